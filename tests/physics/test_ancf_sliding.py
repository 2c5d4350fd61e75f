"""The sliding joint: exact Jacobians, ranks, energy, and two descriptions of the same motion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.physics.ancf import cable
from tests.validation.ancf import sliding
from tests.validation.ancf.mesh import Member, Mesh, in_a_row, nodes
from tests.validation.meshes import RAIL, rope

L, N = 2.0, 6  # length of the rail, m, and number of its elements
BODIES = ("point", "cable")


def soft(EA, EI):
    return RAIL._replace(EA=EA, EI=EI)


def run(b, r, s, time, h, watch=None):
    for _ in range(round(time / h)):
        s = sliding.step(b, r, s, h)
        if watch is not None:
            watch(s)
    return s


def disturbed(slider, smooth=True):
    """Random bent state off the constraint, where Jacobians must hold too."""
    b, r, s = rope(slider, smooth)
    rng = np.random.default_rng(3)
    X = s.X + 0.1 * rng.standard_normal(s.X.shape)
    return b, r, s._replace(X=X, V=rng.standard_normal(X.shape))


# Equations ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("smooth", [True, False])
@pytest.mark.parametrize("slider", BODIES)
def test_jacobian_of_the_constraint(slider, smooth):
    """The Jacobian of the constraint is exact, by complex step (the constraint is a polynomial)."""
    _, r, s = disturbed(slider, smooth)
    by_x, by_w = sliding.jacobian(r, s.X, s.w)
    d = 1e-30j

    def place(k):
        w = s.w.astype(complex)
        w[k] += d
        xi = (w[0] - r.nodes[1]) / (r.nodes[2] - r.nodes[1])
        l = r.nodes[1]
        S = xi ** np.arange(4) @ r.powers[1]
        slope = np.array([0, 1, 2 * xi, 3 * xi**2]) / l @ r.powers[1]
        C = [(S - r.point) @ s.X] + ([slope @ s.X - w[1] * (r.slope @ s.X)] if slider == "cable" else [])
        return np.concatenate(C).imag / 1e-30

    assert sliding.element(r, s.w[0]) == 1
    for k in range(len(s.w)):
        np.testing.assert_allclose(by_w[:, k], place(k), rtol=1e-12, atol=1e-13)
    for j in range(s.X.size):
        X = np.zeros(s.X.size)
        X[j] = 1.0  # linear in X: a unit step is exact
        column = sliding.constraint(r, X.reshape(-1, 3), s.w)
        np.testing.assert_allclose(by_x[:, j], column, atol=1e-13)


@pytest.mark.parametrize("far", [0.02, 0.5, -0.4])
@pytest.mark.parametrize("slider", BODIES)
def test_newtons_matrix_is_the_derivative_of_its_residual(slider, far):
    """Newton's matrix is the derivative of its residual, within an element and across one and two nodes."""
    b, r, s = disturbed(slider)
    rng = np.random.default_rng(8)
    X1 = s.X + 0.05 * rng.standard_normal(s.X.shape)
    w1, lam = s.w + [far, 0.03][: len(s.w)], rng.standard_normal(len(s.lam))
    R, A = sliding.system(b, r, s, 0.01, (X1, w1, lam))
    z, n, k = np.concatenate([X1.ravel(), w1, lam]), X1.size, len(w1)
    assert sliding.element(r, w1[0]) == {0.02: 1, 0.5: 3, -0.4: 0}[far]
    numeric = np.empty_like(A)
    for j in range(len(z)):
        ends = []
        for d in (1e-5, -1e-5):
            y = z.copy()
            y[j] += d
            ends.append(sliding.system(b, r, s, 0.01, (y[:n].reshape(-1, 3), y[n : n + k], y[n + k :]))[0])
        numeric[:, j] = (ends[0] - ends[1]) / 2e-5
    assert np.abs(A - numeric).max() < 1e-7 * np.abs(A).max()
    assert np.abs(R).max() > 0.0


def test_quotients_are_quotients():
    """G (z1 - z0) = C1 - C0 to rounding at any distance; therefore the joint does no work."""
    _, r, s = disturbed("cable")
    for u1 in (0.6 + 1e-9, 0.61, 0.2, 1.9, 0.6):
        for order in (0, 1):
            D, _ = sliding.quotient(r, 0.6, u1, order)
            difference = (sliding.row(r, u1, order) - sliding.row(r, 0.6, order)) @ s.X
            np.testing.assert_allclose(D @ s.X * (u1 - 0.6), difference, atol=1e-15 * 8)
    np.testing.assert_allclose(sliding.quotient(r, 0.6, 0.6, 0)[0], sliding.row(r, 0.6, 1), atol=1e-13)


