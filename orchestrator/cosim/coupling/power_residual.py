"""Variable communication step controlled by the power residual of the bonds; no step is repeated.

S. Sadjina, L. T. Kyllingstad, S. Skjong, E. Pedersen: Energy conservation and power bonds in co-simulations,
Engineering with Computers 33, 2017, doi 10.1007/s00366-016-0492-8 (ECCO).

Components a and b share a bond if each has the other's input as an output and the product is a power. Over a step
from t to t + h each holds an input u and has a mean output y; the coupling loses the energy

    residual = h (y_a . u_a - y_b . u_b),    y_a . u_a: power that a gives by its own balance, with u_a in place of y_b

It is of order h^2 if one input is held at its value of time t (``tracks_first``, whose force passes unchanged: the
residual is force times the difference of extrapolated and actual motion; a state that is sent anew returns part of
it), and of order 3 if both are held for the middle of the step. The paper takes y at the end of the step; here y is
the mean over the step, as in the energy ledger.
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
I_GAIN, P_GAIN = 0.15, 0.2  # the paper's 0.3 and 0.4 over the order
MIN_RATIO, MAX_RATIO = 0.2, 1.5  # bounds of the ratio of two steps
TINY = 1e-6  # of the tolerance: lower bound of the residual in the control law
Dimension = tuple[float, ...]


class Bond(NamedTuple):
    """Pair of opposite feeds: ``forward`` from a to b, ``backward`` from b to a."""

    a: Member
    b: Member
    forward: Feed
    backward: Feed


def bonds(members: Sequence[Member]) -> tuple[Bond, ...]:
    """Return the pairs of feeds that share a bond."""
    ends: dict[str, list[tuple[Member, Feed]]] = {}
    for member in members:
        for feed in member.feeds:
            if feed.bond:
                ends.setdefault(feed.bond, []).append((member, feed))
    return tuple(Bond(backward[0], forward[0], forward[1], backward[1]) for backward, forward in ends.values())


def check_bonds(connections: Sequence[Connection], dimension: Callable[[str, str], Dimension | None]) -> None:
    """Raise Miswired unless bonds are pairs of opposite connections whose products are powers.

    :param dimension: (instance, variable) -> exponents as in ``WATT``, None if unknown.
    """
    pairs: dict[str, list[Connection]] = {}
    for connection in connections:
        if connection.bond:
            pairs.setdefault(connection.bond, []).append(connection)
    for name, pair in pairs.items():
        forward, backward = pair[0], pair[-1]
        if len(pair) != 2 or (forward.source, forward.target) != (backward.target, backward.source):
            raise Miswired(f"bond '{name}' needs two connections, there and back, and has {len(pair)}")
        if len(forward.outputs) != len(backward.outputs):
            raise Miswired(f"bond '{name}' has {len(forward.outputs)} values there and {len(backward.outputs)} back")
        for effort_name, flow_name in zip(forward.outputs, backward.outputs, strict=True):
            effort, flow = dimension(forward.source, effort_name), dimension(backward.source, flow_name)
            if effort is not None and flow is not None and not np.allclose(np.add(effort, flow), WATT):
                raise Miswired(
                    f"bond '{name}': {forward.source}.{effort_name} times {backward.source}.{flow_name} is not in W"
                )


def transferred_energies(bond: Bond, now: Outputs, h: float) -> tuple[float, float]:
    """Energy, J, from a to b over the last step, by the balances of a and b; ``now``: y at its start."""
    output_a, input_b = input_hold.mean(bond.forward, now), bond.b.received[bond.forward.inputs]
    output_b, input_a = input_hold.mean(bond.backward, now), bond.a.received[bond.backward.inputs]
    return h * float(output_a @ input_a), h * float(input_b @ output_b)


class PowerResidualState(NamedTuple):
    """State of the step control."""

    t: float  # s, reached
    h: float  # s, next step
    largest_energy: float  # J, largest energy that a bond has carried
    last_error: float  # residual of the last step over the allowed one
    net_energy: Floats  # J, net energy of each bond


class PowerResidual:
    """Step control that keeps the power residual of a step below a tolerance by a PI controller.

    :param stop: end, s.
    :param step: length of the first step, s.
    :param tolerance: of the residual of a step, summed over the bonds, relative to the largest energy, of either sign,
        that a bond has carried since the start, or to ``energy`` if that is larger.
    :param shortest: s.
    :param longest: s.
    :param energy: J, lower bound of the reference energy.
    """

    rejected_steps = 0  # steps are never repeated

    def __init__(
        self, stop: float, step: float, tolerance: float, shortest: float, longest: float, energy: float
    ) -> None:
        self.stop, self.step, self.tolerance = stop, step, tolerance
        self.shortest, self.longest, self.energy = shortest, longest, energy
        self.forced_steps = 0  # shortest steps with too large a residual
        self._start = self._now = PowerResidualState(0.0, step, energy, 1.0, np.zeros(0))

    def memory(self, scheme: Scheme) -> dict[str, Floats]:
        """State of the step control, by name."""
        *numbers, net_energy = self._now
        return {"pace": np.array([*numbers, self.forced_steps]), "carried": net_energy}

    def restore_memory(self, scheme: Scheme, memory: Mapping[str, Floats]) -> None:
        """Restore the state of the step control; raises LookupError, ValueError if it is not one of this pace."""
        t, h, largest_energy, last_error, forced_steps = memory["pace"].tolist()
        self.forced_steps, self._start = (
            int(forced_steps),
            PowerResidualState(t, h, largest_energy, last_error, memory["carried"]),
        )
        if len(self._start.net_energy) != len(bonds(scheme.members)):
            raise ValueError("it has another number of bonds")

    def walk(self, scheme: Scheme, batch_limit: Callable[[int], int]) -> Iterator[tuple[int, float, float]]:
        """Step to the end; raises CouplingFailed without a bond."""
        bond_pairs = bonds(scheme.members)
        if not bond_pairs:
            raise CouplingFailed("no connection has a bond, whose power residual a variable step could follow")
        t, h, largest_energy, last_error, net_energy = self._start
        net_energy = net_energy.copy() if len(net_energy) else np.zeros(len(bond_pairs))
        while True:
            h = min(max(h, self.shortest), self.longest)
            steps_left = math.ceil((self.stop - t) / h - 1e-9)
            if steps_left <= 0:
                return
            if steps_left <= 2:  # even steps up to the end
                h = min(h, (self.stop - t) / steps_left)
            scheme.advance(t, h)
            work = np.array([transferred_energies(bond, scheme.past.outputs, h) for bond in bond_pairs])
            net_energy += work[:, 1]
            largest_energy = max(largest_energy, float(np.abs(net_energy).max()))
            error = float(np.abs(work[:, 0] - work[:, 1]).sum()) / (largest_energy * self.tolerance)
            self.forced_steps += error > 1.0 and h <= self.shortest
            t += h
            error = max(error, TINY)
            ratio = SAFETY * error**-I_GAIN * (last_error / error) ** P_GAIN
            next_h, last_error = h * min(max(ratio, MIN_RATIO), MAX_RATIO), error
            self._now = PowerResidualState(t, next_h, largest_energy, last_error, net_energy)
            yield 1, t, h
            h = next_h
