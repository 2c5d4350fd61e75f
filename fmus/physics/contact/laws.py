"""Dispatch of the normal contact laws by the class of ``law``.

Every law has a linear spring k, which the spread contacts require for their stored and lost energies
(``wheel.gauss_excess``, ``wheel.patch_defect``), the friction of ``face``, and its own damper. A new law needs a file
with a class of these fields, ``normal`` and ``with_friction``, its class in ``Law``, and its file's name as a value
of ``law`` in ``fmus.vehicles.vehicle``, which loads no kernels.
"""

# the stubs of ``dispatch`` have no bodies
# mypy: disable-error-code="empty-body"

from __future__ import annotations

import sys
from typing import Any, get_args

from fmus.kernels.jit import dispatch
from fmus.physics.arrays import Four
from fmus.physics.contact import hunt_crossley, linear

Law = linear.Linear | hunt_crossley.HuntCrossley  # constants of a contact pair
LAWS: dict[str, Any] = {law.__module__.rpartition(".")[2]: law for law in get_args(Law)}


def _of(law: type) -> Any:
    return sys.modules[law.__module__]


@dispatch(_of)
def normal(law: Law, share: float, depth: float, rate: float) -> Four:
    """Force of a point that carries ``share`` of the contact at penetration ``depth`` > 0, m.

    ``rate``, m/s, is the growth of the penetration. Returns the force, N, its derivatives by depth, N/m, and by rate,
    N s/m, and the stored energy, J.
    """


@dispatch(_of)
def with_friction(law: Law, factor: float, value: float) -> Law:
    """Copy of the ``law`` with the coefficient of friction ``factor`` mu + ``value``; mu is that of the law."""
