"""Rigid links in joint coordinates for integrators: the recursive formulation; sibling: ``dynamics``.

A pin that closes the chain is a constraint between its first and its last link. Of its five equations two are
independent: all pins are parallel, so the gap along the pins and the two tilts are zero in any joint coordinates. The
two in the plane of link 0 (or of the ground) are solved by the response to unit forces there (``recursive.mobility``).

Joint coordinates of a chain of rigid links, and poses and velocities of the links from them.

A floating chain has the pose (7) of link 0, then the angles of the pins 1 to n - 1 about y, rad, each of a link
relative to the previous one; then the velocity (6) of link 0 and the rates of the angles, rad/s. A chain whose first
pin holds to the ground has the angle of link 0 instead of a pose. A closed chain is cut at pin 0, one held at both ends
at its last pin.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.kernels.jit import implemented_in, kernel, namesake
from fmus.physics.arrays import Floats, Matrix, Vector
from fmus.physics.chain.rigid import closing, dynamics
from fmus.physics.chain.rigid.dynamics import ANY, CORRECTIONS, OPEN
from fmus.physics.chain.rigid.links import RigidLinks, loads
from fmus.physics.chain.rigid.newton import GAP
from fmus.physics.chain.state import copy_rows
from fmus.physics.chain.sums import JOINTS
from fmus.physics.elementary import atan2, cos, sin
from fmus.physics.rigid import augmented, body, recursive
from fmus.physics.rigid.body import axis
from fmus.physics.vector import dot

if TYPE_CHECKING:
    from fmus.physics.chain.contacts import Contacts
    from fmus.physics.chain.integration import Environment
    from fmus.physics.chain.rigid.links import RigidLinks
    from fmus.physics.chain.rigid.state import State, Work
    from fmus.physics.rigid.augmented import Ends
    from fmus.physics.rigid.recursive import ArticulatedBodies


def count(links: int, held: bool) -> int:
    """Number of joint coordinates and rates of ``links`` links."""
    return 2 * links if held else 2 * links + 11


@kernel
def joint_indices(held: bool, n: int) -> tuple[int, int, int]:
    """Indices of the angle of link 0 (real or fictitious), of the first rate, and of that angle's rate."""
    return (0, n, n) if held else (6, n + 6, n + 11)


@kernel
def to_joint_coordinates(links: RigidLinks, s: State) -> None:
    """Joint coordinates and rates ``s.joints`` from poses and velocities whose pins are closed."""
    n, held, x = s.q.shape[0], links.ends.first, s.joints
    angle, rates, rate = joint_indices(held, n)
    if not held:
        for k in range(7):
            x[k] = s.q[0, k]
        for k in range(6):
            x[rates + k] = s.v[0, k]
    for i in range(0 if held else 1, n):
        w, y, w0, y0, x0, z0, spin = s.q[i, 3], s.q[i, 5], 1.0, 0.0, 0.0, 0.0, 0.0
        if i > 0:
            w0, x0, y0, z0, spin = s.q[i - 1, 3], s.q[i - 1, 4], s.q[i - 1, 5], s.q[i - 1, 6], s.v[i - 1, 4]
        # part about y and real part of the product conj(before) after
        real = w0 * w + x0 * s.q[i, 4] + y0 * y + z0 * s.q[i, 6]
        about = w0 * y - y0 * w - z0 * s.q[i, 4] + x0 * s.q[i, 6]
        x[angle + i] = 2.0 * atan2(about, real)
        x[rate + i] = s.v[i, 4] - spin


