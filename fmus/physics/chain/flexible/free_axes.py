"""Axes that turn with a chain of cables, and the unknowns of their yaw and roll; see ``interface``.

The pins of a chain share their direction, the y axis. Only contacts turn the chain, so the virtual work of a rotation
of all that the axes carry is zero: the moment of inertia forces, weight and contacts about x and z of the axes
vanishes, and internal forces do not contribute. Newton's iteration has a border of two columns and two rows. The
rotation of a step, the angular velocity and its derivative follow the generalised-alpha method as coordinates, rates
and accelerations do, with R = R(before) exp(psi). The axes do not pitch; their origin follows the middle of the wheels,
and no force depends on it. In an explicit step, accelerations follow from the same border with the mass alone. Wheels
are transformed to the axes; ground forces act in the frame of the start.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kernels.jit import kernel, namesake
from fmus.physics.arrays import Floats, Vector
from fmus.physics.block_cyclic import solve
from fmus.physics.chain.flexible import inertia
from fmus.physics.chain.flexible.axes_state import (
    ACCELERATION,
    AUXILIARY,
    AUXILIARY_ORIGIN,
    MIDDLE,
    OMEGA,
    OMEGA_RATE,
    ORIGIN,
    ROLL,
    VELOCITY,
    YAW,
    from_axes,
    rotate,
    to_axes,
)
from fmus.physics.chain.flexible.condensation import eliminate
from fmus.physics.chain.flexible.interface import gather, layout
from fmus.physics.chain.link_columns import HORNS, RIMS, TEETH, WHEELS
from fmus.physics.integrate.generalized_alpha import auxiliary
from fmus.physics.vector import add, cross, dot, put, scale, vector

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.state import Motion, State, TurningWork
    from fmus.physics.chain.flexible.turning import TurningCables
    from fmus.physics.chain.implicit import ImplicitMethod
    from fmus.physics.integrate.generalized_alpha import Slopes

FOLLOWING_RATE = 200.0  # rate at which the origin follows the wheels, critically damped, 1/s
ROTATION_LEVER = 2.0  # motion of the pins per radian of the axes, m: the weight of a correction


@namesake
def wheels_to_axes(links: TurningCables, x: Motion, w: TurningWork, tangent: bool) -> None:
    """Wheels ``w.wheels`` relative to the axes into ``w.flat``."""
    f, a = x.axes, w.axes
    o, ov, rate = vector(f, ORIGIN), vector(f, VELOCITY), vector(f, OMEGA)
    for k in range(w.wheels.shape[0]):
        row, relative = w.wheels[k], w.flat[k]
        position = to_axes(f, add(vector(row, 0), scale(-1.0, o)))
        put(relative, 0, position)
        put(relative, 3, add(to_axes(f, add(vector(row, 3), scale(-1.0, ov))), scale(-1.0, cross(rate, position))))
        put(relative, 6, add(to_axes(f, vector(row, 6)), scale(-1.0, rate)))
        put(relative, 9, to_axes(f, vector(row, 9)))
        put(relative, 12, to_axes(f, vector(row, 12)))
    put(a.origin_acceleration, 0, to_axes(f, vector(f, ACCELERATION)))
    a.moment[:] = 0.0
    if tangent:
        a.border[:] = 0.0
        a.corner[:] = 0.0


@namesake
def wrenches_from_axes(links: TurningCables, x: Motion, w: TurningWork) -> None:
    """The wrenches on the wheels; those of the ground already are in that frame."""
    for k in range(w.wrench.shape[0] - 1):
        put(w.wrench[k], 0, from_axes(x.axes, vector(w.wrench[k], 0)))
        put(w.wrench[k], 3, from_axes(x.axes, vector(w.wrench[k], 3)))
    for column in (WHEELS, TEETH, RIMS, HORNS):
        if w.on_links.shape[1] > column:
            for i in range(w.on_links.shape[0]):
                put(w.on_links[i], column, from_axes(x.axes, vector(w.on_links[i], column)))


@namesake
def inertia_and_weight(links: TurningCables, x: Motion, w: TurningWork, weight: Vector, r: Floats) -> None:
    """Adds their moment to the balance."""
    f, a, l = x.axes, w.axes, links.element.l
    _add_frame_accelerations(f, w)
    inertia.inertia(links.element, w.mass, w.accelerations, r)
    about_x = about_z = 0.0
    inertia.weigh(to_axes(f, weight), l, 2, 3, r)
    for n in range(4):
        e, q = vector(w.coordinates[n], 0), vector(r[n], 0)
        about_x += e[1] * q[2] - e[2] * q[1]
        about_z += e[0] * q[1] - e[1] * q[0]
    a.moment[0] += about_x
    a.moment[1] += about_z


@kernel
def _add_frame_accelerations(f: Floats, w: TurningWork) -> None:
    """Add the accelerations due to the motion of the axes ``f`` (SIZE) to ``w.accelerations``; the link is in ``w``."""
    origin, roll, yaw, d_roll, d_yaw = (
        vector(w.axes.origin_acceleration, 0),
        f[OMEGA],
        f[OMEGA + 2],
        f[OMEGA_RATE],
        f[OMEGA_RATE + 2],
    )
    rate_squared = roll * roll + yaw * yaw
    for n in range(4):
        x0, y0, z0 = vector(w.coordinates[n], 0)
        dx, dy, dz = vector(w.rates[n], 0)
        along = roll * x0 + yaw * z0
        due_to_axes = (  # rate' x e + 2 rate x e' + rate x (rate x e)
            roll * along - rate_squared * x0 - d_yaw * y0 - 2.0 * yaw * dy,
            d_yaw * x0 - d_roll * z0 - rate_squared * y0 + 2.0 * (yaw * dx - roll * dz),
            yaw * along - rate_squared * z0 + d_roll * y0 + 2.0 * roll * dy,
        )
        for k in range(3):
            w.accelerations[n, k] += due_to_axes[k] + (origin[k] if n % 2 == 0 else 0.0)


@namesake
def absolute_accelerations(links: TurningCables, s: State, w: TurningWork, i: int, j: int) -> None:
    gather(links, s.q, i, j, w.coordinates)
    gather(links, s.v, i, j, w.rates)
    gather(links, s.vdot, i, j, w.accelerations)
    _add_frame_accelerations(s.axes, w)


@namesake
def omitted_accelerations(links: TurningCables, s: State, w: TurningWork, i: int, j: int) -> None:
    """Accelerations of the coordinates, and those by the axes' angular acceleration."""
    gather(links, s.q, i, j, w.coordinates)
    gather(links, s.vdot, i, j, w.accelerations)
    for n in range(4):
        turning = cross(vector(s.axes, OMEGA_RATE), vector(w.coordinates[n], 0))
        put(w.accelerations[n], 0, add(vector(w.accelerations[n], 0), turning))


