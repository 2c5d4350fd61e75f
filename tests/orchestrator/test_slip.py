"""The two slips of a track: one sign and one figure either way, on any heading and slope, for any vehicle."""

import numpy as np
import pytest
from made_logs import made

from orchestrator.execution import summary, summary_text
from orchestrator.log.reader import Log
from orchestrator.results import turning, vehicle_measures
from orchestrator.results.analyses import phases, slip
from orchestrator.results.run_data import Missing, RunData, Window
from orchestrator.results.units import finite
from orchestrator.scene.scene import load

T = 0.01 * np.arange(301)
WINDOW = Window(1.0, 3.0)
SPEED, SLIP, PADS = 2.0, 0.12, 0.1  # m/s of the chain; slip and pad slip of a driving track
POSE = [f"chassis.{part}.{axis}" for part in ("position", "velocity", "angular_velocity") for axis in "xyz"]
OUT = {
    "chassis": ["yaw", "speed", *POSE],
    "track": ["travel", "speed", "slip", "tension.max", *(f"ground.force.{axis}" for axis in "xyz")],
    "drive": ["speed", "energy.work"],
}
JOINT = {"outputs": ["sprocket.force.x", "sprocket.torque.x"], "inputs": ["sprocket.force.x", "sprocket.torque.x"]}


def recorded(path, scene, chain, hull, pads, heading=0.0, grade=0.0, turned=None, yaw_rate=0.0):
    """Log of a vehicle whose chains run at ``chain`` m/s, its hull at ``hull``, its pads rearwards at ``pads``."""
    table = load(scene, "rigid", [f"ground.grade={grade}"] if grade else []).resolved() | {"run": {"step": 0.01}}
    vehicle, whole = table["vehicle"], np.ones(len(T))
    ahead = np.array([np.cos(heading), np.sin(heading), grade * np.cos(heading)])
    ahead /= np.linalg.norm(ahead)
    up = np.array([-grade, 0.0, 1.0]) / np.hypot(grade, 1.0)
    turned = chain if turned is None else turned
    omega = 2.0 * np.pi * turned / (vehicle["sprocket"]["teeth"] * vehicle["track"]["pitch"])
    motion = [*np.outer([5.0, -2.0, 0.4], whole), *np.outer(ahead, hull * whole), *np.outer(yaw_rate * up, whole)]
    rows = {"/chassis/out": np.stack([heading * whole, hull * whole, *motion])}
    sides = ("left",) if table["symmetric"] else ("left", "right")
    for side in sides:
        force = np.outer(3e3 * ahead * np.sign(chain) + 2e4 * up, whole)
        rows[f"/{side}_track/out"] = np.stack([chain * T, chain * whole, pads * whole, 1e4 * whole, *force])
        rows[f"/{side}_drive/out"] = np.stack([omega * whole, 1e3 * T])
    topics = {topic: [(name, "1") for name in OUT[topic.split("/")[1].split("_")[-1]]] for topic in rows}
    joints = [{"source": f"{side}_track", "target": f"{side}_drive", **JOINT} for side in sides]
    instances = [topic.split("/")[1] for topic in rows]
    return made(path, topics, {topic: (T, values.T) for topic, values in rows.items()}, table, instances, joints)


def driving(path, scene, way, heading=0.0, grade=0.0, hull=1.0):
    """Log of a vehicle that drives at SLIP, forwards or backwards; the hull's speed may be off."""
    return recorded(
        path, scene, way * SPEED, way * hull * (1.0 - SLIP) * SPEED, way * PADS * SPEED, heading=heading, grade=grade
    )


