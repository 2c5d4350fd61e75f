"""Models that move by themselves: a very flexible pendulum, a mass that slides along a beam."""

from __future__ import annotations

import numpy as np

from fmus.physics.ancf.cable import Cable
from fmus.physics.arrays import Floats
from orchestrator.scene import tables
from orchestrator.without_fmu import meshes
from orchestrator.without_fmu.ancf import dynamics, sliding
from orchestrator.without_fmu.models import xyz

STAGES = 4  # of Runge-Kutta


ENERGIES = {f"energy.{kind}": "J" for kind in ("kinetic", "strain", "gravity")}


class Pendulum:
    """A cable pinned at its first node."""

    outputs = xyz("tip.position", "m") | ENERGIES

    def __init__(self, p: tables.Pendulum) -> None:
        kind = meshes.ELASTICITIES[p.elasticity]
        c = meshes.round_cable(p.length / p.elements, p.area, p.youngs_modulus, p.density)
        self.mesh, q, v = meshes.rotating(kind, c, p.elements, p.spin, p.gravity)
        self.q, self.v, self.h = q, v, p.step
        self.tip = (p.elements - 1, 1)
        self.count = p.elements + 1
        self.counters = np.zeros(4, np.int32)
        self.about = f"{p.elements} cable elements ({p.elasticity}), {self.mesh.n} dofs"

    def advance(self, t: float, h: float) -> None:
        """Runge-Kutta in equal steps."""
        n = int(np.ceil(h / self.h - 1e-9))
        for _, q, v in dynamics.runge_kutta(self.mesh, self.q, self.v, h / n, n):
            moment = q, v
        self.q, self.v = moment[0].copy(), moment[1].copy()
        self.counters[:2] += n, STAGES * n

    def values(self) -> Floats:
        """Tip and energies; gravity's is nothing at the start."""
        m, lift = self.mesh, -self.mesh.applied(self.q) @ (self.q - self.mesh.start())
        return np.array([*m.end(self.q, self.tip)[0], m.kinetic(self.v), m.energy(self.q), lift])

    def points(self) -> Floats:
        """Its nodes."""
        return meshes.points(self.mesh, self.q)


class Slider:
    """A mass on a rail."""

    outputs = xyz("mass.position", "m") | {"place": "m", "constraint": "m"} | ENERGIES

    def __init__(self, p: tables.Slider) -> None:
        c = Cable(p.length / p.elements, p.line_density, p.axial_stiffness, p.bending_stiffness, 0.0, 0.0)
        self.bodies, self.rail, self.state = meshes.rope("point", p.elements, p.place, c, p.mass, p.gravity)
        self.h, self.spots = p.step, np.linspace(0.0, p.length, 4 * p.elements + 1)
        self.count = len(self.spots) + 1
        self.counters = np.zeros(4, np.int32)
        self.about = f"{p.elements} cable elements on a cubic spline and a mass, {self.bodies.free.sum() - 2} dofs"

    def advance(self, t: float, h: float) -> None:
        """The energy-keeping step of the sliding joint."""
        n = int(np.ceil(h / self.h - 1e-9))
        for _ in range(n):
            self.state = sliding.step(self.bodies, self.rail, self.state, h / n)
        self.counters[0] += n

    def values(self) -> Floats:
        """The mass, its place along the beam, how far it is off the beam, energies."""
        s = self.state
        off = np.abs(sliding.constraint(self.rail, s.X, s.w)).max()
        return np.array([*(self.rail.point @ s.X), s.w[0], off, *sliding.energy(self.bodies, s)])

    def points(self) -> Floats:
        """Along the beam, and the mass."""
        beam = [sliding.row(self.rail, u, 0) @ self.state.X for u in self.spots]
        return np.array([*beam, self.rail.point @ self.state.X])
