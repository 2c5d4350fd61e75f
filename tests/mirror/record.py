"""Record of a run: states, inputs and outputs of every component at every communication point."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vehicle_in_process import InProcess, Member

Floats = NDArray[np.float64]


class Part:
    """Record of a component: K steps, K + 1 instants, the first at the start."""

    def __init__(self, member: Member, scene: Any) -> None:
        self.scene = scene
        self.name, self.kind, self.config, self.parameters = member.name, member.kind, member.config, member.parameters
        self.inputs = {name: k for k, name in enumerate(member.inputs)}
        self.outputs = {name: k for k, name in enumerate([*member.outputs, *member.links, *member.counters])}
        self.start_values = np.array([port.start for port in member.model.ports if port.causality == "input"])
        self._u: list[Floats] = []
        self._y: list[Floats] = []
        self._x: list[Floats] = []

    def append(self, member: Member, first: bool) -> None:
        if not first:
            self._u.append(member.u.copy())
        self._y.append(np.concatenate([member.y, member.link_outputs(), member.model.counters.astype(float)]))
        self._x.append(member.model.state.copy())

    def finish(self, t: Floats) -> None:
        self.t, self.h = t, np.diff(t)
        self.u, self.y, self.state = np.array(self._u), np.array(self._y, order="F"), np.array(self._x)

    def __getitem__(self, name: str) -> Floats:
        """An output at all instants (K + 1)."""
        return self.y[:, self.outputs[name]]

    def input_values(self, name: str) -> Floats:
        """An input in all steps (K)."""
        return self.u[:, self.inputs[name]]

    def vector(self, name: str, axes: str = "xyz") -> Floats:
        """Outputs ``name.x`` and so on (K + 1, 3)."""
        return np.stack([self[f"{name}.{axis}"] for axis in axes], axis=-1)

    def input_vectors(self, name: str, axes: str = "xyz") -> Floats:
        """Inputs ``name.x`` and so on (K, 3)."""
        return np.stack([self.input_values(f"{name}.{axis}") for axis in axes], axis=-1)

    @contextmanager
    def replaced_outputs(self, names: Sequence[str], fault: Callable[[Floats], Floats]):
        """Replace outputs by faulty values within the context."""
        columns = [self.outputs[name] for name in names]
        original = self.y[:, columns]
        self.y[:, columns] = fault(original)
        yield
        self.y[:, columns] = original


class Record:
    """A run: the records of all its components."""

    def __init__(self, system: InProcess, duration: float) -> None:
        self.scene = system.scene
        self.parts = {name: Part(member, system.scene) for name, member in system.members.items()}
        times = [system.t]
        self._note(system, True)
        for _ in range(round(duration / system.scene.run.step)):
            system.step()
            times.append(system.t)
            self._note(system, False)
        for part in self.parts.values():
            part.finish(np.array(times))

    def _note(self, system: InProcess, first: bool) -> None:
        for name, member in system.members.items():
            self.parts[name].append(member, first)

    def __getitem__(self, name: str) -> Part:
        return self.parts[name]
