"""The energy balance: rotations between quaternions, ports, integrals of the components."""

from itertools import pairwise

import numpy as np
import pytest
from made_logs import made
from scipy.spatial.transform import Rotation

from orchestrator.cosim.coupling.tracks_first import Coupling as TracksFirst
from orchestrator.execution.simulate import simulate
from orchestrator.execution.summary import balance, energy_warning, other_tension, other_vehicles
from orchestrator.log.reader import Log
from orchestrator.results.energy import ledger, rotation_vectors
from orchestrator.results.measures import FIGURES
from orchestrator.results.run_data import EVER, RunData
from orchestrator.scene.scene import load


def quaternions(rotations):
    return rotations.as_quat(scalar_first=True)


def test_turns_are_rotation_vectors_in_the_world():
    vectors = np.array([[0.0, 0.02, 0.0], [0.01, -0.3, 0.2], [0.0, 0.0, 0.0], [1e-9, 0.0, 0.0], [0.0, 2.9, 0.0]])
    rotation = Rotation.from_rotvec([0.3, -1.0, 2.0])
    orientations = [quaternions(rotation)]
    for vector in vectors:
        rotation = Rotation.from_rotvec(vector) * rotation
        orientations.append(quaternions(rotation))
    q = np.array(orientations)
    np.testing.assert_allclose(rotation_vectors(q), vectors, atol=1e-12)
    q[2] *= -1.0  # the same rotation
    np.testing.assert_allclose(rotation_vectors(q), vectors, atol=1e-12)


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """A log of a vehicle that drives off at once, for half a second."""
    settings = ["run.stop=0.5 s", "drive.ramp_start=0 s", "drive.ramp_time=0.5 s", "drive.speed=2 rad/s"]
    path = tmp_path_factory.mktemp("energy") / "driven.mcap"
    result = simulate(load("straight", "flexible", settings), path)
    assert result["message"] == ""
    return path


def test_work_at_the_ports_is_what_the_components_received(driven):
    """By the integrals of chassis and drives; every wheel and mount is a port; causes are all that is dissipated."""
    with Log(driven) as log:
        run = RunData(log)
        books, energy_ports = ledger(run), run.ports

        def change(name):
            values = run.signal(name)[1]
            return values[-1] - values[0]

        received = change("chassis.port.work")
        stored = sum(change(f"chassis.energy.{part}") for part in ("kinetic", "gravity", "spring", "dissipated"))
        scale = abs(received) + abs(books.work)
        assert books.integration["chassis"] == pytest.approx(received - stored, abs=1e-3 * scale)
        for name in run.instances:
            assert abs(books.integration[name]) < 0.02 * scale, name
        assert abs(books.port) < 0.02 * scale
    assert len(energy_ports) == 2 * (1 + 6 + 1)
    assert ("left_track", "sprocket", "left_drive", "sprocket") in energy_ports
    assert ("right_drive", "mount", "chassis", "right.sprocket") in energy_ports
    assert sum(books.causes.values()) == pytest.approx(books.dissipated, rel=1e-9)
    assert {"ground_friction", "wheel_damping", "tooth_friction", "chassis"} <= set(books.causes)
    assert sum(books.causes.values()) - books.causes["ground_friction"] != pytest.approx(books.dissipated, rel=1e-3)


def test_a_lost_force_shows_in_the_books(driven, scaled):
    with Log(driven) as log:
        whole = ledger(RunData(log))
        scaled(log, "/chassis/in", "left.road_wheel[3].force.z", 0.95)
        broken = ledger(RunData(log))
    assert abs(broken.integration["chassis"] - whole.integration["chassis"]) > 100.0 * abs(whole.integration["chassis"])


def wired(run, source, target, **pairs):
    """The run with a further connection; __ in a name is a dot."""
    dotted = {output.replace("__", "."): into for output, into in pairs.items()}
    added = {"source": source, "outputs": [*dotted], "target": target, "inputs": [*dotted.values()]}
    run.system = run.system | {"connections": [*run.system["connections"], added]}
    return run