@kernel
def to_poses(links: RigidLinks, s: State, w: Work) -> None:
    """Poses, velocities, rotation matrices and terms of the recursive formulation from ``s.joints``."""
    n, half, held, x, t = s.q.shape[0], links.half, links.ends.first, s.joints, w.articulated
    angle, rates, rate = joint_indices(held, n)
    q, v = s.q, s.v
    if not held:
        norm = np.sqrt(x[3] * x[3] + x[4] * x[4] + x[5] * x[5] + x[6] * x[6])
        for k in range(3, 7):
            x[k] /= norm
        for k in range(7):
            q[0, k] = x[k]
        for k in range(6):
            v[0, k] = x[rates + k]
        body.rotation(q[0], w.system.rotation[0])
    for i in range(0 if held else 1, n):
        A, spin = w.system.rotation[i], x[rate + i]
        b, a = sin(0.5 * x[angle + i]), cos(0.5 * x[angle + i])
        s1, c1 = 2.0 * a * b, a * a - b * b
        t.turn[i, 0], t.turn[i, 1] = c1, s1
        if i == 0:
            q[0, 3], q[0, 4], q[0, 5], q[0, 6] = a, 0.0, b, 0.0
            wx = wy = wz = 0.0
        else:
            e, f, g, h = q[i - 1, 3], q[i - 1, 4], q[i - 1, 5], q[i - 1, 6]
            q[i, 3], q[i, 4], q[i, 5], q[i, 6] = e * a - g * b, f * a - h * b, g * a + e * b, h * a + f * b
            wx, wy, wz = v[i - 1, 3], v[i - 1, 4], v[i - 1, 5]
        ux, uz = c1 * wx - s1 * wz, s1 * wx + c1 * wz
        v[i, 3], v[i, 4], v[i, 5] = ux, wy + spin, uz
        body.rotation(q[i], A)
        for k in range(3):
            # from the centre of the previous link, or the ground's pin, to the pin and on
            position, velocity = w.ground[0, k] + (half if k == 0 else 0.0), 0.0
            if i > 0:
                B = w.system.rotation[i - 1]
                position, velocity = q[i - 1, k] + half * B[k, 0], v[i - 1, k] + half * (B[k, 1] * wz - B[k, 2] * wy)
            q[i, k] = position + half * A[k, 0]
            v[i, k] = velocity + half * (A[k, 1] * uz - A[k, 2] * v[i, 4])
        # acceleration terms of the velocities: turning axes, and the end of the previous link
        e, g = -2.0 * half * (wy * wy + wz * wz), 2.0 * half * wx * wz
        t.bias[i, 0], t.bias[i, 1], t.bias[i, 2] = -uz * spin, 0.0, ux * spin
        t.bias[i, 3], t.bias[i, 4], t.bias[i, 5] = c1 * e - s1 * g, 2.0 * half * wx * wy, s1 * e + c1 * g


@implemented_in(dynamics=".jointed")
class JointedLinks(NamedTuple):
    """Parameters of links that move in joint coordinates."""

    links: RigidLinks  # parameters of the links


@namesake
def derivative(links: JointedLinks, contacts: Contacts | None, env: Environment, s: State, w: Work, k: Floats) -> int:
    rigid = links.links
    to_poses(rigid, s, w)
    failed = accelerations(rigid, contacts, env, s, w)
    _rates(rigid, s, w, k)
    return failed


@kernel
def accelerations(links: RigidLinks, contacts: Contacts | None, env: Environment, s: State, w: Work) -> int:
    """Accelerations and pin forces of the state's poses and velocities, with the wrenches.

    Returns -1, or the link where an inertia is singular.
    """
    half, ends, t = links.half, links.ends, w.articulated
    pin = augmented.closing_pin(ends, s.q.shape[0])
    spring = pin >= 0 and links.spring.stiffness > 0.0
    s.vdot[:] = 0.0
    s.lam[:] = 0.0
    if spring:
        closing.spring_force(links, s, w)
    loads(links, contacts, env, s, w, ANY, False)
    if spring:
        _, opens = closing.gap_and_rate(links, s, w)
        w.sums[JOINTS] += links.spring.damping * dot(opens, opens)
    _pin_loads(links, s, w)
    failed = recursive.factor(half, links.mass, links.inertia, ends.first, t)
    if failed >= 0:
        return failed
    recursive.solve(half, ends.first, True, t, t.load[0], t.response[0])
    if pin >= 0 and not spring:
        _close(links, pin, s, w)
    _write_accelerations(links, s, w)
    return -1


