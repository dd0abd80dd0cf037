"""The law of the controller `pid` as an FMU of FMI 2.0.

Built by PythonFMU: pythonfmu build -f examples/fmu/controller.py -d target/fmu --handle-state --serialize-state
"""

import math

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

SET_POINT = ["altitude", "roll", "pitch", "yaw"]
MOTION = ["z", "climb", "qx", "qy", "qz", "qw", "p", "q", "r"]
COUNTS = ["count_0", "count_1", "count_2", "count_3"]
# vehicles/hummingbird.toml and controllers/gains/pid.toml: kg, m, kg m^2, N and N m for each rpm^2, counts for each rpm.
MASS, ARM, INERTIA = 0.48, 0.17, (5.6e-3, 5.6e-3, 8.1e-3)
THRUST, TORQUE, COUNT, COUNT_0 = 7.6184e-8, 2.6839e-9, 0.02644518272425249, -27.42857142857143
TILT, YAW = (16.0, 6.0), (2.25, 3.0)


class Controller(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        for name in SET_POINT + MOTION:
            setattr(self, name, 0.0)
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        for name in COUNTS:
            setattr(self, name, 1.0)
            self.register_variable(Real(name, causality=Fmi2Causality.output))
        self.altitude_gain = 12.0
        fixed = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.tunable}
        self.register_variable(Real("altitude_gain", **fixed))
        # A value that changes from step to step is a variable, so that it is part of the state that is saved.
        self.lift = 0.0
        self.register_variable(Real("lift", causality=Fmi2Causality.local))

    def do_step(self, current_time, step_size):
        x, y, z, w = self.qx, self.qy, self.qz, self.qw
        roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
        yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        low = self.altitude - self.z
        if abs(self.climb) <= 0.1:
            self.lift = min(max(self.lift + 3.0 * low * step_size, -2.0), 2.0)
        up = self.altitude_gain * low + self.lift - 6.0 * self.climb
        thrust = MASS * (9.81 + up) / max(math.cos(roll) * math.cos(pitch), 0.5)
        errors = self.roll - roll, self.pitch - pitch, math.remainder(self.yaw - yaw, math.tau)
        loops = zip(INERTIA, (TILT, TILT, YAW), errors, (self.p, self.q, self.r))
        x, y, z = (inertia * (gain[0] * error - gain[1] * rate) for inertia, gain, error, rate in loops)
        even, side, spin = 0.25 * thrust / THRUST, 0.5 / (ARM * THRUST), 0.25 * z / TORQUE
        squares = even - side * y + spin, even - side * x - spin, even + side * y + spin, even + side * x - spin
        for name, square in zip(COUNTS, squares):
            setattr(self, name, min(max(COUNT * math.sqrt(max(square, 0.0)) + COUNT_0, 1.0), 200.0))
        return True
