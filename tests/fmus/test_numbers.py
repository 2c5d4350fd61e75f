"""Every number of a vehicle is a parameter of the FMUs that read it; one FMU serves all vehicles of its shape."""

from __future__ import annotations

import json
import math
import random
import re
import struct
import zipfile
from functools import cache

import named_ports
import numpy as np
import pytest
from fmpy import read_model_description
from hypothesis import given
from hypothesis import strategies as st
from named_ports import output_names, parameters
from native_cases import SOIL
from scene_parts import drive, parts
from suspensions import FAR, LAST

from fmus.components import model_of
from fmus.fmi.build import build_shapes, packed_config, start_values
from fmus.ground.contact import soil_law
from fmus.ground.soils import SoilTable
from fmus.ground.tables import GroundTable, number_meanings
from fmus.ground.terrain import heights_of, terrain
from fmus.interface import numbers
from fmus.interface.model import InvalidParameter
from fmus.interface.ports import UNITS, variables
from fmus.native import numbers_file
from fmus.native.fmi3_description import arrays, document
from fmus.native.pack import build_native, build_native_shape, with_constants
from fmus.physics.contact.ground import bumpy_ground
from fmus.vehicles.ranges import contradictions
from orchestrator.cosim.component import Component
from orchestrator.fmi.fmu_files import unpack
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.scene.assembly import assemble, build_parts
from orchestrator.scene.parts import Part
from orchestrator.scene.scene import load

H = 1e-3
ELSEWHERE = {  # numbers of a vehicle file that are parameters of no FMU, and why
    "longest_step": "a choice of the master",
    "tensioner.travel": "a limit that results are held against",
    "sprocket.spin_inertia": "of a drive, whose number it is",
    "return_roller.width": "seen in pictures alone",
    "sprocket.radius": "of a smooth wheel, which no vehicle here has",
    "hitch.x": "of a scene that tows", "hitch.z": "of a scene that tows",
    "seat.position": "of a scene with a seat",
    "chassis.hull": "of a scene whose hull touches the ground",
    **{f"track.belt.{key}": "of a belt, which gives the numbers of its links"
       for key in ("bending", "relaxation_time", "axial", "length", "mass", "thickness")},
    "track.bushing.wear": "of an analysis", "track.bushing.bearing": "of an analysis",
    **dict.fromkeys(("idler.width", "road_wheel.width", "wheel.width"), "of a wheel without a track"),
    "wheel.tensioner.travel": "a limit that results are held against",
}  # fmt: skip
MOVED = {"SprocketDrive": {"mode": "torque", "torque.drive": 100.0}}
IDLE = {  # numbers that change nothing in the first steps, and why
    "guide.clearance",  # more than the play of a chain that stands straight
    *(f"rest.wrench[{k}]" for k in range(1, 7)),  # of a drive: what it shows before the first step
    "track.lateral",  # the default of start.lateral
    "idler.radius",  # of a chassis: the limit of the idler's way
    "road_wheel.x[2]", "road_wheel.x[3]", "road_wheel.x[4]",  # of a track: inside the belt; its wheels are at rest.*
}  # fmt: skip


@cache
def config_of(part_name, *scene):
    part = parts(*scene)[part_name]
    return part.kind, packed_config(part.kind, part.config)


def own_keys(*scene):
    """Keys of a vehicle file, without indices, that are parameters of the components of a scene, as drawn."""
    name, links, *settings = scene
    found = set()
    for part in assemble(load(name, links, settings)).parts:
        config = packed_config(part.kind, part.config)
        names = {*numbers.places(config), *(port.name for port in model_of(part.kind)(config).ports)}
        found |= {name.removeprefix("rest.").partition("[")[0] for name in names}
    return found


