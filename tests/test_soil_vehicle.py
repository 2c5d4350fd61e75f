"""A vehicle on dry sand: equilibrium in its rut, resistance, second pass, saved states, convergence with the step."""

from __future__ import annotations

import numpy as np
import pytest
from vehicle_in_process import InProcess

from fmus.physics.chain.report import LOST
from fmus.physics.chain.sums import GROUND_DAMPING, LOSSES
from fmus.physics.contact.soil import pressure
from fmus.physics.contact.soil.memory import DEEPEST, FIRST, INSIDE, MADE, PRESSURE, SHEAR, TILE, TILES
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results import turning
from orchestrator.results.convergence_index import convergence_index
from orchestrator.results.difference import differences
from orchestrator.results.run_data import RunData, Window
from orchestrator.scene.scene import load

pytestmark = pytest.mark.long
COMPACTED = LOST + GROUND_DAMPING - LOSSES
THERE_AND_BACK = "drive.speed_points=[[0.2, 0], [1.5, 6], [3.5, 6], [4.8, -6], [8, -6]]"
SAND = 'ground.soil={name="dry_sand", k0=0, Au=5.03e8}'


@pytest.fixture(scope="module")
def ride():
    """Half a vehicle that stands, drives ahead and comes back: compaction over the way, and sinkage, at each 0.1 s."""
    vehicle = InProcess(load("straight", "rigid", ["symmetric=true", SAND, THERE_AND_BACK]))
    track = vehicle["left_track"].model
    start, rows, saved = track.s.soil.copy(), [], None
    for k in range(75):
        vehicle.run(0.1)
        pressed = track.s.soil[track.s.soil[:, PRESSURE] > 0.0]
        place = vehicle["chassis"]["chassis.position.x"]
        rows.append([vehicle.t, place, track.report[COMPACTED], pressed[:, DEEPEST].max()])
        if k == 45:
            saved = {name: member.model.state.copy() for name, member in vehicle.members.items()}, vehicle.steps
    return vehicle, start, np.array(rows), saved


def resistance(rows, first, last):
    """Compaction over the way, N, from time ``first`` to ``last``, s."""
    part = rows[(rows[:, 0] > first - 1e-9) & (rows[:, 0] < last + 1e-9)]
    return (part[-1, 2] - part[0, 2]) / abs(part[-1, 1] - part[0, 1])


def test_it_stands_in_its_own_rut(ride):
    """Half of the weight on the mean sinkage of 54 mm; 66 mm if all links bore alike, 206 mm on a link a wheel."""
    vehicle, start, rows, _ = ride
    inside = start[start[:, INSIDE] > 0.0]
    assert 0.04 < inside[:, DEEPEST].mean() < 0.0662
    assert inside[:, DEEPEST].max() < 0.206
    assert not inside[:, SHEAR : SHEAR + 3].any()
    soil = vehicle["left_track"].model.contacts.soil
    assert 0.25 * soil.length * soil.width * inside[:, PRESSURE].sum() == pytest.approx(77948.2, rel=1e-3)
    still = rows[0]
    assert abs(still[1] - -2.006) < 1e-4
    assert still[2] < 5.0


@pytest.mark.parametrize("links", ["rigid", "flexible"])
def test_it_stands_in_soil_that_gives_way_by_a_third_of_a_metre(links):
    """Links of each kind carry the load for which the equilibrium was found; the hull is 23 mm over the ground."""
    vehicle = InProcess(load("soft_ground", links, ['ground.soil={name="snow", kphi=4e5}']))
    track = vehicle["left_track"].model
    assert track.s.soil[:, DEEPEST].max() == pytest.approx(0.325, abs=5e-3)
    vehicle.run(0.02)
    assert vehicle["left_track"]["ground.force.z"] == pytest.approx(77948.2, rel=1e-3)


