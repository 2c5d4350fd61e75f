"""Chains of rigid links without ports, wheels or ground, through the kernels of the rigid track."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from fmus.physics.arrays import Floats
from fmus.physics.chain.explicit import slopes
from fmus.physics.chain.implicit import ImplicitMethod
from fmus.physics.chain.integration import HELD, LOOP, Environment
from fmus.physics.chain.report import COUNTERS, REPORT
from fmus.physics.chain.rigid.dynamics import accelerations, pin_motion
from fmus.physics.chain.rigid.links import RigidLinks, place
from fmus.physics.chain.rigid.newton import TOLERANCE
from fmus.physics.chain.rigid.state import State, shapes, work
from fmus.physics.chain.state import size, store_first_evaluation, views
from fmus.physics.integrate.generalized_alpha import coefficients
from fmus.physics.rigid.augmented import Ends
from fmus.track import steps as track_steps

P, MASS, G = 0.1524, 18.0, 9.81  # pitch, m; mass of a link, kg; gravity, m/s2
FACE, LATERAL = 0.029, 0.1  # of a link, m: there is no contact
RADIUS = 0.8  # spectral radius of generalised alpha
EXPLICIT, IMPLICIT = "Runge-Kutta", "generalised alpha"
NO_INPUTS = np.zeros(0)


def of_angles(angles: Floats) -> Floats:
    """Pins (n + 1, 2), x and z, m, of links at the given angles over x, rad."""
    steps = P * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])


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
        self._slopes, self._report, self._counters = slopes(self.s), np.zeros(REPORT), np.zeros(COUNTERS, np.int64)
        place(self.links, np.asarray(pins, dtype=float), self.s, self.w)

    def release(self) -> Floats:
        """Accelerations (n, 6) of the present state; also sets the pin forces ``s.lam``."""
        if accelerations(self.links, None, self.env, self.s, self.w) >= 0:
            raise ArithmeticError("the chain is singular")
        store_first_evaluation(self.s, self.w)
        return self.s.vdot

    def run(self, time: float, h: float, integrator: str = EXPLICIT) -> Rods:
        """Integrate over ``time``, s, in equal steps of at most ``h``, s; raises ArithmeticError if one fails."""
        explicit = integrator == EXPLICIT
        scheme = self._slopes if explicit else self.method
        chain = self.links, self.env, scheme, h, self.s, self.w, self._report, self._counters
        parts, messages = track_steps.parts_without_contacts(*chain)
        step: Callable[..., int] = track_steps.explicit if explicit else track_steps.implicit
        if step(parts, messages, 0.0, time, NO_INPUTS):
            raise ArithmeticError(f"the chain failed after {messages[0, 0]:.3g} s, link {int(messages[0, 1]) + 1}")
        return self

    def steps(self, time: float, h: float, integrator: str) -> Iterator[None]:
        """Integrate step by step, with initial accelerations; yields after each step."""
        self.release()
        for _ in range(round(time / h)):
            self.run(h, h, integrator)
            yield

    def pins(self) -> Floats:
        """Positions of the pins (nodes, 3), m."""
        pin_motion(self.links, self.s, self.w)
        return self.w.pins[0].copy()

    def tip(self) -> Floats:
        """Position of the end of the last link (3,), m."""
        return self.pins()[-1]

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
