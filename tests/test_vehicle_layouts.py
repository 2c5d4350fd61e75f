"""Layouts of vehicles beside that of the m113: sprocket at the rear, return rollers, sides that differ."""

import copy
import json
import re
import tomllib
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from vehicle_in_process import InProcess
from vehicle_tables import M113, REAR, ROLLERS, SPRING

from fmus.chassis.tree import WHOLE, tree
from fmus.components import model_of
from fmus.driver.skid import SkidVehicle, skid_vehicle
from fmus.ground.tables import number_meanings
from fmus.interface import numbers
from fmus.interface.model import InvalidParameter
from fmus.interface.numbers import packed
from fmus.rest.equilibrium import is_asymmetric
from fmus.vehicles.sides import ground_level, ground_wheels, lopsided, of_wheels, places_of_wheels
from fmus.vehicles.tables import BadInput
from fmus.vehicles.vehicle import TAKEN, VehicleTable, read_table, vehicle
from orchestrator.results.views.shapes import wheel_body
from orchestrator.scene import placing
from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load
from orchestrator.scene.settings import entries, toml_text
from orchestrator.scene.values import overlapping_wheels
from orchestrator.studies.mobility.theory import centre_of_mass, largest_gap, largest_step
from orchestrator.studies.step_limits import pairs

UNSTRETCHED = 1.0017  # tension of rigid links over that of the cables in whose place they stand
STAGGERED = {"track": {"links": 65}, "road_wheel": {"x": [x + 0.085 for x in M113["road_wheel"]["x"]]},
             "idler": {"x": -4.08}}  # fmt: skip


def changed(**parts):
    """Table of the m113 with other parts."""
    return {**copy.deepcopy(M113), **parts}


def mirrored(table):
    """Table of a vehicle mirrored in the plane x = 0: its sprocket is at the other end."""
    table = copy.deepcopy(table)
    table["chassis"]["centre"][0] *= -1.0
    table["chassis"]["hull"] = [[-x, y, z] for x, y, z in table["chassis"]["hull"]]
    table["road_arm"]["pivot"][0] *= -1.0
    for name in ("on_arm", "on_chassis"):
        table["suspension"][name][0] *= -1.0
    table["idler"]["x"] *= -1.0
    for name in ("road_wheel", "return_roller"):
        if name in table:
            table[name]["x"] = [-x for x in reversed(table[name]["x"])]
    return table


def test_a_belt_is_the_numbers_of_its_links():
    """They are in the resolved table, which is read again as it is."""
    track = {key: value for key, value in M113["track"].items() if key not in ("pitch", "mass", "inertia", "face")}
    belt = {
        "bending": "20 N m^2",
        "relaxation_time": "2 ms",
        "length": "9.6 m",
        "mass": "640 kg",
        "thickness": "0.06 m",
    }
    made = vehicle(
        changed(track={**track, "links": 64, "width": 0.38, "belt": belt, "bushing": {"preset": 0.1}}), "own"
    )
    links = made.track
    assert (links.pitch, links.mass, links.face) == pytest.approx((0.15, 10.0, 0.03), rel=1e-14)
    sizes = [size * size for size in (0.15, 0.38, 0.06)]
    assert links.inertia == pytest.approx([10.0 / 12.0 * (sum(sizes) - size) for size in sizes], rel=1e-12)
    assert links.bushing.model_dump(exclude_defaults=True) == pytest.approx(
        {"stiffness": 20.0 / 0.15, "damping": 0.04 / 0.15, "preset": 0.1}, rel=1e-14
    )
    assert vehicle(made.model_dump(), "own") == made


def at_rest(table, *settings):
    """Scene `straight` with this vehicle, which rests for two seconds."""
    return placed(load("straight", "rigid", {"vehicle": table, "track.link_outputs": False, **dict(settings)}))


