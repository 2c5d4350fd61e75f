"""Quaternions, rigid bodies, pins and their linear system against differences, dense algebra, exact rotations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fmus.physics.rigid import augmented, body, pin
from fmus.physics.rigid.augmented import Ends
from fmus.physics.rotation import (
    put_matrix,
    quat_advance,
    quat_forward,
    quat_from_rotation_vector,
    quat_multiply,
    quat_rotate,
)

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


def chain(n: int, ends: Ends, rng: np.random.Generator, bushed: bool):
    """System with random poses near a polygon and random blocks, and its dense Jacobian."""
    s = augmented.system(n, ends.closed, bushed)
    p, r = s.gap.shape
    q = np.array([pose(rng) for _ in range(n)])
    for i in range(n):
        turn = Rotation.from_euler("y", 2 * np.pi * i / n) * Rotation.from_rotvec(0.3 * rng.normal(size=3))
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
    s, B = chain(6, ends, rng, bushed)
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


# Quaternions ---------------------------------------------------------------------------------------------------------

RNG = np.random.default_rng(7)
VECTORS = [
    *RNG.normal(size=(12, 3)),
    np.zeros(3),
    np.array([1e-12, -2e-12, 0.0]),
    np.array([1.9e-4, 0.0, 1e-5]),
    np.array([2.1e-4, 0.0, 1e-5]),
    *(3.14159 * np.eye(3)),
    *(-3.14159 * np.eye(3)),
]


@pytest.mark.parametrize("r", VECTORS)
def test_one_rotation(r):
    reference = Rotation.from_rotvec(r)
    q = quat_from_rotation_vector(r)
    expected = reference.as_quat(scalar_first=True)
    assert np.allclose(q, expected * np.sign(expected @ q), rtol=0, atol=2e-16)
    A, v = np.empty((3, 3)), np.array([0.3, -1.2, 2.0])
    put_matrix(A, q)
    assert np.allclose(A, reference.as_matrix(), rtol=0, atol=1e-15)
    assert np.array_equal(quat_forward(q), A[:, 0])
    assert np.allclose(quat_rotate(q, v), reference.apply(v), rtol=0, atol=4e-15)


def test_product_applies_the_right_factor_first():
    p, q = (quat_from_rotation_vector(r) for r in VECTORS[:2])
    v = np.array([0.3, -1.2, 2.0])
    expected = quat_rotate(p, quat_rotate(q, v))
    assert np.allclose(quat_rotate(quat_multiply(p, q), v), expected, rtol=0, atol=4e-15)
    assert not np.allclose(quat_rotate(quat_multiply(q, p), v), expected, atol=1e-3)


def test_advance_integrates_a_constant_world_rate_exactly():
    rate, start = np.array([0.4, -2.0, 1.1]), quat_from_rotation_vector(VECTORS[0])
    q = start
    for _ in range(1000):
        q = quat_advance(q, rate * 1e-3)
    whole = quat_multiply(quat_from_rotation_vector(rate), start)
    assert np.allclose(np.array(q) * np.sign(np.dot(q, whole)), whole, rtol=0, atol=1e-13)
    body = quat_multiply(start, quat_from_rotation_vector(rate))  # twin: the rate in body axes
    assert not np.allclose(np.array(q) * np.sign(np.dot(q, body)), body, atol=1e-2)
