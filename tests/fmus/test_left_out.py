"""A component loads only what its scene needs, in a fresh process, with a cold or warm cache."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

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
HANGING = {"kind": "pinned", "first": [0.0, 0.0], "last": [0.9144, 0.0]}


def loaded(kind: str, track: dict, **changes) -> set[str]:
    from fmus.vehicles.vehicle import read_table, vehicle

    table = vehicle(*read_table("m113")).model_dump()
    base = {"links": 8, "closed": False, "wheels": [], "ground": False, "gravity": 9.81, "ends": HANGING}
    given = json.dumps([kind, base | track, table])
    program = [sys.executable, "-c", PROGRAM, given, json.dumps(changes)]
    done = subprocess.run(program, capture_output=True, text=True, check=True)
    return set(json.loads(done.stdout))


@pytest.mark.long
@pytest.mark.parametrize("kind", ["track_flexible", "track_rigid"])
def test_a_hanging_chain_loads_no_contact_code(kind):
    names = loaded(kind, {})
    assert f"fmus.physics.chain.{kind[6:]}.dynamics" in names
    assert not [name for name in names if "contact" in name]
    assert not [name for name in names if "chassis" in name or "drive" in name or "vehicle" in name]
    assert bool([name for name in names if "ancf" in name]) == (kind == "track_flexible")
    assert bool([name for name in names if "rigid" in name]) == (kind == "track_rigid")


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


@pytest.mark.long
def test_a_chain_over_the_ground_does():
    names = loaded("track_rigid", {"ground": True}, **{"start.slope.pitch": -0.2})
    assert {"fmus.track.contacts", "fmus.physics.chain.rigid.faces"} <= names
    assert not [name for name in names if "ancf" in name or "cable" in name or "beam" in name]
    assert not [name for name in names if "soil" in name], "hard ground"
    assert not [name for name in names if "terrain" in name], "a plane in the start's frame"


OTHERS = {
    "small_deformation": set(),
    "general": {"fmus.physics.ancf.cable_general"},
    "engineering": {"fmus.physics.ancf.cable_engineering"},
}


@pytest.mark.long
@pytest.mark.parametrize("elasticity", [None, *OTHERS])
def test_a_chain_loads_its_own_elasticity_only(elasticity):
    """A chain loads the modules of its own elasticity only.

    The default is small deformation; it loads neither the modules of the others nor those that they share.
    """
    names = loaded("track_flexible", {}, **({"elasticity": elasticity} if elasticity else {}))
    own = OTHERS[elasticity or "small_deformation"]
    assert own <= names
    for other in OTHERS.values():
        assert other == own or not other & names
    shared = {f"fmus.physics.ancf.{name}" for name in ("cable_local", "centreline", "gauss")}
    assert (shared <= names) if own else not shared & names


@pytest.mark.long
def test_a_planar_chain_loads_no_beams_and_another_chain_no_planar_one():
    planar, cables = loaded("track_flexible", {}, element="planar"), loaded("track_flexible", {})
    assert {"fmus.physics.chain.flexible.planar", "fmus.physics.ancf.cable"} <= planar
    assert "fmus.physics.chain.flexible.planar" not in cables
    names = planar | cables
    assert not names & {"fmus.physics.chain.flexible.beams", "fmus.physics.ancf.beam"}
    assert not [name for name in names if "contact" in name]


@pytest.mark.long
def test_contents_are_what_a_component_loads():
    """The list from a child that compiles nothing is the list of modules that a real step loads."""
    from fmus.ahead import loaded_contents
    from fmus.vehicles.vehicle import read_table, vehicle

    table = vehicle(*read_table("m113")).model_dump()
    held = {"ends": {"kind": "held", "first": [0.0, 0.0]}}
    cases = (({}, {"element": "planar"}), ({"ground": True}, {"start": "displaced"}), (held, {"start": "straight"}))
    for track, parameters in cases:
        base = {"links": 8, "closed": False, "wheels": [], "ground": False, "gravity": 9.81, "ends": HANGING}
        config = {"vehicle": table, "track": base | track}
        contents = loaded_contents([("TrackFlexible", config, parameters)])
        real = {name for name in loaded("track_flexible", track, **parameters) if name not in FOLDERS}
        assert real - {"fmus.fmi.build", "fmus.vehicles.vehicle"} <= set(contents.modules)
        assert set(contents.left_out) >= {
            "fmus.chassis.model",
            "fmus.physics.chain.rigid.dynamics",
            "fmus.physics.contact.guide",
        }
        assert not set(contents.left_out) & set(contents.modules)
        assert ("fmus.physics.contact.ground" in contents.modules) == ("ground" in track)
        assert ("fmus.physics.chain.flexible.consistent_start" in contents.modules) == ("start" in parameters)
        assert (contents.outputs, contents.link_outputs) == (
            (28,),
            (2 * 8 + 6 * 9 + (3 * 8 if "ground" in track else 0),),
        )


def test_contents_are_listed_once_for_a_build(monkeypatch, tmp_path):
    from fmus import ahead

    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path))
    contents, started = ahead.Contents(("fmus.a",), ("fmus.b",), (3,), (4,), (5,)), []
    monkeypatch.setattr(ahead, "_started", lambda parts: started.append(parts) or contents)
    parts = [("Chassis", {"x": 1.0}, {})]
    assert [ahead.loaded_contents(parts) for _ in range(2)] == [contents, contents]
    assert len(started) == 1
    ahead.loaded_contents([("Chassis", {"x": 1.1}, {})])
    assert len(started) == 2


@pytest.mark.long
@pytest.mark.parametrize("spin", [0.0, 5.0])
def test_a_loop_that_spins_is_stretched(spin):
    from fmus.ahead import loaded_contents
    from fmus.vehicles.vehicle import read_table, vehicle

    track = {"links": 64, "closed": True, "wheels": [], "ground": False, "gravity": 0.0, "ends": None}
    config = {"vehicle": vehicle(*read_table("m113")).model_dump(), "track": track}
    contents = loaded_contents([("TrackFlexible", config, {"start.spin": spin})])
    assert ("fmus.physics.chain.flexible.spinning" in contents.modules) == (spin > 0.0)


FOLDERS = {
    "fmus", "fmus.cache", "fmus.ground", "fmus.interface", "fmus.kernels", "fmus.track",
    "fmus.physics", "fmus.physics.ancf", "fmus.physics.integrate", "fmus.physics.contact", "fmus.physics.chain",
    "fmus.physics.chain.flexible", "fmus.track_flexible",
}  # fmt: skip


ELEMENT = {
    "cable": {"fmus.physics.chain.flexible.cables"},
    "beam": {"fmus.physics.chain.flexible.beams", "fmus.physics.ancf.beam"},
}


@pytest.mark.long
@pytest.mark.parametrize(("element", "other"), [("cable", "beam"), ("beam", "cable")])
def test_a_chain_loads_its_own_element_only(element, other):
    names = loaded("track_flexible", {}, element=element)
    assert ELEMENT[element] <= names
    assert not ELEMENT[other] & names
    assert not [name for name in names if "contact" in name]