@pytest.mark.long
def test_every_number_of_a_vehicle_file_is_a_parameter_of_a_component():
    known = own_keys("straight", "flexible") | own_keys("straight", "rigid") | own_keys("turn", "rigid")
    known |= own_keys("serpentine", "rigid") | own_keys("marder", "rigid") | own_keys("robot", "rigid")
    kind, config = parts("straight", "rigid")["chassis"][1:3]
    further = {**config["vehicle"]["idler"], "tensioner": FAR}
    elements = {"suspension": {**config["vehicle"]["suspension"], **LAST}, "tensioner": FAR, "wheel": {"rear": further}}
    packed = packed_config(kind, {**config, "vehicle": {**config["vehicle"], **elements}})
    known |= {name.partition("[")[0].replace("wheel.rear.", "wheel.") for name in numbers.places(packed)}
    known |= own_keys("straight", "rigid", BUSHED, WORN, GROUSERS)
    known |= {name.partition("[")[0] for ground in GROUNDS for name in of_ground(sled(ground)[1])}
    known |= {f"ground.{key}" for key in SIZES}
    known = {"seat.position" if name.startswith("seat.") else name for name in known}
    # of a vehicle with unequal sides; of the life, which is computed from a log
    right = {key for key in number_meanings() if key.startswith(("right.", "life."))}
    assert set(number_meanings()) - known - right == set(ELSEWHERE) - known
    table = {"idler": {"x": 1.0}, "right": {"idler": {"x": 1.1}, "tensioner": {"preload": 2.0}}}
    assert {unit for key, (unit, *_) in number_meanings().items() if not key.startswith("track.belt.")} <= set(UNITS)
    assert {"right.idler.x", "right.tensioner.preload"} <= {*numbers.places({"vehicle": table})}


BUSHED = "vehicle.track.bushing={stiffness=500, preset=0.1, damping=20, friction=0.3, radius=0.02, slow=2.0}"
GROUSERS = "vehicle.track.grouser={height=0.02, length=0.03, width=0.3}"
WORN = "vehicle.sprocket.pitch=0.1523"
BEAMS = (  # arms with numbers of their own, and an idler on a slope
    "vehicle.road_arm.beams=[[1, 2, 3], [4, 5]]", "vehicle.tensioner.angle=0.2",
    "vehicle.road_arm.mass=[90, 40, 120, 60, 30]", "vehicle.road_arm.pin_inertia=[3, 0.5, 5, 1, 0.6]",
    "vehicle.road_arm.long_inertia=[0.4, 0.2, 0.5, 0.3, 0.1]",
    "vehicle.road_arm.pivot=[[-0.717, 0.15], [-0.05, 0.15], [0.617, 0.15], [-0.3, 0.15], [0.366, 0.15]]",
)  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize(
    ("part_name", "settings"),
    [
        ("chassis", ()),
        ("left_track", ()),
        ("left_drive", ()),
        pytest.param("left_track", (BUSHED, WORN, GROUSERS), marks=pytest.mark.long),
        pytest.param("chassis", BEAMS, marks=pytest.mark.long),
    ],
)
def test_every_number_is_read(part_name, settings):
    """Another value changes the start or the first steps."""
    kind, config = config_of(part_name, "straight", "rigid", *settings)

    def course(config):
        model = model_of(kind)(config)
        model.initialise(parameters(model, **MOVED.get(kind, {})))
        u = np.array([port.start for port in model.ports[: model.inputs]])
        if kind == "Chassis":
            u += 100.0 * np.sin(np.arange(len(u)))
        y = np.zeros(len(output_names(model)) - model.link_ports)
        rows = []
        for k in range(3):
            model.step(k * H, H, u)
            model.outputs(y)
            rows.append(y.copy())
        return np.concatenate([*rows, model.state, u])

    usual, idle = course(config), set()
    for name, value in numbers.values(config).items():
        other = numbers.with_values(config, {name: value * 1.01 + 1e-4 * (value == 0.0)})
        if not any(contradictions(other.get("vehicle", {}))) and np.array_equal(course(other), usual):
            idle.add(name)
    assert idle <= {*IDLE, *MOVED.get(kind, {})}