def unbalanced(running, table):
    """Force, N, and moment about the world's origin, N m, of a chassis under the wrenches of its tracks, by hand."""
    chassis, g = running["chassis"], table.gravity

    def vector(member, name):
        return np.array([running[member][f"{name}.{axis}"] for axis in "xyz"])

    force, moment = np.zeros(3), np.zeros(3)

    def add(place, f, torque=0.0):
        nonlocal force, moment
        force, moment = force + f, moment + np.cross(place, f) + torque

    def weigh(mass, place):
        add(place, np.array([0.0, 0.0, -mass * g]))

    hull = Rotation.from_quat([chassis[f"chassis.orientation.{part}"] for part in "wxyz"], scalar_first=True)
    centre = vector("chassis", "chassis.position")
    weigh(table.chassis.mass, centre)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        of_side, track = table.of_side(side), f"{side}_track"
        weigh(table.sprocket.mass, vector("chassis", f"{side}.sprocket.position"))
        weigh(table.idler.mass, vector("chassis", f"{side}.idler.position"))
        for name, further in table.wheel.items():
            weigh(further.mass, vector("chassis", f"{side}.{name}.position"))
        for i in range(1, 1 + len(table.return_roller.x if table.return_roller else ())):
            mass = of_wheels(table.return_roller.mass, i)[i - 1]
            weigh(mass, vector("chassis", f"{side}.return_roller[{i}].position"))
        for i, x in enumerate(of_side.road_wheel.x, 1):
            wheel = vector("chassis", f"{side}.road_wheel[{i}].position")
            z, mass = (of_wheels(getattr(table.road_wheel, key), i)[i - 1] for key in ("z", "mass"))
            drawn = np.array([x, sign * table.track.lateral, z]) - table.chassis.centre
            weigh(mass, wheel)
            if table.road_arm is None:
                np.testing.assert_allclose(wheel, centre + hull.apply(drawn), atol=1e-12)  # on an axle of the hull
                continue
            px, pz = places_of_wheels(table.road_arm.pivot, i)[i - 1]
            pin = centre + hull.apply(drawn + np.array([px, 0.0, pz]))
            weigh(of_wheels(table.road_arm.mass, i)[i - 1], 0.5 * (wheel + pin))
        wheels = [name.removesuffix(".force.x") for name in running[track].outputs if name.endswith(".force.x")]
        for name in (name for name in wheels if name != "ground"):
            place = vector("chassis", f"{side}.{name}.position")
            add(place, vector(track, f"{name}.force"), vector(track, f"{name}.torque"))
    return force, moment


def strands(running, side, name, wheel):
    """Places of the pins (n, 2), m, and of each strand that leaves a wheel the pins beside it and one further."""
    track, chassis, table = running[f"{side}_track"], running["chassis"], running.scene.vehicle.track
    values = dict(zip(track.links, track.link_outputs(), strict=True))
    count = max(int(key[6:].partition("]")[0]) for key in values if key.startswith("joint["))
    pins = np.array([[values[f"joint[{i + 1}].position.{axis}"] for axis in "xz"] for i in range(count)])
    centre = [chassis[f"{side}.{name}.position.{axis}"] for axis in "xz"]
    near = np.linalg.norm(pins - centre, axis=1) < np.hypot(wheel.radius + table.face, 1.3 * table.pitch)
    ends = [(i, i - 1) if near[i] else (i - 1, i) for i in np.flatnonzero(near != np.roll(near, 1))]
    assert len(ends) == 2
    return pins, ends, [values[f"joint[{inside % count + 1}].force.x"] for inside, _ in ends]


def pull_on(running, side, name, wheel):
    """Horizontal force of the chain on a wheel, N, from the pin forces where its strands leave it."""
    pins, ends, forces = strands(running, side, name, wheel)
    ahead = [np.sign(pins[outside, 0] - pins[inside, 0]) for inside, outside in ends]
    return abs(np.dot(ahead, np.abs(forces)))


def pull_of_tension(running, side, name, wheel):
    """The same from the mean tension of the chain, which is larger higher up by the weight between, and directions."""
    pins, ends, _ = strands(running, side, name, wheel)
    vehicle = running.scene.vehicle
    weight, mean = vehicle.track.mass * vehicle.gravity / vehicle.track.pitch, running[f"{side}_track"]["tension.mean"]
    pulls = []
    for inside, outside in ends:
        way, height = pins[outside] - pins[inside], pins[inside, 1] - pins[:, 1].mean()
        pulls.append((mean + weight * height) * way[0] / np.linalg.norm(way))
    return abs(sum(pulls))


def of_page(name):
    """Table of the vehicle of a scene that the page on scenes shows."""
    page = (Path(__file__).parents[1] / "orchestrator" / "scenes.md").read_text(encoding="utf-8")
    shown = re.search(rf"`{name}.toml`:\n\n```toml\n(.*?)```", page, re.DOTALL)[1]
    own = load("straight", "rigid", {"vehicle": tomllib.loads(shown)["vehicle"]}).vehicle
    return own.model_dump(mode="json", exclude_none=True)


