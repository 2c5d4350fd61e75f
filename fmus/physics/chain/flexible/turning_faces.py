"""Faces of cables in turning axes; see ``chain.interface``.

Motion: q, v (nodes, 8), axes; vectors are along the axes. A link has a width: a point is at r + z n + y (j - b t), with
the tangent t in the plane of the axes, the normal n = t x j, the pin axis j and the yaw b = r_x.j / |r_x| of the link
relative to it. With m = z n + y j and c the slopes of the shape functions over |r_x| it moves by (S - c t m^T) de; the
change of t with the yaw is left out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import kernel, namesake, noalias
from fmus.physics.ancf.cable import shape, shape_slope
from fmus.physics.arrays import Floats, Vector
from fmus.physics.chain.flexible.axes_state import OMEGA, ORIGIN, ROLL, VELOCITY, YAW, from_axes, to_axes
from fmus.physics.chain.flexible.cable_faces import position_slope  # noqa: F401 - reached by dispatch
from fmus.physics.contact.face import ContactForce
from fmus.physics.vector import add, cross, dot, put, scale, vector

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.state import Motion, TurningWork
    from fmus.physics.chain.flexible.turning import TurningCables
    from fmus.physics.contact.face import Sinking

# sums over the points of a section, each times y to 0 and 1: number, f, g = df / d position + by_rate df / d rate
COUNT, FORCE, MATRIX = 0, 1, 7
# the damper's df / d rate; by_rate of that rate, its place along the link as a fraction, the outward normal there
RATES, BY_RATE, FOOT, NORMAL = 25, 31, 32, 33


@namesake
def lateral_points(links: TurningCables) -> tuple[int, float]:
    return 2, links.lateral


@namesake
def depth_below_pins(links: TurningCables, x: Motion, i: int) -> float:
    return 1.1 * links.face + 0.1 * links.element.l + links.lateral * abs(x.axes[7])


@namesake
def to_ground(links: TurningCables, x: Motion, w: TurningWork, p: Vector, v: Vector) -> tuple[Vector, Vector]:
    f = x.axes
    v = add(v, cross(vector(f, OMEGA), p))
    return add(vector(f, ORIGIN), from_axes(f, p)), add(vector(f, VELOCITY), from_axes(f, v))


@namesake
def from_ground(links: TurningCables, x: Motion, w: TurningWork, force: ContactForce, tangent: bool) -> ContactForce:
    """The turn of the point's velocity with the axes is left out of the matrix."""
    f = x.axes
    energies = force.energy, force.friction, force.damping
    if not tangent:
        return ContactForce(to_axes(f, force.f), force.g, force.by_rate, force.normal, *energies)
    g = force.g
    a, b, c = to_axes(f, (g[0], g[1], g[2])), to_axes(f, (g[3], g[4], g[5])), to_axes(f, (g[6], g[7], g[8]))
    p, q, r = to_axes(f, (a[0], b[0], c[0])), to_axes(f, (a[1], b[1], c[1])), to_axes(f, (a[2], b[2], c[2]))
    matrix = (p[0], q[0], r[0], p[1], q[1], r[1], p[2], q[2], r[2])
    return ContactForce(to_axes(f, force.f), matrix, to_axes(f, force.by_rate), force.normal, *energies)


