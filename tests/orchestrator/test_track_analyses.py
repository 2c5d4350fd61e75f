"""Analyses against known answers: sums of a run's records, made-up signals, published examples."""

import inspect
import json
import sys
from itertools import pairwise
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from mcap.reader import make_reader

from fmus.vehicle import BadInput
from orchestrator.execution.simulate import simulate
from orchestrator.log.events_topic import WARNINGS
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.results import energy
from orchestrator.results.analyses import (
    circuit,
    contact,
    deformation,
    envelope,
    events,
    fatigue,
    joints,
    links,
    patches,
    power,
    signal_picture,
    slip,
    spectrum,
    wheel_loads,
)
from orchestrator.results.analyses.catalogue import ANALYSES, TRACK, Analysis, analyse, module_of
from orchestrator.results.run_data import EVER, Missing, RunData, Window
from orchestrator.results.table import Table
from orchestrator.results.thinned import TimeEnvelope
from orchestrator.results.views.bodies import EVERY, Bodies
from orchestrator.scene.scene import load

STEP = 1e-3
E1049 = np.array([-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0])
GROUPS = "['tension', 'position', 'force', 'ground', 'fibres', 'slopes']"


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """The left half of a vehicle that drives off at once, with heading 0.6 rad."""
    settings = (
        "run.stop=0.2 s", "drive.ramp_start=0 s", "drive.ramp_time=0.15 s", "drive.speed=6 rad/s", "symmetric=true",
        "start.heading=0.6", f"track.link_outputs={GROUPS}",
    )  # fmt: skip
    path = tmp_path_factory.mktemp("analyses") / "driven.mcap"
    assert simulate(load("straight", "flexible", settings), path)["message"] == ""
    return path


@pytest.fixture(scope="module")
def spinning(tmp_path_factory):
    """A log of the free loop that spins."""
    path = tmp_path_factory.mktemp("analyses") / "spinning.mcap"
    assert simulate(load("spinning_loop", "flexible", ("run.stop=0.05 s", "run.links=20")), path)["message"] == ""
    return path


def made(path, topics, rows, scene=None, instances=("track",), connections=(), closing=()):
    """Write a log of topics: for each its variables and units, and its times with values (m, variables)."""
    system = {"instances": [{"name": name} for name in instances], "connections": list(connections)}
    files = {"scene.json": json.dumps(scene or {}).encode(), "system.json": json.dumps(system).encode()}
    with Recorder(path, topics, files, {}) as recorder:
        for topic, (t, values) in rows.items():
            for k, row in enumerate(np.asarray(values, float)):
                recorder.write(topic, k, float(t[k]), STEP, np.ascontiguousarray(row))
        recorder.close("ok", "", 1, warnings=closing)
    return path


def ends(run, name):
    first, last = run.ends(name)
    return last - first


# power


@pytest.mark.long
def test_power_through_ports_is_the_work_of_the_ledger(driven):
    with Log(driven) as log:
        run = RunData(log)
        port_power = power.of(run)
        works = energy._works(run)
    through = dict(zip(port_power.ports, port_power.energy + port_power.energy_carried, strict=True))
    scale = max(abs(given) for given, _ in works.values())
    assert scale > 1e3
    for port, (given, _) in works.items():
        assert through[f"{port.giver}.{port.giver_connector}"] == pytest.approx(given, abs=1e-3 * scale)


@pytest.mark.long
def test_of_the_hull_relative_power_and_that_on_its_motion_are_what_the_chassis_received(driven):
    with Log(driven) as log:
        run = RunData(log)
        port_power = power.of(run)
        received = ends(run, "chassis.port.work")
        motor = ends(run, "left_drive.energy.work")
        spun = ends(run, "left_drive.energy.kinetic")
    of_hull = [k for k, name in enumerate(port_power.ports) if name != "left_track.sprocket"]
    assert 2 * (port_power.energy + port_power.energy_carried)[of_hull].sum() == pytest.approx(received, rel=2e-3)
    sprocket, mount = (port_power.ports.index(name) for name in ("left_track.sprocket", "left_drive.mount"))
    # a mount does not move relative to the hull; a sprocket passes on the motor's torque less its own spin
    assert abs(port_power.energy[mount]) < 1e-6 * abs(port_power.energy_carried[mount])
    assert port_power.energy_drive[0] == pytest.approx(motor, rel=1e-4)
    assert -port_power.energy[sprocket] == pytest.approx(motor - spun, rel=0.02)
    assert abs(port_power.energy_carried[sprocket]) > 0.03 * abs(port_power.energy[sprocket]), "raw power is similar"


def test_power_sees_a_wrench_that_is_off_by_three_per_cent(driven, scaled):
    with Log(driven) as log:
        right = power.of(RunData(log)).energy
    with Log(driven) as log:
        scaled(log, "/left_track/out", "sprocket.torque.y", 1.03)
        wrong = power.of(RunData(log)).energy
        largest = max(abs(given) for given, _ in energy._works(RunData(log)).values())
    # heading 0.6 rad: cos^2 of the torque about the axle is about y
    assert wrong[0] / right[0] == pytest.approx(1.0 + 0.03 * np.cos(0.6) ** 2, rel=1e-4)
    assert abs(wrong[0] - right[0]) > 5e-3 * largest, "the energy balance does not see the fault"
    np.testing.assert_array_equal(wrong[1:], right[1:])


def test_a_window_of_power_is_a_part_of_it(driven):
    with Log(driven) as log:
        run = RunData(log)
        whole, *parts = (power.of(run, Window(*each)) for each in ((0.0, 0.2), (0.0, 0.1), (0.1, 0.2)))
    np.testing.assert_allclose(parts[0].energy + parts[1].energy, whole.energy, rtol=1e-9, atol=1e-9)
    assert len(whole.t) == len(parts[0].t) + len(parts[1].t)


