"""FMUs in processes of their own: ends, other builds, machines without cotrack."""

import subprocess
import sys
import zipfile

import pytest
from built_toy import build_toy

from fmus.fmi.build import build
from fmus.vehicles.vehicle import read_table, vehicle

TABLE = vehicle(*read_table("m113")).model_dump()


def python(program, *arguments, **options):
    """Lines that a program prints in a process of its own, which must end well."""
    command = [sys.executable, "-X", "faulthandler", "-c", program, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, **options)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def foreign(fmu, folder):
    """The same FMU from another build of the package."""
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(folder / "foreign.fmu", "w") as target:
        for name in source.namelist():
            target.writestr(name, b"0" * 64 if name == "resources/build.txt" else source.read(name))
    return folder / "foreign.fmu"


FOREIGN = """
import sys
from pathlib import Path
from orchestrator.cosim.component import Component
from orchestrator.fmi.slave import ComponentFailed
try:
    Component(Path(sys.argv[1]), "toy")
except ComponentFailed as error:
    print(error)
for path in sys.argv[2:]:
    with Component(Path(path), "toy") as component:  # and the process goes on
        component.initialise({})
        component.step(0.0, 1e-3)
left_open = Component(Path(path), "toy")
left_open.initialise({})
print("survived")
"""


@pytest.mark.long
def test_fmu_of_another_build_is_refused_in_one_sentence(toy, tmp_path, environment):
    sentence, end = python(FOREIGN, foreign(toy, tmp_path), toy, toy, env=environment)
    assert sentence.startswith("toy: Toy was built from other sources (000000000000) than the fmus package")
    assert end == "survived"


ONE_BY_ONE = """
import sys
from fmpy import simulate_fmu
def said(*of):
    print(of[-1].decode().strip().splitlines()[-1])
for fmu in sys.argv[1:]:  # each is unpacked, run and deleted
    try:
        rows = simulate_fmu(fmu, stop_time=2e-3, step_size=1e-3, output_interval=1e-3, logger=said, debug_logging=True)
    except Exception as error:
        print(error)
    else:
        print(len(rows))
import fmus.fmi.slave
assert "resources" in fmus.fmi.slave.__file__
"""


def of_tracks():
    ends = {"kind": "pinned", "first": [0.0, 0.0], "last": [0.9144, 0.0]}
    track = {"links": 8, "closed": False, "wheels": [], "ground": False, "gravity": 9.81, "ends": ends}
    chain = build("TrackFlexible", {"vehicle": TABLE, "track": track, "link_outputs": True})
    drive = build("SprocketDrive", {"vehicle": TABLE, "drive": {"inertia": 1.0, "mount": [0.0, 0.0, 0.0]}})
    return drive, chain


@pytest.mark.long
@pytest.mark.parametrize("others", [lambda: [build_toy(start=0.2)], pytest.param(of_tracks, marks=pytest.mark.long)])
def test_fmus_run_one_after_the_other_where_cotrack_is_not_installed(toy, environment, tmp_path, others):
    """They run in one process, but not one from another build of the package.

    The second runs although modules that it imports were unpacked in the first one's deleted folder.
    """
    alone = {key: value for key, value in environment.items() if key != "PYTHONPATH"}
    fmus = others()
    said = python(ONE_BY_ONE, toy, foreign(fmus[0], tmp_path), *fmus, env=alone, cwd=tmp_path)
    first, refusal, failed, *rest = (line for line in said if "compiles the kernels" not in line)
    assert "was built from other sources (000000000000) than the fmus package" in refusal
    assert [first, failed, *rest] == ["3", "Failed to instantiate model", *["3"] * len(fmus)]