UNLIKE = {  # raised end wheels, each of another radius
    "radius": [0.25, 0.305, 0.305, 0.305, 0.27], "z": [-0.19, -0.215, -0.215, -0.215, -0.21],
    "mass": [377.0, 561.07, 561.07, 561.07, 440.0], "spin_inertia": [11.8, 26.06, 26.06, 26.06, 16.0],
}  # fmt: skip
RAISED = changed(road_wheel={**M113["road_wheel"], **UNLIKE})
LONGER = {**M113["track"], "links": 66}
SECOND = changed(wheel={"rear_idler": {**REAR, "tensioner": SPRING}}, track=LONGER)
BEAMS = {  # of three and two wheels; each arm has a mass of its own
    "beams": [[1, 2, 3], [4, 5]], "mass": [90.0, 40.0, 120.0, 60.0, 30.0],
    "pin_inertia": [3.0, 0.5, 5.0, 1.0, 0.6], "long_inertia": [0.4, 0.2, 0.5, 0.3, 0.1],
    "pivot": [[-0.717, 0.15], [-0.05, 0.15], [0.617, 0.15], [-0.3, 0.15], [0.366, 0.15]],
}  # fmt: skip
ARMS = [0.5 * ahead for ahead, _ in BEAMS["pivot"]]  # x of their middles from the wheels, m
ON_BEAMS = {key: value for key, value in changed(road_arm=BEAMS).items() if key != "suspension"}
ANGLED = changed(tensioner={**M113["tensioner"], "angle": 0.3})
TABLES = {
    "m113": M113,
    "second idler": SECOND,
    "beams": ON_BEAMS,
    "fixed second idler": changed(wheel={"rear_idler": REAR}, track=LONGER, return_roller=ROLLERS),
    "rollers": changed(return_roller=ROLLERS),
    "staggered": changed(return_roller=ROLLERS, right=STAGGERED),
    "raised": RAISED,
    "raised rollers": changed(
        road_wheel=RAISED["road_wheel"],
        return_roller={**ROLLERS, "radius": [0.1, 0.118, 0.13], "mass": [70.0, 90.0, 120.0]},
    ),
    **{
        name: vehicle(*read_table(name)).model_dump(mode="json", exclude_none=True)
        for name in ("marder", "robot", "leopard2", "dozer", "highdrive", "groomer")
    },
    "triangle": of_page("triangle"),
}


# Tensioners of 4 and 8 MN/m and axles without springs make more force of the 0.2 mm between rigid links and cables.
STIFF = {"leopard2": 2.0, "dozer": 4.0, "highdrive": 4.0}


SLOW = "marder", "staggered", "raised", "groomer"  # sides that differ; kernels of belts


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.long] * (name in SLOW)) for name in TABLES])
def test_a_vehicle_starts_in_balance_by_hand(name):
    """Weights of all bodies and wrenches of the tracks balance on the chassis, and tracks carry their own weight.

    The push of each tensioner is the force of the two pins beside its idler, where the chain is cut.
    """
    known = vehicle(TABLES[name], name)
    running = InProcess(at_rest(TABLES[name], ("track.link_outputs", ["position", "force"])))
    force, moment = unbalanced(running, known)
    weight = known.total_mass() * known.gravity
    more = STIFF.get(name, 1.0)
    assert np.abs(force[[0, 2]]).max() < more * 1e-4 * weight
    assert np.abs(moment[:2]).max() < more * 5e-4 * weight  # rigid links; the search has cables
    for side in ("left", "right"):
        pull = pull_on(running, side, "idler", known.idler)
        assert abs(running[f"{side}_track"]["idler.force.x"]) == pytest.approx(pull, rel=1e-6)
        assert running["chassis"][f"{side}.tensioner.force"] == pytest.approx(pull, rel=more * 5e-3)
    ground = sum(running[f"{side}_track"]["ground.force.z"] for side in ("left", "right"))
    assert ground == pytest.approx(weight, rel=more * 1e-4)


def test_the_track_loads_a_beam_in_balance_about_its_pivot():
    """Wheels of a beam turn with it; their loads, and the weights of wheels and arms, have no moment about its pivot.

    The twin: the masses of the arms from rear to front.
    """
    running = InProcess(at_rest(ON_BEAMS))
    known, chassis, track = running.scene.vehicle, running["chassis"], running["left_track"]
    pitch = chassis["pitch"]

    def moment(beam, masses):
        total, angle = 0.0, chassis[f"left.road_arm[{beam[0]}].angle"]
        assert [chassis[f"left.road_arm[{k}].angle"] for k in beam] == [angle] * len(beam)
        for k in beam:
            ahead, up = -np.array(BEAMS["pivot"][k - 1])  # of the wheel centre from the pivot
            c, s = np.cos(angle + pitch), np.sin(angle + pitch)
            x, z = c * ahead + s * up, c * up - s * ahead
            weight = known.gravity * np.array([known.road_wheel.mass, 0.5 * masses[k - 1]]).sum()
            total += z * track[f"road_wheel[{k}].force.x"] - x * (track[f"road_wheel[{k}].force.z"] - weight)
        return total

    for beam in BEAMS["beams"]:
        assert abs(chassis[f"left.road_arm[{beam[0]}].angle"]) > 1e-4
        assert moment(beam, BEAMS["mass"]) == pytest.approx(0.0, abs=10.0)  # rigid links; the search has cables
        assert abs(moment(beam, BEAMS["mass"][::-1])) > 80.0


def reach(running, side, name):
    """Distance from the centre of a wheel to the line of the pins, m."""
    track = running[f"{side}_track"]
    values = dict(zip(track.links, track.link_outputs(), strict=True))
    count = sum(key.endswith("].position.x") and key.startswith("joint") for key in values)
    a = np.array([[values[f"joint[{i}].position.{axis}"] for axis in "xz"] for i in range(1, count + 1)])
    way = np.roll(a, -1, axis=0) - a
    to = np.array([running["chassis"][f"{side}.{name}.position.{axis}"] for axis in "xz"]) - a
    share = np.clip((to * way).sum(1) / (way * way).sum(1), 0.0, 1.0)
    return np.linalg.norm(to - share[:, None] * way, axis=1).min()


