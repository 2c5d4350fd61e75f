"""Measures and analyses along the ground: on a slope they are those of level ground, with gravity tilted."""

import numpy as np
import pytest

from orchestrator.execution import summary
from orchestrator.execution.log_report import _judge
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results import turning, vehicle_measures
from orchestrator.results.analyses import slip
from orchestrator.results.analyses.validity import of as validity
from orchestrator.results.ground_under_vehicle import component, ground_axes, split
from orchestrator.results.page.document import document
from orchestrator.results.page.evaluation import evaluate
from orchestrator.results.run_data import Missing, RunData, Window
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


def test_axes_of_a_plane_are_those_of_its_normal(runs):
    slope, level = runs
    draw = np.random.default_rng(1)
    pose = np.column_stack([draw.uniform(-3.0, 3.0, 20), draw.uniform(-9.0, 9.0, (20, 2))])
    axes = ground_axes(slope, pose)
    np.testing.assert_allclose(axes.up, np.tile(NORMAL, (20, 1)), atol=1e-12)
    np.testing.assert_allclose(np.arctan2(axes.ahead[:, 1], axes.ahead[:, 0]), pose[:, 0], atol=1e-12)
    whole = np.stack(axes, axis=1)
    np.testing.assert_allclose(whole @ whole.transpose(0, 2, 1), np.tile(np.eye(3), (20, 1, 1)), atol=1e-12)
    assert (np.linalg.det(whole) > 0.0).all()
    vectors = draw.normal(size=(20, 3))
    along, up = split(slope, vectors, pose)
    np.testing.assert_allclose(along**2 + up**2, (vectors**2).sum(axis=1), rtol=1e-12)
    np.testing.assert_array_equal(split(level, vectors, pose[:, :1])[1], vectors[:, 2])
    np.testing.assert_array_equal(component(vectors, ground_axes(level, pose[:, :1]).up), vectors[:, 2])


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


def chains_apart(slope, level):
    """Largest distance of pins in the planes of their tracks, m."""
    one, other = (run.links("left_track", WINDOW) for run in (slope, level))
    return float(np.hypot(one.forward - other.forward, one.up - other.up).max())


def test_pins_by_the_vertical_lie_elsewhere(runs):
    slope, level = runs
    slope.scene["ground"].update(grade=0.0, bank=0.0)
    assert chains_apart(slope, level) > 0.5


def test_uneven_ground_has_no_settlement_of_contacts(runs):
    slope, _ = runs
    slope.scene["ground"]["step"] = {"x": [9.0], "rise": 0.1, "radius": 0.02}
    for measure in (vehicle_measures.settlement_of_contacts, vehicle_measures.settlement):
        with pytest.raises(Missing, match="settlement is not known on uneven ground"):
            measure(slope, "", WINDOW)


def test_settlement_on_a_slope_is_that_on_level_ground_and_none_where_the_ground_is_uneven(runs):
    """In the summary too, where the height that a vehicle climbs was shown as a settlement."""
    slope, level = runs
    on_slope, flat = (vehicle_measures.settlement(run, "", WINDOW) for run in runs)
    assert on_slope == pytest.approx(flat, rel=0.05)
    assert flat == level.mean("chassis.settlement", WINDOW)
    plane = slope.scene["ground"]
    for key, value in (
        ("incline_start", 3.0),
        ("rough", {"seed": 1}),
        ("bump", {"start": 5.0}),
        ("trench", {"x": 5.0}),
    ):
        slope.scene["ground"] = plane | {key: value}
        with pytest.raises(Missing, match="settlement is not known on uneven ground"):
            vehicle_measures.settlement(slope, "", WINDOW)
    scene = load("straight", "rigid", START)
    for ground, known in ((plane, True), (plane | {"step": {"x": [9.0], "rise": 0.1, "radius": 0.02}}, False)):
        slope.scene["ground"] = ground
        assert (summary.observables(slope, scene, STOP)["settlement"] > 0.0) == known


def test_creep_counts_where_the_least_friction_could_hold(runs):
    slope, _ = runs
    assert track_checks.least_friction(slope) == 0.3
    everywhere = {"x": [-9.0, 9.0], "y": [-9.0, 9.0]}
    slope.scene["ground"]["friction"] = [
        {**everywhere, "factor": 0.5, "coefficient": None}, {**everywhere, "factor": None, "coefficient": 0.2},
    ]  # fmt: skip
    assert track_checks.least_friction(slope) == 0.15


def test_a_slope_has_a_page_without_warnings(runs):
    slope, _ = runs
    assert validity(slope).entries == ()
    html = document(evaluate(slope, _judge(slope)), None, "")
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