@namesake
def locate_section(
    links: TurningCables, x: Motion, w: TurningWork, i: int, xi: float, z: float
) -> tuple[Vector, Vector, Vector, float]:
    """Return position, m, and velocity, m/s, ``z`` m outside the centreline, with j - b t and the rate of b, 1/s.

    ``w.coordinates`` and ``w.rates`` must be those of link ``i`` (4, 3), of its ``begin_link``. ``xi``: fraction of the
    length. Leaves shape functions in ``w.shape_functions`` (1, m), c, 1/m and 1, in ``w.shape_slopes`` and t in
    ``w.unit_tangent``. ``w.axes`` receives m without y, m, the position, m, and j - b t.
    """
    S, C, e, de, lever = w.shape_functions, w.shape_slopes, w.coordinates, w.rates, w.axes.lever
    shape(links.element, xi, S)
    shape_slope(links.element, xi, C)
    a = b = yaw = da = db = yaw_rate = 0.0
    p = v = (0.0, 0.0, 0.0)
    for k in range(4):
        a, yaw, b = a + C[k] * e[k, 0], yaw + C[k] * e[k, 1], b + C[k] * e[k, 2]
        da, yaw_rate, db = da + C[k] * de[k, 0], yaw_rate + C[k] * de[k, 1], db + C[k] * de[k, 2]
        p, v = add(p, scale(S[k], vector(e[k], 0))), add(v, scale(S[k], vector(de[k], 0)))
    per = 1.0 / np.sqrt(a * a + b * b)
    for k in range(4):
        C[k] *= per
    t0, t2 = a * per, b * per
    w.unit_tangent[0], w.unit_tangent[2] = t0, t2
    lever[0], lever[2] = -z * t2, z * t0
    turn = per * z * (t0 * db - t2 * da)
    w.axes.sums[:] = 0.0
    middle, lateral = (p[0] - z * t2, p[1], p[2] + z * t0), (-per * yaw * t0, 1.0, -per * yaw * t2)
    put(w.axes.section, 0, middle)
    put(w.axes.section, 3, lateral)
    return middle, (v[0] - turn * t0, v[1], v[2] - turn * t2), lateral, per * yaw_rate


@namesake
def locate(
    links: TurningCables, x: Motion, w: TurningWork, i: int, section: tuple[Vector, Vector, Vector, float], y: float
) -> tuple[Vector, Vector]:
    """Leaves y in ``w.axes``."""
    p, v, lateral, yaw_rate = section
    w.axes.lever[1] = y
    t = w.unit_tangent
    return add(p, scale(y, lateral)), (v[0] - y * yaw_rate * t[0], v[1], v[2] - y * yaw_rate * t[2])


@kernel
def apply_force(links: TurningCables, w: TurningWork, i: int, force: ContactForce, tangent: bool) -> None:
    """Sum the forces on the points of a section, weighted by powers of y, for ``finish_section``."""
    s, y, f, g = w.axes.sums, w.axes.lever[1], force.f, force.g
    s[COUNT] += 1.0
    for j in range(3):
        s[FORCE + j] += f[j]
        s[FORCE + 3 + j] += y * f[j]
    if tangent:
        for j in range(9):
            s[MATRIX + j] += g[j]
            s[MATRIX + 9 + j] += y * g[j]


@kernel
def add_rate_matrix(links: TurningCables, w: TurningWork, i: int, force: ContactForce, sinking: Sinking) -> None:
    """Sum df / d rate for ``finish_section``; the rate falls as a face moves outwards."""
    by_rate, foot, normal = sinking
    s, r, y = w.axes.sums, force.by_rate, w.axes.lever[1]
    s[BY_RATE], s[FOOT] = by_rate, foot
    for j in range(3):
        s[RATES + j] += r[j]
        s[RATES + 3 + j] += y * r[j]
        s[NORMAL + j] = normal[j]


@kernel
def _rows(s: Floats, i: int) -> tuple[Vector, Vector, Vector]:
    """Rows of the matrix (3, 3) in ``s`` (36) from index ``i``."""
    return vector(s, i), vector(s, i + 3), vector(s, i + 6)


@kernel
def _times(rows: tuple[Vector, Vector, Vector], a: Vector) -> Vector:
    """Product of a matrix (3, 3) with these ``rows`` and the vector ``a``."""
    return dot(rows[0], a), dot(rows[1], a), dot(rows[2], a)


@kernel
def about_x(a: Vector) -> Vector:
    """Motion of a point at ``a``, m, per radian of roll, x cross a, m."""
    return 0.0, -a[2], a[1]


@kernel
def about_z(a: Vector) -> Vector:
    """Motion of a point at ``a``, m, per radian of yaw, z cross a, m."""
    return -a[1], a[0], 0.0


