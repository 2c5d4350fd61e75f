"""Chains of flexible links in Cholesky coordinates against the same chains in nodal coordinates."""

import numpy as np
import pytest
from chain_loops import CLOSURES, loop, on_wheels, run
from free_chains import Beams, PlanarCables, made, per_link

from fmus.physics.chain.flexible import cholesky
from fmus.physics.chain.flexible.link_layout import coordinate_indices
from fmus.physics.chain.interface import derivative, stage_joints
from fmus.physics.chain.report import DISSIPATED, GRAVITY, KINETIC, STRAIN, WORK
from fmus.track_flexible.model import Model as Flexible

N = 16
SPAN = {"kind": "pinned", "first": [0.0, 0.0], "last": [0.8 * 8 * 0.1524, 0.0]}  # starts displaced from a span of 0.7
OVAL = {"start_of_spin": 20.0, "start_of_ovalling": 2.0}
EXPLICIT = {"integrator": "runge_kutta", "coordinates": "cholesky"}


def pair(build):
    """Return the same chain in nodal and in Cholesky coordinates."""
    return [build(coordinates=coordinates) for coordinates in ("nodal", "cholesky")]


def used(model):
    """Indices of the flat nodal coordinates that belong to a link."""
    return np.unique(coordinate_indices(model.kit, model.s.q, len(model.work.mass), model.links_count))


def matrix(model):
    """B^T as a dense matrix on the used coordinates, from ``to_cholesky`` applied to each unit vector."""
    s, at = model.s, used(model)
    before = s.flat.copy()
    columns = []
    for place in at:
        s.q[:] = s.v[:] = 0.0
        s.q.reshape(-1)[place] = 1.0
        cholesky.to_cholesky(model.link, s, model.work)
        columns.append(s.p[0].reshape(-1)[at].copy())
    s.flat[:] = before
    return np.array(columns).T


def mass(model):
    """Mass matrix of the mesh on the used coordinates, assembled link by link."""
    at, M = coordinate_indices(model.kit, model.s.q, len(model.work.mass), model.links_count), model.work.mass
    whole = np.zeros((model.s.q.size, model.s.q.size))
    for link in at:
        for k in range(link.shape[1]):
            whole[np.ix_(link[:, k], link[:, k])] += M
    return whole[np.ix_(used(model), used(model))]


CHAINS = pytest.mark.parametrize(
    ("kind", "given"),
    [(Flexible, {}), (Flexible, {"closure": "spring"}), (PlanarCables, {}), (Beams, {})],
    ids=["cable", "spring", "planar", "beam"],
)


@pytest.mark.study
@CHAINS
def test_the_mass_in_cholesky_coordinates_is_the_identity(kind, given):
    """B B^T = M, and B is triangular in some order of the coordinates.

    The rates carry the kinetic energy of the report.
    """
    model = made(kind, 5, gravity=0.0, start="polygon", **given, **EXPLICIT, **{"start.spin": 3.0})
    B, M = matrix(model).T, mass(model)
    assert np.abs(B @ B.T - M).max() < 1e-13 * np.abs(M).max()
    assert np.abs(1.03 * B @ B.T - M).max() > 1e-2 * np.abs(M).max()
    assert 0.5 * np.sum(model.s.p[1] ** 2) == pytest.approx(model.report[KINETIC], rel=1e-13)
    left = np.ones(len(B), dtype=bool)
    for _ in range(len(B)):  # eliminate each row that has a single entry among the remaining columns
        rows = [r for r in range(len(B)) if np.count_nonzero(np.abs(B[r, left]) > 1e-12) == 1]
        done = [c for r in rows for c in np.flatnonzero(left & (np.abs(B[r]) > 1e-12))]
        left[done] = False
    assert not left.any()


