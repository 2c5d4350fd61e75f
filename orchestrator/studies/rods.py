"""Chains of rigid rods through the kernels of ``fmus.physics.rigid``: Runge-Kutta and generalised alpha in space.

No ports, wheels or ground; the first pin may hold to the ground. Pose r (3) and unit quaternion (4); velocity (6) with
the turning in body axes. Runge-Kutta works at index 1: poses and velocities are projected after each step. Generalised
alpha keeps the pins at the end of each step (index 3), on increments of the poses, as ``fmus.track_rigid.chain`` does.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.physics.integrate import generalized_alpha as ga
from fmus.physics.integrate.runge_kutta import RK4
from fmus.physics.rigid import augmented

Floats = NDArray[np.float64]
P, MASS, G = 0.1524, 18.0, 9.81  # pitch, m; mass of a link, kg; gravity, m/s2


def of_angles(angles: Floats, pitch: float = P) -> Floats:
    """Pins (n + 1, 2), x and z, of links with the given angles over x."""
    steps = pitch * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])


def rotations(p: Floats) -> Floats:
    """Rotation matrices (n, 3, 3) of quaternions (n, 4)."""
    w, x, y, z = p.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def cross(a: Floats, b: Floats) -> Floats:
    """Cross products of (n, 3), without numpy's own overhead."""
    return np.stack(
        [a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1], a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2],
         a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]], axis=1,
    )  # fmt: skip


def times(p: Floats, turn: Floats) -> Floats:
    """Quaternions (n, 4) times pure ones of the vectors ``turn`` (n, 3)."""
    out = np.empty_like(p)
    out[:, 0] = -(p[:, 1:] * turn).sum(axis=1)
    out[:, 1:] = p[:, :1] * turn + cross(p[:, 1:], turn)
    return out


def moved(p: Floats, turn: Floats) -> Floats:
    """Quaternions (n, 4) turned from the right by rotation vectors (n, 3)."""
    half = 0.5 * np.sqrt((turn * turn).sum(axis=1))[:, None]
    out = np.cos(half) * p + times(p, 0.5 * np.sinc(half / np.pi) * turn)
    return np.asarray(out / np.sqrt((out * out).sum(axis=1))[:, None])


def body(A: Floats, x: Floats) -> Floats:
    """World vectors (n, 3) in body axes."""
    return np.asarray(np.einsum("nij,ni->nj", A, x))


