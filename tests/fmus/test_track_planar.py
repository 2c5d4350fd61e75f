"""The planar chain equals the chain of cables without its zeros: element, contacts, whole scenes."""

from __future__ import annotations

import numpy as np
import pytest
from flexible_track import at_rest, carrier, hanging

from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.interface import observe
from fmus.physics.contact.ground import bumpy_ground, surface_depth
from fmus.physics.integrate.generalized_alpha import Slopes

pytestmark = pytest.mark.long  # kernels of their own

XZ = [0, 2]
LIFT = np.array([0, 2, 3, 4, 5, 6])  # places of a planar pin's six coordinates among the cable's eight
RANDOM = np.random.default_rng(7)


def same(a, b, of: float = 1e-12) -> bool:
    return bool(np.abs(np.asarray(a) - np.asarray(b)).max() <= of * np.abs(b).max())


def lifted(model) -> tuple:
    """A cable model in the state of a planar one."""
    solid = carrier()
    for name in ("q", "v", "a", "vdot"):
        getattr(solid.s, name)[:] = 0.0
        getattr(solid.s, name)[:, LIFT] = getattr(model.s, name)
    solid.rows[:] = model.rows
    solid.work.wheels[:] = model.rows
    return solid


def test_a_moving_chain_has_the_same_residual_and_matrix():
    """A moving chain has the same residual and matrix, on all its wheels and the ground.

    Both ``by_rate`` and ``by_acceleration`` enter.
    """
    model = carrier(element="planar")
    u = at_rest(model)
    for k in range(len(model.wheel_list)):
        u[13 * k + 7 : 13 * k + 10], u[13 * k + 11] = (0.5, 0.0, -0.2), 3.0
    model.step(0.0, 1e-3, u)
    model.s.v[:] += 0.05 * RANDOM.standard_normal(model.s.v.shape)
    model.work.wheels[:] = model.rows
    solid = lifted(model)
    for m in (model, solid):
        evaluate(m)
        observe(m.link, m.environment, m.s, m.work, m.report)
    flat, full = model.work, solid.work
    assert flat.touched.sum() > 20
    assert same(flat.residual, full.residual[:, :, XZ], 1e-9)
    assert same(flat.right_side, full.right_side[:, XZ], 1e-7)
    for name in ("diagonal", "upper", "lower"):
        blocks = getattr(full, name)
        assert same(getattr(flat, name), blocks[:, XZ][:, :, XZ], 1e-11)
        assert np.abs(blocks[:, 1, XZ]).max() == np.abs(blocks[:, XZ, 1]).max() == 0.0, "planes are decoupled"
    assert same(flat.wrench, full.wrench, 1e-11)
    assert same(flat.sums, full.sums, 1e-11)
    measured = [*range(1, 10), 12, 16]
    assert model.report[measured] == pytest.approx(solid.report[measured], rel=1e-7)
    solid.s.q[5, 0] += 1e-9  # twin: a nanometre
    evaluate(solid)
    assert not same(flat.right_side, full.right_side[:, XZ], 1e-5)


def evaluate(m) -> None:
    m.evaluate(Motion(m.s.q, m.s.v, m.s.vdot, m.s.axes), Slopes(0.0, 2e3, 4e6), True)


@pytest.mark.parametrize(("integrator", "links", "steps"), [("generalized_alpha", 64, 100), ("runge_kutta", 8, 10)])
def test_a_released_chain_moves_as_cables_do(integrator, links, steps):
    changes = {"links": links, "integrator": integrator, "start": "displaced"}
    flat, solid = (hanging(element=element, **changes) for element in ("planar", "cable"))
    start, seen = solid.pins(), []
    for model in (flat, solid):
        for k in range(steps):
            model.step(k * 1e-3, 1e-3, np.zeros(0))
        seen.append(np.zeros(model.link_ports))
        model.link_outputs(seen[-1])
    assert flat.stable_step == pytest.approx(solid.stable_step, rel=1e-9)
    assert np.abs(flat.pins() - solid.pins()).max() < 1e-9
    assert np.abs(start - solid.pins()).max() > 1e-5
    assert same(seen[0][:links], seen[1][:links], 1e-8)
    assert np.array_equal(flat.counters, solid.counters)


def test_a_bump_has_the_normal_of_the_plane():
    """The normal of a bump turns by the curvature of ``surface_depth`` along t (``curvature`` in ``face.Face``)."""
    ground = bumpy_ground(0.0, 0.0, 0.2, 0.5, 0.4, 0.3)
    for x, z in ((0.1, 0.02), (0.5, 0.15)):
        _, n0, n2, bend = surface_depth(ground, x, z)
        step = 1e-7
        _, m0, m2, _ = surface_depth(ground, x - step * n2, z + step * n0)
        assert ((m0 - n0) / step, (m2 - n2) / step) == pytest.approx((-bend * n2, bend * n0), abs=1e-5)
