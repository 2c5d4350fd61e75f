"""The kinds of links as their READMEs define them: points of a link, its mass, strain and tension.

Plain numpy, world axes, all instants at once: T instants, n links, e the coordinates of elements. The states are read
as the READMEs of the two tracks describe them; no kernel is used.
"""

from __future__ import annotations

from copy import copy
from functools import cached_property

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.spatial.transform import Rotation

from mirror.motion import rotation_of, start_frame
from mirror.record import Floats, Part

UP = np.array([0.0, 0.0, 1.0])
STRETCH = 1e-6  # for differences of energies


def gauss(count: int) -> tuple[Floats, Floats]:
    """Gauss abscissae and weights on the unit interval."""
    x, w = leggauss(count)
    return 0.5 * (x + 1.0), 0.5 * w


def hermite(xi, l: float, derivative: int = 0) -> Floats:
    """Cubic shape functions of position and slope at both ends, or their derivatives by length (..., 4)."""
    table = ([1, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1])  # by powers of xi
    shapes = []
    for a, row in enumerate(table):
        p = np.polynomial.Polynomial(row).deriv(derivative) if derivative else np.polynomial.Polynomial(row)
        shapes.append(p(np.asarray(xi, float)) * (l if a % 2 else 1.0) / l**derivative)
    return np.stack(shapes, axis=-1)


