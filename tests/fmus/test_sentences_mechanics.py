"""Sentences of chassis, drives, driver, tracks and vehicle files: what was given, what is allowed, in one table.

A row has a part, what is changed, and an essential part of the sentence. Keys that begin with a slash belong to the
part's config, the others are parameters.
"""

from __future__ import annotations

import copy
from functools import reduce

import numpy as np
import pytest
from flexible_track import wheels
from named_ports import Probe, parameters

from fmus.chassis.model import Model as Chassis
from fmus.driver.model import Model as Driver
from fmus.interface.model import InvalidParameter, StepFailed
from fmus.sprocket_drive.model import Model as Drive
from fmus.steering_differential.model import Model as Differential
from fmus.track_flexible.model import Model as Flexible
from fmus.track_rigid.model import Model as Rigid
from fmus.vehicles.tables import BadInput
from fmus.vehicles.vehicle import read_table, vehicle
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load

TABLE = vehicle(*read_table("m113")).model_dump()
POINTS = "0.5 0; 1.5 8; 2.25 -4; 3 -4"
SHAFT = {"inertia": 13.87, "mount": [0.0, 1.0795, 0.0]}
CHASSIS = {"sides": ["left", "right"], "hitch": True}
PINNED = {"kind": "pinned", "first": [0.0, 0.0], "last": [0.97536, 0.0]}
HELD = {"kind": "held", "first": [1.0, 2.0]}
HANGING = {"links": 8, "closed": False, "wheels": [], "ground": False, "gravity": 9.81, "ends": PINNED}
LOOP = HANGING | {"links": 16, "closed": True, "gravity": 0.0, "ends": None}
SAND = {
    "kc": 0.99e3, "kphi": 1528.43e3, "n": 1.1, "cohesion": 1040.0, "friction_angle": 0.5, "Au": 503e6,
    "shear_deformation_modulus": 0.025,
}  # fmt: skip
ROUND = HANGING | {"links": 64, "closed": True, "wheels": wheels(), "ground": True, "ends": None}
PLATE = HANGING | {
    "links": 2,
    "ground": True,
    "soil": SAND,
    "ends": {"kind": "pulled", "first": [0, 0], "last": [0, 0]},
}
PARTS = {
    "chassis": (Chassis, {"chassis": CHASSIS}),
    "drive": (Drive, {"drive": SHAFT}),
    "follower": (Drive, {"drive": SHAFT | {"demanded": True}}),
    "differential": (Differential, {"drive": SHAFT}),
    "driver": (Driver, {}),
    "cables": (Flexible, {"track": HANGING}),
    "cable loop": (Flexible, {"track": LOOP}),
    "cables on wheels": (Flexible, {"track": ROUND}),
    "rods": (Rigid, {"track": HANGING}),
    "rod loop": (Rigid, {"track": LOOP}),
    "rods on wheels": (Rigid, {"track": ROUND}),
    "rods on soil": (Rigid, {"track": PLATE}),
}


def config_of(part, changes):
    config = {"vehicle": copy.deepcopy(TABLE), "link_outputs": True, **copy.deepcopy(PARTS[part][1])}
    for key, value in changes.items():
        if key.startswith("/"):
            *path, last = key[1:].split("/")
            reduce(dict.__getitem__, path, config)[last] = value
    return config


def made(part, changes):
    """An initialised part whose variables are read and set by name."""
    model = PARTS[part][0](config_of(part, changes))
    return Probe(model, **parameters(model, **{key: value for key, value in changes.items() if key[0] != "/"}))


