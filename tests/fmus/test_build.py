"""An FMU depends on its sources and configuration alone and is built once; its kernels are compiled beside."""

import json
import os
import subprocess
import sys
import zipfile

import pytest
from built_toy import TOY, build_toy

from fmus import precompile
from fmus.cache.sources import ROOT, search_path, source_hash, sources
from fmus.components import COMPONENT_KINDS
from fmus.fmi.build import BuildFailed, Shell, build_shells
from orchestrator.fmu_check import runner
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load


def test_fmu_holds_the_whole_tree_and_sources_only(toy):
    with zipfile.ZipFile(toy) as archive:
        names = archive.namelist()
        packed = {name.removeprefix("resources/fmus/") for name in names if name.startswith("resources/fmus/")}
        assert packed == {source.relative_to(ROOT).as_posix() for source in sources()}
        assert archive.read("resources/build.txt").decode() == source_hash()
        assert {"resources/config.json", "resources/toy_fmu.py", "resources/toy/kernels.py"} <= set(names)
        assert "binaries/linux64/Toy.so" in names
    assert not [name for name in names if "__pycache__" in name or "/tests/" in name]


@pytest.mark.long
def test_same_question_same_file(toy, tmp_path):
    before = toy.stat()
    assert build_toy() == toy
    assert toy.stat().st_mtime_ns == before.st_mtime_ns
    assert build_toy(start=0.2) != toy
    copy = build_toy(tmp_path, "other")
    assert copy == tmp_path / "other.fmu"
    assert build_toy(name="other").name == "other.fmu"
    assert [path.name for path in tmp_path.iterdir()] == ["other.fmu"]


@pytest.mark.long
def test_fmus_built_together_are_those_built_alone(tmp_path, monkeypatch):
    """One child describes those that the cache lacks, each with its own configuration; equal sources, equal bytes.

    So a replay can rebuild the FMU of a log. This process imports nothing of them.
    """
    children, run = [], subprocess.run
    path, modules = list(sys.path), set(sys.modules)
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    monkeypatch.setattr(
        "fmus.fmi.build.subprocess.run", lambda *words, **how: children.append(how) or run(*words, **how)
    )
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path / "together"))
    first = build_toy(start=0.1)
    configs = [{"spare": 3, "start": start} for start in (0.1, 0.3, 0.4, 0.3)]
    built = build_shells([Shell(TOY / "toy_fmu.py", config, "toy_fmu") for config in configs], packages=[TOY])
    assert built[0] == first
    assert built[1] == built[3]
    assert len(set(built)) == 3
    assert [len(json.loads(child["input"])["shells"]) for child in children] == [1, 2]
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path / "alone"))
    assert build_toy(start=0.4).read_bytes() == built[2].read_bytes()
    with zipfile.ZipFile(first) as archive:
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        assert 'generationDateAndTime="1980-01-01T00:00:00' in archive.read("modelDescription.xml").decode()
    assert sys.path == path
    assert not [name for name in set(sys.modules) - modules if "toy" in name or "pythonfmu" in name]


@pytest.mark.parametrize(
    "child", ["fmus.fmi.build", "fmus.precompile contents", "fmus.precompile kernels", "orchestrator.fmu_check.runner"]
)
def test_a_child_finds_what_its_parent_finds(tmp_path, monkeypatch, child):
    """Packages that came by PYTHONPATH, or that the program put on its path, are on that of every child."""
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path))
    monkeypatch.delenv("PYTHONPATH", raising=False)
    monkeypatch.setattr("sys.path", [each for each in sys.path if not each.endswith("resources")])  # no FMU is loaded
    monkeypatch.syspath_prepend(tmp_path / "packages")
    paths = []

    def started(command, **how):
        paths.append(how["env"]["PYTHONPATH"].split(os.pathsep))
        raise OSError("no child here")

    for name in ("run", "Popen"):
        monkeypatch.setattr(f"{child.split()[0]}.subprocess.{name}", started)
    part = ("SprocketDrive", {}, {})
    calls = {
        "fmus.fmi.build": lambda: build_toy(start=0.77),
        "fmus.precompile contents": lambda: precompile.loaded_contents([part]),
        "fmus.precompile kernels": lambda: precompile.start_compilation([part]),
        "orchestrator.fmu_check.runner": lambda: runner.in_child("units", tmp_path / "a.fmu", None, 1.0),
    }
    with pytest.raises((OSError, BuildFailed), match="no child here"):
        calls[child]()
    assert paths[0][1:] == sys.path
    assert str(tmp_path / "packages") in paths[0]


