"""The declared order of every tableau: Butcher's conditions, and the rate on a known solution."""

import numpy as np
import pytest

from fmus.physics.integrate import runge_kutta
from fmus.physics.integrate.runge_kutta import Tableau, finish, stage

METHODS = {name: value for name, value in vars(runge_kutta).items() if isinstance(value, Tableau)}


def conditions(m: Tableau) -> list[tuple[int, float]]:
    """(order, defect) of the rooted trees with up to four nodes; Hairer, Norsett, Wanner I, table II.2.1."""
    a, b, c = m.a, m.b, m.c
    return [
        (1, b.sum() - 1),
        (2, b @ c - 1 / 2),
        (3, b @ c**2 - 1 / 3),
        (3, b @ a @ c - 1 / 6),
        (4, b @ c**3 - 1 / 4),
        (4, (b * c) @ a @ c - 1 / 8),
        (4, b @ a @ c**2 - 1 / 12),
        (4, b @ a @ a @ c - 1 / 24),
    ]


@pytest.mark.parametrize("name", METHODS)
def test_conditions_of_the_declared_order(name):
    m = METHODS[name]
    assert np.array_equal(m.a, np.tril(m.a, -1))
    assert np.allclose(m.a.sum(axis=1), m.c)
    assert all(abs(defect) < 1e-15 for order, defect in conditions(m) if order <= m.order)
    twin = m._replace(b=m.b * np.where(np.arange(len(m.b)) == 0, 1.03, 1.0))
    assert any(abs(defect) > 1e-3 for order, defect in conditions(twin) if order <= m.order)


@pytest.mark.parametrize("name", METHODS)
def test_observed_order_is_the_declared_one(name):
    """The observed order is the declared one, on x' = -x y, y' = x^2: x = 1/cosh t, y = tanh t."""
    m = METHODS[name]

    def error(steps):
        x, k, y = np.array([1.0, 0.0]), np.empty((len(m.b), 2)), np.empty(2)
        for _ in range(steps):
            for i in range(len(m.b)):
                stage(m, i, 2.0 / steps, x, k, y)
                k[i] = -y[0] * y[1], y[0] ** 2
            finish(m, 2.0 / steps, x, k)
        return np.linalg.norm(x - [1 / np.cosh(2.0), np.tanh(2.0)])

    slope = np.log2(error(64) / error(128))
    assert abs(slope - m.order) < 0.2, slope
