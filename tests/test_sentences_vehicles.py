"""Sentences about scenes of vehicles: drives, drivers, slopes, soil, symmetric halves, layouts, tensions."""

import pytest
from vehicle_tables import M113, REAR, ROLLERS, SPRING

from fmus.vehicles.tables import BadInput
from fmus.vehicles.vehicle import vehicle
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load

BOTH_SIDES = "symmetric = true needs the same drive on both sides"
SETTINGS = {  # by scene: settings, and the essential part of their sentence
    "serpentine": [
        (["symmetric=true"], BOTH_SIDES),
        (['tracks=["left"]'], "a driver steers with both sides, but tracks has no 'right'"),
        (["track.axes=fixed"], "this vehicle turns: track.axes = 'fixed' keeps cables in their plane"),
        (["drive.mode=torque"], "drive.mode = 'torque': a driver needs 'speed' or 'controller'"),
        (["drive.speed=3"], "drive.speed = 3.0: a driver says how fast sprockets turn"),
        (["driver.heading=1"], "arcs and heading exclude each other"),
        (["driver.arcs=[[0, 0]]"], "an arc of length 0 turns on the spot: its second number is the angle, not 0"),
        (["driver.arcs=[[0, '1 1/m']]"], "driver.arcs[1]"),
        (["driver.arcs=[[3]]"], "driver.arcs[1]"),
        (["driver.arcs=[]"], "arcs: needs at least 1"),
        (["driver.grip=1"], "driver.grip = 1"),
        (["driver.speed_points=[[0, 1]]", "driver.speed=3"], "speed = 3.0 excludes speed_points"),
        (["driver.speed_points=[[1, 2], [0, 3]]"], "speed_points: needs times that rise"),
        (["driver.arcs=false", "driver.heading=1", "driver.reach=3"], "reach needs a path, arcs or points"),
        (["driver.arcs=false", "driver.points=[[0, 0], [1, 0], [1, 0]]"], "number 2 and 3 are the same place"),
        (["drive.left.brake=5", "drive.mode=speed"], "brake = 5.0 needs mode = 'torque' or 'controller', not 'speed'"),
    ],
    "differential": [
        (["drive.left.speed=8"], "left and right exclude steering"),
        (["symmetric=true"], BOTH_SIDES),
        (['tracks=["left"]'], "drive.steering joins both sides, but tracks has no 'right'"),
        (["drive.steering.mode=fast"], "drive.steering.mode = 'fast'"),
        (["drive.steering.engine_points=[[0, 1]]"],
         "engine_points = ((0.0, 1.0),) needs mode = 'torque' or 'controller', not 'speed'"),
        (["drive.steering.torque=2 kN m"], "torque = 2000.0 needs mode = 'torque', not 'speed'"),
        (["drive.steering.brake=2 kN m"], "brake = 2000.0 needs mode = 'torque' or 'controller', not 'speed'"),
        (["drive.steering.stop=0.1"], "stop = 0.1 s must not be before the ramp ends, 2 s"),
        (["drive.steering.engine_points=no.csv"], "differential.toml: drive.steering.engine_points = 'no.csv'"),
        (["drive.steering.gear_ratio=3"], "gear_ratio = 3.0 needs engine_points"),
        (["driver={speed=3}", "drive={mode='speed', steering={mode='torque'}}"], "drive.steering.mode = 'torque'"),
    ],
    "turn": [
        (["drive.right.speed_points=no.csv"], "drive.right.speed_points = 'no.csv': cannot be read"),
        (["drive.left.torque_points=[[0, 2]]"], "torque_points = ((0.0, 2.0),) needs mode = 'torque', not 'speed'"),
    ],
    "straight": [
        (["drive.left.speed=8", "symmetric=true"], BOTH_SIDES),
        (["drive.left.speed=8", 'tracks=["left"]'], "drive.left and drive.right differ, but tracks has no 'right'"),
        (["drive.left.speed=fast"], "drive.left.speed = 'fast'"),
        (["drive.demand=true", "drive.steering={demand=true, demand_lag=0.3}"], "a differential follows with one lag"),
        (["drive.left.speed=8", "track.axes=fixed"], "track.axes = 'fixed' keeps cables in their plane"),
        (["drive.left.speed=8", "drive.middle.speed=8"], "unknown key 'drive.middle'"),
        (["drive={left={speed=3}, right={torque=5}}"], "drive.right: torque = 5.0 needs mode = 'torque', not 'speed'"),
        (["drive={left={mode='speed'}, rigth={mode='speed'}}"], "unknown key 'drive.rigth': did you mean"),
        (["track.axes=free", "track.element=beam"], "axes = 'free' needs element = 'cable'"),
        (["track.axes=free", "symmetric=true", "planar=true"], "planar = true needs track.axes = 'fixed'"),
        (["track.axes=fixed", "ground.bank=0.1"], "track.axes = 'fixed'"),
        *(([f"start.{key}", "start.state=equilibrium"], "state = 'equilibrium' needs")
          for key in ("height=1", "pitch=0.1", "roll=180 deg")),
        (["track.start=polygon", "start.state=equilibrium"], "state = 'equilibrium' needs"),
    ],
    "hanging_chain": [(["track.axes=free"], "hanging_chain.toml: track.axes = 'free' needs wheels")],
}  # fmt: skip