TEN = (
    "vehicle.chassis.mass=12500", "vehicle.chassis.inertia=[3500, 12000, 13000]", "vehicle.suspension.stiffness=1.1e5",
    "vehicle.suspension.damping=6e3", "vehicle.contact.ground.friction=0.5", "vehicle.contact.wheel.friction=0.2",
    "vehicle.contact.sprocket.friction=0.1", "vehicle.contact.wheel.stiffness=3e6", "vehicle.tensioner.stiffness=2e6",
    "vehicle.gravity=9.0",
)  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("part_name", ["chassis", "left_track", "left_drive"])
def test_a_host_that_sets_ten_keys_has_the_bits_of_a_scene_that_sets_them(part_name):
    """It sets them in the FMU of another vehicle; one more number off shows."""
    usual, other = (parts("straight", "rigid", *settings)[part_name] for settings in ((), TEN))
    (fmu,) = build_shapes([(usual.kind, usual.config, None)])
    assert build_shapes([(other.kind, other.config, None)]) == [fmu]
    wanted = {**start_values(other.kind, other.config).parameters, **other.parameters}
    assert wanted != {**start_values(usual.kind, usual.config).parameters, **usual.parameters}

    model = model_of(other.kind)(packed_config(other.kind, other.config))
    u = np.array([float(port.start) for port in model.ports[: model.inputs]])

    def outputs(given):
        with Component(fmu, part_name) as component:
            component.u[:] = u
            component.initialise(given)
            for k in range(5):
                component.write()
                component.step(k * H, H)
            component.read()
            component.read_links()
            return np.concatenate([component.y, component.y_links])

    model.initialise(wanted)
    for k in range(5):
        model.step(k * H, H, u)
    y = [*named_ports.outputs(model).values()]
    assert np.array_equal(outputs(wanted), y)
    off = {"chassis": ("chassis.mass", 12600.0), "left_drive": ("start.angle", 0.01)}
    name, value = off.get(part_name, ("track.mass", 1.02 * wanted.get("track.mass", 0.0)))
    assert not np.array_equal(outputs({**wanted, name: value}), y)


def test_a_mount_that_nothing_moves_is_at_its_own_place():
    """In an FMU of any numbers, with the start values of its own or with those of the description."""
    drives = {x: ("SprocketDrive", {"drive": {"inertia": 9.0, "mount": [x, 0.0, 0.0]}}) for x in (0.0, -2.0, 3.0)}
    for x, placed_drive in drives.items():
        (fmu,) = build_shapes([(*placed_drive, None)])
        values = start_values(*placed_drive)
        assert values.inputs[0] == x
        for starts in (values.inputs, ()):
            with Component(fmu, "drive", starts=starts) as component:
                component.initialise(values.parameters)
                component.step(0.0, H)
                component.read()
                assert component.y[component.outputs.index("sprocket.position.x")] == x


def test_what_is_recorded_of_a_part_does_not_depend_on_the_fmu_that_the_cache_has(fresh_cache):
    """Inputs that nothing feeds have the start values of the part."""
    part = parts("rig", "rigid")["idler_drive"]
    (other,) = build_shapes([("SprocketDrive", {"drive": {**part.config["drive"], "mount": [7.0, 0.0, 0.0]}}, None)])
    (built,) = build_parts([part], native=False)
    assert built.fmu == other
    with Component(built.fmu, part.name, starts=built.starts) as component:
        assert component.u[0] == part.config["drive"]["mount"][0] != 7.0


LEAVES = st.floats(allow_nan=False, allow_infinity=False, width=32) | st.integers(0, 9) | st.text("ab", max_size=2)
KEYS = st.text("abc", min_size=1, max_size=2)


EVERYTHING = GroundTable(
    grade=0.01, bank=0.02, incline_start=-3, incline_length=9,
    bump={"start": -2.5, "rise": 0.2, "slope": 0.3, "length": 0.1, "radius": 0.1},
    step={"x": [-0.5, -0.1], "rise": 0.05}, half_round={"x": [1.5, 2], "radius": 0.1},
    trench={"start": 2.5, "width": 0.5, "depth": 0.4}, kerb={"y": 0.3, "rise": 0.1, "start": -1, "length": 3},
    washboard={"amplitude": 0.01, "wavelength": 2, "phase": 1, "start": -2, "end": 3},
    rough={"iso_class": "B", "period": 20, "start": -0.5, "length": 3},
    heightmap={"heights": [[0, 0.01], [0.02, 0], [0, 0.01]], "corner": [-1, -2], "spacing": [1.5, 3], "start": -2.5,
               "length": 5},
    friction=[{"x": [-0.6, 0.4], "y": [-0.1, 5], "factor": 0.8}, {"x": [-0.3, 3], "coefficient": 0.2}],
).model_dump(exclude_none=True, exclude={"hull", "soil"})  # fmt: skip
GROUNDS = {
    "terrain": {"terrain": {**EVERYTHING, "level": -0.53}},
    "bump": {"bump": {"start": -1.3, "rise": 0.2, "slope": 0.3, "length": 0.3, "radius": 0.1}},
    "sand": {"soil": SoilTable(name="dry_sand", damping=1e3, width=0.2, k0=1e8, Au=1e8).model_dump(exclude={"name"})},
    "clay": {"soil": SoilTable(name="lete_sand", rebound=0.5).model_dump(exclude={"name"})},
}
SIZES = ("heightmap.heights", "heightmap.range", "rough.band", "rough.period")  # part of the shape, or of a file


