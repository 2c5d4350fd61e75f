"""Scenes of the gallery run in full on both track models, with few exceptions, and pass all checks."""

import json

import numpy as np
import pytest

from fmus.track.choices import TRACKS
from orchestrator.cosim.coupling.tracks_first import Coupling as TracksFirst
from orchestrator.execution import replay_model
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.log.tools import WHOLE, verify
from orchestrator.results import measures
from orchestrator.results.energy import ledger
from orchestrator.results.replayed_outputs import compared
from orchestrator.results.run_data import RunData, Window
from orchestrator.results.vehicle_measures import third_law
from orchestrator.scene.scene import load, scene_names

MODELS = tuple(TRACKS)
STEERED = "pivot", "serpentine", "brake_turn", "differential"  # in full only as studies: ``turn`` represents them
OTHERS = "marder", "robot", "rear_drive"  # in full only as studies: ``test_vehicle_layouts`` represents them
SUSPENDED = "tank", "crawler", "elevated_sprocket"  # wheels of their own: with flexible links only as studies
SLOW = "settle", "turn", "rig", "sprocket_bench", "hard_stop"  # seconds of run time
# rigid: others compile their kernels too
UNEVEN = "half_round", "washboard", "rough", "step", "trench", "soft_ground", "snow", "treadmill"
SLOPES = "climb", "side_slope", "hold"
ON_SOIL = "plate_press", "shear_sled"  # kernels of their own
# wheels that hang, or carry it all; an edge that links are pressed on, and pushed against
WARNED = {
    "half_round": {"penetration", "lift"},
    "step": {"penetration", "lift", "compression"},
    "trench": {"penetration"},
}


def marks(name, model):
    """By default a scene runs in full with flexible links, or begins if it takes seconds."""
    if name in (*STEERED, *OTHERS):
        return [pytest.mark.study]
    if name in (*UNEVEN, *SUSPENDED):
        return [pytest.mark.study if model == "flexible" else pytest.mark.long]
    return [] if model == "flexible" and name not in (*SLOW, *SLOPES, *ON_SOIL) else [pytest.mark.long]


CASES = [
    pytest.param(name, model, id=f"{name}-{model}", marks=marks(name, model))
    for name in scene_names()
    for model in MODELS
]
CLOSES = 0.02  # energy residual over the work

_runs = {}


@pytest.fixture(scope="session")
def ran(tmp_path_factory):
    """Return a function that runs a scene once per session and gives its summary."""

    def once(name, model, *settings):
        key = (name, model, *settings)
        if key not in _runs:
            path = tmp_path_factory.mktemp("logs") / f"{name}-{model}.mcap"
            _runs[key] = simulate(load(name, model, settings), path)
        return _runs[key]

    return once


@pytest.mark.parametrize(("name", "model"), CASES)
def test_scene_comes_out_as_expected(ran, name, model):
    """A scene passes every check, with a whole log and a closed energy balance."""
    result = ran(name, model)
    assert (result["status"], result["message"]) == ("ok", "")
    assert {warning["what"] for warning in result["validity"]} == WARNED.get(name, set()), "a false alarm"
    scene = load(name, model)
    made = {n for n, check in scene.expect.items() if check.track in (None, model)}
    assert set(result["checks"]) == made
    wrong = {n: check for n, check in result["checks"].items() if not check["ok"]}
    assert wrong == {}
    assert verify(result["log"]).code == WHOLE
    assert abs(result["energy"]["residual_relative"]) < CLOSES


@pytest.mark.parametrize(("name", "model"), [("settle", "rigid"), ("rig", "rigid"), ("sprocket_bench", "rigid")])
def test_scenes_that_take_long_begin(ran, name, model):
    """Scenes that do not steer begin as they go on: in their validity, with closed energy."""
    result = ran(name, model, "run.stop=0.2 s")
    assert (result["status"], result["message"], result["validity"]) == ("ok", "", [])
    assert abs(result["energy"]["residual_relative"]) < CLOSES