def test_energies_alone_are_those_of_the_powers_over_time(driven, monkeypatch):
    monkeypatch.setattr(power, "BLOCK", 30)
    with Log(driven) as log:
        run = RunData(log)
        whole, summed = power.of(run), power.summary(run)
    np.testing.assert_allclose(summed.relative, whole.energy, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(summed.carried, whole.energy_carried, rtol=1e-9)
    np.testing.assert_allclose(whole.table().rows[0][1:], summed.table().rows[0][1:], rtol=1e-9)
    assert whole.table().title == summed.table().title == "Power into wheels relative to the hull, 0 to 0.2 s"


# spectra

TWO = ((12.5, 50.0), (40.0, 20.0))  # Hz, N


def sines(t):
    return 7.0 + sum(a * np.sin(2 * np.pi * f * t + 0.3) for f, a in TWO)


@pytest.mark.parametrize("shape", ["hann", "flat-top"])
@pytest.mark.parametrize("even", [True, False])
def test_a_sine_shows_its_amplitude_at_its_frequency(tmp_path, shape, even):
    t = np.arange(4000) * STEP
    if not even:
        t = t + 2e-4 * np.sin(17.0 * np.arange(4000))
    rows = {"/track/out": (t - t[0], np.stack([sines(t - t[0]), 0 * t], axis=1))}
    path = made(tmp_path / "s.mcap", {"/track/out": [("travel", "m"), ("force", "N")]}, rows)
    with Log(path) as log:
        travel_spectrum = spectrum.of(RunData(log), "track.travel", shape=shape)
    assert travel_spectrum.resampled is not even
    allowed = 1e-3 if even else 1e-2  # linear interpolation between samples takes a little of a sine
    assert travel_spectrum.amplitude[0, 0] == pytest.approx(7.0, rel=1e-2)
    assert travel_spectrum.peak() == (pytest.approx(12.5, abs=0.01), pytest.approx(50.0, rel=allowed))
    assert travel_spectrum.peak(above=30.0) == (pytest.approx(40.0, abs=0.01), pytest.approx(20.0, rel=allowed))
    rows = travel_spectrum.table().records()
    assert [round(row["frequency"], 2) for row in rows[:2]] == [12.5, 40.0]
    frame = travel_spectrum.table().frame()
    assert list(frame["amplitude"]) == [row["amplitude"] for row in rows]
    assert frame.attrs["units"] == {"signal": "", "frequency": "Hz", "amplitude": "m"}
    assert len(travel_spectrum.series().rows) == len(travel_spectrum.frequency)


def test_between_bins_a_flat_top_reads_a_sine_and_a_hann_window_does_not():
    t = np.arange(2000) * STEP
    values = 3.0 * np.sin(2 * np.pi * 12.25 * t)[:, None]  # bins are 0.5 Hz wide
    amplitude = {shape: spectrum.amplitudes(t, values, shape)[1].max() for shape in spectrum.SHAPES}
    assert amplitude["flat-top"] == pytest.approx(3.0, rel=2e-3)
    assert amplitude["hann"] == pytest.approx(3.0 * 0.8488, rel=5e-3)


def test_orders_are_multiples_of_the_rate_of_teeth(tmp_path):
    t = np.arange(2000) * STEP
    speed = np.full(2000, 2 * np.pi * 1.25)  # 12.5 teeth a second
    connection = {
        "source": "track", "outputs": ["sprocket.force.x"], "target": "drive", "inputs": ["sprocket.force.x"]
    }  # fmt: skip
    path = made(
        tmp_path / "s.mcap",
        {"/track/out": [("travel", "m")], "/drive/out": [("speed", "rad/s")]},
        {"/track/out": (t, sines(t)[:, None]), "/drive/out": (t, speed[:, None])},
        {"vehicle": {"sprocket": {"teeth": 10}}},
        ("track", "drive"),
        [connection],
    )
    with Log(path) as log:
        order_spectrum = spectrum.of(RunData(log), "track.travel", orders=True)
    assert order_spectrum.teeth == pytest.approx(12.5, rel=1e-12)
    assert order_spectrum.order[order_spectrum.amplitude[1:, 0].argmax() + 1] == pytest.approx(1.0, abs=1e-6)


def test_a_scene_without_teeth_is_told(tmp_path):
    t = np.arange(100) * STEP
    connection = {
        "source": "track", "outputs": ["sprocket.force.x"], "target": "drive", "inputs": ["sprocket.force.x"]
    }  # fmt: skip
    path = made(
        tmp_path / "s.mcap",
        {"/track/out": [("travel", "m")], "/drive/out": [("speed", "rad/s")]},
        {"/track/out": (t, sines(t)[:, None]), "/drive/out": (t, 1.0 + t[:, None])},
        {"vehicle": {"sprocket": "round"}},
        ("track", "drive"),
        [connection],
    )
    with Log(path) as log, pytest.raises(Missing, match=r"no number above 0 at vehicle\.sprocket\.teeth"):
        spectrum.of(RunData(log), "track.travel", orders=True)


# places on the circuit


def test_places_are_arc_lengths_from_the_crossing():
    """Places are arc lengths from the crossing: the pins of a square go round the same places."""
    corner = np.array([[1, 0], [1, -1], [0, -1], [-1, -1], [-1, 0], [-1, 1], [0, 1], [1, 1]], float)
    after = np.roll(corner, -1, axis=0)
    moved = np.array([corner + share * (after - corner) for share in (0.0, 0.25, 0.75)])
    middles, pins, length = circuit.places(moved, np.array([1.0, 0.0]))
    np.testing.assert_allclose(length, [8.0, moved_length(moved[1]), moved_length(moved[2])])
    np.testing.assert_allclose(pins[0], np.arange(8.0))
    np.testing.assert_allclose(middles[0], np.arange(8.0) + 0.5)
    assert pins[1, 0] == pytest.approx(0.25)
    with pytest.raises(ValueError, match="round its sprocket"):
        circuit.places(moved + 5.0, np.array([1.0, 0.0]))


def moved_length(polygon):
    return np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1).sum()


@pytest.mark.long
def test_the_envelope_of_a_spinning_loop_is_its_uniform_tension(spinning):
    with Log(spinning) as log:
        tension_envelope = envelope.of(RunData(log))
    side = 0.1524
    radius = side / (2 * np.tan(np.pi / 64))  # of the links' middles
    expected = 18.0 * 5.0**2 * radius / (2 * np.sin(np.pi / 64))  # m omega^2 Rc / (2 sin(pi/N))
    assert tension_envelope.unit == "N"
    assert len(tension_envelope.place) == 64
    for values in (tension_envelope.least, tension_envelope.mean, tension_envelope.most):
        np.testing.assert_allclose(values, expected, rtol=1e-3)
    assert np.diff(tension_envelope.place).max() == pytest.approx(side, rel=1e-4)
    assert tension_envelope.records.sum() == 64 * 6


