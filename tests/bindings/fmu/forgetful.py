"""An FMU of FMI 2.0 that says it saves its state, and leaves its integral out of it."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Forgetful(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.y, self.integral = 0.0, 0.0, 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        if self.u > 1e6:
            raise ValueError(f"u is {self.u}, which no sensor measures")
        self.integral += self.u * step_size
        self.y = self.integral
        return True