def sled(ground):
    """Kind and config of four links that are let go over a ground of GROUNDS."""
    kind, config = config_of("chain", "shear_sled", "rigid")
    track = {key: value for key, value in config["track"].items() if key != "soil"}
    return kind, {**config, "parameters": {"start": "polygon"}, "track": {**track, **GROUNDS[ground]}}


def bare_wheels(ground):
    """Kind and config of a chassis whose wheels have no tracks, on a ground of GROUNDS."""
    kind, config = parts("straight", "rigid")["chassis"][1:3]
    contacts = {"hull": True, "bare": ["left", "right"], **GROUNDS[ground]}
    return kind, {**config, "chassis": {**config["chassis"], "ground": contacts}}


def tracked(ground):
    """Kind and config of a vehicle's track in clay; other tests compile its native library."""
    assert ground == "clay"
    part = parts(SOIL.scene, SOIL.links, *SOIL.settings)[SOIL.part]
    return part.kind, packed_config(part.kind, with_constants(part.kind, part.config, part.parameters))


ON_GROUND = [*((sled, ground) for ground in GROUNDS), (bare_wheels, "terrain"), (bare_wheels, "bump")]


def of_ground(config):
    """Numbers of the ground, each a little changed."""
    found = {name: value for name, value in numbers.values(config).items() if name.startswith("ground.")}
    return {name: value * 0.99 + 1e-3 * (value == 0.0) for name, value in found.items()}


def seen(config):
    """Regions of friction of a ground and its heights on a grid, its bump, or the law of its soil."""
    table = config["track"] if "track" in config else config["chassis"]["ground"]
    if soil := table.get("soil"):
        return [*soil_law(soil, config["vehicle"]["track"])]
    x, y = (each.ravel() for each in np.meshgrid(np.arange(-4.0, 4.0, 0.01), [-0.9, -0.301, 0.0, 0.31]))
    if bump := table.get("bump"):
        return [*bumpy_ground(0.0, **bump)]
    shape = terrain(table["terrain"])
    return [table["terrain"]["level"], *shape.regions.ravel(), *heights_of(shape, x, y)]


@pytest.mark.parametrize(("of", "ground"), ON_GROUND)
def test_numbers_of_the_ground_are_no_shape_and_have_an_effect(of, ground):
    usual = packed_config(*of(ground))
    changed = of_ground(usual)
    assert len(changed) == {"terrain": 50, "bump": 5, "sand": 11, "clay": 11}[ground]
    for name, value in changed.items():
        other = numbers.with_values(usual, {name: value})
        assert numbers.shape(other) == numbers.shape(usual), name
        assert seen(other) != seen(usual), name


@pytest.mark.parametrize(
    "longer",
    [{"heightmap": {"heights": [[0.0, 1.0]] * 4}}, {"rough": {"period": 21.0}}, {"rough": {"seed": 2}},
     {"step": {"x": [1.0]}}, {"kerb": {"start": None}}, {"friction": EVERYTHING["friction"][:1]}],
    ids=json.dumps,
)  # fmt: skip
def test_sizes_and_kinds_of_the_ground_are_shape(longer):
    ((key, other),) = longer.items()
    table = {**EVERYTHING, key: {**EVERYTHING[key], **other} if isinstance(other, dict) else other}
    shapes = [numbers.shape({"track": {"terrain": each}}) for each in (EVERYTHING, table)]
    assert shapes[0] != shapes[1]


def test_numbers_of_the_ground_that_exclude_each_other_are_refused_in_a_sentence():
    kind, config = sled("terrain")
    model = model_of(kind)(numbers.with_values(config, {"ground.half_round.x[2]": 1.51}))
    with pytest.raises(InvalidParameter, match=r"^ground: half_round begins at x = 1\.\d+ m, before half_round ends"):
        model.initialise(parameters(model))


