"""A vehicle starts in static equilibrium with its chains and the ground, and stays at rest."""

from __future__ import annotations

import re
from contextlib import nullcontext, suppress
from functools import cache

import numpy as np
import pytest
from random_vehicles import random_vehicle
from vehicle_in_process import InProcess

from fmus.interface.model import StepFailed
from fmus.interface.ports import motion_ports
from fmus.physics.wheels import read_states
from fmus.rest import equilibrium, standing
from fmus.track import start
from fmus.track.choices import TRACKS
from fmus.track.model import TrackModel
from fmus.vehicles.tables import BadInput
from orchestrator.results.energy import STORED
from orchestrator.scene import placing
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import changed_scene, from_table, load
from orchestrator.scene.tables import StandingTable

MOTION = [port.name.removeprefix("of.") for port in motion_ports("of", "output")]
HEIGHT, LOAD = 1e-4, 5e-3  # m, and share of each wheel's load: largest motion in the first second
LONG = ("planar", "turning", "beam")  # compile kernels of their own
KINDS = {
    "rigid": ("rigid", ()),
    "rigid, spring": ("rigid", ("track.closure=spring",)),
    "cable": ("flexible", ()),
    "planar": ("flexible", ("planar=true",)),
    "turning": ("flexible", ("track.axes=free",)),
    "beam": ("flexible", ("track.element=beam",)),
}
SHORT = {"turning": 0.1, "beam": 0.1}  # s, of models that take long
FOUR = ("vehicle.road_wheel.x=[-0.7, -1.55, -2.4, -3.25]", "vehicle.suspension.stiffness=8e5")
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


@pytest.mark.parametrize("kind", [pytest.param(k, marks=[pytest.mark.long] if k in LONG else []) for k in KINDS])
def test_a_vehicle_stays_where_it_starts(kind):
    model, settings = KINDS[kind]
    scene = at_rest(model, "symmetric=true", *settings)
    assert 0.0295 < -scene.start.equilibrium.height < 0.0310, "settlement counts from the drawn position"
    far, share = moved(scene, SHORT.get(kind, 1.0))
    assert far < 0.1 * HEIGHT
    assert share < 0.2 * LOAD


@pytest.mark.long
@pytest.mark.parametrize("own", [FOUR, HEAVY, ("ground.hull=true", "vehicle.gravity=15")], ids=["four", "heavy", "g"])
def test_vehicles_of_ones_own_stay_too(own):
    far, share = moved(at_rest("rigid", "symmetric=true", *own), 0.5)
    assert far < HEIGHT
    assert share < LOAD


def test_the_place_of_another_spring_is_not_that_of_this_one():
    """The equilibrium of a suspension that is 3 % stiffer is not that of this one (twin)."""
    other = at_rest("rigid", "symmetric=true", "vehicle.suspension.stiffness=1.03e6").start.equilibrium
    table = at_rest("rigid", "symmetric=true").resolved()
    table["start"]["equilibrium"] = other.model_dump(mode="json")
    far, share = moved(from_table(table, "other"), 0.3)
    assert far > HEIGHT
    assert share > LOAD


STANDING = ("m113", "robot", "dozer", pytest.param("leopard2", marks=pytest.mark.long))
SOFT = "vehicle.material.youngs_modulus=5 GPa"  # a belt of the m113's shape


def tension(scene):
    """Mean tension, N, of the left track of the models of a scene as they start."""
    return InProcess(scene)["left_track"]["tension.mean"]


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


