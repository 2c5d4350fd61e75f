"""A chain of cable elements joined by pins: assembly, static equilibrium, integration over a communication step.

A node (pin) has 8 coordinates: position x, y, z; slope of the link that ends there along x and z; slope of the link that
begins there along x and z; the shared slope along the joint axis y. That is the pin of paper (2), eliminated.
The four slopes along x and z of a link belong to it alone, so each Newton step condenses them link by link and leaves a
cyclic block tridiagonal system of 4 x 4 blocks (x, y, z and the shared slope of each pin).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.jit import kernel
from fmus.physics.ancf.cable import (Cable, end_moments, energy, force, mass, shape, shape_slope, stiffness)
from fmus.physics.block_cyclic import factor, invert, solve, workspace
from fmus.physics.contact.friction import Scratch, scratch
from fmus.physics.contact.ground import ground_contact
from fmus.physics.contact.partner import collect, move
from fmus.physics.contact.teeth import teeth_contact
from fmus.physics.contact.wheel import GAUSS, reach, wheel_contact
from fmus.physics.integrate.generalized_alpha import auxiliary, coefficients, slopes

NODE = 8  # coordinates of a pin
OUTER = np.array([0, 1, 2, 4, 6, 7, 8, 10])  # of an element's 12: those shared with its neighbours, 4 a pin
INNER = np.array([3, 5, 9, 11])  # those of its own
FROM = np.array([0, 1, 2, 5, 7, 6])  # where a beginning link's (position, slope) lie in its first pin
TO = np.array([0, 1, 2, 3, 7, 4])  # where an ending link's lie in its second pin
SHARED = np.array([0, 1, 2, 7])  # of a pin: what its two links share

# entries of the sums of one evaluation
CONTACT, POWER, DEPTH, LOAD, SLIP = 0, 1, 2, 3, 4
SUMS = 5


class Links(NamedTuple):
    """The links of a chain, all alike."""

    count: int
    closed: int
    cable: Cable
    face: float  # contact faces from the pin line, m
    outer_fibre: float  # m
    area: float  # m2
    second_moment: float  # m4


class Work(NamedTuple):
    """Arrays of the Newton iteration, made once."""

    A: np.ndarray  # (nodes, 4, 4) diagonal blocks
    U: np.ndarray  # (nodes, 4, 4) to the next pin
    L: np.ndarray  # (nodes, 4, 4) to the previous pin
    factors: np.ndarray
    b: np.ndarray  # (nodes, 4)
    K: np.ndarray  # (12, 12) iteration matrix of one link
    R: np.ndarray  # (links, 4, 3) residual of each link: inertia + internal - external
    inner: np.ndarray  # (links, 4, 4) inverse of its own part
    right: np.ndarray  # (links, 4, 8) inner^-1 times the coupling to the pins
    left: np.ndarray  # (links, 8, 4) coupling of the pins to its own part
    own: np.ndarray  # (links, 4) inner^-1 times its own residual
    e: np.ndarray  # (4, 3)
    v: np.ndarray  # (4, 3)
    dv: np.ndarray  # (4, 3)
    W: np.ndarray  # (4, 3)
    V: np.ndarray  # (4, 3)
    M: np.ndarray  # (4, 4)
    S: np.ndarray  # (4) shape functions
    C: np.ndarray  # (4) their slopes
    x: np.ndarray  # (3)
    u: np.ndarray  # (3)
    swap: np.ndarray  # (8)
    moved: np.ndarray  # (m, 15) wheels at the time of evaluation
    wrench: np.ndarray  # (m + 1, 6) on the wheels, and on the ground
    sums: np.ndarray  # (SUMS)
    contact: Scratch


def work(links: int, nodes: int, wheels: int) -> Work:
    """Fresh zeroed arrays."""
    z = np.zeros
    return Work(z((nodes, 4, 4)), z((nodes, 4, 4)), z((nodes, 4, 4)), workspace(nodes, 4), z((nodes, 4)), z((12, 12)),
                z((links, 4, 3)), z((links, 4, 4)), z((links, 4, 8)), z((links, 8, 4)), z((links, 4)),
                z((4, 3)), z((4, 3)), z((4, 3)), z((4, 3)), z((4, 3)), z((4, 4)), z(4), z(4), z(3), z(3), z(8),
                z((wheels, 15)), z((wheels + 1, 6)), z(SUMS), scratch())


@kernel
def gather(q, i, j, e):
    """Element coordinates (4, 3) of the link from pin ``i`` to pin ``j``."""
    for k in range(3):
        e[0, k] = q[i, k]
        e[2, k] = q[j, k]
    e[1, 0], e[1, 1], e[1, 2] = q[i, 5], q[i, 7], q[i, 6]
    e[3, 0], e[3, 1], e[3, 2] = q[j, 3], q[j, 7], q[j, 4]


@kernel
def locate(links, w, xi, offset):
    """Point at ``xi`` on the face ``offset`` outside the centreline: position and velocity into ``w.x``, ``w.u``.

    Leaves shape functions in ``w.S`` and offset x slopes / |r_x| in ``w.C``. Returns tangent and normal (in x, z).
    The normal is r_x x e_y; its change is -tangent (normal . dr_x) / |r_x|.
    """
    shape(links.cable, xi, w.S)
    shape_slope(links.cable, xi, w.C)
    a = b = da = db = 0.0
    for k in range(4):
        a += w.C[k] * w.e[k, 0]
        b += w.C[k] * w.e[k, 2]
        da += w.C[k] * w.v[k, 0]
        db += w.C[k] * w.v[k, 2]
    rho = np.sqrt(a * a + b * b)
    t0, t2 = a / rho, b / rho
    turn = offset * (t0 * db - t2 * da) / rho
    for i in range(3):
        x = u = 0.0
        for k in range(4):
            x += w.S[k] * w.e[k, i]
            u += w.S[k] * w.v[k, i]
        w.x[i], w.u[i] = x, u
    w.x[0] -= offset * t2
    w.x[2] += offset * t0
    w.u[0] -= turn * t0
    w.u[2] -= turn * t2
    for k in range(4):
        w.C[k] *= offset / rho
    return t0, t2


@kernel
def load(w, R, by_rate, t0, t2, tangent):
    """Put the contact force at the point of ``locate`` on the link: residual ``R`` and, if wanted, matrix ``w.K``.

    With B = S - C t n^T: R -= B^T f, K -= B^T (f_x + by_rate f_v) B.
    """
    f, S, C = w.contact.f, w.S, w.C
    along = f[0] * t0 + f[2] * t2
    for k in range(4):
        R[k, 0] -= S[k] * f[0] + C[k] * along * t2
        R[k, 1] -= S[k] * f[1]
        R[k, 2] -= S[k] * f[2] - C[k] * along * t0
    if not tangent:
        return
    G = w.W  # scratch: (3, 3) part
    for i in range(3):
        for j in range(3):
            G[i, j] = w.contact.f_x[i, j] + by_rate * w.contact.f_v[i, j]
    n = (-t2, 0.0, t0)
    gt = (G[0, 0] * t0 + G[0, 2] * t2, G[1, 0] * t0 + G[1, 2] * t2, G[2, 0] * t0 + G[2, 2] * t2)
    tg = (G[0, 0] * t0 + G[2, 0] * t2, G[0, 1] * t0 + G[2, 1] * t2, G[0, 2] * t0 + G[2, 2] * t2)
    tgt = tg[0] * t0 + tg[2] * t2
    for i in range(3):
        for j in range(3):
            g, p, o, r = G[i, j], gt[i] * n[j], n[i] * tg[j], tgt * n[i] * n[j]
            for a in range(4):
                left, right = S[a] * g - C[a] * o, C[a] * r - S[a] * p
                for b in range(4):
                    w.K[3 * a + i, 3 * b + j] -= S[b] * left + C[b] * right


@kernel
def note(w, k, depth, normal, stored, power):
    """Book a contact with the partner ``k``."""
    w.sums[CONTACT] += stored
    w.sums[POWER] += power
    if depth > w.sums[DEPTH]:
        w.sums[DEPTH] = depth


@kernel
def link_contacts(links, wheels, env, w, R, by_rate, tangent):
    """Contacts of the faces of the link in ``w.e`` with rims and ground."""
    for k in range(wheels.radius.size):
        if wheels.teeth[k]:
            continue
        row = w.moved[k]
        far = wheels.radius[k] + links.face + links.cable.l
        d0, d2 = w.e[0, 0] - row[0], w.e[0, 2] - row[2]
        if d0 * d0 + d2 * d2 > far * far:
            continue
        low, high = reach(row, wheels.radius[k], w.e[0], w.e[2], links.face)
        if high <= low:
            continue
        for side in (-1.0, 1.0):
            xi = 0.5 * (low + high) + side * GAUSS * (high - low)
            t0, t2 = locate(links, w, xi, -links.face)
            depth, normal, stored, power, _ = wheel_contact(env.wheel, 0.5 * (high - low), wheels.radius[k], row,
                                                            w.x, w.u, w.contact)
            if depth > 0.0:
                note(w, k, depth, normal, stored, power)
                collect(row, w.x, w.contact.f, w.wrench[k])
                load(w, R, by_rate, t0, t2, tangent)
    if env.ground and min(w.e[0, 2], w.e[2, 2]) - 1.1 * links.face - 0.1 * links.cable.l < env.height:
        last = wheels.radius.size
        for side in (-1.0, 1.0):
            t0, t2 = locate(links, w, 0.5 + side * GAUSS, links.face)
            depth, normal, stored, power, _ = ground_contact(env.soil, 0.5, env.height, w.x, w.u, w.contact)
            if depth > 0.0:
                note(w, last, depth, normal, stored, power)
                w.sums[LOAD] += normal
                w.sums[SLIP] -= normal * w.u[0]
                for i in range(3):
                    w.wrench[last, i] -= w.contact.f[i]
                load(w, R, by_rate, t0, t2, tangent)


@kernel
def pin_loads(links, wheels, env, q, v, w, by_rate, tangent):
    """Teeth, transverse damping and end loads on the pins; the residual goes into ``w.b``, the matrix into ``w.A``."""
    nodes = q.shape[0]
    for k in range(wheels.radius.size):
        if not wheels.teeth[k]:
            continue
        row = w.moved[k]
        for i in range(nodes):
            d0, d2 = q[i, 0] - row[0], q[i, 2] - row[2]
            if d0 * d0 + d2 * d2 > wheels.radius[k] ** 2:
                continue
            depth, normal, stored, power, _ = teeth_contact(env.sprocket, 1.0, wheels.profile, row, q[i, :3], v[i, :3],
                                                            w.contact)
            if depth <= 0.0:
                continue
            note(w, k, depth, normal, stored, power)
            collect(row, q[i, :3], w.contact.f, w.wrench[k])
            for a in range(3):
                w.b[i, a] -= w.contact.f[a]
                if tangent:
                    for b in range(3):
                        w.A[i, a, b] -= w.contact.f_x[a, b] + by_rate * w.contact.f_v[a, b]
    if env.transverse > 0.0:
        for i in range(nodes):
            before, after = max(i - 1, 0), min(i + 1, nodes - 1)
            if links.closed:
                before, after = (i - 1) % nodes, (i + 1) % nodes
            t0, t2 = q[after, 0] - q[before, 0], q[after, 2] - q[before, 2]
            size = np.sqrt(t0 * t0 + t2 * t2)
            n0, n2 = -t2 / size, t0 / size
            across = n0 * v[i, 0] + n2 * v[i, 2]
            w.sums[POWER] += env.transverse * (across * across + v[i, 1] * v[i, 1])
            w.b[i, 0] += env.transverse * across * n0
            w.b[i, 1] += env.transverse * v[i, 1]
            w.b[i, 2] += env.transverse * across * n2
            if tangent:
                d = by_rate * env.transverse
                w.A[i, 0, 0] += d * n0 * n0
                w.A[i, 0, 2] += d * n0 * n2
                w.A[i, 2, 0] += d * n0 * n2
                w.A[i, 2, 2] += d * n2 * n2
                w.A[i, 1, 1] += d
    if env.ends == 2:
        for a in range(3):
            w.b[0, a] -= env.pull[0, a]
            w.b[nodes - 1, a] -= env.pull[1, a]
    if env.ends == 1:
        for i in (0, nodes - 1):
            for a in range(3):
                w.b[i, a] = 0.0
                if tangent:
                    for b in range(4):
                        w.A[i, a, b] = w.U[i, a, b] = w.L[i, a, b] = 0.0
                    w.A[i, a, a] = 1.0


@kernel
def evaluate(links, wheels, env, q, v, vdot, by_rate, by_acceleration, w, tangent):
    """Residual M vdot + Q - Q_ext of the whole chain, condensed to the pins, into ``w.b``; with ``tangent`` also the
    condensed iteration matrix into ``w.A``, ``w.U``, ``w.L``. Contact sums and wrenches on the wheels at ``w.moved``.

    q, v, vdot (nodes, 8). Returns the largest entry of the residual, N, and the link it belongs to.
    """
    n, nodes, c = links.count, q.shape[0], links.cable
    w.b[:] = 0.0
    w.sums[:] = 0.0
    w.wrench[:] = 0.0
    if tangent:
        w.A[:] = 0.0
        w.U[:] = 0.0
        w.L[:] = 0.0
    mass(c, w.M)
    weight = c.rhoA * c.l * env.gravity
    worst, where = 0.0, 0
    for i in range(n):
        j = (i + 1) % nodes
        R = w.R[i]
        gather(q, i, j, w.e)
        gather(v, i, j, w.v)
        gather(vdot, i, j, w.dv)
        for a in range(4):
            for k in range(3):
                R[a, k] = w.M[a, 0] * w.dv[0, k] + w.M[a, 1] * w.dv[1, k] + w.M[a, 2] * w.dv[2, k] + (
                    w.M[a, 3] * w.dv[3, k])
        R[0, 2] += 0.5 * weight
        R[1, 2] += weight * c.l / 12.0
        R[2, 2] += 0.5 * weight
        R[3, 2] -= weight * c.l / 12.0
        if tangent:
            stiffness(c, w.e, w.v, by_rate, by_acceleration, w.K, w.W, w.V)
        _, _, power = force(c, w.e, w.v, R, w.W, w.V)
        w.sums[POWER] += power
        link_contacts(links, wheels, env, w, R, by_rate, tangent)
        own = w.own[i]
        for k in range(4):
            r = R.flat[INNER[k]]
            own[k] = r
            if abs(r) > worst:
                worst, where = abs(r), i
        if tangent:
            condense(w, i, j)
        inner, left = w.inner[i], w.left[i]
        y0 = inner[0, 0] * own[0] + inner[0, 1] * own[1] + inner[0, 2] * own[2] + inner[0, 3] * own[3]
        y1 = inner[1, 0] * own[0] + inner[1, 1] * own[1] + inner[1, 2] * own[2] + inner[1, 3] * own[3]
        y2 = inner[2, 0] * own[0] + inner[2, 1] * own[1] + inner[2, 2] * own[2] + inner[2, 3] * own[3]
        y3 = inner[3, 0] * own[0] + inner[3, 1] * own[1] + inner[3, 2] * own[2] + inner[3, 3] * own[3]
        own[0], own[1], own[2], own[3] = y0, y1, y2, y3
        for k in range(4):
            w.b[i, k] += R.flat[OUTER[k]]
            w.b[j, k] += R.flat[OUTER[4 + k]]
    pin_loads(links, wheels, env, q, v, w, by_rate, tangent)
    for i in range(nodes):
        for k in range(4):
            if abs(w.b[i, k]) > worst:
                worst, where = abs(w.b[i, k]), min(i, n - 1)
    for i in range(n):
        j = (i + 1) % nodes
        left, own = w.left[i], w.own[i]
        for k in range(4):
            w.b[i, k] -= left[k, 0] * own[0] + left[k, 1] * own[1] + left[k, 2] * own[2] + left[k, 3] * own[3]
            w.b[j, k] -= left[4 + k, 0] * own[0] + left[4 + k, 1] * own[1] + left[4 + k, 2] * own[2] + (
                left[4 + k, 3] * own[3])
    if env.ends == 1:
        w.b[0, :3] = 0.0
        w.b[nodes - 1, :3] = 0.0
    return worst, where


@kernel
def condense(w, i, j):
    """Eliminate the own slopes of link ``i`` from its matrix ``w.K`` and scatter the rest to pins ``i`` and ``j``."""
    inner, right, left = w.inner[i], w.right[i], w.left[i]
    for a in range(4):
        for b in range(4):
            inner[a, b] = w.K[INNER[a], INNER[b]]
        for b in range(8):
            left[b, a] = w.K[OUTER[b], INNER[a]]
    invert(inner, w.swap)
    for a in range(4):
        for b in range(8):
            s = 0.0
            for k in range(4):
                s += inner[a, k] * w.K[INNER[k], OUTER[b]]
            right[a, b] = s
    for a in range(8):
        for b in range(8):
            s = w.K[OUTER[a], OUTER[b]]
            for k in range(4):
                s -= left[a, k] * right[k, b]
            if a < 4 and b < 4:
                w.A[i, a, b] += s
            elif a < 4:
                w.U[i, a, b - 4] += s
            elif b < 4:
                w.L[j, a - 4, b] += s
            else:
                w.A[j, a - 4, b - 4] += s


@kernel
def correct(links, w, q, v, vdot, by_rate, by_acceleration, longest):
    """Take the Newton step from the solution in ``w.b``; at most ``longest`` m. Returns the largest change of a pin, m."""
    nodes = q.shape[0]
    size = 0.0
    for i in range(nodes):
        for k in range(3):
            if not abs(w.b[i, k]) < np.inf:
                return np.inf
            size = max(size, abs(w.b[i, k]))
    scale = -1.0 if size <= longest else -longest / size
    for i in range(links.count):
        j = (i + 1) % nodes
        own, right = w.own[i], w.right[i]
        for k in range(4):
            s = own[k]
            for b in range(4):
                s -= right[k, b] * w.b[i, b] + right[k, 4 + b] * w.b[j, b]
            node, at = (i, 5 + k) if k < 2 else (j, 1 + k)
            q[node, at] += scale * s
            v[node, at] += scale * by_rate * s
            vdot[node, at] += scale * by_acceleration * s
    for i in range(nodes):
        for k in range(4):
            s = scale * w.b[i, k]
            at = SHARED[k]
            q[i, at] += s
            v[i, at] += by_rate * s
            vdot[i, at] += by_acceleration * s
    return size


@kernel
def relax(links, wheels, env, rows, q, tolerance, w):
    """Static equilibrium on wheels that stand still, from ``q`` (nodes, 8), by pseudo-time steps that grow.

    Friction and damping are left out. Returns the number of factorisations (negative: not converged) and the residual.
    """
    still, offset = np.zeros_like(q), np.zeros_like(q)
    before = q.copy()
    move(rows, 0.0, w.moved)
    pseudo, evaluations, worst = 2e-3, 0, 0.0
    for _ in range(400):
        before[:] = q
        offset[:] = 0.0
        converged = False
        for _ in range(12):
            worst, _ = evaluate(links, wheels, env, q, still, offset, 0.0, 1.0 / pseudo**2, w, True)
            evaluations += 1
            if factor(w.A, w.U, w.L, w.factors, links.closed == 1) >= 0:
                break
            solve(w.A, w.U, w.factors, links.closed == 1, w.b)
            size = correct(links, w, q, still, offset, 0.0, 1.0 / pseudo**2, 2e-2)
            if not size < 0.5:
                break
            if size < 1e-10:
                converged = True
                break
        if not converged:
            q[:] = before
            pseudo *= 0.25
            if pseudo < 1e-7:
                return -evaluations, worst
            continue
        offset[:] = 0.0
        worst, _ = evaluate(links, wheels, env, q, still, offset, 0.0, 0.0, w, False)
        if worst < tolerance:
            return evaluations, worst
        pseudo = min(2.0 * pseudo, 1e3)
    return -evaluations, worst


@kernel
def measure(links, wheels, env, q, v, w, report):
    """Fill the report (see fmus.track) with what the state and the sums of the last evaluation say."""
    n, nodes, c = links.count, q.shape[0], links.cable
    kinetic = strain_energy = gravity = along = 0.0
    low, high, mean, stress = np.inf, -np.inf, 0.0, 0.0
    for i in range(n):
        j = (i + 1) % nodes
        gather(q, i, j, w.e)
        gather(v, i, j, w.v)
        for a in range(4):
            for b in range(4):
                s = 0.0
                for k in range(3):
                    s += w.v[a, k] * w.v[b, k]
                kinetic += 0.5 * w.M[a, b] * s
        strain_energy += energy(c, w.e, w.W, w.V)
        gravity += c.rhoA * c.l * env.gravity * (0.5 * (w.e[0, 2] + w.e[2, 2]) + c.l / 12.0 * (w.e[1, 2] - w.e[3, 2]))
        tension, fibre = axial(links, w)
        low, high, mean = min(low, tension), max(high, tension), mean + tension / n
        stress = max(stress, fibre)
        d0, d1, d2 = w.e[2, 0] - w.e[0, 0], w.e[2, 1] - w.e[0, 1], w.e[2, 2] - w.e[0, 2]
        length = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        along += 0.5 * ((w.v[0, 0] + w.v[2, 0]) * d0 + (w.v[0, 1] + w.v[2, 1]) * d1 + (
            w.v[0, 2] + w.v[2, 2]) * d2) / length / n
    report[1], report[2], report[3], report[4], report[5] = along, low, mean, high, stress
    report[6], report[7], report[8], report[9] = kinetic, strain_energy, gravity, w.sums[CONTACT]
    report[12] = w.sums[DEPTH]
    report[16] = w.sums[SLIP] / w.sums[LOAD] if w.sums[LOAD] > 0.0 else 0.0


@kernel
def axial(links, w):
    """Tension, N, and largest axial stress, Pa, of the link in ``w.e``."""
    c = links.cable
    d = (w.e[2, 0] - w.e[0, 0]) ** 2 + (w.e[2, 1] - w.e[0, 1]) ** 2 + (w.e[2, 2] - w.e[0, 2]) ** 2
    # average Green strain, as in cable.strain
    s = 36.0 * d / (c.l * c.l)
    for k in range(3):
        g, p, r = w.e[2, k] - w.e[0, k], w.e[1, k], w.e[3, k]
        s += -6.0 * g * (p + r) / c.l + 4.0 * p * p - 2.0 * p * r + 4.0 * r * r
    tension = c.EA * 0.5 * (s / 30.0 - 1.0)
    first, second = end_moments(c, w.e)
    bend = max(first, second) * links.outer_fibre / links.second_moment
    at = tension / links.area
    return tension, max(abs(at + bend), abs(at - bend))


@kernel
def advance(links, wheels, env, rows, h, longest, radius, tolerance, q, v, a, vdot, wrench0, aux, power, w, mean, report,
            counters):
    """Integrate by generalised-alpha over a communication step of ``h`` s, internal steps of at most ``longest`` s.

    q, v, a, vdot (nodes, 8) and wrench0, aux (wheels + 1, 6), power (1) are the state. ``mean`` (wheels + 1, 6) receives
    the mean wrenches, through the same recursion as the momentum of the chain. A step that Newton cannot do is halved.
    Returns 0, or 1 (Newton failed) or 2 (singular), with the time reached, the link and the residual.
    """
    coef = coefficients(radius)
    q0, v0, a0, d0 = q.copy(), v.copy(), a.copy(), vdot.copy()
    mean[:] = 0.0
    done, where, worst = 0.0, 0, 0.0
    pieces = max(int(np.ceil(h / longest - 1e-9)), 1)
    dt = h / pieces
    while done < h * (1.0 - 1e-12):
        if done + dt > h * (1.0 - 1e-9):
            dt = h - done
        s = slopes(coef, dt)
        q0[:], v0[:], a0[:], d0[:] = q, v, a, vdot
        for i in range(q.shape[0]):
            for k in range(NODE):
                a1 = auxiliary(coef, a0[i, k], d0[i, k], d0[i, k])
                q[i, k] += dt * v0[i, k] + dt * dt * ((0.5 - coef.beta) * a0[i, k] + coef.beta * a1)
                v[i, k] += dt * ((1.0 - coef.gamma) * a0[i, k] + coef.gamma * a1)
        move(rows, done + dt, w.moved)
        converged, failure = False, 1
        for _ in range(10):
            worst, where = evaluate(links, wheels, env, q, v, vdot, s.v, s.vdot, w, True)
            counters[1] += 1
            counters[2] += 1
            if factor(w.A, w.U, w.L, w.factors, links.closed == 1) >= 0:
                failure = 2
                break
            solve(w.A, w.U, w.factors, links.closed == 1, w.b)
            size = correct(links, w, q, v, vdot, s.v, s.vdot, 0.5 * links.cable.l)
            if not size < 10.0:
                break
            if size < tolerance:
                converged = True
                break
        if not converged:
            q[:], v[:], a[:], vdot[:] = q0, v0, a0, d0
            counters[3] += 1
            dt *= 0.5
            if dt < 1e-4 * min(h, longest):
                return failure, done, where, worst
            continue
        for i in range(q.shape[0]):
            for k in range(NODE):
                a[i, k] = auxiliary(coef, a0[i, k], d0[i, k], vdot[i, k])
        worst, where = evaluate(links, wheels, env, q, v, vdot, s.v, s.vdot, w, False)
        counters[1] += 1
        for i in range(mean.shape[0]):
            for k in range(6):
                old = aux[i, k]
                aux[i, k] = auxiliary(coef, old, wrench0[i, k], w.wrench[i, k])
                mean[i, k] += dt / h * ((1.0 - coef.gamma) * old + coef.gamma * aux[i, k])
                wrench0[i, k] = w.wrench[i, k]
        report[10] += 0.5 * dt * (power[0] + w.sums[POWER])
        power[0] = w.sums[POWER]
        if env.ends == 2:
            for k in range(3):
                report[11] += env.pull[0, k] * (q[0, k] - q0[0, k])
                report[11] += env.pull[1, k] * (q[-1, k] - q0[-1, k])
        before = report[1]
        measure(links, wheels, env, q, v, w, report)
        report[0] += 0.5 * dt * (before + report[1])
        done += dt
        counters[0] += 1
    return 0, done, where, worst
