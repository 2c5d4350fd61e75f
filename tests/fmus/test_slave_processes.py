"""FMUs in processes of their own: failures, ends, other builds, machines without cotrack."""

import re
import subprocess
import sys
import zipfile

import pytest

from fmus.fmi.build import build
from fmus.vehicles.vehicle import read_table, vehicle

TABLE = vehicle(*read_table("m113")).model_dump()


RAISES = """
import sys
from fmpy.fmi2 import FMU2Slave
from orchestrator.cosim.fmu_files import unpack
from pathlib import Path
folder = unpack(Path(sys.argv[1]))
trouble = int(sys.argv[2])
for round in range(3):
    slave = FMU2Slave(guid="", modelIdentifier="Toy", unzipDirectory=str(folder), instanceName="raw")
    slave.instantiate()
    def failing(call, *arguments):
        try:
            call(*arguments)
        except Exception:
            return
        raise SystemExit("did not fail")
    failing(slave.getReal, [99999])
    failing(slave.getReal, [99999])
    slave.setString([trouble], ["explode"])
    slave.setupExperiment()
    slave.enterInitializationMode()
    failing(slave.exitInitializationMode)
    failing(slave.exitInitializationMode)
    slave.setString([trouble], ["raise"])
    slave.exitInitializationMode()
    for i in range(5):
        slave.doStep(i * 1e-3, 1e-3)
    failing(slave.doStep, 5e-3, 1e-3)
    failing(slave.doStep, 5e-3, 1e-3)
    slave.fmi2FreeInstance(slave.component)
print("survived")
"""


def test_process_survives_raises_and_free(toy, xml, environment):
    reference = re.search(r'name="trouble" valueReference="(\d+)"', xml)[1]
    done = subprocess.run(
        [sys.executable, "-X", "faulthandler", "-c", RAISES, toy, reference],
        env=environment,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout.splitlines()[-1:]) == (0, ["survived"]), done.stderr


RUNS = {
    "component": """
import sys
from pathlib import Path
from orchestrator.cosim.component import Component
with Component(Path(sys.argv[1]), "toy") as component:
    component.initialise({})
    component.step(0.0, 1e-3)
""",
    "left open": """
import sys
from pathlib import Path
from orchestrator.cosim.component import Component
component = Component(Path(sys.argv[1]), "toy")
component.initialise({})
""",
    "fmpy alone": """
import sys, fmpy
fmpy.simulate_fmu(sys.argv[1], stop_time=0.003, step_size=1e-3)
""",
}


@pytest.mark.long
def test_processes_in_a_row_end_well(toy, environment):
    scripts = list(RUNS.values())
    codes = [
        subprocess.run([sys.executable, "-c", scripts[i % 3], toy], env=environment, capture_output=True).returncode
        for i in range(9)
    ]
    assert codes == [0] * 9


FOREIGN = """
import sys
from pathlib import Path
from orchestrator.cosim.component import Component
from orchestrator.cosim.graph import ComponentFailed
try:
    Component(Path(sys.argv[1]), "toy")
except ComponentFailed as error:
    print(error)
for path in sys.argv[2:]:
    with Component(Path(path), "toy") as component:  # and the process goes on
        component.initialise({})
        component.step(0.0, 1e-3)
print("survived")
"""


def test_fmu_of_another_build_is_refused_in_one_sentence(toy, tmp_path, environment):
    foreign = tmp_path / "foreign.fmu"
    with zipfile.ZipFile(toy) as source, zipfile.ZipFile(foreign, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            target.writestr(name, b"0" * 64 if name == "resources/build.txt" else content)
    done = subprocess.run(
        [sys.executable, "-c", FOREIGN, foreign, toy, toy], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    sentence, end = done.stdout.splitlines()
    assert sentence.startswith("toy: Toy was built from other sources (000000000000) than the fmus package")
    assert end == "survived"


ELSEWHERE = """
import fmpy, sys
result = fmpy.simulate_fmu(sys.argv[1], stop_time=0.003, step_size=1e-3, output=["x"])
import fmus.fmi.slave, toy.kernels
assert "resources" in fmus.fmi.slave.__file__, fmus.fmi.slave.__file__
hits = toy.kernels.advance.stats.cache_hits
assert sum(hits.values()) == 1, hits
print(result["x"][-1])
"""


def test_fmu_runs_where_cotrack_is_not_installed_and_finds_its_kernels(toy, environment, tmp_path):
    env = {key: value for key, value in environment.items() if key != "PYTHONPATH"}
    subprocess.run([sys.executable, "-c", RUNS["component"], toy], env=environment, check=True)  # compiles
    done = subprocess.run([sys.executable, "-c", ELSEWHERE, toy], env=env, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) < 0.1


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
"""


@pytest.mark.long
def test_fmus_run_one_after_the_other_in_one_process(toy, environment, tmp_path):
    """FMUs run one after the other in one process, but not one from another build of the package.

    The second runs although modules that it imports were unpacked in the first one's deleted folder.
    """
    ends = {"kind": "pinned", "first": [0.0, 0.0], "last": [0.9144, 0.0]}
    track = {"links": 8, "closed": False, "wheels": [], "ground": False, "gravity": 9.81, "ends": ends}
    config = {"vehicle": TABLE, "track": track, "link_outputs": True}
    chain = build("TrackFlexible", config)
    drive = build("SprocketDrive", {"vehicle": TABLE, "drive": {"inertia": 1.0, "mount": [0.0, 0.0, 0.0]}})
    foreign = tmp_path / "foreign.fmu"
    with zipfile.ZipFile(drive) as source, zipfile.ZipFile(foreign, "w") as target:
        for name in source.namelist():
            target.writestr(name, b"0" * 64 if name == "resources/build.txt" else source.read(name))
    env = {key: value for key, value in environment.items() if key != "PYTHONPATH"}
    program = [sys.executable, "-c", ONE_BY_ONE, toy, foreign, drive, chain]
    done = subprocess.run(program, env=env, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    first, said, *rest = (line for line in done.stdout.splitlines() if "compiles the kernels" not in line)
    assert said.startswith("this FMU was built from other sources (000000000000) than the fmus package")
    assert [first, *rest] == ["3", "Failed to instantiate model", "3", "3"], done.stderr