@namesake
def along_axes(links: TurningCables, s: State, v: Vector) -> Vector:
    return to_axes(s.axes, v)


@namesake
def couple_inertia(links: TurningCables, w: TurningWork, by_acceleration: float) -> None:
    """M (axis x e)."""
    K, M = w.iteration_matrix, w.mass
    c = w.coordinates
    e = vector(c[0], 0), vector(c[1], 0), vector(c[2], 0), vector(c[3], 0)
    roll = across = yaw = 0.0
    for n in range(4):
        m = (0.0, 0.0, 0.0)
        for k in range(4):
            m = add(m, scale(M[n, k], e[k]))
        x, y, z = scale(by_acceleration, m)
        roll, across, yaw = roll + e[n][1] * y + e[n][2] * z, across - e[n][2] * x, yaw + e[n][0] * x + e[n][1] * y
        put(K[ROLL], 3 * n, (0.0, -z, y))
        put(K[YAW], 3 * n, (-y, x, 0.0))
        K[3 * n, ROLL], K[3 * n + 1, ROLL], K[3 * n + 2, ROLL] = 0.0, -z, y
        K[3 * n, YAW], K[3 * n + 1, YAW], K[3 * n + 2, YAW] = -y, x, 0.0
    K[ROLL, ROLL], K[ROLL, YAW], K[YAW, ROLL], K[YAW, YAW] = roll, across, across, yaw