@pytest.mark.parametrize(
    ("scene", "settings", "said"), [(name, *row) for name, rows in SETTINGS.items() for row in rows]
)
def test_settings_that_cannot_be(scene, settings, said):
    with pytest.raises(BadInput) as refused:
        load(scene, "flexible", settings)
    assert said in str(refused.value)


HULL = "vehicle.chassis.hull=[[0.45, 0.85, 0.25], [0.45, -0.86, 0.25]]"
CENTRE, RIGHT = "vehicle.chassis.centre=[-2.006, {}, 0.406]", "vehicle.right.suspension.stiffness={}"
PATCH = "ground.friction=[{x=[0, 1.5], y=[-0.5, 0.5], factor=0.5}]"
OTHER_PATCH = "ground.friction=[{x=[0, 1.5], y=[-0.48, 0.52], factor=0.5}]"
BESIDE = "start.position=[0.0, 0.02, 0.0]"
HALVES = [  # what the sentence names, settings that no half vehicle can have, and almost the same that it can
    ("chassis.centre", [CENTRE.format(0.0002)], [CENTRE.format(0)]),
    ("chassis.hull", [HULL, "ground.hull=true"], [HULL]),  # points that touch nothing
    ("track.links", ["vehicle.right={track={links=65}}"], ["vehicle.right={track={links=64}}"]),
    ("suspension.stiffness = 1000000.0 and 1030000.0 is", [RIGHT.format(1.03e6)], [RIGHT.format(1e6)]),
    ("friction", [PATCH, BESIDE], [PATCH]),
    ("friction", ["ground.friction=[{x=[0, 1.5], y=[-0.5, 0.52], factor=0.5}]"], [OTHER_PATCH, BESIDE]),
    ("grade", ["ground.grade=0.1", "start.heading=0.01"], ["ground.grade=0.1"]),
    ("bank", ["ground.bank=0.001"], ["ground.bank=0"]),
]


@pytest.mark.parametrize(("key", "fault", "twin"), HALVES)
def test_only_its_own_mirror_image_is_symmetric(key, fault, twin):
    assert load("straight", "rigid", [*twin, "symmetric=true"]).symmetric
    with pytest.raises(BadInput) as refused:
        load("straight", "rigid", [*fault, "symmetric=true"])
    assert "straight.toml: symmetric = true needs" in str(refused.value)
    assert key in str(refused.value)