@pytest.mark.parametrize(
    ("scene", "settings", "others"),
    [
        ("shear_sled", (), ("ground.soil.name=lete_sand", "ground.soil.cohesion=2 kPa")),
        ("soft_ground", ("ground.step={x=[3],rise=0.1}",), ("ground.step.rise=0.2", "ground.soil.kphi=3e6")),
        ("step", (), ("ground.step.rise=0.3", "ground.step.radius=0.025")),
        ("rough", (), ("ground.rough.start=2", "ground.rough.length=4")),
        ("straight", ("ground.friction=[{x=[0,1],factor=0.5}]",), ("ground.friction=[{x=[1,3],factor=0.9}]",)),
    ],
)
def test_scenes_with_other_numbers_of_the_ground_share_their_fmus(scene, settings, others):
    usual, other = (assemble(load(scene, "rigid", [*each])).parts for each in (settings, (*settings, *others)))
    for part, another in zip(usual, other, strict=True):
        configs = [packed_config(each.kind, each.config) for each in (part, another)]
        assert numbers.shape(configs[0]) == numbers.shape(configs[1])
        assert (configs[0] != configs[1]) == bool(of_ground(configs[0]))


@pytest.mark.long
@pytest.mark.parametrize(
    ("of", "ground", "native"),
    [
        *((*each, False) for each in ON_GROUND),
        (*ON_GROUND[5], True),
        *(pytest.param(*each, True, marks=pytest.mark.study) for each in (ON_GROUND[0], (tracked, "clay"))),
    ],
)
def test_an_fmu_with_a_number_of_the_ground_is_one_of_another_ground(of, ground, native):
    """It is the same FMU, with the bits of a model of the other ground; most numbers change the first steps."""
    kind, usual = of(ground)

    def course(config):
        (built,) = build_parts([Part("part", kind, config, {}, 0)], native)
        with Component(built.fmu, "part", resources=built.resources, starts=built.starts) as component:
            component.initialise(built.parameters)
            for k in range(5):
                component.write()
                component.step(k * H, H)
            component.read()
            return built.fmu, component.y.tolist()

    def of_model(config):
        model = model_of(kind)(config)
        model.initialise({**parameters(model), **config.get("parameters", {})})
        u = np.array([float(port.start) for port in model.ports[: model.inputs]])
        for k in range(5):
            model.step(k * H, H, u)
        return [*named_ports.outputs(model, links=False).values()]

    fmu, y = course(usual)
    moved = 0
    for name, value in of_ground(usual).items():
        other = numbers.with_values(usual, {name: value})
        same, found = course(other)
        assert (same, found) == (fmu, of_model(packed_config(kind, other))), name
        moved += found != y
    assert 2 * moved >= len(of_ground(usual))


@given(st.recursive(LEAVES, lambda at: st.lists(at, max_size=3) | st.dictionaries(KEYS, at, max_size=3)))
def test_numbers_are_the_floats_and_nothing_else(table):
    config = {"vehicle": {"t": table}}
    found = numbers.values(config)
    assert numbers.with_values(config, found) == numbers.with_values(config, {})
    moved = numbers.with_values(config, {name: value + 1.0 for name, value in found.items()})
    assert numbers.shape(moved) == numbers.shape(config)
    assert numbers.values(moved) == {name: value + 1.0 for name, value in found.items()}


RIGHT = {  # unit, least and largest value, what is allowed
    "chassis.mass": ("kg", 5e-324, "inf", "greater than 0"),
    "road_wheel.mass": ("kg", 5e-324, "inf", "greater than 0"),
    "idler.x": ("m", -1e3, 1e3, "-1000 or more and 1000 at most"),
    "seat.position": ("m", -1e3, 1e3, "-1000 or more and 1000 at most"),
    "track.bushing.friction": ("1", 0, 2.0, "0 or more and 2 at most"),
    "sprocket.flank_angle": ("rad", 5e-324, math.nextafter(1.2, 0.0), "greater than 0 and less than 1.2"),
    "ground.rough.band": ("1/m", 5e-324, "inf", "greater than 0"),
    "ground.step.x": ("m", -1e6, 1e6, "-1e+06 or more and 1e+06 at most"),
}


@pytest.mark.parametrize("key", RIGHT)
def test_a_number_has_the_unit_and_bounds_of_its_key(key):
    """Of one value, of a value that may be a list, of the entries of a list and of tables with names."""
    assert tuple(number_meanings()[key])[:4] == RIGHT[key]
    assert number_meanings()["sprocket.radius"][4].endswith("excludes teeth"), "when a key counts is in its meaning"


