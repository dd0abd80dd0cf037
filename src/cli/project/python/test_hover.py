#!/usr/bin/env python3
"""Flies the controller, and looks at the height that it reaches."""

import tempfile
import unittest
from pathlib import Path

import hummingbus as hb

MANIFEST = Path(__file__).resolve().parent.parent / "hover-python.toml"


class HoverTest(unittest.TestCase):
    def test_the_controller_reaches_the_height_that_the_pilot_asks_for(self):
        with tempfile.TemporaryDirectory() as folder:
            path = str(Path(folder) / "hover.mcap")
            outcome = hb.fly(str(MANIFEST), record=path)
            self.assertTrue(outcome.passed, outcome.conditions)
            state = hb.Recording(path).numpy("/plant/state", ["position.z"])
            # The set point steps from 1.0 m to 1.5 m at 1 s.
            settled = state["position.z"][4000:]
            self.assertGreater(len(settled), 1000)
            self.assertLess(abs(settled - 1.5).max(), 0.05)


if __name__ == "__main__":
    unittest.main()