@namesake
def assemble_border(links: TurningCables, w: TurningWork, i: int, j: int) -> None:
    border, corner, rest, m = w.axes.border, w.axes.corner, w.rest, len(layout(links).shared)
    axes = 2 * m
    for n in range(axes):
        pin, place = (i, n) if n < m else (j, n - m)
        for k in range(2):
            border[pin, place, k] += rest[n, axes + k]
            border[pin, place, 2 + k] += rest[axes + k, n]
    for k in range(2):
        for l in range(2):
            corner[k, l] += rest[axes + k, axes + l]


@namesake
def predict_axes(links: TurningCables, method: ImplicitMethod, h: float, s: State, w: TurningWork) -> None:
    f, c = s.axes, method.alpha
    rate, acceleration = vector(f, OMEGA), vector(f, OMEGA_RATE)
    for k in range(2):
        a0 = f[AUXILIARY + k]
        a1 = auxiliary(c, a0, acceleration[2 * k], acceleration[2 * k])
        w.axes.psi[k] = h * rate[2 * k] + h * h * ((0.5 - c.beta) * a0 + c.beta * a1)
        f[OMEGA + 2 * k] += h * ((1.0 - c.gamma) * a0 + c.gamma * a1)
    rotate(f, w.before.axes, w.axes.psi)
    # the origin by the same method, so that forces balance the chain's momentum; implicit: stable at any step
    o, v, a, a0 = vector(f, ORIGIN), vector(f, VELOCITY), vector(f, ACCELERATION), vector(f, AUXILIARY_ORIGIN)
    a1 = auxiliary(c, a0[0], a[0], 0.0), auxiliary(c, a0[1], a[1], 0.0), auxiliary(c, a0[2], a[2], 0.0)
    a1_slope = auxiliary(c, 0.0, 0.0, 1.0)  # derivative of a1 by the acceleration at the end
    position = add(o, add(scale(h, v), scale(h * h, add(scale(0.5 - c.beta, a0), scale(c.beta, a1)))))
    velocity = add(v, scale(h, add(scale(1.0 - c.gamma, a0), scale(c.gamma, a1))))
    by_place, by_rate = a1_slope * c.beta * h * h, a1_slope * c.gamma * h
    stiff = 1.0 + by_place * FOLLOWING_RATE * FOLLOWING_RATE + 2.0 * by_rate * FOLLOWING_RATE
    corrected = scale(1.0 / stiff, _origin_acceleration(f, w, position, velocity))
    put(f, ORIGIN, add(position, scale(by_place, corrected)))
    put(f, VELOCITY, add(velocity, scale(by_rate, corrected)))
    put(f, ACCELERATION, corrected)
    put(f, AUXILIARY_ORIGIN, add(a1, scale(a1_slope, corrected)))


@kernel
def _origin_acceleration(f: Floats, w: TurningWork, o: Vector, v: Vector) -> Vector:
    """Acceleration of the origin at ``o``, m, with the velocity ``v``, m/s, critically damped, m/s2; ``f`` (SIZE)."""
    wheels, m0 = w.wheels.shape[0], vector(f, MIDDLE)
    offset, relative_velocity = add(o, from_axes(f, m0)), add(v, from_axes(f, cross(vector(f, OMEGA), m0)))
    for k in range(wheels):
        offset = add(offset, scale(-1.0 / wheels, vector(w.wheels[k], 0)))
        relative_velocity = add(relative_velocity, scale(-1.0 / wheels, vector(w.wheels[k], 3)))
    return add(scale(-FOLLOWING_RATE * FOLLOWING_RATE, offset), scale(-2.0 * FOLLOWING_RATE, relative_velocity))