RECOIL = {"preload": 9e4, "stiffness": 4e5}


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ({"right": {"road_wheel": {"x": [-1.0]}}}, "right.road_wheel.x: has 1 positions, must have 5"),
        ({"right": {"return_roller": {"x": [-1.0]}}}, "right.return_roller.x: has 1 positions, must have 0"),
        ({"right": {"idler": {"x": 4.0}}}, "right.idler.x = 4.0 m: must be on the side of the sprocket that idler.x"),
        ({"right": {"sprocket": {"teeth": 9}}}, "unknown key 'right.sprocket'"),
        (
            {"sprocket": {**M113["sprocket"], "outer_radius": 0.4, "gaps_per_pin": 2}},
            "sprocket.gaps_per_pin = 2: 10 teeth take 5 pins a turn, it must be 6 or more",
        ),
        (
            {"sprocket": {**M113["sprocket"], "outer_radius": 0.8, "pins_per_gap": 3}},
            f"track.links = {M113['track']['links']}: must be divisible by sprocket.pins_per_gap = 3",
        ),
        (
            {
                "sprocket": {**M113["sprocket"], "outer_radius": 0.8, "pins_per_gap": 2},
                "right": {"track": {"links": 63}},
            },
            "right.track.links = 63: must be divisible by sprocket.pins_per_gap = 2",
        ),
        (
            {"sprocket": {**M113["sprocket"], "teeth": 20, "gaps_per_pin": 2, "pins_per_gap": 2}},
            "sprocket: pins_per_gap = 2 needs gaps_per_pin = 1, not 2",
        ),
        ({"return_roller": {**ROLLERS, "radius": -1.0}}, "return_roller.radius = -1.0"),
        (
            {"road_wheel": {**M113["road_wheel"], "radius": [0.25, 0.3]}},
            "road_wheel.radius: has 2 values, must have one for all wheels or 5, one for each",
        ),
        ({"return_roller": {**ROLLERS, "mass": [90.0, 80.0]}}, "return_roller.mass: has 2 values, must have one for"),
        (
            {"road_wheel": {**M113["road_wheel"], "mass": [1.0, 0.0, 1.0, 1.0, 1.0]}},
            "wheel 2: must be greater than 0 kg",
        ),
        (
            {"tensioner": {**M113["tensioner"], "wheel": "front"}, "wheel": {"rear": REAR}},
            "tensioner.wheel = 'front': must be one of ['idler', 'rear']",
        ),
        ({"wheel": {"idler": REAR}}, "wheel.idler: is the name of another part of a side or of its ports, take"),
        ({"wheel": {"ground": REAR}}, "wheel.ground: is the name of another part of a side or of its ports, take"),
        ({"wheel": {"Rear": REAR}}, "wheel.Rear: a name has small letters, digits and _ alone, a letter first"),
        ({"wheel": {"rear": {**REAR, "mass": 1e-9}}}, "wheel.rear.mass = 1e-09 kg: must be 1e-06 to 1e+07 kg"),
        (
            {"idler": {**M113["idler"], "transverse_inertia": 1e308}},
            "idler.transverse_inertia = 1e+308 kg m^2: must be 0 to 1e+08 kg m^2",
        ),
        ({"guide": {**M113["guide"], "clearance": 1.1e17}}, "guide.clearance = 1.1e+17: must be 0 to 50 m"),
        ({"idler": {**M113["idler"], "x": -1e300}}, "idler.x = -1e+300: must be -1000 to 1000 m"),
        ({"chassis": {**M113["chassis"], "hull": [[1.0, 0.0, 2e3]]}}, "chassis.hull[1][3] = 2000.0: must be -1000 to"),
        (
            {"chassis": {**M113["chassis"], "inertia": [1.0, 1e13, 1e13]}},
            "chassis.inertia = 1e+13 kg m^2: must be 0",
        ),
        ({"right": {"idler": {"x": -5e3}}}, "right.idler.x = -5000.0: must be -1000 to 1000 m"),
        ({"road_wheel": {**M113["road_wheel"], "width": 1e308}}, "road_wheel.width = 1e+308 m: must be 0 to 50 m"),
        (
            {"wheel": {"rear": {**REAR, "tensioner": {**SPRING, "wheel": "idler"}}}},
            "unknown key 'wheel.rear.tensioner.wheel'",
        ),
        (
            {"wheel": {"rear": REAR}, "right": {"wheel": {"front": {"x": -3.8}}}},
            "right.wheel.front: has no wheel.front from which it differs",
        ),
        (
            {"wheel": {"rear": {**REAR, "tensioner": {**SPRING, "stiffness": 0.0, "recoil": RECOIL}}}},
            "wheel.rear.tensioner.recoil: needs a wheel.rear.tensioner.stiffness above 0, in line with which its",
        ),
        ({"return_roller": {"mass": 1.0}}, "key 'return_roller.spin_inertia' is missing"),
        (
            {"track": {**M113["track"], "belt": {"bending": 20.0, "length": "10 m"}}},
            "track: pitch = 0.1524: track.belt makes it 0.15625, leave it out",
        ),
        (
            {"track": {**M113["track"], "belt": {"bending": 15.24}, "bushing": {"stiffness": 101.0}}},
            "track: bushing.stiffness = 101.0: track.belt makes it 100.0, leave it out",
        ),
        (
            {"track": {**M113["track"], "grouser": {"height": 0.05, "length": 0.08, "count": 2}}},
            "track.grouser.length = 0.08 m: 2 must fit in track.pitch = 0.1524 m",
        ),
        (
            {"track": {**M113["track"], "grouser": {"height": 0.05, "length": 0.02, "width": 0.4}}},
            "track.grouser.width = 0.4 m: 1 must fit in track.width = 0.378 m",
        ),
        (
            {"track": {**M113["track"], "grouser": {"height": -0.05, "length": 0.02}}},
            "track.grouser.height = -0.05: must",
        ),
        ({"track": {**M113["track"], "belt": {"bending": -1.0}}}, "track.belt.bending = -1.0: must be greater than 0"),
        ({"track": {**M113["track"], "belt": {"length": 1.0}}}, "key 'track.belt.bending' is missing"),
        ({"track": {**M113["track"], "pitch": "m", "belt": {"bending": 1.0}}}, "track.pitch = 'm': must be a"),
        ({"track": {**M113["track"], "links": 0, "belt": {"bending": 1.0, "length": 1.0}}}, "track.links = 0: must be"),
    ],
)
def test_a_wrong_layout(parts, said):
    with pytest.raises(BadInput) as refused:
        vehicle({**M113, **parts}, "own.toml")
    assert str(refused.value).startswith("own.toml: ")
    assert said in str(refused.value)


RAMP = "ground.heightmap={heights=[[0, 0], [1, 1]], corner=[-10, -5], spacing=[20, 10]}"
TIPS = (
    r"was not found, start\.state = 'drawn' needs none.* is 3\.50 m ahead of its foremost road wheel, so it tips over"
)


@pytest.mark.long
@pytest.mark.parametrize(
    ("scene", "settings", "said"),
    [
        ("straight", ["ground.soil.name=dry_sand", RAMP], r"ground\.soil needs level ground under the tracks"),
        ("straight", ["vehicle.chassis.centre=[12, 0, 0.4]"], TIPS),
        pytest.param(
            "soft_ground",
            ["ground.soil.name=snow"],
            r"soft_ground\.toml: .* at rest the hull is 102 mm in the soil, which",
            marks=pytest.mark.long,
        ),
    ],
)
def test_a_vehicle_that_does_not_stand(scene, settings, said):
    """On snow uniform pressure says 538 mm, which is more than the 410 mm under the belly."""
    with pytest.raises(BadInput, match=said):
        placed(load(scene, "rigid", settings))