@kernel
def _pin_loads(links: RigidLinks, s: State, w: Work) -> None:
    """Collect the loads at the first pins of the links, N m and N, from residuals without accelerations."""
    half, m, A, r, p = links.half, links.mass, w.system.rotation, w.system.residual, w.articulated.load[0]
    for i in range(s.q.shape[0]):
        ox, oy, oz = s.v[i, 3], s.v[i, 4], s.v[i, 5]
        f = r[i, 0], r[i, 1], r[i, 2]
        f0 = dot(axis(A[i], 0), f) - m * half * (oy * oy + oz * oz)
        f1 = dot(axis(A[i], 1), f) + m * half * ox * oy
        f2 = dot(axis(A[i], 2), f) + m * half * ox * oz
        p[i, 0], p[i, 1], p[i, 2] = r[i, 3], r[i, 4] - half * f2, r[i, 5] + half * f1
        p[i, 3], p[i, 4], p[i, 5] = f0, f1, f2


@kernel
def _axes(ends: Ends, w: Work) -> tuple[tuple[float, float], tuple[float, float]]:
    """Axes x and z of the closing pin's support (link 0 or the ground) in the axes of the last link.

    Each is given by its components along x and z.
    """
    A, n = w.system.rotation, w.system.rotation.shape[0]
    B, P = (A[0] if ends.closed else w.still), A[n - 1]
    return (
        (dot(axis(P, 0), axis(B, 0)), dot(axis(P, 2), axis(B, 0))),
        (dot(axis(P, 0), axis(B, 2)), dot(axis(P, 2), axis(B, 2))),
    )


@kernel
def _relative_acceleration(
    half: float, ends: Ends, x: Floats, axes: tuple[tuple[float, float], tuple[float, float]], w: Work
) -> tuple[float, float]:
    """Relative acceleration of the closing pin along its two ``axes``, m/s2.

    ``half``: half the pitch, m; ``x`` (n, 6): accelerations at the links' first pins, rad/s2 and m/s2.
    """
    last = x[x.shape[0] - 1]
    e0, e2 = last[3], last[5] - 2.0 * half * last[1]
    a, b = axes[0][0] * e0 + axes[0][1] * e2, axes[1][0] * e0 + axes[1][1] * e2
    if ends.closed:
        a, b = a - x[0, 3], b - x[0, 5]
    return a, b


@kernel
def _close(links: RigidLinks, pin: int, s: State, w: Work) -> None:
    """Add the two forces of the closing pin that give both its sides the same acceleration."""
    half, ends, t, n, A = links.half, links.ends, w.articulated, s.q.shape[0], w.system.rotation
    axes = _axes(ends, w)
    for k in range(2):
        p, (fx, fz) = t.load[1 + k], axes[k]
        p[:] = 0.0
        p[n - 1, 1], p[n - 1, 3], p[n - 1, 5] = 2.0 * half * fz, -fx, -fz
        if ends.closed:
            p[0, 3 + 2 * k] += 1.0
        recursive.solve(half, ends.first, False, t, p, t.response[1 + k])
        t.mobility[0, k], t.mobility[1, k] = _relative_acceleration(half, ends, t.response[1 + k], axes, w)
    a, b = _relative_acceleration(half, ends, t.response[0], axes, w)
    # centripetal acceleration of the last link's end
    ox, oy, oz = s.v[n - 1, 3], s.v[n - 1, 4], s.v[n - 1, 5]
    e0, e2 = -2.0 * half * (oy * oy + oz * oz), 2.0 * half * ox * oz
    f = _cancelling_forces(t.mobility, a + axes[0][0] * e0 + axes[0][1] * e2, b + axes[1][0] * e0 + axes[1][1] * e2)
    _add(f, t)
    for i in range(3):
        x, z = (A[0, i, 0], A[0, i, 2]) if ends.closed else (w.still[i, 0], w.still[i, 2])
        s.lam[pin, i] = f[0] * x + f[1] * z


