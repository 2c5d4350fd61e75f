"""The track of rigid links behind its ports: rest, impulses, drive, agreement of integrators, errors."""

from __future__ import annotations

import numpy as np
import pytest
from m113 import LINKS, MASS, VEHICLE, P
from named_ports import outputs, parameters
from rigid_track import hanging, inputs, rolling
from vehicle_in_process import InProcess

from fmus.interface.model import InvalidParameter, StepFailed
from fmus.physics.chain.rigid.faces import add_last_correction
from fmus.physics.chain.rigid.links import pins as evaluate_pins
from fmus.physics.chain.rigid.links import residual
from fmus.physics.chain.rigid.newton import TOLERANCE
from fmus.physics.integrate import hht
from fmus.physics.integrate.generalized_alpha import Slopes
from fmus.physics.rigid import body
from fmus.track.choices import INTEGRATORS
from orchestrator.scene.scene import load

COARSE = [("generalized_alpha", 1e-5), ("hht", 1e-5)]  # integrators with tolerances of their iteration, m


@pytest.mark.long
def test_hanging_chain_at_rest():
    model = hanging()
    model.initialise(parameters(model))
    y = outputs(model)
    w = MASS * 9.81 / P
    assert -min(y[f"joint[{i}].position.z"] for i in range(1, 66)) == pytest.approx(2.589308, abs=1e-6)
    assert abs(y["joint[1].force.x"]) / w == pytest.approx(3.298471, rel=1e-6)
    # the force at a pin carries half of the chain and the horizontal pull
    pull = np.hypot(y["joint[1].force.x"], y["joint[1].force.z"])
    assert pull == pytest.approx(np.hypot(3.298471 * w, 32 * MASS * 9.81), rel=1e-5)
    for k in range(20):
        model.step(k * 1e-3, 1e-3, np.zeros(0))
    later = outputs(model)
    assert max(abs(later[k] - y[k]) for k in y if "position" in k) < 1e-9
    assert model.counters[0] == 20
    other = hanging(span=0.8 * 1.02)
    other.initialise(parameters(other))
    assert abs(-outputs(other)["joint[33].position.z"] - 2.589308) > 1e-2


@pytest.mark.long
def test_displaced_chain_swings_and_keeps_its_energy():
    model = hanging()
    model.initialise(parameters(model, start="displaced"))
    start = outputs(model)
    assert start["joint[65].position.x"] == pytest.approx(0.8 * LINKS * P, abs=1e-12)
    moved = 0.0
    for k in range(300):
        model.step(k * 1e-3, 1e-3, np.zeros(0))
        y = outputs(model)
        moved = max(moved, abs(y["joint[33].position.z"] - start["joint[33].position.z"]))
    lost = start["energy.gravity"] - y["energy.gravity"] - y["energy.kinetic"]
    assert moved > 0.01
    assert y["energy.kinetic"] > 1.0
    assert abs(lost) < 1e-5 * y["energy.kinetic"]


@pytest.fixture(scope="module")
def track():
    model = rolling()
    model.initialise(parameters(model))
    return model, model.state.copy()


def test_closed_track_stays_at_rest(track):
    model, state = track
    model.state[:] = state
    model.counters[:] = 0
    before = outputs(model)
    assert before["tension.min"] > 5e3
    assert before["energy.kinetic"] == 0.0
    weight = LINKS * MASS * 9.81
    lifted = sum(before[f"{w['name']}.force.z"] for w in model.wheel_list)
    assert before["ground.force.z"] - lifted == pytest.approx(weight, abs=1e-4)
    for k in range(20):
        model.step(k * 1e-3, 1e-3, inputs(model, k * 1e-3, 0.0))
    after = outputs(model)
    assert after["tension.mean"] == pytest.approx(before["tension.mean"], rel=1e-6)
    assert after["energy.kinetic"] < 1e-6


