"""Draws docs/img/hover.png from a recording of manifests/hover.toml.

Usage: python3 scripts/plot_hover.py HUMMINGBUS hover.mcap docs/img/hover.png   (needs matplotlib)
"""

import json
import math
import subprocess
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt


def series(binary, recording, topic, fields):
    """Times in seconds and one list of values for each field of a topic."""
    lines = subprocess.run(
        [binary, "cat", recording, "--topic", topic], check=True, capture_output=True, text=True
    ).stdout.splitlines()
    messages = [json.loads(line) for line in lines]
    times = [message["time_ns"] * 1e-9 for message in messages]
    return times, [[message["fields"][field] for message in messages] for field in fields]


def roll_deg(x, y, z, w):
    return math.degrees(math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)))


def main(binary, recording, picture):
    quaternion = [f"attitude.{part}" for part in "xyzw"]
    speeds = [f"rotor_speed[{rotor}]" for rotor in range(4)]
    t, (z, *rest) = series(binary, recording, "/plant/state", ["position.z", *quaternion, *speeds])
    asked_t, (asked_z, asked_roll) = series(binary, recording, "/pilot/set_point", ["altitude", "roll"])
    estimate_t, (estimate,) = series(binary, recording, "/attitude/estimate", ["roll"])

    figure, (top, middle, bottom) = plt.subplots(3, 1, sharex=True, figsize=(9, 7.5), layout="constrained")
    top.plot(t, z, label="altitude")
    top.plot(asked_t, asked_z, "k--", linewidth=1, label="set point")
    top.set_ylabel("altitude [m]")
    middle.plot(t, [roll_deg(*q) for q in zip(*rest[:4])], label="roll")
    middle.plot(estimate_t, [math.degrees(roll) for roll in estimate], linewidth=0.8, label="estimated roll")
    middle.plot(asked_t, [math.degrees(roll) for roll in asked_roll], "k--", linewidth=1, label="set point")
    middle.set_ylabel("roll [deg]")
    for name, speed in zip(["front", "right", "rear", "left"], rest[4:]):
        bottom.plot(t, [value * 30 / math.pi for value in speed], linewidth=1, label=name)
    bottom.set_ylabel("rotor speed [rpm]")
    bottom.set_xlabel("simulated time [s]")
    for axes in (top, middle, bottom):
        axes.grid(alpha=0.3)
        axes.legend(loc="upper right", fontsize=8)
    top.set_title("AscTec Hummingbird: 1.0 → 1.5 m, then a 10° roll doublet")
    figure.savefig(picture, dpi=110)


if __name__ == "__main__":
    main(*sys.argv[1:])