SHARP = {"mode": "controller", "controller.proportional": 1e12}
BEAM = {"element": "beam"}
EXPLICIT = {"integrator": "runge_kutta", "coordinates": "cholesky"}
REFUSED = [
    ("chassis", {"/chassis/sides": ["right"]}, "sides"),
    ("chassis", {"/chassis/seats": ["gunner"]}, "chassis.seats names 'gunner': the vehicle has driver"),
    ("chassis", {"/vehicle/hitch": None}, "the vehicle has no table hitch"),
    ("chassis", {"hitch.load.ramp.start": 2.0}, "hitch.load.ramp.end = 1 s must not be before"),
    ("chassis", {"hitch.load.points": "1 2; 1 3"}, "its speeds must rise"),
    ("chassis", {"hitch.load.points": "1 2 3"}, "must be 'speed force; speed force; ...'"),
    ("chassis", {"step": 0.0}, "step = 0"),
    ("chassis", {"step": np.nan}, "step = nan"),
    ("chassis", {"start.heading": np.inf}, "start.heading = inf"),
    ("chassis", {"/vehicle/tensioner/recoil": {"preload": 6e4, "stiffness": 3e5}, "tensioner.preload": 61e3},
     "tensioner.recoil.preload = 60000 N must be 61000 N at least"),
    ("drive", {"/drive/inertia": 0.0}, "drive.inertia = 0.0 kg m2 must be positive"),
    ("drive", {"/drive/demanded": "some"}, "drive.demanded = 'some': must be false, true"),
    ("drive", {"mode": "fast"}, "mode = 'fast': must be one of speed, torque, controller"),
    ("drive", {"extrapolation": "none"}, "extrapolation = 'none'"),
    ("drive", {"brake.torque": -1.0}, "brake.torque = -1"),
    ("drive", {"torque.limit": -5.0}, "torque.limit = -5"),
    ("drive", {"ramp.start": 2.0, "ramp.end": 1.0}, "ramp.end = 1 s must not be before ramp.start"),
    ("drive", {"ramp.end": 6.0, "stop.start": 5.0}, "must not be before"),
    ("drive", {"speed.end": np.nan}, "speed.end = nan"),
    ("drive", {"speed.points": "1 2; 1 3"}, "its times must rise"),
    ("drive", {"speed.points": "1 2 3"}, "must be 'time value; time value; ...'"),
    ("drive", {"speed.points": "fast"}, "must be 'time value; time value; ...'"),
    ("drive", {"torque.points": "0 nan"}, "must be finite numbers"),
    ("drive", {"brake.points": "0 -1"}, "must not be negative"),
    ("drive", {"speed.points": POINTS, "stop.start": 9.0}, "exclude each other"),
    ("drive", {"engine.points": "0 5"}, "engine.points needs mode 'torque' or 'controller'"),
    ("drive", {"engine.points": "0 -5", "mode": "torque"}, "engine.points = '0 -5' must not be negative"),
    ("drive", {"gear.ratio": 0.0}, "gear.ratio = 0: must be greater than 0"),
    ("follower", {"mode": "torque"}, "a drive with the input speed.demand has a speed or a controller"),
    ("follower", {"/drive/demanded": [""], "mode": "torque", "torque.drive": 5.0},
     "torque.drive = 5.0: the input torque.demand says how large it is"),
    ("follower", {"speed.end": 3.0}, "speed.end = 3.0: the input speed.demand says how fast"),
    ("follower", {"demand.lag": 0.0}, "demand.lag = 0: must be greater than 0"),
    ("differential", {"/drive/inertia": 0.0}, "drive.inertia = 0.0 kg m2 must be positive"),
    ("differential", {"steering.brake.torque": -1.0}, "steering.brake.torque = -1: must be between 0 and 1e11"),
    ("differential", {"propulsion.mode": "fast"}, "propulsion.mode = 'fast': must be one of speed"),
    ("differential", {"steering.gear.ratio": 0.0}, "steering.gear.ratio = 0: must be greater than 0"),
    ("differential", {"steering.ramp.start": 2.0}, "steering.ramp.end = 1 s must not be before steering.ramp.start"),
    ("differential", {"propulsion.engine.points": "0 5"}, "propulsion.engine.points needs mode"),
    ("differential", {"propulsion.engine.points": "0", "propulsion.mode": "torque"}, "must be 'speed torque; speed"),
    ("driver", {"path.arcs": "5"}, "path.arcs = '5': must be 'length curvature"),
    ("driver", {"path.arcs": "0 0"}, "an arc of length 0 turns on the spot, by an angle that is not 0"),
    ("driver", {"path.arcs": "1 nan"}, "finite numbers"),
    ("driver", {"path.points": "0 0"}, "at least two points"),
    ("driver", {"path.points": "0 0; 0 0"}, "each apart from the next"),
    ("driver", {"path.points": "0 0; 1 0", "path.arcs": "1 0"}, "exclude each other"),
    ("driver", {"friction": -0.1}, "friction = -0.1: must be 0 or more"),
    ("driver", {"grip": 0.95}, "grip = 0.95: must be between 0.05 and 0.9"),
    ("driver", {"reach": 0.0}, "reach = 0: must be greater than 0"),
    ("driver", {"yaw.gain": -1.0}, "yaw.gain = -1: must be 0 or more"),
    ("driver", {"speed.points": "0 -1"}, "speed.points = '0 -1' must not be negative"),
    ("driver", {"ramp.start": 2.0}, "ramp.end = 1 s must not be before ramp.start"),
    ("cables", {"element": "shell"}, "element = 'shell': must be one of cable, planar, beam"),
    ("cables", {"elasticity": "large"}, "elasticity = 'large': must be one of small_deformation, general, engineering"),
    ("cables", {"elasticity": "general"} | BEAM, "elasticity = 'general' needs element = 'cable'"),
    ("cables", {"/vehicle/material/shear_modulus": 50e9} | BEAM, "Poisson's ratio 1, of a beam 0 or more"),
    ("cables", {"material.youngs_modulus": -1.0}, "youngs_modulus"),
    ("cables", {"step": 0.0}, "step = 0"),
    ("cables", {"tolerance": 1.0}, "tolerance = 1: must be greater than 0 and 1e-05 at most"),
    ("cables", {"/track/ends": PINNED | {"last": [1.5, 0.0]}}, "cannot reach"),
    ("cables", {"/track/ends": HELD, "start": "folded"}, "a fold with one link across needs an odd number of links"),
    ("cables", {"/vehicle/track/inertia": [0.25, 3.4e-8, 0.22]}, "vehicle.track.inertia[1] = 3.4e-08"),
    ("cables", {"/vehicle/track/inertia": [0.6, 0.22, 0.25]} | BEAM, "must be less than the sum of the other two, 0.4"),
    ("cable loop", {"joints": "constrained"} | BEAM, "joints = 'constrained' needs element = 'cable' and axes ="),
    ("cable loop", {"joints": "constrained", "element": "planar"}, "not 'planar'"),
    ("cable loop", {"axes": "loose"}, "axes = 'loose': must be one of fixed, free"),
    ("cable loop", {"axes": "free"} | BEAM, "axes = 'free' needs element = 'cable'"),
    ("cable loop", {"axes": "free"}, "axes = 'free' needs wheels"),
    ("cable loop", EXPLICIT | {"integrator": "generalized_alpha"},
     "needs integrator = 'runge_kutta', 'adams' or 'dormand_prince', not 'generalized_alpha'"),
    ("cable loop", EXPLICIT | {"integrator": "hht", "spectral_radius": 0.5}, "not 'hht'"),
    ("cable loop", EXPLICIT | {"joints": "constrained"}, "needs axes = 'fixed' and joints = 'eliminated', not 'fixed'"),
    ("cables on wheels", {"/track/links": 70}, "70 links of 0.1524 m make 10.6680 m, the belt round the wheels 9"),
    ("rods", {"spectral_radius": 1.5}, "spectral_radius = 1.5: must be between 0 and 1"),
    ("rods", {"integrator": "hht"}, "spectral_radius = 0.4: integrator = 'hht' has 0.5 to 1"),
    ("rods", {"adams.rtol": 1.0}, "adams.rtol = 1: must be between 1e-13 and 0.1"),
    ("rods", {"formulation": "other"}, "formulation = 'other'"),
    *(("rods", {"formulation": "recursive", "integrator": name, "spectral_radius": 0.8},
       f"formulation = 'recursive' is integrated explicitly: integrator = '{name}' must be 'runge_kutta', 'adams' or"
       " 'dormand_prince'") for name in ("generalized_alpha", "hht")),
    ("rod loop", {"closure": "glue"}, "closure = 'glue'"),
    ("rod loop", {"closure": "spring", "closure.stiffness": 0.0}, "closure.stiffness = 0"),
    ("rod loop", {"/track/links": 3, "start.ovalling": 1.0}, "a triangle of links is rigid, it must be 0"),
    ("rods on soil", {"integrator": "runge_kutta"}, "soil remembers accepted steps and needs an implicit integrator"),
    ("rods on soil", {"/track/soil": SAND | {"Au": 0.0}}, "ground.soil.k0 = 0 and Au = 0"),
]  # fmt: skip