def test_rigid_links_show_the_forces_that_cables_show_at_rest():
    """Rigid links at rest have the forces of cables, between seated pins too.

    There T cos^2(pi/z), 9.5 % less, passes from link to link. A rim stretches the halves of a cable, by 2 % of its
    tension on the idler.
    """
    shown = {}
    for name, settings in {"rigid": ("rigid",), "cable": ("flexible",)}.items():
        track = InProcess(load("straight", settings[0], settings[1:]))["left_track"]
        shown[name] = track.link_outputs(), track["tension.mean"], track["tension.max"]
        tension = [k for k, output in enumerate(track.links) if output.endswith("tension")]
        force = [k for k, output in enumerate(track.links) if ".force." in output]
    for which, allowed in ((tension, 0.03), (force, 5e-3)):
        one, other = (shown[name][0][which] for name in ("rigid", "cable"))
        assert abs(other).max() > 1e4
        assert abs(one - other).max() < allowed * abs(other).max()
        assert abs(1.05 * one - other).max() > allowed * abs(other).max()
    assert shown["rigid"][1:] == pytest.approx(shown["cable"][1:], rel=3e-3)


@pytest.mark.long
@pytest.mark.parametrize(("integrator", "tolerance"), [*((name, TOLERANCE) for name in INTEGRATORS), *COARSE])
def test_impulses_on_the_wheels_balance_the_momentum(track, integrator, tolerance):
    """They do at any tolerance of Newton's iteration, and in steps of very different lengths."""
    model, state = track
    model.state[:] = state
    model.integrator, method = integrator, model.method
    model.method = method._replace(tolerance=tolerance)
    if integrator == "hht":
        model.method = model.method._replace(alpha=hht.coefficients(0.8))
    model.begin_run()
    s, t = model.s, 0.0
    for h in (*(1e-3,) * 30, *(1e-5, 1e-4, 1e-3) * 4):
        before = MASS * s.v[:, :3].sum(0)
        model.step(t, h, inputs(model, t, 20.0, lateral=0.05))
        t += h
        y = outputs(model)
        gained = MASS * s.v[:, :3].sum(0) - before
        force = [y[f"ground.force.{a}"] - sum(y[f"{w['name']}.force.{a}"] for w in model.wheel_list) for a in "xyz"]
        force[2] -= LINKS * MASS * 9.81
        assert np.abs(gained - h * np.array(force)).max() < 1e-9
    model.integrator, model.method = INTEGRATORS[0], method
    model.begin_run()
    assert np.abs(gained).max() > 0.1


def test_sprocket_drives_the_chain_over_wheels_and_ground(track):
    model, state = track
    model.state[:] = state
    model.counters[:] = 0
    for k in range(400):
        model.step(k * 1e-3, 1e-3, inputs(model, k * 1e-3, 10.0))
    y = outputs(model)
    pins = 10 * 10.0 * 0.3 / (2.0 * np.pi)  # teeth passed: half of the ramp of 0.2 s, and 0.2 s
    assert y["travel"] == pytest.approx(pins * P, rel=0.01)
    assert y["speed"] == pytest.approx(10 * P * 10.0 / (2.0 * np.pi), rel=0.04)
    assert y["energy.dissipated"] > 0.0
    assert model.counters[0] == 400
    assert model.counters[3] == 0
    assert model.counters[2] < 4 * 400
    evaluate_pins(model.rigid, model.s, model.work)
    worst = np.abs(model.work.system.gap).max()
    assert worst < 1e-11


@pytest.mark.parametrize("short", [(1e-9,), (1e-5,), (1e-4,), (1e-5, 1e-8), (1e-9, 1e-7, 1e-9)])
def test_short_steps_between_long_ones_change_little(track, short):
    """A host that meets an event takes such steps.

    Without ``close_rates`` they ended with tensions of meganewtons, or failed.
    """
    model, state = track
    tensions = []
    for between in ((), short):
        model.state[:], t = state, 0.0
        model.counters[:] = 0
        model.begin_run()
        for _ in range(60):
            for h in (1e-3, *between):
                model.step(t, h, inputs(model, t, 20.0))
                t += h
        tensions.append(outputs(model)["tension.mean"])
        assert model.counters[3] == 0
        assert abs(model.s.vdot).max() < 2e3
    assert tensions[1] == pytest.approx(tensions[0], rel=0.05)