def test_the_start_of_a_scene_moves_no_idler():
    """A drawn start, soil, a slope, one track: the tension asked is the vehicle's, and each adds its own."""
    level = at_rest("rigid")
    for settings in (
        ("start.state=drawn",), ("ground.soil.name=dry_sand",), ("ground.grade=0.2",), ('tracks=["left"]',),
        ("symmetric=true",), ("start.height=1",), ("vehicle.contact.ground.friction=0.8",),
    ):  # fmt: skip
        other = at_rest("rigid", *settings)
        assert (other.vehicle.idler, other.vehicle.tensioner, other.standing) == (
            level.vehicle.idler, level.vehicle.tensioner, level.standing,
        ), settings  # fmt: skip
    assert placing.track_tension(at_rest("rigid", "start.state=drawn").resolved())["start"] == pytest.approx(
        [16.3e3], rel=1e-3
    )
    assert placing.track_tension(at_rest("rigid", "ground.soil.name=dry_sand").resolved())["start"][0] > 1.15 * 14.38e3
    stiffer = at_rest("rigid", "vehicle.tensioner.stiffness=1.05e6")
    assert stiffer.vehicle.tensioner.preload != pytest.approx(level.vehicle.tensioner.preload, rel=1e-3)


def test_what_does_not_stand_keeps_its_tension_as_drawn():
    for settings, why in (
        (("vehicle.gravity=0",), "without gravity"),
        (("start.state=drawn", "vehicle.chassis.centre=[9, 0, 0.4]"), "tips over"),
    ):
        scene = at_rest("rigid", *settings)
        assert why in scene.standing.why
        assert scene.standing.drawn == pytest.approx([14.38e3], rel=1e-3)
        assert scene.standing.tracks == ()
    with pytest.raises(
        BadInput, match=r"tension = 1845\.3 N: the vehicle standing on level, hard ground lacks it: the"
    ):
        placed(load("straight", "rigid", {"vehicle": random_vehicle(6)}))


def test_rigid_links_of_a_belt_start_from_their_own_equilibrium(monkeypatch):
    """They do not stretch: from that of cables their hull jumps, and the chassis says so (twin)."""
    scene = at_rest("rigid", SOFT)
    vehicle = InProcess(scene)
    asked = scene.vehicle.track.tension
    assert vehicle["left_track"]["tension.mean"] == pytest.approx(asked, rel=1e-4)
    vehicle.run(0.05)
    assert vehicle["left_track"]["tension.mean"] == pytest.approx(asked, rel=1e-3)
    assert vehicle["chassis"].model.warnings() == []
    monkeypatch.setattr(equilibrium, "STRETCHED", np.inf)
    monkeypatch.setattr(equilibrium, "cached_result", lambda kind, name, request, compute: compute())
    monkeypatch.setattr(standing, "cached_result", lambda kind, name, request, compute: compute())
    placing._solved_equilibrium.cache_clear()
    placing._solved_standing.cache_clear()
    other = InProcess(at_rest("rigid", SOFT))
    assert abs(other["left_track"]["tension.mean"] / asked - 1.0) > 0.03
    (warning,) = [text for _ in range(3) for text in (other.run(2e-3), *other["chassis"].model.warnings())[1:]]
    hull, lack = map(float, re.search(r"falls with (\S+) m/s2 and .* differ by (\S+) %", warning).groups())
    assert hull < 0.2
    assert lack > 1.0
    placing._solved_equilibrium.cache_clear()
    placing._solved_standing.cache_clear()


def test_a_vehicle_with_sides_of_its_own_has_the_tension_on_both():
    tracks = at_rest("rigid", "vehicle=marder").standing.tracks
    assert [track.tension for track in tracks] == pytest.approx([12260.0] * 2, rel=1e-5)
    sides = at_rest("rigid", LEANS.format(0.1))
    tensions = [track.tension for track in sides.standing.tracks]
    assert np.mean(tensions) == pytest.approx(sides.vehicle.track.tension, rel=1e-5)
    assert tensions[0] != pytest.approx(tensions[1], rel=1e-4)