def test_a_vehicle_stands_on_wheels_that_differ_as_asked():
    """Its tracks carry the tension asked, links lie on the rims of raised wheels, and both sides are alike.

    The twins: a mass that is 5 % off is out of balance by hand, a radius that is 3 % off is no rim that links touch.
    """
    scene = at_rest(RAISED, ("track.link_outputs", ["position", "force"]))
    left, right = scene.standing.tracks
    assert (left.tension, right.tension) == pytest.approx([UNSTRETCHED * scene.vehicle.track.tension] * 2, rel=1e-3)
    assert left.loads == pytest.approx(right.loads, rel=1e-9)
    assert max(left.loads[0], left.loads[4]) < 0.2 * min(left.loads[1:4])
    running, face = InProcess(scene), scene.vehicle.track.face
    for side in ("left", "right"):
        for i in (1, 5):  # hardly loaded, they sink by less than 5 mm
            away, radius = reach(running, side, f"road_wheel[{i}]") - face, UNLIKE["radius"][i - 1]
            assert [0.0 < part * radius - away < 5e-3 for part in (1.0, 0.97, 1.03)] == [True, False, False]
    weight = scene.vehicle.total_mass() * scene.vehicle.gravity
    heavier = {**RAISED["road_wheel"], "mass": [*UNLIKE["mass"][:4], 1.05 * UNLIKE["mass"][4]]}
    for table, sign in ((RAISED, -1.0), (changed(road_wheel=heavier), 1.0)):
        force, _ = unbalanced(running, vehicle(table, "raised"))
        assert sign * (abs(force[2]) - 1e-4 * weight) > 0.0


def read_by_others(table):
    """Wheels of a vehicle as its readers other than a chassis take them: driver, theory, limits, pictures, ground."""
    known = vehicle(table, "own")
    scene = load("straight", "rigid", {"vehicle": table})
    shapes = [
        wheel_body(f"left_track/{name}[2]", name, "left_track", table) for name in ("road_wheel", "return_roller")
    ]
    return (
        [np.array(part).tolist() for part in skid_vehicle(table)[0]], largest_step(known), centre_of_mass(known),
        pairs(scene), [(shape.radius, shape.width) for shape in shapes], ground_level(table), known.total_mass(),
        list(overlapping_wheels(table)),
    )  # fmt: skip


def test_a_list_of_equal_numbers_is_that_number():
    one = changed(return_roller=ROLLERS)
    each = copy.deepcopy(one)
    for name in ("road_wheel", "return_roller"):
        count = len(one[name]["x"])
        each[name] |= {key: [value] * count for key, value in one[name].items() if key != "x"}
    assert read_by_others(each) == read_by_others(one)
    for key in ("mass", "pin_inertia", "long_inertia", "pivot"):
        each["road_arm"][key] = [one["road_arm"][key]] * len(one["road_wheel"]["x"])
    assert read_by_others(each) == read_by_others(one)
    trees = [tree(vehicle(table, "own").model_dump(), 2) for table in (each, one)]
    for key in ("hinge", "leaf_mass", "across", "along", "transverse", "spin_inertia", "fraction", "masses", "travel"):
        np.testing.assert_array_equal(*(getattr(each, key) for each in trees))


def test_readers_take_the_number_of_each_wheel():
    """Raised wheels carry no load in the driver's vehicle; the lowest one stands on the ground, the last one hangs."""
    low, raised = (read_by_others(changed(road_wheel=wheel, return_roller=ROLLERS))
                   for wheel in (M113["road_wheel"], {**M113["road_wheel"], **UNLIKE}))  # fmt: skip
    wheels = SkidVehicle._fields.index("wheels")
    assert (len(low[0][wheels]), len(raised[0][wheels])) == (5, 3)
    assert raised[5] == low[5]  # the ground
    assert low[6] - raised[6] == pytest.approx(2.0 * (2.0 * 561.07 - 377.0 - 440.0))
    assert raised[3]["road wheel on its link"].m2 < low[3]["road wheel on its link"].m2 - 180.0
    heavy = [*UNLIKE["mass"][:4], 2.0 * UNLIKE["mass"][4]]
    moved = centre_of_mass(vehicle(changed(road_wheel={**M113["road_wheel"], **UNLIKE, "mass": heavy}), "own"))
    assert moved[0] < centre_of_mass(vehicle(RAISED, "own"))[0] - 0.05  # the last wheel is behind it
    for known in (vehicle(table, "own") for table in (RAISED, SECOND, ON_BEAMS)):
        chains = 2.0 * known.track.links * known.track.mass
        assert tree(known.model_dump(), 2).masses[WHOLE] == pytest.approx(known.total_mass() - chains, rel=1e-12)
        assert skid_vehicle(known.model_dump())[0].mass == pytest.approx(known.total_mass(), rel=1e-12)
    behind = changed(road_arm={**BEAMS, "mass": BEAMS["mass"][::-1]})
    places = [centre_of_mass(vehicle(table, "own"))[0] for table in (changed(road_arm=BEAMS), behind)]
    ways = [skid_vehicle(table)[1] for table in (changed(road_arm=BEAMS), behind)]
    moment = 2.0 * np.dot(np.subtract(BEAMS["mass"][::-1], BEAMS["mass"]), np.add(M113["road_wheel"]["x"], ARMS))
    assert np.diff(places)[0] == pytest.approx(moment / known.total_mass(), rel=1e-9)
    assert np.diff(ways)[0] == pytest.approx(moment / known.total_mass(), rel=1e-9)
    shape = wheel_body("left_track/road_wheel[5]", "road_wheel", "left_track", RAISED)
    assert shape.radius == 0.27