@pytest.mark.long
def test_integrators_agree():
    runs = []
    for integrator in INTEGRATORS:
        model = rolling()
        model.initialise(parameters(model, integrator=integrator, spectral_radius=0.5))
        for k in range(100):
            model.step(k * 1e-3, 1e-3, inputs(model, k * 1e-3, 10.0))
        runs.append(outputs(model))
    other = runs.pop(INTEGRATORS.index("runge_kutta"))
    for one in runs:
        assert one["speed"] == pytest.approx(other["speed"], rel=5e-3)
        assert one["travel"] == pytest.approx(other["travel"], rel=1e-2)
        assert one["tension.mean"] == pytest.approx(other["tension.mean"], rel=2e-2)
        assert one["energy.dissipated"] == pytest.approx(other["energy.dissipated"], rel=0.05)
    adams = runs[-1]
    assert adams["speed"] == pytest.approx(other["speed"], rel=1e-6)
    assert adams["energy.dissipated"] == pytest.approx(other["energy.dissipated"], rel=1e-5)


def along_the_whole_chain(q, A, axis):
    """Increments (n, 6) of all links that move the whole chain rigidly: along an axis, or (3 to 5) about one."""
    x = np.zeros((len(q), 6))
    if axis < 3:
        x[:, axis] = 1.0
        return x
    turn = np.eye(3)[axis - 3]
    x[:, :3] = np.cross(turn, q[:, :3] - q[:, :3].mean(0))
    x[:, 3:] = np.einsum("nji,j->ni", A, turn)
    return x


def moved(q, x):
    """Poses of links after increments."""
    ends = np.empty_like(q)
    for before, increment, after in zip(q, x, ends, strict=True):
        body.advance(before, increment, after)
    return ends


@pytest.mark.long
def test_wheels_links_and_pins_get_the_change_of_the_forces(track):
    """Newton's last correction adds the derivative of the values of an evaluation, if no pin opens.

    As in the matrix, the rates outweigh the positions.
    """
    model, start = track
    model.state[:] = start
    for k in range(60):
        model.step(1e-3 * k, 1e-3, inputs(model, 1e-3 * k, 20.0, 0.1, 0.1))
    s, w, by, eps = model.s, model.work, Slopes(0.0, 1e5, 0.0), 1e-10
    q, v = s.q.copy(), s.v.copy()
    shown = w.wrench[:, :3], w.wrench[:, 3:], w.on_links, s.load, w.along

    def forces_at(q, v, tangent=False):
        s.q[:], s.v[:] = q, v
        w.increment[:] = 0.0
        residual(*model.system()[:2], model.environment, s, w, by, tangent)
        return [part.copy() for part in shown]

    for axis in range(6):
        before = forces_at(q, v, tangent=True)
        x = along_the_whole_chain(q, w.system.rotation, axis)
        w.points.q[:] = q
        w.system.correction[:] = x
        add_last_correction(model.rigid, s, w)
        given = [now - then for now, then in zip(shown, before, strict=True)]
        ends = [forces_at(moved(q, d * x), v + by.v * d * x) for d in (eps, -eps)]
        for part, after, earlier in zip(given, *ends, strict=True):
            change = (after - earlier) / (2.0 * eps)
            assert abs(part - change).max() < 1e-3 * abs(change).max(), axis
            assert abs(1.03 * part - change).max() > 1e-2 * abs(change).max()