def test_the_description_states_unit_bounds_and_meaning():
    part = parts()["chassis"]
    (fmu,) = build_shapes([(part.kind, part.config, None)])
    described = read_model_description(fmu)
    variables = {variable.name: variable for variable in described.modelVariables}
    mass = variables["chassis.mass"]
    assert (mass.causality, mass.variability, mass.description) == ("parameter", "fixed", "mass of the hull")
    assert (mass.unit, mass.min, variables["chassis.inertia[2]"].unit) == ("kg", "0.0", "kg.m2")
    assert {unit.name for unit in described.unitDefinitions} >= {"kg", "kg.m2"}


OF_NAMES = {  # unit by the end of a name without indices and axis
    r"energy\..*": "J", "position": "m", "distance": "m", "height": "m", r"(start|rest|track)\.lateral": "m",
    "road_wheel.x": "m", "idler.x": "m", "velocity": "m/s", "friction_velocity": "m/s", "angular_velocity": "rad/s",
    "roll": "rad", "heading": "rad", "force": "N", "tension": "N", "push": "N", "preload": "N", "torque": "N.m",
    "mass": "kg", r"\w*inertia": "kg.m2", "work": "J", "orientation": "1", "friction": "1", "ratio": "1",
    r"soil\.(n|kc|kphi)": "1", r"soil\.(k0|elastic)": "Pa/m", r"soil\.Au": "Pa/m2", r"soil\.damping": "Pa.s/m",
    "cohesion": "Pa", "friction_angle": "rad", "shear_deformation_modulus": "m",  # kc and kphi have a unit for each n
    "grip": "1", "yaw.gain": "1", "spectral_radius": "1", r"adams\.[ar]tol": "1", "link_outputs.interval": "1",
}  # fmt: skip


def unit_of(name, config):
    """Right unit of a Real by its name, None where the name leaves it open."""
    if row := re.fullmatch(r"rest\.(left|right|wrench)\[(\d+)\]", name):
        arms = len(config["chassis"]["start"]["left"]) - 1 if "chassis" in config else 0
        return ("N", "N.m")[(int(row[2]) - 1) // 3 % 2] if row[1] == "wrench" else "rad" if int(row[2]) <= arms else "m"
    if name.startswith("ends."):
        return "N" if config["track"]["ends"]["kind"] == "pulled" else "m"
    plain = re.sub(r"\[[^]]*\]|(?<=[a-z]{4})\.[wxyz]$", "", name) if "wheel.x" not in name else "road_wheel.x"
    return next((unit for end, unit in OF_NAMES.items() if re.fullmatch(rf"(.*\.)?{end}", plain)), None)


def reals_of(part):
    """Names and units of the Reals of a part in FMI 2.0 and, read from its description, in FMI 3.0; its config."""
    config = packed_config(part.kind, part.config)
    known = model_of(part.kind)(config).ports
    reals = variables((*known, *numbers.ports(config, number_meanings(), known))).reals
    about = {"guid": "", "text": "", "tool": "", "others": (), "categories": {}, "experiment": {"stop": 1.0, "step": H}}
    root = document("fmu", arrays=arrays(reals), **about)
    types = {kind.get("name"): kind.get("unit") for kind in root.iter("Float64Type")}
    later = [(one.get("name"), one.get("unit") or types[one.get("declaredType")]) for one in root.iter("Float64")]
    return [*((port.name, port.unit) for port in reals), *later], config


@pytest.mark.parametrize("scene", ["straight", "differential", "serpentine", "crawler", "hanging_chain", "shear_sled"])
def test_every_real_has_the_unit_of_its_name(scene):
    for part in parts(scene).values():
        found, config = reals_of(part)
        right = {name: unit_of(name, config) for name, _ in found}
        assert [(name, unit) for name, unit in found if right[name] not in (unit, None if unit != "1" else unit)] == []


# --- native FMUs -----------------------------------------------------------------------------------


def library(fmu):
    with zipfile.ZipFile(fmu) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith(".so")]
        return archive.read(name)


@pytest.mark.long
def test_native_fmus_of_a_shape_have_one_library():
    usual, other, demanded = (build_native(*each) for each in (drive(), drive(11.0), drive(9.0, demanded=True)))
    assert library(usual) == library(other) != library(demanded)
    assert usual.read_bytes() != other.read_bytes()
    guids = [read_model_description(file).guid for file in (usual, other)]
    assert guids[0][:28] == guids[1][:28]
    assert guids[0] != guids[1]  # some hosts unpack one FMU for each guid
    with pytest.raises(ComponentFailed):
        Component(usual, "drive", resources=unpack(other) / "resources")
    assert build_native_shape(*drive(11.0)).fmu == build_native_shape(*drive()).fmu


