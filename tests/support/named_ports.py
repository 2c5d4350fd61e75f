"""Variables of a component's model by name."""

import numpy as np


def parameters(model, **changes):
    """Start values of all parameters, with changes."""
    return {port.name: port.start for port in model.ports if port.causality == "parameter"} | changes


def output_names(model):
    """Names of the Real outputs; those of links are the last ``model.link_ports``."""
    return [port.name for port in model.ports if port.causality == "output" and isinstance(port.start, float)]


def outputs(model, links=True):
    """Values of the Real outputs by name; without ``links`` those of the links are left out."""
    names = output_names(model)
    y = np.zeros(len(names))
    own = len(y) - model.link_ports
    model.outputs(y[:own])
    if links and own < len(y):
        model.link_outputs(y[own:])
    return dict(zip(names, y if links else y[:own], strict=links))


class Probe:
    """A model whose variables are read and set by name; inputs that are not set keep their start values."""

    def __init__(self, model, **parameters):
        """Initialise with parameters, in whose names __ may stand for a dot."""
        inputs = [port for port in model.ports if port.causality == "input" and isinstance(port.start, float)]
        self.model, self.names, self.t = model, output_names(model), 0.0
        self.u, self.y = np.array([port.start for port in inputs]), np.zeros(len(self.names))
        self.inputs = {port.name: k for k, port in enumerate(inputs)}
        self._given = {name: k for k, name in enumerate(self.names)}
        model.initialise({name.replace("__", "."): value for name, value in parameters.items()})

    def __setitem__(self, name, value):
        self.u[self.inputs[name]] = value

    def give(self, name, values, axes="xyz"):
        """Set the input of a vector."""
        for axis, value in zip(axes, values, strict=True):
            self[f"{name}.{axis}"] = value

    def __getitem__(self, name):
        self.model.outputs(self.y)
        if name in self._given:
            return self.y[self._given[name]]
        axes = "wxyz" if name.endswith("orientation") else "xyz"
        return self.y[[self._given[f"{name}.{axis}"] for axis in axes]]

    def step(self, h=1e-3):
        self.model.step(self.t, h, self.u)
        self.t += h
        return self

    def run(self, duration, h=1e-3, **inputs):
        """Make steps of ``h`` s, each with ``inputs`` where a probe takes some."""
        for _ in range(round(duration / h)):
            self.step(h, **inputs)
        return self
