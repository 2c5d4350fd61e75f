"""The wheel is complete: unpacked elsewhere, it lists its scenes and builds an FMU from its own files."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    done = subprocess.run(build, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (wheel,) = folder.glob("cotrack-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def cotrack(site, folder, *arguments):
    environment = {**os.environ, "PYTHONPATH": str(site)}
    command = [sys.executable, "-P", "-m", "orchestrator", *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)


def test_wheel_has_scenes_vehicles_and_pages_only(unpacked):
    assert (unpacked / "orchestrator" / "gallery" / "straight.toml").is_file()
    assert (unpacked / "fmus" / "vehicles" / "m113.toml").is_file()
    assert len([*unpacked.glob("**/*.png")]) == len([*unpacked.glob("fmus/*/icon.png")]) == 6
    top = {path.name for path in unpacked.iterdir() if not path.name.endswith(".dist-info")}
    assert top == {"cotrack", "fmus", "orchestrator"}
    assert all((unpacked / name / "py.typed").is_file() for name in top)
    assert sum(path.stat().st_size for path in unpacked.parent.glob("*.whl")) < 2_000_000
    (entries,) = unpacked.glob("*.dist-info/entry_points.txt")
    assert "cotrack = orchestrator.__main__:main" in entries.read_text()


@pytest.mark.long
def test_cotrack_runs_from_the_wheel(unpacked, tmp_path):
    for words, said, file in (
        (["scenes"], "straight", ""),
        (["run", "hanging_chain", "--stop", "0.01", "--json"], "ok", "logs/hanging_chain-flexible-run.stop=0.01.mcap"),
        (["build", "hanging_chain", "-o", "out"], "", "out/TrackFlexible-hanging_chain.fmu"),
    ):
        done = cotrack(unpacked, tmp_path, *words)
        assert done.returncode == 0, done.stderr
        assert said in done.stdout
        assert (tmp_path / file).exists()