def test_it_is_held_back_by_compaction(ride):
    """Between the bracket of terrain theory, 0.92 kN and 10.08 kN a track; of a rut as deep as the links."""
    vehicle, _, rows, _ = ride
    ahead = resistance(rows, 2.4, 3.4)
    assert 922.0 < ahead < 10079.0
    soil = vehicle["left_track"].model.contacts.soil
    depth = rows[(rows[:, 0] > 2.4) & (rows[:, 0] < 3.4), 3].max()
    assert 0.85 < ahead / (soil.width * pressure.compaction(soil, depth)) < 1.15


def test_the_way_back_in_the_rut_is_easier(ride):
    vehicle, _, rows, _ = ride
    assert resistance(rows, 5.4, 6.8) < 0.5 * resistance(rows, 2.4, 3.4)
    track = vehicle["left_track"].model
    assert track.s.rut[MADE] > 4.0
    assert 0.1 < track.s.rut[FIRST:].reshape(TILES, TILE)[:, 2:].max() < 0.25


def test_a_state_saved_in_the_rut_goes_on_to_the_bit(ride):
    vehicle, _, _, (states, steps) = ride
    track, ends = vehicle["left_track"].model, []
    for forget in (False, False, True):
        for name, member in vehicle.members.items():
            member.model.state[:] = states[name]
            member.model.outputs(member.y)
        if forget:
            track.s.rut[FIRST:] = 0.0
        vehicle.steps = steps
        vehicle.run(0.3)
        ends.append(track.state.copy())
    assert (ends[0] == ends[1]).all()
    assert (ends[0] != ends[2]).any()


def turn(speeds, path, settings):
    """Yaw rate, steering moment, power of the slower and the faster side, settlement: of 1 to 1.4 s and of 2 to 3 s.

    Besides, the part of the energy that is unaccounted for.
    """
    given = [f"drive.{side}.speed={speed}" for side, speed in zip(("left", "right"), speeds, strict=True)]
    given += ["symmetric=false", "hitch=false", "expect={}", "drive.ramp_time=1", "run.stop=3", *settings]
    result, measures = simulate(load("soft_ground", None, given), path), []
    assert result["status"] == "ok", result["message"]
    with Log(path) as log:
        run = RunData(log)
        for window in (Window(1.0, 1.4), Window(2.0, 3.0)):
            power = sorted(turning.drive_power(run, side, window) for side in ("left", "right"))
            steering = turning.yaw_rate(run, "", window), turning.steering_moment(run, "", window)
            measures.append([*steering, *power, run.mean("chassis.settlement", window)])
    return np.array(measures), result["energy"]["residual_relative"]


@pytest.mark.parametrize("settings", [
    ["track.model=rigid"],
    pytest.param(["track.model=flexible"], marks=pytest.mark.study),  # cables with axes that turn
    pytest.param(["track.model=flexible", "track.element=beam"], marks=pytest.mark.study),
])  # fmt: skip
def test_turns_on_sand_mirror_each_other(tmp_path, settings):
    """A vehicle that is thrown to either side; it amplifies rounding errors, to 1e-5 after 3 s.

    Steady, the inner track is dragged along. The moment is up to that of equal loads on five wheels a side, under each
    of which shear across begins anew over 0.33 m, the effective length of ``soft_ground``; shear along takes a part.
    """
    left, left_open = turn((5, 9), tmp_path / "left.mcap", settings)
    right, right_open = turn((9, 5), tmp_path / "right.mcap", settings)
    mirrored = np.array([-1.0, -1.0, 1.0, 1.0, 1.0])
    np.testing.assert_allclose(right[0], mirrored * left[0], rtol=1e-7)
    assert max(abs(left_open), abs(right_open)) < 1e-3
    rate, moment, inner, outer, _ = left[1]
    assert rate == pytest.approx(0.244, abs=0.005)
    lever = np.array([1.333, 0.667])  # of the wheels before and behind the middle one, m
    across = lever * rate / 1.7 * 0.33 / 0.025  # shear displacement at the end of such a length over K
    most = 0.4 * 155.9e3 * 0.54 * np.sum(lever * (1.0 - (1.0 - np.exp(-across)) / across))
    assert 0.75 * most < moment < most
    assert inner < 0.0 < outer


