import numpy as np

from fmus.interface.model import InvalidParameter, StepFailed
from fmus.interface.ports import Port
from toy.kernels import advance


class Model:
    step_kernel = advance
    link_ports = 3
    indices = ()

    def __init__(self, config):
        self.config = config
        self.ports = (
            Port("force", "input", "N", "force on the mass"),
            *(Port(f"spare[{i}]", "input", "m", "an input that nobody reads") for i in range(1, config["spare"] + 1)),
            Port("x", "output", "m", "position"),
            Port("v", "output", "m/s", "velocity"),
            *(Port(f"copy[{i}]", "output", "m", "the position again") for i in range(1, config["spare"] + 1)),
            *(Port(f"link[{i}].tension", "output", "N", "tension of a part of the spring") for i in (1, 2, 3)),
            Port("solver.steps", "output", "1", "internal steps", 0),
            Port("start.x", "parameter", "m", "position at the start", config["start"]),
            Port("stiffness", "parameter", "N/m", "stiffness", 100.0),
            Port("damping", "parameter", "N.s/m", "damping", 0.1),
            Port("substeps", "parameter", "1", "internal steps in a step", 4),
            Port("trouble", "parameter", "1", "what goes wrong", "none", ("none", "raise", "nan", "zero", "warn")),
        )
        self.state = np.zeros(2)
        self.counters = np.zeros(1, dtype=np.int64)
        self._warnings = []

    def initialise(self, parameters):
        if parameters["stiffness"] < 0.0:
            raise InvalidParameter(f"stiffness = {parameters['stiffness']}: 100 % of springs push back")
        self.parameters = parameters
        self.state[:] = parameters["start.x"], 0.0
        self.counters[:] = 0

    def step(self, t, h, u):
        p, n = self.parameters, self.parameters["substeps"]
        if p["trouble"] == "warn" or self.config.get("creaks"):
            self._warnings.append("the spring creaks at 5 % of its load")
        self.counters += n
        advance(self.state, n, h / n, p["stiffness"], p["damping"], u[0])
        if t > 0.0045 and p["trouble"] == "raise":
            raise StepFailed(f"the spring broke at t = {t} s")
        if t > 0.0045 and p["trouble"] == "zero":
            1 / 0  # noqa: B018
        if t > 0.0045 and p["trouble"] == "nan":
            self.state[1] = np.nan

    def outputs(self, y):
        y[:2] = self.state
        y[2:] = self.state[0]

    def link_outputs(self, y):
        y[:] = self.parameters["stiffness"] * self.state[0] * np.array([1.0, 2.0, 3.0])

    def warnings(self):
        messages, self._warnings = self._warnings, []
        return messages
