"""The controller of examples/fmu/controller.py as an FMU of FMI 3.0: with units, integers and a boolean."""

import math

from pythonfmu3 import Boolean, Fmi3Causality, Fmi3Slave, Fmi3Variability, Float64, Int64, Unit

MASS, ARM, INERTIA = 0.48, 0.17, (5.6e-3, 5.6e-3, 8.1e-3)
THRUST, TORQUE, COUNT, COUNT_0 = 7.6184e-8, 2.6839e-9, 0.02644518272425249, -27.42857142857143
COUNTS = ["count_0", "count_1", "count_2", "count_3"]


class Controller3(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.register_units([Unit("cm", m=1, factor=0.01), Unit("deg", rad=1, factor=math.pi / 180), Unit("m.s-1", m=1, s=-1)])
        continuous = {"variability": Fmi3Variability.continuous}
        scalars = [("height", "cm"), ("z", "m"), ("climb", "m.s-1"), ("roll", "deg"), ("pitch", "deg"), ("yaw", None)]
        for name, unit in scalars:
            setattr(self, name, 0.0)
            self.register_variable(Float64(name, causality=Fmi3Causality.input, unit=unit, **continuous))
        for name in ("qx", "qy", "qz", "qw", "p", "q", "r"):
            setattr(self, name, 0.0)
            self.register_variable(Float64(name, causality=Fmi3Causality.input, **continuous))
        for name in COUNTS:
            setattr(self, name, 1.0)
            self.register_variable(Float64(name, causality=Fmi3Causality.output, **continuous))
        self.active, self.lift, self.steps = True, 0.0, 0
        self.register_variable(Boolean("active", causality=Fmi3Causality.parameter, variability=Fmi3Variability.tunable))
        self.register_variable(Float64("lift", causality=Fmi3Causality.local, **continuous))
        self.register_variable(Int64("steps", causality=Fmi3Causality.output, variability=Fmi3Variability.discrete))

    def do_step(self, current_time, step_size):
        self.steps += 1
        x, y, z, w = self.qx, self.qy, self.qz, self.qw
        roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
        yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        low = self.height / 100 - self.z
        if self.active and abs(self.climb) <= 0.1:
            self.lift = min(max(self.lift + 3.0 * low * step_size, -2.0), 2.0)
        thrust = MASS * (9.81 + 12.0 * low + self.lift - 6.0 * self.climb) / max(math.cos(roll) * math.cos(pitch), 0.5)
        errors = math.radians(self.roll) - roll, math.radians(self.pitch) - pitch, math.remainder(self.yaw - yaw, math.tau)
        loops = zip(INERTIA, ((16.0, 6.0), (16.0, 6.0), (2.25, 3.0)), errors, (self.p, self.q, self.r))
        x, y, z = (inertia * (gain[0] * error - gain[1] * rate) for inertia, gain, error, rate in loops)
        even, side, spin = 0.25 * thrust / THRUST, 0.5 / (ARM * THRUST), 0.25 * z / TORQUE
        squares = even - side * y + spin, even - side * x - spin, even + side * y + spin, even + side * x - spin
        for name, square in zip(COUNTS, squares):
            setattr(self, name, min(max(COUNT * math.sqrt(max(square, 0.0)) + COUNT_0, 1.0), 200.0))
        return True
