"""The door to the normal contact laws: the class of a law says which module is behind it.

A law has a linear spring k, on which rests what spread contacts store and lose (``wheel.bulge``,
``wheel.patch_defect``), the friction of ``face``, and a damper of its own. A new one is a file with a class of these
fields and ``normal``, and its name here and in ``fmus.vehicle``.
"""

from __future__ import annotations

import sys
from typing import Any

from fmus.jit import door
from fmus.physics.contact import hunt_crossley, linear

LAWS: dict[str, Any] = {"linear": linear.Linear, "hunt_crossley": hunt_crossley.HuntCrossley}


def _of(law: type) -> Any:
    return sys.modules[law.__module__]


@door(_of)
def normal(law, share, depth, rate):
    """Force of a point that carries ``share`` of the contact, at penetration ``depth`` > 0 growing at ``rate``.

    Returns the force N, its derivatives by depth and by rate, and the stored energy J.
    """
