"""A vehicle starts in static equilibrium with its chains and the ground, and stays at rest; or begins as drawn."""

from __future__ import annotations

import re
from contextlib import nullcontext, suppress
from functools import cache

import numpy as np
import pytest
import random_vehicles
from vehicle_in_process import InProcess

from fmus.interface.model import StepFailed
from fmus.interface.ports import motion_ports
from fmus.physics.chain.report import T_MEAN
from fmus.physics.wheels import read_states
from fmus.rest import equilibrium, standing
from fmus.rest.tensioning import tension_wheel
from fmus.track import start
from fmus.track.choices import TRACKS
from fmus.track.model import TrackModel
from fmus.vehicles.sides import ground_level
from fmus.vehicles.tables import BadInput
from orchestrator.cli.inventory import describe
from orchestrator.execution import summary
from orchestrator.results.energy import STORED
from orchestrator.scene.assembly import assemble
from orchestrator.scene.parts import closed_track_config, own_parts
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import changed_scene, from_table, load

MOTION = [port.name.removeprefix("of.") for port in motion_ports("of", "output")]
HEIGHT, LOAD = 1e-4, 5e-3  # m, and share of each wheel's load: largest motion in the first second
OWN_KERNELS = ("planar", "turning", "beam")  # compile kernels of their own
TRACK_KINDS = {
    "rigid": ("rigid", ()),
    "rigid, spring": ("rigid", ("track.closure=spring",)),
    "cable": ("flexible", ()),
    "planar": ("flexible", ("planar=true",)),
    "turning": ("flexible", ("track.axes=free",)),
    "beam": ("flexible", ("track.element=beam",)),
}
SHORT = {"turning": 0.1, "beam": 0.1}  # s, of models that take long
FOUR = ("vehicle.road_wheel.x=[-0.7, -1.55, -2.4, -3.25]", "vehicle.suspension.stiffness=8e5")
FRICTION = "vehicle.contact.ground.friction"
HEAVY = ("vehicle.chassis.centre=[-1.6, 0, 0.5]",)


def at_rest(model, *settings):
    """Scene `straight`, which rests for two seconds."""
    return placed(load("straight", model, ("track.link_outputs=false", *settings)))


def seen(vehicle):
    """Settlement, m, and the loads of all wheels on tracks, N."""
    loads = [
        member[name]
        for member in vehicle.members.values()
        if member.kind.startswith("Track")
        for name in member.outputs
        if name.startswith("road_wheel") and name.endswith(".force.z")
    ]
    return vehicle["chassis"]["settlement"], np.array(loads)


def moved(scene, duration):
    """Largest change of the settlement, m, and relative change of a wheel's load in ``duration`` s."""
    vehicle = InProcess(scene)
    height, loads = seen(vehicle)
    far = share = 0.0
    for _ in range(round(duration / 5e-3)):
        vehicle.run(5e-3)
        now, pushes = seen(vehicle)
        far = max(far, abs(now - height))
        share = max(share, float(np.max(abs(pushes / loads - 1.0), initial=0.0)))
    return far, share


def in_kept_place(scene, other):
    """The scene in the equilibrium of another one."""
    table = scene.resolved()
    table["start"]["equilibrium"] = other.start.equilibrium.model_dump(mode="json")
    return from_table(table, "other")


@pytest.fixture
def uncached(monkeypatch):
    """Searches that are made anew: of another friction, which they do not read, as a process remembers results."""
    for module in (equilibrium, standing):
        monkeypatch.setattr(module, "cached_result", lambda kind, name, request, compute: compute())


@pytest.mark.parametrize(
    "kind", [pytest.param(k, marks=[pytest.mark.long] if k in OWN_KERNELS else []) for k in TRACK_KINDS]
)
def test_a_vehicle_stays_where_it_starts(kind):
    model, settings = TRACK_KINDS[kind]
    scene = at_rest(model, "symmetric=true", *settings)
    assert 0.0295 < -scene.start.equilibrium.height < 0.0310, "settlement counts from the drawn position"
    far, share = moved(scene, SHORT.get(kind, 1.0))
    assert far < 0.1 * HEIGHT
    assert share < 0.2 * LOAD