@pytest.mark.long
@pytest.mark.parametrize("name", ["turn", *STEERED])
def test_scenes_that_steer_begin(ran, name):
    """Scenes that steer begin on rigid links: paired forces, closed energy, a vehicle that moves."""
    who = "driver" if name == "serpentine" else "drive"
    result = ran(name, "rigid", "run.stop=0.6 s", f"{who}.ramp_start=0 s", f"{who}.ramp_time=0.3 s")
    assert (result["status"], result["message"], result["validity"]) == ("ok", "", [])
    assert result["checks"]["third_law"]["ok"]
    assert abs(result["energy"]["residual_relative"]) < CLOSES
    with Log(result["log"]) as log:
        yaw, way = (log.signal(f"chassis.{signal}")[1][-1] for signal in ("yaw", "distance"))
    assert abs(yaw) > 0.02 or way > 0.1


BRIEF = ("run.stop=0.3 s", "run.step=1 ms", "drive.ramp_start=0 s", "drive.ramp_time=0.2 s", "run.outputs=1")


@pytest.mark.parametrize("component", ["chassis", "left_track", "right_track", "left_drive", "right_drive"])
def test_every_component_of_straight_replays_bit_by_bit(ran, component):
    result = ran("straight", "flexible", *BRIEF)
    with replay_model.open_replay(result["log"], component, None) as again:
        verdict = again.verify()
    assert verdict.difference is None, verdict.sentence
    assert verdict.steps == 300


def test_replay_notices_another_parameter(ran):
    result = ran("straight", "flexible", *BRIEF)
    with replay_model.open_replay(result["log"], "left_drive", None) as again:
        other = again._replace(parameters={**again.parameters, "speed.end": 20.0 * (1 + 1e-12)})
        verdict = other.verify()
    assert verdict.difference is not None
    assert verdict.sentence.startswith("different: left_drive.")


def test_rigid_links_under_the_wheels_of_flexible_ones(ran, tmp_path):
    result = ran("straight", "flexible", *BRIEF)
    with replay_model.open_replay(result["log"], "left_track", "rigid") as again:
        assert again.record(tmp_path / "replayed.mcap") == 300
    with Log(tmp_path / "replayed.mcap") as replayed, Log(result["log"]) as log:
        assert len(replayed.read("/left_track/out").t) == 301
        comparisons = {one.signal: one for one in compared(log, replayed, "left_track")}
    assert 0.0 < abs(comparisons["sprocket.force.x"].difference).mean() < comparisons["sprocket.force.x"].largest


def test_impulse_across_the_ports(ran, scaled):
    result = ran("straight", "flexible", *BRIEF)
    with Log(result["log"]) as log:
        run = RunData(log)
        assert third_law(run, "", Window(0.0, 0.3)) < 1e-12
        scaled(log, "/chassis/in", "left.road_wheel[3].force.z", 1.001)
        assert third_law(run, "", Window(0.0, 0.3)) > 1e-6, "a twin that loses 0.1 % of a wheel's force passes"


