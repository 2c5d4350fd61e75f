"""Sliding joint: a point, or a second cable, that slides along a flexible cable of several elements.

Equation (4) of Shabana et al., Ideal compliant joints and integration of computer aided design and analysis. The
position u of the joint along the rail (m of undeformed length) and the ratio m of the two gradients are coordinates
without inertia:

    C_1 = r(u) - r_p = 0,    C_2 = r_x(u) - m g = 0        g: the slope of the sliding cable at its joint

Six equations less two unknowns remove four degrees of freedom; a bare point has C_1 and u only and loses two.

All coordinates are vectors X (N, 3); those of an element are T X with constant T (4, N), so meshes, pins and control
points are treated alike. At C1 nodes r_xx jumps between elements: a cable that slides over such a node changes its
angular velocity at once, which is an impact. A ``smooth`` rail has the control points of a cubic spline as coordinates
(bspline.py); it is C2 and causes no impact. A point passes either rail without one.

Time: the discrete gradient method of Gonzalez, Physica D 132, 1999, order 2. For a step from 0 to 1,

    M (V1 - V0)/h + F(X0, X1) + G_X^T lam = weight,    V1 + V0 = 2 (X1 - X0)/h
    G_u . lam = -drag (u1 - u0)/h,    G_m . lam = 0,    C(X1, u1, m1) = 0

where F is the elastic force with the mean strain at the mean position, and G the difference quotients of C, with
G (z1 - z0) = C1 - C0. The constraint does no work at any step size, also across nodes: energy and constraint are
conserved to rounding. The rate of the constraint holds to second order (``rates`` returns its residual); oscillations
after an impact are not damped.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.physics.ancf import cable
from fmus.physics.ancf.cable import Cable
from fmus.physics.arrays import Floats
from tests.validation.ancf import bspline
from tests.validation.ancf.bspline import FALLING, POWERS, polynomial

ITERATIONS = 20
CLOSED = 1e-12  # largest Newton correction of a converged step, relative to the rail


class Bodies(NamedTuple):
    """All bodies, with N coordinate vectors."""

    M: Floats  # (N, N) mass, kg
    K: Floats  # (N, N) bending stiffness, N/m
    G: Floats  # (n, N, N) int S_x^T S_x dx of each element
    EA: Floats  # (n) axial stiffness, N
    l: Floats  # (n) lengths, m
    load: Floats  # (N, 3) constant force, N
    free: NDArray[np.bool_]  # (3 N) components without a support
    shift: Floats  # (N) change by a unit translation: 1 for positions, 0 for slopes


class Rail(NamedTuple):
    """Rail and slider of the joint."""

    nodes: Floats  # (n + 1) limits of its elements, m of undeformed length
    powers: Floats  # (n, 4, N) r(u) = sum_p xi^p powers[k, p] X in element k
    point: Floats  # (N) factor of X for the sliding point
    slope: Floats  # (N) factor of X for the sliding slope g; (0) for a bare point
    drag: float  # viscous friction along the rail, N s/m


class State(NamedTuple):
    """State of motion."""

    X: Floats  # (N, 3) m
    V: Floats  # (N, 3) m/s
    w: Floats  # (1 or 2) u, m, and the ratio of the gradients
    lam: Floats  # (3 or 6) mean multipliers of the last step, N and N m
    lost: float  # J, dissipated by drag


# Building ----------------------------------------------------------------------------------------------------------


def chain_map(n: int, l: float, smooth: bool = False) -> Floats:
    """Map T (n, 4, N) of a straight mesh of ``n`` elements from nodal r, r_x or spline control points."""
    if smooth:
        return bspline.extraction(l * np.concatenate([[0.0] * 3, np.arange(n + 1.0), [n] * 3]))
    T = np.zeros((n, 4, 2 * (n + 1)))
    for k in range(n):
        T[k, np.arange(4), 2 * k + np.arange(4)] = 1.0
    return T


def bodies(
    parts: list[tuple[Cable, Floats]], points: list[float], gravity: float, held: Floats
) -> tuple[Bodies, list[Floats]]:
    """Assemble meshes ``parts`` (a cable and its T (n, 4, N_i)) and point masses ``points``, kg.

    ``held``: rows (k, N) that select the supported coordinate vectors; gravity, m/s2, acts along -z. Returns the bodies
    and the T (n, 4, N) of each part.
    """
    sizes = [T.shape[2] for _, T in parts]
    N = sum(sizes) + len(points)
    M, K, load = np.zeros((N, N)), np.zeros((N, N)), np.zeros((N, 3))
    G, maps, at = [], [], 0
    shift = np.ones(N)
    for (c, T), size in zip(parts, sizes, strict=True):
        wide = np.zeros((len(T), 4, N))
        wide[:, :, at : at + size] = T
        moved = np.tile([1.0, 0.0, 1.0, 0.0], len(T))
        shift[at : at + size] = np.linalg.lstsq(T.reshape(-1, size), moved, rcond=None)[0]
        at += size
        maps.append(wide)
        m = np.zeros((4, 4))
        cable.mass(c, m)
        g, bend = np.array(cable.linear(c._replace(EI=0.0), 1.0, 0.0)), np.array(cable.linear(c, 0.0, 0.0))
        weight = c.rhoA * c.l * gravity * np.array([0.5, c.l / 12.0, 0.5, -c.l / 12.0])
        for t in wide:
            M += t.T @ m @ t
            K += t.T @ bend @ t
            load[:, 2] -= weight @ t
            G.append(t.T @ g @ t)
    M[at:, at:] = np.diag(points)
    load[at:, 2] = -gravity * np.array(points)
    free = np.repeat(~held.any(axis=0), 3)
    elements = [c for c, T in parts for _ in T]
    EA, lengths = np.array([c.EA for c in elements]), np.array([c.l for c in elements])
    return Bodies(M, K, np.array(G), EA, lengths, load, free, shift), maps


def rail(c: Cable, T: Floats, point: Floats, slope: Floats | None = None, drag: float = 0.0) -> Rail:
    """Rail of a mesh of cables ``c`` with map ``T`` (n, 4, N), for a sliding ``point`` and ``slope`` (N,)."""
    powers = POWERS * np.array([1.0, c.l, 1.0, c.l])
    nodes = c.l * np.arange(len(T) + 1.0)
    return Rail(nodes, np.einsum("pa,kaN->kpN", powers, T), point, np.zeros(0) if slope is None else slope, drag)


# The rail at a place, and between two ------------------------------------------------------------------------------


def element(r: Rail, u: float) -> int:
    """Element at ``u``, m; beyond its ends the rail continues its first or last element."""
    return min(max(int(np.searchsorted(r.nodes, u, side="right")) - 1, 0), len(r.powers) - 1)


def row(r: Rail, u: float, order: int) -> Floats:
    """Row (N,) whose product with X is the derivative of ``order`` of r(u)."""
    k = element(r, u)
    l = r.nodes[k + 1] - r.nodes[k]
    return polynomial((u - r.nodes[k]) / l, order) / l**order @ r.powers[k]


def quotient(r: Rail, u0: float, u1: float, order: int) -> tuple[Floats, Floats]:
    """Rows (N,), (N,): difference quotient of a derivative of r between u0 and u1; its derivative by u1.

    Evaluated as polynomials, without division by a short distance; across nodes the mean of the pieces by length.
    """
    first, last = element(r, u0), element(r, u1)
    if first == last:
        return _within(r, first, u0, u1, order)
    step = 1 if last > first else -1
    total, a = np.zeros(r.powers.shape[2]), u0
    for k in range(first, last, step):
        b = r.nodes[k + 1] if step > 0 else r.nodes[k]
        total += (b - a) * _within(r, k, a, b, order)[0]
        a = b
    piece, change = _within(r, last, a, u1, order)
    way = u1 - u0
    mean = (total + (u1 - a) * piece) / way
    return mean, (piece + (u1 - a) * change - mean) / way


def _within(r: Rail, k: int, u0: float, u1: float, order: int) -> tuple[Floats, Floats]:
    l = r.nodes[k + 1] - r.nodes[k]
    a, b = (u0 - r.nodes[k]) / l, (u1 - r.nodes[k]) / l
    means = (0.0, 1.0, a + b, a * a + a * b + b * b)
    changes = (0.0, 0.0, 1.0, a + 2.0 * b)
    weight, slope = np.zeros(4), np.zeros(4)
    for p in range(order, 4):
        weight[p] = FALLING[order, p] * means[p - order] / l ** (order + 1)
        slope[p] = FALLING[order, p] * changes[p - order] / l ** (order + 2)
    return weight @ r.powers[k], slope @ r.powers[k]


# The constraint ----------------------------------------------------------------------------------------------------


def constraint(r: Rail, X: Floats, w: Floats) -> Floats:
    """Residual of the equations (4): (3,) for a point, m, (6,) for a cable."""
    meet = (row(r, w[0], 0) - r.point) @ X
    if not r.slope.size:
        return meet
    return np.concatenate([meet, row(r, w[0], 1) @ X - w[1] * (r.slope @ X)])


def jacobian(r: Rail, X: Floats, w: Floats) -> tuple[Floats, Floats]:
    """Derivatives of ``constraint`` by the coordinates (3 or 6, 3 N) and by u, m (3 or 6, 1 or 2)."""
    by_x, along = _spread(row(r, w[0], 0) - r.point), row(r, w[0], 1) @ X
    if not r.slope.size:
        return by_x, along[:, None]
    by_x = np.vstack([by_x, _spread(row(r, w[0], 1) - w[1] * r.slope)])
    by_w = np.zeros((6, 2))
    by_w[:3, 0], by_w[3:, 0], by_w[3:, 1] = along, row(r, w[0], 2) @ X, -(r.slope @ X)
    return by_x, by_w


def removed(b: Bodies, r: Rail, X: Floats, w: Floats) -> int:
    """Number of degrees of freedom that the joint removes: rank of its equations less that of u and m."""
    by_x, by_w = jacobian(r, X, w)
    whole = np.hstack([by_x[:, b.free], by_w])
    return int(np.linalg.matrix_rank(whole) - np.linalg.matrix_rank(by_w))


def rates(b: Bodies, r: Rail, s: State) -> tuple[Floats, Floats]:
    """Rates of u and m for the velocities, and the residual of the constraint's rate, m/s."""
    by_x, by_w = jacobian(r, s.X, s.w)
    moving = by_x @ s.V.ravel()
    rate = np.asarray(np.linalg.lstsq(by_w, -moving, rcond=None)[0], float)
    return rate, moving + by_w @ rate


