"""Consistent start of a released chain: links deformed in balance with their initial accelerations.

At that instant each link moves as a rigid body. Its weight and inertia load it, and it takes the deformation that
balances them, so the release starts no wave. The deformation consists of its own coordinates, of those that it shares
with its neighbours besides the positions, and of the length of its chord. The chords keep their directions or, where
both ends are pinned, have them scaled by the one factor that keeps the distance of the ends. Elements and elasticities
enter by their residuals alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from fmus.physics.arrays import Floats, Integers
from fmus.physics.chain.flexible.link_layout import across, coordinate_indices, in_plane
from fmus.physics.chain.layout import scale_of_angles
from fmus.physics.elementary import atan2, cos, of_each, sin
from fmus.physics.elimination import solved

if TYPE_CHECKING:
    from types import ModuleType

PROBE = 1e-7  # deformation of a link in the difference quotients
MAX_DEFORMATION_CHANGE = 0.05  # largest deformation in a step of Newton's iteration
ROUNDS = 50

# residuals of the chain at rest (links, rows, axes) by its accelerations (nodes, width)
Residuals = Callable[[Floats], Floats]


class OpenChain:
    """Open chain of equal links at rest; changes the coordinates ``q`` (nodes, width) in place.

    ``kit``: module of its links; ``mass`` (rows, rows): mass matrix of one, kg; ``pitch``, m; ``pinned``: at both ends,
    else at the first.
    """

    def __init__(self, kit: ModuleType, q: Floats, mass: Floats, pitch: float, pinned: bool) -> None:
        self.q, self.flat, self.mass, self.pitch, self.pinned = q, q.reshape(-1), mass, pitch, pinned
        n, axes, m = len(q) - 1, len(kit.AXES), len(kit.LAYOUT.shared)
        at = coordinate_indices(kit, q, len(mass), n)  # in the flat q, of each link (rows, axes)
        # a link's coordinates: its own; those shared at its first and at its second pin, without the pins' positions
        parts = kit.LAYOUT.inner, kit.LAYOUT.outer[axes:m], kit.LAYOUT.outer[m + axes :]
        self.order = np.concatenate(parts)
        self.own, *self.shared = (at.reshape(n, -1)[:, part] for part in parts)  # shared coordinates at each pin
        self.free = np.ones((n + 1, m - axes), dtype=bool)  # which shared coordinates of each pin are free
        self.free[[0, -1] if pinned else 0] = axes == kit.LAYOUT.fixed
        self.plane, self.second = at[:, :, [0, axes - 1]], len(mass) // 2
        self.shift = np.zeros(len(mass))  # 1 for the vectors of a link that are positions
        self.shift[[0, self.second]] = 1.0
        self.ends = self.flat[self.plane[0, 0]].copy(), self.flat[self.plane[-1, self.second]].copy()
        chord = self.vectors()[:, self.second]
        self.angles = of_each(atan2, chord[:, 1], chord[:, 0])
        self.factor, self.lengths = 1.0, np.full(n, pitch)

    def vectors(self) -> Floats:
        """Coordinates of the links in the plane (links, rows, 2), positions from each link's first pin."""
        e = self.flat[self.plane]
        return e - self.shift[:, None] * e[:, :1]

    def along(self) -> Floats:
        """Directions of the chords (links, 2)."""
        angles = self.factor * self.angles
        return np.stack([of_each(cos, angles), of_each(sin, angles)], axis=1)

    def lay(self, lengths: Floats) -> None:
        """Place the pins at chords of the ``lengths`` (links), m."""
        steps = np.cumsum(lengths[:, None] * self.along(), axis=0)
        self.flat[self.plane[:, self.second]] = self.ends[0] + steps

    def rigid(self, residuals: Residuals) -> tuple[Floats, Floats]:
        """Accelerations (nodes, width) of links moving as rigid bodies; force on the last pin (2), N."""
        r = self.vectors()
        turning = across(r)
        n, chord, chord_turning = len(r), r[:, self.second], turning[:, self.second]
        after = float(np.einsum("v,vw,w", self.shift, self.mass, self.shift)) * np.arange(n - 1, -1, -1.0)[:, None]
        moment = np.einsum("v,vw,iwk->ik", self.shift, self.mass, r) + after * chord
        coupling = np.triu(np.einsum("ik,jk->ij", chord, moment), 1)
        about = np.einsum("ivk,vw,iwk->i", r, self.mass, r) + after[:, 0] * np.sum(chord**2, axis=1)
        R = in_plane(residuals(np.zeros_like(self.q)))
        torque = -np.einsum("ivk,ivk->i", turning, R) - np.sum(chord_turning * self.beyond(R), axis=1)
        closing = chord_turning if self.pinned else np.zeros((n, 0))
        none = np.zeros(2 * (closing.shape[1],))
        system = np.block([[coupling + coupling.T + np.diag(about), -closing], [closing.T, none]])
        x = solved(system, np.concatenate([torque, none[:, :1].ravel()]))
        turned = x[:n, None, None] * turning
        carried = np.cumsum(turned[:, self.second], axis=0) - turned[:, self.second]
        a = np.zeros_like(self.q)
        a.reshape(-1)[self.plane] = turned + self.shift[:, None] * carried[:, None]
        return a, x[n:] if self.pinned else np.zeros(2)

    def beyond(self, R: Floats, last: Floats | float = 0.0) -> Floats:
        """Force of each link's second pin on the rest of the chain (links, 2), N.

        R (links, rows, 2): residuals in the plane; ``last`` (2): force on the last pin.
        """
        whole = R[:, 0] + R[:, self.second]
        return np.cumsum(whole[::-1], axis=0)[::-1] - whole - last

    def balance(self, R: Floats, beyond: Floats) -> Floats:
        """Imbalance of each link, N or N m: own coordinates, those shared at both pins, and one along its chord.

        Returns (links, size), size being the number of these. R (links, rows, axes): residuals; ``beyond`` (links, 2)
        as above.
        """
        pull = np.sum((in_plane(R)[:, self.second] + beyond) * self.along(), axis=1)
        return np.hstack([R.reshape(len(R), -1)[:, self.order], pull[:, None]])

    def numbers(self) -> Integers:
        """Index of the chain's unknown for each entry of ``balance`` (links, size); -1: held."""
        n, own = self.own.shape
        links = np.arange(n * (own + 1)).reshape(n, own + 1)
        pins = np.where(self.free.ravel(), links.size + np.cumsum(self.free) - 1, -1).reshape(self.free.shape)
        return np.hstack([links[:, :-1], pins[:-1], pins[1:], links[:, -1:]])

    def response(self, residuals: Residuals, a: Floats, beyond: Floats) -> Floats:
        """Derivative (links, size, size) of ``balance`` by the deformations of each link, by differences.

        All links are probed at once; for a coordinate that links share, every other pin at a time.
        """
        saved, now = self.flat.copy(), self.balance(residuals(a), beyond)
        n, size = now.shape
        K, own, s = np.zeros((n, size, size)), self.own.shape[1], self.free.shape[1]

        def answer() -> Floats:
            change = (self.balance(residuals(a), beyond) - now) / PROBE
            self.flat[:] = saved
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
        """Take a step ``change`` (links, size), in the order of ``balance``; lay the chain between its ends."""
        own, s = self.own.shape[1], self.free.shape[1]
        self.flat[self.own] += change[:, :own]
        self.flat[self.shared[0]] += change[:, own : own + s]
        self.flat[self.shared[1][-1]] += change[-1, own + s : -1]
        self.lengths += self.pitch * change[:, -1]
        if self.pinned:
            before, span = self.factor, float(self.ends[1][0] - self.ends[0][0])
            self.factor = scale_of_angles(
                lambda s: float((self.lengths * of_each(cos, s * self.angles)).sum()) - span, 0.5, 1.5
            )
            turn, slopes = (
                (self.factor - before) * self.angles[:, None, None],
                self.plane[:, self.shift == 0.0],
            )
            self.flat[slopes] = of_each(cos, turn) * self.flat[slopes] + of_each(sin, turn) * across(self.flat[slopes])
        self.lay(self.lengths)


