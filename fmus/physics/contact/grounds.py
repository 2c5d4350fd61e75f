"""Dispatch of the shapes of the ground by the class of ``shape``.

A level ground with at most one bump is a ``ground.GroundShape``; all other grounds are ``terrain.shape.Terrain``, which
is imported and compiled only where a scene has one. A shape is given in the frame of its component (track or chassis).
"""

# the stubs of ``dispatch`` have no bodies
# mypy: disable-error-code="empty-body"

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fmus.kernels.jit import dispatch
from fmus.physics.arrays import Vector, VectorLike

if TYPE_CHECKING:
    from fmus.physics.contact.face import Face
    from fmus.physics.contact.laws import Law


@dispatch("ground")
def ground_face(shape: Any, x: VectorLike, v: Vector) -> tuple[float, Face]:
    """Depth, m, of a point at ``x``, m, with velocity ``v``, m/s, in the ground, and the Face there.

    The face is valid for a depth above 0.
    """


@dispatch("ground")
def is_above(shape: Any, a: Vector, b: Vector, reach: float) -> bool:
    """Whether the ground is more than ``reach`` m below the points ``a`` and ``b`` of a link and all between them.

    The test is cheap, and so it is False for some links that are above the ground.
    """


@dispatch("ground")
def ground_law(shape: Any, law: Law, x: VectorLike) -> Law:
    """Contact law at the point ``x``, m: ``law`` with the friction of its region."""


@dispatch("ground")
def wheel_normal(shape: Any, centre: Vector, axle: Vector, radius: float) -> Vector:
    """Unit normal of the ground where it is nearest to the ``centre`` of a wheel of ``radius`` m; ``axle``: unit."""