@pytest.mark.long
@pytest.mark.parametrize("kind", TRACK_KINDS)
def test_a_vehicle_on_pads_stands_higher_by_their_height(kind):
    """By 0.2 mm less, as links that tilt under wheels reach farther down; on a bar a link they tilt more (twin)."""
    model, settings = TRACK_KINDS[kind]
    over_ground, loads = [], []
    for grouser in ("", "{height=0.04, length=0.1524}", "{height=0.04, length=0.03}"):
        given = [f"vehicle.track.grouser={grouser}"] if grouser else []
        scene = at_rest(model, "symmetric=true", *settings, *given)
        vehicle = InProcess(scene).run(5e-3)
        over_ground.append(vehicle["chassis"]["chassis.position.z"] - ground_level(scene.vehicle.model_dump()))
        loads.append(vehicle["left_track"]["ground.force.z"])
    pads, bars = (height - over_ground[0] for height in over_ground[1:])
    assert pads == pytest.approx(0.04, abs=3e-4)
    assert bars == pytest.approx(0.038, abs=1e-3)
    assert bars != pytest.approx(0.04, abs=1e-3)
    assert loads == pytest.approx([0.5 * scene.vehicle.total_mass() * 9.81] * 3, rel=1e-3)


@pytest.mark.long
@pytest.mark.parametrize("own", [FOUR, HEAVY, ("ground.hull=true", "vehicle.gravity=15")], ids=["four", "heavy", "g"])
def test_vehicles_of_ones_own_stay_too(own):
    far, share = moved(at_rest("rigid", "symmetric=true", *own), 0.5)
    assert far < HEIGHT
    assert share < LOAD


@pytest.mark.long
def test_the_place_of_another_spring_is_not_that_of_this_one():
    """The equilibrium of a suspension that is 3 % stiffer is not that of this one (twin)."""
    other = at_rest("rigid", "symmetric=true", "vehicle.suspension.stiffness=1.03e6")
    far, share = moved(in_kept_place(at_rest("rigid", "symmetric=true"), other), 0.3)
    assert far > HEIGHT
    assert share > LOAD


STANDING = ("m113", "robot", "dozer", "highdrive", pytest.param("leopard2", marks=pytest.mark.long))
SOFT = "vehicle.material.youngs_modulus=5 GPa"  # a belt of the m113's shape


def tension(scene):
    """Mean tension, N, of the left track of the models of a scene as they start."""
    return InProcess(scene)["left_track"]["tension.mean"]


@pytest.mark.long
@pytest.mark.parametrize("vehicle", STANDING)
def test_the_standing_vehicle_has_the_tension_asked(vehicle):
    """On flexible links to 1e-4; rigid ones of steel keep the place of cables and are within 1 %."""
    scenes = [at_rest(model, f"vehicle={vehicle}") for model in ("flexible", "rigid")]
    asked = scenes[0].vehicle.track.tension
    assert tension(scenes[0]) == pytest.approx(asked, rel=1e-4)
    assert tension(scenes[1]) == pytest.approx(asked, rel=0.01)
    assert scenes[0].vehicle.idler == scenes[1].vehicle.idler
    other = at_rest("flexible", f"vehicle={vehicle}", f"vehicle.track.tension={1.03 * asked}")
    assert tension(other) != pytest.approx(asked, rel=0.02), "a tension that is 3 % off goes unnoticed"


@pytest.mark.long
def test_loads_and_the_pull_at_the_sprocket_add_up_to_the_weight():
    """Of a vehicle on its idlers and rollers; raised idlers, the twins, are not among the loads told."""
    low = {"vehicle.wheel.rear_idler.z": -0.87, "vehicle.idler.z": -0.866}
    scene = placed(load("elevated_sprocket", "flexible", low))
    found, vehicle = summary.track_tension(scene.resolved()), scene.vehicle
    on_idlers, on_rollers = sum(found["others"][0].values()), sum(found["loads"][0])
    assert [*found["others"][0]] == ["idler", "rear_idler"]
    pull, weight = scene.start.equilibrium.sprockets[0][2], 0.5 * vehicle.total_mass(()) * vehicle.gravity
    assert on_idlers + on_rollers + pull == pytest.approx(weight, rel=1e-5)
    assert on_idlers > 0.4 * weight
    drawn = load("elevated_sprocket", "rigid")
    raised = placed(drawn)
    assert summary.track_tension(raised.resolved())["others"] == [{}, {}]
    line = next(line for line in describe(drawn) if "idler at" in line)
    assert line == f"  idler at x = {raised.vehicle.idler.x:.5g} m, z = -0.845 m, moved there for this tension"
    assert abs(raised.vehicle.idler.x - drawn.vehicle.idler.x) > 1e-3, "the place is not that of the file"