def test_an_envelope_shows_what_links_feel_where_they_are(tmp_path):
    """An envelope shows tension by place: on a polygon that turns, every place has one value."""
    n, t = 40, np.arange(50) * STEP
    angle = -2 * np.pi * (np.arange(n)[None] / n + 3.1 * t[:, None])  # in the numbering of the links
    pins = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=2)
    middle = np.angle(np.exp(1j * (angle - np.pi / n))) % (2 * np.pi)
    tension = 1e4 + 1e3 * np.cos(middle)
    topics = {
        "/track/links": [(f"link[{i + 1}].tension", "N") for i in range(n)]
        + [(f"joint[{i + 1}].position.{axis}", "m") for i in range(n) for axis in "xyz"],
        "/track/out": [("travel", "m")],
    }
    rows = {"/track/links": (t, np.hstack([tension, pins.reshape(50, -1)])), "/track/out": (t, t[:, None])}
    scene = {"start": {"position": [0.0, 0.0, 0.0], "heading": 0.0}}
    with Log(made(tmp_path / "e.mcap", topics, rows, scene)) as log:
        tension_envelope = envelope.of(RunData(log), bins=20)
    expected = 1e4 + 1e3 * np.cos(2 * np.pi * (np.arange(20) + 0.5) / 20)
    half = 1e3 * np.pi / 20  # half a bin's width
    assert np.abs(tension_envelope.least - expected).max() < 1.05 * half
    assert np.abs(tension_envelope.most - expected).max() < 1.05 * half
    np.testing.assert_allclose(tension_envelope.mean, expected, atol=0.3 * half)
    np.testing.assert_allclose(np.hypot(tension_envelope.forward, tension_envelope.up), 1.0, atol=0.03)
    assert np.argmax(tension_envelope.mean) in (0, 19)


def test_open_chains_have_no_circuit(tmp_path):
    topics = {
        "/track/links": [("link[1].tension", "N")]
        + [(f"joint[{i}].position.{axis}", "m") for i in (1, 2) for axis in "xyz"],
        "/track/out": [("travel", "m")],
    }
    rows = {"/track/links": (np.zeros(1), np.zeros((1, 7))), "/track/out": (np.zeros(1), np.zeros((1, 1)))}
    with (
        Log(made(tmp_path / "o.mcap", topics, rows)) as log,
        pytest.raises(Missing, match="1 links between 2 pins make no circuit"),
    ):
        envelope.of(RunData(log))


# fatigue


def test_rainflow_counts_the_example_of_the_standard():
    counted = {}
    for size, number in zip(*fatigue.rainflow_cycles(fatigue.turning_points(E1049)), strict=True):
        counted[size] = counted.get(size, 0.0) + number
    assert counted == {3.0: 0.5, 4.0: 1.5, 6.0: 0.5, 8.0: 1.0, 9.0: 0.5}


def test_what_lies_between_turning_points_does_not_count():
    fine = np.interp(np.linspace(0, 8, 161), np.arange(9), E1049)
    fine = np.repeat(fine, 2)
    np.testing.assert_array_equal(fatigue.turning_points(fine), E1049)
    values = np.round(np.random.default_rng(5).normal(size=500), 1)  # with equal neighbours
    for whole, part in zip(
        fatigue.rainflow_cycles(values), fatigue.rainflow_cycles(fatigue.turning_points(values)), strict=True
    ):
        np.testing.assert_array_equal(whole, part)
    assert fatigue.rainflow_cycles(fatigue.turning_points(np.full(9, 3.0)))[0].size == 0


def stressed(path, stress):
    topics = {
        "/track/links": [(f"link[{i}].fibre.{side}", "Pa") for side in ("outer", "inner") for i in (1, 2)],
        "/track/out": [("travel", "m")],
    }
    t = np.arange(len(stress)) * STEP
    return made(path, topics, {"/track/links": (t, stress), "/track/out": (t, t[:, None])})


def test_damage_is_that_of_miner(tmp_path):
    """Damage is Miner's sum of counts (S / 100 MPa)^m / 2e6 by hand (E1049, ranges times 20 MPa)."""
    stress = 20e6 * E1049[:, None] * np.array([1.0, 0.5, 2.0, 0.0])
    by_hand = sum(n * (s * 20e6 / 100e6) ** 3 for s, n in ((3, 0.5), (4, 1.5), (6, 0.5), (8, 1.0), (9, 0.5))) / 2e6
    with Log(stressed(tmp_path / "f.mcap", stress)) as log:
        run = RunData(log)
        assessment = fatigue.of(run)
        steeper = fatigue.of(run, line=fatigue.StressLifeLine(slope=5.0))
        with pytest.raises(BadInput, match=r"slope = 0: must be greater than 0"):
            fatigue.of(run, line=fatigue.StressLifeLine(slope=0.0))
    np.testing.assert_allclose(assessment.damage, by_hand * np.array([[1.0, 8.0], [0.125, 0.0]]), rtol=1e-12)
    np.testing.assert_allclose(assessment.largest[:, 0], [180e6, 90e6])
    np.testing.assert_allclose(assessment.cycles, [[4.0, 4.0], [4.0, 0.0]])
    assert steeper.damage[0, 1] / steeper.damage[0, 0] == pytest.approx(32.0)
    assert assessment.life == pytest.approx(8 * STEP / 3600 / (8 * by_hand))


def test_blocks_of_records_do_not_change_cycles(tmp_path, monkeypatch):
    from orchestrator.results.analyses import link_records

    stress = 1e7 * np.random.default_rng(2).normal(size=(60, 4))
    path = stressed(tmp_path / "f.mcap", stress)
    with Log(path) as log:
        whole = fatigue.of(RunData(log))
        monkeypatch.setattr(link_records, "SIZE", 7)
        np.testing.assert_array_equal(fatigue.of(RunData(log)).damage, whole.damage)