@pytest.mark.parametrize(("slider", "lost", "equations"), [("cable", 4, 6), ("point", 2, 3)])
def test_degrees_of_freedom_by_rank(slider, lost, equations):
    for smooth in (True, False):
        b, r, s = rope(slider, smooth)
        assert sliding.removed(b, r, s.X, s.w) == lost  # straight
        b, r, s = disturbed(slider, smooth)
        assert sliding.removed(b, r, s.X, s.w) == lost  # and bent
        by_x, by_w = sliding.jacobian(r, s.X, s.w)
        assert np.linalg.matrix_rank(by_x) == equations
        assert np.linalg.matrix_rank(by_w) == equations - lost


def test_force_is_the_gradient_of_the_energy():
    b, _, s = disturbed("cable")
    F = sliding.elastic(b, s.X)
    for j in (0, 7, 13, 20):
        d = np.zeros(s.X.size)
        d[j] = 1e-6
        up, down = (sliding.energy(b, s._replace(X=s.X + x * d.reshape(-1, 3)))[1] for x in (1, -1))
        assert F.ravel()[j] == pytest.approx((up - down) / 2e-6, rel=1e-6, abs=1e-7 * np.abs(F).max())


def test_the_rail_is_the_mesh_of_cables():
    """The rail has the mass, strain energy and force of the mesh with eliminated joints."""
    b, _, s = disturbed("point", smooth=False)
    mesh = Mesh([Member(cable, RAIL, nodes(cable, [0, 0, 0], np.eye(3), RAIL.l, N))], in_a_row(2, N))
    X = s.X[:-1]
    e = np.array([X[2 * k : 2 * k + 4] for k in range(N)])
    q = mesh.fit(e)
    np.testing.assert_allclose(mesh.coordinates(q), e.ravel(), atol=1e-14)
    assert mesh.energy(q) == pytest.approx(sliding.energy(b, s)[1], rel=1e-11)
    v = np.random.default_rng(2).standard_normal(X.shape)
    rate = mesh.fit(np.array([v[2 * k : 2 * k + 4] for k in range(N)])) - mesh.fit(np.zeros_like(e))
    assert mesh.force(q) @ rate == pytest.approx(np.sum(sliding.elastic(b, s.X)[:-1] * v), rel=1e-10)
    moving = s._replace(V=np.vstack([v, np.zeros(3)]))
    assert 0.5 * rate @ (mesh.M @ rate) == pytest.approx(sliding.energy(b, moving)[0], rel=1e-12)


# Motion ------------------------------------------------------------------------------------------------------------


def test_drag_takes_what_it_says():
    """Friction takes from the energy what the joint reports as lost, to rounding (twin of the energy)."""
    b, r, s = rope("cable", drag=0.05)
    start = sum(sliding.energy(b, s))
    s = run(b, r, s, 1.0, 2e-3)
    lost = start - sum(sliding.energy(b, s))
    assert s.lost > 1e-3
    assert lost == pytest.approx(s.lost, rel=1e-8)


def minimal(b, r, s, times):
    """Motion in minimal coordinates by DOP853: u, m and the rail's vectors give the slider's.

    Y are the free vectors; X = Y but for the sliding point S(u) Y and its slope S'(u) Y / m. Returns Y, u and the
    indices of Y at ``times``.
    """
    free = b.free.reshape(-1, 3).all(axis=1)
    own = r.point + (r.slope if r.slope.size else 0.0) > 0
    kept = np.flatnonzero(free & ~own)
    n, p, g = len(kept), int(r.point.argmax()), int(r.slope.argmax()) if r.slope.size else -1

    def whole(Y):
        X = s.X.copy()
        X[kept] = Y
        X[own] = 0.0
        return X

    def spatial(rows):
        return np.kron(rows, np.eye(3))

    def motion(_, z):
        half = 3 * n + len(s.w)
        Y, w, dY, dw = (
            z[: 3 * n].reshape(n, 3), z[3 * n : half],
            z[half : half + 3 * n].reshape(n, 3), z[half + 3 * n :],
        )  # fmt: skip
        X, dX = whole(Y), np.zeros_like(s.X)
        dX[kept] = dY
        S = [sliding.row(r, w[0], k) for k in range(4)]
        x, dx = [row @ X for row in S], [row @ dX for row in S]
        B = np.zeros((len(s.X), n))
        B[kept, np.arange(n)] = 1.0
        J = np.zeros((len(s.X), 3, half))
        B[p] = S[0][kept]
        X[p] = x[0]
        centripetal = np.zeros_like(X)
        centripetal[p] = 2.0 * dx[1] * dw[0] + x[2] * dw[0] ** 2
        if g >= 0:
            m, dm = w[1], dw[1]
            B[g] = S[1][kept] / m
            X[g] = x[1] / m
            turning = dx[1] + x[2] * dw[0]
            centripetal[g] = (2.0 * dx[2] * dw[0] + x[3] * dw[0] ** 2) / m
            centripetal[g] += -2.0 * turning * dm / m**2 + 2.0 * x[1] * dm**2 / m**3
        J[:, :, : 3 * n] = spatial(B).reshape(len(s.X), 3, -1)
        J[p, :, 3 * n] = x[1]
        if g >= 0:
            J[g, :, 3 * n], J[g, :, 3 * n + 1] = x[2] / m, -x[1] / m**2
        J = J.reshape(-1, half)
        mass = spatial(b.M)
        f = (b.load - sliding.elastic(b, X) - b.M @ centripetal).ravel()
        return np.concatenate([z[half:], np.linalg.solve(J.T @ mass @ J, J.T @ f)])

    rate, _ = sliding.rates(b, r, s)
    z = np.concatenate([s.X[kept].ravel(), s.w, s.V[kept].ravel(), rate])
    solution = solve_ivp(motion, (0.0, times[-1]), z, "DOP853", times, rtol=1e-9, atol=1e-11).y.T
    return solution[:, : 3 * n].reshape(-1, n, 3), solution[:, 3 * n], kept