@pytest.mark.long
def test_port_energy_falls_with_the_communication_step(ran):
    """The energy of the ports falls with the order of the coupling at least."""
    ports = []
    for h in ("1 ms", "2 ms"):
        result = ran("straight", "flexible", *BRIEF, f"run.step={h}")
        with Log(result["log"]) as log:
            ports.append(ledger(RunData(log)).port)
    assert TracksFirst.ORDER < np.log2(ports[1] / ports[0]) < 4.5


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "model", "settings"),
    [
        *(("rig", model, ("drive.speed=-3 rad/s", "run.links=40")) for model in MODELS),
        pytest.param("hanging_chain", "flexible", ("track.element=beam", "run.links=100"), marks=pytest.mark.study),
        pytest.param("spinning_loop", "flexible", ("planar=true",), marks=pytest.mark.study),
    ],
)
def test_variants_of_a_scene_pass_its_checks(ran, name, model, settings):
    """Pins, chain speed, torque and tight span of the rig that turns backwards; chains of other elements."""
    result = ran(name, model, *settings)
    assert result["status"] == "ok"
    assert {name: check["value"] for name, check in result["checks"].items() if not check["ok"]} == {}
    assert len(result["checks"]) > 2 - (name == "spinning_loop")
    assert name != "rig" or result["observables"]["speed"] < -0.7


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "close"),
    [("settle", {"settlement": 0.02, "ground_force": 1e-3}), ("straight", {"distance": 0.01, "speed": 0.01})],
)
def test_kinds_of_links_are_alike(ran, name, close):
    first, *others = (ran(name, model)["observables"] for model in MODELS)
    for observables in others:
        for figure, share in close.items():
            assert observables[figure] == pytest.approx(first[figure], rel=share), figure


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "settings", "figures"),
    [("settle", ("run.stop=0.4 s",), ("settlement",)), ("straight", BRIEF, ("distance", "speed"))],
)
def test_beams_carry_the_vehicle_as_cables_do(ran, name, settings, figures):
    results = [ran(name, "flexible", *settings, *more) for more in ((), ("track.element=beam",))]
    assert [result["status"] for result in results] == ["ok", "ok"]
    for figure in figures:
        cables, beams = (result["observables"][figure] for result in results)
        assert beams == pytest.approx(cables, rel=0.01)
        assert abs(cables) > 1e-3
    assert results[0]["observables"]["tension_max"] != results[1]["observables"]["tension_max"]


# 2 / 120 instead of 2 / 99
ELEVEN = ("vehicle.sprocket.teeth=11", "vehicle.sprocket.outer_radius=0.285 m")
TWINS = [
    ("sprocket_bench", "polygon", ELEVEN),
    ("sprocket_bench", "pins_per_revolution", ELEVEN),
    ("hanging_chain", "sag", ("chain.span=0.79",)),
    ("hanging_chain", "tension", ("vehicle.gravity=9.83",)),
    ("hard_stop", "distance", ("vehicle.contact.ground.friction=0.31",)),
    ("climb", "uphill", ("ground.grade=0.202",)),
    ("climb", "torque", ("ground.grade=0.21",)),
    ("hold", "creep", ("vehicle.contact.ground.friction=0.301",)),
    ("soft_ground", "thrust", ("hitch.force=15.4 kN",)),
    ("soft_ground", "sinkage", ("ground.soil.kphi=1.2e6",)),
    ("soft_ground", "rut", ("ground.soil.kphi=1.2e6",)),
    ("elevated_sprocket", "thrust", ("hitch.force=30.9 kN",)),
    ("snow", "rut", ("ground.soil.kphi=175e3",)),
    ("soft_ground", "slip", ("ground.soil.shear_deformation_modulus=27 mm",)),
    ("treadmill", "pull", ("ground.soil.shear_deformation_modulus=27 mm",)),
    ("treadmill", "speed", ("hitch.drag_points=[[1.6, 0], [1.8, 155896]]",)),
    ("plate_press", "sinkage", ("ground.soil.kphi=1.56e6",)),
    ("plate_press", "compaction", ("vehicle.gravity=9.83",)),
    ("plate_press", "energy", ("run.step=2 ms", "track.step=2 ms", "run.links=1")),
    ("shear_sled", "energy", ("run.step=1 ms", "track.step=1 ms", "run.links=1")),
    ("shear_sled", "sinkage", ("ground.soil.kphi=1.53e6",)),
    ("shear_sled", "resistance", ("ground.soil.cohesion=1.06 kPa",)),
    ("shear_sled", "way", ("ground.soil.shear_deformation_modulus=25.5 mm",)),
    ("shear_sled", "shear", ("ground.soil.friction_angle=28.3 deg",)),
    ("released_chain", "tip_of_steel", ("vehicle.gravity=9.82",)),
    ("released_chain", "energy", ("run.step=10 ms", "track.step=10 ms", "run.links=1")),
    ("spinning_loop", "joint_force", ("chain.spin=5.05",)),
    ("spinning_loop", "hoop_strain", ("vehicle.material.youngs_modulus=202 GPa",)),
    ("settle", "ground_force", ("vehicle.chassis.mass=5600",)),
]


