"""Links as their READMEs define them: points of a link, its mass, strain and tension; the rigid kind.

Plain numpy, world axes, all instants at once: T instants, n links, e the coordinates of elements. The states are read
as the READMEs of the two tracks describe them; no kernel is used.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from functools import cached_property

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.spatial.transform import Rotation

from mirror.motion import ground_frame, rotation_of, start_frame
from mirror.record import Floats, Part

UP = np.array([0.0, 0.0, 1.0])
STRETCH = 1e-6  # for differences of energies


def gauss(count: int) -> tuple[Floats, Floats]:
    """Gauss abscissae and weights on the unit interval."""
    x, w = leggauss(count)
    return 0.5 * (x + 1.0), 0.5 * w


def hermite(xi, l: float, derivative: int = 0) -> Floats:
    """Cubic shape functions of position and slope at both ends, or their derivatives by length (..., 4)."""
    table = np.array([[1, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1]], float).T  # powers of xi, shapes
    for _ in range(derivative):
        table = table[1:] * np.arange(1.0, len(table))[:, None]
    x = np.asarray(xi, float)[..., None]
    shapes = 0.0 * x
    for row in table[::-1]:
        shapes = row + x * shapes
    return shapes * [1.0, l, 1.0, l] / l**derivative


class Chain:
    """Common part of all kinds of links."""

    guided = False  # whether links have guides, and a width

    def __init__(self, part: Part) -> None:
        self.part = part
        track, self.vehicle = part.config["track"], part.config["vehicle"]
        self.n, self.closed = int(track["links"]), bool(track["closed"])
        self.nodes = self.n if self.closed else self.n + 1
        self.pitch, self.face = self.vehicle["track"]["pitch"], self.vehicle["track"]["face"]
        self.gravity = float(track["gravity"])
        quarter = 0.25 * self.vehicle["track"]["width"]
        self.lateral = (-quarter, quarter) if self.guided else (0.0,)  # of contact points from the middle, m
        p = part.parameters
        self.turn = ground_frame(p)
        self.across = self.turn.apply([0, 1, 0])
        self.origin = start_frame(p)[0] + float(p["start.lateral"]) * self.across
        self.second = (np.arange(self.n) + 1) % self.nodes  # second pin of each link
        self.read(part.state)

    def world(self, a: Floats) -> Floats:
        """Vectors (..., 3) from the axes of the start to the world's."""
        return self.turn.apply(a.reshape(-1, 3)).reshape(a.shape)

    read: Callable[[Floats], None]  # a state
    advanced: Callable[[float], Chain]  # the chain some s later (or earlier) at its present rates
    # positions and velocities (T, nodes, 3) of the pins
    pins: Floats
    rates: Floats

    def __copy__(self) -> Chain:
        """Return a chain whose coordinates may be changed: what was computed from them is not copied."""
        other = object.__new__(type(self))
        derived = {
            name for kind in type(self).__mro__ for name, a in vars(kind).items() if isinstance(a, cached_property)
        }
        other.__dict__ = {name: a for name, a in self.__dict__.items() if name not in derived}
        return other

    @cached_property
    def line(self) -> Floats:
        """Unit vector from the first to the last pin of each link (T, n, 3)."""
        line = self.ends[1] - self.ends[0]
        return line / np.linalg.norm(line, axis=-1, keepdims=True)

    @cached_property
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
    """Links with nodal coordinates; subclasses give ``point``, ``pin``, and what is annotated here."""

    state_rates: Floats  # (T, nodes, w) rates in the state's layout
    # element coordinates (T, n, rows, 3), world frame, of a state's values (T, nodes, w), of places or of rates
    coordinates: Callable[[Floats, bool], Floats]
    centreline: Callable[..., Floats]  # shape functions (..., rows) on the axis, or their derivative
    mass_matrix: Floats  # integral of rho S_a S_b
    energies: Callable[[Floats], Floats]  # strain energy of elements at coordinates (..., rows, 3), J
    shared_nudges: tuple[Floats, ...]  # unit changes of the vector ``shared_row``, in the axes of ``nudged``
    damping_tension: Floats  # contribution of damping to the tension of each link (T, n), N
    material_loss: Floats  # power lost in the material of all links (T), W
    excess_inertia: float  # second moment of mass along the link beyond a rod's, kg m2, on the mean slope of the line

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

    shared_row = 1  # vector of an element that is a gradient which it shares at its first pin, in some directions

    def nudged(self, row: int, change: Floats) -> Element:
        """The chain with a vector of all elements changed."""
        other = copy(self)
        other.e = self.e.copy()
        other.e[:, :, row] += change
        return other

    def advanced(self, tau: float) -> Element:
        other = copy(self)
        other.e, other.pins = self.e + tau * self.v, self.pins + tau * self.rates
        return other

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

    @cached_property
    def middle(self) -> Floats:
        return 0.5 * (self.ends[0] + self.ends[1])

    def coordinate_accelerations(self, a: Floats) -> Floats:
        """Accelerations (T, n, rows, 3), world frame, from derivatives ``a`` of the rates (T, nodes, w)."""
        return self.coordinates(a, False)

    @cached_property
    def momentum(self) -> Floats:
        """Momentum of each link (T, n, 3)."""
        x, w = gauss(4)
        return self.mass * np.einsum("p,pa,tnai->tni", w, self.centreline(x), self.v)

    @cached_property
    def stretch_mode(self) -> Floats:
        """Change of coordinates (T, n, rows, 3) by a unit stretch along the line of the pins."""
        line = self.line
        mode, half = np.zeros_like(self.e), self.e.shape[2] // 2
        mode[:, :, 0], mode[:, :, half] = -0.5 * self.pitch * line, 0.5 * self.pitch * line
        mode[:, :, 1] = mode[:, :, half + 1] = line
        return mode

    @cached_property
    def tension(self) -> Floats:
        """Tension of each link (T, n), N: work of a stretch, over the length."""
        more, less = (self.energies(self.e + way * STRETCH * self.stretch_mode) for way in (1.0, -1.0))
        return (more - less) / (2.0 * STRETCH * self.pitch) + self.damping_tension

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
