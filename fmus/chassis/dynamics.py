"""Equations of motion of the tree, exact and O(n), and their integration over one communication step.

State x, flat: position of O (3, world), quaternion of B (4), velocity of O (3, world), angular velocity (3,
in B), then for n leaves: coordinates (arm angle about +y, or way on the slide; 0 in the drawn position), spin angles
(relative to B), coordinate rates, spin rates (absolute, about B's y axis); then the states of hitch and seats, where
there are any; then dissipated energy, work of the wrenches (J).
Derivation and symbols: README.md of this folder; its equation numbers stand at the lines.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fmus.chassis.fittings import pull, touch
from fmus.chassis.leaf import ROOT, compression, is_fixed, linear_spring, wheel_offset
from fmus.chassis.tree import BODY, WHOLE, VehicleTree
from fmus.kernels.jit import allocating, dispatch, kernel
from fmus.physics.arrays import Floats, Matrix, Vector
from fmus.physics.integrate.runge_kutta import RK4, finish, stage
from fmus.physics.rotation import put_matrix, put_quat, quat_normalise
from fmus.physics.vector import add, cross, dot, put, scale, to_body, to_world, vector
from fmus.start import Stance

LEAF = 4  # numbers of a leaf in the state
ENERGY_SUMS = 2  # energies in the state: dissipated energy, work of the wrenches

FINE, NOT_FINITE, BROKEN_QUATERNION, OUT_OF_REACH = 0, 1, 2, 3  # faults; the number of the leaf is added to the last


class Parts(NamedTuple):
    """Data of a running chassis: parameters, state and counters of its kernels."""

    tree: VehicleTree
    contacts: Any  # with the ground; None where there are none
    longest: float  # longest internal step, s
    springs: np.ndarray  # (n, 3) int: index in ``steps.begin``'s p of stiffness, damping and preload of a leaf
    start: np.ndarray  # (16) frame at the drawn centre of mass, its place at the start, m, and gravity energy, J
    centre: tuple[float, float, float]  # centre of mass of the hull in the drawn position, vehicle frame, m
    hull: Stance  # of the hull at the start
    leaves: np.ndarray  # (n) coordinates of the leaves at the start
    missing_preload: tuple[float, float]  # preload that the left and the right tensioner lack, N
    rests: int  # 1: starts in an equilibrium with tracks; 0: in the drawn position
    sides: int  # sides that have ports
    state: np.ndarray
    counters: np.ndarray  # (2) int: solver.steps, solver.evaluations
    stages: np.ndarray  # (5, states) work array: rates at the stages of a step, and a state
    extrapolate: int  # 1: received wrenches are extrapolated
    received: np.ndarray  # wrenches of the last steps, see ``interface.wrenches``
    inputs: np.ndarray  # work array: inputs as the step uses them
    hitch: Any = None  # see ``hitch``; None for a chassis that tows nothing
    seats: Any = None  # see ``seats``; None where no motion of seats is asked for


@kernel
def leaf_inertia(tree: VehicleTree, k: int, r: Vector, w: Vector) -> Vector:
    """Product J w of leaf k about its centre of mass, in B; r: from the hinge to the wheel centre. (3)"""
    a, b, t = tree.across[k], tree.along[k] * dot(r, w), tree.transverse[k]
    return (a + t) * w[0] - b * r[0], a * w[1] - b * r[1], (a + t) * w[2] - b * r[2]


@kernel
def unit_wrench(tree: VehicleTree, k: int, A: Matrix, u: Floats) -> tuple[Vector, Vector]:
    """Force and torque on unit k in B, from the world wrenches u (6 for each input)."""
    i, m = 6 * tree.input_index[k], tree.mirror[k]
    f, g = to_body(A, vector(u, i)), to_body(A, vector(u, i + 3))
    return (f[0], m * f[1], f[2]), (m * g[0], g[1], m * g[2])


@kernel
def add_body(M: Floats, mass: float, c: Vector, J: Matrix) -> None:
    """Add a body, centre c, inertia J (3, 3) about c, to the lower triangle of the root's M (6, 6). (5)"""
    for i in range(3):
        M[i, i] += mass
        for j in range(3):
            M[3 + i, 3 + j] += J[i, j] - mass * c[i] * c[j]
        M[3 + i, 3 + i] += mass * dot(c, c)
    for i in range(3):  # mass [c x], skew
        j, k = (i + 1) % 3, (i + 2) % 3
        M[3 + k, j] += mass * c[i]
        M[3 + j, k] -= mass * c[i]