@kernel
def _cancelling_forces(mobility: Floats, a: float, b: float) -> tuple[float, float]:
    """Two forces, N (or impulses), that cancel the relative motion (a, b), m/s2 (or m/s, m).

    ``mobility`` (2, 2): relative motion by unit forces, 1/kg.
    """
    det = mobility[0, 0] * mobility[1, 1] - mobility[0, 1] * mobility[1, 0]
    return (mobility[0, 1] * b - mobility[1, 1] * a) / det, (mobility[1, 0] * a - mobility[0, 0] * b) / det


@kernel
def _add(f: tuple[float, float], t: ArticulatedBodies) -> None:
    """Add the accelerations by the two forces ``f``, N."""
    x, a, b = t.response[0], t.response[1], t.response[2]
    for i in range(x.shape[0]):
        for k in range(6):
            x[i, k] += f[0] * a[i, k] + f[1] * b[i, k]


@kernel
def _centre(half: float, A: Matrix, x: Floats) -> Vector:
    """World acceleration of a link's centre, m/s2, less centripetal terms, by that of its first pin, ``x`` (6).

    ``x``: rad/s2 and m/s2, in the link's own axes; ``half``: half the pitch, m.
    """
    e = x[3], x[4] + half * x[2], x[5] - half * x[1]
    return dot((A[0, 0], A[0, 1], A[0, 2]), e), dot((A[1, 0], A[1, 1], A[1, 2]), e), dot((A[2, 0], A[2, 1], A[2, 2]), e)


@kernel
def _write_accelerations(links: RigidLinks, s: State, w: Work) -> None:
    """Accelerations of the links' centres and, from the last link to the first, the forces in the pins."""
    half, m, n, p, x = links.half, links.mass, s.q.shape[0], s.lam.shape[0], w.articulated.response[0]
    for i in range(n):
        A, ox, oy, oz = w.system.rotation[i], s.v[i, 3], s.v[i, 4], s.v[i, 5]
        whirl = -half * (oy * oy + oz * oz), half * ox * oy, half * ox * oz
        centre = _centre(half, A, x[i])
        for k in range(3):
            s.vdot[i, k] = centre[k] + A[k, 0] * whirl[0] + A[k, 1] * whirl[1] + A[k, 2] * whirl[2]
            s.vdot[i, 3 + k] = x[i, k]
    copy_rows(s.vdot, s.a)
    sprung = links.spring.stiffness > 0.0
    closed = links.ends.closed
    for i in range(n - 1, -1, -1):
        if i == 0 and (closed or not links.ends.first):
            break
        j = (i + 1) % p
        for k in range(3):
            s.lam[i, k] = s.lam[j, k] - m * s.vdot[i, k] - w.system.residual[i, k]
            # the residual already contains the spring's force
            if sprung and i == n - 1:
                s.lam[i, k] -= s.lam[j, k]


@kernel
def _rates(links: RigidLinks, s: State, w: Work, k: Floats) -> None:
    """Time derivative of the joint coordinates and their rates into ``k``, of the length of ``s.joints``."""
    n, held, x = s.q.shape[0], links.ends.first, s.joints
    angle, rates, rate = joint_indices(held, n)
    if not held:
        body.pose_rate(s.q[0], s.v[0], k)
        for i in range(6):
            k[rates + i] = s.vdot[0, i]
    for i in range(0 if held else 1, n):
        k[angle + i] = x[rate + i]
        k[rate + i] = s.vdot[i, 4] - (s.vdot[i - 1, 4] if i > 0 else 0.0)


