"""A vehicle with a steering differential: two drives in one, closed powers, keys of a scene."""

import numpy as np
import pytest
from vehicle_in_process import InProcess

from fmus.vehicles.tables import BadInput
from orchestrator.execution import replay_model
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results import difference, turning, vehicle_measures
from orchestrator.results.run_data import Missing, RunData, Window
from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load

QUICK = ("run.stop=1.5 s", "track.link_outputs=false", "drive.ramp_start=0.2 s", "drive.ramp_time=0.8 s")
JOINED = (
    *QUICK, "drive.speed=6", "drive.steering.speed=8", "drive.steering.ramp_start=0.2 s",
    "drive.steering.ramp_time=0.8 s",
)  # fmt: skip


def path(scene, settings, steps):
    """Places, heading and power of all motors (steps, 5), and the vehicle."""
    vehicle = InProcess(load(scene, "rigid", settings))
    rows = []
    for _ in range(steps):
        vehicle.step()
        chassis = vehicle["chassis"]
        motors = [name for name in ("left_drive", "right_drive") if name in vehicle.members]
        power = sum(vehicle[name]["power"] for name in motors)
        if not motors:
            power = sum(vehicle["differential"][f"{motor}.power"] for motor in ("propulsion", "steering"))
        rows.append([*(chassis[f"chassis.position.{axis}"] for axis in "xyz"), chassis["yaw"], power])
    return np.array(rows), vehicle


@pytest.fixture(scope="module")
def to_the_left():
    return path("differential", JOINED, 1200)


@pytest.mark.long
def test_with_prescribed_speeds_it_drives_as_two_drives_do(to_the_left):
    there, _ = to_the_left
    two, _ = path("turn", (*QUICK, "drive.left.speed=2", "drive.right.speed=10"), 1200)
    assert there[-1, 3] > 0.03
    np.testing.assert_allclose(there[:, :4], two[:, :4], atol=1e-9)
    np.testing.assert_allclose(there[:, 4], two[:, 4], atol=1e-4)
    other, _ = path("differential", (*JOINED, "drive.steering.speed=8.2"), 600)
    assert np.abs(other[:, 3] - there[:600, 3]).max() > 1e-4


@pytest.mark.long
def test_steered_the_other_way_it_drives_in_mirror(to_the_left):
    there, _ = to_the_left
    back, _ = path("differential", (*JOINED, "drive.steering.speed=-8"), 1200)
    np.testing.assert_allclose(back * [1.0, -1.0, 1.0, -1.0, 1.0], there, atol=1e-4)
    np.testing.assert_allclose(back[:, :4] * [1.0, -1.0, 1.0, -1.0], there[:, :4], atol=1e-9)


def test_powers_close(to_the_left):
    """The power of the half shafts is that of the motors, and the chains receive it."""
    _, vehicle = to_the_left
    gear = vehicle["differential"]
    given = gear["left.work"] + gear["right.work"]
    assert given == pytest.approx(gear["propulsion.work"] + gear["steering.work"], rel=1e-9)
    assert given == pytest.approx(gear["energy.work"], rel=1e-9)
    assert gear["left.power"] < 0.0 < gear["right.power"]
    assert gear["power.regenerated"] == pytest.approx(-gear["left.power"])
    taken = gear["energy.work"] + gear["port.work"] - gear["energy.dissipated"] - gear["energy.kinetic"]
    assert abs(taken) < 1e-6 * gear["energy.work"]


