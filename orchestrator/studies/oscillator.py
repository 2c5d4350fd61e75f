"""The two-mass oscillator cut in two exact slaves, and what theory says of each coupling of them.

Masses m1 and m2 on wall springs and dampers (k1, c1), (k2, c2), joined by (k, c). Three cuts:

- "wrench": through the spring, as a track and its wheel: side a (mass 1 and spring) moves mass 2 on by its velocity and
  gives the mean force over the step; side b is mass 2.
- "spring": through the spring, instantaneous values: side a gets the velocity of mass 2 and gives k times its own
  stretch, a state; without coupling damper, whose force would depend on the input at once.
- "mass": at the masses: each side owns the coupling spring and is told position and velocity of the other mass.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import expm

from fmus.physics.arrays import Floats
from orchestrator.cosim.graph import Connection, Instance, Kind, Stages, System, wire


class Oscillator(NamedTuple):
    """The system, SI."""

    k: float = 1.0  # of the coupling spring
    c: float = 0.0
    m1: float = 1.0
    m2: float = 1.0
    k1: float = 1.0
    k2: float = 1.0
    c1: float = 0.0
    c2: float = 0.0
    start: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)  # x1, v1, x2, v2


class Side(NamedTuple):
    """x' = A x + B u, u' = E u inside a step; y = C x (value) or its mean of C x + D u."""

    A: Floats
    B: Floats
    C: Floats
    x: Floats  # at the start
    D: Floats
    E: Floats
    mean: bool
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    given: tuple[Kind, ...]  # what each input carries

    def map(self, h: float) -> tuple[Floats, Floats, Floats, Floats]:
        """x_after = P x + Q u, y_after = R x + S u over a step."""
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


def sides(cut: str, o: Oscillator) -> tuple[Side, Side]:
    """Side a, which steps first where there is an order, and side b."""
    x1, v1, x2, v2 = o.start
    if cut == "mass":
        return (
            _joined(o, o.m1, o.k1, o.c1, x1, v1, ("x2", "v2"), ("x1", "v1")),
            _joined(o, o.m2, o.k2, o.c2, x2, v2, ("x1", "v1"), ("x2", "v2")),
        )
    none = np.zeros((1, 1))
    b = Side(
        np.array([[0.0, 1.0], [-o.k2 / o.m2, -o.c2 / o.m2]]), np.array([[0.0], [1.0 / o.m2]]), np.eye(2),
        np.array([x2, v2]), np.zeros((2, 1)), none, False,
        ("force",), ("x", "v"), ("mean",) if cut == "wrench" else ("value",),
    )  # fmt: skip
    if cut == "wrench":
        a = _joined(o, o.m1, o.k1, o.c1, x1, v1, ("x", "v"), ("force",))
        moving = np.array([[0.0, 1.0], [0.0, 0.0]])
        force, back = np.array([[o.k, o.c]]), np.array([[-o.k, -o.c]])
        return a._replace(C=force, D=back, E=moving, mean=True, given=("state", "rate")), b
    a = Side(
        np.array([[0.0, 1.0, 0.0], [-o.k1 / o.m1, -o.c1 / o.m1, -o.k / o.m1], [0.0, 1.0, 0.0]]),
        np.array([[0.0], [0.0], [-1.0]]), np.array([[0.0, 0.0, o.k]]), np.array([x1, v1, x1 - x2]), none, none, False,
        ("v",), ("force",), ("value",),
    )  # fmt: skip
    return a, b._replace(C=np.array([[0.0, 1.0]]), D=none, outputs=("v",))


def _joined(
    o: Oscillator, m: float, k: float, c: float, x: float, v: float, inputs: tuple[str, ...], outputs: tuple[str, ...]
) -> Side:
    """A mass on its wall's spring ``k`` and damper ``c`` and on those of the coupling, whose other end is the input."""
    A = np.array([[0.0, 1.0], [-(k + o.k) / m, -(c + o.c) / m]])
    B = np.array([[0.0, 0.0], [o.k / m, o.c / m]])
    zero = np.zeros((2, 2))
    return Side(A, B, np.eye(2), np.array([x, v]), zero, zero, False, inputs, outputs, ("value", "value"))


