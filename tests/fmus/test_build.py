"""An FMU depends on its sources and configuration alone and is built once, by one process."""

import json
import os
import subprocess
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor

import pytest
from conftest import TOY, build_toy

from fmus import ahead
from fmus.cache.sources import ROOT, search_path, source_hash, sources
from fmus.fmi.build import KINDS, BuildFailed, Shell, build, build_shell, build_shells
from orchestrator.fmu_check import runner


def test_fmu_holds_the_whole_tree_and_sources_only(toy):
    with zipfile.ZipFile(toy) as archive:
        names = archive.namelist()
        packed = {name.removeprefix("resources/fmus/") for name in names if name.startswith("resources/fmus/")}
        assert packed == {source.relative_to(ROOT).as_posix() for source in sources()}
        assert archive.read("resources/build.txt").decode() == source_hash()
        assert {"resources/config.json", "resources/toy_fmu.py", "resources/toy/kernels.py"} <= set(names)
        assert "binaries/linux64/Toy.so" in names
    assert not [name for name in names if "__pycache__" in name or "/tests/" in name]


def test_same_question_same_file(toy, tmp_path):
    before = toy.stat()
    assert build_toy() == toy
    assert toy.stat().st_mtime_ns == before.st_mtime_ns
    assert build_toy(start=0.2) != toy
    copy = build_toy(tmp_path, "other")
    assert copy == tmp_path / "other.fmu"
    assert build_toy(name="other").name == "other.fmu"
    assert [path.name for path in tmp_path.iterdir()] == ["other.fmu"]


def test_fmus_built_together_are_those_built_alone(tmp_path, monkeypatch):
    """One child describes those that the cache lacks, each with its own configuration."""
    children = []
    run = subprocess.run
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


@pytest.mark.parametrize(
    "child", ["fmus.fmi.build", "fmus.ahead contents", "fmus.ahead kernels", "orchestrator.fmu_check.runner"]
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
        "fmus.ahead contents": lambda: ahead.loaded_contents([part]),
        "fmus.ahead kernels": lambda: ahead.start_compilation([part]),
        "orchestrator.fmu_check.runner": lambda: runner.in_child("units", tmp_path / "a.fmu", None, 1.0),
    }
    with pytest.raises((OSError, BuildFailed), match="no child here"):
        calls[child]()
    path = paths[0]
    assert path[1:] == sys.path
    assert str(tmp_path / "packages") in path


@pytest.mark.long
def test_packages_may_come_by_pythonpath(tmp_path):
    """A Python without packages builds an FMU with those in PYTHONPATH, as ``pip install --target`` puts them."""
    env = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(TOY.parents[1]), *sys.path]),
        "COTRACK_CACHE": str(tmp_path),
    }
    command = [getattr(sys, "_base_executable", sys.executable), "-P", "-m", "orchestrator", "build", "hanging_chain"]
    done = subprocess.run([*command, "-o", "built"], env=env, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert [file.name for file in (tmp_path / "built").iterdir()] == ["TrackFlexible-hanging_chain.fmu"]


def test_of_fmus_built_together_the_one_that_fails_is_named(tmp_path, monkeypatch):
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path))
    other = tmp_path / "other_fmu.py"
    other.write_text((TOY / "toy_fmu.py").read_text(encoding="utf-8"), encoding="utf-8")
    shells = [Shell(TOY / "toy_fmu.py", {"spare": 3, "start": 0.1}, "one"), Shell(other, {"spare": "many"}, "two")]
    with pytest.raises(BuildFailed, match=r"^cannot build other_fmu: "):
        build_shells(shells, packages=[TOY])
    assert not list(tmp_path.rglob("*.fmu"))


def test_of_a_child_that_ends_the_fmus_are_named(tmp_path, monkeypatch):
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path))
    (tmp_path / "ending_fmu.py").write_text("raise SystemExit('the end')", encoding="utf-8")
    with pytest.raises(BuildFailed, match=r"^cannot build ending_fmu: the end$"):
        build_shell(tmp_path / "ending_fmu.py", {})


@pytest.mark.long
def test_equal_sources_give_equal_bytes(tmp_path, monkeypatch):
    """Builds at different times give the same bytes, so that a replay can rebuild the FMU of a log."""
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    contents = []
    for name in ("one", "two"):
        monkeypatch.setenv("COTRACK_CACHE", str(tmp_path / name))
        built = build_toy()
        contents.append(built.read_bytes())
        with zipfile.ZipFile(built) as archive:
            assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
            assert 'generationDateAndTime="1980-01-01T00:00:00' in archive.read("modelDescription.xml").decode()
    assert contents[0] == contents[1]


@pytest.mark.long
def test_two_builds_at_once_leave_one_file(fresh_cache):
    with ThreadPoolExecutor(2) as pool:
        paths = list(pool.map(lambda _: build_toy(), range(2)))
    assert paths[0] == paths[1]
    assert [path.name for path in paths[0].parent.iterdir()] == ["toy_fmu.fmu"]
    assert zipfile.ZipFile(paths[0]).testzip() is None


def test_building_leaves_this_process_alone(fresh_cache):
    path, modules = list(sys.path), set(sys.modules)
    build_toy()
    assert sys.path == path
    assert not [name for name in set(sys.modules) - modules if "toy" in name or "pythonfmu" in name]


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: build("Submarine", {}), "no kind of component is called 'Submarine': there are TrackFlexible"),
        (lambda: build_toy(start=float("nan")), "the configuration of toy_fmu is not JSON: "),
        (lambda: build_toy(spare="many"), "cannot build toy_fmu: TypeError: "),
        (lambda: build_shell(TOY / "toy_fmu.py", {}, packages=[TOY]), "cannot build toy_fmu: KeyError: "),
        (lambda: build_shell(TOY / "none_fmu.py", {}), "no FMU shell at "),
    ],
)
def test_what_cannot_be_built_is_refused_in_one_sentence(call, sentence):
    with pytest.raises(BuildFailed) as caught:
        call()
    assert str(caught.value).startswith(sentence)
    assert "\n" not in str(caught.value)


def test_without_a_folder_for_it_an_fmu_is_refused_in_one_sentence(toy, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    with pytest.raises(BuildFailed, match=r"^cannot build toy_fmu.fmu: .*Not a directory"):
        build_toy(tmp_path / "file" / "folder")
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path / "file"))
    monkeypatch.setattr("fmus.fmi.build.temporary_folder", lambda: tmp_path / "file")
    with pytest.raises(BuildFailed, match=r"^cannot build toy_fmu.fmu: .*Not a directory"):
        build_toy()


@pytest.mark.parametrize("kind", KINDS)
def test_shells_have_stems_of_their_own(kind):
    stems = [path.rpartition("/")[2] for path in KINDS.values()]
    assert len(set(stems)) == len(stems)
    assert stems.count(KINDS[kind].rpartition("/")[2]) == 1


def test_a_child_does_not_find_what_a_loaded_fmu_packs(tmp_path, monkeypatch):
    """Pythonfmu adds the folder of an FMU that it loads to the path; its copy of pythonfmu there has no binaries."""
    resources = tmp_path / "resources"
    monkeypatch.syspath_prepend(str(resources))
    assert str(resources) in search_path(ROOT).split(os.pathsep), "the twin: any other folder is handed on"
    (tmp_path / "modelDescription.xml").write_text("<fmiModelDescription/>")
    assert str(resources) not in search_path(ROOT).split(os.pathsep)
