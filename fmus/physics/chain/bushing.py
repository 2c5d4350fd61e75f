"""Bushed pins: torque about a pin by the angle between its two links, its rate, and friction under the pin's force.

    T = k (angle - preset) + c rate + mu r N s(rate),   s(x) = x / (x^2 + slow^2)^(1/2)

The angle is that of the link after the pin relative to the one before it, positive as the chain bends round its wheels.
-T acts on the link after, T on the link before. N is the size of the pin's force at the start of the step; s
regularises friction. Its work is that of wear (Archard, J. Appl. Phys. 24, 1953, doi 10.1063/1.1721448). Where a spring
closes a loop, and at the ends of a chain, there is no bush.

Neighbours meet in the torque, which stands in the way of what is eliminated link by link. In an implicit step the
change of the torque, t = T' b dx with the derivative b of the angle, is therefore an unknown of the pin,
b dx - t / T' = 0.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.kernels.jit import implemented_in, kernel, namesake
from fmus.physics.chain.link_columns import JOINT
from fmus.physics.chain.state import add_share
from fmus.physics.chain.sums import JOINTS, PINS

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.link_layout import LinkLayout
    from fmus.physics.chain.state import ChainState, ChainWork

FREE = 1e-12  # T' of a pin without a bush, N m/rad: not 0, it is a divisor


@implemented_in(layouts=".bushing")
class Bushing(NamedTuple):
    """Bush of each pin of a chain."""

    stiffness: float  # k, N m/rad
    preset: float  # angle without torque, rad
    damping: float  # c, N m s/rad
    arm: float  # mu r of the friction, m
    slow: float  # rate below which friction grows in proportion, rad/s


@namesake
def chosen(bushing: Bushing, plain: LinkLayout, bushed: LinkLayout) -> LinkLayout:
    return bushed


def without_losses(b: Bushing | None) -> Bushing | None:
    """Return a bush without damping and friction, for the search of an equilibrium; None without one."""
    return b and b._replace(damping=0.0, arm=0.0)


class BushArrays(NamedTuple):
    """Arrays for k pins; k = 0 without bushes."""

    force: np.ndarray  # (k) N, size of the pin's force at the start of the step, N
    torque: np.ndarray  # (k) T, N m
    stiffness: np.ndarray  # (k) T', change of the torque with the angle over a step, N m/rad
    turning: np.ndarray  # (k, 2) size of the rate, rad/s, and power of friction, W: what ``State.turned`` sums
    before: np.ndarray  # (k, 3) derivative of the angle by the slope of the flexible link before it
    after: np.ndarray  # (k, 3) and of the one after it


def bush_arrays(pins: int) -> BushArrays:
    """Return zeroed arrays."""
    z = np.zeros
    return BushArrays(z(pins), z(pins), np.full(pins, FREE), z((pins, 2)), z((pins, 3)), z((pins, 3)))


@kernel
def hold_forces(s: ChainState, w: ChainWork) -> None:
    """Note the force of each pin at the start of a step, under which it rubs; chains with bushes evaluate it."""
    force, f = w.bushes.force, s.on_links
    for j in range(force.size):
        force[j] = np.sqrt(f[j, JOINT] ** 2 + f[j, JOINT + 1] ** 2 + f[j, JOINT + 2] ** 2)


@kernel
def add_turning(share: float, s: ChainState, w: ChainWork) -> None:
    """Add ``share`` s of the turning before a step and of that after it, as losses are summed."""
    add_share(share, s.turning, s.turned)
    add_share(share, w.bushes.turning, s.turned)


@kernel
def turn(b: Bushing, j: int, angle: float, rate: float, by_rate: float, w: ChainWork) -> None:
    """Torque of pin ``j``, and what it loses; ``angle``, rad, ``rate``, rad/s; ``by_rate``, 1/s: d rate / d angle."""
    size = np.sqrt(rate * rate + b.slow * b.slow)
    rubbing, lost = b.arm * w.bushes.force[j], b.damping * rate * rate
    per = rubbing / size
    w.bushes.torque[j] = b.stiffness * (angle - b.preset) + (b.damping + per) * rate
    w.bushes.stiffness[j] = FREE + b.stiffness + by_rate * (b.damping + per * (b.slow / size) * (b.slow / size))
    w.bushes.turning[j, 0], w.bushes.turning[j, 1] = abs(rate), per * rate * rate
    w.sums[JOINTS] += lost
    w.sums[PINS] += per * rate * rate


@kernel
def stored(b: Bushing, angle: float) -> float:
    """Energy of a bush at an ``angle``, rad, J."""
    return 0.5 * b.stiffness * (angle - b.preset) * (angle - b.preset)