@pytest.mark.long
@pytest.mark.parametrize(("name", "check", "settings"), TWINS)
def test_expectations_can_fail(ran, name, check, settings):
    model = "rigid" if name in (*UNEVEN, *SUSPENDED) else "flexible"
    assert ran(name, model, *settings)["checks"][check]["ok"] is False


@pytest.mark.long
def test_a_pin_in_every_second_gap_makes_a_polygon_of_half_the_teeth(ran):
    """21 teeth take 10.5 pins a turn, whose ripple is 2 / (10.5^2 - 1); the free span swings, to 3 % of that."""
    shape = ("vehicle.sprocket.teeth=21", "vehicle.sprocket.gaps_per_pin=2", "vehicle.sprocket.outer_radius=0.272 m")
    seen = {name: check["value"] for name, check in ran("sprocket_bench", "rigid", *shape)["checks"].items()}
    assert seen["pins_per_revolution"] == pytest.approx(10.5, rel=2e-3)
    assert seen["polygon"] == pytest.approx(2.0 / (10.5**2 - 1.0), rel=0.03)
    assert abs(seen["polygon"] * (10.0**2 - 1.0) / 2.0 - 1.0) > 0.05, "the twin"


@pytest.mark.long
def test_a_crawler_drives_on_a_tooth_between_every_second_gap(ran):
    """25 teeth, as many crawlers have: 12.5 pins a turn, no tooth jumped, a pitch a pin but for the pads' slip."""
    shape = ("vehicle.sprocket.teeth=25", "vehicle.sprocket.gaps_per_pin=2", "vehicle.sprocket.outer_radius=0.4256 m")
    result = ran("crawler", "rigid", *shape)
    checks = result["checks"]
    assert {name for name, check in checks.items() if not check["ok"]} == {"pins_left"}
    assert checks["pins_left"]["value"] == pytest.approx(12.5, abs=0.03)
    assert abs(checks["speed_excess"]["value"]) < 4e-3
    assert (result["status"], result["validity"]) == ("ok", [])


@pytest.mark.long
def test_folded_chain_of_other_length(ran):
    """The fall times of a folded chain scale with the root of its length."""
    result = ran("folded_chain", "rigid", "chain.links=17", "run.stop=0.63 s")
    for name in ("fall_time", "half_fall_time", "behind_free_fall"):
        assert measured(result, name) == pytest.approx(FALL[name], rel=0.01, abs=1e-12)


def test_a_chain_let_go_shows_its_support_from_the_start(ran):
    """A released chain has its support force from t = 0 on: 0.494898 of the weight of 33 rods."""
    with Log(ran("folded_chain", "flexible")["log"]) as log:
        t, force = log.signal("chain.joint[1].force.z")
    assert t[0] == 0.0
    np.testing.assert_allclose(force[t < 5.5e-3], 0.494898 * 33 * 18.0 * 9.81, rtol=1e-2)


FALL = {"fall_time": 0.8472, "half_fall_time": 0.948, "behind_free_fall": 0.0}


def measured(result, name):
    with Log(result["log"]) as log:
        return measures.FIGURES[name](RunData(log), "", Window(0.0, result["simulated_time"]))


def test_what_a_scene_does_not_declare_is_not_logged(ran):
    with Log(ran("hanging_chain", "flexible")["log"]) as log:
        assert set(log.topics) == {"/chain/in", "/chain/out", "/chain/links", "/stats/chain"}
        assert [i["name"] for i in json.loads(log.attachment("system.json"))["instances"]] == ["chain"]
        _, contact = log.signal("chain.energy.contact")
        assert np.all(contact == 0.0)