class Slave:
    """A side as the master sees a component."""

    def __init__(self, name: str, side: Side, u: Floats, y: Floats) -> None:
        self.name, self.side, self.inputs, self.outputs = name, side, side.inputs, side.outputs
        self.u, self.y = u.copy(), y.copy()
        self.x = side.x.copy()
        self.steps = 0  # done in all, also those taken back
        self._after = y.copy()
        self._map = cache(side.map)

    def write(self) -> None:
        """Inputs lie where the step finds them."""

    def step(self, t: float, h: float) -> None:
        """Exact for what is given."""
        P, Q, R, S = self._map(h)
        self._after = R @ self.x + S @ self.u
        self.x = P @ self.x + Q @ self.u
        self.steps += 1

    def read(self) -> None:
        """Outputs."""
        self.y[:] = self._after

    def save(self) -> Any:
        """The state with the arrays."""
        return self.x.copy(), self.u.copy(), self.y.copy()

    def restore(self, state: Any) -> None:
        """Back again."""
        self.x = state[0].copy()
        self.u[:], self.y[:] = state[1:]

    def free(self, state: Any) -> None:
        """Nothing to do."""


def coupled(cut: str, o: Oscillator, kind_of_b: type[Slave] = Slave) -> tuple[Stages, Slave, Slave]:
    """Both sides, wired; force and velocity are a power bond."""
    a, b = sides(cut, o)
    yb = b.C @ b.x  # what both sides show at t = 0: a force that depends on the input sees the true one
    ya = a.C @ a.x + (a.D @ yb if a.mean else 0.0)
    one, two = Slave("a", a, yb, ya), kind_of_b("b", b, ya, yb)
    connections = [
        Connection(
            source, (output,), target, (name,), kind,
            rates=(output.replace("x", "v"),) if output in ("x1", "x2") else (),  # positions of the cut at the masses
            bond="spring" if output in ("force", "v") else "",
        )
        for source, target, side, peer in (("b", "a", a, b), ("a", "b", b, a))
        for output, name, kind in zip(peer.outputs, side.inputs, side.given, strict=True)
    ]  # fmt: skip
    system = System((Instance("a", None, {}, 0), Instance("b", None, {}, 1)), tuple(connections))  # type: ignore[arg-type]
    return wire(system, {"a": one, "b": two}), one, two


def whole(o: Oscillator) -> Floats:
    """The system's matrix."""
    return np.array([
        [0.0, 1.0, 0.0, 0.0],
        [-(o.k1 + o.k) / o.m1, -(o.c1 + o.c) / o.m1, o.k / o.m1, o.c / o.m1],
        [0.0, 0.0, 0.0, 1.0],
        [o.k / o.m2, o.c / o.m2, -(o.k2 + o.k) / o.m2, -(o.c2 + o.c) / o.m2],
    ])  # fmt: skip


def energy(o: Oscillator, x: Floats) -> float:
    """Of both masses and all springs, J."""
    x1, v1, x2, v2 = x
    kinetic = o.m1 * v1**2 + o.m2 * v2**2
    return float(0.5 * (kinetic + o.k1 * x1**2 + o.k2 * x2**2 + o.k * (x1 - x2) ** 2))


# What theory says ---------------------------------------------------------------------------------------------------