class Chain:
    """Common part of all kinds of links."""

    lateral: tuple[float, ...] = (0.0,)  # lateral places of contact points from the middle, m
    guided = False

    def __init__(self, part: Part) -> None:
        self.part = part
        track, self.vehicle = part.config["track"], part.config["vehicle"]
        self.n, self.closed = int(track["links"]), bool(track["closed"])
        self.nodes = self.n if self.closed else self.n + 1
        self.pitch, self.face = self.vehicle["track"]["pitch"], self.vehicle["track"]["face"]
        self.gravity = float(track["gravity"])
        p = part.parameters
        heading = float(p["start.heading"])
        self.turn = Rotation.from_euler("z", heading)
        self.ahead, self.across = self.turn.apply([1, 0, 0]), self.turn.apply([0, 1, 0])
        self.origin = start_frame(p)[0] + float(p["start.lateral"]) * self.across
        self.second = (np.arange(self.n) + 1) % self.nodes  # second pin of each link
        self.read(part.state)

    def world(self, a: Floats) -> Floats:
        """Vectors (..., 3) from the axes of the start to the world's."""
        return self.turn.apply(a.reshape(-1, 3)).reshape(a.shape)

    def read(self, state: Floats) -> None:
        raise NotImplementedError

    def advanced(self, tau: float) -> Chain:
        """The chain ``tau`` s later (or earlier) at its present rates."""
        raise NotImplementedError

    # positions and velocities (T, nodes, 3) of the pins
    pins: Floats
    rates: Floats

    @property
    def ends(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Both pins of each link, and their velocities, (T, n, 3) each."""
        return self.pins[:, : self.n], self.pins[:, self.second], self.rates[:, : self.n], self.rates[:, self.second]

    @property
    def mass(self) -> float:
        """Mass of a link, kg."""
        return self.vehicle["track"]["mass"]


class Rigid(Chain):
    """Rigid links: pose, velocity of the centre of mass, body-fixed angular velocity."""

    guided = True

    def read(self, state: Floats) -> None:
        T, n = len(state), self.n
        q, v = state[:, : 7 * n].reshape(T, n, 7), state[:, 7 * n : 13 * n].reshape(T, n, 6)
        self.lateral = (-0.25 * self.vehicle["track"]["width"], 0.25 * self.vehicle["track"]["width"])
        self.centre, self.velocity = self.origin + self.world(q[..., :3]), self.world(v[..., :3])
        self.body_rates, self.state_rates = v[..., 3:], v
        body = (self.turn * rotation_of(q[..., 3:].reshape(-1, 4))).as_matrix().reshape(T, n, 3, 3)
        self.body, self.spin = body, np.einsum("tnij,tnj->tni", body, v[..., 3:])
        half, swing = 0.5 * self.pitch * body[..., 0], 0.5 * self.pitch * np.cross(self.spin, body[..., 0])
        self.pins = np.concatenate([self.centre - half, (self.centre + half)[:, -1:]], axis=1)[:, : self.nodes]
        self.rates = np.concatenate([self.velocity - swing, (self.velocity + swing)[:, -1:]], axis=1)[:, : self.nodes]
        self.axes = body[..., 1]
        self.pin_axes = np.concatenate([body[..., 1], body[:, -1:, :, 1]], axis=1)[:, : self.nodes]

    def advanced(self, tau: float) -> Rigid:
        other = copy(self)
        about = Rotation.from_rotvec(tau * self.spin.reshape(-1, 3)).as_matrix().reshape(self.body.shape)
        other.centre, other.body = self.centre + tau * self.velocity, about @ self.body
        arm = 0.5 * self.pitch * other.body[..., 0]
        other.pins = np.concatenate([other.centre - arm, (other.centre + arm)[:, -1:]], axis=1)[:, : self.nodes]
        return other

    def point(self, t, i, xi, y, off) -> tuple[Floats, Floats]:
        """Place and velocity of a point of link ``i`` at instant ``t``.

        The point is a fraction ``xi`` along the link, ``y`` across and ``off`` outwards, m.
        """
        local = np.stack(np.broadcast_arrays((np.asarray(xi) - 0.5) * self.pitch, y, off), axis=-1)
        arm = np.einsum("...ij,...j->...i", self.body[t, i], local)
        return self.centre[t, i] + arm, self.velocity[t, i] + np.cross(self.spin[t, i], arm)

    def pin(self, t, j, y) -> tuple[Floats, Floats]:
        """Position and velocity of points of pins ``j`` at ``y``, m, from their middle."""
        at_end = j >= self.n
        return self.point(t, np.where(at_end, j - 1, j), np.where(at_end, 1.0, 0.0), y, 0.0)

    @property
    def kinetic(self) -> Floats:
        J = np.array(self.vehicle["track"]["inertia"])
        return 0.5 * (self.mass * self.velocity**2).sum((1, 2)) + 0.5 * (J * self.body_rates**2).sum((1, 2))

    @property
    def height(self) -> Floats:
        """Height of the centre of mass of each link (T, n), m."""
        return self.centre[..., 2]

    strain_energy = 0.0

    def momentum_rates(self, a: Floats) -> tuple[Floats, Floats]:
        """Rates of momentum, and of angular momentum about the middle, of each link (T, n, 3).

        ``a`` are the derivatives of the state's rates.
        """
        J = np.array(self.vehicle["track"]["inertia"])
        torque = J * a[..., 3:] + np.cross(self.body_rates, J * self.body_rates)
        return self.mass * self.world(a[..., :3]), np.einsum("tnij,tnj->tni", self.body, torque)

    @property
    def momentum(self) -> Floats:
        """Momentum of each link (T, n, 3)."""
        return self.mass * self.velocity

    middle = property(lambda self: self.centre)

    def gradients_at(self, xi: float) -> Floats:
        """Unit vector along each link (T, n, 3)."""
        return self.body[..., 0]


class Element(Chain):
    """Links with nodal coordinates; subclasses give ``points`` and shape functions."""

    state_rates: Floats  # (T, nodes, w) rates in the state's layout

    def coordinates(self, x: Floats, places: bool) -> Floats:
        """Element coordinates (T, n, rows, 3), world frame, of a state's values (T, nodes, w)."""
        raise NotImplementedError

    def read(self, state: Floats) -> None:
        T, size = len(state), self.nodes * self.width
        q = state[:, :size].reshape(T, self.nodes, self.width)
        self.state_rates = state[:, size : 2 * size].reshape(T, self.nodes, self.width)
        self.e, self.v = self.coordinates(q, True), self.coordinates(self.state_rates, False)
        half = self.e.shape[2] // 2
        self.pins, self.rates = self.e[:, :, 0], self.v[:, :, 0]
        if not self.closed:
            self.pins = np.concatenate([self.pins, self.e[:, -1:, half]], axis=1)
            self.rates = np.concatenate([self.rates, self.v[:, -1:, half]], axis=1)

    def advanced(self, tau: float) -> Element:
        other = copy(self)
        other.e, other.pins = self.e + tau * self.v, self.pins + tau * self.rates
        return other

    @cached_property
    def mass_matrix(self) -> Floats:
        """Mass matrix: integral of rho S_a S_b."""
        raise NotImplementedError

    def energies(self, e: Floats) -> Floats:
        """Strain energy of elements at coordinates ``e`` (..., rows, 3), J."""
        raise NotImplementedError

    @property
    def strain_energy(self) -> Floats:
        return self.energies(self.e).sum(1)

    @property
    def kinetic(self) -> Floats:
        return 0.5 * np.einsum("ab,tnai,tnbi->t", self.mass_matrix, self.v, self.v)

    @property
    def height(self) -> Floats:
        x, w = gauss(4)
        return np.einsum("p,pa,tna->tn", w, self.centreline(x), self.e[..., 2])

    def centreline(self, xi, derivative: int = 0) -> Floats:
        """Shape functions (..., rows) on the axis."""
        raise NotImplementedError

    @property
    def middle(self) -> Floats:
        return 0.5 * (self.ends[0] + self.ends[1])

    def coordinate_accelerations(self, a: Floats) -> Floats:
        """Accelerations (T, n, rows, 3), world frame, from derivatives ``a`` of the rates (T, nodes, w)."""
        return self.coordinates(a, False)

    @property
    def momentum(self) -> Floats:
        """Momentum of each link (T, n, 3)."""
        x, w = gauss(4)
        return self.mass * np.einsum("p,pa,tnai->tni", w, self.centreline(x), self.v)

    @property
    def damping_tension(self) -> Floats:
        """Contribution of damping to the tension of each link (T, n), N."""
        raise NotImplementedError

    @property
    def material_loss(self) -> Floats:
        """Power lost in the material of all links (T), W."""
        raise NotImplementedError

    @cached_property
    def stretch_mode(self) -> Floats:
        """Change of coordinates (T, n, rows, 3) by a unit stretch along the line of the pins."""
        line = self.ends[1] - self.ends[0]
        line = line / np.linalg.norm(line, axis=-1, keepdims=True)
        mode, half = np.zeros_like(self.e), self.e.shape[2] // 2
        mode[:, :, 0], mode[:, :, half] = -0.5 * self.pitch * line, 0.5 * self.pitch * line
        mode[:, :, 1] = mode[:, :, half + 1] = line
        return mode

    @cached_property
    def tension(self) -> Floats:
        """Tension of each link (T, n), N: work of a stretch, over the length."""
        more, less = (self.energies(self.e + way * STRETCH * self.stretch_mode) for way in (1.0, -1.0))
        return (more - less) / (2.0 * STRETCH * self.pitch) + self.damping_tension

    @property
    def excess_inertia(self) -> float:
        """Second moment of mass along the link beyond a rod's, kg m2, on the mean slope of the line."""
        raise NotImplementedError

    @cached_property
    def mean_slope(self) -> Floats:
        """Weights (rows) of the mean slope of the line.

        First moment of the line about the middle, over that of unit slope.
        """
        x, w = gauss(4)
        return 12.0 / self.pitch * np.einsum("p,p,pa->a", w, x - 0.5, self.centreline(x))

    def slope_inertia_force(self, a: Floats) -> Floats:
        """Part of the inertia of the mean slope in the tension (T, n), N."""
        turning = np.einsum("a,tnai->tni", self.mean_slope, self.coordinate_accelerations(a))
        return self.excess_inertia / self.pitch * (turning * self.stretch_mode[:, :, 1]).sum(-1)

    def momentum_rates(self, a: Floats) -> tuple[Floats, Floats]:
        dde = self.coordinate_accelerations(a)
        x, w = gauss(4)
        linear = self.mass * np.einsum("p,pa,tnai->tni", w, self.centreline(x), dde)
        arm = self.e.copy()
        half = arm.shape[2] // 2
        for row in (0, half):
            arm[:, :, row] -= self.middle
        torque = np.cross(arm, np.einsum("ab,tnbi->tnai", self.mass_matrix, dde)).sum(2)
        return linear, torque


class Cable(Element):
    """Cable; a pin has position, slopes (x, z) of both links, and the shared y slope."""

    width = 8

    def coordinates(self, x: Floats, places: bool) -> Floats:
        first, last = x[:, : self.n], x[:, self.second]
        e = np.stack([first[..., [0, 1, 2]], first[..., [5, 7, 6]], last[..., [0, 1, 2]], last[..., [3, 7, 4]]], axis=2)
        e = self.world(e)
        if places:
            e[:, :, [0, 2]] += self.origin
        return e

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
        at, more = (
            self.axial / section["area"],
            self.stiffness[1] / section["bending"] * section["outer_fibre"] * bend,
        )
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
        self.lateral = (-0.25 * self.vehicle["track"]["width"], 0.25 * self.vehicle["track"]["width"])
        self.state_rates = state[:, size : 2 * size].reshape(T, self.nodes, self.width)
        f = state[:, 2 * size : 2 * size + 24]
        self.R = self.turn.as_matrix() @ f[:, :9].reshape(T, 3, 3)
        self.o, self.do, self.ddo = (
            self.origin + self.world(f[:, 9:12]),
            self.world(f[:, 12:15]),
            self.world(f[:, 15:18]),
        )
        self.w, self.dw = f[:, 18:21], f[:, 21:24]
        self.c = self.vectors(state[:, :size].reshape(T, self.nodes, self.width))
        self.dc = self.vectors(self.state_rates)
        self.update_world()

    def vectors(self, x: Floats) -> Floats:
        """Vectors (T, n, 4, 3) along the axes, from (T, nodes, 8)."""
        first, last = x[:, : self.n], x[:, self.second]
        return np.stack(
            [first[..., [0, 1, 2]], first[..., [5, 7, 6]], last[..., [0, 1, 2]], last[..., [3, 7, 4]]], axis=2
        )

    def update_world(self) -> None:
        """Set all quantities in the world frame."""
        self.e, self.v = (
            self.world_vectors(self.c),
            self.world_vectors(self.dc + np.cross(self.w[:, None, None], self.c)),
        )
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
        accelerations = (
            self.vectors(a) + 2.0 * np.cross(w, self.dc) + np.cross(dw, self.c) + np.cross(w, np.cross(w, self.c))
        )
        accelerations = self.world_vectors(accelerations)
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
        line = (self.ends[1] - self.ends[0]) / np.linalg.norm(self.ends[1] - self.ends[0], axis=-1, keepdims=True)
        return np.einsum("p,tnp,tnpi,tni->tn", w, self.stretch_drag(x)[0], self.slopes(self.e, x), line)

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

    def coordinates(self, x: Floats, places: bool) -> Floats:
        wide = np.zeros((*x.shape[:2], 8))
        wide[..., [0, 2, 3, 4, 5, 6]] = x
        return super().coordinates(wide, places)


class Beam(Element):
    """Beam; a pin has position, r_y along it, and r_x, r_z of the ending and of the beginning link."""

    width = 18
    guided = True

    def coordinates(self, x: Floats, places: bool) -> Floats:
        first, last = (a.reshape(*a.shape[:2], 6, 3) for a in (x[:, : self.n], x[:, self.second]))
        e = self.world(np.concatenate([first[:, :, [0, 4, 1, 5]], last[:, :, [0, 2, 1, 3]]], axis=2))
        if places:
            e[:, :, [0, 4]] += self.origin
        return e

    def read(self, state: Floats) -> None:
        super().read(state)
        self.lateral = (-0.25 * self.vehicle["track"]["width"], 0.25 * self.vehicle["track"]["width"])
        section = self.vehicle["section"]
        seconds = section["lateral_bending"], section["bending"]
        self.wide, self.high = (np.sqrt(12.0 * second / section["area"]) for second in seconds)

    @property
    def axes(self) -> Floats:
        """Axis of each link, the mean of its pins' axes."""
        axis = self.e[:, :, 2] + self.e[:, :, 6]
        return axis / np.linalg.norm(axis, axis=-1, keepdims=True)

    def shape(self, xi, y, z) -> Floats:
        xi, y, z = np.broadcast_arrays(np.asarray(xi, float), y, z)
        S = hermite(xi, self.pitch)
        return np.stack([S[..., 0], S[..., 1], y * (1 - xi), z * (1 - xi), S[..., 2], S[..., 3], y * xi, z * xi], -1)

    def centreline(self, xi, derivative: int = 0) -> Floats:
        S = hermite(xi, self.pitch, derivative)
        none = np.zeros_like(S[..., 0])
        return np.stack([S[..., 0], S[..., 1], none, none, S[..., 2], S[..., 3], none, none], -1)

    @cached_property
    def mass_matrix(self) -> Floats:
        """Mass of a box with the table's inertias; length beyond the pitch acts on the mean slope."""
        (x, w), (s, m) = gauss(4), gauss(2)
        M, slope, (roll, pin, yaw) = np.zeros((8, 8)), self.mean_slope, self.vehicle["track"]["inertia"]
        wide, high = (np.sqrt(6.0 * moment / self.mass) for moment in (roll + yaw - pin, roll + pin - yaw))
        for a, wa in zip(x, w, strict=True):
            for b, wb in zip(s - 0.5, m, strict=True):
                for c, wc in zip(s - 0.5, m, strict=True):
                    S = self.shape(a, b * wide, c * high)
                    M += self.mass * wa * wb * wc * np.outer(S, S)
        return M + self.excess_inertia * np.outer(slope, slope)

    @property
    def excess_inertia(self) -> float:
        roll, pin, yaw = self.vehicle["track"]["inertia"]
        return 0.5 * (pin + yaw - roll) - self.mass * self.pitch**2 / 12.0

    def point(self, t, i, xi, y, off) -> tuple[Floats, Floats]:
        S = self.shape(xi, y, off)
        return np.einsum("...a,...ai->...i", S, self.e[t, i]), np.einsum("...a,...ai->...i", S, self.v[t, i])

    def pin(self, t, j, y) -> tuple[Floats, Floats]:
        i, half = np.where(j >= self.n, j - 1, j), np.where(j >= self.n, 4, 0)
        y = np.asarray(y)[..., None]
        return self.e[t, i, half] + y * self.e[t, i, half + 2], self.v[t, i, half] + y * self.v[t, i, half + 2]

    def gradients(self, xi, y, z, e=None) -> Floats:
        """Deformation gradient F (T, n, 3, 3), columns r_x, r_y, r_z, at one place of all links."""
        e = self.e if e is None else e
        C, l = hermite(xi, self.pitch, 1), self.pitch
        D = np.array([[C[0], C[1], -y / l, -z / l, C[2], C[3], y / l, z / l],
                      [0, 0, 1 - xi, 0, 0, 0, xi, 0], [0, 0, 0, 1 - xi, 0, 0, 0, xi]])  # fmt: skip
        return np.einsum("ja,...ai->...ij", D, e)

    def gradients_at(self, xi: float) -> Floats:
        """Gradients r_x (T, n, 3) of the axis of all links at a fraction of their length."""
        return self.gradients(xi, 0.0, 0.0)[..., 0]

    @property
    def young(self) -> float:
        return float(self.part.parameters["material.youngs_modulus"])

    def strain_changes(self, change: Floats) -> list[tuple[float, Floats]]:
        """Changes of the quadratic strains, with energy weights, by a ``change`` of coordinates."""
        more, less = self.parts(self.e + 0.5 * change), self.parts(self.e - 0.5 * change)
        return [(w, s - r) for (w, s), (_, r) in zip(more, less, strict=True)]

    @property
    def damping_tension(self) -> Floats:
        tau, pairs = (
            float(self.part.parameters["material.relaxation_time"]),
            zip(self.strain_changes(self.v), self.strain_changes(self.stretch_mode), strict=True),
        )
        return 2.0 * tau / self.pitch * sum(w * rate * by for (w, rate), (_, by) in pairs)

    @property
    def material_loss(self) -> Floats:
        tau = float(self.part.parameters["material.relaxation_time"])
        return 2.0 * tau * sum(w * rate**2 for w, rate in self.strain_changes(self.v)).sum(1)

    @cached_property
    def stress(self) -> Floats:
        """Largest E times Green's strain xx at the section's corners, at the Gauss points of the axis, Pa."""
        largest = 0.0
        for x in gauss(4)[0]:
            for y in (-0.5 * self.wide, 0.5 * self.wide):
                for z in (-self.vehicle["section"]["outer_fibre"], self.vehicle["section"]["outer_fibre"]):
                    slope = self.gradients(x, y, z)[..., 0]
                    largest = np.maximum(largest, abs(self.young * 0.5 * ((slope**2).sum(-1) - 1.0)))
        return largest

    @property
    def pin_axes(self) -> Floats:
        axis = np.concatenate([self.e[:, :, 2], self.e[:, -1:, 6]], axis=1)[:, : self.nodes]
        return axis / np.linalg.norm(axis, axis=-1, keepdims=True)

    @cached_property
    def fibres(self) -> tuple[Floats, Floats]:
        """E times Green's strain xx at mid-width, mean along the link, outside and inside, Pa."""
        off, (x, w) = self.vehicle["section"]["outer_fibre"], gauss(4)
        return tuple(
            sum(b * self.young * 0.5 * ((self.gradients(a, 0.0, z)[..., 0] ** 2).sum(-1) - 1.0)
                for a, b in zip(x, w, strict=True))
            for z in (off, -off)
        )  # fmt: skip

    def energies(self, e: Floats) -> Floats:
        """Strain energy of elements at coordinates ``e`` (..., 8, 3), J."""
        return sum(w * s**2 for w, s in self.parts(e))

    def parts(self, e: Floats) -> list[tuple[float, Floats]]:
        """The energy as weights, J, and strains; the energy is the sum of weight times strain squared.

        Saint-Venant-Kirchhoff: without lateral coupling over the section, the rest of Hooke's law on the axis. Shears
        xy and xz have the torsion factor over the section; on the axis they have the rest of the transverse shear.
        """
        section, material = self.vehicle["section"], self.vehicle["material"]
        E, nu = self.young, 0.5 * material["youngs_modulus"] / material["shear_modulus"] - 1.0
        G = 0.5 * E / (1.0 + nu)
        lame = 2.0 * G * nu / (1.0 - 2.0 * nu)
        twist = section["torsion"] / (section["bending"] + section["lateral_bending"])
        volume, terms = 0.5 * section["area"] * self.pitch, []
        (x, w), (s, m) = gauss(4), gauss(2)

        def strains(a: float, y: float, z: float) -> tuple[Floats, Floats, Floats]:
            """Normal strains, the two shears with the axis, and the shear within the section."""
            F = self.gradients(a, y, z, e)
            C = np.einsum("...ij,...ik->...jk", F, F)
            normal = 0.5 * (np.stack([C[..., i, i] for i in range(3)], -1) - 1.0)
            return normal, np.stack([C[..., 0, 1], C[..., 0, 2]], -1), C[..., 1, 2]

        for a, wa in zip(x, w, strict=True):
            for b, wb in zip(s - 0.5, m, strict=True):
                for c, wc in zip(s - 0.5, m, strict=True):
                    normal, along, within = strains(a, b * self.wide, c * self.high)
                    w = volume * wa * wb * wc
                    terms += [(w * E, normal[..., i]) for i in range(3)]
                    terms += [(w * twist * G, along[..., i]) for i in range(2)] + [(w * G, within)]
            normal, along, _ = strains(a, 0.0, 0.0)
            terms.append((volume * wa * lame, normal.sum(-1)))
            terms += [(volume * wa * (2.0 * G - E), normal[..., i]) for i in range(3)]
            terms += [(volume * wa * (5.0 / 6.0 - twist) * G, along[..., i]) for i in range(2)]
        return terms


KINDS = {"cable": Cable, "planar": Planar, "beam": Beam, "general": General, "engineering": Engineering}


def chain(part: Part) -> Chain:
    """Return the links of a track."""
    if part.kind == "TrackRigid":
        return Rigid(part)
    if part.parameters["axes"] == "free":
        return Turning(part)
    elasticity = str(part.parameters["elasticity"])
    return KINDS[str(part.parameters["element"]) if elasticity == "small_deformation" else elasticity](part)
