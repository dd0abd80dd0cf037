#!/usr/bin/env python3
"""A controller of height, roll and pitch, as a program of its own."""

# If this import fails, make the environment again, as README.md says: @environment@
import hummingbus as hb


def tilt_rad(attitude):
    """Roll and pitch (positive nose down) of an attitude near level."""
    x, y, z, w = attitude.item()
    return 2 * (w * x + y * z), 2 * (w * y - z * x)


def law(gains, error, rate):
    return gains[0] * error - gains[1] * rate


class Controller(hb.Component):
    """Its state is empty: each command follows from the inputs of the same tick."""

    inputs = {"set_point": "SetPoint", "estimate": "StateEstimate"}
    outputs = {"command": "MotorCommand"}

    def __init__(self, node):
        # The table `parameters` of the manifest. The defaults are tuned for the vehicle file of this project.
        given = node.parameters
        # Command at which the vehicle hovers, in counts.
        self.hover = given.get("hover", 76.5)
        # Counts per metre of height error, and per metre a second of climb.
        self.altitude = given.get("altitude", [63.6, 31.8])
        # Counts per radian of roll or pitch error, and per radian a second of rate.
        self.tilt = given.get("tilt", [11.6, 4.4])
        # Counts per radian a second of yaw rate.
        self.yaw_rate = given.get("yaw_rate", 5.0)

    def step(self, tick, set_point, estimate, command):
        error_m = float(set_point["altitude"]) - float(estimate["position"]["z"])
        lift = self.hover + law(self.altitude, error_m, float(estimate["velocity"]["z"]))
        roll_rad, pitch_rad = tilt_rad(estimate["attitude"])
        rate = estimate["angular_velocity"].item()
        roll = law(self.tilt, float(set_point["roll"]) - roll_rad, rate[0])
        pitch = law(self.tilt, float(set_point["pitch"]) - pitch_rad, rate[1])
        yaw = -self.yaw_rate * rate[2]
        # Rotors in the order of the vehicle file: front, right, rear, left. A positive roll lifts the left side, a
        # positive pitch the rear. The drag of the clockwise rotors, front and rear, yaws to the left.
        parts = yaw - pitch, -yaw - roll, yaw + pitch, -yaw + roll
        hb.set_values(command["command"], [lift + part for part in parts])


if __name__ == "__main__":
    hb.run_node(Controller)