@pytest.mark.parametrize(("part", "changes", "sentence"), REFUSED)
def test_a_part_refuses_what_cannot_be(part, changes, sentence):
    with pytest.raises(InvalidParameter) as refusal:
        made(part, changes)
    assert sentence in str(refusal.value)


SPUN = {"start.spin": 50.0, "material.youngs_modulus": 1e5}
FAILED = [  # part, changes, inputs, and the length of the step that fails after 10 ms
    ("chassis", {}, {}, 1e300, "a communication step of 1e+300 s takes 1e+303 internal steps"),
    ("chassis", {}, {"left.idler.force.x": np.nan}, 1e-3, "left.idler.force.x is not finite"),
    ("chassis", {}, {"right.road_wheel[3].force.z": 1e8}, 1.0, "right road_arm[3] is beyond its reach"),
    ("chassis", {}, {"left.idler.force.x": -2e8}, 1.0, "left idler is beyond its reach"),
    ("drive", {}, {"sprocket.force.x": np.nan}, 1e-3, "at t = 0.01 s the input sprocket.force.x is not finite"),
    ("drive", {}, {"mount.position.z": np.inf}, 1e-3, "mount.position.z is not finite"),
    ("drive", {}, {"mount.orientation.w": 0.0}, 1e-3, "mount.orientation is no rotation"),
    ("differential", {}, {"right.sprocket.force.x": np.nan}, 1e-3, "right.sprocket.force.x is not finite"),
    ("differential", {}, {"right.mount.orientation.w": 3.0}, 1e-3, "right.mount.orientation is no rotation"),
    ("differential", {}, {"left.mount.orientation.w": 3.0}, 1e-3, "left.mount.orientation is no rotation"),
    ("driver", {}, {"chassis.velocity.y": np.nan}, 1e-3, "the input chassis.velocity.y is not finite"),
    ("rods on wheels", {}, {"sprocket.orientation.y": np.nan}, 1e-3, "t = 0.01 s the input sprocket.orientation.y is"),
    ("rods on wheels", {}, {"sprocket.orientation.w": 0.0}, 1e-3, "sprocket.orientation is no rotation: its length is"),
    ("rods on wheels", {}, {"idler.position.x": -4.777}, 1e-3, "the motion of each wheel must be connected"),
    ("rods on wheels", {}, {"idler.position.x": -1e12}, 1e-3, "the motion of each wheel must be connected"),
    ("rods on wheels", {}, {}, 1e6, "a communication step of 1e+06 s takes 1e+09 internal steps of 0.001 s"),
    ("cables on wheels", {}, {"idler.orientation.x": 0.05}, 1e-3, "5.7 degrees off the pin axis: cables with axes"),
]  # fmt: skip