# --- convergence ---


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """Function: differences of the runs of 3 s with two steps, H = h, ms, by observable."""
    folder, logs = tmp_path_factory.mktemp("steps"), {}
    for h in (4.0, 2.0, 1.0, 0.5, 0.25, 0.125):
        steps = [f"run.step={h} ms", f"track.step={h} ms", "run.stop=3 s", "expect={}"]
        result = simulate(load("soft_ground", "rigid", steps), folder / f"{h}.mcap")
        assert result["status"] == "ok", result["message"]
        logs[h] = result["log"]

    def differ(one, other):
        with Log(logs[one]) as run, Log(logs[other]) as reference:
            return differences(RunData(run), RunData(reference))

    return differ


@pytest.mark.study
def test_a_run_on_soil_converges_with_first_order(compared):
    """RMS of the position over 3 s, e(h) = C (h^p - 0.125^p): e(1) / e(0.25) is 7 for p = 1, 4.4 for 0.5, 21 for 2."""
    errors = {h: compared(h, 0.125)["position"].absolute for h in (2.0, 1.0, 0.5, 0.25)}
    assert 5.5 < errors[1.0] / errors[0.25] < 9.0  # p = 0.75 and 1.25
    assert 10.3 < errors[2.0] / errors[0.25] < 22.5
    assert sorted(errors.values()) == [errors[h] for h in (0.25, 0.5, 1.0, 2.0)]
    assert errors[1.0] < 0.2e-3


@pytest.mark.study
def test_the_estimate_on_soil_bounds_the_error(compared):
    """The worst observable, which is torque, and position, speed and pitch."""
    for h in (1.0, 0.5):
        pairs = compared(2.0 * h, h), compared(4.0 * h, 2.0 * h)
        error = compared(h, 0.125)
        for name in ("position", "velocity", "pitch", "torque"):
            stated = convergence_index(*(found[name].absolute for found in pairs)).error
            assert 1.0 < stated / error[name].absolute < 15.0


# --- soil on a terrain ---


@pytest.mark.study
def test_soil_under_a_terrain_that_is_level_is_soil():
    """An obstacle out of reach changes nothing."""
    level, far = (
        InProcess(load("soft_ground", "rigid", ["drive.ramp_time=0.2 s", *settings])).run(0.3)["left_track"].model
        for settings in ((), ("ground.half_round={x=[60], radius=0.1}",))
    )
    np.testing.assert_allclose(far.pins(), level.pins(), atol=1e-9)
    np.testing.assert_allclose(far.s.soil[:, PRESSURE], level.s.soil[:, PRESSURE], rtol=1e-6, atol=1.0)


def test_brakes_hold_on_a_slope_of_soil():
    """Mobilised shear holds without creep: on hard ground of a friction of 0.3 it would be 8.9 mm/s."""
    there = "drive.speed_points=[[0.2, 0], [1.2, 8], [5.5, 8], [6.5, 0]]"
    slope = ("ground.grade=0.2", "ground.incline_start=0.6", "ground.incline_length=2.7")
    vehicle = InProcess(load("soft_ground", "rigid", ["hitch=false", there, *slope]))
    chassis, means = vehicle["chassis"], []
    vehicle.run(10.0)
    for _ in range(2):  # the hull still swings on the springs, by 2 cm a second to and fro
        means.append(np.mean([vehicle.run(0.1)["chassis"]["chassis.position.x"] for _ in range(20)]))
    assert means[0] > 3.0
    assert chassis["pitch"] == pytest.approx(-np.arctan(0.2), abs=0.05)
    assert abs(means[1] - means[0]) < 0.3 * 8.944e-3 * 2.0
