"""Heights over x and y with their derivatives, as tuples that add."""

from __future__ import annotations

from fmus.kernels.jit import kernel
from fmus.physics.contact.terrain.fade import Three

Six = tuple[float, float, float, float, float, float]  # h, m, h_x, h_y, h_xx, h_xy, h_yy
LEVEL = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def plus(a: Six, b: Six) -> Six:
    """Sum of two heights."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@kernel
def times(f: Three, a: Six) -> Six:
    """Height ``a`` times a function ``f`` of x."""
    return (
        f[0] * a[0],
        f[0] * a[1] + f[1] * a[0],
        f[0] * a[2],
        f[0] * a[3] + 2.0 * f[1] * a[1] + f[2] * a[0],
        f[0] * a[4] + f[1] * a[2],
        f[0] * a[5],
    )