@pytest.mark.parametrize(("part", "changes", "inputs", "h", "sentence"), FAILED)
def test_a_step_that_cannot_be_made_says_so_and_changes_nothing(part, changes, inputs, h, sentence):
    probe = made(part, changes).run(0.01)
    before = probe.model.state.copy()
    for name, value in inputs.items():
        probe[name] = value
    with pytest.raises(StepFailed) as failure:
        probe.step(h)
    assert sentence in str(failure.value)
    np.testing.assert_array_equal(probe.model.state, before)


@pytest.mark.parametrize(("part", "changes", "sentence"), [
    ("drive", SHARP, "the controller's gains are too large"),
    ("rods on wheels", {"start": "polygon", "contact.wheel.stiffness": 1e30}, "did not converge at t = 0 s, link 33"),
    ("cables on wheels", {"start": "polygon", "start.lateral": -1.0}, "sprocket is 2.07 m too far from where the"),
    ("cables on wheels", {"start": "polygon", "start.position.z": 0.2}, "0.2 m too far from where the track was laid"),
    ("cables on wheels", {"start": "polygon", "start.heading": 0.1}, "0.405 m too far from where the track was laid"),
    ("cable loop", SPUN, "spins at 50 rad/s has no relative equilibrium: its links are too soft"),
    ("cables", {"/track/ends": HELD, "/track/links": 33, "start": "folded", "material.youngs_modulus": 200.0},
     "the tension at which the chain is let go was not found: its links are too soft"),
])  # fmt: skip
def test_a_start_that_cannot_be_made_says_so(part, changes, sentence):
    with pytest.raises(StepFailed) as failure:
        made(part, changes).step()
    assert sentence in str(failure.value)