@kernel
def leaf_bias(
    tree: VehicleTree, k: int, w: Vector, qd: float, r: Vector, c: Vector, lc: Vector
) -> tuple[Vector, Vector]:
    """Force and torque about c, in B, of leaf k by its acceleration at rest of the unknowns. (7)

    w: angular velocity of B; qd: rate of the leaf; r: from the hinge to the wheel centre; c: centre of mass, and lc its
    derivative by the coordinate.
    """
    y = float(tree.is_arm[k])
    centripetal, wl = scale(-tree.fraction[k] * y * qd * qd, r), (w[0], w[1] + y * qd, w[2])
    bias = add(add(cross(w, cross(w, c)), cross(scale(2 * qd, w), lc)), centripetal)
    gyro = add(leaf_inertia(tree, k, r, cross(w, (0.0, y * qd, 0.0))), cross(wl, leaf_inertia(tree, k, r, wl)))
    return scale(-tree.leaf_mass[k], bias), scale(-1.0, gyro)


@dispatch("suspension", default=True)
def suspend(suspension: Any, tree: VehicleTree, k: int, q: float, qd: float) -> tuple[float, float, float, float]:
    """Push along the spring-damper of leaf k, N, force against its coordinate q, lost power, W, stored energy, J.

    ``suspension``: that of the tree.
    """
    return linear_spring(tree, k, q, qd)


@dispatch("suspension", default=True)
def spring_push(suspension: Any, tree: VehicleTree, k: int, q: float, qd: float) -> float:
    """Push along the spring-damper of leaf k, N, as an output; its last bit has always been that of this product."""
    e, slope = compression(tree, k, q)
    return tree.preload[k] + tree.stiffness[k] * e + tree.damping[k] * slope * qd


@dispatch("suspension", default=True)
def put_elements(suspension: Any, tree: VehicleTree, x: Floats, k: int, y: Floats, i: int) -> int:
    """Write the outputs of the elements of leaf k beside its spring from ``y[i]`` on; return the index after them."""
    return i


@kernel
def leaf_tensor(tree: VehicleTree, k: int, r: Vector, J: Matrix) -> None:
    """Write the inertia (3, 3) of ``leaf_inertia`` to J, kg m2. (3)"""
    for i in range(3):
        for j in range(3):
            J[i, j] = -tree.along[k] * r[i] * r[j]
        J[i, i] += tree.across[k] + (tree.transverse[k] if i != 1 else 0.0)


@kernel
def eliminate(M: Floats, b: Floats, Q: Floats, k: int, g: float, generalized_mass: float) -> None:
    """Eliminate leaf k from M (6, 6) and b (6); divide its row of Q (n, 6) by its ``generalized_mass``. (10)"""
    for i in range(6):
        b[i] -= Q[k, i] * g
        for j in range(i + 1):
            M[i, j] -= Q[k, i] * Q[k, j] / generalized_mass
    for i in range(6):
        Q[k, i] /= generalized_mass


@kernel
def reduce_leaf(tree: VehicleTree, k: int, own: tuple[float, float], first: tuple[float, float]) -> tuple[float, float]:
    """Eliminate leaf k with its generalized force and mass ``own``, a bogie with its last arm. (10)

    Returns the sums of a bogie's arms up to this one, which come with the next one as ``first``.
    """
    (force, mass), Q, g = own, tree.coupling, tree.leaf_force
    if tree.joined[k] == 1:
        force, mass = force + first[0], mass + first[1]
        for i in range(6):
            Q[k, i] += Q[k - 1, i]
    g[k] = force / mass
    if is_fixed(tree, k):
        g[k], Q[k] = 0.0, 0.0
    elif k + 1 < tree.is_arm.size and tree.joined[k + 1] == 1:
        return force, mass
    else:
        eliminate(tree.root_mass, tree.root_force, Q, k, g[k], mass)
        while tree.joined[k] == 1:
            g[k - 1] = g[k]
            for i in range(6):
                Q[k - 1, i] = Q[k, i]
            k -= 1
    return 0.0, 0.0


@kernel
def solve_symmetric(M: Floats, b: Floats) -> None:
    """Solve M x = b in place of b; M: positive definite, its lower triangle becomes the Cholesky factor."""
    n = len(b)
    for j in range(n):
        for i in range(j, n):
            s = M[i, j]
            for k in range(j):
                s -= M[i, k] * M[j, k]
            M[i, j] = np.sqrt(s) if i == j else s / M[j, j]
        for k in range(j):
            b[j] -= M[j, k] * b[k]
        b[j] /= M[j, j]
    for j in range(n - 1, -1, -1):
        for i in range(j + 1, n):
            b[j] -= M[i, j] * b[i]
        b[j] /= M[j, j]