def test_without_fibres_one_sentence_says_what_to_record(spinning):
    with Log(spinning) as log, pytest.raises(Missing, match=r"group 'fibres' of track\.link_outputs"):
        fatigue.of(RunData(log))


# links


def test_forces_of_links_are_those_of_the_track(driven):
    with Log(driven) as log:
        run = RunData(log)
        forces = links.of(run)
        t, whole = run.vectors("left_track", "out", "ground.force")
        tension = log.select(log.choose(["left_track.link[*].tension"]))["/left_track/links"].values
        world = log.select(log.choose(["left_track.joint[*].force.*"]))["/left_track/links"].values
    at = np.searchsorted(t, forces.t - 1e-9)
    between = [whole[i + 1 : j + 1].mean(axis=0) for i, j in pairwise(at)]
    summed = np.einsum("mnij,mnj->mi", forces.axes, forces.ground)
    np.testing.assert_allclose(summed, [whole[0], *between], atol=1e-9 * np.abs(whole).max())
    assert np.abs(whole[-1, 2]) > 4e4
    # from strain alone; a link's tension also has damping and rotation
    np.testing.assert_allclose(forces.axial, tension, atol=1e-3 * tension.max())
    np.testing.assert_allclose(
        np.linalg.norm(forces.joint, axis=2), np.linalg.norm(world.reshape(*forces.t.shape, -1, 3), axis=2), rtol=1e-12
    )
    # the first pin of a taut link pulls it backwards, and the ground pushes inwards
    assert np.median(-forces.joint[-1, :, 0] / tension[-1]) == pytest.approx(1.0, abs=0.05)
    assert forces.ground[-1, :, 2].sum() == pytest.approx(-between[-1][2], rel=0.02)
    assert np.abs(forces.joint[..., 1]).max() < 1e-6 * np.abs(forces.joint).max(), "a straight run has lateral forces"


def test_a_force_of_the_ground_that_is_off_by_three_per_cent_is_seen(driven, scaled):
    with Log(driven) as log:
        run = RunData(log)
        right = links.of(run).ground
        link = int(np.abs(right[-1]).max(axis=1).argmax())
        scaled(log, "/left_track/links", f"link[{link + 1}].ground.force.z", 1.03)
    with Log(driven) as log:
        wrong, force = links.of(RunData(log)).ground, contact.of(RunData(log)).force
    lost = np.einsum("mnk,mnk->m", wrong - right, wrong - right) ** 0.5
    assert lost[-1] > 1e-3 * np.abs(right).max()
    assert force != pytest.approx(-right[..., 2].sum(axis=1).mean(), rel=1e-4)


def test_the_moment_of_a_link_is_that_of_its_fibres(driven):
    """The moment of a link is that of its fibre stresses: M = (inner - outer) / 2 x I / fibre distance."""
    with Log(driven) as log:
        run = RunData(log)
        moment = links.of(run).moment
        pair = [run.signal(f"left_track.link[5].fibre.{side}")[1] for side in ("outer", "inner")]
    np.testing.assert_allclose(moment[:, 4], 0.5 * (pair[1] - pair[0]) * 2.03e-6 / 0.02, rtol=1e-12)


def test_joints_are_the_extremes_of_links(driven):
    with Log(driven) as log:
        run = RunData(log)
        extremes, every, summed = joints.of(run), links.of(run), links.summary(run)
    for k in range(3):
        values = every.joint[..., k]
        record, joint = np.unravel_index(values.argmax(), values.shape)
        assert extremes.most[0, k] == values[record, joint] == values.max()
        assert (extremes.most_joint[0, k], extremes.most_t[0, k]) == (joint + 1, every.t[record])
        assert extremes.least[0, k] == values.min()
        printed = [row[3:] for row in summed.rows if row[:2] == ("joint force", links.AXES[k])]
        np.testing.assert_allclose(printed, [[values.min() / 1e3, values.mean() / 1e3, values.max() / 1e3]], rtol=1e-9)


# deformation

ROD, GRADIENT = 0.2, (1.0 + 1e-5, 0.0, 2e-5)  # m; at the first pin of a made-up element


def bent(path, turned=0.0, gradient=GRADIENT):
    """Log of one link with r = x + 1e-5 x + (2e-5 x, 0, 2e-5 x - 3e-4 x^2 + 1e-3 x^3), rotated about y."""
    x = np.array([0.0, ROD])
    slope = np.stack([np.ones(2), np.zeros(2), -6e-4 * x + 3e-3 * x**2], axis=1) + np.array(gradient) - [1.0, 0.0, 0.0]
    along, outwards = x * gradient[0], gradient[2] * x - 3e-4 * x**2 + 1e-3 * x**3
    place = np.stack([5.0 + along, np.ones(2), 2.0 + outwards], axis=1)
    c, s = np.cos(turned), np.sin(turned)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    row = np.concatenate([(place @ turn.T).ravel(), (slope @ turn.T).ravel()])
    names = [(f"joint[{i}].position.{axis}", "m") for i in (1, 2) for axis in "xyz"]
    names += [(f"link[1].slope.{end}.{axis}", "1") for end in ("first", "last") for axis in "xyz"]
    topics = {"/track/out": [("travel", "m")], "/track/links": names}
    scene = {"vehicle": {"track": {"pitch": ROD}}, "start": {"heading": 0.0}}
    t = np.array([0.0, 1.0])
    return made(path, topics, {"/track/out": (t, [[0.0], [0.0]]), "/track/links": (t, [row, row])}, scene)


