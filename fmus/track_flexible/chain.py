"""A chain of cable elements joined by pins: assembly, static equilibrium, integration over a communication step.

A node (pin) has 8 coordinates: position x, y, z; slope of the link that ends there along x and z; slope of the link
that begins there along x and z; the shared slope along the joint axis y. That is the pin of paper (2), eliminated.
The four slopes along x and z of a link belong to it alone, so each Newton step condenses them link by link and leaves
a cyclic block tridiagonal system of 4 x 4 blocks (x, y, z and the shared slope of each pin).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.jit import kernel
from fmus.physics.ancf.cable import Cable, mass
from fmus.physics.block_cyclic import factor, invert, solve, workspace
from fmus.physics.chain_speed import chain_speed
from fmus.physics.integrate.generalized_alpha import auxiliary, coefficients, slopes
from fmus.physics.point import Scratch, scratch
from fmus.physics.wheels import move
from fmus.track_flexible.element import end_moments, energy, force, stiffness, tension
from fmus.track_flexible.nodes import NODE, gather
from fmus.track_flexible.sums import CONTACT, DEPTH, LOAD, POWER, SLIP, SUMS
from fmus.track_flexible.touch import touch_links, touch_pins

OUTER = np.array([0, 1, 2, 4, 6, 7, 8, 10])  # of an element's 12: those shared with its neighbours, 4 a pin
INNER = np.array([3, 5, 9, 11])  # those of its own
FROM = np.array([0, 1, 2, 5, 7, 6])  # where a beginning link's (position, slope) lie in its first pin
TO = np.array([0, 1, 2, 3, 7, 4])  # where an ending link's lie in its second pin
FOUR = (0,) * 4  # size of a block, for the inversion
SHARED = np.array([0, 1, 2, 7])  # of a pin: what its two links share

CHORD = 1e-5  # m: below such a correction the iteration matrix is kept


class Links(NamedTuple):
    """The links of a chain, all alike."""

    count: int
    closed: int
    cable: Cable  # its class is the elasticity, see ``element``
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
    touched: np.ndarray  # (links) whether a link touches a rim or the ground
    load: np.ndarray  # (links, 4, 3) residual of its contacts, where touched
    stiffening: np.ndarray  # (links, 12, 12) and their iteration matrix
    wrench: np.ndarray  # (m + 1, 6) on the wheels, and on the ground
    sums: np.ndarray  # (SUMS)
    contact: Scratch


def work(links: int, nodes: int, wheels: int) -> Work:
    """Fresh zeroed arrays."""
    z = np.zeros
    return Work(
        z((nodes, 4, 4)),
        z((nodes, 4, 4)),
        z((nodes, 4, 4)),
        workspace(nodes, 4),
        z((nodes, 4)),
        z((12, 12)),
        z((links, 4, 3)),
        z((links, 4, 4)),
        z((links, 4, 8)),
        z((links, 8, 4)),
        z((links, 4)),
        z((4, 3)),
        z((4, 3)),
        z((4, 3)),
        z((4, 3)),
        z((4, 3)),
        z((4, 4)),
        z(4),
        z(4),
        z(3),
        z(3),
        z(8),
        z((wheels, 15)),
        z(links, dtype=np.bool_),
        z((links, 4, 3)),
        z((links, 12, 12)),
        z((wheels + 1, 6)),
        z(SUMS),
        scratch(),
    )


@kernel
def pin_loads(links, env, q, v, w, by_rate, tangent):
    """Transverse damping and end loads on the pins; the residual goes into ``w.b``, the matrix into ``w.A``."""
    nodes = q.shape[0]
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
    for i in (0, nodes - 1):
        if env.ends == 1 or (env.ends == 3 and i == 0):
            for a in range(3):
                w.b[i, a] = 0.0
                if tangent:
                    for b in range(4):
                        w.A[i, a, b] = w.U[i, a, b] = w.L[i, a, b] = 0.0
                    w.A[i, a, a] = 1.0


@kernel
def evaluate(links, contacts, env, q, v, vdot, by_rate, by_acceleration, w, tangent):
    """Residual M vdot + Q - Q_ext of the whole chain, condensed to the pins, into ``w.b``; with ``tangent`` also the
    condensed iteration matrix into ``w.A``, ``w.U``, ``w.L``. Contact sums and wrenches on the wheels at ``w.moved``.

    q, v, vdot (nodes, 8). Returns the largest entry of the residual, N, and the link it belongs to.
    """
    n, nodes, c = links.count, q.shape[0], links.cable
    R, own, inner, left, b, M, K = w.R, w.own, w.inner, w.left, w.b, w.M, w.K
    e, de, dde, W, V, sums = w.e, w.v, w.dv, w.W, w.V, w.sums
    b[:] = 0.0
    sums[:] = 0.0
    w.wrench[:] = 0.0
    if tangent:
        w.A[:] = 0.0
        w.U[:] = 0.0
        w.L[:] = 0.0
    mass(c, M)
    weight = c.rhoA * c.l * env.gravity
    worst, where = 0.0, 0
    if contacts is not None:
        touch_links(contacts, links, q, v, w, by_rate, tangent)
    for i in range(n):
        j = i + 1 if i + 1 < nodes else 0
        gather(q, i, j, e)
        gather(v, i, j, de)
        gather(vdot, i, j, dde)
        r = R[i]
        for a in range(4):
            for k in range(3):
                r[a, k] = (
                    M[a, 0] * dde[0, k] + M[a, 1] * dde[1, k] + M[a, 2] * dde[2, k] + M[a, 3] * dde[3, k]
                )
        r[0, 2] += 0.5 * weight
        r[1, 2] += weight * c.l / 12.0
        r[2, 2] += 0.5 * weight
        r[3, 2] -= weight * c.l / 12.0
        if tangent:
            stiffness(c, e, de, by_rate, by_acceleration, K, W, V)
        sums[POWER] += force(c, e, de, r, W, V)
        if contacts is not None:  # noqa: SIM102 - numba leaves out the whole branch
            if w.touched[i]:
                for a in range(4):
                    for k in range(3):
                        r[a, k] += w.load[i, a, k]
                if tangent:
                    K += w.stiffening[i]
        for k in range(2):
            worst, where = (abs(r[1, 2 * k]), i) if abs(r[1, 2 * k]) > worst else (worst, where)
            worst, where = (abs(r[3, 2 * k]), i) if abs(r[3, 2 * k]) > worst else (worst, where)
        if tangent:
            condense(K, w.A, w.U, w.L, inner[i], w.right[i], left[i], w.swap, i, j)
        for k in range(4):
            own[i, k] = (
                inner[i, k, 0] * r[1, 0]
                + inner[i, k, 1] * r[1, 2]
                + inner[i, k, 2] * r[3, 0]
                + (inner[i, k, 3] * r[3, 2])
            )
        for k in range(3):
            b[i, k] += r[0, k]
            b[j, k] += r[2, k]
        b[i, 3] += r[1, 1]
        b[j, 3] += r[3, 1]
    if contacts is not None:
        touch_pins(contacts, q, v, w, by_rate, tangent)
    pin_loads(links, env, q, v, w, by_rate, tangent)
    for i in range(nodes):
        for k in range(4):
            if abs(b[i, k]) > worst:
                worst, where = abs(b[i, k]), min(i, n - 1)
    for i in range(n):
        j = i + 1 if i + 1 < nodes else 0
        for k in range(4):
            for m in range(4):
                b[i, k] -= left[i, k, m] * own[i, m]
                b[j, k] -= left[i, 4 + k, m] * own[i, m]
    if env.ends == 1 or env.ends == 3:
        b[0, :3] = 0.0
    if env.ends == 1:
        b[nodes - 1, :3] = 0.0
    return worst, where


@kernel
def condense(K, A, U, L, inner, right, left, swap, i, j):
    """Eliminate the own slopes of a link from its matrix ``K`` (12, 12), scatter the rest to its pins ``i`` and ``j``.

    Leaves the inverse of its own part in ``inner`` (4, 4), that times the coupling in ``right`` (4, 8), and the
    coupling in ``left`` (8, 4).
    """
    for a in range(4):
        for b in range(4):
            inner[a, b] = K[INNER[a], INNER[b]]
        for b in range(8):
            left[b, a] = K[OUTER[b], INNER[a]]
    invert(inner, swap, FOUR)
    for a in range(4):
        for b in range(8):
            s = 0.0
            for k in range(4):
                s += inner[a, k] * K[INNER[k], OUTER[b]]
            right[a, b] = s
    for a in range(4):
        for b in range(4):
            s, o, p, r = (
                K[OUTER[a], OUTER[b]],
                K[OUTER[a], OUTER[4 + b]],
                K[OUTER[4 + a], OUTER[b]],
                K[OUTER[4 + a], OUTER[4 + b]],
            )
            for k in range(4):
                s -= left[a, k] * right[k, b]
                o -= left[a, k] * right[k, 4 + b]
                p -= left[4 + a, k] * right[k, b]
                r -= left[4 + a, k] * right[k, 4 + b]
            A[i, a, b] += s
            U[i, a, b] += o
            L[j, a, b] += p
            A[j, a, b] += r


@kernel
def correct(links, w, q, v, vdot, by_rate, by_acceleration, longest):
    """Take the Newton step from the solution in ``w.b``, at most ``longest`` m; returns the largest change of a pin."""
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
def relax(links, contacts, env, rows, q, tolerance, w):
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
            worst, _ = evaluate(links, contacts, env, q, still, offset, 0.0, 1.0 / pseudo**2, w, True)
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
        worst, _ = evaluate(links, contacts, env, q, still, offset, 0.0, 0.0, w, False)
        if worst < tolerance:
            return evaluations, worst
        pseudo = min(2.0 * pseudo, 1e3)
    return -evaluations, worst


@kernel
def measure(links, env, q, v, w, report):
    """Fill the report (see fmus.track) with what the state and the sums of the last evaluation say."""
    n, nodes, c = links.count, q.shape[0], links.cable
    kinetic = strain_energy = gravity = 0.0
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
        gravity += (
            c.rhoA
            * c.l
            * env.gravity
            * (0.5 * (w.e[0, 2] + w.e[2, 2]) + c.l / 12.0 * (w.e[1, 2] - w.e[3, 2]))
        )
        pull, fibre = axial(links, w)
        low, high, mean = min(low, pull), max(high, pull), mean + pull / n
        stress = max(stress, fibre)
    along = chain_speed(q[:, :3], v[:, :3], links.closed == 1)
    report[1], report[2], report[3], report[4], report[5] = along, low, mean, high, stress
    report[6], report[7], report[8], report[9] = kinetic, strain_energy, gravity, w.sums[CONTACT]
    report[12] = w.sums[DEPTH]
    report[16] = w.sums[SLIP] / w.sums[LOAD] if w.sums[LOAD] > 0.0 else 0.0


@kernel
def axial(links, w):
    """Tension, N, and largest axial stress, Pa, of the link in ``w.e``."""
    c = links.cable
    pull = tension(c, w.e)
    first, second = end_moments(c, w.e)
    bend = max(first, second) * links.outer_fibre / links.second_moment
    at = pull / links.area
    return pull, max(abs(at + bend), abs(at - bend))


@kernel
def advance(
    links,
    contacts,
    env,
    rows,
    h,
    longest,
    radius,
    tolerance,
    q,
    v,
    a,
    vdot,
    wrench0,
    aux,
    power,
    w,
    mean,
    report,
    counters,
):
    """Integrate by generalised-alpha over a communication step of ``h`` s, internal steps of at most ``longest`` s.

    q, v, a, vdot (nodes, 8) and wrench0, aux (wheels + 1, 6), power (1) are the state. ``mean`` (wheels + 1, 6)
    receives the mean wrenches, through the same recursion as the momentum of the chain. A step that Newton cannot do
    is halved.
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
        converged, failure, size = False, 1, np.inf
        for _ in range(12):
            fresh = size > CHORD  # close to the solution the last matrix serves once more
            worst, where = evaluate(links, contacts, env, q, v, vdot, s.v, s.vdot, w, fresh)
            counters[1] += 1
            if fresh:
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
        measure(links, env, q, v, w, report)
        report[0] += 0.5 * dt * (before + report[1])
        done += dt
        counters[0] += 1
    return 0, done, where, worst
