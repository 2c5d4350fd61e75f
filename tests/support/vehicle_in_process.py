"""A scene's models coupled in this process, tracks first, without FMUs, master and log.

The same as `cotrack run` does. For tests that need states, which a log does not hold; a system that no scene file
describes (different drives left and right, another parameter of one part); or many short runs. The numbers are those of
`cotrack run`, to the bit (``test_vehicle_in_process.py``)::

    scene = load("straight", "rigid", ["start.heading=37 deg"])
    vehicle = InProcess(scene, {"left_drive": {"speed.end": 8.0}, "*_track": {"contact.ground.friction": 0.5}})
    vehicle.run(0.2)
    vehicle["chassis"]["yaw"], vehicle["left_track"].model.state

Values of the vehicle's table are settings of the scene (``vehicle.road_wheel.mass=600 kg``). Free parameters of a
component are set by part: ``vehicle["left_drive"].parameters`` holds all of them with their values.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.components import model_of
from orchestrator.scene.assembly import assemble
from orchestrator.scene.kinds import Scene
from orchestrator.scene.parts import Part
from orchestrator.scene.placing import placed

Floats = NDArray[np.float64]
Overrides = Mapping[str, Mapping[str, float | int | str]]


class Member:
    """A running part: its model, its inputs ``u`` of the last step, its outputs ``y``, all by name."""

    def __init__(self, part: Part, overrides: Overrides) -> None:
        self.name, self.kind, self.stage = part.name, part.kind, part.stage
        self.config = json.loads(json.dumps(part.config))  # as a component reads it
        self.model: Any = model_of(part.kind)(self.config)
        real = [port for port in self.model.ports if isinstance(port.start, float)]
        self.inputs = [port.name for port in real if port.causality == "input"]
        outputs = [port.name for port in real if port.causality == "output"]
        count = len(outputs) - self.model.link_ports
        self.outputs, self.links = outputs[:count], outputs[count:]
        ports = self.model.ports
        self.counters = [port.name for port in ports if port.causality == "output" and isinstance(port.start, int)]
        self.parameters = {port.name: port.start for port in self.model.ports if port.causality == "parameter"}
        settings = dict(part.parameters)
        for pattern, values in overrides.items():
            if fnmatchcase(part.name, pattern):
                settings.update(values)
        for name in settings:
            if name not in self.parameters:
                raise KeyError(f"{part.name} has no parameter '{name}'")
        self.parameters |= settings
        self.u = np.array([port.start for port in real if port.causality == "input"])
        self.y = np.zeros(count)
        self._place = {name: k for k, name in enumerate(self.outputs)}
        self.model.initialise(self.parameters)
        self.model.outputs(self.y)

    def step(self, t: float, h: float) -> None:
        """Step from t to t + h with the present inputs; raises StepFailed."""
        self.model.step(t, h, self.u)
        self.model.outputs(self.y)

    def link_outputs(self) -> Floats:
        """Present values of ``links``."""
        y = np.zeros(len(self.links))
        if self.links:
            self.model.link_outputs(y)
        return y

    def __getitem__(self, name: str) -> float:
        """Value of an output, also of link outputs and counters."""
        if name in self._place:
            return float(self.y[self._place[name]])
        if name in self.counters:
            return int(self.model.counters[self.counters.index(name)])
        return float(self.link_outputs()[self.links.index(name)])


class InProcess:
    """The initialised parts of a scene and their coupling."""

    def __init__(self, scene: Scene, overrides: Overrides | None = None) -> None:
        """``overrides``: parameters of parts by name or pattern; raises KeyError if no part matches."""
        self.scene = placed(scene)
        assembly, overrides = assemble(self.scene), overrides or {}
        for pattern in overrides:
            if not any(fnmatchcase(part.name, pattern) for part in assembly.parts):
                raise KeyError(f"no part is called '{pattern}'")
        self.members = {part.name: Member(part, overrides) for part in assembly.parts}
        self.stages = [
            [member for member in self.members.values() if member.stage == stage]
            for stage in sorted({member.stage for member in self.members.values()})
        ]
        self._feeds: dict[str, list[tuple[Member, list[int], list[int]]]] = {name: [] for name in self.members}
        for connection in assembly.connections:
            source, target = self.members[connection.source], self.members[connection.target]
            columns = [source.outputs.index(name) for name in connection.outputs]
            inputs = [target.inputs.index(name) for name in connection.inputs]
            self._feeds[target.name].append((source, columns, inputs))
        self.steps, self.further = 0, 0.0  # steps of the scene's length; time of other steps, s

    @property
    def t(self) -> float:
        """Time reached, s."""
        return self.steps * self.scene.run.step + self.further

    def __getitem__(self, name: str) -> Member:
        return self.members[name]

    def step(self, h: float | None = None, at_once: bool = False) -> None:
        """Make one communication step: motions from its beginning, wrenches from parts that have stepped.

        ``h``: length of a step that is not the scene's, s; ``at_once``: all parts get values of the beginning (Jacobi).
        """
        for stage in [[*self.members.values()]] if at_once else self.stages:
            for member in stage:
                for source, columns, inputs in self._feeds[member.name]:
                    member.u[inputs] = source.y[columns]
            for member in stage:
                member.step(self.t, h or self.scene.run.step)
        if h is None:
            self.steps += 1
        else:
            self.further += h

    def run(self, duration: float) -> InProcess:
        """Make as many steps of the scene as fit in ``duration`` s."""
        for _ in range(round(duration / self.scene.run.step)):
            self.step()
        return self
