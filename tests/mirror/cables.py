"""Links that are cables: of small deformation, with axes that turn, planar, and with other elasticities."""

from __future__ import annotations

from copy import copy
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from mirror.links import Element, gauss, hermite
from mirror.record import Floats


class Cable(Element):
    """Cable; a pin has position, slopes (x, z) of both links, and the shared y slope."""

    width = 8

    @property
    def shared_nudges(self) -> tuple[Floats, ...]:
        return (self.across,)

    def coordinates(self, x: Floats, places: bool) -> Floats:
        e = self.world(self.vectors(x))
        if places:
            e[:, :, [0, 2]] += self.origin
        return e

    def vectors(self, x: Floats) -> Floats:
        """Vectors (T, n, 4, 3) along the axes of the state, from its values (T, nodes, 8)."""
        first, last = x[:, : self.n], x[:, self.second]
        return np.stack([first[..., :3], first[..., [5, 7, 6]], last[..., :3], last[..., [3, 7, 4]]], axis=2)

    @property
    def axes(self) -> Floats:
        return np.broadcast_to(self.across, self.e[:, :, 0].shape)

    @property
    def pin_axes(self) -> Floats:
        return np.broadcast_to(self.axes[:, :1], self.pins.shape)

    def centreline(self, xi, derivative: int = 0) -> Floats:
        return hermite(xi, self.pitch, derivative)

    @cached_property
    def mass_matrix(self) -> Floats:
        """Mass of the line, and on its mean slope the table's inertia about the pin beyond that of a rod."""
        x, w = gauss(4)
        S, slope = self.centreline(x), self.mean_slope
        return self.mass * np.einsum("p,pa,pb->ab", w, S, S) + self.excess_inertia * np.outer(slope, slope)

    @property
    def excess_inertia(self) -> float:
        return self.vehicle["track"]["inertia"][1] - self.mass * self.pitch**2 / 12.0

    def point(self, t, i, xi, y, off) -> tuple[Floats, Floats]:
        """Point on the face, ``off`` outside the centreline, along r_x cross the pins' axis."""
        e, v = self.e[t, i], self.v[t, i]
        S, C = hermite(xi, self.pitch), hermite(xi, self.pitch, 1)
        x, u, slope, rate = (np.einsum("...a,...ai->...i", f, g) for f, g in ((S, e), (S, v), (C, e), (C, v)))
        slope = slope - (slope @ self.across)[..., None] * self.across
        rate = rate - (rate @ self.across)[..., None] * self.across
        size = np.linalg.norm(slope, axis=-1, keepdims=True)
        t_ = slope / size
        turning = (rate - t_ * (t_ * rate).sum(-1, keepdims=True)) / size
        off = np.asarray(off)[..., None]
        return x + off * np.cross(t_, self.across), u + off * np.cross(turning, self.across)

    def pin(self, t, j, y) -> tuple[Floats, Floats]:
        return self.pins[t, j], self.rates[t, j]

    def slopes(self, e: Floats, xi, derivative: int = 1) -> Floats:
        """r_x or r_xx (..., p, 3) at fractions (p) of elements ``e`` (..., 4, 3)."""
        return np.einsum("pa,...ai->...pi", hermite(xi, self.pitch, derivative), e)

    def gradients_at(self, xi: float) -> Floats:
        """Gradients r_x (T, n, 3) of all links at a fraction of their length."""
        return self.slopes(self.e, [xi])[:, :, 0]

    @property
    def stiffness(self) -> tuple[float, float]:
        """Stiffnesses EA, N, and EI, N m2."""
        E, section = float(self.part.parameters["material.youngs_modulus"]), self.vehicle["section"]
        return E * section["area"], E * section["bending"]

    def green_strain(self, e: Floats) -> Floats:
        """Average Green strain."""
        x, w = gauss(3)
        return 0.5 * (np.einsum("p,...pi,...pi->...", w, self.slopes(e, x), self.slopes(e, x)) - 1.0)

    def curvature(self, e: Floats, xi) -> Floats:
        """Curvature at fractions (p), 1/m, that EI turns into a moment: here |r_xx|."""
        return np.linalg.norm(self.slopes(e, xi, 2), axis=-1)

    @cached_property
    def axial(self) -> Floats:
        """Axial force (T, n), N: EA times the strain."""
        return self.stiffness[0] * self.green_strain(self.e)

    @property
    def tau(self) -> float:
        return float(self.part.parameters["material.relaxation_time"])

    @property
    def strain_motion(self) -> tuple[Floats, Floats]:
        """Coordinates and rates (T, n, 4, 3) in the axes of the strains."""
        return self.e, self.v

    @property
    def stretch_damping(self) -> Floats:
        """Damping force of the stretch (T, n), N, per unit of stretch."""
        x, w = gauss(3)
        e, v = self.strain_motion
        rate = np.einsum("p,tnpi,tnpi->tn", w, self.slopes(e, x), self.slopes(v, x))
        return self.tau * self.stiffness[0] * rate / (1.0 + 2.0 * self.green_strain(e))

    @property
    def damping_tension(self) -> Floats:
        return self.stretch_damping * np.linalg.norm(self.ends[1] - self.ends[0], axis=-1) / self.pitch

    @property
    def material_loss(self) -> Floats:
        x, w = gauss(3)
        e, v = self.strain_motion
        rate = np.einsum("p,tnpi,tnpi->tn", w, self.slopes(e, x), self.slopes(v, x))
        return self.pitch * (self.stretch_damping * rate).sum(1) + self.bending_loss

    @property
    def bending_loss(self) -> Floats:
        """Power lost by damping of the curvature, relative to the chord (T), W."""
        x, w = gauss(3)
        e, v = self.strain_motion
        chord, swing = e[:, :, 2] - e[:, :, 0], v[:, :, 2] - v[:, :, 0]
        omega = np.cross(chord, swing) / (chord**2).sum(-1, keepdims=True)
        curvature, rate = self.slopes(e, x, 2), self.slopes(v, x, 2)
        rate = rate - np.cross(omega[:, :, None], curvature)
        return self.tau * self.stiffness[1] * self.pitch * np.einsum("p,tnpi,tnpi->t", w, rate, rate)

    @cached_property
    def stress(self) -> Floats:
        """Largest stress (T, n), Pa: tension over area plus end moment over section modulus."""
        section, (_, EI) = self.vehicle["section"], self.stiffness
        moment = EI * self.curvature(self.e, [0.0, 1.0]).max(-1)
        fibre = moment * section["outer_fibre"] / section["bending"]
        axial = self.axial / section["area"]
        return np.maximum(abs(axial + fibre), abs(axial - fibre))

    @cached_property
    def fibres(self) -> tuple[Floats, Floats]:
        """Stress at the outer and the inner fibre (T, n), Pa: tension over area, and outward curvature."""
        section, (x, w) = self.vehicle["section"], gauss(3)
        slope = self.slopes(self.e, [0.5])[:, :, 0]
        outwards = np.cross(slope, self.axes)
        outwards = outwards / np.linalg.norm(outwards, axis=-1, keepdims=True)
        bend = np.einsum("p,tnpi,tni->tn", w, self.slopes(self.e, x, 2), outwards)
        at, more = self.axial / section["area"], self.stiffness[1] / section["bending"] * section["outer_fibre"] * bend
        return at - more, at + more

    def energies(self, e: Floats) -> Floats:
        EA, EI = self.stiffness
        x, w = gauss(3)
        return 0.5 * self.pitch * (EA * self.green_strain(e) ** 2 + EI * self.curvature(e, x) ** 2 @ w)