def _spread(A: Floats) -> Floats:
    """Expand a matrix (or row) on coordinate vectors to components: Kronecker product with the identity."""
    A = np.atleast_2d(A)
    wide = np.zeros((len(A), 3, A.shape[1], 3))
    for i in range(3):
        wide[:, i, :, i] = A
    return wide.reshape(3 * len(A), 3 * A.shape[1])


# Forces, energy, time ----------------------------------------------------------------------------------------------


def strains(b: Bodies, X: Floats) -> Floats:
    """Average Green strain of each element."""
    return 0.5 * ((b.G @ X * X).sum(axis=(1, 2)) / b.l - 1.0)


def elastic(b: Bodies, X: Floats) -> Floats:
    """Elastic force (N, 3), the gradient of the strain energy."""
    return (np.tensordot(b.EA * strains(b, X), b.G, 1) + b.K) @ X


def energy(b: Bodies, s: State) -> tuple[float, float, float]:
    """Kinetic, strain and gravity energy, J."""
    eps = strains(b, s.X)
    strain = 0.5 * float(np.sum(b.EA * b.l * eps * eps)) + 0.5 * float(np.sum(s.X * (b.K @ s.X)))
    return 0.5 * float(np.sum(s.V * (b.M @ s.V))), strain, -float(np.sum(b.load * s.X))