def balance_links(chain: OpenChain, residuals: Residuals, tolerance: float) -> bool:
    """Deform the links until their imbalance is below ``tolerance``, N; False if that fails."""
    numbers = chain.numbers()
    free, size = numbers >= 0, int(numbers.max()) + 1
    rows, columns = np.broadcast_arrays(numbers[:, :, None], numbers[:, None])
    free_pairs = (rows >= 0) & (columns >= 0)
    for _ in range(ROUNDS):
        a, last = chain.rigid(residuals)
        R = residuals(a)
        beyond = chain.beyond(in_plane(R), last)
        imbalance = np.bincount(numbers[free], chain.balance(R, beyond)[free], size).astype(float)
        if np.abs(imbalance).max() < tolerance:
            if chain.pinned:
                chain.flat[chain.plane[-1, chain.second]] = chain.ends[1]
            return True
        K = chain.response(residuals, a, beyond)
        whole = np.zeros((size, size))
        np.add.at(whole, (rows[free_pairs], columns[free_pairs]), K[free_pairs])
        step = solved(whole, -imbalance)
        largest = float(np.abs(step).max())
        if not largest < np.inf:
            return False
        chain.deform(
            np.where(free, step[numbers], 0.0) * min(1.0, MAX_DEFORMATION_CHANGE / max(largest, MAX_DEFORMATION_CHANGE))
        )
    return False
