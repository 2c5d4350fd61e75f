"""Rigid bodies, pins and their linear system against differences, dense algebra and exact rotations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fmus.physics.integrate import generalized_alpha, hht
from fmus.physics.integrate.generalized_alpha import GeneralizedAlpha, auxiliary, coefficients, slopes
from fmus.physics.rigid import augmented, body, pin
from fmus.physics.rigid.augmented import Ends

HALF = 0.0762


def pose(rng: np.random.Generator) -> np.ndarray:
    turned = rng.normal(size=4)
    return np.concatenate([rng.normal(size=3), turned / np.linalg.norm(turned)])


def matrix(q: np.ndarray) -> np.ndarray:
    A = np.empty((3, 3))
    body.rotation(q, A)
    return A


def moved(q: np.ndarray, x: np.ndarray) -> np.ndarray:
    out = np.empty(7)
    body.advance(q, x, out)
    return out


@pytest.mark.parametrize("size", [1e-9, 1e-3, 0.09, 0.11, 2.0])
def test_advance_turns_from_the_right(size: float):
    rng = np.random.default_rng(1)
    q, x = pose(rng), rng.normal(size=6)
    x[3:] *= size / np.linalg.norm(x[3:])
    one = moved(q, x)
    assert np.abs(matrix(one) - matrix(q) @ Rotation.from_rotvec(x[3:]).as_matrix()).max() < 5e-16 * 4
    assert np.allclose(one[:3], q[:3] + x[:3], rtol=0, atol=1e-16)
    assert abs(np.linalg.norm(one[3:]) - 1.0) < 1e-15


def test_turn_rate_inverts_the_tangent():
    rng = np.random.default_rng(2)
    x, d = 0.02 * rng.normal(size=3), rng.normal(size=3)
    out, step = np.empty(3), 1e-6
    body.turn_rate(x, d, out)
    left = Rotation.from_rotvec(x - step * out)
    right = Rotation.from_rotvec(x + step * out)
    assert np.abs((left.inv() * right).as_rotvec() / (2 * step) - d).max() < 1e-8
    assert np.abs((left.inv() * right).as_rotvec() / (2 * step) - 1.01 * d).max() > 1e-3


def equations(q: np.ndarray) -> np.ndarray:
    C = np.empty(5)
    pin.equations(HALF, q[0], matrix(q[0]), q[1], matrix(q[1]), C)
    return C


def dense(q: np.ndarray) -> np.ndarray:
    B = np.empty((2, 5, 6))
    pin.jacobian(HALF, matrix(q[0]), matrix(q[1]), B[0], B[1])
    return np.hstack([B[0], B[1]])


def test_pin_jacobian_by_differences():
    rng = np.random.default_rng(3)
    q = np.array([pose(rng), pose(rng)])  # far from closed: every term matters
    B, h = dense(q), 1e-6
    for k in range(12):
        x = np.zeros((2, 6))
        x[k // 6, k % 6] = h
        ahead = equations(np.array([moved(q[i], x[i]) for i in range(2)]))
        behind = equations(np.array([moved(q[i], -x[i]) for i in range(2)]))
        assert np.abs((ahead - behind) / (2 * h) - B[:, k]).max() < 1e-9


def test_pin_velocity_terms_by_differences():
    rng = np.random.default_rng(4)
    q, v = np.array([pose(rng), pose(rng)]), rng.normal(size=(2, 6))
    g, h = np.empty(5), 1e-4
    pin.velocity_terms(HALF, matrix(q[0]), v[0, 3:], matrix(q[1]), v[1, 3:], g)

    def at(t: float) -> np.ndarray:
        return equations(np.array([moved(q[i], t * v[i]) for i in range(2)]))

    assert np.abs((at(h) - 2 * at(0.0) + at(-h)) / h**2 - g).max() < 1e-6 * np.abs(g).max()


def test_reaction_is_the_transposed_jacobian():
    rng = np.random.default_rng(5)
    q = np.array([pose(rng) for _ in range(3)])
    A = [matrix(one) for one in q]
    before, after = rng.normal(size=(2, 5))
    W, f = np.empty((4, 2, 3)), np.zeros(6)
    pin.axis_rows(A[0], A[1], W[0], W[1])
    pin.axis_rows(A[1], A[2], W[2], W[3])
    pin.reaction(HALF, A[1], before, after, W[1], W[2], f)
    expected = dense(q[:2])[:, 6:].T @ before + dense(q[1:])[:, :6].T @ after
    assert np.abs(f - expected).max() < 1e-15 * 10


def test_stiffness_by_differences():
    rng = np.random.default_rng(6)
    q, lam = pose(rng), np.zeros((2, 5))
    lam[:, :3] = rng.normal(size=(2, 3))
    none, K, h = np.zeros((2, 3)), np.zeros((3, 3)), 1e-6
    pin.stiffness(HALF, matrix(q), lam[0], lam[1], K)

    def torque(x: np.ndarray) -> np.ndarray:
        f = np.zeros(6)
        pin.reaction(HALF, matrix(moved(q, np.concatenate([np.zeros(3), x]))), lam[0], lam[1], none, none, f)
        return f[3:]

    for k in range(3):
        x = np.zeros(3)
        x[k] = h
        assert np.abs((torque(-x) - torque(x)) / (2 * h) - K[:, k]).max() < 1e-9


def chain(n: int, ends: Ends, rng: np.random.Generator, wobble: float = 0.3, bushed: bool = False):
    """System with random poses near a polygon and random blocks, and its dense Jacobian."""
    s = augmented.system(n, ends.closed, bushed)
    p, r = s.gap.shape
    q = np.array([pose(rng) for _ in range(n)])
    for i in range(n):
        turn = Rotation.from_euler("y", 2 * np.pi * i / n) * Rotation.from_rotvec(wobble * rng.normal(size=3))
        x, y, z, w = turn.as_quat()
        q[i, 3:] = w, x, y, z
        s.rotation[i] = matrix(q[i])
        s.iteration_matrix[i] = rng.normal(size=(6, 6)) + 5.0 * np.eye(6)
    B = np.zeros((r * p, 6 * n))
    still = np.eye(3)
    for j in range(p):
        P, Q = (j - 1) % n if ends.closed else j - 1, j
        if not ends.closed and ((j == 0 and not ends.first) or (j == n and not ends.last)):
            continue
        AP = s.rotation[P] if P >= 0 else still
        AQ = s.rotation[Q] if n > Q else still
        pin.axis_rows(AP, AQ, s.axes_before[j], s.axes_after[j])
        BP, BQ = np.empty((2, 5, 6))
        pin.jacobian(HALF, AP, AQ, BP, BQ)
        if P >= 0:
            B[r * j : r * j + 5, 6 * P : 6 * P + 6] += BP
            B[r * j + 5 : r * j + r, 6 * P + 4] = -1.0
        if n > Q:
            B[r * j : r * j + 5, 6 * Q : 6 * Q + 6] += BQ
            B[r * j + 5 : r * j + r, 6 * Q + 4] = 1.0
    return s, B


ENDS = [Ends(True, False, False), Ends(False, True, True), Ends(False, True, False), Ends(False, False, False)]


@pytest.mark.long
@pytest.mark.parametrize("bushed", [False, True])
@pytest.mark.parametrize("ends", ENDS)
def test_solver_equals_dense(ends: Ends, bushed: bool):
    rng = np.random.default_rng(7)
    s, B = chain(6, ends, rng, bushed=bushed)
    n, (p, r) = 6, s.gap.shape
    s.residual[:], s.gap[:] = rng.normal(size=(n, 6)), rng.normal(size=(p, r))
    bush = rng.uniform(0.5, 2.0, bushed * p)
    K = np.zeros((6 * n, 6 * n))
    for i in range(n):
        K[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] = s.iteration_matrix[i]
    D = np.zeros((r * p, r * p))
    for j in range(bush.size):
        D[r * j + 5, r * j + 5] = 1.0 / bush[j]
    if ends.closed or (ends.first and ends.last):
        j, link = (0, 0) if ends.closed else (n, n - 1)
        y = s.rotation[link, :, 1]
        D[r * j : r * j + 3, r * j : r * j + 3] = np.outer(y, y) / augmented.STIFFNESS
        D[r * j + 3, r * j + 3] = D[r * j + 4, r * j + 4] = 1.0 / augmented.TILTING
    C = s.gap.copy()
    for j, held in ((0, ends.first), (p - 1, ends.last)):
        if not ends.closed and not held:
            D[r * j : r * j + r, r * j : r * j + r] = np.eye(r)
            C[j] = 0.0
    whole = np.block([[K, -B.T], [B, D]])
    expected = -np.linalg.solve(whole, np.concatenate([s.residual.ravel(), C.ravel()]))
    assert augmented.factor(HALF, ends, s, bush, 1.0) == -1
    augmented.solve(HALF, ends, s)
    solution = np.concatenate([s.correction.ravel(), s.multiplier_correction.ravel()])
    assert np.abs(solution - expected).max() < 1e-9 * np.abs(expected).max()


def test_closed_loop_of_parallel_pins_has_three_equations_too_many():
    _, B = chain(64, ENDS[0], np.random.default_rng(8), wobble=0.0)
    assert B.shape == (320, 384)
    assert np.linalg.matrix_rank(B, tol=1e-9) == 317
    _, C = chain(64, ENDS[0], np.random.default_rng(8), wobble=0.01)
    assert np.linalg.matrix_rank(C, tol=1e-9) == 320


def test_coefficients_of_generalized_alpha():
    assert coefficients(0.0) == (-1.0, 0.0, 1.0, 1.5)
    assert coefficients(1.0) == (0.5, 0.5, 0.25, 0.5)
    for radius in (0.0, 0.5, 0.8, 1.0):
        c = coefficients(radius)
        assert c.gamma == pytest.approx(0.5 + c.alpha_f - c.alpha_m, abs=1e-15)  # second order


def oscillate(c: GeneralizedAlpha, omega: float, h: float, steps: int) -> tuple[float, float]:
    """Solve q'' = -omega^2 q from (1, 0), with one linear solve per step; return q and v."""
    s = slopes(c, h)
    q, v, vdot = 1.0, 0.0, -(omega**2)
    a = vdot
    for _ in range(steps):
        a1 = auxiliary(c, a, vdot, vdot)
        x = h * v + h * h * ((0.5 - c.beta) * a + c.beta * a1)
        v1, vdot1 = v + h * ((1 - c.gamma) * a + c.gamma * a1), vdot
        dx = -(vdot1 + omega**2 * (q + x)) / (s.vdot + omega**2)
        q, v, a, vdot = q + x + dx, v1 + s.v * dx, a1 + s.a * dx, vdot1 + s.vdot * dx
    return q, v


ALPHA = generalized_alpha.coefficients


@pytest.mark.parametrize(
    ("method", "radius"),
    [(ALPHA, 0.0), (ALPHA, 0.5), (ALPHA, 0.8), (ALPHA, 1.0), *((hht.coefficients, r) for r in (0.5, 0.8, 1.0))],
)
def test_implicit_methods_are_of_second_order(method, radius: float):
    assert generalized_alpha.order == hht.order == 2
    c = method(radius)
    errors = [abs(oscillate(c, 2.0, 1.0 / n, n)[0] - np.cos(2.0)) for n in (40, 80, 160)]
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all((rates > 1.9) & (rates < 2.1))


def test_a_gamma_that_is_off_by_some_per_cent_is_of_first_order():
    c = hht.coefficients(0.8)
    errors = [abs(oscillate(c._replace(gamma=1.04 * c.gamma), 2.0, 1.0 / n, n)[0] - np.cos(2.0)) for n in (40, 80, 160)]
    assert np.log2(errors[1] / errors[2]) < 1.3


def test_hht_is_newmarks_method_with_averaged_forces():
    """HHT is Newmark's method with averaged forces: alpha = -0.1 has beta = 0.3025 and gamma = 0.6.

    Hilber, Hughes, Taylor 1977.
    """
    c = hht.coefficients(9.0 / 11.0)
    assert c == pytest.approx((0.0, 0.1, 0.3025, 0.6), rel=1e-12)
    assert hht.coefficients(1.0) == pytest.approx((0.0, 0.0, 0.25, 0.5))  # the trapezoidal rule
    assert hht.coefficients(hht.LEAST).alpha_f == pytest.approx(1.0 / 3.0)
    assert hht.coefficients(0.5) == pytest.approx(ALPHA(0.5), abs=1e-15), "the two families are equal at 0.5"
    assert hht.coefficients(0.51) != pytest.approx(ALPHA(0.51), abs=1e-3)


@pytest.mark.parametrize(
    ("method", "radius"), [(ALPHA, 0.3), (ALPHA, 0.8), (hht.coefficients, 0.6), (hht.coefficients, 0.8)]
)
def test_spectral_radius_at_infinite_frequency(method, radius: float):
    sizes = [abs(oscillate(method(radius), 1e6, 1.0, n)[0]) for n in (40, 80)]
    assert (sizes[1] / sizes[0]) ** (1 / 40) == pytest.approx(radius, rel=0.08)
