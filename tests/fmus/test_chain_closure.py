"""Loops of flexible links: closed by a stiff spring at a cut (paper 8.1), or with constrained pins.

References are exact solutions, conserved quantities, and the same loop with eliminated pins.
"""

import numpy as np
import pytest
from chain_loops import CLOSURES, SPIN, N, loop, on_wheels, run
from free_chains import TABLE, P, per_link

from fmus.physics.chain.flexible.link_layout import coordinate_indices
from fmus.physics.chain.report import DISSIPATED, KINETIC, STRAIN

LINKS = 64
INTEGRATORS = pytest.mark.parametrize("integrator", ["generalized_alpha", "runge_kutta"])
SHARED = [0, 1, 2, 4]  # coordinates that two links share at a pin: position, and slope along the joint axis


def gap(model):
    return np.linalg.norm(model.s.q[-1, :3] - model.s.q[0, :3])


# --- closed by a spring ------------------------------------------------------------------------------------


@pytest.mark.study
@pytest.mark.parametrize("links", [16, 64])
def test_a_slow_loop_that_a_spring_closes_has_its_equilibrium(links):
    """At 5 rad/s rounding hides the stiffness of the rotation, spin^2 m, unless the tangent is taken with care."""
    spin, angle = 5.0, np.pi / links
    rigid = TABLE["track"]["mass"] * spin**2 * P / (2.0 * np.tan(angle)) / (2.0 * np.sin(angle))
    model = loop(links, start_of_spin=spin, closure="spring")
    assert gap(model) * 1e9 == pytest.approx(rigid, rel=1e-3)
    assert gap(model) * 1.03e9 != pytest.approx(rigid, rel=1e-2)


@pytest.mark.study
def test_a_spinning_loop_opens_by_its_joint_force_over_the_stiffness():
    """The gap of a spinning loop equals its joint force over the spring's stiffness.

    Relative equilibrium of rigid links: force m w^2 Rc / (2 sin(pi/N)); steel links carry 3e-6 more.
    """
    rigid = TABLE["track"]["mass"] * SPIN**2 * P / (2.0 * np.tan(np.pi / N)) / (2.0 * np.sin(np.pi / N))
    closed = np.linalg.norm(per_link(loop(start_of_spin=SPIN))[1], axis=1)
    assert closed == pytest.approx(np.full(N, rigid), rel=1e-5)
    off = []
    for k in (1e8, 1e9, 1e10):
        model = loop(start_of_spin=SPIN, closure="spring", closure_of_stiffness=k, closure_of_damping=0.0)
        force = np.linalg.norm(per_link(model)[1], axis=1)
        # the force of the first pin is the force of the spring
        assert gap(model) * k == pytest.approx(force[0], rel=1e-9)
        assert gap(model) * 1.03 * k != pytest.approx(force[0], rel=1e-2)
        off.append(np.abs(force - closed).max())
    assert off[0] < 2e-4 * rigid
    assert np.log10(np.divide(off[:-1], off[1:])) == pytest.approx([1.0, 1.0], abs=0.02)


@pytest.mark.study
@INTEGRATORS
def test_a_loop_that_a_spring_closes_moves_like_a_closed_one_as_the_spring_stiffens(integrator):
    """The motion of a loop closed by a spring approaches that of the closed loop as 1 / k."""
    start = {"start_of_spin": 5.0, "start_of_ovalling": 4.0, "start": "polygon", "integrator": integrator}
    closed = run(loop(**start), 0.02).pins()
    off = []
    for k in (1e7, 1e8, 1e9):  # at 1e10, half of a link's own stiffness, the ringing of the steel shows: 1e-8 m
        there = run(loop(**start, closure="spring", closure_of_stiffness=k), 0.02).pins()
        off.append(np.abs(there - closed).max())
    assert 1e-7 < off[0] < 1e-4
    assert np.log10(np.divide(off[:-1], off[1:])) == pytest.approx([1.0, 1.0], abs=0.1)


def momentum(model):
    """Linear momentum (x, z) and angular momentum about y of the mesh, summed link by link."""
    at = coordinate_indices(model.kit, model.s.q, 4, model.links_count)
    e, v, M = model.s.q.reshape(-1)[at], model.s.v.reshape(-1)[at], model.work.mass
    p = np.einsum("ab,ibk->iak", M, v)
    turned = e[..., 2] * p[..., 0] - e[..., 0] * p[..., 2]
    return np.array([p[:, [0, 2], 0].sum(), p[:, [0, 2], 2].sum(), turned.sum()])


@pytest.mark.study
@pytest.mark.parametrize("damping", [0.0, 1e4])
def test_energy_and_momentum_of_a_loop_that_a_spring_closes(damping):
    """The energy balance of a loop closed by a spring holds, and the momenta stay constant.

    The spring's energy counts as strain, the loss of its damper as dissipated; the two forces are equal and opposite.
    """
    k = 1e8
    model = loop(
        start_of_spin=SPIN, start_of_ovalling=10.0, closure="spring", closure_of_stiffness=k,
        closure_of_damping=damping, material_of_relaxation_time=0.0, integrator="runge_kutta",
    )  # fmt: skip
    before, moving = model.report.copy(), momentum(model)
    stored = [0.5 * k * gap(model) ** 2]
    run(model, 0.02)
    stored.append(0.5 * k * gap(model) ** 2)
    balance = [r[KINETIC] + r[STRAIN] + r[DISSIPATED] for r in (before, model.report)]
    exchanged = np.abs(np.diff(stored))[0]
    assert np.ptp(balance) < 1e-4 * exchanged  # an error of 5 % in the spring would be seen
    assert (model.report[DISSIPATED] > 1e-4 * exchanged) == (damping > 0.0)
    now = momentum(model)
    assert now[:2] == pytest.approx(moving[:2], abs=1e-9 * moving[2])
    assert now[2] == pytest.approx(moving[2], rel=1e-6 if damping else 1e-11)  # the damper resists rotation of the gap


