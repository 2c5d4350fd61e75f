"""Chains without ports, wheels or ground, by the kernels of the tracks: rigid links, and cables."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from fmus.interface.sentences import GAPS
from fmus.physics.ancf.cable import Cable, mass
from fmus.physics.arrays import Floats
from fmus.physics.block_cyclic import factor, solve
from fmus.physics.chain.explicit import slopes
from fmus.physics.chain.flexible import cables
from fmus.physics.chain.flexible import dynamics as flexible
from fmus.physics.chain.flexible.assembly import evaluate
from fmus.physics.chain.flexible.condensation import correct
from fmus.physics.chain.flexible.initial_state import factor_mass
from fmus.physics.chain.flexible.link_layout import straight
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.flexible.state import State as FlexibleState
from fmus.physics.chain.flexible.state import shapes as flexible_shapes
from fmus.physics.chain.flexible.state import work as flexible_work
from fmus.physics.chain.implicit import ImplicitMethod
from fmus.physics.chain.integration import HELD, LOOP, Environment
from fmus.physics.chain.interface import observe
from fmus.physics.chain.report import COUNTERS, GRAVITY, KINETIC, REPORT
from fmus.physics.chain.rigid.dynamics import accelerations, pin_motion
from fmus.physics.chain.rigid.links import RigidLinks, place
from fmus.physics.chain.rigid.newton import TOLERANCE
from fmus.physics.chain.rigid.state import State, shapes, work
from fmus.physics.chain.state import size, store_first_evaluation, views
from fmus.physics.integrate import hht
from fmus.physics.integrate.generalized_alpha import Slopes, coefficients
from fmus.physics.rigid.augmented import Ends
from fmus.physics.wheels import WIDTH
from fmus.start import FRAME
from fmus.track import steps as track_steps
from fmus.track.failures import WARNINGS
from fmus.track.motions import exchange_size
from tests.validation.meshes import AREA, SECOND, STEEL

P, MASS, G = 0.1524, 18.0, 9.81  # pitch, m; mass of a link, kg; gravity, m/s2
FACE, LATERAL = 0.029, 0.1  # of a link, m: there is no contact
RADIUS = 0.8  # spectral radius of generalised alpha
EXPLICIT, IMPLICIT, HHT = "runge_kutta", "generalized_alpha", "hht"
NO_INPUTS = np.zeros(0)


def of_angles(angles: Floats) -> Floats:
    """Pins (n + 1, 2), x and z, m, of links at the given angles over x, rad."""
    steps = P * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])


def integrate(chain: Any, explicit: Any, time: float, h: float, integrator: str) -> None:
    """Integrate a chain; raises ArithmeticError if a step fails. ``explicit``: slopes of its state."""
    scheme = explicit if integrator == EXPLICIT else chain.method
    if integrator == HHT:
        scheme = scheme._replace(alpha=hht.coefficients(RADIUS))
    none, exchange, flags = np.zeros((0, WIDTH)), np.zeros(exchange_size(0)), np.zeros(len(WARNINGS))
    at = np.zeros(FRAME), none, none, flags, exchange, none  # the origin, and no wheels
    common = track_steps.CommonData(h, 0, 0.0, 0.0, *at, chain.report, 0.0, chain.counters, 1.0)
    parts = track_steps.Parts(chain.links, None, chain.env, scheme, common, chain.s, chain.w, chain.report)
    messages = np.zeros((1 + len(WARNINGS), GAPS + 1))
    step: Callable[..., int] = track_steps.explicit if integrator == EXPLICIT else track_steps.implicit
    if step(parts, messages, 0.0, time, NO_INPUTS):
        raise ArithmeticError(f"the chain failed after {messages[0, 0]:.3g} s, link {int(messages[0, 1]) + 1}")


class Rods:
    """Rigid links between ``pins`` (n + 1, 2), closed (n, 2), m, in the plane y = 0; they move in space.

    The first pin may be fixed to the ground. Links have the inertia of thin rods about their own axes.
    """

    def __init__(
        self,
        pins: Floats,
        held: bool = False,
        closed: bool = False,
        gravity: float = G,
        pitch: float = P,
        mass: float = MASS,
        radius: float = RADIUS,
    ) -> None:
        n = len(pins) if closed else len(pins) - 1
        thin = np.array([0.25, mass * pitch**2 / 12.0, mass * pitch**2 / 12.0])  # 0.25 in roll
        ends, sizes = Ends(closed, held, False), shapes(n, closed, 0)
        self.links = RigidLinks(0.5 * pitch, FACE, LATERAL, mass, thin, ends)
        self.env = Environment((0.0, 0.0, -gravity), HELD if held else LOOP, np.zeros((2, 3)), 0.0, -1)
        self.method = ImplicitMethod(coefficients(radius), TOLERANCE, True)
        self.s, self.w = views(State, sizes, np.zeros(size(sizes))), work(n, closed, 0)
        self._slopes, self.report, self.counters = slopes(self.s), np.zeros(REPORT), np.zeros(COUNTERS, np.int64)
        place(self.links, np.asarray(pins, dtype=float), self.s, self.w)

    def release(self) -> Rods:
        """Set the accelerations ``s.vdot`` and the pin forces ``s.lam`` of the present state."""
        if accelerations(self.links, None, self.env, self.s, self.w) >= 0:
            raise ArithmeticError("the chain is singular")
        store_first_evaluation(self.s, self.w)
        return self

    def run(self, time: float, h: float, integrator: str = EXPLICIT) -> Rods:
        """Integrate over ``time``, s, in equal steps of at most ``h``, s; raises ArithmeticError if one fails."""
        integrate(self, self._slopes, time, h, integrator)
        return self

    def rate(self) -> float:
        """Largest rate of a link in the plane, rad/s."""
        return float(np.abs(self.s.v[:, 4]).max())

    def pins(self) -> Floats:
        """Positions of the pins (nodes, 3), m."""
        pin_motion(self.links, self.s, self.w)
        return self.w.pins[0].copy()

    def turn(self, rate: Floats) -> None:
        """Set the velocities of a rigid rotation ``rate`` (3,), rad/s, about the origin."""
        pin_motion(self.links, self.s, self.w)
        self.s.v[:, :3] = np.cross(rate, self.s.q[:, :3])
        self.s.v[:, 3:] = np.einsum("nji,j->ni", self.w.system.rotation, rate)

    def energy(self) -> float:
        """Kinetic and gravity energy, J."""
        s, m = self.s, self.links.mass
        kinetic = 0.5 * m * (s.v[:, :3] ** 2).sum() + 0.5 * (s.v[:, 3:] ** 2 * self.links.inertia).sum()
        return float(kinetic - m * np.dot(s.q[:, :3].sum(axis=0), self.env.gravity))

    def angular_momentum(self) -> Floats:
        """Angular momentum (3,) about the origin, kg m2/s."""
        s = self.s
        pin_motion(self.links, s, self.w)
        spin = np.einsum("nij,nj->ni", self.w.system.rotation, self.links.inertia * s.v[:, 3:])
        return np.asarray((np.cross(s.q[:, :3], self.links.mass * s.v[:, :3]) + spin).sum(axis=0))


class Cables:
    """Cables between ``pins``, as ``Rods``."""

    def __init__(
        self,
        pins: Floats,
        held: bool = False,
        closed: bool = False,
        gravity: float = G,
        cable: Cable = STEEL,
        radius: float = RADIUS,
    ) -> None:
        self.env = Environment((0.0, 0.0, -gravity), HELD if held else LOOP, np.zeros((2, 3)), 0.0, -1)
        self.report, self.counters = np.zeros(REPORT), np.zeros(COUNTERS, np.int64)
        n, nodes = (len(pins) if closed else len(pins) - 1), len(pins)
        self.links = cables.Cables(n, int(closed), cable, FACE, 0.02, AREA, SECOND)
        self.method = ImplicitMethod(coefficients(radius), 1e-12, True)
        sizes = flexible_shapes(cables.NODE, nodes, 0)
        self.s, self.w = views(FlexibleState, sizes, np.zeros(size(sizes))), flexible_work(cables, n, nodes, 0)
        self.place(np.asarray(pins, float))

    def place(self, pins: Floats) -> None:
        """Place straight links between the pins."""
        straight(cables, self.links, pins, self.s.q)

    def evaluate(self, vdot: Floats | None = None, by_acceleration: float = 0.0) -> None:
        """Evaluate the residual and the matrix at rest."""
        x = Motion(self.s.q, self.w.still, self.w.still if vdot is None else vdot)
        evaluate(self.links, None, self.env, x, Slopes(0.0, 0.0, by_acceleration), self.w, True)

    def solve(self) -> None:
        """Solve for the correction in ``w.right_side``."""
        w, closed = self.w, bool(self.links.closed)
        assert factor(w.diagonal, w.upper, w.lower, w.factors, closed) < 0
        solve(w.diagonal, w.upper, w.factors, closed, w.right_side)

    def correct(self, vdot: Floats, by_acceleration: float = 0.0) -> float:
        """Apply the correction in ``w.right_side`` at rest; return the largest change of a pin, m."""
        x = Motion(self.s.q, np.zeros_like(self.s.q), vdot)
        return float(correct(self.links, self.w, x, Slopes(0.0, 0.0, by_acceleration), 0.1))

    def release(self) -> Cables:
        """Set the accelerations of the start."""
        assert factor_mass(self.links, self.env, self.s, self.w) == -1
        flexible.accelerations(self.links, None, self.env, self.s, self.w)
        self.s.vdot[:] = self.s.a[:] = self.w.change[0]
        store_first_evaluation(self.s, self.w)
        return self

    def run(self, time: float, h: float, integrator: str = IMPLICIT) -> Cables:
        """Integrate as ``Rods.run``."""
        if integrator == EXPLICIT:
            assert factor_mass(self.links, self.env, self.s, self.w) == -1
        integrate(self, slopes(self.s), time, h, integrator)
        return self

    def rate(self) -> float:
        """Largest rate of a slope in the plane, rad/s."""
        return float(max(np.abs(self.s.v[:-1, 5:7]).max(), np.abs(self.s.v[1:, 3:5]).max()))

    def pins(self) -> Floats:
        """Positions of the pins (nodes, 3), m."""
        return self.s.q[:, :3].copy()

    def energy(self) -> float:
        """Kinetic, strain and gravity energy, J."""
        mass(self.links.element, self.w.mass)
        observe(self.links, self.env, self.s, self.w, self.report)
        return float(self.report[KINETIC : GRAVITY + 1].sum())

    def elements(self, values: Floats) -> Floats:
        """Element coordinates (n, 4, 3) of all links, or their rates."""
        e = np.zeros((self.links.n, 4, 3))
        for i in range(len(e)):
            cables.gather(self.links, values, i, (i + 1) % len(values), e[i])
        return e

    def angular_momentum(self) -> Floats:
        """Angular momentum (3,) about the origin, kg m2/s."""
        mass(self.links.element, self.w.mass)
        e, v = self.elements(self.s.q), self.elements(self.s.v)
        return np.asarray(np.cross(e, self.w.mass @ v).sum(axis=(0, 1)))

    def turn(self, rate: Floats) -> None:
        """Set the velocities of a rotation about y at ``rate`` (3,), rad/s."""
        for x, z in ((0, 2), (3, 4), (5, 6)):
            self.s.v[:, x], self.s.v[:, z] = rate[1] * self.s.q[:, z], -rate[1] * self.s.q[:, x]

    def blocks(self) -> Floats:
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