class Rods:
    """Links between pins in the plane y = 0, which move in space."""

    def __init__(self, pins: Floats, held: bool = False, closed: bool = False, gravity: float = G) -> None:
        n = len(pins) if closed else len(pins) - 1
        self.n, self.gravity, self.half, self.held = n, gravity, 0.5 * P, held
        self.inertia = np.array([0.25, MASS * P**2 / 12.0, MASS * P**2 / 12.0])  # thin; 0.25 in roll
        self.ends, self.system = augmented.Ends(closed, held, False), augmented.system(n, closed)
        space = np.zeros((len(pins), 3))
        space[:, [0, 2]] = pins
        chord = (np.roll(space, -1, axis=0) - space)[:n]
        self.r, angle = space[:n] + 0.5 * chord, -np.arctan2(chord[:, 2], chord[:, 0])
        self.p = np.stack([np.cos(angle / 2), 0 * angle, np.sin(angle / 2), 0 * angle], axis=1)
        self.v = np.zeros((n, 6))
        self.joined = slice(0, n) if closed else slice(1, n)  # pins between two links, by the link behind
        self.before = np.roll(np.arange(n), 1)[self.joined]

    def _pins(self, p: Floats, v: Floats) -> None:
        """Rotations, axis rows and the velocity terms of all pins, into the system."""
        s, k, b = self.system, self.joined, self.before
        s.A[:] = A = rotations(p)
        x, y, z = A[:, :, 0], A[:, :, 1], A[:, :, 2]
        w = np.einsum("nij,nj->ni", A, v[:, 3:])
        dx, dy, dz = cross(w, x), cross(w, y), cross(w, z)
        xx, yy, zz = cross(w, dx), cross(w, dy), cross(w, dz)
        s.C[:] = 0.0
        for row, (e, de, ee) in enumerate(((x, dx, xx), (z, dz, zz))):
            s.WP[k, row] = body(A[b], cross(e[b], y[k]))
            s.WQ[k, row] = body(A[k], cross(y[k], e[b]))
            s.C[k, 3 + row] = (ee[b] * y[k] + 2.0 * de[b] * dy[k] + e[b] * yy[k]).sum(axis=1)
        s.C[k, :3] = self.half * (xx[b] + xx[k])
        if self.held:
            for row, e in enumerate(np.eye(3)[[0, 2]]):
                s.WQ[0, row] = body(A[:1], cross(y[:1], e[None]))[0]
                s.C[0, 3 + row] = e @ yy[0]
            s.C[0, :3] = self.half * xx[0]

    def accelerations(self, p: Floats, v: Floats) -> Floats:
        """(n, 6); the forces in the pins are then in ``system.dl``."""
        s, J = self.system, self.inertia
        self._pins(p, v)
        s.r[:] = 0.0
        s.r[:, 2] = MASS * self.gravity
        s.r[:, 3:] = cross(v[:, 3:], J * v[:, 3:])
        s.K[:] = np.diag(np.concatenate([np.full(3, MASS), J]))
        if augmented.factor(self.half, self.ends, s, augmented.REGULAR) >= 0:
            raise ArithmeticError("the chain is singular")
        augmented.solve(self.half, self.ends, s)
        return np.array(s.dx)

    def release(self) -> Floats:
        """Accelerations now."""
        return self.accelerations(self.p, self.v)

    def step(self, h: float) -> None:
        """One step of Runge-Kutta and the projection."""
        rates: list[tuple[Floats, Floats, Floats]] = []
        for a in RK4.a:
            shares = [h * x for x in a[: len(rates)]]
            _, p, v = self._moved(rates, shares)
            rates.append((v[:, :3], 0.5 * times(p, v[:, 3:]), self.accelerations(p, v)))
        self.r, self.p, self.v = self._moved(rates, [h * x for x in RK4.b])
        self._project()

    def _moved(self, rates: list[Any], shares: list[float]) -> tuple[Floats, Floats, Floats]:
        r, p, v = self.r, self.p, self.v
        for (dr, dp, dv), share in zip(rates, shares, strict=True):
            if share:
                r, p, v = r + share * dr, p + share * dp, v + share * dv
        return r, p / np.sqrt((p * p).sum(axis=1))[:, None], v

    def _gaps(self) -> None:
        """How far the pins are open, into the system whose rotations are set."""
        s, k, b = self.system, self.joined, self.before
        x, y, z, end = s.A[:, :, 0], s.A[:, :, 1], s.A[:, :, 2], self.half * s.A[:, :, 0]
        s.C[:] = 0.0
        s.C[k, :3] = self.r[b] + end[b] - self.r[k] + end[k]
        s.C[k, 3], s.C[k, 4] = (x[b] * y[k]).sum(axis=1), (z[b] * y[k]).sum(axis=1)
        if self.held:
            s.C[0] = np.concatenate([end[0] - self.r[0], y[0, [0, 2]]])

    def _project(self) -> None:
        """Close the pins in position, then in velocity, with the factors of the last stage."""
        s = self.system
        s.r[:] = 0.0
        for _ in range(4):
            self._pins(self.p, self.v)
            self._gaps()
            if abs(s.C).max() < 1e-13:
                break
            augmented.solve(self.half, self.ends, s)
            self.r = self.r + s.dx[:, :3]
            self.p = moved(self.p, s.dx[:, 3:])
        augmented.rates(self.half, self.ends, s, self.v)
        augmented.solve(self.half, self.ends, s)
        self.v = self.v + s.dx

    def _reactions(self, lam: Floats) -> Floats:
        """B^T lam on the links (n, 6), open chain."""
        s, f = self.system, np.zeros((self.n, 6))
        before, after = lam[:-1], lam[1:]
        f[:, :3] = after[:, :3] - before[:, :3]
        pull = body(s.A, after[:, :3] + before[:, :3])
        f[:, 4], f[:, 5] = -self.half * pull[:, 2], self.half * pull[:, 1]
        f[:, 3:] += np.einsum("nki,nk->ni", s.WP[1:], after[:, 3:])
        f[:, 3:] += np.einsum("nki,nk->ni", s.WQ[:-1], before[:, 3:])
        return f

    def implicit(self, time: float, h: float, radius: float = 0.8) -> Iterator[None]:
        """Steps of generalised alpha of an open chain; Newton with the mass as its matrix, for slow chains."""
        c = ga.coefficients(radius)
        by, s, J = ga.slopes(c, h), self.system, self.inertia
        mass = np.concatenate([np.full(3, MASS), J])
        vdot = self.release()
        lam, a = s.dl.copy(), vdot.copy()
        for _ in range(round(time / h)):
            r0, p0, vdot1 = self.r, self.p, vdot.copy()
            a1 = ga.auxiliary(c, a, vdot, vdot1)
            x = h * self.v + h * h * ((0.5 - c.beta) * a + c.beta * a1)
            self.v = self.v + h * ((1.0 - c.gamma) * a + c.gamma * a1)
            size = np.inf
            for _ in range(20):
                self.r, self.p = r0 + x[:, :3], moved(p0, x[:, 3:])
                self._pins(self.p, self.v)
                self._gaps()
                s.r[:] = mass * vdot1 - self._reactions(lam)
                s.r[:, 2] += MASS * self.gravity
                s.r[:, 3:] += cross(self.v[:, 3:], J * self.v[:, 3:])
                if size < 1e-13:
                    break
                s.K[:] = by.vdot * np.diag(mass)
                if augmented.factor(self.half, self.ends, s, 1.0) >= 0:
                    raise ArithmeticError("the chain is singular")
                augmented.solve(self.half, self.ends, s)
                dx, turn, size = s.dx.copy(), s.dx[:, 3:], float(np.abs(s.dx).max())
                once = cross(x[:, 3:], turn)  # the increment turns the end of the step
                dx[:, 3:] = turn + 0.5 * once + cross(x[:, 3:], once) / 12.0
                x, vdot1, a1 = x + dx, vdot1 + by.vdot * dx, a1 + by.a * dx
                self.v = self.v + by.v * dx
                lam += s.dl
            else:
                if size > 1e-10:
                    raise ArithmeticError(f"Newton: a correction of {size:.1e} after 20 iterations")
            a, vdot = a1, vdot1
            yield

    def steps(self, time: float, h: float, integrator: str) -> Iterator[None]:
        """Steps of either integrator."""
        if integrator != "Runge-Kutta":
            yield from self.implicit(time, h)
            return
        for _ in range(round(time / h)):
            self.step(h)
            yield

    def run(self, time: float, h: float) -> Rods:
        """Equal steps of Runge-Kutta."""
        for _ in range(round(time / h)):
            self.step(h)
        return self

    def tip(self) -> Floats:
        """The end of the last link (3)."""
        return np.asarray(self.r[-1] + self.half * rotations(self.p[-1:])[0, :, 0])

    def turn(self, rate: Floats) -> None:
        """Velocities of a rigid rotation ``rate`` (3) about the origin."""
        self.v[:, :3] = np.cross(rate, self.r)
        self.v[:, 3:] = np.einsum("nji,j->ni", rotations(self.p), rate)

    def energy(self) -> float:
        """Kinetic and of gravity, J."""
        kinetic = 0.5 * MASS * (self.v[:, :3] ** 2).sum() + 0.5 * (self.v[:, 3:] ** 2 * self.inertia).sum()
        return float(kinetic + MASS * self.gravity * self.r[:, 2].sum())

    def angular_momentum(self) -> Floats:
        """About the origin (3)."""
        spin = np.einsum("nij,nj->ni", rotations(self.p), self.inertia * self.v[:, 3:])
        return np.asarray((np.cross(self.r, MASS * self.v[:, :3]) + spin).sum(axis=0))