@allocating
def rates(tree: VehicleTree, contacts: Any, hitch: Any, x: Floats, u: Floats, out: Floats) -> None:
    """Write dx/dt at the state x to ``out``; the rates of the states of seats, which are 0, are left as they are.

    u: wrenches on the units, world (6 for each input); the wrenches of the ground are added where there are contacts,
    the forces on the hitch where there is one.
    """
    n = len(tree.is_arm)
    A, M, b, J, Q, g = tree.rotation, tree.root_mass, tree.root_force, tree.tensor, tree.coupling, tree.leaf_force
    put_matrix(A, x[3:7])
    v, w = to_body(A, vector(x, 7)), vector(x, 10)
    M[:], b[:] = 0.0, 0.0
    d, spin, rate, spin_rate = ROOT, ROOT + n, ROOT + 2 * n, ROOT + 3 * n
    dissipated, momentum, first = 0.0, 0.0, (0.0, 0.0)
    if contacts is not None:
        touch(contacts, tree, x, A, v, w)
        dissipated += contacts.sums[1]
    F, T, power = root_wrench(tree, contacts, hitch, x, v, w, u, out)
    for k in range(n):
        q, qd, y = x[d + k], x[rate + k], float(tree.is_arm[k])
        r, dr = wheel_offset(tree, k, q)
        hinge, s, m = vector(tree.hinge[k], 0), tree.fraction[k], tree.leaf_mass[k]
        c, lc, turn = add(hinge, scale(s, r)), scale(s, dr), (0.0, y, 0.0)
        f, torque = unit_wrench(tree, k, A, u)
        wheel = add(hinge, r)
        power += dot(f, add(add(v, cross(w, wheel)), scale(qd, dr)))
        power += torque[0] * w[0] + torque[1] * x[spin_rate + k] + torque[2] * w[2]
        if contacts is not None:
            f, torque = add(f, vector(contacts.f, 6 * k)), add(torque, vector(contacts.f, 6 * k + 3))

        f_c, t_c = leaf_bias(tree, k, w, qd, r, c, lc)
        F = add(F, add(f, f_c))  # (8), the wheel's torque without its part about the axle
        T = add(T, add(add(cross(wheel, f), (torque[0], 0.0, torque[2])), add(cross(c, f_c), t_c)))
        momentum += tree.spin_inertia[k] * x[spin_rate + k]

        _, pull, lost_power, _ = suspend(tree.suspension, tree, k, q, qd)
        dissipated += lost_power

        Jt = leaf_inertia(tree, k, r, turn)
        generalized_mass = m * dot(lc, lc) + dot(turn, Jt)
        generalized_force = dot(dr, f) + dot(lc, f_c) + dot(turn, t_c) - pull
        put(Q[k], 0, scale(m, lc))
        put(Q[k], 3, add(cross(c, scale(m, lc)), Jt))
        leaf_tensor(tree, k, r, J)
        add_body(M, m, c, J)
        first = reduce_leaf(tree, k, (generalized_force, generalized_mass), first)

        out[d + k], out[spin + k] = qd, x[spin_rate + k] - w[1]
        out[spin_rate + k] = torque[1] / tree.spin_inertia[k]  # (4)

    T = add(T, cross((0.0, momentum, 0.0), w))  # gyroscopic moment of the wheels' spin (8)
    put(b, 0, add(vector(b, 0), F))
    put(b, 3, add(vector(b, 3), T))
    solve_symmetric(M, b)
    for k in range(n):  # (11)
        out[rate + k] = g[k] - dot(Q[k], b) - dot(Q[k, 3:], b[3:])
    root_rates(tree.gravity[0], x, A, w, b, out)
    out[-2], out[-1] = dissipated, power


@kernel
def root_wrench(
    tree: VehicleTree, contacts: Any, hitch: Any, x: Floats, v: Vector, w: Vector, u: Floats, out: Floats
) -> tuple[Vector, Vector, float]:
    """Wrench on the root about O, in B, of its free body, contacts and hitch, and power of the mounts' wrenches, W.

    Writes the rates of the hitch's states to ``out``; other arguments as of ``free_body``.
    """
    n, A = len(tree.is_arm), tree.rotation
    F, T, power = free_body(tree, A, v, w, u, tree.root_mass)
    if contacts is not None:
        F, T = add(F, vector(contacts.f, 6 * n)), add(T, vector(contacts.f, 6 * n + 3))
    if hitch is not None:
        f, torque = pull(hitch, x, A, u, out)
        F, T = add(F, f), add(T, torque)
    return F, T, power