@kernel
def _lever_part(w: TurningWork, h: Vector, h_y: Vector) -> Vector:
    """Part of B^T h that turns the section about the pin line, for a force ``h``, N, at the height y over this line.

    ``h_y`` = y h, N m. Components along the normal, the pin axis and the tangent, N m.
    """
    t0, t2, lever = w.unit_tangent[0], w.unit_tangent[2], w.axes.lever
    pull = h[0] * t0 + h[2] * t2
    return pull * lever[0], h_y[0] * t0 + h_y[2] * t2, pull * lever[2]


@kernel
def finish_section(links: TurningCables, w: TurningWork, i: int, tangent: bool) -> None:
    """Add the section's forces, R -= B^T f, K -= B^T g B with B = S - c t m^T; moment balance; border."""
    S, C, R, s, moment = w.shape_functions, w.shape_slopes, w.load[i], w.axes.sums, w.axes.moment
    if s[COUNT] == 0.0:
        return
    f, f_y = vector(s, FORCE), vector(s, FORCE + 3)
    l = _lever_part(w, f, f_y)
    for k in range(4):
        for j in range(3):
            R[k, j] -= S[k] * f[j] - C[k] * l[j]
    p, d = vector(w.axes.section, 0), vector(w.axes.section, 3)
    moment[0] -= dot(about_x(p), f) + dot(about_x(d), f_y)
    moment[1] -= dot(about_z(p), f) + dot(about_z(d), f_y)
    if tangent:
        _add_matrix(w, i, p, d)


@kernel
@noalias
def _add_matrix(w: TurningWork, i: int, p: Vector, d: Vector) -> None:
    """Add K -= N^T g N, with N = B for the coordinates and axis x (p + y d) for the rotation of the axes.

    ``p``, m, and ``d`` are those of the section's points. So roll and yaw have columns, their effect on the residual,
    and rows, the effect of the coordinates on their balance. The rotation of forces with the axes is left out.
    """
    S, C, s, K, e = w.shape_functions, w.shape_slopes, w.axes.sums, w.stiffening[i], w.coordinates
    (m0, y, m2), t0, t2 = w.axes.lever, w.unit_tangent[0], w.unit_tangent[2]
    f, f_y, lever_tangent = w.axes.section_tangent[0], w.axes.section_tangent[1], w.axes.lever_tangent
    g, g_y, t = _rows(s, MATRIX), _rows(s, MATRIX + 9), (t0, 0.0, t2)
    pull, pull_y = _times(g, t), _times(g_y, t)
    for a in range(3):
        c0, c1, c2, cy0 = m0 * pull[a], pull_y[a], m2 * pull[a], m0 * pull_y[a]
        cy1, cy2 = y * y * pull[a], m2 * pull_y[a]
        for b in range(4):
            f[a, 3 * b] = S[b] * g[a][0] - C[b] * c0
            f[a, 3 * b + 1] = S[b] * g[a][1] - C[b] * c1
            f[a, 3 * b + 2] = S[b] * g[a][2] - C[b] * c2
            f_y[a, 3 * b] = S[b] * g_y[a][0] - C[b] * cy0
            f_y[a, 3 * b + 1] = S[b] * g_y[a][1] - C[b] * cy1
            f_y[a, 3 * b + 2] = S[b] * g_y[a][2] - C[b] * cy2
    for k, motion, motion_y in ((ROLL, about_x(p), about_x(d)), (YAW, about_z(p), about_z(d))):
        h, h_y = _motion_response(g, g_y, y * y, motion, motion_y)
        for a in range(3):
            f[a, k], f_y[a, k] = h[a], h_y[a]
    if s[BY_RATE] != 0.0:
        _add_rate_damping(s, f, f_y, e)
    for n in range(14):
        pull_change = t0 * f[0, n] + t2 * f[2, n]
        lever_tangent[0, n], lever_tangent[2, n] = m0 * pull_change, m2 * pull_change
        lever_tangent[1, n] = t0 * f_y[0, n] + t2 * f_y[2, n]
    for k in range(4):
        for a in range(3):
            for n in range(14):
                K[3 * k + a, n] -= S[k] * f[a, n] - C[k] * lever_tangent[a, n]
    for n in range(14):
        K[ROLL, n] -= p[1] * f[2, n] - p[2] * f[1, n] + d[1] * f_y[2, n] - d[2] * f_y[1, n]
        K[YAW, n] -= p[0] * f[1, n] - p[1] * f[0, n] + d[0] * f_y[1, n] - d[1] * f_y[0, n]