def test_ends_of_the_theory_are_wheels_on_level_ground():
    """Raised end wheels bear no gap; a second idler on the ground is the last one, one 20 mm higher (twin) is not."""
    raised, road = vehicle(RAISED, "own"), M113["road_wheel"]["x"]
    x, _ = centre_of_mass(raised)
    assert largest_gap(raised).low == pytest.approx(min(x - road[3], road[1] - x))
    assert largest_step(raised).low < largest_step(vehicle(M113, "own")).low
    for z, more in ((-0.32, [-4.6]), (-0.30, [])):
        known = vehicle({**RAISED, "wheel": {"rear_idler": {**REAR, "x": -4.6, "z": z}}}, "own")
        places, (x, _) = [*road[1:4], *more], centre_of_mass(known)
        assert [wheel["x"] for wheel in ground_wheels(known.model_dump())] == places
        assert largest_gap(known) == pytest.approx((min(x - places[-1], places[0] - x), min(x + 4.6, -x)))


@pytest.mark.long
def test_a_vehicle_with_its_sprocket_at_the_rear_is_a_mirror_image():
    """The m113 mirrored in x has mirrored idlers and rests mirrored; driven backwards it moves as the m113 forwards."""
    table = changed(return_roller=ROLLERS)
    here, there = at_rest(table), at_rest(mirrored(table))
    assert there.vehicle.idler.x == pytest.approx(-here.vehicle.idler.x, abs=1e-5)
    assert there.push == pytest.approx(here.push, rel=1e-4)
    a, b = here.start.equilibrium, there.start.equilibrium
    assert b.height == pytest.approx(a.height, abs=1e-5)
    assert b.pitch == pytest.approx(-a.pitch, abs=1e-5)
    assert b.left[:5] == pytest.approx([-angle for angle in a.left[4::-1]], abs=1e-4)
    assert b.left[5] == pytest.approx(-a.left[5], abs=1e-5)
    driven = {"drive.ramp_start": 0.0, "drive.ramp_time": 0.6, "run.stop": 1.0}
    forwards = InProcess(at_rest(table, *driven.items(), ("drive.speed", 6.0))).run(0.8)
    backwards = InProcess(at_rest(mirrored(table), *driven.items(), ("drive.speed", -6.0))).run(0.8)
    distance = forwards["chassis"]["distance"]
    assert distance > 0.5
    assert backwards["chassis"]["distance"] == pytest.approx(-distance, rel=2e-3)
    assert backwards["chassis"]["left.tensioner.force"] == pytest.approx(
        forwards["chassis"]["left.tensioner.force"], rel=0.03
    )


@pytest.mark.long
def test_equal_sides_by_two_ways():
    """A table right that repeats the left side is solved as two sides, which come to rest as one half does."""
    one = at_rest(changed())
    two = at_rest(changed(right={"track": {"links": 64}}))
    a, b = one.start.equilibrium, two.start.equilibrium
    assert two.vehicle.right.idler.x == one.vehicle.idler.x
    assert two.vehicle.right.tensioner.preload == two.vehicle.tensioner.preload
    assert (b.height, *b.left, *b.right) == pytest.approx((a.height, *a.left, *a.right), abs=1e-7)
    assert b.roll == pytest.approx(0.0, abs=1e-8)


def test_cables_of_sides_that_differ_have_free_axes():
    axes = [load("straight", "flexible", {"vehicle": t}).track.axes for t in (changed(), changed(right=STAGGERED))]
    assert axes == [None, "free"]