@pytest.mark.parametrize("turned", [0.0, 0.7, 3.0])
def test_deformation_of_a_known_cubic_in_its_tangent_frame(tmp_path, turned):
    """Deformation of a known cubic in its tangent frame is the bending.

    Along the chord it is half of the angle's square. The tangent takes 2e-5 x off.
    """
    with Log(bent(tmp_path / "bent.mcap", turned)) as log:
        field = deformation.of(RunData(log), at=[0.3])
    x = field.x
    assert field.t.tolist() == [0.0]
    np.testing.assert_allclose(field.displacement[0, 0, :, 0], 1e-5 * x, atol=1e-3 * 2e-6)
    outwards = -3e-4 * x**2 + 1e-3 * x**3  # along z: the pin's axis is y, so x cross y
    np.testing.assert_allclose(field.displacement[0, 0, :, 1], outwards, atol=1e-4 * abs(outwards).max())
    assert abs(field.displacement[..., 2]).max() < 1e-14
    assert field.series().rows[-1][3] == pytest.approx(1e-5 * ROD, rel=1e-3)
    with Log(bent(tmp_path / "other.mcap", turned, (1.0 + 1.03e-5, 0.0, 2e-5))) as log:
        other = deformation.of(RunData(log)).displacement
    assert abs(other[0, 0, -1, 0] / field.displacement[0, 0, -1, 0] - 1.0) > 0.02


def test_links_in_tension_lengthen_by_their_strain(driven):
    """Links in tension lengthen by stress l / E less the shortening by bending; nothing is lateral."""
    with Log(driven) as log:
        run = RunData(log)
        field = deformation.of(run, at=[0.1, 0.2])
        t, outer = run.signal("left_track.link[5].fibre.outer")
        _, inner = run.signal("left_track.link[5].fibre.inner")
    at = np.searchsorted(t, field.t - 1e-9)
    stretched = 0.5 * (outer + inner)[at] * 0.1524 / 2e11
    bend = np.gradient(field.displacement[:, 4, :, 1], field.x, axis=1)
    shortened = 0.5 * np.trapezoid(bend**2, field.x, axis=1)
    np.testing.assert_allclose(field.displacement[:, 4, -1, 0] + shortened, stretched, rtol=1e-3)
    assert np.abs(field.displacement[..., 2]).max() < 1e-12
    assert 1e-8 < np.abs(field.displacement[..., 1]).max() < 1e-4
    with Log(driven) as log, pytest.raises(Missing, match=r"in the window is at 0\.2 s"):
        deformation.of(RunData(log), at=[0.3])


def test_deformation_as_a_picture_and_as_numbers(cotrack, driven, tmp_path):
    assert cotrack("analyse", driven, "deformation", "--at", "0.1", "--at", "0.2", "--link", "7", "-o", "d.png")[0] == 0
    assert (tmp_path / "d.png").read_bytes()[:4] == b"\x89PNG"
    assert cotrack("analyse", driven, "deformation", "-o", "d.csv")[0] == 0
    assert len((tmp_path / "d.csv").read_text().splitlines()) == 1 + 64 * deformation.POINTS
    status, _, err = cotrack("analyse", driven, "deformation", "--link", "65", "-o", "e.png")
    assert (status, err) == (2, "cotrack: --link 65: left_track has the links 1 to 64\n")


# wheels and ground


def test_pressure_is_the_force_on_the_ground_over_the_pads(driven):
    with Log(driven) as log:
        run = RunData(log)
        pressure, every = contact.of(run), links.of(run)
        pushes, since = -every.ground[..., 2].sum(axis=1), np.diff(every.t, prepend=every.t[0] - every.t[1])
        assert pressure.force == pytest.approx(np.average(pushes, weights=since), rel=1e-9)
        assert pressure.area == pytest.approx(0.1524 * 0.378)
        assert pressure.peak == pytest.approx(-every.ground[..., 2].min() / pressure.area, rel=1e-9)
    assert np.nansum(pressure.mean) * pressure.area == pytest.approx(pressure.force, rel=0.15)
    touching = pressure.forward[pressure.most > 0.01 * pressure.peak]
    assert touching.max() < -0.3
    assert touching.min() > -3.8


def test_slip_and_thrust_are_along_the_heading(driven):
    with Log(driven) as log:
        run = RunData(log)
        track_slip = slip.of(run)
        _, force = run.vectors("left_track", "out", "ground.force")
    ahead = np.array([np.cos(0.6), np.sin(0.6), 0.0])
    np.testing.assert_allclose(track_slip.thrust[:, 0], force @ ahead, atol=1e-6 * np.abs(force).max())
    assert np.abs(track_slip.lateral).max() < 1e-6 * np.abs(force).max()
    assert np.abs(track_slip.thrust[-50:]).mean() > 100.0
    np.testing.assert_array_equal(track_slip.load[:, 0], force[:, 2])


def over_time(t, values, keep):
    """Mean of a step function (value k from t[k - 1] to t[k]) over the kept steps, by hand."""
    total = time = 0.0
    for k in range(len(t)):
        if keep[k]:
            own = t[k] - t[k - 1] if k else t[1] - t[0]
            total, time = total + own * values[k], time + own
    return total / time


@pytest.mark.parametrize("even", [True, False])
def test_a_slip_ratio_weighs_a_record_by_its_own_step_alone(tmp_path, even):
    """A slip ratio weighs a record by its own step; a halt before it does not count."""
    t = np.linspace(0.0, 4.0, 401)
    t = t if even else t + 0.4 * np.sin(t)
    speed = np.where(np.sin(2 * np.pi * t) > 0.2, 2.0 + t, 0.01)
    ratio = 0.02 + 0.3 * np.exp(-40.0 * ((t + 0.97) % 1.0))  # largest at the start
    names = ["travel", "slip", "speed", *(f"ground.force.{axis}" for axis in "xyz")]
    values = np.column_stack([t, ratio * speed, speed, np.zeros((len(t), 2)), np.full(len(t), 1e4)])
    topics = {"/chassis/out": [("yaw", "rad")], "/track/out": [(name, "1") for name in names]}
    rows = {"/chassis/out": (t, np.zeros((len(t), 1))), "/track/out": (t, values)}
    path = made(tmp_path / "s.mcap", topics, rows, {"assembly": "vehicle"}, ("chassis", "track"))
    with Log(path) as log:
        row = slip.of(RunData(log)).table().records()[0]
    wanted = 100.0 * over_time(t, ratio, speed > slip.SLOWEST)
    assert row["slip ratio"] == pytest.approx(wanted, rel=1e-9)
    kept = np.flatnonzero(speed > slip.SLOWEST)
    assert np.average(100.0 * ratio[kept], weights=np.diff(t[kept], prepend=0.0)) > 1.5 * wanted, "the twin"


