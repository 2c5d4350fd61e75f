"""A vehicle has one inertia: rigid links, cables and beams turn as its table says."""

from typing import Any

import numpy as np
import pytest
from free_chains import HOLD, LONG_BEAMS, LONG_PLANAR, LONG_RIGID, TABLE, Beams, P, PlanarCables, made
from named_ports import parameters
from scipy.linalg import eigh

from fmus.interface.model import InvalidParameter
from fmus.physics.ancf.element import mass, straight
from fmus.physics.chain.flexible.inertia import LEAST_SHARE
from fmus.physics.chain.flexible.link_layout import coordinate_indices
from fmus.physics.chain.report import KINETIC
from fmus.track_flexible.model import Model as Flexible
from fmus.track_rigid.model import Model as Rigid

MASS, INERTIA = TABLE["track"]["mass"], tuple(TABLE["track"]["inertia"])
ROD = MASS * P**2 / 12.0
RATE = 3.0  # rad/s


def built(kind, links, ends, inertia, **changes):
    """Build a chain with the vehicle's table but with other inertias, kg m2."""
    track = {"links": links, "closed": ends is None, "wheels": [], "ground": False, "gravity": 9.81 if ends else 0.0}
    table = {**TABLE, "track": {**TABLE["track"], "inertia": list(inertia)}}
    model = kind({"vehicle": table, "track": {**track, "ends": ends}, "link_outputs": True})
    model.initialise(parameters(model, **changes))
    return model


def turning_energy(model, axis):
    """Kinetic energy of a link that turns about its first pin, J, without that of its centre of mass."""
    w = RATE * np.eye(3)[axis]
    if isinstance(model, Rigid):
        model.s.v[0] = np.concatenate([np.cross(w, [0.5 * P, 0.0, 0.0]), w])
        model.evaluate_start()
    else:
        at, across = coordinate_indices(model.kit, model.s.q, len(model.work.mass), 1)[0], model.kit.AXES
        e = np.zeros((len(at), 3))
        e[:, across] = model.s.q.reshape(-1)[at]
        e[[0, len(at) // 2]] -= e[0]
        model.s.v.reshape(-1)[at] = np.cross(w, e)[:, across]
        model.evaluate_start()
    centre = 0.5 * MASS * (0.5 * P * RATE) ** 2 if axis else 0.0
    return model.report[KINETIC] - centre


@pytest.mark.parametrize("kind", [LONG_RIGID, Flexible, LONG_BEAMS, LONG_PLANAR])
def test_a_link_turns_with_the_inertia_of_the_table(kind):
    """A link turns about each axis with the inertia of the table.

    A cable is a line: it has the inertia about its pin, and the same about its normal.
    """
    axes = {Rigid: INERTIA, Beams: INERTIA, Flexible: (0.0, INERTIA[1], INERTIA[1]), PlanarCables: (None, INERTIA[1])}
    for axis, inertia in enumerate(axes[kind]):
        if inertia is not None:
            energy = turning_energy(made(kind, 1, HOLD), axis)
            assert energy == pytest.approx(0.5 * inertia * RATE**2, rel=1e-12, abs=1e-12)
            assert inertia == 0.0 or energy != pytest.approx(0.5 * 1.03 * inertia * RATE**2, rel=1e-12)


@pytest.mark.long
def test_rotary_inertia_neither_weighs_nor_moves():
    """The rotary inertia of the elements has no part in a translation."""
    for kind in (Flexible, PlanarCables, Beams):
        model = made(kind, 1, HOLD)
        shift = np.zeros(len(model.work.mass))
        shift[:: len(shift) // 2] = 1.0
        e = straight(model.link.element)[:, 0]
        np.testing.assert_allclose(shift @ model.work.mass @ shift, MASS, rtol=1e-14)
        np.testing.assert_allclose(shift @ model.work.mass @ e, 0.5 * MASS * P, rtol=1e-14)


def motion(kind, inertia, **changes):
    """Pins of a loop of eight links that becomes oval as it spins, after 50 ms, m."""
    spin = {"start": "polygon", "start.spin": 20.0, "start.ovalling": 8.0, "step": 1e-4}
    model = built(kind, 8, None, inertia, **spin, **changes)
    for k in range(10):
        model.step(5e-3 * k, 5e-3, np.zeros(0))
    return model.pins()


@pytest.mark.long
@pytest.mark.parametrize("kind", [Flexible, Beams])
def test_flexible_links_move_as_rigid_ones_the_stiffer_they_are(kind):
    """Flexible links approach the motion of rigid ones as 1 / E; 3 % more inertia gives another limit."""
    rigid = motion(Rigid, INERTIA)
    apart = [np.abs(motion(kind, INERTIA, **{"material.youngs_modulus": E}) - rigid).max() for E in (2e8, 2e9, 2e10)]
    twin = np.abs(motion(Rigid, (INERTIA[0], 1.03 * INERTIA[1], INERTIA[2])) - rigid).max()
    assert apart[2] < 0.1 * twin
    rates = np.log10(np.array(apart[:-1]) / apart[1:])
    np.testing.assert_allclose(rates, 1.0, atol=0.2)


def eigenvalues(model):
    """Eigenvalues of a link's mass matrix relative to that of its line or volume alone."""
    c = model.link.element
    alone = np.zeros_like(model.work.mass)
    mass(
        c._replace(rotary=(0.0, 0.0, 0.0) if isinstance(model, Beams) and model.kind.element == "beam" else 0.0), alone
    )
    return eigh(model.work.mass, alone, eigvals_only=True)


@pytest.mark.parametrize("kind", [Flexible, LONG_PLANAR], ids=["cable", "planar"])
def test_a_cable_bears_all_inertias_that_rounding_leaves(kind):
    def least(share: float) -> Any:
        return built(kind, 2, HOLD, (INERTIA[0], share * LEAST_SHARE * ROD, INERTIA[2]))

    model = least(1.01)
    for k in range(3):
        model.step(1e-3 * k, 1e-3, np.zeros(0))
    assert eigenvalues(model)[0] == pytest.approx(1.01 * LEAST_SHARE, rel=1e-3)
    with pytest.raises(InvalidParameter):
        least(0.99)


@pytest.mark.long
@pytest.mark.parametrize("axis", range(3))
def test_a_beam_bears_the_inertias_of_all_bodies(axis):
    """A beam accepts every inertia that a body can have: each less than the sum of the other two."""
    bound = sum(INERTIA) - INERTIA[axis]

    def most(share: float) -> Any:
        return built(Beams, 2, HOLD, [share * bound if k == axis else INERTIA[k] for k in range(3)])

    model = most(0.999)
    for k in range(3):
        model.step(1e-3 * k, 1e-3, np.zeros(0))
    assert 0.0 < eigenvalues(model)[0] < 0.1
    with pytest.raises(InvalidParameter):
        most(1.001)