def test_the_start_depends_on_no_friction_and_no_damping():
    """Of a scene, or set by a host: the places of all links are the same to the bit; not so with the stiffness."""
    start = InProcess(at_rest("rigid"))["left_track"].model.s.q.copy()
    for key, value in {"friction": 0.55, "friction_velocity": 0.03, "damping": 9e3, "stiffness": 2.1e6}.items():
        names = [f"contact.{pair}.{key}" for pair in ("sprocket", "wheel", "ground")]
        of_scene = InProcess(at_rest("rigid", *(f"vehicle.{name}={value}" for name in names)))
        of_host = InProcess(at_rest("rigid"), {"*_track": dict.fromkeys(names, value)})
        for vehicle in (of_scene, of_host):
            assert np.array_equal(vehicle["left_track"].model.s.q, start) == (key != "stiffness"), key


class Rough:
    """Accelerations of one unknown, m/s2, that chains make rough: a kink of 4e-4 m/s2 every few micrometres."""

    unknowns = [0]  # noqa: RUF012

    def __init__(self, phase):
        self.phase = phase

    def accelerations(self, guess):
        return np.array([-150.0 * (guess[0] - 0.01) + 0.9e-4 * np.sin(guess[0] / 5e-7 + self.phase)])


@pytest.mark.parametrize(
    ("difference", "least_share", "finds_all"), [(1e-5, 1.0 / 16.0, True), (1e-6, 1.0, False), (1e-5, 1.0, False)]
)
def test_small_kinks_of_the_chains_forces_stop_no_search(monkeypatch, difference, least_share, finds_all):
    """Quotients over 1 um see slopes of 180 1/s2 in them, more than the suspension's; full steps go round (twins)."""
    monkeypatch.setattr(equilibrium, "DIFFERENCE", difference)
    monkeypatch.setattr(equilibrium, "LEAST_SHARE", least_share)
    found = []
    for phase in np.linspace(0.0, 6.0, 40):
        with suppress(StepFailed):
            found.append(equilibrium._solve(Rough(phase), np.zeros(1))[0])
    assert (len(found) == 40) == finds_all
    assert found == pytest.approx([0.01] * len(found), abs=2e-6)


@pytest.mark.parametrize("least_share", [1.0 / 16.0, 1.0])
def test_a_search_goes_on_where_a_chain_finds_no_rest_on_its_way(monkeypatch, least_share):
    """A change that a chain cannot follow is halved; without that the search fails (twin)."""

    class Blind(Rough):
        def accelerations(self, guess):
            if 0.005 < guess[0] < 0.0065:
                raise StepFailed("the chain is lost")
            return super().accelerations(guess)

    monkeypatch.setattr(equilibrium, "LEAST_SHARE", least_share)
    with nullcontext() if least_share < 1.0 else pytest.raises(StepFailed, match="is lost"):
        assert equilibrium._solve(Blind(0.0), np.array([0.0035])) == pytest.approx(0.01, abs=2e-6)


def test_kinds_of_links_start_in_one_place():
    solid = (kind for name, kind in KINDS.items() if name != "planar")
    places = [at_rest(model, *settings).start.equilibrium for model, settings in solid]
    assert all(place == places[0] for place in places)


@pytest.mark.parametrize("pose", [(), ("start.heading=0.7", "start.position=[3, -2, 0.25]")])
def test_tracks_are_laid_round_the_wheels_that_the_chassis_shows(pose):
    """Tracks are laid round the wheels that the chassis shows; mounts and sprockets match them."""
    vehicle = InProcess(at_rest("rigid", *pose))
    for side in ("left", "right"):
        model, drive = vehicle[f"{side}_track"].model, vehicle[f"{side}_drive"]
        places = ["sprocket", *(f"road_wheel[{i}]" for i in range(1, 6)), "idler"]
        shown = np.array([[vehicle["chassis"][f"{side}.{place}.{name}"] for name in MOTION] for place in places])
        rows = np.zeros_like(model.start_rows)
        read_states(shown.ravel(), model.frame, rows)
        np.testing.assert_allclose(model.start_rows, rows, rtol=0.0, atol=1e-14 if pose else 0.0)
        np.testing.assert_allclose([drive[f"sprocket.{name}"] for name in MOTION], shown[0], rtol=0.0, atol=1e-15)


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