@pytest.mark.long
def test_matrix_of_the_links_is_the_derivative_of_their_residual(track):
    """Newton's matrix times a motion that opens no pin equals the change of the residual, contacts included.

    The derivative by rates outweighs that by positions, in which the matrix leaves out how contacts grow.
    """
    model, start = track
    model.state[:] = start
    for k in range(60):
        model.step(1e-3 * k, 1e-3, inputs(model, 1e-3 * k, 20.0, 0.1, 0.1))
    s, w, by, eps = model.s, model.work, Slopes(0.0, 1e5, 0.0), 1e-10
    w.increment[:] = 0.0

    def residual_at(q, v, tangent=False):
        s.q[:], s.v[:] = q, v
        residual(*model.system()[:2], model.environment, s, w, by, tangent)
        return w.system.residual.copy()

    q, v = s.q.copy(), s.v.copy()
    residual_at(q, v, tangent=True)
    K, A = w.system.iteration_matrix.copy(), w.system.rotation.copy()
    for axis in range(6):
        x = along_the_whole_chain(q, A, axis)
        after, before = (residual_at(moved(q, d * x), v + by.v * d * x) for d in (eps, -eps))
        predicted, change = np.einsum("nij,nj->ni", K, x), (after - before) / (2.0 * eps)
        error = abs(predicted - change).max() / abs(change).max()
        assert error < 3e-5, axis
        assert abs(1.03 * predicted - change).max() / abs(change).max() > 1e-2


def test_guides_take_the_chain_along_sideways(track):
    model, state = track
    model.state[:] = state
    for k in range(600):
        model.step(k * 1e-3, 1e-3, inputs(model, k * 1e-3, 0.0, lateral=0.05))
    off = model.pins()[:, 1] - 0.05 * 0.6
    play = VEHICLE["guide"]["clearance"]
    assert np.abs(off).max() < play + 2e-3
    free = rolling(guide={"clearance": 1.0}, contact={k: v | {"friction": 0.0} for k, v in VEHICLE["contact"].items()})
    free.initialise(parameters(free))
    for k in range(600):
        free.step(k * 1e-3, 1e-3, inputs(free, k * 1e-3, 0.0, lateral=0.05))
    assert np.abs(free.pins()[:, 1]).max() < 1e-3  # nothing moves it sideways


def test_turned_vehicle_runs_alike(track):
    model, state = track
    model.state[:] = state
    for k in range(100):
        model.step(k * 1e-3, 1e-3, inputs(model, k * 1e-3, 10.0))
    straight = outputs(model)
    heading = np.radians(37.0)
    model.initialise(parameters(model, **{"start.heading": heading}))
    for k in range(100):
        model.step(k * 1e-3, 1e-3, inputs(model, k * 1e-3, 10.0, heading=heading))
    turned = outputs(model)
    for name in ("speed", "tension.mean", "travel", "road_wheel[2].force.z"):
        assert turned[name] == pytest.approx(straight[name], rel=1e-7, abs=1e-7)
    c, s = np.cos(heading), np.sin(heading)
    x, y = straight["sprocket.force.x"], straight["sprocket.force.y"]
    assert turned["sprocket.force.x"] == pytest.approx(c * x - s * y, rel=1e-6)
    assert turned["sprocket.force.y"] == pytest.approx(s * x + c * y, rel=1e-6)


def test_state_is_everything(track):
    model, state = track
    model.state[:] = state
    u = inputs(model, 0.3, 10.0)
    model.step(0.0, 1e-3, u)
    saved, counters = model.state.copy(), model.counters.copy()
    model.step(1e-3, 1e-3, u)
    first, first_counters = outputs(model), model.counters.copy()
    for _ in range(3):
        model.step(2e-3, 1e-3, inputs(model, 0.1, 3.0))
    model.state[:], model.counters[:] = saved, counters
    model.step(1e-3, 1e-3, u)
    assert outputs(model) == first
    assert np.array_equal(model.counters, first_counters)