CURVE = {"compression": (-0.1, 0.0, 0.02, 0.1), "force": (-2e4, 0.0, 2e4, 2.2e5), "wheels": None}
STOP = {"gap": 0.02, "stiffness": 4e5, "damping": 0.0, "wheels": None}
CONTRADICTIONS = [
    ({"suspension": {"stiffness": [1e6, 2e6]}}, "suspension.stiffness: has 2 values, must have one for all"),
    ({"suspension": {"damping": [1.0, 2.0, 3.0, 4.0, -5.0]}}, "wheel 5: must be 0 to 1e+11 N s/m"),
    ({"road_arm": None}, "suspension: needs the table road_arm"),
    ({"suspension": None}, "road_arm: needs the table suspension, or pairs = true"),
    ({"suspension": None, "road_arm": {"beams": ((1, 2, 3),)}}, "pairs = true or beams with all wheels: bogies"),
    ({"road_arm": {"pairs": True}}, "road_arm.pairs: 5 wheels of a side must be an even number"),
    ({"road_arm": {"pairs": True, "beams": ((1, 2),)}}, "road_arm: beams = ((1, 2),) excludes pairs"),
    ({"road_arm": {"beams": ((1, 2), (3,))}}, "road_arm.beams[2] = (3,): must be a list of whole number, 1 to 12, at"),
    ({"road_arm": {"beams": ((0, 1),)}}, "road_arm.beams[1][1] = 0"),
    *(({"road_arm": {"beams": beams}}, f"road_arm.beams = {[[*beam] for beam in beams]}: must be lists of neighbours of"
       " the wheels 1 to 5, front to rear, each in one list at most")
      for beams in (((1, 3),), ((2, 1),), ((1, 2), (2, 3)), ((4, 5, 6),), ((3, 4), (1, 2)))),
    ({"road_arm": {"beams": ((1, 2, 3),)}}, "road_arm.pivot: the pivots of wheels 1 and 2, on one beam, must be at one"
     " place, not at (-0.367, -0.081) and (-1.034, -0.081) m"),
    ({"road_arm": {"mass": [70.0, 80.0]}}, "road_arm.mass: has 2 values, must have one for all wheels or 5"),
    ({"road_arm": {"pin_inertia": [1.0, 1.0, 1.0, 1.0, 0.0]}}, "wheel 5: must be greater than 0 kg m^2"),
    ({"road_arm": {"mass": [70.0, 80.0, 1e9, 80.0, 80.0]}}, "road_arm.mass = 1e+09 kg: must be 1e-06 to 1e+07 kg"),
    ({"tensioner": {"angle": 1.5}}, "tensioner.angle = 1.5: must be greater than -1.4, less than 1.4 rad"),
    ({"suspension": {"on_arm": None}}, "suspension.on_arm: is missing; stiffness acts between both ends"),
    ({"suspension": {"spring": {**CURVE, "force": (1.0, 2.0)}}}, "spring.force: has 2 numbers, must have 4"),
    ({"suspension": {"spring": {"compression": (0.0, 0.0), "force": (1.0, 2.0)}}}, "or more, rising"),
    ({"suspension": {"damper": {"speed": (0.0, 1.0), "force": (0.0, -1.0)}}}, "must have the sign of the speed"),
    ({"suspension": {"damper": {"speed": (0.5, 1.0), "force": (1.0, 2.0)}}}, "must have 0 m/s among"),
    ({"suspension": {"bump_stop": {**STOP, "wheels": (1, 9)}}}, "bump_stop.wheels: names wheel 9; a side has 5"),
    ({"tensioner": {"stiffness": 0.0, "recoil": {"preload": 1e3, "stiffness": 1e5}}},
     "tensioner.recoil: needs a tensioner.stiffness above 0"),
    ({"right": {"suspension": {"stiffness": (1.0, 2.0)}}}, "right.suspension.stiffness: has 2 values"),
]  # fmt: skip


