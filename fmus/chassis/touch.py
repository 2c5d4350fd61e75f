"""Dispatch from the chassis to its contacts: resolved when a chassis with contacts is compiled.

Where ``contacts`` is None numba removes the call, and the contact modules are not imported.
"""

from __future__ import annotations

from typing import Any

from fmus.chassis.tree import VehicleTree
from fmus.kernels.jit import dispatch
from fmus.physics.arrays import Floats, Matrix, Vector


def _kernels(contacts: type) -> Any:
    from fmus.chassis import contacts as kernels

    return kernels


@dispatch(_kernels, shared=True)
def touch(contacts: Any, tree: VehicleTree, x: Floats, A: Matrix, v: Vector, w: Vector) -> None:
    """See ``contacts.touch``."""
