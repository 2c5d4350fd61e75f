"""Layouts of vehicles beside that of the m113: sprocket at the rear, return rollers, sides that differ."""

import copy

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from vehicle_in_process import InProcess

from fmus.chassis.tree import tree
from fmus.driver.skid import Footing, footing
from fmus.rest.equilibrium import is_asymmetric
from fmus.start import ground_level
from fmus.vehicles.sides import lopsided, of_wheels
from fmus.vehicles.vehicle import VehicleTable, read_table, vehicle
from orchestrator.results.views.shapes import wheel_body
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load
from orchestrator.scene.settings import entries
from orchestrator.scene.values import overlapping_wheels
from orchestrator.studies.mobility.theory import centre_of_mass, largest_step
from orchestrator.studies.step_limits import pairs

M113 = vehicle(*read_table("m113")).model_dump(mode="json", exclude_none=True)
ROLLERS = {
    "mass": 90.0, "spin_inertia": 1.4, "transverse_inertia": 0.9, "radius": 0.118, "width": 0.3,
    "x": [-1.0, -2.0, -3.0], "z": 0.096,
}  # fmt: skip
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
            px, pz = table.road_arm.pivot
            pin = centre + hull.apply(drawn + np.array([px, 0.0, pz]))
            weigh(table.road_arm.mass, 0.5 * (wheel + pin))
        wheels = [name.removesuffix(".force.x") for name in running[track].outputs if name.endswith(".force.x")]
        for name in (name for name in wheels if name != "ground"):
            place = vector("chassis", f"{side}.{name}.position")
            add(place, vector(track, f"{name}.force"), vector(track, f"{name}.torque"))
    return force, moment


def pull_on_idler(running, table, side):
    """Horizontal force of the chain on the idler, N, from the pin forces where its strands leave the idler."""
    track, end = running[f"{side}_track"], np.sign(table.idler.x)
    values = dict(zip(track.links, track.link_outputs(), strict=True))
    pins = np.array([[values[f"joint[{i + 1}].position.{axis}"] for axis in "xz"] for i in range(table.track.links)])
    beyond = end * (pins[:, 0] - running["chassis"][f"{side}.idler.position.x"]) > -0.5 * table.idler.radius
    cut = np.flatnonzero(beyond != np.roll(beyond, 1))  # pins between a link of the wrap and one of a strand
    assert len(cut) == 2
    return sum(abs(values[f"joint[{i + 1}].force.x"]) for i in cut)


UNLIKE = {  # raised end wheels, each of another radius
    "radius": [0.25, 0.305, 0.305, 0.305, 0.27], "z": [-0.19, -0.215, -0.215, -0.215, -0.21],
    "mass": [377.0, 561.07, 561.07, 561.07, 440.0], "spin_inertia": [11.8, 26.06, 26.06, 26.06, 16.0],
}  # fmt: skip
RAISED = changed(road_wheel={**M113["road_wheel"], **UNLIKE})
TABLES = {
    "m113": M113,
    "rollers": changed(return_roller=ROLLERS),
    "staggered": changed(return_roller=ROLLERS, right=STAGGERED),
    "raised": RAISED,
    "raised rollers": changed(
        road_wheel=RAISED["road_wheel"],
        return_roller={**ROLLERS, "radius": [0.1, 0.118, 0.13], "mass": [70.0, 90.0, 120.0]},
    ),
    **{
        name: vehicle(*read_table(name)).model_dump(mode="json", exclude_none=True)
        for name in ("marder", "robot", "leopard2", "dozer")
    },
}


# Tensioners of 4 and 8 MN/m and axles without springs make more force of the 0.2 mm between rigid links and cables.
STIFF = {"leopard2": 2.0, "dozer": 4.0}


@pytest.mark.parametrize("name", [*TABLES])
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
        pull = pull_on_idler(running, known.of_side(side), side)
        assert abs(running[f"{side}_track"]["idler.force.x"]) == pytest.approx(pull, rel=1e-6)
        assert running["chassis"][f"{side}.tensioner.force"] == pytest.approx(pull, rel=more * 5e-3)
    ground = sum(running[f"{side}_track"]["ground.force.z"] for side in ("left", "right"))
    assert ground == pytest.approx(weight, rel=more * 1e-4)


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
    assert (left.tension, right.tension) == pytest.approx([scene.vehicle.track.tension] * 2, rel=1e-3)
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
        [np.array(part).tolist() for part in footing(table)[0]], largest_step(known), centre_of_mass(known),
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
    trees = [tree(vehicle(table, "own").model_dump(), 2) for table in (each, one)]
    for key in ("hinge", "leaf_mass", "across", "along", "transverse", "spin_inertia", "fraction", "masses", "travel"):
        np.testing.assert_array_equal(*(getattr(each, key) for each in trees))


def test_readers_take_the_number_of_each_wheel():
    """Raised wheels carry no load in the driver's footing; the lowest one stands on the ground, the last one hangs."""
    low, raised = (read_by_others(changed(road_wheel=wheel, return_roller=ROLLERS))
                   for wheel in (M113["road_wheel"], {**M113["road_wheel"], **UNLIKE}))  # fmt: skip
    wheels = Footing._fields.index("wheels")
    assert (len(low[0][wheels]), len(raised[0][wheels])) == (5, 3)
    assert raised[5] == low[5]  # the ground
    assert low[6] - raised[6] == pytest.approx(2.0 * (2.0 * 561.07 - 377.0 - 440.0))
    assert raised[3]["road wheel on its link"].m2 < low[3]["road wheel on its link"].m2 - 180.0
    heavy = [*UNLIKE["mass"][:4], 2.0 * UNLIKE["mass"][4]]
    moved = centre_of_mass(vehicle(changed(road_wheel={**M113["road_wheel"], **UNLIKE, "mass": heavy}), "own"))
    assert moved[0] < centre_of_mass(vehicle(RAISED, "own"))[0] - 0.05  # the last wheel is behind it
    shape = wheel_body("left_track/road_wheel[5]", "road_wheel", "left_track", RAISED)
    assert shape.radius == 0.27


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