@pytest.mark.parametrize(("tables", "sentence"), CONTRADICTIONS)
def test_a_vehicle_file_without_contradictions_is_asked_for(tables, sentence):
    table = copy.deepcopy(TABLE)
    for key, value in tables.items():
        table[key] = {**table[key], **value} if value and table.get(key) else value
    with pytest.raises(BadInput) as error:
        vehicle(table, "tank.toml")
    assert sentence in str(error.value)


SCENES = [
    ("hanging_chain", "flexible", {"track.formulation": "recursive"}, "needs model = 'rigid': flexible links have"),
    ("hanging_chain", "rigid", {"track.formulation": "recursive"}, "formulation = 'recursive' is integrated"),
    ("rig", "rigid", {"rig.links": 40}, "too long; 64 links or rig.axle_distance = "),
    ("straight", "rigid", {"vehicle.idler.x": -3.5}, "too short; 58 links or vehicle.idler.x = -3.991 m would fit"),
    ("elevated_sprocket", "rigid", {"vehicle.track.links": 42}, "track.tension = 12000 N: not reached with the"),
    ("elevated_sprocket", "rigid", {"vehicle.track.links": 42}, "; 43 links or vehicle.idler.x = 1.683 m would fit"),
    ("elevated_sprocket", "rigid", {"vehicle.tensioner.recoil.preload": 9.0}, "recoil.preload = 9 N must be"),
]  # fmt: skip


@pytest.mark.parametrize(("scene", "links", "settings", "sentence"), SCENES)
def test_a_scene_that_cannot_be_says_so(scene, links, settings, sentence):
    with pytest.raises(BadInput) as error:
        placed(load(scene, links, settings))
    assert sentence in str(error.value)


REST = {"height": 0.0, "roll": 0.0, "pitch": 0.0, "left": [0.0] * 6, "right": [0.0] * 6}
PULL = "because rest.* does not count the pull at its hitch"
WARNINGS = [  # part, changes, inputs; the warning of 10 ms, after which there is none
    ("chassis", {"/chassis/start": REST}, {"hitch.force.x": -15e3}, PULL),
    ("chassis", {"/chassis/start": REST}, {"right.sprocket.torque.y": -9e3}, "not count the torque of its drives"),
    ("chassis", {"/chassis/start": REST}, {"hitch.force.x": -15e3, "right.sprocket.torque.y": -9e3},
     PULL + " and the torque of its drives"),
    ("chassis", {"/chassis/start": REST}, {"hitch.force.x": -100.0},
     "because a number is another than that with which rest.* was found, or other tracks act on it"),
    ("drive", {"mode": "torque", "torque.drive": -900.0, "torque.limit": 400.0}, {},
     "the torque -900 N m of the motor is beyond torque.limit = 400 N m"),
    ("follower", {"/drive/demanded": [""], "mode": "torque", "torque.limit": 1e3}, {"torque.demand": -9e9},
     "beyond torque.limit = 1000 N m"),
]  # fmt: skip


@pytest.mark.parametrize(("part", "changes", "inputs", "sentence"), WARNINGS)
def test_a_warning_is_given_once(part, changes, inputs, sentence):
    probe = made(part, changes)
    for name, value in inputs.items():
        probe[name] = value
    (warning,) = probe.run(0.01).model.warnings()
    assert sentence in warning
    assert probe.run(0.01).model.warnings() == []