def laid(*settings):
    scene = at_rest("rigid", *settings)
    return scene.vehicle.idler, scene.vehicle.tensioner, scene.standing


def at_start(*settings):
    return summary.track_tension(at_rest("rigid", *settings).resolved())["start"]


@pytest.mark.long
def test_rigid_links_whose_search_fails_stand_in_the_place_of_cables(monkeypatch, uncached):
    """And what they carry there is told; it is not the tension asked."""
    search = equilibrium.VehicleOnChains.come_to_rest

    def on_cables_alone(vehicle, guess):
        if isinstance(vehicle.chains[0]._model, equilibrium.RigidLinks):
            raise StepFailed("none on rigid links")
        return search(vehicle, guess)

    monkeypatch.setattr(equilibrium.VehicleOnChains, "come_to_rest", on_cables_alone)
    cables, rigid = (at_rest(model, "symmetric=true", SOFT, f"{FRICTION}=0.33") for model in ("flexible", "rigid"))
    assert rigid.vehicle.idler == cables.vehicle.idler
    for told in (rigid.standing.tracks[0].tension, rigid.start.equilibrium.tracks[0].tension):
        assert told == pytest.approx(tension(rigid), rel=1e-6)
        assert told != pytest.approx(rigid.vehicle.track.tension, rel=0.03)


@pytest.mark.long
def test_the_start_of_a_scene_moves_no_idler():
    """A drawn start, a slope, one track: the tension asked is the vehicle's, and each adds its own."""
    level = laid()
    for settings in (
        ("start.state=drawn",), ("ground.grade=0.2",), ('tracks=["left"]',),
        ("symmetric=true",), ("start.height=1",), ("vehicle.contact.ground.friction=0.8",),
    ):  # fmt: skip
        assert laid(*settings) == level, settings
    assert at_start("start.state=drawn") == pytest.approx([16.3e3], rel=1e-3)
    assert laid("vehicle.tensioner.stiffness=1.05e6")[1].preload != pytest.approx(level[1].preload, rel=1e-3)


@pytest.mark.long
def test_soil_moves_no_idler_and_adds_tension():
    """Its start compiles kernels of its own, those of ``soft_ground``."""
    assert laid("ground.soil.name=dry_sand") == laid()
    assert at_start("ground.soil.name=dry_sand")[0] > 1.15 * 14.38e3


@pytest.mark.long
def test_what_does_not_stand_keeps_its_tension_as_drawn(monkeypatch):
    for settings, why in (
        (("vehicle.gravity=0",), "without gravity"),
        (("start.state=drawn", "vehicle.chassis.centre=[9, 0, 0.4]"), "tips over"),
    ):
        scene = at_rest("rigid", *settings)
        assert why in scene.standing.why
        assert scene.standing.drawn == pytest.approx([14.38e3], rel=1e-3)
        assert scene.standing.tracks == ()
    with pytest.raises(BadInput, match=r"tension = 1845\.3 N: no place of the idler was found where the"):
        placed(load("straight", "rigid", {"vehicle": random_vehicles.random_vehicle(6)}))

    def sags(vehicle, guess):
        raise StepFailed("it has sagged")

    monkeypatch.setattr(equilibrium.VehicleOnChains, "come_to_rest", sags)
    with pytest.raises(BadInput, match=r"N: not reached with the idler .*; at the nearest as drawn: it has sagged"):
        placed(load("straight", "rigid", {"vehicle": random_vehicles.random_vehicle(6)}))


@pytest.mark.long
def test_rigid_links_of_a_belt_start_from_their_own_equilibrium(monkeypatch, uncached):
    """They do not stretch: from that of cables their hull jumps, and the chassis says so (twin)."""
    scene = at_rest("rigid", SOFT)
    vehicle = InProcess(scene)
    asked = scene.vehicle.track.tension
    assert vehicle["left_track"]["tension.mean"] == pytest.approx(asked, rel=1e-4)
    vehicle.run(0.05)
    assert vehicle["left_track"]["tension.mean"] == pytest.approx(asked, rel=1e-3)
    assert vehicle["chassis"].model.warnings() == []
    monkeypatch.setattr(equilibrium, "STRETCHED", np.inf)
    other = InProcess(at_rest("rigid", SOFT, f"{FRICTION}=0.31"))
    assert abs(other["left_track"]["tension.mean"] / asked - 1.0) > 0.03
    (warning,) = [text for _ in range(3) for text in (other.run(2e-3), *other["chassis"].model.warnings())[1:]]
    hull, lack = map(float, re.search(r"falls with (\S+) m/s2 and .* differ by (\S+) %", warning).groups())
    assert hull < 0.2
    assert lack > 1.0


