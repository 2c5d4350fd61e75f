"""A chain let go from a shape: its links are deformed as that instant deforms them, so that no wave is born with it.

At that instant each link moves as a rigid body. Its weight and its inertia then load it, and it takes the deformation
that balances them: of its own coordinates, of those that it shares with its neighbours besides the positions, and of
the length of its chord. The chords keep their directions or, where both ends are pinned, have them scaled by the one
factor that keeps the distance of the ends. Elements and elasticities are seen through their residuals alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

from fmus.physics.arrays import Floats
from fmus.physics.chain.flexible.places import across, in_plane, places

PROBE = 1e-7  # deformation by which the response of a link is found
LONGEST = 0.05  # largest deformation of one step of Newton's iteration
ROUNDS = 50

# of the chain at rest, (links, rows, axes), by its accelerations (nodes, width)
Residuals = Callable[[Floats], Floats]


class Chain:
    """An open chain of equal links at rest, link by link; changes the coordinates ``q`` (nodes, width) in place.

    ``kit`` is the module of its links, ``mass`` (rows, rows) that of one; ``pinned``: at both ends, else at the first.
    """

    def __init__(self, kit: Any, q: Floats, mass: Floats, pitch: float, pinned: bool) -> None:
        self.q, self.flat, self.mass, self.pitch, self.pinned = q, q.reshape(-1), mass, pitch, pinned
        n, axes, m = len(q) - 1, len(kit.AXES), len(kit.LAYOUT.shared)
        at = places(kit, q, len(mass), n)
        parts = kit.LAYOUT.inner, kit.LAYOUT.outer[axes:m], kit.LAYOUT.outer[m + axes :]
        self.order = np.concatenate(parts)
        self.own, *self.shared = (at.reshape(n, -1)[:, part] for part in parts)  # shared at each pin
        self.free = np.ones((n + 1, m - axes), dtype=bool)  # of the shared coordinates of each pin
        self.free[[0, -1] if pinned else 0] = axes == kit.LAYOUT.fixed
        self.plane, self.second = at[:, :, [0, axes - 1]], len(mass) // 2
        self.shift = np.zeros(len(mass))  # of a link's vectors those that are positions
        self.shift[[0, self.second]] = 1.0
        self.ends = self.flat[self.plane[0, 0]].copy(), self.flat[self.plane[-1, self.second]].copy()
        chord = self.vectors()[:, self.second]
        self.angles, self.factor, self.lengths = np.arctan2(chord[:, 1], chord[:, 0]), 1.0, np.full(n, pitch)

    def vectors(self) -> Floats:
        """Coordinates of the links in the plane (links, rows, 2), positions from each link's first pin."""
        e = self.flat[self.plane]
        return e - self.shift[:, None] * e[:, :1]

    def along(self) -> Floats:
        """Directions of the chords (links, 2)."""
        return np.stack([np.cos(self.factor * self.angles), np.sin(self.factor * self.angles)], axis=1)

    def lay(self, lengths: Floats) -> None:
        """Put the pins at chords of these lengths, m."""
        steps = np.cumsum(lengths[:, None] * self.along(), axis=0)
        self.flat[self.plane[:, self.second]] = self.ends[0] + steps

    def rigid(self, residuals: Residuals) -> tuple[Floats, Floats]:
        """Accelerations (nodes, width) of links that move as rigid bodies, and the force on the last pin (2), N."""
        r = self.vectors()
        turning = across(r)
        n, chord, swing = len(r), r[:, self.second], turning[:, self.second]
        after = float(self.shift @ self.mass @ self.shift) * np.arange(n - 1, -1, -1.0)[:, None]
        moment = np.einsum("v,vw,iwk->ik", self.shift, self.mass, r) + after * chord
        coupling = np.triu(chord @ moment.T, 1)
        about = np.einsum("ivk,vw,iwk->i", r, self.mass, r) + after[:, 0] * np.sum(chord**2, axis=1)
        R = in_plane(residuals(np.zeros_like(self.q)))
        torque = -np.einsum("ivk,ivk->i", turning, R) - np.sum(swing * self.beyond(R), axis=1)
        closing = swing if self.pinned else np.zeros((n, 0))
        none = np.zeros(2 * (closing.shape[1],))
        system = np.block([[coupling + coupling.T + np.diag(about), -closing], [closing.T, none]])
        x = np.linalg.solve(system, np.concatenate([torque, none[:, :1].ravel()]))
        moved = x[:n, None, None] * turning
        carried = np.cumsum(moved[:, self.second], axis=0) - moved[:, self.second]
        a = np.zeros_like(self.q)
        a.reshape(-1)[self.plane] = moved + self.shift[:, None] * carried[:, None]
        return a, x[n:] if self.pinned else np.zeros(2)

    def beyond(self, R: Floats, last: Floats | float = 0.0) -> Floats:
        """The force of each link's second pin on what follows (links, 2), N, ``last`` being that on the last pin.

        R (links, rows, 2): residuals in the plane.
        """
        whole = R[:, 0] + R[:, self.second]
        return np.cumsum(whole[::-1], axis=0)[::-1] - whole - last

    def balance(self, R: Floats, beyond: Floats) -> Floats:
        """What each link lacks (links, size): on its own coordinates, on those shared at both pins, along its chord."""
        pull = np.sum((in_plane(R)[:, self.second] + beyond) * self.along(), axis=1)
        return np.hstack([R.reshape(len(R), -1)[:, self.order], pull[:, None]])

    def numbers(self) -> NDArray[np.int64]:
        """Which unknown of the chain stands where in ``balance`` (links, size); -1: held."""
        n, own = self.own.shape
        links = np.arange(n * (own + 1)).reshape(n, own + 1)
        pins = np.where(self.free.ravel(), links.size + np.cumsum(self.free) - 1, -1).reshape(self.free.shape)
        return np.hstack([links[:, :-1], pins[:-1], pins[1:], links[:, -1:]])

    def response(self, residuals: Residuals, a: Floats, beyond: Floats) -> Floats:
        """How ``balance`` answers the deformations of each link (links, size, size), all links probed at once.

        Of a coordinate that links share, every other pin is probed at a time.
        """
        kept, now = self.flat.copy(), self.balance(residuals(a), beyond)
        n, size = now.shape
        K, own, s = np.zeros((n, size, size)), self.own.shape[1], self.free.shape[1]

        def answer() -> Floats:
            change = (self.balance(residuals(a), beyond) - now) / PROBE
            self.flat[:] = kept
            return change

        for k in range(own):
            self.flat[self.own[:, k]] += PROBE
            K[:, :, k] = answer()
        pins = np.vstack([self.shared[0], self.shared[1][-1:]])
        for k in range(s):
            for first in (0, 1):
                self.flat[pins[first::2, k]] += PROBE
                change = answer()
                K[first::2, :, own + k] = change[first::2]
                K[1 - first :: 2, :, own + s + k] = change[1 - first :: 2]
        self.lay(self.lengths + self.pitch * PROBE)
        K[:, :, -1] = answer()
        return K

    def deform(self, change: Floats) -> None:
        """Take a step (links, size), in the order of ``balance``, and lay the chain between its ends."""
        own, s = self.own.shape[1], self.free.shape[1]
        self.flat[self.own] += change[:, :own]
        self.flat[self.shared[0]] += change[:, own : own + s]
        self.flat[self.shared[1][-1]] += change[-1, own + s : -1]
        self.lengths += self.pitch * change[:, -1]
        if self.pinned:
            before, span = self.factor, float(self.ends[1][0] - self.ends[0][0])
            self.factor = brentq(lambda s: self.lengths @ np.cos(s * self.angles) - span, 0.5, 1.5, xtol=1e-15)
            turn, slopes = (
                (self.factor - before) * self.angles[:, None, None],
                self.plane[:, self.shift == 0.0],
            )
            self.flat[slopes] = np.cos(turn) * self.flat[slopes] + np.sin(turn) * across(self.flat[slopes])
        self.lay(self.lengths)


def tighten(chain: Chain, residuals: Residuals, tolerance: float) -> bool:
    """Deform the links until they lack less than ``tolerance``, N, of moving as rigid bodies. False: not found."""
    numbers = chain.numbers()
    there, size = numbers >= 0, int(numbers.max()) + 1
    rows, columns = np.broadcast_arrays(numbers[:, :, None], numbers[:, None])
    both = (rows >= 0) & (columns >= 0)
    for _ in range(ROUNDS):
        a, last = chain.rigid(residuals)
        R = residuals(a)
        beyond = chain.beyond(in_plane(R), last)
        lacks = np.bincount(numbers[there], chain.balance(R, beyond)[there], size)
        if np.abs(lacks).max() < tolerance:
            if chain.pinned:
                chain.flat[chain.plane[-1, chain.second]] = chain.ends[1]
            return True
        K = chain.response(residuals, a, beyond)
        step = spsolve(coo_array((K[both], (rows[both], columns[both])), shape=(size, size)).tocsc(), -lacks)
        largest = float(np.abs(step).max())
        if not largest < np.inf:
            return False
        chain.deform(np.where(there, step[numbers], 0.0) * min(1.0, LONGEST / max(largest, LONGEST)))
    return False
