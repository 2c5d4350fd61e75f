"""Models in static equilibrium under a dead load that grows with time: a cantilever (the elastica), an L-frame."""

from __future__ import annotations

import numpy as np

from fmus.physics.ancf import beam
from fmus.physics.arrays import Floats
from orchestrator.scene import tables
from orchestrator.without_fmu import meshes
from orchestrator.without_fmu.ancf import loads, statics
from orchestrator.without_fmu.ancf.mesh import Mesh
from orchestrator.without_fmu.models import xyz

CLOSE = 1e-11  # last correction of Newton's iteration, m


class Bent:
    """A mesh under ``rate`` times t of its loads."""

    outputs = {"load": "N"} | xyz("tip.displacement", "m") | {"energy.strain": "J", "energy.work": "J"}

    def __init__(self, mesh: Mesh, tip: tuple[int, int], full: float, rate: float) -> None:
        self.mesh, self.tip, self.full, self.rate = mesh, tip, full, rate
        self.q = self.start = mesh.start()
        self.load = self.work = 0.0  # N, J
        self.count = len(meshes.points(mesh, self.q))
        self.counters = np.zeros(4, np.int32)

    def advance(self, t: float, h: float) -> None:
        """The equilibrium at t + h from that at t."""
        found = statics.newton(self.mesh, self.q, self.rate * (t + h), CLOSE)
        if found is None:
            force = self.full * self.rate * (t + h)
            raise ArithmeticError(f"Newton: no equilibrium found under {force:.6g} N, take shorter steps")
        before, f = self.q, self.mesh.applied(self.q)
        self.q = found[0]
        self.work += self.rate * (t + 0.5 * h) * float(f @ (self.q - before))  # trapezoids: the load is dead
        self.load = self.full * self.rate * (t + h)
        self.counters += 1, found[1], found[1], 0

    def values(self) -> Floats:
        """Load, tip and energies."""
        moved = self.mesh.end(self.q, self.tip)[0] - self.mesh.end(self.start, self.tip)[0]
        return np.array([self.load, *moved, self.mesh.energy(self.q), self.work])

    def points(self) -> Floats:
        """The nodes."""
        return meshes.points(self.mesh, self.q)


class Cantilever(Bent):
    """Cable elements of L = 1 m and EI = 1 N m2 under 1 N times rate times t."""

    def __init__(self, p: tables.Cantilever) -> None:
        mesh = meshes.cantilever(meshes.ELASTICITIES[p.elasticity], p.elements, p.slenderness)
        tip = (p.elements - 1, 1)
        self.about = f"{p.elements} cable elements ({p.elasticity}), {mesh.n} dofs"
        super().__init__(mesh.loaded(loads.point_force(mesh, tip, [0, 0, 1])), tip, 1.0, p.load_rate)


class Frame(Bent):
    """Two members of beams or cables, rigidly joined."""

    def __init__(self, p: tables.Frame) -> None:
        kind = beam if p.element == "beam" else meshes.ELASTICITIES[p.element]
        mesh, _ = meshes.frame(kind, p.elements, p.height, p.corner)
        self.about = f"2 x {p.elements} elements ({p.element}), {mesh.n} dofs"
        super().__init__(mesh, (2 * p.elements - 1, 1), meshes.frame_load(p.height), 1.0 / p.load_time)