@namesake
def solve_pins(links: TurningCables, w: TurningWork, fresh: bool) -> None:
    if not fresh:
        solve(w.diagonal, w.upper, w.factors, links.closed == 1, w.right_side)
        return
    corner, border, b, d = w.axes.corner, w.axes.border, w.axes.response[0], w.axes.response[1]
    for i in range(b.shape[0]):
        for k in range(b.shape[1]):
            b[i, k], d[i, k] = border[i, k, 0], border[i, k, 1]
    solve(w.diagonal, w.upper, w.factors, links.closed == 1, w.right_side, b, d)
    for i in range(b.shape[0]):
        for k in range(b.shape[1]):
            p, q = border[i, k, 2], border[i, k, 3]
            corner[0, 0], corner[0, 1] = corner[0, 0] - p * b[i, k], corner[0, 1] - p * d[i, k]
            corner[1, 0], corner[1, 1] = corner[1, 0] - q * b[i, k], corner[1, 1] - q * d[i, k]


@kernel
def _solve_rotation(links: TurningCables, x: Motion, w: TurningWork, by_acceleration: float) -> tuple[float, float]:
    """Solve for the step of roll and yaw, rad, and correct the solutions of the pins and of the links.

    ``by_acceleration`` as in ``couple_inertia``; with 1, of a mass matrix, the steps are accelerations, rad/s2.
    """
    a, y, own, border, Z = w.axes, w.right_side, w.own, w.axes.border, w.axes.response
    t0, t1 = (
        a.moment[0] + links.rotary_inertia * x.axes[OMEGA_RATE],
        a.moment[1] + links.rotary_inertia * x.axes[OMEGA_RATE + 2],
    )
    s00, s11 = (
        a.corner[0, 0] + links.rotary_inertia * by_acceleration,
        a.corner[1, 1] + links.rotary_inertia * by_acceleration,
    )
    s01, s10, roll_of = a.corner[0, 1], a.corner[1, 0], 2 * len(layout(links).shared)
    for i in range(links.n):
        for n in range(4):
            t0, t1 = t0 - w.left[i, roll_of, n] * own[i, n], t1 - w.left[i, roll_of + 1, n] * own[i, n]
    for i in range(y.shape[0]):
        for k in range(y.shape[1]):
            t0, t1 = t0 - border[i, k, 2] * y[i, k], t1 - border[i, k, 3] * y[i, k]
    per = 1.0 / (s00 * s11 - s01 * s10)
    roll, yaw = per * (s11 * t0 - s01 * t1), per * (s00 * t1 - s10 * t0)
    for i in range(y.shape[0]):
        for k in range(y.shape[1]):
            y[i, k] -= Z[0, i, k] * roll + Z[1, i, k] * yaw
    for i in range(links.n):
        for n in range(4):
            own[i, n] -= w.right[i, n, roll_of] * roll + w.right[i, n, roll_of + 1] * yaw
    return roll, yaw


@namesake
def correct_axes(links: TurningCables, x: Motion, w: TurningWork, by: Slopes) -> float:
    a, f = w.axes, x.axes
    roll, yaw = _solve_rotation(links, x, w, by.vdot)
    a.turn[0], a.turn[1] = -roll, -yaw
    a.psi[0] -= roll
    a.psi[1] -= yaw
    f[OMEGA] -= by.v * roll
    f[OMEGA + 2] -= by.v * yaw
    f[OMEGA_RATE] -= by.vdot * roll
    f[OMEGA_RATE + 2] -= by.vdot * yaw
    rotate(f, w.before.axes, a.psi)
    return ROTATION_LEVER * max(abs(roll), abs(yaw))


@namesake
def motion_with_axes(links: TurningCables, w: TurningWork, p: Vector) -> Vector:
    return cross((w.axes.turn[0], 0.0, w.axes.turn[1]), p)


@namesake
def finish_axes(links: TurningCables, method: ImplicitMethod, s: State, w: TurningWork) -> None:
    """The auxiliary accelerations."""
    c, f, before = method.alpha, s.axes, w.before.axes
    for k in range(2):
        f[AUXILIARY + k] = auxiliary(c, before[AUXILIARY + k], before[OMEGA_RATE + 2 * k], f[OMEGA_RATE + 2 * k])


