"""Rates of the pins at the beginning of a short step after a longer one.

The implicit step closes the pins in position. Their rates are off by the square of its length, and a much shorter step
would take them out by accelerations that are as much larger as it is shorter. Impulses between the links take them out
before it: the momentum of the chain stays. These impulses are no part of the pins' mean forces.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.jit import kernel
from fmus.physics.chain.rigid import closing
from fmus.physics.chain.rigid.links import pins
from fmus.physics.chain.state import add_share
from fmus.physics.rigid import augmented

if TYPE_CHECKING:
    from fmus.physics.chain.rigid.links import RigidLinks
    from fmus.physics.chain.rigid.state import State
    from fmus.physics.chain.rigid.work import Work

SHORT = 2.5e-4  # longest step that is looked at, s
PARTING = 0.1  # least acceleration, m/s2, by which a step would take the rates out


@kernel
def set_mass(links: RigidLinks, w: Work) -> None:
    """Set the matrices of all links to their masses and inertias."""
    K = w.system.K
    K[:] = 0.0
    for i in range(K.shape[0]):
        for k in range(3):
            K[i, k, k] = links.mass
            K[i, 3 + k, 3 + k] = links.inertia[k]


@kernel
def close_rates(links: RigidLinks, h: float, s: State, w: Work) -> None:
    """Change the velocities so that no pin parts, if a step of ``h`` s would need a large acceleration for it."""
    if h >= SHORT:
        return
    y, ends, parting = w.system, closing.ends_without_pin(links), 0.0
    pins(links, s, w)
    augmented.rates(links.half, ends, y, s.v)
    for j in range(y.C.shape[0]):
        for k in range(5):
            parting = max(parting, abs(y.C[j, k]) * (1.0 if k < 3 else links.half))
    if parting < PARTING * h:
        return
    set_mass(links, w)
    y.r[:] = 0.0
    if augmented.factor(links.half, ends, y, augmented.REGULAR) < 0:
        augmented.solve(links.half, ends, y)
        add_share(1.0, y.dx, s.v)