def test_every_point_of_a_vehicle_is_compared_with_its_mirror_image():
    """All keys of three lengths are points; seats do not act."""
    schema = VehicleTable.model_json_schema()
    parts = {
        key: entry.get("items", entry).get("prefixItems") or () for key, entry, _ in entries(schema, schema["$defs"])
    }
    points = [key for key, each in parts.items() if len(each) == 3 and all(one["unit"] == "m" for one in each)]
    assert points == ["chassis.centre", "chassis.hull", "seat.NAME.position"]
    assert not lopsided(changed())
    for key in ("centre", "hull"):
        moved = changed()
        point = moved["chassis"][key]
        (point if key == "centre" else point[3])[1] += 1e-6
        assert lopsided(moved) == f"chassis.{key}"
    assert is_asymmetric({"vehicle": moved, "chassis": {"ground": {"hull": True}}}, ("left", "right"))
    assert not is_asymmetric({"vehicle": moved, "chassis": {}}, ("left", "right"))
    assert is_asymmetric({"vehicle": moved, "chassis": {"one_sided": True}}, ("left", "right"))


@pytest.mark.parametrize(("settings", "one_sided"), [
    ({}, False), ({"start.heading": "2 deg"}, True), ({"ground.washboard.phase": "10 deg"}, True),
])  # fmt: skip
def test_waves_across_a_vehicle_leave_it_its_own_mirror_image(settings, one_sided, monkeypatch):
    """Only half of it is solved for its start, so both sides have one drive."""

    def asked(problem):
        hull, *_ = json.loads(problem)
        assert is_asymmetric(hull, ("left", "right")) == one_sided
        raise BadInput("enough")

    monkeypatch.setattr(placing, "_solved_equilibrium", asked)
    monkeypatch.setattr(placing, "_tensioned_scene", lambda scene: scene)
    on_waves = {"symmetric": False, "start.position": [6.3, 0.0, 0.0]}
    with pytest.raises(BadInput, match="enough"):
        placing.placed(load("washboard", "rigid", on_waves | settings))


def second(**parts):
    """Table of the m113 with a second idler, whose own table has other parts."""
    return {**SECOND, "wheel": {"rear_idler": {**SECOND["wheel"]["rear_idler"], **parts}}}


OF_PINS = ("track.link_outputs", ["position", "force"])


def test_a_second_idler_is_held_by_its_own_spring():
    """Its push is that of its spring, and the chain's tension times the directions of its strands.

    The twins: a stiffness that is 3 % off, and a tension.
    """
    running = InProcess(at_rest(SECOND, OF_PINS))
    vehicle, chassis = running.scene.vehicle, running["chassis"]
    wheel, push = vehicle.wheel["rear_idler"], chassis["left.rear_idler.tensioner.force"]
    hull = Rotation.from_quat([chassis[f"chassis.orientation.{part}"] for part in "wxyz"], scalar_first=True)
    place, centre = (
        np.array([chassis[f"{name}.position.{axis}"] for axis in "xyz"]) for name in ("left.rear_idler", "chassis")
    )
    slide = hull.inv().apply(place - centre)[0] - (wheel.x - vehicle.chassis.centre[0])
    assert slide == pytest.approx(-1.41e-3, rel=0.01)
    of_spring = [wheel.tensioner.preload + part * wheel.tensioner.stiffness * slide for part in (1.0, 1.03)]
    assert push == pytest.approx(of_spring[0], rel=1e-6)
    assert push != pytest.approx(of_spring[1], rel=3e-3)
    pull = pull_of_tension(running, "left", "rear_idler", wheel)
    assert push == pytest.approx(pull, rel=0.01)
    assert push != pytest.approx(1.03 * pull, rel=0.01)
    for side in ("left", "right"):
        assert chassis[f"{side}.rear_idler.tensioner.force"] == pytest.approx(push, rel=1e-9)
        pulled = pull_on(running, side, "rear_idler", wheel)
        assert running[f"{side}_track"]["rear_idler.force.x"] == pytest.approx(pulled, rel=1e-6)


def along(running, side, name, wheel, slide):
    """Forward force of the chain along a ``slide`` x, z on a wheel, N, from its pins, weight of its links included."""
    track = running[f"{side}_track"]
    pins, ends, _ = strands(running, side, name, wheel)
    values, count = dict(zip(track.links, track.link_outputs(), strict=True)), running.scene.vehicle.track.links
    forces = []
    for inside, outside in ends:
        force = np.array([values[f"joint[{inside % count + 1}].force.{axis}"] for axis in "xz"])
        forces.append(force * np.sign(force @ (pins[outside] - pins[inside])))
    table, (one, other) = running.scene.vehicle, (inside for inside, _ in ends)
    links = min((one - other) % count, (other - one) % count)
    return (np.sum(forces, axis=0) - [0.0, links * table.track.mass * table.gravity]) @ slide