def test_means_of_links_are_over_time_where_records_are_uneven(tmp_path):
    """Means of forces and patches by place are means over time, with records of 1 and of 10 ms."""
    t = np.concatenate([np.arange(0.0, 0.5, 1e-3), np.arange(0.5, 1.0005, 1e-2)])
    tension = 1e4 * (1.0 + (t > 0.5 - 1e-9))
    angle = -2.0 * np.pi * (np.arange(12) + 0.5) / 12
    pins = np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=1)
    names = [f"joint[{i}].{what}.{a}" for what in ("position", "force") for i in range(1, 13) for a in "xyz"]
    names += [f"link[{i}].tension" for i in range(1, 13)]
    force = np.einsum("m,nk->mnk", tension, np.roll(pins, -1, axis=0) - pins).reshape(len(t), 36)
    values = np.hstack([np.tile(pins.ravel(), (len(t), 1)), force, np.tile(tension[:, None], (1, 12))])
    topics = {"/track/out": [("travel", "m")], "/track/links": [(name, "1") for name in names]}
    path = made(tmp_path / "u.mcap", topics, {"/track/out": (t, t[:, None]), "/track/links": (t, values)})
    wanted = over_time(t, tension, np.ones(len(t), bool))
    assert tension.mean() < 0.8 * wanted, "the twin, a mean over records, must differ"
    with Log(path) as log:
        run = RunData(log)
        np.testing.assert_allclose(envelope.of(run, bins=5).mean, wanted, rtol=1e-9)
        (along,) = [row for row in links.summary(run).rows if row[:2] == ("joint force", "along")]
        side = float(np.linalg.norm(pins[1] - pins[0]))
    assert along[4] == pytest.approx(1e-3 * wanted * side, rel=1e-9)
    long = patches.Patches(("wheel",), t, *np.repeat(tension[None, :, None], 3, axis=0))
    assert long.table().records()[0]["length"] == pytest.approx(1e3 * wanted, rel=1e-9)


def rolling(path, load, **more):
    """Write a log of two road wheels with the given loads (m, 2)."""
    t = np.arange(len(load)) * STEP
    names = [(f"road_wheel[{i}].force.{axis}", "N") for i in (1, 2) for axis in "xyz"]
    force = np.zeros((len(load), 2, 3))
    force[..., 2] = load
    topics = {"/track/out": [("travel", "m"), *names]}
    return made(path, topics, {"/track/out": (t, np.hstack([t[:, None], force.reshape(len(load), 6)]))}, **more)


def test_loads_of_wheels_are_counted_by_time(tmp_path):
    t = np.arange(1000) * STEP
    load = np.stack([1e4 + 3e3 * np.sin(2 * np.pi * 5 * t), np.where(t < 0.25 - 1e-9, 0.0, 8e3)], axis=1)
    with Log(rolling(tmp_path / "w.mcap", load)) as log:
        loads = wheel_loads.of(RunData(log))
    np.testing.assert_allclose(loads.mean, [1e4, 6e3], rtol=1e-9)
    np.testing.assert_allclose(loads.rms, [3e3 / np.sqrt(2), 8e3 * np.sqrt(0.25 * 0.75)], rtol=1e-9)
    np.testing.assert_allclose(loads.lifted, [0.0, 0.25], atol=1e-12)
    np.testing.assert_allclose([loads.least, loads.most], [[7e3, 0.0], [13e3, 8e3]], rtol=1e-9)


def test_a_wheel_on_a_flat_face_has_the_patch_of_a_circle():
    """A wheel on a flat face has the patch of a circle: a chord of the rim, or its part on the link."""
    radius, face, sunk, pitch = 0.3, 0.03, 0.004, 0.15
    pins = np.array([[0.0, 0.0, 0.0], [pitch, 0.0, 0.0], [2 * pitch, 0.0, 0.0]])
    normals = np.tile([0.0, 0.0, -1.0], (1, 2, 1))  # outwards: the wheel stands on the other side
    height, half = radius - sunk, np.sqrt(radius**2 - (radius - sunk) ** 2)

    def depths(low, high):
        """Mean of the exact depth from ``low`` to ``high``, m."""
        s = np.linspace(low, high, 20001)
        return radius - np.trapezoid(np.hypot(height, s), s) / (high - low)

    def patch_at(place, high=0.0):
        centre = np.array([[place, 0.0, height + face + high]])
        return (each[0] for each in patches.patch(pins[None], normals, centre, radius, face))

    length, depth = patch_at(0.075)
    np.testing.assert_allclose(length, [2 * half, 0.0], rtol=1e-12)
    np.testing.assert_allclose(depth, [depths(-half, half), 0.0], rtol=2e-3)
    length, depth = patch_at(pitch + 0.01)
    np.testing.assert_allclose(length, [half - 0.01, half + 0.01], rtol=1e-12)
    np.testing.assert_allclose(depth, [depths(-half, -0.01), depths(-0.01, half)], rtol=2e-3)
    assert not any(each.any() for each in patch_at(0.075, sunk + 1e-9))


@pytest.mark.parametrize(("face", "fits"), [(0.029, True), (0.030, False)])
def test_patches_at_rest_carry_what_wheels_are_loaded_by(driven, face, fits):
    """Patches at rest carry the loads of wheels: stiffness times depth, along the normals of the links.

    They carry some per mille more, because the normals of the rim fan out.
    """
    with Log(driven) as log:
        run, start = RunData(log), Window(-1.0, 1e-6)
        bodies, vehicle = Bodies(run, EVERY, window=start), run.scene["vehicle"]
        poses, contacts = next(bodies.blocks()), patches.of(run, start)
        links, pairs = poses.links["left_track"], []
        for wheel in bodies.wheels:
            if wheel.kind == "road_wheel":
                at = poses.wheels[wheel.name].position
                length, depth = patches.patch(links.pins, links.axes[..., 2], at, wheel.radius, face)
                share = length[0] * depth[0] * vehicle["contact"]["wheel"]["stiffness"] / vehicle["track"]["pitch"]
                force = run.vectors("left_track", "out", f"{wheel.name.partition('/')[2]}.force", window=start)[1][0]
                pairs.append((-(share @ links.axes[0, :, 2, 2]), force[2]))
                if fits:
                    assert contacts.length[0, contacts.wheels.index(wheel.name.replace("/", "."))] == length.sum()
    carried, load = np.transpose(pairs)
    assert len(load) == 5
    assert bool(np.all(np.abs(carried - load) <= 0.015 * np.abs(load))) == fits, pairs