def test_a_child_does_not_find_what_a_loaded_fmu_packs(tmp_path, monkeypatch):
    """Pythonfmu adds the folder of an FMU that it loads to the path; its copy of pythonfmu there has no binaries."""
    resources = tmp_path / "resources"
    monkeypatch.syspath_prepend(str(resources))
    assert str(resources) in search_path(ROOT).split(os.pathsep), "the twin: any other folder is handed on"
    (tmp_path / "modelDescription.xml").write_text("<fmiModelDescription/>")
    assert str(resources) not in search_path(ROOT).split(os.pathsep)


def test_of_fmus_built_together_the_one_that_fails_is_named(fresh_cache, tmp_path):
    other = tmp_path / "other_fmu.py"
    other.write_text((TOY / "toy_fmu.py").read_text(encoding="utf-8"), encoding="utf-8")
    shells = [Shell(TOY / "toy_fmu.py", {"spare": 3, "start": 0.1}, "one"), Shell(other, {"spare": "many"}, "two")]
    with pytest.raises(BuildFailed, match=r"^cannot build other_fmu: "):
        build_shells(shells, packages=[TOY])
    assert not list(fresh_cache.rglob("*.fmu"))


def test_shells_have_stems_of_their_own():
    assert len({path.rpartition("/")[2] for path in COMPONENT_KINDS.values()}) == len(COMPONENT_KINDS)


# --- kernels that a background process compiles -----------------------------------------------------


def recipe(scene, kind):
    """Kind, config and parameters of the first part of a kind in a scene."""
    return next((p.kind, p.config, p.parameters) for p in assemble(load(scene)).parts if p.kind == kind)


DRIVE, CABLES = recipe("straight", "SprocketDrive"), recipe("hanging_chain", "TrackFlexible")
PROGRAM = """
import json, logging, sys
import numpy as np
from fmus.components import model_of
kind, config, parameters = json.load(sys.stdin)
model = model_of(kind)(config)
model.initialise({p.name: p.start for p in model.ports if p.causality == "parameter"} | parameters)
logging.basicConfig(level=logging.INFO)
reals = [p for p in model.ports if isinstance(p.start, float)]
model.step(0.0, 1e-3, np.array([p.start for p in reals if p.causality == "input"]))
model.outputs(np.zeros(sum(p.causality == "output" for p in reals) - model.link_ports))
model.link_outputs(np.zeros(model.link_ports))
"""


def compiled_by_a_step(part, cache, environment):
    """Whether a step in a new process compiles any kernel."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], input=json.dumps(part), capture_output=True, text=True, check=True,
        env={**environment, "COTRACK_CACHE": str(cache), "PYTHONPATH": str(precompile.ROOT.parent)},
    )  # fmt: skip
    return "is compiled" in done.stderr


@pytest.mark.study
@pytest.mark.parametrize("part", [DRIVE, CABLES], ids=["drive", "cables"])
def test_what_was_compiled_beside_is_not_compiled_again(environment, monkeypatch, tmp_path, part):
    assert compiled_by_a_step(part, tmp_path / "empty", environment), "the twin"
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path / "cache"))
    process = precompile.start_compilation([part])
    assert process is not None
    assert process.wait(timeout=120) == 0
    assert precompile.start_compilation([part]) is None
    assert not compiled_by_a_step(part, tmp_path / "cache", environment)


def test_kernels_of_each_kind_of_track_are_compiled_ahead_once(fresh_cache):
    contact = {"contact": {"ground": {"law": "linear", "stiffness": 1e6}}}
    ridden = {"soil": {"n": 1.0}}, contact, {}
    others = (
        ({}, contact, {}),
        ({"soil": {"n": 1.0}, "terrain": [1.0]}, contact, {}),
        ({"soil": {"n": 1.0}}, contact | {"track": {"bushing": {"stiffness": 1.0}}}, {}),
        ({"soil": {"n": 1.0}}, {"contact": {"ground": {"law": "hunt_crossley"}}}, {}),
        ({"soil": {"n": 1.0}}, contact, {"integrator": "hht"}),
    )
    same = ({"soil": {"n": 0.5}}, {"contact": {"ground": {"law": "linear", "stiffness": 2e6}}}, {"step": 1e-3})

    def mark(parts):
        track, vehicle, parameters = parts
        return precompile._mark(
            ("TrackRigid", {"track": {"closed": True} | track, "vehicle": vehicle}, parameters), False
        )

    assert len({mark(parts) for parts in (ridden, *others)}) == 1 + len(others)
    assert mark(same) == mark(ridden)


def test_parts_that_cannot_start_are_left_to_the_fmus(fresh_cache):
    process = precompile.start_compilation([("SprocketDrive", {"vehicle": {}, "drive": {}}, {})])
    assert process is not None
    assert process.wait(timeout=120) == 0
    other = precompile.start_compilation([DRIVE])
    assert other is not None
    other.kill()  # its compilation takes seconds
    other.wait()
