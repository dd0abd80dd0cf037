"""Simulations that Python steps: a manifest's components on this thread, without processes, bit for bit the same."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from . import _native
from ._messages import dtype
from ._program import toml

# Ticks are 32-bit numbers.
_TICKS_MAX = 2**32 - 1


class Simulation:
    """A simulation of a manifest, before tick 0.

        simulation = hummingbus.Simulation("manifests/hover.toml", set={"run.seed": 7})
        simulation.step(1000)
        height_m = float(simulation.read("/plant/state")["position"]["z"])

    A process of kind `agent` is whoever steps the simulation: it sends on its outputs `command`, `set_point` or `reference`
    what `act` has set last. `text` is a manifest without a file, whose paths begin in the working directory.
    """

    def __init__(
        self,
        manifest: str | os.PathLike[str] | None = None,
        *,
        text: str | None = None,
        set: Mapping[str, Any] | None = None,
    ):
        if (manifest is None) == (text is None):
            raise TypeError("give either the path of a manifest or its text")
        path = "simulation.toml" if manifest is None else os.fspath(manifest)
        if text is None:
            try:
                text = Path(path).read_text()
            except OSError as error:
                raise _native.Error(f"cannot read {path}: {error.strerror}") from error
        overrides = [f"{key}={toml(value)}" for key, value in (set or {}).items()]
        self._native = _native.Simulation(text, path, overrides)

    @property
    def tick(self) -> int:
        """The next tick."""
        return self._native.tick

    @property
    def time_s(self) -> float:
        """Simulation time at the start of the next tick."""
        return self._native.time_s

    def step(self, ticks: int = 1) -> None:
        """Computes so many ticks."""
        if not 0 <= ticks <= _TICKS_MAX:
            raise _native.Error(f"step: expected 0 to {_TICKS_MAX} ticks, found {ticks}")
        self._native.step(ticks)

    def act(self, agent: str, **messages: np.ndarray) -> None:
        """Has a process of kind `agent` send these messages, by the names of its outputs, from now on."""
        for output, message in messages.items():
            self._native.act(agent, output, message.tobytes())

    def read(self, topic: str) -> np.ndarray | None:
        """A copy of the newest message of `topic`; `None` before the first one."""
        type_name, message = self._native.newest(topic)
        if message is None:
            return None
        return np.ndarray((), dtype(type_name), message)

    def save(self) -> _native.Saved:
        """The state before the next tick, from which this or another simulation of the same manifest goes on."""
        return self._native.save()

    def restore(self, saved: _native.Saved) -> None:
        """Goes on from a saved state."""
        self._native.restore(saved)