@pytest.mark.study
@CHAINS
def test_accelerations_and_forces_are_those_of_nodal_coordinates(kind, given):
    """Accelerations and link forces in a random state are those of nodal coordinates."""
    models = pair(
        lambda **c: made(kind, N, gravity=9.81, start="polygon", integrator="runge_kutta", **given, **c)
    )  # fmt: skip
    random = np.random.default_rng(15)
    at = used(models[0])
    noise = random.standard_normal((2, at.size))
    for model in models:
        for array, size, shift in ((model.s.q, 1e-4, noise[0]), (model.s.v, 1.0, noise[1])):
            array.reshape(-1)[at] += size * shift
    whole, own = models
    state = own.state.copy()
    assert own.copy_state(state[own.s.p.size :]), "a nodal model accepted a state of Cholesky coordinates"
    q, v = own.s.q.copy(), own.s.v.copy()
    k = [np.zeros(2 * whole.s.q.size) for _ in models]
    for model, rates in zip(models, k, strict=True):
        model.work.wheels[:] = model.start_rows
        derivative(*model.system(), model.s, model.work, rates)
        stage_joints(model.link, model.environment, model.s, model.work)
    assert np.abs(own.s.q - q).max() < 1e-14 * np.abs(q).max()
    assert np.abs(own.s.v - v).max() < 1e-13 * np.abs(v).max()
    there, here = (model.s.vdot.reshape(-1)[at] for model in models)
    assert np.abs(there).max() > 1e4
    assert np.abs(here - there).max() < 1e-11 * np.abs(there).max()
    expected = matrix(own) @ there
    assert np.abs(k[1][own.s.q.size :][at] - expected).max() < 1e-11 * np.abs(expected).max()
    here, there = (model.work.on_links for model in (own, whole))
    assert np.abs(here - there).max() < 1e-11 * np.abs(there).max()


@pytest.mark.study
@CLOSURES
def test_runge_kutta_takes_the_same_steps_to_rounding(closure):
    """Runge-Kutta steps agree to rounding: the two coordinates are linear functions of each other."""
    whole, own = pair(lambda **c: loop(closure=closure, integrator="runge_kutta", **OVAL, **c))
    for model in (whole, own):
        run(model, 0.01)
    assert np.abs(own.s.q - whole.s.q).max() < 1e-12 * np.abs(whole.s.q).max()
    assert np.abs(own.s.v - whole.s.v).max() < 1e-8 * np.abs(whole.s.v).max()
    there, here = (np.concatenate([each.ravel() for each in per_link(model)]) for model in (whole, own))
    assert np.abs(here - there).max() < 1e-7 * np.abs(there).max()
    assert own.counters.tolist() == whole.counters.tolist()
    assert own.report == pytest.approx(whole.report, rel=1e-7, abs=1e-6)
    off = run(loop(closure=closure, material_of_youngs_modulus=2.06e11, **EXPLICIT, **OVAL), 0.01)
    assert np.abs(off.s.v - whole.s.v).max() > 1e-6 * np.abs(whole.s.v).max()


@pytest.mark.long
@pytest.mark.parametrize("ends", [SPAN, {"kind": "held", "first": [1.0, 2.0]}], ids=["pinned", "held"])
def test_ends_that_are_held_stay(ends):
    """A fixed coordinate stays and acts on no other."""
    start = "displaced" if ends is SPAN else "straight"
    whole, own = pair(lambda **c: made(Flexible, 8, ends, start=start, integrator="runge_kutta", **c))
    first = own.s.q[0, :3].copy()
    before = own.report.copy()
    for model in (whole, own):
        run(model, 0.02)
    assert np.abs(own.s.q - whole.s.q).max() < 1e-11 * np.abs(whole.s.q).max()
    assert np.abs(own.s.v).max() > 0.1
    assert np.abs(own.s.q[0, :3] - first).max() < 1e-15
    balance = [r[KINETIC] + r[STRAIN] + r[GRAVITY] + r[DISSIPATED] - r[WORK] for r in (before, own.report)]
    assert np.ptp(balance) < 1e-3 * own.report[KINETIC]


@pytest.mark.study
def test_a_track_on_wheels():
    """Contacts, pin forces and wrenches of the vehicle's track agree while its wheels move away."""
    settings = "track.integrator=runge_kutta", "track.joints=eliminated"
    whole, own = (on_wheels(*settings, f"track.coordinates={c}") for c in ("nodal", "cholesky"))
    for model in (whole, own):
        model.rows[:, 3] += 0.5
        model.advance(0.0, 2e-3)
    assert np.abs(own.s.q - whole.s.q).max() < 1e-12
    assert np.abs(own.s.mean - whole.s.mean).max() < 1e-7 * np.abs(whole.s.mean).max()
    assert np.abs(whole.s.mean).max() > 1e3