@pytest.mark.long
def test_an_idler_on_a_slope_is_moved_and_held_along_it():
    """The standing track carries its tension; the push is that of the spring, of the chain and of the idler's weight.

    The twins: the slide at the other angle, and the weight left out.
    """
    running = InProcess(at_rest(ANGLED, OF_PINS))
    known, chassis, track = running.scene.vehicle, running["chassis"], running["left_track"]
    idler, way = known.idler, np.array([np.cos(0.3), 0.0, np.sin(0.3)])
    assert [each.tension for each in running.scene.standing.tracks] == pytest.approx(
        [UNSTRETCHED * 14380.0] * 2, rel=1e-3
    )
    from_drawn = np.array([idler.x - M113["idler"]["x"], idler.z - M113["idler"]["z"]])
    assert abs(from_drawn[0]) > 1e-3
    assert from_drawn[1] / from_drawn[0] == pytest.approx(np.tan(0.3), rel=1e-9)
    hull = Rotation.from_quat([chassis[f"chassis.orientation.{part}"] for part in "wxyz"], scalar_first=True)
    place, centre = (
        np.array([chassis[f"{name}.position.{axis}"] for axis in "xyz"]) for name in ("left.idler", "chassis")
    )
    moved = hull.inv().apply(place - centre) - (
        [idler.x, known.track.lateral, idler.z] - np.array(known.chassis.centre)
    )
    assert moved == pytest.approx((moved @ way) * way, abs=1e-12)
    push, spring = chassis["left.tensioner.force"], known.tensioner
    assert push == pytest.approx(spring.preload + spring.stiffness * (moved @ way), rel=1e-6)
    force = np.array([track[f"idler.force.{axis}"] for axis in "xyz"])

    def held(way, weight=idler.mass * known.gravity):
        return (force - [0.0, 0.0, weight]) @ hull.apply(way)

    assert push == pytest.approx(held(way), rel=5e-3)  # rigid links; the search has cables
    assert push != pytest.approx(held(way * [1.0, 1.0, -1.0]), rel=0.05)
    assert push != pytest.approx(held(way, 0.0), rel=0.02)
    slide = hull.apply(way)[[0, 2]]
    assert force[[0, 2]] @ slide == pytest.approx(along(running, "left", "idler", idler, slide), rel=1e-6)


@pytest.mark.long
def test_sides_whose_slides_are_elsewhere():
    """Right wheels with a place of their own are moved along the slide too; a further wheel has its own angle."""
    wheel = {"rear_idler": {**REAR, "tensioner": {**SPRING, "angle": -0.2}}}
    right = {"idler": {"x": -3.97}}
    running = InProcess(at_rest({**ANGLED, "track": LONGER, "wheel": wheel, "right": right}, OF_PINS))
    known = running.scene.vehicle
    force, moment = unbalanced(running, known)
    weight = known.total_mass() * known.gravity
    assert np.abs(force[[0, 2]]).max() < 1e-4 * weight
    assert np.abs(moment[:2]).max() < 5e-4 * weight
    sides = {side: known.of_side(side).idler for side in ("left", "right")}
    for (side, idler), drawn in zip(sides.items(), (M113["idler"]["x"], -3.97), strict=True):
        assert (idler.z - M113["idler"]["z"]) / (idler.x - drawn) == pytest.approx(np.tan(0.3), rel=1e-6)
        for name, angle, mass in (("idler.", 0.3, idler.mass), ("rear_idler.", -0.2, REAR["mass"])):
            at = angle - running["chassis"]["pitch"]
            ahead, up = (running[f"{side}_track"][f"{name}force.{axis}"] for axis in "xz")
            held = ahead * np.cos(at) + (up - mass * known.gravity) * np.sin(at)
            named = f"{side}.{name}tensioner.force".replace(".idler.", ".")
            assert running["chassis"][named] == pytest.approx(held, rel=2e-3)
    assert [each.tension for each in running.scene.standing.tracks] == pytest.approx(
        [UNSTRETCHED * 14380.0] * 2, rel=1e-3
    )


@pytest.mark.long
def test_the_wheel_that_is_moved_for_the_tension():
    """Either idler is moved to the tension asked; the other one stays as drawn, and both springs balance the chain."""
    for name, stays in (("idler", ("wheel", "rear_idler", -3.9)), ("rear_idler", ("idler", None, -3.991))):
        table = {**SECOND, "idler": {**M113["idler"], "x": -3.991}, "tensioner": {**M113["tensioner"], "wheel": name}}
        scene = at_rest(table)
        x = scene.vehicle.idler.x, scene.vehicle.wheel["rear_idler"].x
        assert (x[0] == -3.991, x[1] == -3.9) == (name != "idler", name == "idler"), stays
        for tracks in (scene.standing.tracks, scene.start.equilibrium.tracks):
            assert [each.tension for each in tracks] == pytest.approx([UNSTRETCHED * 14380.0] * 2, rel=1e-3)
    with pytest.raises(BadInput, match=r"within 60 mm of x = -3\.9 m, .*vehicle\.track\.links = 67"):
        at_rest({**table, "track": {**LONGER, "links": 67}})