@pytest.mark.long
def test_a_vehicle_with_sides_of_its_own_has_the_tension_on_both():
    tracks = at_rest("flexible", "vehicle=marder").standing.tracks
    assert [track.tension for track in tracks] == pytest.approx([12260.0] * 2, rel=1e-5)
    # 0.32: links just touch rims that lean, where Newton's corrections alternate and secants are taken
    sides = at_rest("rigid", LEANS.format(0.32))
    tensions = [track.tension for track in sides.standing.tracks]
    assert np.mean(tensions) == pytest.approx(1.00205 * sides.vehicle.track.tension, rel=2e-4)  # they do not stretch
    assert tensions[0] != pytest.approx(tensions[1], rel=1e-4)


@pytest.mark.long
def test_the_start_depends_on_no_friction_and_no_damping():
    """Of a scene, or set by a host: the places of all links are the same to the bit; not so with the stiffness."""
    start = InProcess(at_rest("rigid"))["left_track"].model.s.q.copy()
    for key, value in {"friction": 0.55, "friction_velocity": 0.03, "damping": 9e3, "stiffness": 2.1e6}.items():
        names = [f"contact.{pair}.{key}" for pair in ("sprocket", "wheel", "ground")]
        of_scene = InProcess(at_rest("rigid", *(f"vehicle.{name}={value}" for name in names)))
        of_host = InProcess(at_rest("rigid"), {"*_track": dict.fromkeys(names, value)})
        for vehicle in (of_scene, of_host):
            assert np.array_equal(vehicle["left_track"].model.s.q, start) == (key != "stiffness"), key


def rough(phase, blind=False):
    """A vehicle of one unknown whose accelerations, m/s2, chains make rough: a kink of 4e-4 every few micrometres.

    ``blind``: with places at which a chain finds no rest.
    """
    parts = own_parts(load("straight", "rigid", ["tracks=[]", "start.state=drawn"])).parts
    (chassis,) = (part.config for part in parts if part.kind == "Chassis")
    vehicle = equilibrium.VehicleOnChains(equilibrium.Cables, chassis, {}, (0.0, 0.0))

    def accelerations(guess):
        if blind and 0.005 < guess[0] < 0.0065:
            raise StepFailed("the chain is lost")
        return np.array([-150.0 * (guess[0] - 0.01) + 0.9e-4 * np.sin(guess[0] / 5e-7 + phase)])

    vehicle.unknowns, vehicle.accelerations = [0], accelerations
    return vehicle


@pytest.mark.parametrize(
    ("difference", "least_share", "finds_all"),
    [(1e-5, 1.0 / 16.0, True), (1e-6, 1.0, False), (1e-5, 1.0, False)],
)
def test_small_kinks_of_the_chains_forces_stop_no_search(monkeypatch, difference, least_share, finds_all):
    """Quotients over 1 um see slopes of 180 1/s2 in them, more than the suspension's; full steps go round (twins)."""
    monkeypatch.setattr(equilibrium, "DIFFERENCE", difference)
    monkeypatch.setattr(equilibrium, "LEAST_SHARE", least_share)
    found = []
    for phase in np.linspace(0.0, 6.0, 40):
        with suppress(StepFailed):
            found.append(rough(phase).come_to_rest(np.zeros(1))[0])
    assert (len(found) == 40) == finds_all
    assert found == pytest.approx([0.01] * len(found), abs=2e-6)


@pytest.mark.parametrize("least_share", [1.0 / 16.0, 1.0])
def test_a_search_goes_on_where_a_chain_finds_no_rest_on_its_way(monkeypatch, least_share):
    """A change that a chain cannot follow is halved; without that the search fails (twin)."""
    monkeypatch.setattr(equilibrium, "LEAST_SHARE", least_share)
    with nullcontext() if least_share < 1.0 else pytest.raises(StepFailed, match="is lost"):
        assert rough(0.0, blind=True).come_to_rest(np.array([0.0035])) == pytest.approx(0.01, abs=2e-6)