# --- pins as equations -------------------------------------------------------------------------------------


def both(**changes):
    """Return loops with eliminated and with constrained pins, and the places of their coordinates."""
    models = [loop(joints=joints, **changes) for joints in ("eliminated", "constrained")]
    return models, [coordinate_indices(model.kit, model.s.q, 4, model.links_count) for model in models]


def opened(vectors, closure):
    """Largest residual of the pins' constraints (2), without that of the spring."""
    first = 1 if closure == "spring" else 0
    return np.abs(vectors[::2, SHARED] - np.roll(vectors[1::2, SHARED], 1, axis=0))[first:].max()


@pytest.mark.study
@CLOSURES
def test_accelerations_with_equations_are_those_without(closure):
    """Constrained and eliminated pins give the same accelerations in a random state."""
    (whole, own), (at, mine) = both(closure=closure, start="polygon")
    random = np.random.default_rng(15)
    used = np.unique(at)
    for array, size in ((whole.s.q, 1e-4), (whole.s.v, 1.0)):
        array.reshape(-1)[used] += size * random.standard_normal(used.size)
    own.s.q.reshape(-1)[mine], own.s.v.reshape(-1)[mine] = whole.s.q.reshape(-1)[at], whole.s.v.reshape(-1)[at]
    for model in (whole, own):
        model.evaluate_start()
    there, here = whole.s.vdot.reshape(-1)[at], own.s.vdot.reshape(-1)[mine]
    largest = np.abs(there).max()
    assert largest > 1e4
    assert np.abs(here - there).max() < 1e-11 * largest
    assert opened(own.s.vdot, closure) < 1e-11 * largest
    assert np.abs(own.work.residual - whole.work.residual).max() < 1e-11 * np.abs(whole.work.residual).max()
    own.s.q.reshape(-1)[mine[3, 0, 0]] += 1e-6  # a pin that is open by a micrometre gives other accelerations
    own.evaluate_start()
    assert np.abs(own.s.vdot.reshape(-1)[mine] - there).max() > 1e-6 * largest


@pytest.mark.study
@INTEGRATORS
@CLOSURES
def test_a_chain_with_equations_moves_like_one_without(closure, integrator):
    models, where = both(closure=closure, integrator=integrator, start_of_spin=SPIN, start_of_ovalling=2.0)
    for model in models:
        run(model, 0.02)
    for name, tolerance in (("q", 1e-12), ("v", 1e-8)):
        there, here = (getattr(m.s, name).reshape(-1)[at] for m, at in zip(models, where, strict=True))
        assert np.abs(here - there).max() < tolerance * np.abs(there).max()
    there, here = (np.concatenate([each.ravel() for each in per_link(model)]) for model in models)
    assert np.abs(here - there).max() < 1e-7 * np.abs(there).max()
    assert models[0].counters.tolist() == models[1].counters.tolist()
    own = models[1].s
    assert opened(own.q, closure) < 1e-15
    assert opened(own.v, closure) < 1e-12 * SPIN
    assert (opened(own.q, "pin") > 1e-7) == (closure == "spring")  # the spring opens


@pytest.mark.study
def test_what_is_taken_off_the_equations_is_put_back_after_an_explicit_step():
    """Projection after an explicit step closes positions and velocities and keeps linear momentum."""
    model = loop(joints="constrained", integrator="runge_kutta", start="polygon")
    model.s.q[5, 0] += 1e-9
    model.s.v[5, 0] += 1e-6
    before = momentum(model)
    model.advance(0.0, 1e-5)
    assert opened(model.s.q, "pin") < 1e-15
    assert opened(model.s.v, "pin") < 1e-14
    assert momentum(model)[:2] == pytest.approx(before[:2], abs=1e-13)


# --- how many, and on wheels -------------------------------------------------------------------------------


def shown(model):
    """Tensions of the links (LINKS,) and forces of the pins (LINKS, 3), N."""
    y = np.zeros(model.link_ports)
    model.link_outputs(y)
    return y[:LINKS], y[5 * LINKS : 8 * LINKS].reshape(-1, 3)


@pytest.mark.study
def test_a_track_on_wheels_that_a_spring_closes():
    """A track closed by a spring opens by tension over stiffness; its tensions converge as 1 / k."""
    closed = on_wheels()
    tension, joints = shown(closed)[0], closed.pins()
    off = []
    for k in (1e8, 1e9, 1e10):
        model = on_wheels("track.closure=spring", f"track.closure_stiffness={k}")
        near, force = shown(model)
        assert gap(model) * k == pytest.approx(near[-1], rel=0.02)
        assert np.linalg.norm(force[0]) == pytest.approx(near[0], rel=0.02)
        off.append(np.abs(near - tension).max())
        assert model.pins().shape == joints.shape
    assert np.log10(np.divide(off[:-1], off[1:])) == pytest.approx([1.0, 1.0], abs=0.05)
    assert off[1] < 20.0  # N, of 15 kN
