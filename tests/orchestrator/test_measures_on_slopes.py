"""Measures along the ground: on a slope those of level ground, with gravity tilted; slips either way, any heading."""

from types import SimpleNamespace

import numpy as np
import pytest
from made_logs import made

from orchestrator.execution import summary, summary_text
from orchestrator.execution.log_report import report
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results import turning, vehicle_measures
from orchestrator.results.analyses import phases, slip
from orchestrator.results.analyses.validity import of as validity
from orchestrator.results.ground_under_vehicle import ground_axes
from orchestrator.results.run_data import RunData, Window
from orchestrator.results.units import finite
from orchestrator.results.validity import track_checks
from orchestrator.scene.scene import load

STOP = 0.03
WINDOW, LAST = Window(0.01, STOP), Window(0.02, STOP)
WEIGHT = 155896.4  # N
GRADE, BANK, HEADING = 0.2, 0.1, 0.4
NORMAL = np.array([-GRADE, -BANK, 1.0]) / np.sqrt(1.0 + GRADE**2 + BANK**2)
SLOPE = ("ground.grade=0.2", "ground.bank=0.1")
START = (
    f"run.stop={STOP}",
    "run.step=1 ms",
    f"start.heading={HEADING}",
    "start.position=[1.0, -2.0, 0.3]",
    "expect={}",
)


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Runs of a vehicle that stands in equilibrium: on a slope, and on level ground."""
    folder = tmp_path_factory.mktemp("slopes")
    for name, settings in (("slope", SLOPE), ("level", ())):
        summary = simulate(load("straight", "rigid", (*START, *settings)), folder / f"{name}.mcap")
        assert (summary["status"], summary["warnings"], summary["validity"]) == ("ok", [], [])
    return folder


@pytest.fixture
def runs(logs):
    with Log(logs / "slope.mcap") as slope, Log(logs / "level.mcap") as level:
        yield RunData(slope), RunData(level)


@pytest.mark.long
def test_thrust_and_load_are_the_weight_along_and_across_the_slope(runs):
    slope, _ = runs
    weight = WEIGHT * np.array([0.0, 0.0, -1.0])
    forces = slip.of(slope, LAST)
    assert forces.load.sum(axis=1).mean() == pytest.approx(-weight @ NORMAL, rel=1e-3)
    held = np.hypot(forces.thrust.sum(axis=1), forces.lateral.sum(axis=1)).mean()
    assert held == pytest.approx(np.linalg.norm(weight - weight @ NORMAL * NORMAL), rel=0.03)
    assert turning.propulsion(slope, "left", LAST) == pytest.approx(forces.thrust[:, 0].mean(), rel=1e-3)
    slope.scene["ground"].update(grade=0.0, bank=0.0)  # twin: by the vertical
    assert slip.of(slope, LAST).load.sum(axis=1).mean() > 1.02 * -weight @ NORMAL


def test_springs_settle_and_chains_hang_as_on_level_ground(runs):
    slope, level = runs
    value, flat = (vehicle_measures.settlement_of_springs(run, "", WINDOW) for run in runs)
    assert 0.9 * flat < value < 1.1 * flat
    of_contacts = vehicle_measures.settlement_of_contacts
    assert 0.9 < of_contacts(slope, "", WINDOW) / of_contacts(level, "", WINDOW) < 1.1
    assert chains_apart(slope, level) < 0.04  # strands sag less where the brakes hold the vehicle
    slope.scene["ground"].update(grade=0.0, bank=0.0)  # twin: by the vertical
    assert not 0.9 * flat < vehicle_measures.settlement_of_springs(slope, "", WINDOW) < 1.1 * flat
    with Log(slope.log.path) as log:
        upright = RunData(log)
        upright.scene["ground"].update(grade=0.0, bank=0.0)
        assert chains_apart(upright, level) > 0.5


def chains_apart(slope, level):
    """Largest distance of pins in the planes of their tracks, m."""
    one, other = (run.links("left_track", WINDOW) for run in (slope, level))
    return float(np.hypot(one.forward - other.forward, one.up - other.up).max())


def test_settlement_on_a_slope_is_that_on_level_ground_and_none_where_the_ground_is_uneven(runs):
    """In the summary too, where the height that a vehicle climbs was shown as a settlement."""
    slope, level = runs
    on_slope, flat = (vehicle_measures.settlement(run, "", WINDOW) for run in runs)
    assert on_slope == pytest.approx(flat, rel=0.05)
    assert flat == level.mean("chassis.settlement", WINDOW)
    plane, scene = slope.scene["ground"], load("straight", "rigid", START)
    step = {"step": {"x": [9.0], "rise": 0.1, "radius": 0.02}}
    others = {"incline_start": 3.0}, {"rough": {"seed": 1}}, {"bump": {"start": 5.0}}, {"trench": {"x": 5.0}}, step
    for uneven in others:
        slope.scene["ground"] = plane | uneven
        for measure in (vehicle_measures.settlement_of_contacts, vehicle_measures.settlement):
            with pytest.raises(LookupError):
                measure(slope, "", WINDOW)
    for ground, known in ((plane, True), (plane | step, False)):
        slope.scene["ground"] = ground
        assert (summary.observables(slope, scene, STOP)["settlement"] > 0.0) == known


@pytest.mark.parametrize("further", [{}, {"rear": {"x": -9.0}}])
def test_the_plane_under_a_vehicle_is_that_under_all_its_wheels(further):
    """On a ground with the height of a parabola; return rollers do not touch it. The twin has no further wheel."""
    table = {
        "chassis": {"centre": [-2.0, 0.0, 0.0]}, "track": {"lateral": 1.0}, "road_wheel": {"x": [-1.0, -3.0]},
        "idler": {"x": -4.5}, "wheel": further, "return_roller": {"x": [-2.0]},
    }  # fmt: skip
    surface = SimpleNamespace(height_under=lambda places: 0.01 * places[..., 0] ** 2)
    scene = {"ground": {"washboard": {"start": 0.0}}, "vehicle": table}
    run = SimpleNamespace(scene=scene, compute_once=lambda *_: surface)
    along, _, _ = ground_axes(run, np.zeros((1, 3)))
    x = np.array([0.0, -1.0, -3.0, -4.5, *(wheel["x"] for wheel in further.values())]) + 2.0
    assert along[0, 2] / along[0, 0] == pytest.approx(np.polyfit(x, 0.01 * x**2, 1)[0])


def test_creep_counts_where_the_least_friction_could_hold(runs):
    slope, _ = runs
    assert track_checks.least_friction(slope) == 0.3
    everywhere = {"x": [-9.0, 9.0], "y": [-9.0, 9.0]}
    slope.scene["ground"]["friction"] = [
        {**everywhere, "factor": 0.5, "coefficient": None}, {**everywhere, "factor": None, "coefficient": 0.2},
    ]  # fmt: skip
    assert track_checks.least_friction(slope) == 0.15


def test_a_slope_has_a_page_without_warnings(runs, tmp_path):
    assert validity(runs[0]).entries == ()
    report(runs[0].log.path, tmp_path / "page.html")
    html = (tmp_path / "page.html").read_text()
    assert "along the normal of the ground at the start" in html
    assert "Lifted off" not in html


# --- turns ------------------------------------------------------------------------------------------


class Turning:
    """Recorded circle of a radius on the slope, anticlockwise about its normal."""

    radius, rate = 10.0, 0.3

    def __init__(self, scene):
        self.scene, self.tracks = scene, ()
        east = np.cross([0.0, 1.0, 0.0], NORMAL)
        east = east / np.linalg.norm(east)
        north = np.cross(NORMAL, east)
        self.t = np.linspace(0.0, 2.0 * np.pi / self.rate, 2001)
        c, s = np.cos(self.rate * self.t)[:, None], np.sin(self.rate * self.t)[:, None]
        velocity = self.radius * self.rate * (c * north - s * east)
        self.values = {
            "position": self.radius * (c * east + s * north), "velocity": velocity,
            "angular_velocity": np.tile(self.rate * NORMAL, (len(self.t), 1)),
        }  # fmt: skip
        self.yaw = np.arctan2(velocity[:, 1], velocity[:, 0])

    def compute_once(self, name, make):
        return make(self)

    def signal(self, name, window):
        if name == "chassis.yaw":
            return self.t, self.yaw
        part, _, axis = name.removeprefix("chassis.chassis.").rpartition(".")
        return self.t, self.values[part][:, "xyz".index(axis)]

    def mean(self, name, window):
        return float(self.signal(name, window)[1].mean())


def test_a_circle_on_a_slope_has_its_radius(runs):
    run = Turning(runs[0].scene)
    assert turning.turn_radius(run, "", WINDOW) == pytest.approx(10.0, rel=1e-9)
    assert turning.lateral_speed(run, "", WINDOW) == pytest.approx(0.0, abs=1e-9)
    assert turning.rotation_centre(run, "", WINDOW) == pytest.approx(0.0, abs=1e-8)
    assert turning.yaw_rate(run, "", WINDOW) == pytest.approx(0.3 * NORMAL[2], rel=1e-9)  # about the vertical
    level = Turning(runs[1].scene)
    assert abs(turning.turn_radius(level, "", WINDOW) / 10.0 - 1.0) > 1e-3


# --- slips: one sign and one figure either way, for any vehicle ---------------------------------------

T = 0.01 * np.arange(301)
DRIVEN = Window(1.0, 3.0)
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
    speeds = way * np.array([1.0, hull * (1.0 - SLIP), PADS]) * SPEED
    return recorded(path, scene, *speeds, heading=heading, grade=grade)


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
            assert vehicle_measures.slip(run, "", DRIVEN) == pytest.approx(SLIP)
            assert vehicle_measures.pad_slip(run, "left", DRIVEN) == pytest.approx(PADS)
            assert vehicle_measures.speed_excess(run, "", DRIVEN) == pytest.approx(-SLIP)
            assert turning.track_slip(run, "left", DRIVEN) == pytest.approx(PADS * SPEED)
            (phase,) = phases.of(run).phases
            assert phase.slip_left == pytest.approx(PADS * SPEED)
    with Log(driving(tmp_path / "twin.mcap", scene, way, hull=1.03)) as log:
        assert vehicle_measures.slip(RunData(log), "", DRIVEN) < 0.8 * SLIP


def test_the_tracks_of_a_turn_have_slips_of_their_own(tmp_path):
    """Each beside the speed of the hull over it: the inner one brakes.

    Slip is that of the sprocket's pitches, pad slip that of the chain: a sprocket may turn beside it.
    """
    with Log(recorded(tmp_path / "turn.mcap", "turn", 2.0, 2.0, 0.0, yaw_rate=0.3)) as log:
        run = RunData(log)
        arm = run.scene["vehicle"]["track"]["lateral"]
        assert [row["slip"] for row in slip.of(run).table().records()] == pytest.approx([15.0 * arm, -15.0 * arm])
        assert vehicle_measures.slip(run, "right", DRIVEN) == pytest.approx(-0.15 * arm)
    with Log(recorded(tmp_path / "jumps.mcap", "straight", 2.0, 1.8, 0.2, turned=3.0)) as log:
        assert vehicle_measures.slip(RunData(log), "", DRIVEN) == pytest.approx(1.0 - 1.8 / 3.0)
        assert vehicle_measures.pad_slip(RunData(log), "", DRIVEN) == pytest.approx(0.1)


@pytest.mark.parametrize(("chain", "hull", "pads"), [
    (0.0, -3.8, -3.8), (1e-14, -3.8, -3.8),  # locked; it slides backwards
    (0.5, 3.8, -3.3), (-0.5, -3.8, -3.3),  # nearly locked
    (0.0, 0.0, 0.0), (0.02, 0.02, 0.0),
])  # fmt: skip
def test_a_chain_that_stands_has_the_velocity_of_its_pads_and_no_share(tmp_path, chain, hull, pads):
    """Negative, as a track that brakes has it."""
    rearwards = pads if hull > 0.0 else -pads
    scene = load("hold", "rigid")
    with Log(recorded(tmp_path / "held.mcap", "hold", chain, hull, rearwards)) as log:
        run = RunData(log)
        found = summary.observables(run, scene, T[-1])
        stands = [vehicle_measures.speed_excess] * (abs(chain) < 0.05)
        for measure in (vehicle_measures.slip, vehicle_measures.pad_slip, *stands):
            with pytest.raises(LookupError, match="stand"):
                measure(run, "", DRIVEN)
        text = str(slip.of(run).table())
    assert finite({name: found[name] for name in ("slip", "pad_slip")}) == {"slip": None, "pad_slip": None}
    assert found["pad_velocity"] == pytest.approx(pads)
    windows = summary.windows(found, scene, T[-1])
    entry = summary.empty("hold", "rigid") | {"observables": found, "windows": windows, "simulated_time": T[-1]}
    (line,) = [line for line in summary_text.lines(entry) if "pads" in line]
    assert line.split() == ["pads", "slide", "at", f"{pads:.3g}", "m/s"]
    assert "%" not in line
    assert text.splitlines()[2].split()[1:3] == ["-", "-"]


def test_a_chain_that_runs_shows_its_slips_instead(tmp_path):
    with Log(driving(tmp_path / "run.mcap", "hold", -1.0, grade=0.2)) as log:
        found = summary.observables(RunData(log), scene := load("hold", "rigid"), T[-1])
    entry = {"observables": found, "windows": summary.windows(found, scene, T[-1]), "simulated_time": 3.0}
    text = [" ".join(line.split()) for line in summary_text.lines(summary.empty("hold", "rigid") | entry)]
    assert {"slip 12 %", "slip of the pads 10 %"} < {*text}
    assert not any("pads slide" in line for line in text)