@pytest.mark.long
def test_further_wheels_of_sides_that_differ():
    """A right wheel elsewhere, on a stiffer spring, is in balance; an equal one is the left one."""
    other = {"x": -3.89, "tensioner": {**SPRING, "stiffness": 2e6}}
    table = {**SECOND, "right": {"wheel": {"rear_idler": other}}}
    assert lopsided(VehicleTable.model_validate(table).model_dump()) == "wheel.rear_idler"
    running = InProcess(at_rest(table, OF_PINS))
    known = running.scene.vehicle
    force, moment = unbalanced(running, known)
    weight = known.total_mass() * known.gravity
    assert np.abs(force[[0, 2]]).max() < 1e-4 * weight
    assert np.abs(moment[:2]).max() < 5e-4 * weight
    pushes = [running["chassis"][f"{side}.rear_idler.tensioner.force"] for side in ("left", "right")]
    pulls = [pull_on(running, side, "rear_idler", known.wheel["rear_idler"]) for side in ("left", "right")]
    assert pushes == pytest.approx(pulls, rel=5e-3)
    assert pushes[0] != pytest.approx(pushes[1], rel=0.01)
    assert [each.tension for each in running.scene.standing.tracks] == pytest.approx(
        [UNSTRETCHED * 14380.0] * 2, rel=1e-3
    )
    same = at_rest({**SECOND, "right": {"wheel": {"rear_idler": {"x": -3.9}}}}).start.equilibrium
    assert (*same.left, *same.right) == pytest.approx(2 * at_rest(SECOND).start.equilibrium.left, abs=1e-7)


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_further_wheel_without_a_track_lacks_its_push(side):
    running = InProcess(at_rest(SECOND, ("tracks", [side]), ("start.state", "drawn")))
    pushes = {each: running["chassis"][f"{each}.rear_idler.tensioner.force"] for each in ("left", "right")}
    assert pushes.pop(side) == pytest.approx(11343.5, rel=1e-3)
    assert [*pushes.values()] == [0.0]


@pytest.mark.long
def test_a_recoil_below_the_push_of_a_further_wheel_is_refused():
    for preload, start in (9e3, "drawn"), (11e3, "equilibrium"):
        table = second(tensioner={**SPRING, "recoil": {"preload": preload, "stiffness": 4e5}})
        with pytest.raises(
            (InvalidParameter, BadInput),
            match=rf"wheel\.rear_idler\.tensioner\.recoil\.preload = {preload:g} N must be",
        ):
            InProcess(at_rest(table, ("start.state", start)))
    kept = second(tensioner={**SPRING, "recoil": {"preload": 12e3, "stiffness": 4e5}})
    assert InProcess(at_rest(kept))["chassis"]["left.rear_idler.recoil.stroke"] == 0.0


@pytest.mark.parametrize(("name", "links"), [("straight", "rigid"), ("straight", "flexible"), ("tank", "rigid")])
def test_no_further_wheel_takes_the_name_of_a_port(name, links):
    """Ports and parameters of a track, and of a side of a chassis, that begin with a name and a point."""
    first = set()
    for part in assemble(load(name, links, ["track.link_outputs=true", "start.state=drawn"])).parts:
        for port in model_of(part.kind)(part.config).ports if part.stage != "drive" else ():
            above, *rest = re.sub(r"\[.*?\]", "", port.name).split(".")
            if rest and part.kind.startswith("Track"):
                first.add(above)
            elif above in ("left", "right"):
                first.add(rest[0])
    assert first <= {*TAKEN}
    assert {"tensioner", "energy", "ground"} <= first


def test_settings_name_further_wheels(tmp_path):
    """A vehicle with a base takes its wheels by name; ports and parameters have the names of the tables."""
    scene = (resources.files("orchestrator.gallery") / "straight.toml").read_text(encoding="utf-8")
    scene = scene.replace('vehicle = "m113"\n', "") + '[vehicle]\nbase = "own.toml"\nwheel.rear_idler.x = "-3.89 m"\n'
    (tmp_path / "scene.toml").write_text(scene)
    (tmp_path / "own.toml").write_text("".join(f"{key} = {toml_text(value)}\n" for key, value in SECOND.items()))
    scene = load(str(tmp_path / "scene.toml"), "rigid", ["vehicle.wheel.rear_idler.tensioner.stiffness=2 MN/m"])
    wheel = scene.vehicle.wheel["rear_idler"]
    assert (wheel.x, wheel.z, wheel.tensioner.stiffness, wheel.tensioner.damping) == (-3.89, 0.35, 2e6, 1e4)
    (chassis,) = (part for part in assemble(scene).parts if part.kind == "Chassis")
    model = model_of(chassis.kind)(chassis.config)
    config = packed(chassis.config, model.reads(chassis.config))
    ports = {port.name: port for port in (*model.ports, *numbers.ports(config, number_meanings(), model.ports))}
    assert {"left.rear_idler.position.x", "right.rear_idler.force.z", "left.rear_idler.tensioner.force"} <= ports.keys()
    assert ports["wheel.rear_idler.tensioner.stiffness"].start == 2e6
    assert ports["wheel.rear_idler.radius"].unit == "m"
    assert "wheel.rear_idler.tensioner.travel" not in ports  # a limit of results
