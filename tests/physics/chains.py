"""Chains without ports, run by the kernels of the tracks: no wheels, no ground, free or held ends."""

from __future__ import annotations

import numpy as np

from fmus.physics.ancf.cable import Cable, mass
from fmus.physics.block_cyclic import factor, solve
from fmus.physics.chain.explicit import slopes
from fmus.physics.chain.flexible import cables
from fmus.physics.chain.flexible.assembly import evaluate
from fmus.physics.chain.flexible.cables import gather
from fmus.physics.chain.flexible.condensation import correct
from fmus.physics.chain.flexible.dynamics import accelerations
from fmus.physics.chain.flexible.initial_state import factor_mass
from fmus.physics.chain.flexible.link_layout import straight
from fmus.physics.chain.flexible.state import Motion, State
from fmus.physics.chain.flexible.state import shapes as flexible_shapes
from fmus.physics.chain.flexible.state import work as flexible_work
from fmus.physics.chain.implicit import ImplicitMethod
from fmus.physics.chain.integration import HELD, LOOP, Environment
from fmus.physics.chain.interface import observe
from fmus.physics.chain.report import COUNTERS, GRAVITY, KINETIC, REPORT
from fmus.physics.chain.state import size, store_first_evaluation, views
from fmus.physics.integrate import adams, dormand_prince, generalized_alpha, hht, runge_kutta
from fmus.physics.integrate.generalized_alpha import Slopes, coefficients
from fmus.track import steps as track_steps
from tests.validation.rods import EXPLICIT, IMPLICIT, P, Rods, of_angles  # noqa: F401 - for tests

AREA, SECOND = 0.01516, 2.03e-6  # of a link's section
STEEL = Cable(P, 7800 * AREA, 2e11 * AREA, 2e11 * SECOND, 0.0, 0.0)
INTEGRATORS = {  # with their orders
    "generalized_alpha": generalized_alpha.order,
    "hht": hht.order,
    "runge_kutta": runge_kutta.RK4.order,
    "adams": adams.order,
    "dormand_prince": dormand_prince.order,
}
NO_INPUTS = np.zeros(0)


def line(n: int, pitch: float = P, along: tuple[float, float] = (1.0, 0.0)) -> np.ndarray:
    """Pins (n + 1, 2), m, of a straight chain from the origin."""
    return pitch * np.arange(n + 1)[:, None] * np.array(along)


def ring(n: int, pitch: float = P) -> np.ndarray:
    """Pins (n, 2), m, of a regular polygon round the origin."""
    angle = -2.0 * np.pi * np.arange(n) / n
    return pitch / (2.0 * np.sin(np.pi / n)) * np.stack([np.cos(angle), np.sin(angle)], axis=1)


class Rigid(Rods):
    """Chain of rigid links; the first pin held or not, the last one free."""

    def factor(self):
        assert factor_mass(self.links, self.env, self.s, self.w) == -1

    def run(self, time, h, integrator="generalized_alpha"):
        if integrator == "hht":
            self.method = self.method._replace(alpha=hht.coefficients(0.8))
        return super().run(time, h, EXPLICIT if integrator == "runge_kutta" else IMPLICIT)

    def release(self):
        super().release()
        return self


class Flexible:
    """Chain of cable links; the first pin held or not, the last one free."""

    def __init__(self, pins, held=False, closed=False, gravity=9.81, cable=STEEL, radius=0.8):
        self.env = Environment((0.0, 0.0, -gravity), HELD if held else LOOP, np.zeros((2, 3)), 0.0, -1)
        self.report, self.counters = np.zeros(REPORT), np.zeros(COUNTERS, np.int64)
        n, nodes = (len(pins) if closed else len(pins) - 1), len(pins)
        self.links = cables.Cables(n, int(closed), cable, 0.029, 0.02, AREA, SECOND)
        self.method = ImplicitMethod(coefficients(radius), 1e-12, True)
        sizes = flexible_shapes(cables.NODE, nodes, 0)
        self.s, self.w = views(State, sizes, np.zeros(size(sizes))), flexible_work(cables, n, nodes, 0)
        self.place(np.asarray(pins, float))

    def place(self, pins):
        straight(cables, self.links, pins, self.s.q)

    def evaluate(self, vdot=None, by_acceleration=0.0):
        """Evaluate the residual and the matrix at rest."""
        x = Motion(self.s.q, self.w.still, self.w.still if vdot is None else vdot)
        evaluate(self.links, None, self.env, x, Slopes(0.0, 0.0, by_acceleration), self.w, True)

    def solve(self):
        w = self.w
        assert factor(w.diagonal, w.upper, w.lower, w.factors, bool(self.links.closed)) < 0
        solve(w.diagonal, w.upper, w.factors, bool(self.links.closed), w.right_side)

    def correct(self, vdot, by_acceleration=0.0):
        """Apply the correction in ``w.right_side`` at rest; return the largest change of a pin, m."""
        x = Motion(self.s.q, np.zeros_like(self.s.q), vdot)
        return correct(self.links, self.w, x, Slopes(0.0, 0.0, by_acceleration), 0.1)

    def release(self):
        """Set the accelerations of the start."""
        system = self.links, None, self.env, self.s, self.w
        self.factor()
        accelerations(*system)
        self.s.vdot[:] = self.s.a[:] = self.w.change[0]
        store_first_evaluation(self.s, self.w)
        return self

    def factor(self):
        assert factor_mass(self.links, self.env, self.s, self.w) == -1

    def run(self, time, h, integrator="generalized_alpha"):
        step, scheme = track_steps.implicit, self.method
        if integrator == "hht":
            scheme = self.method._replace(alpha=hht.coefficients(0.8))
        if integrator == "runge_kutta":
            self.factor()
            step, scheme = track_steps.explicit, slopes(self.s)
        chain = self.links, self.env, scheme, h, self.s, self.w, self.report, self.counters
        assert not step(*track_steps.parts_without_contacts(*chain), 0.0, time, NO_INPUTS)
        return self

    def pins(self):
        return self.s.q[:, :3].copy()

    def energy(self):
        mass(self.links.element, self.w.mass)
        observe(self.links, self.env, self.s, self.w, self.report)
        return self.report[KINETIC : GRAVITY + 1].sum()

    def angular_momentum(self):
        """Angular momentum about the origin (3)."""
        total, e, v = np.zeros(3), np.zeros((4, 3)), np.zeros((4, 3))
        mass(self.links.element, self.w.mass)
        for i in range(self.links.n):
            j = (i + 1) % len(self.s.q)
            gather(self.links, self.s.q, i, j, e)
            gather(self.links, self.s.v, i, j, v)
            total += np.cross(e, self.w.mass @ v).sum(axis=0)
        return total

    def turn(self, rate):
        """Set the velocities of a rotation about y at ``rate`` rad/s."""
        for x, z in ((0, 2), (3, 4), (5, 6)):
            self.s.v[:, x], self.s.v[:, z] = rate * self.s.q[:, z], -rate * self.s.q[:, x]

    def blocks(self):
        """Condensed matrix of the last evaluation, dense (4 nodes, 4 nodes)."""
        w, n = self.w, len(self.s.q)
        D = np.zeros((n, 4, n, 4))
        for i in range(n):
            D[i, :, i] += w.diagonal[i]
            if self.links.closed or i < n - 1:
                D[i, :, (i + 1) % n] += w.upper[i]
            if self.links.closed or i > 0:
                D[i, :, i - 1] += w.lower[i]
        return D.reshape(4 * n, 4 * n)