def test_a_chain_that_finds_no_rest_ahead_is_moved_back_for_a_slope(monkeypatch):
    """And where it finds none on either side the search ends with the chain's sentence (twin)."""
    for hole, found in ((lambda x: 0.0 < x < 2e-5, True), (lambda x: 0.0 < abs(x) < 2e-5, False)):
        vehicle = rough(0.0)
        within = vehicle.accelerations

        def accelerations(guess, hole=hole, within=within):
            if hole(guess[0]):
                raise StepFailed("the chain is lost")
            return within(guess)

        monkeypatch.setattr(vehicle, "accelerations", accelerations)
        with nullcontext() if found else pytest.raises(StepFailed, match="is lost"):
            assert vehicle.come_to_rest(np.zeros(1)) == pytest.approx(0.01, abs=2e-6)


def test_kinds_of_links_start_in_one_place():
    solid = (kind for name, kind in TRACK_KINDS.items() if name != "planar")
    places = [at_rest(model, *settings).start.equilibrium for model, settings in solid]
    assert all(place.model_copy(update={"tracks": places[0].tracks}) == places[0] for place in places)
    (rigid, _, cable, *_) = (place.tracks[0].tension for place in places)
    assert rigid == pytest.approx(tension(at_rest("rigid")), rel=1e-6), "what is told is what links carry"
    assert rigid != pytest.approx(cable, rel=1e-3)


PLACE, HEADING, RAISED, PITCHED = (3.0, -2.0, 0.25), 0.7, 2.0, 2.8


@pytest.mark.parametrize("pose", ["level", "placed", "raised"])
def test_tracks_are_laid_round_the_wheels_that_the_chassis_shows(pose):
    """Tracks are laid round the wheels that the chassis shows, as drawn or at rest; mounts and sprockets match them."""
    (x, y, z), heading = (PLACE, HEADING) if pose != "level" else ((0.0, 0.0, 0.0), 0.0)
    height, pitch = (RAISED, PITCHED) if pose == "raised" else (0.0, 0.0)
    settings = (f"start.position=[{x}, {y}, {z}]", f"start.heading={heading}", f"start.height={height}")
    vehicle = InProcess(at_rest("rigid", *settings, f"start.pitch={pitch}"))
    c, s = np.cos(heading), np.sin(heading)
    for part in assemble(vehicle.scene).parts:
        if not part.kind.startswith("Track"):
            continue
        side, lateral = part.name.removesuffix("_track"), part.parameters["start.lateral"]
        model, drive = vehicle[part.name].model, vehicle[f"{side}_drive"]
        places = ["sprocket", *(f"road_wheel[{i}]" for i in range(1, 6)), "idler"]
        shown = np.array([[vehicle["chassis"][f"{side}.{place}.{name}"] for name in MOTION] for place in places])
        rows = np.zeros_like(model.start_rows)
        read_states(shown.ravel(), model.frame, rows)
        np.testing.assert_allclose(model.start_rows, rows, rtol=0.0, atol=1e-14 if pose != "level" else 0.0)
        np.testing.assert_allclose([drive[f"sprocket.{name}"] for name in MOTION], shown[0], rtol=0.0, atol=1e-14)
        wheels = start.drawn(part.config["vehicle"], part.config["track"]["wheels"])
        assert len(wheels) == 7
        for wheel in wheels:
            assert ("start" in wheel) == (pose != "raised"), "a raised vehicle must start as drawn"
            ahead, over = wheel["start"][0:3:2] if "start" in wheel else wheel["position"]
            forward, up = np.cos(pitch) * ahead + np.sin(pitch) * over, np.cos(pitch) * over - np.sin(pitch) * ahead
            expected = x + c * forward - s * lateral, y + s * forward + c * lateral, z + up + height
            found = [vehicle["chassis"][f"{side}.{wheel['name']}.position.{axis}"] for axis in "xyz"]
            np.testing.assert_allclose(found, expected, atol=1e-9)


def test_a_vehicle_falls_as_a_whole_until_it_touches():
    """A vehicle falls as a whole by g t^2 / 2 until it touches the ground, also upside down."""
    turned = ("start.pitch=180 deg", "ground.hull=true", "run.step=1 ms", "track.step=1 ms")
    vehicle = InProcess(at_rest("rigid", *turned, "start.height=2.5"))
    parts = [vehicle[name] for name in ("chassis", "left_track", "right_track")]
    before = sum(part["energy.gravity"] for part in parts)
    vehicle.run(0.3)
    fallen = before - sum(part["energy.gravity"] for part in parts)
    assert fallen / 155896.3998 == pytest.approx(0.5 * 9.81 * 0.3**2, rel=1e-6)
    assert [part["ground.force.z"] for part in parts] == [0.0] * 3
    assert InProcess(at_rest("rigid", *turned, "start.height=0.7")).run(0.1)["chassis"]["ground.force.z"] > 1e4


