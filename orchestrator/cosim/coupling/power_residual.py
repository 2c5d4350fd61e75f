"""A variable communication step that follows the power residual of the bonds: no step is repeated, no state saved.

S. Sadjina, L. T. Kyllingstad, S. Skjong, E. Pedersen: Energy conservation and power bonds in co-simulations,
Engineering with Computers 33, 2017, doi 10.1007/s00366-016-0492-8 (ECCO).

Two components a and b share a bond when each shows what the other takes and the product is a power. Over a step from t
to t + h each is given u, held, and shows y in the mean; the coupling loses the energy

    residual = h (y_a . u_a - y_b . u_b),    y_a . u_a: power that a felt it give, with u_a in place of y_b

It is of order h^2 where an input is held as of time t (``tracks_first``, whose force passes unchanged: there it is
force times the motion that was extrapolated less the motion that was made; a state that is sent anew gives part of it
back), of order 3 where both are held for the middle of the step. The paper takes y at the end of the step; the mean
over it is what the energy ledger books.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from orchestrator.cosim.coupling import input_hold
from orchestrator.cosim.coupling.input_hold import Outputs
from orchestrator.cosim.coupling.scheme import CouplingFailed, Scheme
from orchestrator.cosim.graph import Connection, Feed, Floats, Member, Miswired

WATT = (1, 2, -3, 0, 0, 0, 0, 0)  # exponents of kg, m, s, A, K, mol, cd, 10
SAFETY = 0.8
I_GAIN, P_GAIN = 0.15, 0.2  # of the paper: 0.3 and 0.4 over the order
LEAST, MOST = 0.2, 1.5  # change of the step from one to the next
TINY = 1e-6  # of the tolerance: a smaller residual lets the step grow no faster

Dimension = tuple[float, ...]


class Bond(NamedTuple):
    """What two components exchange: ``there`` feeds b with what a shows, ``back`` feeds a with what b shows."""

    a: Member
    b: Member
    there: Feed
    back: Feed


def bonds(members: Sequence[Member]) -> tuple[Bond, ...]:
    """Pairs of feeds that share a bond."""
    ends: dict[str, list[tuple[Member, Feed]]] = {}
    for member in members:
        for feed in member.feeds:
            if feed.bond:
                ends.setdefault(feed.bond, []).append((member, feed))
    return tuple(Bond(back[0], there[0], there[1], back[1]) for back, there in ends.values())


def check(connections: Sequence[Connection], dimension: Callable[[str, str], Dimension | None]) -> None:
    """Raises Miswired unless bonds are pairs, there and back, of as many values whose products are powers.

    :param dimension: (instance, variable) -> its exponents as in ``WATT``, None where it is not known.
    """
    pairs: dict[str, list[Connection]] = {}
    for connection in connections:
        if connection.bond:
            pairs.setdefault(connection.bond, []).append(connection)
    for name, pair in pairs.items():
        there, back = pair[0], pair[-1]
        if len(pair) != 2 or (there.source, there.target) != (back.target, back.source):
            raise Miswired(f"bond '{name}' needs two connections, there and back, and has {len(pair)}")
        if len(there.outputs) != len(back.outputs):
            raise Miswired(f"bond '{name}' has {len(there.outputs)} values there and {len(back.outputs)} back")
        for one, other in zip(there.outputs, back.outputs, strict=True):
            effort, flow = dimension(there.source, one), dimension(back.source, other)
            if effort is not None and flow is not None and not np.allclose(np.add(effort, flow), WATT):
                raise Miswired(f"bond '{name}': {there.source}.{one} times {back.source}.{other} is not in W")


def works(bond: Bond, now: Outputs, h: float) -> tuple[float, float]:
    """J that went from a to b over the step just done: as a felt it, and as b did; ``now``: outputs at its start."""
    shown, felt = input_hold.mean(bond.there, now), bond.b.component.u[bond.there.inputs]
    answer, seen = input_hold.mean(bond.back, now), bond.a.component.u[bond.back.inputs]
    return h * float(shown @ seen), h * float(felt @ answer)


class Remembered(NamedTuple):
    """What the next step follows from."""

    t: float  # s, reached
    h: float  # s, how long it is to be
    size: float  # J, the largest energy that a bond has carried
    before: float  # residual of the step before, over what is allowed
    carried: Floats  # J, by bond


class PowerResidual:
    """A pace that keeps the power residual of a step below a tolerance, by a PI controller.

    :param stop: end, s.
    :param step: length of the first step, s.
    :param tolerance: of the residual of a step, summed over the bonds, over the largest energy that a bond has carried
        since the start, either way, or over ``energy``.
    :param shortest: s.
    :param longest: s.
    :param energy: J; below it all is quiet.
    """

    rejected = 0  # steps are never taken back

    def __init__(
        self, stop: float, step: float, tolerance: float, shortest: float, longest: float, energy: float
    ) -> None:
        self.stop, self.step, self.tolerance = stop, step, tolerance
        self.shortest, self.longest, self.energy = shortest, longest, energy
        self.forced = 0  # shortest steps with too large a residual
        self._start = self._now = Remembered(0.0, step, energy, 1.0, np.zeros(0))

    def memory(self, scheme: Scheme) -> dict[str, Floats]:
        """What it remembers, by name."""
        *numbers, carried = self._now
        return {"pace": np.array([*numbers, self.forced]), "carried": carried}

    def remember(self, scheme: Scheme, memory: Mapping[str, Floats]) -> None:
        """Go on with that; raises LookupError, ValueError for what is none of this pace's."""
        t, h, size, before, forced = memory["pace"].tolist()
        self.forced, self._start = int(forced), Remembered(t, h, size, before, memory["carried"])
        if len(self._start.carried) != len(bonds(scheme.members)):
            raise ValueError("it has another number of bonds")

    def walk(self, scheme: Scheme, most: Callable[[int], int]) -> Iterator[tuple[int, float, float]]:
        """Step after step to the end; raises CouplingFailed where there is no bond."""
        found = bonds(scheme.members)
        if not found:
            raise CouplingFailed("no connection has a bond, whose power residual a variable step could follow")
        t, h, size, before, carried = self._start
        carried = carried.copy() if len(carried) else np.zeros(len(found))
        while True:
            h = min(max(h, self.shortest), self.longest)
            left = math.ceil((self.stop - t) / h - 1e-9)
            if left <= 0:
                return
            if left <= 2:  # land on the end with even steps
                h = min(h, (self.stop - t) / left)
            scheme.advance(t, h)
            work = np.array([works(bond, scheme.past.outputs, h) for bond in found])
            carried += work[:, 1]
            size = max(size, float(np.abs(carried).max()))
            error = float(np.abs(work[:, 0] - work[:, 1]).sum()) / (size * self.tolerance)
            self.forced += error > 1.0 and h <= self.shortest
            t += h
            error = max(error, TINY)
            wanted = SAFETY * error**-I_GAIN * (before / error) ** P_GAIN
            following, before = h * min(max(wanted, LEAST), MOST), error
            self._now = Remembered(t, following, size, before, carried)
            yield 1, t, h
            h = following
