"""Step limits: spectral radii of the linearised coupling, stability limits of explicit integrators.

The coupling's limit is that of two masses joined by a contact and cut there like a track and its wheel: the side of the
track extrapolates the wheel by its velocity and outputs the mean force over the step, which the side of the wheel
receives. Both sides are exact, so any instability comes from the cut.

Two-mass oscillator cut into two exact components, and the theory of each coupling: masses m1 and m2 on wall springs and
dampers (k1, c1), (k2, c2), joined by (k, c). Three cuts:

- "wrench": through the spring, like a track and its wheel: side a (mass 1 and spring) extrapolates mass 2 by its
  velocity and outputs the mean force over the step; side b is mass 2.
- "spring": through the spring, instantaneous values: side a receives the velocity of mass 2 and outputs k times its
  stretch, a state; without coupling damper, whose force would depend on the input directly.
- "mass": at the masses: each side owns the coupling spring and receives position and velocity of the other mass.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from fmus.physics.ancf.cable import Cable
from fmus.physics.ancf.element import highest_frequency
from fmus.vehicles.sides import of_wheels
from orchestrator.cosim.graph import Floats, Quantity
from orchestrator.scene.kinds import Scene, VehicleScene


class Oscillator(NamedTuple):
    """Parameters of the oscillator, SI units."""

    k: float = 1.0  # coupling spring
    c: float = 0.0
    m1: float = 1.0
    m2: float = 1.0
    k1: float = 1.0
    k2: float = 1.0
    c1: float = 0.0
    c2: float = 0.0
    start: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)  # x1, v1, x2, v2


class LinearComponent(NamedTuple):
    """Linear component: x' = A x + B u, u' = E u inside a step; y = C x (value) or its mean of C x + D u."""

    A: Floats
    B: Floats
    C: Floats
    x: Floats  # start
    D: Floats
    E: Floats
    mean: bool
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    carries: tuple[Quantity, ...]  # what each input carries

    def map(self, h: float) -> tuple[Floats, Floats, Floats, Floats]:
        """Matrices of a step: x_after = P x + Q u, y_after = R x + S u."""
        n, m, r = len(self.A), self.B.shape[1], len(self.C)
        whole = np.zeros((n + m + r, n + m + r))
        whole[:n, : n + m] = np.hstack([self.A, self.B])
        whole[n : n + m, n : n + m] = self.E
        whole[n + m :, : n + m] = np.hstack([self.C, self.D])
        end = expm(whole * h)
        P, Q = end[:n, :n], end[:n, n : n + m]
        if self.mean:
            return P, Q, end[n + m :, :n] / h, end[n + m :, n : n + m] / h
        return P, Q, self.C @ P, self.C @ Q


def sides(cut: str, o: Oscillator) -> tuple[LinearComponent, LinearComponent]:
    """Side a, which steps first in sequential couplings, and side b."""
    x1, v1, x2, v2 = o.start
    if cut == "mass":
        return (
            _joined(o, o.m1, o.k1, o.c1, x1, v1, ("x2", "v2"), ("x1", "v1")),
            _joined(o, o.m2, o.k2, o.c2, x2, v2, ("x1", "v1"), ("x2", "v2")),
        )
    none = np.zeros((1, 1))
    b = LinearComponent(
        np.array([[0.0, 1.0], [-o.k2 / o.m2, -o.c2 / o.m2]]), np.array([[0.0], [1.0 / o.m2]]), np.eye(2),
        np.array([x2, v2]), np.zeros((2, 1)), none, False,
        ("force",), ("x", "v"), ("mean",) if cut == "wrench" else ("value",),
    )  # fmt: skip
    if cut == "wrench":
        a = _joined(o, o.m1, o.k1, o.c1, x1, v1, ("x", "v"), ("force",))
        moving = np.array([[0.0, 1.0], [0.0, 0.0]])
        force, back = np.array([[o.k, o.c]]), np.array([[-o.k, -o.c]])
        return a._replace(C=force, D=back, E=moving, mean=True, carries=("state", "rate")), b
    a = LinearComponent(
        np.array([[0.0, 1.0, 0.0], [-o.k1 / o.m1, -o.c1 / o.m1, -o.k / o.m1], [0.0, 1.0, 0.0]]),
        np.array([[0.0], [0.0], [-1.0]]), np.array([[0.0, 0.0, o.k]]), np.array([x1, v1, x1 - x2]), none, none, False,
        ("v",), ("force",), ("value",),
    )  # fmt: skip
    return a, b._replace(C=np.array([[0.0, 1.0]]), D=none, outputs=("v",))


def _joined(
    o: Oscillator, m: float, k: float, c: float, x: float, v: float, inputs: tuple[str, ...], outputs: tuple[str, ...]
) -> LinearComponent:
    """Mass on its wall spring ``k`` and damper ``c`` and the coupling spring; inputs move its other end."""
    A = np.array([[0.0, 1.0], [-(k + o.k) / m, -(c + o.c) / m]])
    B = np.array([[0.0, 0.0], [o.k / m, o.c / m]])
    zero = np.zeros((2, 2))
    return LinearComponent(A, B, np.eye(2), np.array([x, v]), zero, zero, False, inputs, outputs, ("value", "value"))


def amplification(scheme: str, hold: str, cut: str, o: Oscillator, h: float) -> Floats:
    """Matrix of a step of constant length, on (x_a, x_b, y_a, y_b, the last y_a and y_b)."""
    a, b = sides(cut, o)
    (Pa, Qa, Ra, Sa), (Pb, Qb, Rb, Sb) = a.map(h), b.map(h)
    sizes = [len(a.x), len(b.x), len(a.C), len(b.C), len(a.C), len(b.C)]
    xa, xb, ya, yb, pa, pb = np.split(np.eye(sum(sizes)), np.cumsum(sizes)[:-1])

    def column(side: LinearComponent, value: float, mean: float, rate: float) -> Floats:
        """Weight of each input by what it carries; 0 for a state."""
        weight = {"value": value, "mean": mean, "state": 0.0, "rate": rate}
        return np.array([[weight[kind]] for kind in side.carries])

    extrapolated = hold == "linear"
    ahead = [column(side, 0.5, 1.0, 0.0 if scheme == "tracks_first" else 0.5) * extrapolated for side in (a, b)]
    within = [column(side, 0.5, 1.0, 0.5) if extrapolated else column(side, 1.0, 1.0, 1.0) for side in (a, b)]

    def foreseen(side: int, now: Floats, before: Floats) -> Floats:
        slope = now - before
        if cut == "mass":  # the velocity is sent with the position
            slope = np.vstack([h * now[1], slope[1]])
        return now + ahead[side] * slope

    ua, ub = foreseen(0, yb, pb), foreseen(1, ya, pa)
    if scheme == "iterative":  # u_a = y_b + w (y_b' - y_b), where y_b' depends on u_a through y_a'
        gain = within[0] * (Sb @ (within[1] * Sa))
        rest = yb + within[0] * (Rb @ xb + Sb @ (ya + within[1] * (Ra @ xa - ya)) - yb)
        ua = np.asarray(np.linalg.solve(np.eye(len(gain)) - gain, rest), dtype=np.float64)
    if scheme != "jacobi":
        ub = ya + within[1] * (Ra @ xa + Sa @ ua - ya)
    ya_after, yb_after = Ra @ xa + Sa @ ua, Rb @ xb + Sb @ ub
    return np.vstack([Pa @ xa + Qa @ ua, Pb @ xb + Qb @ ub, ya_after, yb_after, ya, yb])


def radius(scheme: str, hold: str, cut: str, o: Oscillator, h: float) -> float:
    """Spectral radius of a step."""
    return float(np.abs(np.linalg.eigvals(amplification(scheme, hold, cut, o, h))).max())


MAX_STEP = 0.5  # s
RUNGE_KUTTA = 2.785  # end of the stability region on the real axis, classical method
AMPLIFIED = 1.0 + 1e-6  # spectral radius beyond rounding


def coupling_limit(pair: Oscillator) -> float:
    """First step, s, at which the spectral radius exceeds 1; MAX_STEP if none does."""

    def growth(h: float) -> float:
        return radius("tracks_first", "linear", "wrench", pair, h) - AMPLIFIED

    for before, after in pairwise(np.geomspace(1e-5, MAX_STEP, 200)):
        if growth(after) > 0.0:
            return float(brentq(growth, before, after, rtol=1e-6))
    return MAX_STEP


def explicit_limit(frequency: float, relaxation: float = 0.0) -> float:
    """Largest step of classical Runge-Kutta, s, for a mode of ``frequency``, rad/s, and its damping.

    The mode is x'' + relaxation w^2 x' + w^2 x = 0, as of a material with that relaxation time, s.
    """
    roots = np.roots([1.0, relaxation * frequency**2, frequency**2])

    def growth(h: float) -> float:
        z = h * roots
        return float(abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24).max()) - 1.0

    high = 0.9 * RUNGE_KUTTA / float(abs(roots).max())  # stable for any damping
    while growth(high) <= 0.0:
        high *= 1.01
    return float(brentq(growth, high / 1.01, high, rtol=1e-9))


def pairs(scene: VehicleScene) -> dict[str, Oscillator]:
    """Cuts of a vehicle as two masses on a contact, with the loads of the vehicle at rest.

    Mass 1 is that of the links in contact, on the ground below; mass 2 is what the chain moves, on its own springs.
    """
    v = scene.vehicle
    contact, ground, link = v.contact.wheel, v.contact.ground, v.track.mass
    wrapped = math.pi * v.idler.radius / v.track.pitch  # links on half of the idler
    load = v.gravity * v.total_mass(scene.tracks) / (2.0 * len(v.road_wheel.x))
    arm, count = np.array(v.road_arm.mass if v.road_arm else 0.0), len(v.road_wheel.x)
    stiffness, damping = (
        max(of_wheels(getattr(v.suspension, key, None) or 0.0, count)) for key in ("stiffness", "damping")
    )
    spin = float(np.min(v.road_wheel.spin_inertia / np.square(v.road_wheel.radius)))
    return {
        "road wheel on its link": Oscillator(
            k=contact.stiffness, c=contact.damping, m1=link, m2=float(np.min(np.add(v.road_wheel.mass, 0.5 * arm))),
            k1=ground.stiffness, c1=ground.damping, k2=stiffness, c2=damping,
        ),
        "idler in its bend": Oscillator(
            k=0.5 * wrapped * contact.stiffness, c=0.5 * wrapped * contact.damping, m1=wrapped * link, m2=v.idler.mass,
            k1=2.0 * v.material.youngs_modulus * v.section.area / abs(v.idler.x),  # both spans to the sprocket
            k2=v.tensioner.stiffness, c2=v.tensioner.damping,
        ),
        "friction that spins a road wheel": Oscillator(
            k=0.0, c=contact.friction * load / contact.friction_velocity, m1=link, m2=spin, k1=0.0, k2=0.0,
            c1=ground.friction * load / ground.friction_velocity,
        ),
    }  # fmt: skip


def link_frequency(scene: Scene) -> float:
    """Highest frequency of a free straight link, rad/s: an upper bound for its chain."""
    v = scene.vehicle
    E, A, I, l, mass = v.material.youngs_modulus, v.section.area, v.section.bending, v.track.pitch, v.track.mass
    rotary = v.track.inertia[1] - mass * l**2 / 12.0
    return highest_frequency(Cable(l, mass / l, E * A, E * I, 0.0, 0.0, rotary=rotary))


def predicted(scene: Scene) -> tuple[float, str]:
    """Longest step, s, and its cause; NaN without a limit (implicit links alone)."""
    if scene.track.integrator == "runge_kutta" and "element" in scene.track.choices():
        return explicit_limit(link_frequency(scene), scene.vehicle.material.relaxation_time), "highest mode of a link"
    if not isinstance(scene, VehicleScene):
        return math.nan, ""
    return min((coupling_limit(pair), name) for name, pair in pairs(scene).items())
