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
        self.mass, inertias = given["mass_kg"], given["inertia_kg_m2"]
        thrust, torque = given["rotor"]  # N and N*m for each rpm^2
        slope, offset = given["counts"]  # counts for each rpm, and at 0 rpm
        even, side, spin = 0.25 / thrust, 0.5 / (given["arm_m"] * thrust), 0.25 / torque
        # Front, right, rear, left: squared counts above the offset for thrust and for the torques about x, y and z.
        mix = [[even, 0, -side, spin], [even, -side, 0, -spin], [even, 0, side, spin], [even, side, 0, -spin]]
        self.mix = slope**2 * np.array(mix)
        self.offset, self.least, self.most = offset, (1 - offset) ** 2, (200 - offset) ** 2
        self.wrench = np.zeros(4)  # memory for thrust and torque, set before each use
        self.altitude = given["altitude"]
        gains = (given["tilt"], given["tilt"], given["yaw"])
        self.stiffness = [inertia * gain[0] for inertia, gain in zip(inertias, gains)]
        self.damping = [inertia * gain[2] for inertia, gain in zip(inertias, gains)]
        self.id = np.frombuffer(b"python".ljust(24, b"\0"), np.uint8)

    def step(self, tick, set_point, estimate, command, state):
        x, y, z, w = estimate["attitude"].item()
        roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        pitch = math.asin(2 * (w * y - z * x))
        yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        _, altitude, roll_asked, pitch_asked, yaw_asked = set_point.item()
        climb, low = estimate["velocity"]["z"].item(), altitude - estimate["position"]["z"].item()
        integrals, (proportional, integral, derivative) = state["integrals"], self.altitude
        lift = integrals["lift"].item()
        if abs(climb) <= 0.1:
            lift = min(max(lift + integral * low * self.period_s, -2.0), 2.0)
        up = proportional * low + lift - derivative * climb
        thrust = self.mass * (9.81 + up) / max(math.cos(roll) * math.cos(pitch), 0.5)
        p, q, r = estimate["angular_velocity"].item()
        stiffness, damping = self.stiffness, self.damping
        torque = (
            stiffness[0] * (roll_asked - roll) - damping[0] * p,
            stiffness[1] * (pitch_asked - pitch) - damping[1] * q,
            stiffness[2] * math.remainder(yaw_asked - yaw, math.tau) - damping[2] * r,
        )
        integrals["lift"], state["thrust"], state["id"]["name"] = lift, thrust, self.id
        # Number by number: numpy takes twice as long to take a tuple apart.
        wrench, stated = self.wrench, state["torque"]
        wrench[0], wrench[1], wrench[2], wrench[3] = thrust, *torque
        stated[0], stated[1], stated[2] = torque
        offset, least, most = self.offset, self.least, self.most
        sent = command["command"]
        sent["count"], values = 4, sent["values"]
        for rotor, square in enumerate(self.mix.dot(wrench).tolist()):
            values[rotor] = math.sqrt(least if square < least else most if square > most else square) + offset


if __name__ == "__main__":
    hb.run_node(Controller)
