"""Both sides of a cut oscillator as slaves of the master, exact within a step; exact motion of both.

A hammer blow, half a sine of force on mass 2 between communication points, makes a quiet and a violent part.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import expm

from fmus.physics.arrays import Floats
from orchestrator.cosim.graph import Connection, Instance, Stages, System, connect
from orchestrator.studies.step_limits import LinearComponent, Oscillator, sides


class Slave:
    """Side of the oscillator with the interface of a component."""

    def __init__(self, name: str, side: LinearComponent, u: Floats, y: Floats) -> None:
        self.name, self.side, self.inputs, self.outputs = name, side, side.inputs, side.outputs
        self.u, self.y = u.copy(), y.copy()
        self.x = side.x.copy()
        self.steps = 0  # number of steps, including rejected ones
        self._after = y.copy()
        self._map = cache(side.map)

    def write(self) -> None:
        """Do nothing: the step reads its inputs in place."""

    def step(self, t: float, h: float) -> None:
        """Advance by ``h``, s, exactly for the given inputs."""
        P, Q, R, S = self._map(h)
        self._after = R @ self.x + S @ self.u
        self.x = P @ self.x + Q @ self.u
        self.steps += 1

    def read(self) -> None:
        """Copy the outputs of the last step."""
        self.y[:] = self._after

    def save(self) -> Any:
        """Return copies of state, inputs and outputs."""
        return self.x.copy(), self.u.copy(), self.y.copy()

    def restore(self, state: Any) -> None:
        """Restore a saved state."""
        self.x = state[0].copy()
        self.u[:], self.y[:] = state[1:]

    def free(self, state: Any) -> None:
        """Do nothing: a saved state needs no release."""


def coupled(cut: str, o: Oscillator, kind_of_b: type[Slave] = Slave) -> tuple[Stages, Slave, Slave]:
    """Return both sides, connected; force and velocity are a power bond."""
    a, b = sides(cut, o)
    yb = b.C @ b.x  # outputs at t = 0, with the true inputs
    ya = a.C @ a.x + (a.D @ yb if a.mean else 0.0)
    one, two = Slave("a", a, yb, ya), kind_of_b("b", b, ya, yb)
    connections = [
        Connection(
            source, (output,), target, (name,), kind,
            rates=(output.replace("x", "v"),) if output in ("x1", "x2") else (),  # in the cut at the masses
            bond="spring" if output in ("force", "v") else "",
        )
        for source, target, side, peer in (("b", "a", a, b), ("a", "b", b, a))
        for output, name, kind in zip(peer.outputs, side.inputs, side.carries, strict=True)
    ]  # fmt: skip
    system = System((Instance("a", None, {}, 0), Instance("b", None, {}, 1)), tuple(connections))  # type: ignore[arg-type]
    return connect(system, {"a": one, "b": two}), one, two


def whole(o: Oscillator) -> Floats:
    """System matrix of the whole oscillator."""
    return np.array([
        [0.0, 1.0, 0.0, 0.0],
        [-(o.k1 + o.k) / o.m1, -(o.c1 + o.c) / o.m1, o.k / o.m1, o.c / o.m1],
        [0.0, 0.0, 0.0, 1.0],
        [o.k / o.m2, o.c / o.m2, -(o.k2 + o.k) / o.m2, -(o.c2 + o.c) / o.m2],
    ])  # fmt: skip


def energy(o: Oscillator, x: Floats) -> float:
    """Energy of both masses and all springs, J."""
    x1, v1, x2, v2 = x
    kinetic = o.m1 * v1**2 + o.m2 * v2**2
    return float(0.5 * (kinetic + o.k1 * x1**2 + o.k2 * x2**2 + o.k * (x1 - x2) ** 2))


# The hammer ----------------------------------------------------------------------------------------------------------

STRIKE, DURATION, IMPULSE = 10.0037, 0.2, 1.0  # s, s, N s


def pieces(t: float, h: float) -> list[tuple[float, float, bool]]:
    """Parts of [t, t + h]: start, length, and True while the hammer strikes."""
    edges = [t, *(e for e in (STRIKE, STRIKE + DURATION) if t < e < t + h), t + h]
    return [(a, b - a, STRIKE < 0.5 * (a + b) < STRIKE + DURATION) for a, b in pairwise(edges)]


def hammered(A: Floats, x: Floats, place: int, t: float, h: float) -> Floats:
    """Solve x' = A x exactly with the hammer's force on mass 2 = 1 kg, whose velocity has index ``place``."""
    w, n = np.pi / DURATION, len(A)
    for a, length, strikes in pieces(t, h):
        if not strikes:
            x = expm(A * length) @ x
            continue
        driven = np.zeros((n + 2, n + 2))  # augmented with sine and cosine
        driven[:n, :n] = A
        driven[place, n] = 0.5 * w * IMPULSE
        driven[n, n + 1], driven[n + 1, n] = w, -w
        phase = w * (a - STRIKE)
        x = (expm(driven * length) @ np.array([*x, np.sin(phase), np.cos(phase)]))[:n]
    return x


class Struck(Slave):
    """Side b of the wrench cut with the hammer's force."""

    def step(self, t: float, h: float) -> None:
        """Advance by ``h``, s, exactly for the given inputs and the hammer's force."""
        if not any(strikes for *_, strikes in pieces(t, h)):
            super().step(t, h)
            return
        A = np.zeros((3, 3))
        A[:2, :2], A[:2, 2:] = self.side.A, self.side.B
        self.x = hammered(A, np.array([*self.x, *self.u]), 1, t, h)[:2]
        self._after = self.side.C @ self.x
        self.steps += 1


def struck(o: Oscillator) -> tuple[Stages, Slave, Slave, Callable[[float], Floats]]:
    """Return the wrench cut with the hammer, and its exact motion, to be called in order of time."""
    stages, a, b = coupled("wrench", o, Struck)
    now, x, A = 0.0, np.array(o.start), whole(o)

    def truth(t: float) -> Floats:
        nonlocal now, x
        if t > now:
            x = hammered(A, x, 3, now, t - now)
        now = t
        return x

    return stages, a, b, truth