@pytest.mark.parametrize(("share", "refused"), [(1.02, True), (0.98, False), (1e12, True)])
def test_wheels_that_come_apart_are_not_connected(track, share, refused):
    """A wheel must not be more than five pitches farther from the sprocket than at the start, at any time."""
    model, state = track
    model.state[:] = state
    model.step(0.0, 1e-3, inputs(model, 0.0, 0.0))
    u = inputs(model, 0.0, 0.0)
    u[-13] -= share * 5.0 * VEHICLE["track"]["pitch"]
    said = ""
    try:
        model.step(1e-3, 1e-3, u)
    except StepFailed as failure:  # a chain that is pulled so far fails as well
        said = str(failure)
    name = model.wheel_list[-1]["name"]
    assert (f"the {name} is " in said and "the motion of each wheel must be connected" in said) == refused
    model.begin_run()


def test_bad_parameters_and_hopeless_steps(track):
    model = hanging()
    with pytest.raises(InvalidParameter, match=r"spectral_radius = 1\.5: must be between 0 and 1"):
        model.initialise(parameters(model, spectral_radius=1.5))
    with pytest.raises(InvalidParameter, match=r"spectral_radius = 0\.4: integrator = 'hht' has 0\.5 to 1"):
        model.initialise(parameters(model, integrator="hht"))
    with pytest.raises(InvalidParameter, match=r"adams\.rtol = 1: must be between 1e-13 and 0\.1"):
        model.initialise(parameters(model, **{"adams.rtol": 1.0}))
    rolled, state = track
    rolled.state[:] = state
    u = inputs(rolled, 0.0, 0.0)
    u[5] = np.nan
    with pytest.raises(StepFailed, match=r"at t = 0 s the input sprocket.orientation.y is not finite"):
        rolled.step(0.0, 1e-3, u)
    rolled.step(0.0, 1e-3, inputs(rolled, 0.0, 0.0))  # zeros before the first step are no motion yet
    u = inputs(rolled, 0.0, 0.0)
    u[3:7] = 0.0
    with pytest.raises(StepFailed, match=r"t = 2 s the input sprocket.orientation is no rotation: its length is 0"):
        rolled.step(2.0, 1e-3, u)
    u = inputs(rolled, 0.0, 0.0)
    with pytest.raises(StepFailed, match=r"a communication step of 1e\+06 s takes 1e\+09 internal steps of 0.001 s"):
        rolled.step(0.0, 1e6, u)
    rolled.state[:] = state
    rolled.step(0.0, 1e-13, u)
    assert np.isfinite(rolled.state).all()
    kept, u = rolled.contacts, inputs(rolled, 0.0, 0.0)
    rolled.contacts = kept._replace(wheel=kept.wheel._replace(k=1e40))
    rolled.begin_run()
    with pytest.raises(StepFailed, match=r"did not converge at t = 1 s, link \d+: residual"):
        rolled.step(1.0, 1e-3, u)
    rolled.contacts = kept
    rolled.begin_run()


def test_contact_points_beyond_their_arrays_are_refused(track):
    """The room is what fits side by side; a chain that needs more is told with its number of points."""
    rolled, state = track
    rolled.state[:], kept = state, rolled.work
    u = inputs(rolled, 0.0, 0.0)
    rolled.step(0.0, 1e-3, u)
    used, room = int(kept.points.number[0]), len(kept.points.which)
    assert 0 < used < room == rolled.most_points < 8 * LINKS * (len(rolled.wheel_list) + 1)
    rolled.state[:] = state
    rolled.work = kept._replace(points=kept.points._replace(which=kept.points.which[: used // 2]))
    rolled.begin_run()
    with pytest.raises(StepFailed, match=r"at \d+ points at t = 0 s, link \d+: .* these lie in a heap"):
        rolled.step(0.0, 1e-3, u)
    assert np.array_equal(rolled.state, state)
    rolled.work = kept
    rolled.begin_run()