@kernel
def project(links: JointedLinks, s: State, w: Work) -> int:
    """Close the loop in position, then in velocity, by impulses in its pin.

    They use the mobility of the last stage. Joint coordinates keep all other pins closed.
    """
    rigid = links.links
    to_poses(rigid, s, w)
    pin = augmented.closing_pin(rigid.ends, s.q.shape[0])
    if pin < 0 or rigid.spring.stiffness > 0.0:
        return -1
    most = np.inf
    for _ in range(CORRECTIONS):
        gap, _ = closing.gap_and_rate(rigid, s, w)
        a, b = _in_plane(rigid.ends, gap, w)
        most = max(abs(a), abs(b))
        if most <= GAP:
            break
        _move(rigid, _cancelling_forces(w.articulated.mobility, a, b), s, w)
        to_poses(rigid, s, w)
    _, opens = closing.gap_and_rate(rigid, s, w)
    a, b = _in_plane(rigid.ends, opens, w)
    _push(rigid, _cancelling_forces(w.articulated.mobility, a, b), s, w)
    to_poses(rigid, s, w)
    return -1 if most <= OPEN else pin


@kernel
def _in_plane(ends: Ends, g: Vector, w: Work) -> tuple[float, float]:
    """Components of the world vector ``g`` along the two axes of the closing pin's forces."""
    B = w.system.rotation[0] if ends.closed else w.still
    return dot(axis(B, 0), g), dot(axis(B, 2), g)


@kernel
def _response(f: tuple[float, float], t: ArticulatedBodies, i: int, k: int) -> float:
    """Response of entry ``k`` of link ``i`` to the two impulses ``f``."""
    return f[0] * t.response[1, i, k] + f[1] * t.response[2, i, k]


@kernel
def _base(links: RigidLinks, f: tuple[float, float], w: Work) -> None:
    """Response of the centre of link 0 to the two impulses, into the first row of ``w.increment`` (6)."""
    t, x = w.articulated, w.increment[0]
    for k in range(6):
        x[k] = _response(f, t, 0, k)
    centre = _centre(links.half, w.system.rotation[0], x)
    for k in range(3):
        x[3 + k] = x[k]
        x[k] = centre[k]


@kernel
def _move(links: RigidLinks, f: tuple[float, float], s: State, w: Work) -> None:
    """Change the joint coordinates by the two impulses ``f``, here of displacement, kg m."""
    n, held, x, t = s.q.shape[0], links.ends.first, s.joints, w.articulated
    angle, _, _ = joint_indices(held, n)
    if not held:
        _base(links, f, w)
        body.advance(s.q[0], w.increment[0], x)
    for i in range(0 if held else 1, n):
        x[angle + i] += _response(f, t, i, 1) - (_response(f, t, i - 1, 1) if i > 0 else 0.0)


@kernel
def _push(links: RigidLinks, f: tuple[float, float], s: State, w: Work) -> None:
    """Change the rates of the joint coordinates by the two impulses ``f``, N s."""
    n, held, x, t = s.q.shape[0], links.ends.first, s.joints, w.articulated
    _, rates, rate = joint_indices(held, n)
    if not held:
        _base(links, f, w)
        for k in range(6):
            x[rates + k] += w.increment[0, k]
    for i in range(0 if held else 1, n):
        x[rate + i] += _response(f, t, i, 1) - (_response(f, t, i - 1, 1) if i > 0 else 0.0)


@namesake
def stage_joints(links: JointedLinks, env: Environment, s: State, w: Work) -> None:
    dynamics.stage_joints(links.links, env, s, w)


@namesake
def speed(links: JointedLinks, env: Environment, s: State, w: Work) -> float:
    return dynamics.speed(links.links, env, s, w)


@namesake
def first_speed(links: JointedLinks, env: Environment, s: State, w: Work, report: Floats) -> float:
    return dynamics.speed(links.links, env, s, w)


@namesake
def observe(links: JointedLinks, env: Environment, s: State, w: Work, report: Floats) -> None:
    dynamics.observe(links.links, env, s, w, report)
