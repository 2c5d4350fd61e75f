"""Quaternion kernels against scipy's Rotation and against each other."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fmus.physics.rotation import (
    put_matrix,
    quat_advance,
    quat_forward,
    quat_from_rotation_vector,
    quat_multiply,
    quat_rotate,
)

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


def scipy_quat(rotation: Rotation) -> np.ndarray:
    return rotation.as_quat(scalar_first=True)


@pytest.mark.parametrize("r", VECTORS)
def test_one_rotation(r):
    reference = Rotation.from_rotvec(r)
    q = quat_from_rotation_vector(r)
    expected = scipy_quat(reference)
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