@kernel
def free_body(tree: VehicleTree, A: Matrix, v: Vector, w: Vector, u: Floats, M: Floats) -> tuple[Vector, Vector, float]:
    """Wrench on the free body with the sprockets about O, in B, and power of the mounts' wrenches, W. (6)

    Adds its inertia to M (6, 6). A, v, w: rotation of B (3, 3), velocity of O and angular velocity, in B.
    """
    c, power = vector(tree.centre, 0), 0.0
    add_body(M, tree.masses[BODY], c, tree.inertia)
    F = scale(-tree.masses[BODY], cross(w, cross(w, c)))
    T = add(cross(c, F), cross(to_world(tree.inertia, w), w))
    for side in range(2):
        f, torque = unit_wrench(tree, len(tree.is_arm) + side, A, u)
        mount = vector(tree.sprocket[side], 0)
        F, T = add(F, f), add(T, add(torque, cross(mount, f)))
        power += dot(f, add(v, cross(w, mount))) + dot(torque, w)
    return F, T, power


@kernel
def root_rates(gravity: float, x: Floats, A: Matrix, w: Vector, b: Floats, out: Floats) -> None:
    """Write the derivative of pose and velocity of B to ``out``; b (6): accelerations but gravity, in B."""
    p = vector(x, 4)
    put(out, 0, vector(x, 7))
    out[3] = -0.5 * dot(p, w)
    put(out, 4, scale(0.5, add(scale(x[3], w), cross(p, w))))
    put(out, 7, to_world(A, vector(b, 0)))
    out[9] -= gravity  # uniform gravity accelerates the whole tree alike (12)
    put(out, 10, vector(b, 3))


@allocating
def fault(tree: VehicleTree, x: Floats) -> int:
    """Fault of the state x, a code of this module; FINE if it has none."""
    for i in range(x.size):
        if not np.isfinite(x[i]):
            return NOT_FINITE
    if abs(np.sqrt(x[3] ** 2 + x[4] ** 2 + x[5] ** 2 + x[6] ** 2) - 1.0) > 1e-2:
        return BROKEN_QUATERNION
    for k in range(len(tree.is_arm)):
        q = x[ROOT + k]
        if tree.is_arm[k] == 0:
            out_of_reach = abs(q) > tree.travel[k]
        else:  # past the dead point, where the spring's line runs through the pin
            slopes = compression(tree, k, q)[1] * compression(tree, k, 0.0)[1]
            out_of_reach = abs(q) > np.pi or (tree.drawn_length[k] > 0.0 and slopes <= 0.0)
        if out_of_reach:
            return OUT_OF_REACH + k
    return FINE


@allocating
def advance(c: Parts, x: Floats, u: Floats, h: float, steps: int) -> tuple[int, int]:
    """Integrate x in place over ``steps`` steps of h s under constant u; return steps done and fault."""
    tree, k = c.tree, c.stages
    y = k[len(RK4.b)]
    for steps_done in range(steps):
        for i in range(len(RK4.b)):
            stage(RK4, i, h, x, k, y)
            rates(tree, c.contacts, c.hitch, y, u, k[i])
        finish(RK4, h, x, k)
        code = fault(tree, x)
        if code != FINE:
            return steps_done + 1, code
        put_quat(x, 3, quat_normalise(x[3:7]))
    return steps, FINE


@allocating
def energies(tree: VehicleTree, x: Floats) -> Vector:
    """Kinetic, gravity (0 where the common centre of mass is at z = 0) and spring energy, J. (13)"""
    n, A = len(tree.is_arm), tree.rotation
    put_matrix(A, x[3:7])
    v, w = to_body(A, vector(x, 7)), vector(x, 10)
    c = vector(tree.centre, 0)
    vc, moment, spring = add(v, cross(w, c)), scale(tree.masses[BODY], c), 0.0
    kinetic = 0.5 * tree.masses[BODY] * dot(vc, vc) + 0.5 * dot(w, to_world(tree.inertia, w))
    for k in range(n):
        q, qd, spin = x[ROOT + k], x[ROOT + 2 * n + k], x[ROOT + 3 * n + k]
        r, dr = wheel_offset(tree, k, q)
        c = add(vector(tree.hinge[k], 0), scale(tree.fraction[k], r))
        vc = add(add(v, cross(w, c)), scale(qd * tree.fraction[k], dr))
        wl = (w[0], w[1] + tree.is_arm[k] * qd, w[2])
        kinetic += 0.5 * tree.leaf_mass[k] * dot(vc, vc) + 0.5 * dot(wl, leaf_inertia(tree, k, r, wl))
        kinetic += 0.5 * tree.spin_inertia[k] * spin * spin
        moment = add(moment, scale(tree.leaf_mass[k], c))
        spring += suspend(tree.suspension, tree, k, q, 0.0)[3]
    gravity = tree.gravity[0] * (tree.masses[WHOLE] * x[2] + to_world(A, moment)[2])
    return kinetic, gravity, spring
