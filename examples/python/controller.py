#!/usr/bin/env python3
"""The law of the controller `pid` in numpy. It takes over from `pid` in flight, and `pid` from it: both have the same state."""

import math

import hummingbus as hb
import numpy as np


class Controller(hb.Component):
    inputs = {"set_point": "SetPoint", "estimate": "StateEstimate"}
    outputs = {"command": "MotorCommand"}
    state = "ControllerState"

    def __init__(self, node):
        given, self.period_s = node.parameters, node.period_s
        self.mass, self.inertia = given["mass_kg"], given["inertia_kg_m2"]
        thrust, torque = given["rotor"]  # N and N*m for each rpm^2
        side, spin = 0.5 / (given["arm_m"] * thrust), 0.25 / torque
        # Front, right, rear, left: squared speeds for thrust and for the torques about x, y and z.
        even = 0.25 / thrust
        self.mix = np.array([[even, 0, -side, spin], [even, -side, 0, -spin], [even, 0, side, spin], [even, side, 0, -spin]])
        self.counts = given["counts"]  # for each rpm, and at 0 rpm
        self.altitude, self.tilt, self.yaw = given["altitude"], given["tilt"], given["yaw"]
        self.id = np.frombuffer(b"python".ljust(24, b"\0"), np.uint8)

    def step(self, tick, set_point, estimate, command, state):
        x, y, z, w = estimate["attitude"].item()
        roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        pitch = math.asin(2 * (w * y - z * x))
        yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        _, altitude, *asked = set_point.item()
        climb, low = float(estimate["velocity"]["z"]), altitude - float(estimate["position"]["z"])
        lift = float(state["integrals"]["lift"])
        if abs(climb) <= 0.1:
            lift = min(max(lift + self.altitude[1] * low * self.period_s, -2.0), 2.0)
        up = self.altitude[0] * low + lift - self.altitude[2] * climb
        thrust = self.mass * (9.81 + up) / max(math.cos(roll) * math.cos(pitch), 0.5)
        errors = asked[0] - roll, asked[1] - pitch, math.remainder(asked[2] - yaw, math.tau)
        loops = zip(self.inertia, (self.tilt, self.tilt, self.yaw), errors, estimate["angular_velocity"].item())
        torque = [inertia * (gain[0] * error - gain[2] * rate) for inertia, gain, error, rate in loops]
        state["integrals"]["lift"], state["thrust"], state["torque"] = lift, thrust, torque
        state["id"]["name"] = self.id
        squares = self.mix.dot((thrust, *torque))
        counts = self.counts[0] * np.sqrt(np.maximum(squares, 0.0)) + self.counts[1]
        hb.set_values(command["command"], np.minimum(np.maximum(counts, 1.0), 200.0))


if __name__ == "__main__":
    hb.run_node(Controller)