@kernel
def _add_rate_damping(s: Floats, f: Floats, f_y: Floats, e: Floats) -> None:
    """Add the damper's force by the rate of the face, which depends on the pins and the axes' rotation.

    ``s`` (36): sums; ``f``, N/m, and ``f_y``, N, (3, whole): tangents of the section's force and of its moment by y;
    ``e`` (4, 3): coordinates of the link.
    """
    normal, rate, rate_y = vector(s, NORMAL), vector(s, RATES), vector(s, RATES + 3)
    share_first, share_last = s[BY_RATE] * (1.0 - s[FOOT]), s[BY_RATE] * s[FOOT]
    foot = add(scale(share_first, vector(e[0], 0)), scale(share_last, vector(e[2], 0)))
    roll, yaw = dot(normal, about_x(foot)), dot(normal, about_z(foot))
    for a in range(3):
        for j in range(3):
            f[a, j] -= share_first * rate[a] * normal[j]
            f[a, 6 + j] -= share_last * rate[a] * normal[j]
            f_y[a, j] -= share_first * rate_y[a] * normal[j]
            f_y[a, 6 + j] -= share_last * rate_y[a] * normal[j]
        f[a, ROLL] -= roll * rate[a]
        f[a, YAW] -= yaw * rate[a]
        f_y[a, ROLL] -= roll * rate_y[a]
        f_y[a, YAW] -= yaw * rate_y[a]


@kernel
def _motion_response(
    g: tuple[Vector, Vector, Vector], g_y: tuple[Vector, Vector, Vector], y2: float, a: Vector, a_y: Vector
) -> tuple[Vector, Vector]:
    """Sums over points p + y d of g (a + y a_y), and of y times that, for a motion a + y a_y.

    ``g``, N/m, and ``g_y``, N: rows of the sums of the points' matrices, times y to 0 and 1; ``y2``, m2: square of y.
    """
    return add(_times(g, a), _times(g_y, a_y)), add(_times(g_y, a), scale(y2, _times(g, a_y)))


@namesake
def locate_pin(links: TurningCables, x: Motion, w: TurningWork, i: int, y: float) -> tuple[Vector, Vector]:
    q, v = x.q[i], x.v[i]
    p = q[0], q[1] + y, q[2]
    put(w.axes.point, 0, p)
    return p, (v[0], v[1], v[2])


@kernel
def apply_pin_force(
    links: TurningCables, x: Motion, w: TurningWork, i: int, y: float, force: ContactForce, tangent: bool
) -> None:
    """Add a force to ``w.right_side``, ``w.diagonal``, and its coupling with the axes' rotation to the border."""
    p, f, g, edge, corner = vector(w.axes.point, 0), force.f, force.g, w.axes.border[i], w.axes.corner
    for a in range(3):
        w.right_side[i, a] -= f[a]
    roll, yaw = about_x(p), about_z(p)
    w.axes.moment[0] -= dot(roll, f)
    w.axes.moment[1] -= dot(yaw, f)
    if not tangent:
        return
    for a in range(3):
        for b in range(3):
            w.diagonal[i, a, b] -= g[3 * a + b]
    rows, columns = (g[:3], g[3:6], g[6:]), (g[::3], g[1::3], g[2::3])
    h, k, roll_row, yaw_row = _times(rows, roll), _times(rows, yaw), _times(columns, roll), _times(columns, yaw)
    for a in range(3):
        edge[a, 0] -= h[a]
        edge[a, 1] -= k[a]
        edge[a, 2] -= roll_row[a]
        edge[a, 3] -= yaw_row[a]
    corner[0, 0] -= dot(roll, h)
    corner[0, 1] -= dot(roll, k)
    corner[1, 0] -= dot(yaw, h)
    corner[1, 1] -= dot(yaw, k)