def alike(a, b, topic, least=0.0):
    """Assert that two logs have the same motion and forces, up to the growth of rounding.

    Forces below ``least`` of the largest are left out.
    """
    names = [n for n in b.read(topic).names if n.endswith((".x", ".z", "tension"))]
    names = [n for n in names if ".torque" not in n and "angular" not in n and "orientation" not in n]
    assert len(names) > 30
    columns = [[series.names.index(n) for n in names] for series in (a.read(topic), b.read(topic))]
    one, other = a.read(topic).values[:, columns[0]], b.read(topic).values[:, columns[1]]
    # a link of 3e9 N/m turns the rounding of a coordinate, 1e-15 m, into micronewtons, at every step
    force = np.array([n.endswith("tension") or ".force" in n for n in names])
    scale = np.maximum(np.abs(one).max(axis=0), 1e-3)
    scale[force] = np.maximum(scale[force], least * scale[force].max(initial=0.0))
    soil = np.array([n.startswith("link") and ".ground." in n for n in names])  # some links hardly touch it
    scale[soil] = scale[soil].max(initial=0.0)
    apart = np.abs(other - one).max(axis=0) / scale
    assert apart[~force].max() < 1e-9
    assert apart[force].max(initial=0.0) < 3e-8  # pin forces are sums over links and of their rounding


HALF = (*BRIEF, "symmetric=true")


@pytest.mark.long
def test_half_a_vehicle_moves_like_the_whole(ran):
    """Half a vehicle moves like the whole: the same motion, forces and energies with half the topics."""
    whole, half = ran("straight", "flexible", *BRIEF), ran("straight", "flexible", *HALF)
    with Log(whole["log"]) as a, Log(half["log"]) as b:
        assert not any(topic.startswith(("/right", "/stats/right")) for topic in b.topics)
        for topic in ("/chassis/out", "/left_track/links"):
            alike(a, b, topic)
    for figure in ("distance", "speed", "ground_force", "slip", "pad_slip"):
        assert half["observables"][figure] == pytest.approx(whole["observables"][figure], rel=1e-9)
    for figure in ("work", "change", "dissipated", "port", "residual"):
        assert half["energy"][figure] == pytest.approx(whole["energy"][figure], rel=1e-6)
    heavier = ran("straight", "flexible", *HALF, "vehicle.chassis.mass=5600")
    assert heavier["observables"]["distance"] != pytest.approx(whole["observables"]["distance"], rel=1e-3)


@pytest.mark.long
def test_a_planar_half_vehicle_moves_like_the_half(ran):
    """A planar half vehicle moves like the half: same chassis, pins and forces, at any heading."""
    half, planar = ran("straight", "flexible", *HALF), ran("straight", "flexible", *HALF, "planar=true")
    with Log(half["log"]) as a, Log(planar["log"]) as b:
        for topic in ("/chassis/out", "/left_track/links"):
            alike(a, b, topic, least=0.01)  # at rest little force is along the hull
    for figure in ("distance", "speed", "ground_force"):
        assert planar["observables"][figure] == pytest.approx(half["observables"][figure], rel=1e-9)
    for figure in ("work", "change", "dissipated"):
        assert planar["energy"][figure] == pytest.approx(half["energy"][figure], rel=1e-6)
    turned = ran("straight", "flexible", *HALF, "planar=true", "start.heading=37 deg")
    assert turned["observables"]["distance"] == pytest.approx(planar["observables"]["distance"], rel=1e-9)
    harder = ran("straight", "flexible", *HALF, "planar=true", "vehicle.contact.ground.stiffness=2.1e6 N/m")
    assert harder["observables"]["ground_force"] != pytest.approx(half["observables"]["ground_force"], rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("name", ["rig", "sprocket_bench"])
def test_a_planar_chain_runs_like_one_in_space(ran, name):
    brief = ("run.stop=0.3 s", "drive.ramp_start=0 s", "drive.ramp_time=0.2 s", "run.links=50")
    space, plane = ran(name, "flexible", *brief), ran(name, "flexible", *brief, "planar=true")
    with Log(space["log"]) as a, Log(plane["log"]) as b:
        alike(a, b, "/track/links", least=0.05)  # in straight spans little force is vertical
    assert plane["energy"]["work"] == pytest.approx(space["energy"]["work"], rel=1e-8)
