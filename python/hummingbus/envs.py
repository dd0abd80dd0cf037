"""Environments of gymnasium on simulations: for controllers that are learned. `pip install gymnasium`."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from . import _native
from ._messages import message, set_values, vector
from ._simulations import Simulation

_HOVER = """
[run]
duration_s = 3600.0
[process.plant]
kind = "plant"
vehicle = {vehicle}
inputs.command = {{ topic = "/agent/command", delay_ticks = 1, initial = {{ command = {hover} }} }}
[process.agent]
kind = "agent"
outputs.command = {{}}
"""


class HoverEnv(gymnasium.Env):
    """Hold a place in the air with the commands of the rotors, from a start nearby.

    `vehicle` is a vehicle file with any number of rotors; without it, the Hummingbird flies. An action is a number from -1 to 1
    for each rotor: its command is `hover + span * action`, in the unit of the vehicle file, for `action_ticks` ms. Without
    these two, `hover` is the command at which the vehicle hovers, and `span` a fifth of the range of its commands. An observation is 13 doubles: the way to the target (m), velocity (m/s), attitude (quaternion
    x, y, z, w), and angular velocity in the body (rad/s). The reward of a step lies between -1 and 1: 1 at rest at the target.
    An episode ends when the vehicle is farther than 2 m from the target, lies below the ground or on its side.
    """

    metadata = {"render_modes": []}

    def __init__(
        self,
        vehicle: str | os.PathLike[str] | None = None,
        *,
        hover: float | None = None,
        span: float | None = None,
        action_ticks: int = 10,
        duration_s: float = 10.0,
        target_m: tuple[float, float, float] = (0.0, 0.0, 1.0),
        start_within_m: float = 0.5,
    ):
        self._folder = tempfile.TemporaryDirectory(prefix="hummingbus-env-")
        if vehicle is None:
            vehicle = Path(self._folder.name) / "hummingbird.toml"
            vehicle.write_text(_native.REFERENCE_VEHICLE)
        rotors, at_hover, least, most = _native.motors(vehicle)
        self._hover = at_hover if hover is None else hover
        self._span = (most - least) / 5.0 if span is None else span
        self._text = _HOVER.format(vehicle=_quoted(os.path.abspath(vehicle)), hover=[self._hover] * rotors)
        self._rotors = rotors
        self._action_ticks, self._duration_s = action_ticks, duration_s
        self._target, self._start_within = np.array(target_m), start_within_m
        self._command = message("MotorCommand").zeros()
        self._simulation: Simulation | None = None
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (rotors,), np.float64)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (13,), np.float64)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        """Begins an episode. `options["position_m"]` states the start, which is drawn otherwise."""
        super().reset(seed=seed)
        drawn = self._target + self.np_random.uniform(-self._start_within, self._start_within, 3)
        position = np.array((options or {}).get("position_m", drawn), float)
        self._simulation = Simulation(text=self._text, set={"process.plant.parameters.initial_position_m": position})
        self._act(self._simulation, np.zeros(self._rotors))
        self._simulation.step(1)
        return self._observed(self._simulation), {"time_s": self._simulation.time_s}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Flies `action_ticks` with the commands of `action`."""
        if self._simulation is None:
            raise _native.Error("the environment was not reset")
        self._act(self._simulation, np.clip(action, -1.0, 1.0))
        self._simulation.step(self._action_ticks)
        observation, time_s = self._observed(self._simulation), self._simulation.time_s
        away, speed, spin = (float(np.linalg.norm(observation[part])) for part in (slice(3), slice(3, 6), slice(10, 13)))
        x, y = observation[6], observation[7]
        upright = 1.0 - 2.0 * (x * x + y * y)
        is_over = away > 2.0 or upright < 0.0 or self._target[2] - observation[2] < 0.0
        reward = -1.0 if is_over else 1.0 - min(2.0, 0.5 * away + 0.1 * speed + 0.05 * spin)
        return observation, reward, is_over, time_s >= self._duration_s, {"time_s": time_s}

    def close(self) -> None:
        """Removes the folder of the environment."""
        self._folder.cleanup()

    def _act(self, simulation: Simulation, action: np.ndarray) -> None:
        set_values(self._command["command"], self._hover + self._span * action)
        simulation.act("agent", command=self._command)

    def _observed(self, simulation: Simulation) -> np.ndarray:
        state = simulation.read("/plant/state")
        if state is None:
            raise _native.Error("the plant has sent no state")
        parts = (self._target - vector(state["position"]), *(vector(state[name]) for name in ("velocity", "attitude", "angular_velocity")))
        return np.concatenate(parts)


# For `gymnasium.make` and `make_vec`, once this module is imported.
gymnasium.register("hummingbus/Hover-v0", entry_point="hummingbus.envs:HoverEnv")


def _quoted(text: str) -> str:
    """A text as TOML writes it."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