class Turning(Cable):
    """Cable in axes that turn: rotation, origin, their velocities and accelerations.

    A link has a width and is stiffer about its normal. The state's values are along the axes, as ``c`` and ``dc`` are.
    """

    guided = True

    def read(self, state: Floats) -> None:
        T, size = len(state), self.nodes * self.width
        self.state_rates = state[:, size : 2 * size].reshape(T, self.nodes, self.width)
        f = state[:, 2 * size : 2 * size + 24]
        self.R = self.turn.as_matrix() @ f[:, :9].reshape(T, 3, 3)
        self.o, self.do, self.ddo = (self.world(f[:, k : k + 3]) for k in (9, 12, 15))
        self.o = self.o + self.origin
        self.w, self.dw = f[:, 18:21], f[:, 21:24]
        self.c = self.vectors(state[:, :size].reshape(T, self.nodes, self.width))
        self.dc = self.vectors(self.state_rates)
        self.update_world()

    @property
    def shared_nudges(self) -> tuple[Floats, ...]:
        return (np.array([0.0, 1.0, 0.0]),)

    def nudged(self, row: int, change: Floats) -> Turning:
        other = copy(self)
        other.c = self.c.copy()
        other.c[:, :, row] += change
        other.update_world()
        return other

    def update_world(self) -> None:
        """Set all quantities in the world frame."""
        rates = self.dc + np.cross(self.w[:, None, None], self.c)
        self.e, self.v = self.world_vectors(self.c), self.world_vectors(rates)
        self.e[:, :, [0, 2]] += self.o[:, None, None]
        self.v[:, :, [0, 2]] += self.do[:, None, None]
        self.pins, self.rates = self.e[:, :, 0], self.v[:, :, 0]

    @property
    def kinetic(self) -> Floats:
        """Kinetic energy, with the inertia perpendicular to the links' lines, J."""
        roll, pin, yaw = self.vehicle["track"]["inertia"]
        return super().kinetic + 0.5 * self.n * 0.5 * (roll + yaw - pin) * (self.w**2).sum(1)

    def world_vectors(self, a: Floats) -> Floats:
        return np.einsum("tij,tnaj->tnai", self.R, a)

    def advanced(self, tau: float) -> Turning:
        other = copy(self)
        other.c, other.o = self.c + tau * self.dc, self.o + tau * self.do
        other.R = self.R @ Rotation.from_rotvec(tau * self.w).as_matrix()
        other.update_world()
        return other

    def coordinate_accelerations(self, a: Floats) -> Floats:
        w, dw = self.w[:, None, None], self.dw[:, None, None]
        turning = 2.0 * np.cross(w, self.dc) + np.cross(dw, self.c) + np.cross(w, np.cross(w, self.c))
        accelerations = self.world_vectors(self.vectors(a) + turning)
        accelerations[:, :, [0, 2]] += self.ddo[:, None, None]
        return accelerations

    @property
    def axes(self) -> Floats:
        return np.broadcast_to(self.R[:, None, :, 1], self.e[:, :, 0].shape)

    def point(self, t, i, xi, y, off) -> tuple[Floats, Floats]:
        """Point with normal perpendicular to the pins' axis; ``y`` is perpendicular to the link.

        The link yaws relative to the pins' axis.
        """
        c, dc, S, C = self.c[t, i], self.dc[t, i], hermite(xi, self.pitch), hermite(xi, self.pitch, 1)
        x, u, slope, rate = (np.einsum("...a,...ai->...i", f, g) for f, g in ((S, c), (S, dc), (C, c), (C, dc)))
        across = np.array([0.0, 1.0, 0.0])
        plane = np.array([1.0, 0.0, 1.0])
        size = np.linalg.norm(slope * plane, axis=-1, keepdims=True)
        t_ = slope * plane / size
        turning = (rate * plane - t_ * (t_ * rate).sum(-1, keepdims=True)) / size
        off, y = np.asarray(off)[..., None], np.broadcast_to(y, np.shape(t))[..., None]
        x = x + off * np.cross(t_, across) + y * (across - slope[..., 1:2] / size * t_)
        u = u + off * np.cross(turning, across) - y * rate[..., 1:2] / size * t_
        return self.world_point(t, x, u)

    def pin(self, t, j, y) -> tuple[Floats, Floats]:
        y = np.broadcast_to(y, np.shape(t))[..., None] * np.array([0.0, 1.0, 0.0])
        return self.world_point(t, self.c[t, j, 0] + y, self.dc[t, j, 0])

    def world_point(self, t, x: Floats, u: Floats) -> tuple[Floats, Floats]:
        """Place and velocity in the world frame of points given along the axes, at the instants ``t``."""
        u = u + np.cross(self.w[t], x)
        return tuple(at[t] + np.einsum("...ij,...j->...i", self.R[t], a) for at, a in ((self.o, x), (self.do, u)))

    @property
    def strain_motion(self) -> tuple[Floats, Floats]:
        return self.c, self.dc

    def energies(self, e: Floats) -> Floats:
        """Strain energy, with the section's lateral bending about the normal, J."""
        section, (_, EI) = self.vehicle["section"], self.stiffness
        x, w = gauss(3)
        axis = self.R[:, :, 1].reshape(len(self.R), *[1] * (e.ndim - 3), 1, 3)
        bent = (self.slopes(e, x, 2) * axis).sum(-1)
        more = EI * (section["lateral_bending"] / section["bending"] - 1.0)
        return super().energies(e) + 0.5 * self.pitch * more * bent**2 @ w