@pytest.mark.long
def test_its_measures_are_those_of_its_outputs(tmp_path):
    log = tmp_path / "joined.mcap"
    assert simulate(load("differential", "rigid", (*JOINED, "run.stop=1.3 s")), log)["status"] == "ok"
    window = Window(1.1, 1.3)
    with Log(log) as opened:
        run = RunData(opened)
        assert run.sides == ("left", "right")
        for of, name in (("left", "left"), ("right", "right"), ("propulsion", "propulsion"), ("steering", "steering")):
            mean = run.mean(f"differential.{name}.power", window)
            assert turning.drive_power(run, of, window) == pytest.approx(mean, rel=0.02)
        with pytest.raises(Missing, match="'steer': there is that of left, right, propulsion, steering"):
            turning.drive_power(run, "steer", window)
        with np.errstate(invalid="ignore"):
            assert np.isnan(turning.regenerated_power(run, "", Window(1.1, 1.1)))
        torques = dict(difference.observables(run))["torque"].read(run)
        assert torques.values.shape[1] == 2
        taken = turning.regenerated_power(run, "", window)
        assert taken == -turning.drive_power(run, "left", window) > 0.0
        assert vehicle_measures.speed_excess(run, "", window) == pytest.approx(
            run.mean("chassis.speed", window) / (0.242552 * run.mean("differential.propulsion.speed", window)) - 1.0,
            abs=1e-5,
        )
    with replay_model.open_replay(log, "differential", None) as again:
        assert again.verify().difference is None


def test_only_a_differential_regenerates(tmp_path):
    log = tmp_path / "turn.mcap"
    assert simulate(load("turn", "rigid", ("run.stop=0.01 s",)), log)["status"] == "ok"
    with Log(log) as opened, pytest.raises(Missing, match="there is no steering differential"):
        turning.regenerated_power(RunData(opened), "", Window(0.0, 0.01))


@pytest.mark.long
def test_a_driver_steers_by_it_as_by_two_drives():
    brief = ("run.stop=1 s", "driver.ramp_start=0", "driver.ramp_time=0.4 s", "track.link_outputs=false",
             "driver.arcs=[[0.1, 0], [9, 0.2]]")  # fmt: skip
    one, vehicle = path("serpentine", (*brief, "drive.steering.mode=speed"), 1200)
    two, _ = path("serpentine", brief, 1200)
    assert "differential" in vehicle.members
    assert two[-1, 3] > 0.01
    np.testing.assert_allclose(one[:, :4], two[:, :4], atol=1e-9)


def test_nothing_of_it_where_it_is_not_asked_for():
    parts = assemble(placed(load("differential", "rigid"))).parts
    assert {part.kind for part in parts} == {"TrackRigid", "SteeringDifferential", "Chassis"}
    without = load("differential", "rigid", ["drive.steering=false"])
    assert {part.kind for part in assemble(placed(without)).parts} == {"TrackRigid", "SprocketDrive", "Chassis"}
    assert not without.turns
    scene = load("differential", "flexible")
    assert scene.track.axes == "free"
    assert type(scene).model_validate(scene.resolved()) == scene


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        (("drive.left.speed=8",), "left and right exclude steering"),
        (("symmetric=true",), "symmetric = true needs the same drive on both sides"),
        (('tracks=["left"]',), "drive.steering joins both sides, but tracks has no 'right'"),
        (("drive.steering.sped=8",), "unknown key 'drive.steering.sped': did you mean 'drive.steering.speed'?"),
        (("drive.steering.mode=fast",), "drive.steering.mode = 'fast'"),
        (
            ("drive.steering.engine_points=[[0, 1]]",),
            "engine_points = ((0.0, 1.0),) needs mode = 'torque' or 'controller', not 'speed'",
        ),
        (("drive.steering.torque=2 kN m",), "torque = 2000.0 needs mode = 'torque', not 'speed'"),
        (("drive.steering.brake=2 kN m",), "brake = 2000.0 needs mode = 'torque' or 'controller', not 'speed'"),
        (("drive.steering.stop=0.1",), "stop = 0.1 s must not be before the ramp ends, 2 s"),
        (("drive.steering.engine_points=none.csv",), "differential.toml: drive.steering.engine_points = 'none.csv'"),
        (("drive.steering.gear_ratio=3",), "gear_ratio = 3.0 needs engine_points"),
        (("driver={speed=3}", "drive={mode='speed', steering={mode='torque'}}"), "drive.steering.mode = 'torque'"),
    ],
)
def test_what_cannot_be_joined_is_a_sentence(settings, sentence):
    with pytest.raises(BadInput) as refused:
        load("differential", "flexible", settings)
    assert sentence in str(refused.value)