def speed_after(fmu, resources, starts=(), **given):
    """Speed of a drive after five steps, by default of a torque."""
    with Component(fmu, "drive", resources=resources, starts=starts) as component:
        component.initialise(given or {"mode": "torque", "torque.drive": 100.0})
        for k in range(5):
            component.write()
            component.step(k * H, H)
        component.read()
        return component.y[component.outputs.index("speed")]


def test_a_file_of_numbers_makes_an_instance_one_of_another_fmu():
    shape, other = build_native_shape(*drive()), build_native_shape(*drive(11.0))
    speeds = [speed_after(shape.fmu, each.resources) for each in (shape, other)]
    assert speeds[0] / speeds[1] == pytest.approx(11.0 / 9.0, rel=1e-9)
    assert speeds[1] == speed_after(build_native(*drive(11.0)), None)


@pytest.mark.long
def test_points_are_numbers():
    """Drives that differ in the points of their speed share an FMU; each instance has its own, a constant."""
    made = []
    for rise in (4.0, 6.0):
        points = f"0.0 0.0; 0.005 {rise}"
        fmu, resources, starts = build_native_shape(*drive(points=points))
        made.append((fmu, speed_after(fmu, resources, starts, **{"speed.points": points})))
        with pytest.raises(ComponentFailed):
            speed_after(fmu, resources, starts, **{"speed.points": "0.0 1.0"})
    assert made[0][0] == made[1][0]
    assert [speed for _, speed in made] == pytest.approx([4.0, 6.0], rel=1e-12)
    assert build_native_shape(*drive(points="0.0 0.0; 0.004 4.0; 0.005 4.0")).fmu != made[0][0]


@pytest.mark.long
def test_constants_are_those_of_the_numbers():
    """A slope is a constant of a native chain: each instance of the shape has its own."""
    fmus, (kind, config) = [], sled("terrain")
    for slope in ({"start.slope.pitch": 0.05}, {"start.slope.pitch": 0.1}):
        fmu, resources, starts = build_native_shape(kind, with_constants(kind, config, slope))
        fmus.append(fmu)
        with Component(fmu, "track", resources=resources, starts=starts) as component:
            component.initialise(slope)
            with pytest.raises(ComponentFailed):
                component.initialise({"start.slope.pitch": 0.3})
    assert fmus[0] == fmus[1]


def test_a_wrong_file_of_numbers_is_refused(tmp_path):
    """One byte changed, cut anywhere, of another FMU, or not there."""
    fmu, resources, _ = build_native_shape(*drive())
    whole, rng = (resources / numbers_file.FILE).read_bytes(), random.Random(1)
    content = whole[: numbers_file.HEAD.size + struct.unpack_from("<Q", whole, 16)[0]]  # without the cache's checksum
    foreign = (build_native_shape(*drive(9.0, demanded=True)).resources / numbers_file.FILE).read_bytes()
    wrong = [foreign, b"", *(content[: rng.randrange(len(content))] for _ in range(20))]
    for _ in range(40):
        at = rng.randrange(len(content))
        wrong.append(content[:at] + bytes([content[at] ^ 1 << rng.randrange(8)]) + content[at + 1 :])
    place = tmp_path / numbers_file.FILE
    for each in (None, *wrong):
        if each is not None:
            place.write_bytes(each)
        with pytest.raises(ComponentFailed):
            Component(fmu, "drive", resources=tmp_path)
    place.write_bytes(content)
    assert speed_after(fmu, tmp_path) == speed_after(fmu, resources)


@pytest.mark.parametrize("name", ["a b", "ü%20", "x" * 200])
def test_resources_are_found_by_any_path(tmp_path, name):
    fmu, resources, _ = build_native_shape(*drive())
    (tmp_path / name).mkdir()
    (tmp_path / name / numbers_file.FILE).write_bytes((resources / numbers_file.FILE).read_bytes())
    assert speed_after(fmu, tmp_path / name) == speed_after(fmu, resources)


def test_a_state_of_other_numbers_is_refused():
    fmu, resources, _ = build_native_shape(*drive())
    with Component(fmu, "drive", resources=resources) as one:
        one.initialise({})
        state = one.dump(one.save())
    with Component(fmu, "drive", resources=build_native_shape(*drive(11.0)).resources) as other:
        other.initialise({})
        with pytest.raises(ComponentFailed):
            other.restore(other.load(state))