def test_a_torque_apart_from_its_force_leaves_no_balance_and_the_summary_says_why(driven):
    """A drive that also pulled on the hitch, and one that turned a wheel of the hull: no port joins the two."""
    with Log(driven) as log:
        run = wired(RunData(log), "left_drive", "chassis", mount__force__x="hitch.force.x")
        run = wired(run, "left_drive", "chassis", mount__torque__x="left.idler.torque.x")
        assert run.ports == RunData(log).ports
        found = balance(run)
        assert found["energy"] is None
        assert found["energy_missing"].startswith(
            "the work of left_drive.mount.torque.x -> chassis.left.idler.torque.x is"
        )
        assert balance(RunData(log))["energy_missing"] == ""


@pytest.mark.parametrize(("changes", "said"), [
    ({}, True),
    ({"start": {"equilibrium": {"tracks": [{"tension": 10.3e3}, {"tension": 10.6e3}], "height": 0.0}}}, False),
    ({"start": {"equilibrium": None}}, False),  # as drawn
    ({"ground": {"soil": {"name": "dry_sand"}}}, False),
    ({"ground": {"grade": 0.3}}, False),
    ({"vehicle": {"track": {"tension": 10e3}, "right": {"track": {"tension": 20e3}}}}, False),
])  # fmt: skip
def test_another_tension_than_is_asked_is_said(changes, said):
    """Of a start on level, hard ground by more than 5 %."""
    tracks = [{"tension": tension, "sag": 0.1, "loads": (), "others": {}} for tension in (10.4e3, 10.7e3)]
    rest = {"tracks": tracks, "height": -0.1}
    standing = rest | {"drawn": [9e3], "why": ""}
    scene = {
        "standing": standing,
        "start": {"equilibrium": rest},
        "vehicle": {"track": {"tension": 10e3}},
        "ground": {},
    }
    for key, value in changes.items():
        if (equilibrium := value.get("equilibrium")) is not None:
            value = {"equilibrium": equilibrium | {"tracks": [tracks[0] | each for each in equilibrium["tracks"]]}}
        scene[key] = value
    told = "tracks carry 10.55 kN at the start, where vehicle.track.tension = 10 kN is asked: the links come to rest"
    assert [text.startswith(told) for text in other_tension(scene)] == [True] * said


def test_figures_are_those_of_one_vehicle(driven):
    """A further vehicle, whose chassis has another name, adds nothing to what the ground carries, and is told."""
    with Log(driven) as log:
        run, both = RunData(log), RunData(log)
        ends = {"left_track": "a_track", "right_track": "b_track", "chassis": "hull"}
        other = [one | {end: ends.get(one[end], f"other_{one[end]}") for end in ("source", "target")}
                 for one in run.system["connections"]]  # fmt: skip
        both.system = run.system | {"connections": [*other, *run.system["connections"]]}
        both.all_tracks = ("a_track", "left_track", "b_track", "right_track")
        assert both.tracks == run.tracks == ("left_track", "right_track")
        assert FIGURES["ground_force"](both, "", EVER) == FIGURES["ground_force"](run, "", EVER)
        told = "figures are those of the vehicle of left_track and right_track: a_track and b_track are of another one"
        assert (other_vehicles(both), other_vehicles(run)) == ([told], [])
        both.__dict__.pop("tracks")
        both.__dict__["ports"] = ()
        assert both.tracks == both.all_tracks, "in a system without ports all are one"