def test_settlement_distance_and_energy_count_from_their_own_starts():
    chassis = InProcess(at_rest("rigid"))["chassis"]
    assert chassis["settlement"] == pytest.approx(0.0302, abs=3e-4)
    assert chassis["distance"] == chassis["energy.gravity"] == 0.0
    assert chassis["energy.spring"] > 1e3


@pytest.mark.long
def test_a_side_without_a_track_goes_without_the_push_of_one():
    """On a side without a track the tensioner has no push and holds its idler where drawn."""
    scene = at_rest("rigid", 'tracks=["left"]')
    place = scene.start.equilibrium
    assert abs(place.right[-1]) < 1e-4
    assert place.left[-1] == pytest.approx(-0.004, abs=5e-4)
    assert scene.push == pytest.approx(32.7e3, rel=1e-2)
    vehicle = InProcess(scene)
    assert abs(vehicle["chassis"]["right.tensioner.force"]) < 100.0
    assert vehicle["chassis"]["left.tensioner.force"] == pytest.approx(28.8e3, rel=1e-2)
    own = at_rest("rigid", 'tracks=["left"]', "vehicle.tensioner.preload=2 kN").start.equilibrium
    assert own.right[-1] == pytest.approx(-2e-3, abs=1e-4), "a user's own preload applies to both sides"


ENERGIES = tuple(f"energy.{kind}" for kind in (*STORED, "dissipated", "covered"))
MADE = 1e-4  # J: largest energy that a vehicle makes or loses as it begins to rest
LEANS = "vehicle.chassis.centre=[-2.006, {}, 0.406]"


def made(scene, duration):
    """Energy, J, that appears while the vehicle of a scene with locked sprockets stands, and the change of its roll."""
    vehicle = InProcess(scene)

    def held():
        return sum(part[name] for part in vehicle.members.values() for name in ENERGIES if name in part.outputs)

    before, roll = held(), vehicle["chassis"]["roll"]
    vehicle.run(duration)
    return abs(held() - before), abs(vehicle["chassis"]["roll"] - roll)


@pytest.mark.long
def test_a_vehicle_that_leans_makes_no_energy(monkeypatch):
    """Its chains rest on the wheels as they lean; on upright wheels they would make 0.3 J in the first step (twin)."""
    scene = at_rest("rigid", LEANS.format(0.1))
    energy, roll = made(scene, 0.02)
    assert scene.start.equilibrium.roll == pytest.approx(-9.0e-4, rel=0.02)
    assert energy < MADE
    assert roll < 2e-6
    other = at_rest("rigid", LEANS.format(0.105))  # of a centre that is 5 % farther aside
    assert made(in_kept_place(scene, other), 0.02)[1] > 4e-6
    monkeypatch.setattr(equilibrium.RigidLinks, "find_equilibrium", lambda model, rows: None)  # it leans them
    assert made(scene, 0.02)[0] > 100.0 * MADE


@pytest.mark.long
@pytest.mark.parametrize(
    ("model", "settings", "most"),
    [
        ("rigid", (LEANS.format(0.6),), 5e-4),
        ("rigid", (LEANS.format(0.3),), 5e-4),
        ("rigid", (LEANS.format(0.4),), 5e-4),
        ("rigid", (LEANS.format(0.6), "ground.bank=0.2"), 0.2),
        ("rigid", ('tracks=["left"]',), 0.01),
        ("rigid", ("vehicle=robot", "vehicle.chassis.centre=[0.32, 0.03, 0.02]"), 1e-5),
        ("rigid", ("vehicle=marder", "run.step=0.5 ms", "track.step=0.5 ms"), 1e-5),
        ("flexible", (LEANS.format(0.6),), 5e-3),
    ],
)
def test_vehicles_that_lean_make_no_energy(model, settings, most):
    assert made(at_rest(model, *settings), 0.05)[0] < most


