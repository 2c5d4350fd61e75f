"""Chains without ports, driven through the kernels of the two tracks: no wheels, no ground, any end held or free."""

from __future__ import annotations

import numpy as np

from fmus.physics.ancf.cable import Cable
from fmus.physics.block_cyclic import factor, solve
from fmus.physics.chain.cable_nodes import gather
from fmus.physics.integrate.generalized_alpha import auxiliary, coefficients, slopes
from fmus.physics.rigid.augmented import Ends
from fmus.track import LOOP, REPORT, Environment
from fmus.track_flexible import cables, chain
from fmus.track_flexible import explicit as flexible_explicit
from fmus.track_rigid import chain as rigid
from fmus.track_rigid import explicit as rigid_explicit

P = 0.1524  # pitch, m
AREA, SECOND = 0.01516, 2.03e-6  # of the link's section
STEEL = Cable(P, 7800 * AREA, 2e11 * AREA, 2e11 * SECOND, 0.0, 0.0)
INTEGRATORS = {"generalized_alpha": 2, "runge_kutta": 4}  # and their orders
NO_ROWS = np.zeros((0, 15))


def line(n: int, pitch: float = P, along: tuple[float, float] = (1.0, 0.0)) -> np.ndarray:
    """Pins (n + 1, 2) of a straight chain from the origin."""
    return pitch * np.arange(n + 1)[:, None] * np.array(along)


def of_angles(angles: np.ndarray, pitch: float = P) -> np.ndarray:
    """Pins (n + 1, 2) of links with the given angles over x."""
    steps = pitch * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])


def ring(n: int, pitch: float = P) -> np.ndarray:
    """Pins (n, 2) of a regular polygon round the origin."""
    angle = -2.0 * np.pi * np.arange(n) / n
    return pitch / (2.0 * np.sin(np.pi / n)) * np.stack([np.cos(angle), np.sin(angle)], axis=1)


class Rigid:
    """Rigid links; the first pin held or not, the last one free."""

    def __init__(self, pins, held=False, closed=False, gravity=9.81, inertia=None, pitch=P, mass=18.0, radius=0.8):
        n = len(pins) if closed else len(pins) - 1
        thin = (0.25, mass * pitch**2 / 12.0, mass * pitch**2 / 12.0)
        self.link = rigid.Link(0.5 * pitch, 0.029, 0.1, mass, np.array(inertia or thin))
        self.ends, self.method = Ends(closed, held, False), coefficients(radius)
        self.env = Environment(gravity, LOOP, np.zeros((2, 3)), 0.0, -1)
        flat = np.zeros(sum(int(np.prod(shape)) for shape in rigid.shapes(n, closed, 0)))
        self.s, self.work = rigid.views(flat, n, closed, 0), rigid.work(n, closed, 0)
        self.counters = np.zeros(4, np.int64)
        rigid.place(self.link, np.asarray(pins, float), self.s, self.work)

    def _parts(self):
        return self.link, self.ends, self.env, None

    def release(self):
        assert rigid.accelerations(*self._parts(), self.s, self.work) == -1
        return self

    def run(self, time, h, integrator="generalized_alpha"):
        if integrator == "runge_kutta":
            n = len(self.s.q)
            flat, k = self.s.q.base[: 13 * n], rigid_explicit.slopes(n)
            failed = rigid_explicit.march(*self._parts(), NO_ROWS, time, h, self.s, self.work, flat, k, self.counters)
        else:
            failed = rigid.advance(*self._parts(), self.method, NO_ROWS, time, h, self.s, self.work, self.counters)
        assert failed == -1
        return self

    def pins(self):
        rigid.pin_motion(self.link, self.s, self.work)
        return self.work.pins[0].copy()

    def energy(self):
        s, J = self.s, self.link.inertia
        kinetic = 0.5 * self.link.mass * (s.v[:, :3] ** 2).sum() + 0.5 * (s.v[:, 3:] ** 2 * J).sum()
        return kinetic + self.link.mass * self.env.gravity * s.q[:, 2].sum()

    def angular_momentum(self):
        """About the origin (3)."""
        s = self.s
        rigid.pin_motion(self.link, s, self.work)
        spin = np.einsum("nij,nj->ni", self.work.system.A, self.link.inertia * s.v[:, 3:])
        return (np.cross(s.q[:, :3], self.link.mass * s.v[:, :3]) + spin).sum(0)

    def turn(self, rate):
        """Velocities of a rigid rotation ``rate`` (3) about the origin."""
        rigid.pin_motion(self.link, self.s, self.work)
        self.s.v[:, :3] = np.cross(rate, self.s.q[:, :3])
        self.s.v[:, 3:] = np.einsum("nji,j->ni", self.work.system.A, rate)