class General(Cable):
    """Cable with local Green strain and curvature."""

    points = gauss(5), gauss(3)  # Gauss points of stretch and of bending for an energy per length

    def strains(self, e: Floats, xi) -> tuple[Floats, Floats]:
        """Axial strain, and the ratio of the force to EA times it, |r_x|."""
        size = np.linalg.norm(self.slopes(e, xi), axis=-1)
        return 0.5 * (size**2 - 1.0), size

    def curvature(self, e: Floats, xi) -> Floats:
        a, b = self.slopes(e, xi), self.slopes(e, xi, 2)
        return np.linalg.norm(np.cross(a, b), axis=-1) / np.linalg.norm(a, axis=-1) ** 3

    @cached_property
    def axial(self) -> Floats:
        x, w = self.points[0]
        strain, lever = self.strains(self.e, x)
        return self.stiffness[0] * (strain * lever) @ w

    def stretch_drag(self, x) -> tuple[Floats, Floats]:
        """Damping of the stretch at fractions (p) (T, n, p): force per unit of stretch, N, and its rate, 1/s."""
        slope = self.slopes(self.e, x)
        rate = (slope * self.slopes(self.v, x)).sum(-1)
        return self.tau * self.stiffness[0] * rate / (slope**2).sum(-1), rate

    @property
    def damping_tension(self) -> Floats:
        x, w = self.points[0]
        return np.einsum("p,tnp,tnpi,tni->tn", w, self.stretch_drag(x)[0], self.slopes(self.e, x), self.line)

    @property
    def material_loss(self) -> Floats:
        x, w = self.points[0]
        force, rate = self.stretch_drag(x)
        return self.pitch * (force * rate @ w).sum(1) + self.bending_loss

    def energies(self, e: Floats) -> Floats:
        EA, EI = self.stiffness
        (x, w), (s, m) = self.points
        return 0.5 * self.pitch * (EA * self.strains(e, x)[0] ** 2 @ w + EI * self.curvature(e, s) ** 2 @ m)


class Engineering(General):
    """Cable with strain |r_x| - 1, and curvature as angle per length of the straight link."""

    def strains(self, e: Floats, xi) -> tuple[Floats, Floats]:
        size = np.linalg.norm(self.slopes(e, xi), axis=-1)
        return size - 1.0, np.ones_like(size)

    def curvature(self, e: Floats, xi) -> Floats:
        a, b = self.slopes(e, xi), self.slopes(e, xi, 2)
        return np.linalg.norm(np.cross(a, b), axis=-1) / np.linalg.norm(a, axis=-1) ** 2


class Planar(Cable):
    """Cable without lateral coordinates: position and two slopes, x and z of each."""

    width = 6
    shared_nudges = ()

    def coordinates(self, x: Floats, places: bool) -> Floats:
        wide = np.zeros((*x.shape[:2], 8))
        wide[..., [0, 2, 3, 4, 5, 6]] = x
        return super().coordinates(wide, places)