@pytest.mark.long
def test_a_vehicle_on_one_track_leans_and_stays():
    vehicle = InProcess(at_rest("rigid", 'tracks=["left"]'))
    height, loads = seen(vehicle)
    assert vehicle["chassis"]["roll"] == pytest.approx(0.0193, abs=3e-4)
    borne = vehicle["chassis"]["ground.force.z"] + vehicle["left_track"]["ground.force.z"]
    assert borne == pytest.approx(155896.4 - 64 * 18.02 * 9.81, rel=1e-4)
    vehicle.run(0.25)
    now, pushes = seen(vehicle)
    assert abs(now - height) < HEIGHT
    assert abs(pushes / loads - 1.0).max() < 0.01


@pytest.mark.long
def test_bare_wheels_stand_on_the_ground():
    """Bare wheels stand on the ground, by four numbers of statics."""
    scene = at_rest("rigid", "tracks=[]")
    far, _ = moved(scene, 0.2)
    assert far < 1e-9
    table = scene.vehicle
    vehicle = InProcess(scene)["chassis"]
    weight = 155896.3998 - 2 * table.track.links * table.track.mass * 9.81
    assert vehicle["ground.force.z"] == pytest.approx(weight, rel=1e-6)


@cache
def end_of_settling(model):
    """Settlement and loads of the drawn vehicle after four seconds."""
    settings = ("symmetric=true", "track.link_outputs=false", "run.step=2 ms", "track.step=2 ms")
    vehicle = InProcess(load("settle", model, settings)).run(4.0)
    return seen(vehicle)


@pytest.mark.study
@pytest.mark.parametrize("model", TRACKS)
def test_what_drops_comes_to_rest_where_others_start(model):
    height, loads = end_of_settling(model)
    start, pushes = seen(InProcess(at_rest(model, "symmetric=true")))
    assert start == pytest.approx(height, abs=HEIGHT)
    np.testing.assert_allclose(pushes, loads, rtol=LOAD)


def test_what_begins_as_drawn():
    """Settling vehicles, those that are raised, turned or laid out, and those of logs of an older version."""
    scene = placed(load("settle", "rigid"))
    assert (scene.start.state, scene.start.equilibrium) == ("drawn", None)
    assert InProcess(scene)["chassis"]["settlement"] == 0.0
    for setting in ("start.height=1", "start.pitch=0.1", "start.roll=180 deg", "track.start=polygon"):
        assert load("straight", "rigid", [setting]).start.state == "drawn"
    table = placed(load("straight", "rigid", ["start.state=drawn"])).resolved()
    del table["start"]["state"], table["push"]
    old = from_table(table, "old")
    assert old.start.state == "drawn"
    assert placed(old) is old


def test_a_placed_scene_keeps_its_place():
    """A placed scene keeps its place with another number, as in replays and branches of a log."""
    scene = at_rest("rigid")
    other = changed_scene(scene.resolved(), ["vehicle.suspension.stiffness=2e6"], "log")
    assert placed(other).start.equilibrium == scene.start.equilibrium


@pytest.mark.long
def test_a_vehicle_that_cannot_rest_is_refused_in_an_engineer_s_words(monkeypatch, uncached):
    """Wheels too small for their load pass through the links: the chain has two tensions there, and none is taken."""
    table = random_vehicles.random_vehicle(20)
    scene = load("straight", "flexible", {"vehicle": table})
    config = {**closed_track_config(scene), "link_outputs": False}
    idler = tension_wheel(config, "idler", scene.vehicle.track.tension)
    vehicle = standing.with_idlers(scene.vehicle.model_dump(), [idler[:2]], [idler.pushes])
    parts = {part.name: part for part in own_parts(load("straight", "flexible", {"vehicle": vehicle})).parts}
    track = equilibrium.FlexibleTrack({**parts["left_track"].config, "link_outputs": False}, {})
    sentence = r"it has sagged by (\d+) mm .*: the sprocket, whose track is (\d+) mm above"

    def at_rest():
        return equilibrium.equilibrium(parts["chassis"].config, {"left": track, "right": track})

    with pytest.raises(BadInput, match=sentence) as error:
        at_rest()
    sag, room = map(int, re.search(sentence, str(error.value)).groups())
    pitch, face, wheel = table["track"]["pitch"], table["track"]["face"], table["road_wheel"]
    drawn = wheel["radius"] + face - wheel["z"] - 0.5 * pitch / np.sin(np.pi / table["sprocket"]["teeth"])
    assert room == round(1e3 * drawn)
    assert sag > room
    monkeypatch.setattr(equilibrium, "ACCEPTED", 1.0)
    assert -1e3 * at_rest().height == pytest.approx(sag, abs=0.51)


