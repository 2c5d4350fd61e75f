"""The planar chain equals the chain of cables without its zeros: element, contacts, whole scenes."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.interface.model import InvalidParameter
from fmus.physics.ancf import cable, element
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.interface import observe
from fmus.physics.contact.ground import bumpy_ground, surface_depth
from fmus.physics.integrate.generalized_alpha import Slopes
from tests.fmus.test_track_flexible import PITCH, at_rest, carrier, hanging, make

pytestmark = pytest.mark.long  # kernels of their own

XZ = [0, 2]
LIFT = np.array([0, 2, 3, 4, 5, 6])  # places of a planar pin's six coordinates among the cable's eight
RANDOM = np.random.default_rng(7)


def same(a, b, of: float = 1e-12) -> bool:
    return bool(np.abs(np.asarray(a) - np.asarray(b)).max() <= of * np.abs(b).max())


def link(bending: float = 1.0) -> cable.Cable:
    return cable.Cable(PITCH, 118.0, 3e9, 4e5 * bending, 3e3, 0.4)


def bent() -> tuple[np.ndarray, np.ndarray]:
    """Coordinates and rates (4, 3) of a bent and stretched link in its plane."""
    e, v = np.zeros((4, 3)), np.zeros((4, 3))
    e[:, XZ] = np.array([[0.0, 0.0], [0.9, 0.5], [0.8 * PITCH, 0.6 * PITCH], [0.7, 0.7]])
    e[:, XZ] += 1e-3 * RANDOM.standard_normal((4, 2))
    v[:, XZ] = RANDOM.standard_normal((4, 2))
    return e, v


def forces(c: cable.Cable, e: np.ndarray, v: np.ndarray) -> tuple:
    """Force, matrix, power, energy and end moments of the cable and of the planar cable."""
    results = []
    for axes in ([0, 1, 2], XZ):
        n, one = len(axes), c._replace(axes=tuple(axes))
        p, u, Q, K = e[:, axes].copy(), v[:, axes].copy(), np.zeros((4, n)), np.zeros((4 * n, 4 * n))
        cable.tangent(one, p, u, 2e3, K)
        results.append((Q, K, element.force(one, p, u, Q), cable.energy(one, p), cable.end_moments(one, p)))
    return tuple(results)


def test_the_element_is_the_cable_in_its_plane():
    e, v = bent()
    in_plane = (3 * np.arange(4)[:, None] + np.array(XZ)).ravel()
    (Q, K, *rest), (q, k, *flat) = forces(link(), e, v)
    assert same(q, Q[:, XZ])
    assert same(k, K[np.ix_(in_plane, in_plane)])
    for a, b in zip(flat, rest, strict=True):
        assert same(a, b)
    stiffer = forces(link(1.03), e, v)[1]
    assert not same(stiffer[0], q, 1e-8)
    assert not same(stiffer[1], k, 1e-8)


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


def test_coordinates_and_time():
    """A track has 64 x 8 less 64 x 2 coordinates, and a released chain moves as cables do."""
    assert carrier(element="planar").s.q.size == 384
    flat, solid = (hanging(start="displaced", element=element) for element in ("planar", "cable"))
    assert np.abs(flat.pins() - solid.pins()).max() < 1e-10
    seen = []
    for model in (flat, solid):
        for k in range(100):
            model.step(k * 1e-3, 1e-3, np.zeros(0))
        links = np.zeros(model.link_ports)
        model.link_outputs(links)
        seen.append(links)
    assert np.abs(flat.pins() - solid.pins()).max() < 1e-9
    assert np.abs(flat.pins() - solid.pins()[::-1]).max() > 1e-2
    assert same(seen[0][:64], seen[1][:64], 1e-8)
    assert np.array_equal(flat.counters, solid.counters)


@pytest.mark.parametrize("start", ["rest", "polygon"])
def test_ends_that_are_pulled_work_alike(start):
    """Pulled ends do the same work, as on the bench: sprocket, constant pulls, transverse damping."""
    ends = {"kind": "pulled", "first": [-15e3, 0.0], "last": [-14e3, 0.0]}
    wheel = {"name": "sprocket", "kind": "teeth", "position": [0.0, 0.0]}
    track = {"links": 24, "closed": False, "wheels": [wheel], "gravity": 0.0, "ends": ends, "transverse_damping": 300.0}
    flat, solid = (make(track, element=element, start=start) for element in ("planar", "cable"))
    u = at_rest(flat)
    u[11] = 0.9
    for model in (flat, solid):
        for k in range(50):
            turned = u.copy()
            turned[[3, 5]] = np.cos(0.45e-3 * k), np.sin(0.45e-3 * k)
            model.step(k * 1e-3, 1e-3, turned)
    assert abs(solid.report[11]) > 1.0
    assert same(flat.report, solid.report, 1e-9)
    assert np.abs(flat.pins() - solid.pins()).max() < 1e-10


def test_the_same_explicitly():
    explicit = {"links": 8, "integrator": "runge_kutta", "start": "displaced"}
    flat, solid = (hanging(element=element, **explicit) for element in ("planar", "cable"))
    for model in (flat, solid):
        for k in range(10):
            model.step(k * 1e-3, 1e-3, np.zeros(0))
    assert flat.stable_step == pytest.approx(solid.stable_step, rel=1e-9)
    assert np.abs(flat.pins() - solid.pins()).max() < 1e-10


def test_only_small_deformations_are_planar():
    with pytest.raises(InvalidParameter, match="elasticity = 'general' needs element = 'cable'"):
        hanging(element="planar", elasticity="general")


def test_a_bump_has_the_normal_of_the_plane():
    """The normal of a bump turns by the curvature of ``surface_depth`` along t (``curvature`` in ``face.Face``)."""
    ground = bumpy_ground(0.0, 0.0, 0.2, 0.5, 0.4, 0.3)
    for x, z in ((0.1, 0.02), (0.5, 0.15)):
        _, n0, n2, bend = surface_depth(ground, x, z)
        step = 1e-7
        _, m0, m2, _ = surface_depth(ground, x - step * n2, z + step * n0)
        assert ((m0 - n0) / step, (m2 - n2) / step) == pytest.approx((-bend * n2, bend * n0), abs=1e-5)