def amplification(scheme: str, hold: str, cut: str, o: Oscillator, h: float) -> Floats:
    """The matrix of one step in constant steps, on (x_a, x_b, y_a, y_b, y_a and y_b a step before, missed by a)."""
    a, b = sides(cut, o)
    (Pa, Qa, Ra, Sa), (Pb, Qb, Rb, Sb) = a.map(h), b.map(h)
    sizes = [len(a.x), len(b.x), len(a.C), len(b.C), len(a.C), len(b.C), len(b.C)]
    xa, xb, ya, yb, pa, pb, missed = np.split(np.eye(sum(sizes)), np.cumsum(sizes)[:-1])

    def column(side: Side, value: float, mean: float, rate: float) -> Floats:
        """Weights of each input by what it carries; a state has none."""
        weight = {"value": value, "mean": mean, "state": 0.0, "rate": rate}
        return np.array([[weight[kind]] for kind in side.given])

    extrapolated = hold == "linear"
    ahead = [column(side, 0.5, 1.0, 0.0 if scheme == "tracks_first" else 0.5) * extrapolated for side in (a, b)]
    within = [column(side, 0.5, 1.0, 0.5) if extrapolated else column(side, 1.0, 1.0, 1.0) for side in (a, b)]

    def foreseen(side: int, now: Floats, before: Floats) -> Floats:
        slope = now - before
        if cut == "mass":  # of the position, the velocity is sent along
            slope = np.vstack([h * now[1], slope[1]])
        return now + ahead[side] * slope

    ua, ub = foreseen(0, yb, pb), foreseen(1, ya, pa)
    if scheme == "energy_corrected":
        ua = ua + missed
    if scheme == "iterative":  # u_a = y_b + w (y_b' - y_b), where y_b' depends on u_a through y_a'
        gain = within[0] * (Sb @ (within[1] * Sa))
        rest = yb + within[0] * (Rb @ xb + Sb @ (ya + within[1] * (Ra @ xa - ya)) - yb)
        ua = np.asarray(np.linalg.solve(np.eye(len(gain)) - gain, rest), dtype=np.float64)
    if scheme != "jacobi":
        ub = ya + within[1] * (Ra @ xa + Sa @ ua - ya)
    ya_after, yb_after = Ra @ xa + Sa @ ua, Rb @ xb + Sb @ ub
    returned = np.array([[scheme == "energy_corrected" and kind == "value"] for kind in a.given])
    missed = returned * (missed + yb + within[0] * (yb_after - yb) - ua)
    return np.vstack([Pa @ xa + Qa @ ua, Pb @ xb + Qb @ ub, ya_after, yb_after, ya, yb, missed])


def radius(scheme: str, hold: str, cut: str, o: Oscillator, h: float) -> float:
    """Spectral radius of a step."""
    return float(np.abs(np.linalg.eigvals(amplification(scheme, hold, cut, o, h))).max())


# Quiet and violent --------------------------------------------------------------------------------------------------


# A hammer: half a sine of force on mass 2, between communication points.
STRIKE, DURATION, IMPULSE = 10.0037, 0.2, 1.0  # s, s, N s


def pieces(t: float, h: float) -> list[tuple[float, float, bool]]:
    """Start, length, and whether the hammer strikes, of the parts of [t, t + h]."""
    edges = [t, *(e for e in (STRIKE, STRIKE + DURATION) if t < e < t + h), t + h]
    return [(a, b - a, STRIKE < 0.5 * (a + b) < STRIKE + DURATION) for a, b in pairwise(edges)]


def hammered(A: Floats, x: Floats, place: int, t: float, h: float) -> Floats:
    """Solve x' = A x exactly under the hammer's force on mass 2 = 1 kg, whose velocity is at ``place``."""
    w, n = np.pi / DURATION, len(A)
    for a, length, strikes in pieces(t, h):
        if not strikes:
            x = expm(A * length) @ x
            continue
        driven = np.zeros((n + 2, n + 2))  # with sine and cosine
        driven[:n, :n] = A
        driven[place, n] = 0.5 * w * IMPULSE
        driven[n, n + 1], driven[n + 1, n] = w, -w
        phase = w * (a - STRIKE)
        x = (expm(driven * length) @ np.array([*x, np.sin(phase), np.cos(phase)]))[:n]
    return x


class Struck(Slave):
    """Side b of the wrench cut under the hammer."""

    def step(self, t: float, h: float) -> None:
        """Exact for what is given."""
        if not any(strikes for *_, strikes in pieces(t, h)):
            super().step(t, h)
            return
        A = np.zeros((3, 3))
        A[:2, :2], A[:2, 2:] = self.side.A, self.side.B
        self.x = hammered(A, np.array([*self.x, *self.u]), 1, t, h)[:2]
        self._after = self.side.C @ self.x
        self.steps += 1


def struck(o: Oscillator) -> tuple[Stages, Slave, Slave, Callable[[float], Floats]]:
    """The wrench cut under the hammer, and the exact motion, to be asked forward in time."""
    stages, a, b = coupled("wrench", o, Struck)
    now, x, A = 0.0, np.array(o.start), whole(o)

    def truth(t: float) -> Floats:
        nonlocal now, x
        if t > now:
            x = hammered(A, x, 3, now, t - now)
        now = t
        return x

    return stages, a, b, truth