class Flexible:
    """Cable links; the first pin held or not, the last one free."""

    def __init__(self, pins, held=False, closed=False, gravity=9.81, cable=STEEL, radius=0.8):
        n, self.closed = (len(pins) if closed else len(pins) - 1), closed
        self.links = cables.Links(n, int(closed), cable, 0.029, 0.02, AREA, SECOND)
        self.env = Environment(gravity, LOOP, np.zeros((2, 3)), 0.0, -1)
        self.held, self.radius = held, radius
        self.x = np.zeros((4, len(pins), 8))
        self.q, self.v, self.a, self.vdot = self.x
        self.w, self.still = cables.work(n, len(pins), 0), np.zeros((len(pins), 8))
        self.power, self.report, self.counters = np.zeros(2), np.zeros(len(REPORT)), np.zeros(4, np.int64)
        self.wrench = np.zeros((3, 1, 6))
        self.place(np.asarray(pins, float))

    def place(self, pins):
        n = self.links.count
        self.q[:, [0, 2]] = pins
        chord = (np.roll(pins, -1, axis=0) - pins)[:n] / self.links.cable.l
        self.q[:n, 5:7] = chord
        self.q[(np.arange(n) + 1) % len(pins), 3:5] = chord

    def evaluate(self, q, v, vdot, by_rate=0.0, by_acceleration=0.0, tangent=False, links=None):
        """Residual into ``w.b``, with the held pin's equations replaced by no motion."""
        w = self.w
        cables.evaluate(links or self.links, None, self.env, q, v, vdot, by_rate, by_acceleration, w, tangent)
        if self.held:
            w.b[0, :3] = 0.0
            if tangent:
                w.A[0, :3], w.U[0, :3] = 0.0, 0.0
                w.A[0, [0, 1, 2], [0, 1, 2]] = 1.0

    def solve(self, fresh):
        w = self.w
        if fresh:
            assert factor(w.A, w.U, w.L, w.factors, self.closed) < 0
        solve(w.A, w.U, w.factors, self.closed, w.b)

    def release(self):
        """Accelerations of the start."""
        soft = self.links.cable._replace(EA=0.0, EI=0.0)
        self.evaluate(self.q, self.still, self.still, 0.0, 1.0, True, self.links._replace(cable=soft))
        assert factor(self.w.A, self.w.U, self.w.L, self.w.factors, self.closed) < 0
        self.evaluate(self.q, self.v, self.still)
        self.solve(False)
        self.vdot[:], dummy = 0.0, np.zeros_like(self.q)
        cables.correct(self.links, self.w, self.vdot, dummy, dummy, 0.0, 0.0, np.inf)
        self.a[:] = self.vdot
        return self

    def step(self, h):
        """One step of generalised-alpha, as ``fmus.track_flexible.chain.advance`` does it."""
        c = coefficients(self.radius)
        s = slopes(c, h)
        a0, vdot0 = self.a.copy(), self.vdot.copy()
        a1 = auxiliary(c, a0, vdot0, vdot0)
        self.q += h * self.v + h * h * ((0.5 - c.beta) * a0 + c.beta * a1)
        self.v += h * ((1.0 - c.gamma) * a0 + c.gamma * a1)
        size = np.inf
        for _ in range(12):
            fresh = size > 1e-5
            self.evaluate(self.q, self.v, self.vdot, s.v, s.vdot, fresh)
            self.solve(fresh)
            size = cables.correct(self.links, self.w, self.q, self.v, self.vdot, s.v, s.vdot, 0.1)
            if size < 1e-12:
                break
        assert size < 1e-10
        self.a[:] = auxiliary(c, a0, vdot0, self.vdot)

    def run(self, time, h, integrator="generalized_alpha"):
        if self.held:
            for _ in range(round(time / h)):
                self.step(h)
        elif integrator == "runge_kutta":
            space = flexible_explicit.scratch(*self.q.shape)
            assert flexible_explicit.factor_mass(self.links, None, self.env, self.q, space[0], self.w)
            failed = flexible_explicit.march(
                self.links, None, self.env, NO_ROWS, time, h, self.x.reshape(-1)[: 2 * self.q.size], *space,
                self.w, self.wrench[2], self.report, self.counters,
            )  # fmt: skip
            assert not failed[0]
        else:
            failed = chain.advance(
                self.links, None, self.env, NO_ROWS, time, h, self.radius, 1e-12, self.q, self.v, self.a, self.vdot,
                self.wrench[0], self.wrench[1], self.power, self.w, self.wrench[2], self.report, self.counters,
            )  # fmt: skip
            assert not failed[0]
        return self

    def pins(self):
        return self.q[:, :3].copy()

    def energy(self):
        cables.mass(self.links.cable, self.w.M)
        cables.measure(self.links, self.env, self.q, self.v, self.w, self.report)
        return self.report[6:9].sum()

    def angular_momentum(self):
        """About the origin (3)."""
        total, e, v = np.zeros(3), np.zeros((4, 3)), np.zeros((4, 3))
        cables.mass(self.links.cable, self.w.M)
        for i in range(self.links.count):
            j = (i + 1) % len(self.q)
            gather(self.q, i, j, e)
            gather(self.v, i, j, v)
            total += np.cross(e, self.w.M @ v).sum(axis=0)
        return total

    def turn(self, rate):
        """Velocities of a rotation about y at ``rate`` rad/s."""
        for x, z in ((0, 2), (3, 4), (5, 6)):
            self.v[:, x], self.v[:, z] = rate * self.q[:, z], -rate * self.q[:, x]

    def blocks(self):
        """The condensed matrix of the last evaluation, dense (4 nodes, 4 nodes)."""
        w, n = self.w, len(self.q)
        D = np.zeros((n, 4, n, 4))
        for i in range(n):
            D[i, :, i] += w.A[i]
            if self.closed or i < n - 1:
                D[i, :, (i + 1) % n] += w.U[i]
            if self.closed or i > 0:
                D[i, :, i - 1] += w.L[i]
        return D.reshape(4 * n, 4 * n)