def test_a_vehicle_that_leans_makes_no_energy():
    """Its chains rest on the wheels as they lean; on upright wheels they would make 0.3 J in the first step (twin)."""
    scene = at_rest("rigid", LEANS.format(0.1))
    energy, roll = made(scene, 0.02)
    assert scene.start.equilibrium.roll == pytest.approx(-9.0e-4, rel=0.02)
    assert energy < MADE
    assert roll < 2e-6
    other = at_rest("rigid", LEANS.format(0.105)).start.equilibrium  # of a centre that is 5 % farther aside
    table = scene.resolved()
    table["start"]["equilibrium"] = other.model_dump(mode="json")
    assert made(from_table(table, "other"), 0.02)[1] > 4e-6


def test_chains_on_upright_wheels_under_a_hull_that_leans_are_found(monkeypatch):
    """The fault that the last test looks for, planted."""

    def upright(model, pins):
        model.start_rows[:, 9:12] = 0.0, 1.0, 0.0
        model.settle(pins, rest=True)

    monkeypatch.setattr(TrackModel, "_lean", upright)
    assert made(at_rest("rigid", LEANS.format(0.1)), 0.02)[0] > 100.0 * MADE


@pytest.mark.long
@pytest.mark.parametrize(
    ("model", "settings", "most"),
    [
        ("rigid", (LEANS.format(0.6),), 5e-4),
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


def test_settling_begins_as_drawn():
    scene = placed(load("settle", "rigid"))
    assert (scene.start.state, scene.start.equilibrium) == ("drawn", None)
    assert InProcess(scene)["chassis"]["settlement"] == 0.0


@pytest.mark.parametrize("setting", ["start.height=1", "start.pitch=0.1", "start.roll=180 deg", "track.start=polygon"])
def test_what_is_raised_turned_or_laid_out_begins_as_drawn(setting):
    assert load("straight", "rigid", [setting]).start.state == "drawn"
    with pytest.raises(BadInput, match=r"state = 'equilibrium' needs"):
        load("straight", "rigid", [setting, "start.state=equilibrium"])


def test_a_log_of_old_begins_as_it_did():
    """A log of an older version starts as it did: its scene is placed and has no equilibrium."""
    table = placed(load("straight", "rigid", ["start.state=drawn"])).resolved()
    del table["start"]["state"], table["push"]
    scene = from_table(table, "old")
    assert scene.start.state == "drawn"
    assert placed(scene) is scene


def test_a_placed_scene_keeps_its_place():
    """A placed scene keeps its place with another number, as in replays and branches of a log."""
    scene = at_rest("rigid")
    other = changed_scene(scene.resolved(), ["vehicle.suspension.stiffness=2e6"], "log")
    assert placed(other).start.equilibrium == scene.start.equilibrium


def test_no_equilibrium_is_a_sentence():
    """A hull so far forward that it tips over has no equilibrium, which the error says."""
    with pytest.raises(BadInput, match=r"equilibrium was not found, start\.state = 'drawn' needs none"):
        placed(load("straight", "rigid", ["vehicle.chassis.centre=[9, 0, 0.4]"]))


def test_a_vehicle_that_cannot_rest_is_refused_in_an_engineer_s_words(monkeypatch):
    """Wheels too small for their load pass through the links: the chain has two tensions there, and none is taken."""
    monkeypatch.setattr(equilibrium, "cached_result", lambda kind, name, request, compute: compute())
    table = random_vehicle(20)
    sentence = r"it has sagged by (\d+) mm .*: the sprocket, whose track is (\d+) mm above"
    scene = load("straight", "flexible", {"vehicle": table})
    place = placing._laid_idler(scene, scene.vehicle.track.tension, "vehicle.track")
    scene = placing._with_idlers(scene, [place.x], [place.push], StandingTable(drawn=()))
    with pytest.raises(BadInput, match=sentence) as error:
        placing._scene_at_rest(scene)
    sag, room = map(int, re.search(sentence, str(error.value)).groups())
    pitch, face, wheel = table["track"]["pitch"], table["track"]["face"], table["road_wheel"]
    drawn = wheel["radius"] + face - wheel["z"] - 0.5 * pitch / np.sin(np.pi / table["sprocket"]["teeth"])
    assert room == round(1e3 * drawn)
    assert sag > room
    with monkeypatch.context() as without:
        without.setattr(equilibrium, "ACCEPTED", 1.0)
        taken = placing._scene_at_rest(scene).start.equilibrium
    assert -1e3 * taken.height == pytest.approx(sag, abs=0.51)
    placing._solved_equilibrium.cache_clear()
    beyond = re.compile(r"its centre of mass is 3\.50 m ahead of its foremost road wheel, so it tips over")
    monkeypatch.setattr(equilibrium, "MOST_STEPS", 1)
    with pytest.raises(BadInput, match=beyond):
        placed(load("straight", "rigid", ["vehicle.chassis.centre=[12, 0, 0.4]"]))


@pytest.mark.parametrize("leans", [False, pytest.param(True, marks=pytest.mark.long)])
def test_a_run_s_track_has_the_tension_of_the_equilibrium(monkeypatch, leans):
    """Of a slack crawler-like vehicle, and one that leans; a chain laid out otherwise is refused."""
    settings = [LEANS.format(0.1)] if leans else {"vehicle": random_vehicle(16)}

    def found():
        placing._solved_equilibrium.cache_clear()
        return placed(load("straight", "rigid" if leans else "flexible", settings)).start.equilibrium

    rest = found()
    assert rest is not None
    measured, factor = equilibrium._ChainOnWheels.tension_laid_out, 1.0005

    monkeypatch.setattr(equilibrium, "cached_result", lambda kind, name, request, compute: compute())
    monkeypatch.setattr(equilibrium._ChainOnWheels, "tension_laid_out", lambda self: measured(self) / factor)
    assert found() == rest
    factor = 1.002
    with pytest.raises(BadInput, match="a track that came there carries"):
        found()
    placing._solved_equilibrium.cache_clear()


@pytest.mark.long
def test_a_chain_that_finds_no_rest_in_soil_is_lowered_in_shorter_stages(monkeypatch):
    """A vehicle that sinks by 167 mm; in stages of 50 mm its chain is lost (twin)."""
    scene = load(
        "straight",
        "flexible",
        {"vehicle": random_vehicle(104), "ground.soil.name": "clayey_soil_38", "run.allow": ["belly"]},
    )
    assert placed(scene).start.equilibrium.height == pytest.approx(-0.1673, abs=1e-4)
    monkeypatch.setattr(start, "FINER", 0)
    monkeypatch.setattr(equilibrium, "cached_result", lambda kind, name, request, compute: compute())
    placing._solved_equilibrium.cache_clear()
    with pytest.raises(BadInput, match="static equilibrium of the track was not found"):
        placed(scene)
    placing._solved_equilibrium.cache_clear()


@pytest.mark.long
def test_a_tension_that_jumps_ends_the_search(monkeypatch):
    """As drawn with 6.993 kN more or less, this vehicle carries 4.09 or 6.14 kN, as it rests in two ways."""
    found, one = [], standing._Search._standing
    monkeypatch.setattr(standing, "cached_result", lambda kind, name, request, compute: compute())
    monkeypatch.setattr(standing._Search, "_standing", lambda *given: found.append(one(*given)) or found[-1])
    with pytest.raises(BadInput, match=r"nearest tension is \S+ N, and it jumps: the vehicle rests in two ways"):
        placed(load("straight", "flexible", {"vehicle": random_vehicle(20)}))
    assert len(found) < standing.MOST // 2