@namesake
def accelerate_origin(links: TurningCables, x: Motion, w: TurningWork) -> None:
    f = x.axes
    put(f, ACCELERATION, _origin_acceleration(f, w, vector(f, ORIGIN), vector(f, VELOCITY)))
    f[OMEGA_RATE] = f[OMEGA_RATE + 2] = 0.0


@namesake
def solve_accelerations(links: TurningCables, x: Motion, w: TurningWork) -> None:
    """The border of the mass depends on the coordinates."""
    f, nodes = x.axes, x.q.shape[0]
    w.axes.border[:] = 0.0
    w.axes.corner[:] = 0.0
    for i in range(links.n):
        j = i + 1 if i + 1 < nodes else 0
        gather(links, x.q, i, j, w.coordinates)
        w.iteration_matrix[:] = 0.0
        inertia.add_mass(links.element, w.mass, 1.0, w.iteration_matrix)
        couple_inertia(links, w, 1.0)
        eliminate(links, w, i)
        assemble_border(links, w, i, j)
    solve_pins(links, w, True)
    roll, yaw = _solve_rotation(links, x, w, 1.0)
    f[OMEGA_RATE], f[OMEGA_RATE + 2] = -roll, -yaw
    f[AUXILIARY], f[AUXILIARY + 1] = -roll, -yaw  # an implicit step begins with them
    put(f, AUXILIARY_ORIGIN, vector(f, ACCELERATION))


@namesake
def axes_rates(links: TurningCables, x: State, k: Floats, first: int) -> None:
    """R' = R (rate x)."""
    f, rate = x.axes, vector(x.axes, OMEGA)
    for i in range(3):
        put(k, first + 3 * i, cross(vector(f, 3 * i), rate))
        k[first + ORIGIN + i], k[first + VELOCITY + i], k[first + OMEGA + i] = (
            f[VELOCITY + i],
            f[ACCELERATION + i],
            f[OMEGA_RATE + i],
        )
    for i in range(f.size):
        if ACCELERATION <= i < OMEGA or i >= OMEGA_RATE:
            k[first + i] = 0.0


@namesake
def orthogonalise(links: TurningCables, s: State) -> None:
    """One step of Newton's iteration for the polar factor, R (3 - R^T R) / 2."""
    f = s.axes
    rows = vector(f, 0), vector(f, 3), vector(f, 6)
    for i in range(3):
        row = rows[i]
        for j in range(3):
            row = add(row, scale((0.5 if i == j else 0.0) - 0.5 * dot(rows[i], rows[j]), rows[j]))
        put(f, 3 * i, row)


@namesake
def absolute_rates(links: TurningCables, x: State, w: TurningWork) -> None:
    """Components along the axes."""
    f = x.axes
    rate, origin_velocity = vector(f, OMEGA), to_axes(f, vector(f, VELOCITY))
    for n in range(4):
        v = add(vector(w.rates[n], 0), cross(rate, vector(w.coordinates[n], 0)))
        put(w.rates[n], 0, add(v, origin_velocity) if n % 2 == 0 else v)


@namesake
def centre_of_mass(links: TurningCables, x: State, w: TurningWork) -> Vector:
    l, e = links.element.l, w.coordinates
    place = inertia.centre(l, 2, 0, e), inertia.centre(l, 2, 1, e), inertia.centre(l, 2, 2, e)
    return start_frame_position(links, x, place)


@namesake
def start_frame_position(links: TurningCables, s: State, p: Vector) -> Vector:
    return add(vector(s.axes, ORIGIN), from_axes(s.axes, p))


@namesake
def start_frame_vector(links: TurningCables, s: State, v: Vector) -> Vector:
    return from_axes(s.axes, v)


@namesake
def rotary_energy(links: TurningCables, x: State) -> float:
    return 0.5 * links.rotary_inertia * (x.axes[OMEGA] ** 2 + x.axes[OMEGA + 2] ** 2)