def momentum(b: Bodies, s: State) -> tuple[Floats, Floats]:
    """Linear momentum, kg m/s, and angular momentum about the origin, kg m2/s."""
    p = b.M @ s.V
    return b.shift @ p, np.cross(s.X, p).sum(axis=0)


def system(b: Bodies, r: Rail, s: State, h: float, z: tuple[Floats, Floats, Floats]) -> tuple[Floats, Floats]:
    """Residual and its derivative for a step of ``h``, s, from ``s`` at the iterate ``z`` = X1, w1, lam.

    Rows: momentum (3 N), then u and m, then the constraint; columns in the same order.
    """
    X1, w1, lam = z
    n, k, m = X1.size, len(w1), len(lam)
    mean = 0.5 * (s.X + X1)
    eps = 0.5 * (strains(b, s.X) + strains(b, X1))
    stiff = np.tensordot(b.EA * eps, b.G, 1) + b.K
    inertia = 2.0 / h**2 * b.M
    R, A = np.zeros(n + k + m), np.zeros((n + k + m, n + k + m))
    force = inertia @ (X1 - s.X - h * s.V) + stiff @ mean - b.load
    push, pull = b.G @ mean, b.G @ X1  # (elements, N, 3)
    A[:n, :n] = _spread(inertia + 0.5 * stiff)
    A[:n, :n] += push.reshape(-1, n).T @ ((0.5 * b.EA / b.l)[:, None] * pull.reshape(-1, n))
    # difference quotients of the constraint: position, and slope of a sliding cable
    u0, u1 = s.w[0], w1[0]
    R[n], A[n, n] = r.drag * (u1 - u0) / h, r.drag / h
    taken = [r.point, 0.5 * (s.w[1] + w1[1]) * r.slope] if r.slope.size else [r.point]
    for order, own in enumerate(taken):
        f, at = lam[3 * order : 3 * order + 3], slice(n + k + 3 * order, n + k + 3 * order + 3)
        S = 0.5 * (row(r, u0, order) + row(r, u1, order)) - own
        D, D_u = quotient(r, u0, u1, order)
        force += np.outer(S, f)
        R[n] += (D @ mean) @ f
        A[:n, n] += 0.5 * np.outer(row(r, u1, order + 1), f).ravel()
        A[n, :n] += 0.5 * np.outer(D, f).ravel()
        A[n, n] += (D_u @ mean) @ f
        A[:n, at] = _spread(S).T
        A[n, at] = D @ mean
    if r.slope.size:
        g, f = r.slope @ mean, lam[3:]
        R[n + 1], A[n + 1, n + k + 3 :] = -(g @ f), -g
        A[:n, n + 1] = A[n + 1, :n] = -0.5 * np.outer(r.slope, f).ravel()
    R[:n] = force.ravel()
    R[n + k :] = constraint(r, X1, w1)
    A[n + k :, :n], A[n + k :, n : n + k] = jacobian(r, X1, w1)
    return R, A