@pytest.mark.long
@pytest.mark.parametrize(
    ("seed", "k", "model"),
    [
        (9090, 13, "flexible"),
        (9090, 78, "flexible"),
        (9090, 74, "rigid"),
        (20261201, 58, "rigid"),
        (20261201, 99, "rigid"),
    ],
)
def test_vehicles_whose_chains_are_hard_to_lay_out_start(seed, k, model, monkeypatch):
    """Their chains are far on the way still, carry another tension there, or would snap past rollers (twin)."""
    monkeypatch.setattr(random_vehicles, "SEED", seed)
    scene = placed(load("straight", model, {"vehicle": random_vehicles.random_vehicle(k), "symmetric": True}))
    told, asked = scene.start.equilibrium.tracks[0].tension, scene.vehicle.track.tension
    assert told == pytest.approx(asked, rel=0.01)
    track = InProcess(scene)["left_track"]
    assert track["tension.mean"] == pytest.approx(told, rel=1e-3)
    if model == "rigid":
        monkeypatch.setattr(equilibrium.RigidLinks, "_settle_slowly", lambda model, pins: None)
        assert InProcess(scene)["left_track"]["tension.max"] > 1.4 * track["tension.max"]


@pytest.mark.long
def test_a_place_from_which_no_run_starts_is_not_taken(monkeypatch, uncached):
    """A chain that snaps past rollers in every second layout has another tension each time: that of the run is told."""
    monkeypatch.setattr(random_vehicles, "SEED", 20261201)
    monkeypatch.setattr(equilibrium.RigidLinks, "_settle_slowly", lambda model, pins: None)
    settings = {"vehicle": random_vehicles.random_vehicle(99), "symmetric": True, FRICTION: 0.37}
    scene = placed(load("straight", "rigid", settings))
    told = scene.standing.tracks[0].tension
    assert told == pytest.approx(InProcess(scene)["left_track"]["tension.mean"], rel=1e-3)
    assert told > 1.5 * scene.vehicle.track.tension


@pytest.mark.long
@pytest.mark.parametrize("leans", [False, True])
def test_a_run_s_track_has_the_tension_of_the_equilibrium(monkeypatch, uncached, leans):
    """Of a slack crawler-like vehicle, and one that leans; a chain laid out otherwise is refused."""
    settings = {} if leans else {"vehicle": random_vehicles.random_vehicle(16)}
    if leans:
        settings["vehicle.chassis.centre"] = [-2.006, 0.1, 0.406]

    def found(factor):
        monkeypatch.setattr(TrackModel, "lay_out", lambda *given: (lay_out(*given), less(given[0], factor)))
        scene = load("straight", "rigid" if leans else "flexible", {**settings, FRICTION: 0.2 * factor})
        return placed(scene).start.equilibrium

    def less(model, factor):
        model.report[T_MEAN] /= factor

    lay_out = TrackModel.lay_out
    assert found(1.0005) == found(1.0) is not None
    with pytest.raises(BadInput, match="a track that came there carries"):
        found(1.002)


@pytest.mark.long
def test_a_chain_that_finds_no_rest_in_soil_is_lowered_in_shorter_stages(monkeypatch, uncached):
    """A vehicle that sinks by 167 mm; in stages of 50 mm its chain is lost (twin)."""
    settings = {"vehicle": random_vehicles.random_vehicle(104), "ground.soil.name": "clayey_soil_38"}
    settings["run.allow"] = ["belly"]
    rest = placed(load("straight", "flexible", settings)).start.equilibrium
    assert rest.height == pytest.approx(-0.1673, abs=1e-4)
    monkeypatch.setattr(start, "FINER", 0)
    with pytest.raises(BadInput, match="static equilibrium of the track was not found"):
        placed(load("straight", "flexible", {**settings, FRICTION: 0.31}))


@pytest.mark.long
def test_a_tension_that_jumps_ends_the_search(monkeypatch, uncached):
    """As drawn with 6.993 kN more or less, this vehicle carries 4.09 or 6.14 kN, as it rests in two ways."""
    found, one = [], standing.tension_wheel
    monkeypatch.setattr(standing, "tension_wheel", lambda *given: found.append(one(*given)) or found[-1])
    with pytest.raises(BadInput, match=r"nearest tension found is \S+ N, and it jumps: the vehicle rests in two ways"):
        placed(load("straight", "flexible", {"vehicle": random_vehicles.random_vehicle(20)}))
    assert len(found) < standing.MAX_EQUILIBRIA // 2