@pytest.mark.long
def test_what_the_ledger_leaves_open_falls_with_the_step(tmp_path):
    """The ledger's residual falls with the step at order one, that of the dampers' rates in a track.

    The ports' part has the order of the coupling. Without the covering losses the residual tends to 0.26 J.
    """
    books = []
    for step in ("0.25 ms", "0.125 ms"):
        settings = ["run.stop=0.06 s", f"run.step={step}", f"track.step={step}"]
        books.append(simulate(load("settle", "rigid", settings), tmp_path / f"{step}.mcap")["energy"])

    def slope(of: list[float]) -> float:
        return float(np.log2(of[0] / of[1]))

    assert slope([one["port"] for one in books]) == pytest.approx(TracksFirst.ORDER, abs=0.1)
    assert slope([one["residual"] for one in books]) == pytest.approx(1.0, abs=0.12)
    assert slope([one["residual"] + one["covered"] for one in books]) < 0.6


def jumped(tmp_path, step, stop):
    """Energy balance of a rig whose sprocket jumps to 20 rad/s at once."""
    settings = [f"run.stop={stop}", f"run.step={step}", f"track.step={step}", "drive.ramp_time=0", "drive.speed=20"]
    return simulate(load("rig", "rigid", settings), tmp_path / f"{step}-{stop}.mcap")["energy"]


def test_the_impact_of_a_speed_that_jumps_is_open_at_order_two(tmp_path):
    """The residual of a speed jump has order two in the first 10 ms, where pins rebound from the teeth.

    Pins that it presses 51 mm into the teeth in 50 ms, where the nearest face changes, keep their energy.
    """
    books = [jumped(tmp_path, step, "10 ms") for step in ("0.5 ms", "0.25 ms", "0.125 ms")]
    rates = np.log2([abs(a["residual"] / b["residual"]) for a, b in pairwise(books)])
    assert np.abs(rates - 2.0).max() < 0.3, rates
    assert abs(books[0]["residual_relative"]) < 2e-3
    for step in ("0.25 ms", "0.125 ms"):
        later = jumped(tmp_path, step, "50 ms")
        assert abs(later["residual_relative"]) < 1e-3
        assert 0.02 * later["dissipated"] > 2e-3 * abs(later["work"])  # 2 % of the losses would be seen


def booked(path, **energies):
    """Energy balance of a log whose components hold the given energies (kind -> (m,)) over time."""
    topics, rows = {}, {}
    for name, kinds in energies.items():
        topics |= {f"/{name}/in": [("u", "1")], f"/{name}/out": [(f"energy.{kind}", "J") for kind in kinds]}
        values = np.stack([*kinds.values()], axis=1)
        t = 0.01 * np.arange(len(values))
        rows |= {f"/{name}/out": (t, values), f"/{name}/in": (t[:-1], np.zeros((len(t) - 1, 1)))}
    made(path, topics, rows, instances=energies, step=0.01)
    with Log(path) as log:
        return ledger(RunData(log))._asdict()


def test_potential_energy_that_comes_back_counts_in_the_scale(tmp_path):
    """1 kJ goes from gravity into a spring and back; 10 J are lost."""
    back = 1000.0 * np.sin(np.linspace(0.0, np.pi, 101)) ** 2
    lost = np.linspace(0.0, 10.0, 101)
    books = booked(tmp_path / "log.mcap", hull={"gravity": 5e6 - back, "spring": back - lost})
    assert books["residual"] == pytest.approx(10.0)
    assert books["residual_relative"] == pytest.approx(0.01, rel=1e-3), "the scale is the remaining energy at the end"
    assert energy_warning(books) == ""


@pytest.mark.parametrize(("opened", "warns"), [(0.06, True), (0.04, False)])
def test_a_heavy_hull_hides_no_error_of_a_track(tmp_path, opened, warns):
    rising = np.linspace(0.0, 1.0, 101)
    fall = 1e12 * rising
    books = booked(
        tmp_path / "log.mcap",
        hull={"kinetic": fall, "gravity": -fall},
        track={"kinetic": 5e3 * rising, "gravity": -(5e3 - 5e3 * opened) * rising},
    )
    assert abs(books["residual_relative"]) < 1e-8
    assert books["integration_relative"]["track"] == pytest.approx(-opened, rel=1e-6)
    assert ("the energy ledger of track leaves 6% open" in energy_warning(books)) == warns