@pytest.mark.long
@pytest.mark.parametrize(("slider", "longest"), [("point", 2.5e-3), ("cable", 1.25e-3)])
def test_against_minimal_coordinates(slider, longest):
    """The motion converges with order 2 to that in minimal coordinates, over two nodes of the rail."""
    given = {"c": soft(300.0, 0.5), "place": 0.62, "gravity": 20.0}
    b, r, s = rope(slider, **given)
    times = np.linspace(0.05, 0.35, 7)
    truth, place, kept = minimal(b, r, s, times)
    assert place.max() - place.min() > 0.05
    errors = []
    for h in (longest, longest / 2, longest / 4):
        now, gaps = s, []
        for k in range(len(times)):
            now = run(b, r, now, 0.05, h)
            gaps.append(np.append(now.X[kept] - truth[k], now.w[0] - place[k]))
        errors.append(np.sqrt(np.mean(np.square(gaps))))
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.abs(rates - 2.0).max() < 0.25, (errors, rates)
    assert errors[-1] < 2e-4
    b, r, s = rope(slider, mass=1.03, **given)  # twin: 3 % more mass
    assert np.sqrt(np.mean((run(b, r, s, 0.35, longest / 4).X[kept] - truth[-1]) ** 2)) > 5 * errors[-1]


def on_a_turning_rod(mass, h, rate=2.0):
    """Place of a point on a nearly rigid rod that turns about its pinned end, without weight."""
    b, r, s = rope("point", c=soft(1e7, 1e4), place=0.5, mass=mass, gravity=0.0, ends=1)
    s = s._replace(V=np.cross([0.0, rate, 0.0], s.X))
    return run(b, r, s, 0.6, h).w[0]


def test_point_on_a_turning_rod():
    """A point on a turning rod obeys (J + m u^2) theta' = const, u'' = u theta'^2, J = 0.5 kg/m L^3 / 3."""
    J, mass = 0.5 * L**3 / 3, 1.0
    spin = (J + mass * 0.25) * 2.0
    exact = solve_ivp(
        lambda _, y: [y[1], y[0] * (spin / (J + mass * y[0] ** 2)) ** 2], (0, 0.6), [0.5, 0.0], rtol=1e-10, atol=1e-12
    ).y[0, -1]  # fmt: skip
    assert exact > 0.75  # past two nodes
    assert on_a_turning_rod(mass, 2e-3) == pytest.approx(exact, abs=2e-5)
    assert abs(on_a_turning_rod(1.03 * mass, 2e-3) - exact) > 5e-4


def test_momentum_of_free_bodies():
    """Free bodies keep linear momentum to rounding and angular momentum at order 2."""
    drift = []
    for h in (4e-3, 2e-3):
        b, r, s = rope("cable", c=soft(1e3, 0.5), gravity=0.0, ends=0)
        s = s._replace(V=np.cross([0.0, 2.0, 0.3], s.X) + b.shift[:, None] * [1.0, -2.0, 0.5])
        assert np.abs(sliding.rates(b, r, s)[1]).max() < 1e-14
        linear, angular = sliding.momentum(b, s)
        # one kilogram each, centres of mass at 1 m and at 0.7 m
        expected = np.cross([0.0, 2.0, 0.3], [1.7, 0.0, 0.0]) + 2.0 * np.array([1.0, -2.0, 0.5])
        np.testing.assert_allclose(linear, expected, atol=1e-12)
        s = run(b, r, s, 0.4, h)
        after = sliding.momentum(b, s)
        assert np.abs(after[0] - linear).max() < 1e-11
        drift.append(np.abs(after[1] - angular).max() / np.abs(angular).max())
    assert drift[1] < 1e-3
    assert 1.6 < np.log2(drift[0] / drift[1]) < 2.6, drift


@pytest.mark.long
def test_nodes_are_impacts_for_a_cable_on_a_rail_that_is_not_smooth():
    """Nodes of a rail that is not smooth are impacts for a cable: its rate of rotation jumps there."""
    worst = []
    for smooth in (True, False):
        b, r, s = rope("cable", smooth)
        off = []
        run(b, r, s, 1.0, 2e-3, lambda s, b=b, r=r, off=off: off.append(np.abs(sliding.rates(b, r, s)[1]).max()))
        worst.append(max(off))
    assert worst[1] > 10 * worst[0]