def step(b: Bodies, r: Rail, s: State, h: float) -> State:
    """Take a step of ``h``, s; raises ValueError if Newton does not converge or the joint leaves its rail."""
    n, k = s.X.size, len(s.w)
    keep = np.concatenate([b.free, np.ones(k + len(s.lam), dtype=bool)])
    rate, _ = rates(b, r, s)
    X, w, lam = s.X + h * s.V, s.w + h * rate, s.lam.copy()
    length, size, count = r.nodes[-1], np.inf, 0
    for count in range(1, ITERATIONS + 1):  # noqa: B007 - named in the failure
        R, A = system(b, r, s, h, (X, w, lam))
        d = np.zeros(len(R))
        d[keep] = np.linalg.solve(A[np.ix_(keep, keep)], -R[keep])
        X = X + d[:n].reshape(-1, 3)
        w = w + d[n : n + k]
        lam = lam + d[n + k :]
        before, size = size, float(np.abs(d[: n + k]).max())
        if size < CLOSED * length or (size >= before and size < 1e-9 * length):
            if not r.nodes[0] <= w[0] <= r.nodes[-1]:
                raise ValueError(f"the sliding joint left its rail of {length:.6g} m at u = {w[0]:.6g} m")
            lost = s.lost + r.drag * (w[0] - s.w[0]) ** 2 / h
            return State(X, 2.0 / h * (X - s.X) - s.V, w, lam, lost)
        if not size < 1e6 * length:
            break
    raise ValueError(
        f"Newton: a correction of {size:.3g} m after {count} iterations, the sliding joint at u = {s.w[0]:.6g} m"
    )


def at_rest(r: Rail, X: Floats, u: float) -> State:
    """State at rest with coordinates ``X`` and the joint at ``u``, m; the gradient ratio is that of slopes."""
    w = np.array([u])
    if r.slope.size:
        g = r.slope @ X
        w = np.array([u, float((row(r, u, 1) @ X) @ g / (g @ g))])
    return State(X, np.zeros_like(X), w, np.zeros(6 if r.slope.size else 3), 0.0)