# events


def test_events_come_in_order_with_what_they_are_of(tmp_path):
    t = np.arange(1000) * STEP
    load = np.full((1000, 2), 1e4)
    load[300:400, 1] = 0.0
    load[340, 1] = 300.0  # neither lifted nor down
    speed = np.where(t < 0.6, 2 * np.pi, np.where(t < 0.8, 0.05, 3.0))
    angle = np.cumsum(speed) * STEP
    brake = np.cumsum((t > 0.55) * (t < 0.7)) * 1.0
    force = np.zeros((1000, 2, 3))
    force[..., 2] = load
    topics = {
        "/track/out": [("travel", "m"), *((f"road_wheel[{i}].force.{axis}", "N") for i in (1, 2) for axis in "xyz")],
        "/drive/out": [("speed", "rad/s"), ("angle", "rad"), ("energy.dissipated", "J")],
        "/stats/track": [("solver.rejected", "1")],
    }
    rows = {
        "/track/out": (t, np.hstack([t[:, None], force.reshape(1000, 6)])),
        "/drive/out": (t, np.stack([speed, angle, brake], axis=1)),
        "/stats/track": (t[::100], np.array([0, 0, 0, 0, 0, 0, 0, 0, 0, 2.0])[:, None]),
    }
    connection = {
        "source": "track", "outputs": ["sprocket.force.x"], "target": "drive", "inputs": ["sprocket.force.x"]
    }  # fmt: skip
    warning = {"component": "track", "text": "it slips", "time": 0.5, "count": 3}
    scene = {"vehicle": {"sprocket": {"teeth": 10}}}
    path = made(tmp_path / "e.mcap", topics, rows, scene, ("track", "drive"), [connection], [warning])
    with Log(path) as log:
        record = events.of(RunData(log))
        every = events.of(RunData(log), teeth=True)
        late = events.of(RunData(log), Window(0.65, 1.0))
    assert [(event.kind, event.component, round(event.t, 6)) for event in record.events] == [
        ("lifted", "track.road_wheel[2]", 0.3),
        ("touches", "track.road_wheel[2]", 0.4),
        ("warning", "track", 0.5),
        ("locked", "drive", 0.6),
        ("released", "drive", 0.8),
        ("step", "track", 0.9),
    ]
    assert record.events[2].text == "it slips, 3 times"
    assert "2 times" in record.events[-1].text
    teeth = [event.t for event in every.of("tooth")]
    assert len(teeth) == record.teeth["drive"] == int(angle[-1] * 10 / (2 * np.pi))
    np.testing.assert_allclose(np.diff(teeth[:5]), 0.1, rtol=1e-6)
    assert {event.text for event in every.of("tooth")} == {"a tooth ahead"}
    assert [(event.kind, round(event.t, 6)) for event in late.events] == [
        ("locked", 0.65),  # it was at rest already
        ("released", 0.8),
        ("step", 0.9),
    ]


def test_a_log_ends_with_its_events_in_messages_of_foxglove(driven):
    with driven.open("rb") as file:
        messages = [
            (schema.name, message.log_time, json.loads(message.data))
            for schema, _, message in make_reader(file).iter_messages(topics=["/events"])
        ]
    with Log(driven) as log:
        run = RunData(log)
        happened, angle = events.of(run, teeth=True).events, run.signal("left_drive.angle")[1]
        teeth = run.scene["vehicle"]["sprocket"]["teeth"]
        assert log.others == {"/events": "foxglove.Log"}
    assert {name for name, _, _ in messages} == {"foxglove.Log"}
    shown = [(said["name"], said["kind"], said["message"], said["level"] == 3) for _, _, said in messages]
    assert shown == [(e.component, e.kind, e.text, e.kind in WARNINGS) for e in happened]
    for (_, time, said), event in zip(messages, happened, strict=True):
        assert time == 1_000_000_000 * said["timestamp"]["sec"] + said["timestamp"]["nsec"] == round(1e9 * event.t)
    passed = np.floor(angle * teeth / (2.0 * np.pi))
    assert sum(said["kind"] == "tooth" for _, _, said in messages) == np.abs(np.diff(passed)).sum()


# the commands


def test_analyse_prints_tables_and_json_and_files(cotrack, driven, tmp_path):
    for what in (
        "power",
        "envelope",
        "fatigue",
        "wheel-loads",
        "patches",
        "contact",
        "slip",
        "joints",
        "links",
        "deformation",
        "events",
    ):
        status, out, err = cotrack("analyse", driven, what)
        assert (status, err) == (0, ""), what
        assert out.count("\n") >= 3
    status, out, _ = cotrack("analyse", driven, "power", "--json", "--from", "0.1", "-o", tmp_path / "p.csv")
    answer = json.loads(out)
    assert status == 0
    assert answer["units"]["power"] == "kW"
    with Log(driven) as log:
        port_power = power.of(RunData(log), Window(0.1, 1.0))
    assert answer["rows"][0]["energy"] == pytest.approx(port_power.energy[0] / 1e3, rel=1e-12)
    rows = np.genfromtxt(tmp_path / "p.csv", delimiter=",", skip_header=1)
    np.testing.assert_allclose(rows[:, 2], port_power.relative[:, 0])
    status, out, _ = cotrack("analyse", driven, "spectrum", "--signal", "left_track.link[3].tension", "--order")
    assert status == 0
    assert "tooth order" in out


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("power", "--order"), "--order is an option of spectrum, not of power"),
        (("spectrum",), "a spectrum needs --signal NAME"),
        (("power", "--from", "2", "--to", "1"), "the first instant must not be after the last"),
        (("power", "--from", "90"), "holds no step between 90 and inf s"),
        (("envelope", "--from", "90"), "no links of 'left_track' were recorded between 90 and inf s"),
        (("envelope", "--track", "middle"), "has no track 'middle'"),
        (("fatigue", "--sn", "100e6"), "--sn 100e6: must be"),
        (("fatigue", "--sn", "100e6,-1,3"), "cycles = -1: must be greater than 0"),
        (("envelope", "--signal", "link[*].wheels.force"), "group 'wheels' of track.link_outputs"),
        (("power", "-o", "p.txt"), "its name must end in .csv"),
        (("power", "-o", "nowhere/p.csv"), "there is no folder"),
    ],
)
def test_analyse_refuses_in_one_sentence(cotrack, driven, tmp_path, arguments, sentence):
    status, out, err = cotrack("analyse", driven, *arguments)
    assert (status, out) == (2, "")
    assert sentence in err
    assert err.count("\n") == 1
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize(
    "options",
    [
        ("left_track.link[*].tension",),
        ("left_track.tension.max", "left_track.speed", "chassis.speed"),
        ("left_track.link[*].tension", "--waterfall"),
        ("left_track.link[*].tension", "--place"),
        ("left_track.link[*].tension", "--spectrum", "--waterfall"),
        ("left_track.tension.max", "--order"),
    ],
)
def test_plot_draws_every_kind(cotrack, driven, tmp_path, options):
    status, out, err = cotrack("plot", driven, *options, "-o", "a.png")
    assert (status, out, err) == (0, "a.png\n", "")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert [file.name for file in tmp_path.iterdir()] == ["a.png"]


