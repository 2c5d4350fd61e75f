"""A component loads only what its scene needs, in a fresh process, with a cold or warm cache."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from m113 import VEHICLE

from fmus.precompile import loaded_contents

PROGRAM = """
import json, sys
import numpy as np
from importlib import import_module
kind, track, table = json.loads(sys.argv[1])
model = import_module(f"fmus.{kind}.model").Model({"vehicle": table, "track": track, "link_outputs": True})
model.initialise({p.name: p.start for p in model.ports if p.causality == "parameter"} | json.loads(sys.argv[2]))
u = np.array([p.start for p in model.ports if p.causality == "input"], dtype=float)
model.step(0.0, 1e-3, u)
print(json.dumps(sorted(name for name in sys.modules if name.startswith("fmus"))))
"""
HANGING = {
    "links": 8, "closed": False, "wheels": [], "ground": False, "gravity": 9.81,
    "ends": {"kind": "pinned", "first": [0.0, 0.0], "last": [0.9144, 0.0]},
}  # fmt: skip
LOOP = {"links": 64, "closed": True, "gravity": 0.0, "ends": None}
FLEXIBLE, RIGID = "TrackFlexible", "TrackRigid"
SIDES = {"sides": ["left", "right"]}
SHARED = ("ancf.cable_local", "ancf.centreline", "ancf.gauss")
GENERAL, ENGINEERING, PLANAR = ("ancf.cable_general",), ("ancf.cable_engineering",), ("flexible.planar",)
CABLE, BEAM = ("flexible.cables", "ancf.cable"), ("flexible.beams", "ancf.beam")
AIR = ("contact", "terrain", "soil", "chassis.model")
ROWS = [  # kind, track or chassis, parameters; ends of names that are loaded, parts of names that are not
    (FLEXIBLE, {}, {}, ("flexible.dynamics", *CABLE), (*AIR, "rigid", *BEAM, *PLANAR, *GENERAL, *ENGINEERING, *SHARED)),
    (FLEXIBLE, {}, {"elasticity": "general"}, (*GENERAL, *SHARED), (*AIR, *ENGINEERING)),
    (FLEXIBLE, {}, {"elasticity": "engineering"}, (*ENGINEERING, *SHARED), (*AIR, *GENERAL)),
    (FLEXIBLE, {}, {"element": "beam"}, BEAM, (*AIR, "flexible.cables", *PLANAR)),
    (FLEXIBLE, {}, {"element": "planar"}, (*PLANAR, "ancf.cable"), (*AIR, *BEAM)),
    (FLEXIBLE, LOOP, {"start.spin": 5.0}, ("flexible.spinning",), AIR),
    (FLEXIBLE, LOOP, {"start.spin": 0.0}, CABLE, (*AIR, "flexible.spinning")),
    (FLEXIBLE, {"ground": True}, {"start": "displaced"}, ("contact.ground", "consistent_start"),
     ("contact.guide", "soil")),
    (RIGID, {}, {}, ("rigid.dynamics",), (*AIR, "ancf", "flexible")),
    (RIGID, {"ground": True}, {"start.slope.pitch": -0.2}, ("fmus.track.contacts", "rigid.faces"),
     ("ancf", "cable", "beam", "soil", "terrain")),
    ("Chassis", SIDES, {}, ("chassis.dynamics",), ("contact", "chassis.hitch", "chassis.seats", "track_")),
    ("Chassis", SIDES | {"ground": {"hull": True, "bare": []}}, {}, ("chassis.contacts",), ("chassis.hitch",)),
]  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize(("kind", "given", "changes", "loads", "leaves"), ROWS)
def test_a_component_loads_what_its_scene_needs(kind, given, changes, loads, leaves):
    """By the list from a child that compiles nothing."""
    own = {"chassis": given} if kind == "Chassis" else {"track": HANGING | given}
    contents = loaded_contents([(kind, {"vehicle": VEHICLE, **own}, changes)])
    assert not [part for part in loads if not any(name.endswith(part) for name in contents.modules)]
    assert not [name for name in contents.modules if any(part in name for part in leaves)]
    assert not set(contents.left_out) & set(contents.modules)
    assert [name for name in contents.left_out if any(part in name for part in leaves)]


@pytest.mark.long
@pytest.mark.parametrize(("kind", "track", "changes"), [
    (FLEXIBLE, {}, {"element": "planar"}), (FLEXIBLE, {"ground": True}, {"start": "displaced"}), (RIGID, {}, {}),
])  # fmt: skip
def test_contents_are_what_a_component_loads(kind, track, changes):
    """The list from a child that compiles nothing is the list of modules that a real step loads."""
    config = {"vehicle": VEHICLE, "track": HANGING | track}
    contents = loaded_contents([(kind, config, changes)])
    folder = {FLEXIBLE: "track_flexible", RIGID: "track_rigid"}[kind]
    program = [sys.executable, "-c", PROGRAM, json.dumps([folder, config["track"], VEHICLE]), json.dumps(changes)]
    done = subprocess.run(program, capture_output=True, text=True, check=True)
    real = {name for name in json.loads(done.stdout) if any(other.startswith(f"{name}.") for other in contents.modules)}
    assert {*json.loads(done.stdout)} - real - {"fmus.fmi.build", "fmus.vehicles.vehicle"} <= {*contents.modules}
    assert contents.outputs == (28,)
    assert contents.link_outputs == (2 * 8 + 6 * 9 + (3 * 8 if "ground" in track else 0),)


@pytest.mark.long
@pytest.mark.parametrize(("setting", "loads"), [("ground.grade=0.2", False), ("ground.kerb={y=1,rise=0.1}", True)])
def test_a_scene_on_a_plane_loads_no_terrain(setting, loads):
    """A slope is a plane in the frame of the start; another ground is a terrain (twin)."""
    program = (
        "import json, sys; from orchestrator.scene.assembly import assemble; from orchestrator.scene.placing import"
        " placed; from orchestrator.scene.scene import load\n"
        "parts = assemble(placed(load('straight', 'rigid', sys.argv[1:]))).parts\n"
        "print(json.dumps([any('terrain' in str(found) for found in all) for all in (list(sys.modules), parts)]))"
    )
    done = subprocess.run([sys.executable, "-c", program, setting], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == [loads, loads]