@pytest.mark.parametrize("scene", ["straight", "robot", "marder", "rear_drive"])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_slips_are_the_same_either_way_on_any_heading_and_slope(tmp_path, scene, way):
    for k, (heading, grade) in enumerate([(0.0, 0.0), (0.5 * np.pi, 0.0), (2.5, 0.3), (0.5 * np.pi, 0.3)]):
        with Log(driving(tmp_path / f"{k}.mcap", scene, way, heading, grade)) as log:
            run = RunData(log)
            for row in slip.of(run).table().records():
                assert row["slip"] == pytest.approx(100.0 * SLIP)
                assert row["pad slip"] == pytest.approx(100.0 * PADS)
                assert row["pads"] == pytest.approx(PADS * SPEED)
                assert row["thrust"] == pytest.approx(3.0 * way)
            assert vehicle_measures.slip(run, "", WINDOW) == pytest.approx(SLIP)
            assert vehicle_measures.pad_slip(run, "left", WINDOW) == pytest.approx(PADS)
            assert vehicle_measures.speed_excess(run, "", WINDOW) == pytest.approx(-SLIP)
            assert turning.track_slip(run, "left", WINDOW) == pytest.approx(PADS * SPEED)
            (phase,) = phases.of(run).phases
            assert phase.slip_left == pytest.approx(PADS * SPEED)
    with Log(driving(tmp_path / "twin.mcap", scene, way, hull=1.03)) as log:
        assert vehicle_measures.slip(RunData(log), "", WINDOW) < 0.8 * SLIP


def test_the_tracks_of_a_turn_have_slips_of_their_own(tmp_path):
    """Each beside the speed of the hull over it: the inner one brakes."""
    path = recorded(tmp_path / "turn.mcap", "turn", 2.0, 2.0, 0.0, yaw_rate=0.3)
    with Log(path) as log:
        run = RunData(log)
        arm = run.scene["vehicle"]["track"]["lateral"]
        rows = slip.of(run).table().records()
        assert [row["slip"] for row in rows] == pytest.approx([15.0 * arm, -15.0 * arm])
        assert vehicle_measures.slip(run, "right", WINDOW) == pytest.approx(-0.15 * arm)


@pytest.mark.parametrize(
    ("chain", "hull", "pads"),
    [
        (0.0, -3.8, -3.8),  # locked; it slides backwards
        (1e-14, -3.8, -3.8),
        (0.5, 3.8, -3.3),  # nearly locked
        (-0.5, -3.8, -3.3),
        (0.0, 0.0, 0.0),
        (0.02, 0.02, 0.0),
    ],
)
def test_a_chain_that_stands_has_the_velocity_of_its_pads_and_no_share(tmp_path, chain, hull, pads):
    """Negative, as a track that brakes has it."""
    rearwards = pads if hull > 0.0 else -pads
    scene = load("hold", "rigid")
    with Log(recorded(tmp_path / "held.mcap", "hold", chain, hull, rearwards)) as log:
        run = RunData(log)
        found = summary.observables(run, scene, T[-1])
        for measure in (
            vehicle_measures.slip,
            vehicle_measures.pad_slip,
            *[vehicle_measures.speed_excess] * (abs(chain) < 0.05),
        ):
            with pytest.raises(Missing, match="stand"):
                measure(run, "", WINDOW)
        text = str(slip.of(run).table())
    assert finite({name: found[name] for name in ("slip", "pad_slip")}) == {"slip": None, "pad_slip": None}
    assert found["pad_velocity"] == pytest.approx(pads)
    entry = summary.empty("hold", "rigid") | {"observables": found, "simulated_time": T[-1]}
    (line,) = [line for line in summary_text.lines(entry) if "pads" in line]
    assert f"pads slide at {pads:.3g} m/s" in line
    assert "%" not in line
    assert text.splitlines()[2].split()[1:3] == ["-", "-"]


def test_a_chain_that_runs_shows_its_slips_instead(tmp_path):
    with Log(driving(tmp_path / "run.mcap", "hold", -1.0, grade=0.2)) as log:
        found = summary.observables(RunData(log), load("hold", "rigid"), T[-1])
    text = "\n".join(summary_text.lines(summary.empty("hold", "rigid") | {"observables": found, "simulated_time": 3.0}))
    assert "slip 12 %, slip of the pads 10 %" in text
    assert "pads slide" not in text


def test_a_sprocket_that_turns_beside_its_chain_counts_in_the_slip(tmp_path):
    """Slip is that of the sprocket's pitches, pad slip that of the chain."""
    path = recorded(tmp_path / "jumps.mcap", "straight", 2.0, 1.8, 0.2, turned=3.0)
    with Log(path) as log:
        run = RunData(log)
        assert vehicle_measures.slip(run, "", WINDOW) == pytest.approx(1.0 - 1.8 / 3.0)
        assert vehicle_measures.pad_slip(run, "", WINDOW) == pytest.approx(0.1)