def test_curves_of_long_records_are_thinned_as_those_of_the_page(tmp_path):
    t = np.arange(20_001) * STEP
    values = np.sin(3.0 * t)
    values[7777], values[12345] = 9.0, -8.0
    rows = {"/track/out": (t, np.stack([values, t], axis=1))}
    path = made(tmp_path / "s.mcap", {"/track/out": [("force", "N"), ("travel", "m")]}, rows)
    with Log(path) as log:
        (curve,) = signal_picture._curves(RunData(log), ["track.force"], EVER, False, False, 0, False)
    assert (curve.x[curve.y.argmax()], curve.x[curve.y.argmin()]) == (t[7777], t[12345]), "wrong instants"
    assert {*zip(curve.x, curve.y, strict=True)} <= {*zip(t, values, strict=True)}
    same = TimeEnvelope(0.0, float(t[-1]), 1, signal_picture.CURVE)
    same.add(t, values[:, None])
    assert np.array_equal(curve.x, same.curve(0).t)
    assert np.array_equal(curve.y, same.curve(0).y)


def test_plot_of_several_logs_names_them(cotrack, driven, spinning, tmp_path):
    status, _, err = cotrack("plot", driven, spinning, "*.tension.max", "-o", "a.svg")
    assert (status, err) == (0, "")
    text = (tmp_path / "a.svg").read_text()
    assert "left_track.tension.max, driven" in text
    assert "tension.max, spinning" in text


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("-o", "a.png"), "plot needs a signal"),
        (("left_track.nothing", "-o", "a.png"), "has no signal 'left_track.nothing'"),
        (("left_track.speed", "-o", "a.bmp"), "its name must end in .png, .svg or .pdf"),
        (("left_track.speed", "--waterfall", "-o", "a.png"), "is no family of signals"),
        (("chassis.left.suspension[*].force", "--place", "-o", "a.png"), "of no link or pin of a track"),
        (("left_track.link[*].tension", "--place", "--order", "-o", "a.png"), "drawn over time"),
        (("left_track.speed", "--from", "9", "-o", "a.png"), "no records on /left_track/out"),
    ],
)
def test_plot_refuses_in_one_sentence(cotrack, driven, tmp_path, arguments, sentence):
    status, out, err = cotrack("plot", driven, *arguments)
    assert (status, out) == (2, "")
    assert sentence in err
    assert not [*tmp_path.iterdir()]


def test_what_is_no_log_is_told(cotrack):
    status, _, err = cotrack("plot", "left_track.speed")
    assert status == 2
    assert "plot needs a log" in err


# cells of a notebook

CELL = """import orchestrator as cotrack
found = cotrack.analyse({path!r}, {what!r}, {window}{options})
table = found.table().frame()"""
OPTIONS = {"spectrum": ", signals='left_track.tension.max'"}


@pytest.mark.parametrize("what", ANALYSES)
def test_every_analysis_takes_three_lines_of_a_notebook(driven, what):
    cell = CELL.format(path=str(driven), what=what, window=(0.05, 0.2), options=OPTIONS.get(what, ""))
    names = {}
    exec(cell, names)
    assert len(cell.splitlines()) == 3
    assert len(names["table"]) == len(names["found"].table().rows) > -(what in ("events", "validity"))
    assert list(names["table"].columns) == [column.key for column in names["found"].table().columns]


@pytest.mark.parametrize(("what", "analysis"), ANALYSES.items())
def test_what_is_declared_is_what_an_analysis_takes(what, analysis):
    module = module_of(what)
    for function, options in (
        (module.of, analysis.options),
        (getattr(module, "picture", None), analysis.picture_options),
    ):
        names = set(inspect.signature(function).parameters) if function else set()
        assert {option.name for option in options} <= names
    assert hasattr(module, "summary") <= analysis.full_series or what == "links"


def test_an_analysis_takes_one_module_and_one_entry(cotrack, driven, monkeypatch):
    class Toy(NamedTuple):
        def table(self):
            return Table.of("toy", (("weight", "N"),), [(1.5,)])

    of = SimpleNamespace(of=lambda run, window, track="": Toy())
    monkeypatch.setitem(sys.modules, "orchestrator.results.analyses.toy", of)
    monkeypatch.setitem(ANALYSES, "toy", Analysis("weighs", (TRACK,)))
    status, out, _ = cotrack("analyse", driven, "toy", "--track", "left_track")
    assert status == 0
    assert "weight, N\n      1.5" in out
    status, _, err = cotrack("analyse", driven, "toy", "--teeth")
    assert (status, err) == (2, "cotrack: --teeth is an option of events, not of toy\n")


def test_a_cell_that_asks_for_nothing_we_know_is_told(driven):
    with pytest.raises(BadInput, match="no analysis 'weather': one of power, spectrum"):
        analyse(driven, "weather")
