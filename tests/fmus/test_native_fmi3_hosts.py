"""FMUs of FMI 3.0 in other hosts than FMPy.

`fmi3_host.c` is one of ours, which Wine runs too. FMUContainer of the FMU Manipulation Toolbox is a host in C (extra
`hosts`); Ecos reads FMI 3.0 with fmi4c (`ecospy`).
"""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fmi3_instance import Three, native3
from native_cases import CHAIN, CHASSIS, DRIVE, ran
from plugged import PROFILE, pairs_of_terminals, parts_of_a_vehicle, plugged_vehicle

from fmus.native.link import LINUX, WINDOWS, compiler
from fmus.native.pack import build_native, targets_windows, with_constants
from orchestrator.cosim.fmu_files import unpack
from orchestrator.scene.assembly import build_native_all
from orchestrator.scene.products import scene_products
from orchestrator.scene.scene import load

pytestmark = pytest.mark.study
H, STEPS = 1e-3, 300
HOST = Path(__file__).parents[1] / "host" / "fmi3_host.c"
TOOLBOX = "fmu_manipulation_toolbox"
SHOWN = {"chassis": ("chassis.position", "speed", "energy.kinetic"), "left_track": ("tension.mean", "sprocket.force")}
ECOS = """
import json, sys
from ecospy import EcosSimulation, EcosSimulationStructure

file, h, steps, parameters, names = json.loads(sys.argv[1])
structure = EcosSimulationStructure()
structure.add_model("drive", file)
structure.add_parameter_set("chosen", {f"drive::{name}": value for name, value in parameters.items()})
simulation = EcosSimulation(step_size=h, structure=structure)
simulation.init(parameter_set="chosen")
rows = []
for _ in range(steps):
    simulation.step(1)
    rows.append([simulation.get_real(f"drive::{name}").hex() for name in names])
print(json.dumps(rows))
"""


def tool(name, *arguments, **options):
    command = [sys.executable, "-m", f"{TOOLBOX}.cli.{name}", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, **options)
    said = done.stdout + done.stderr
    assert done.returncode == 0, said
    return said


@pytest.mark.parametrize("case", [DRIVE, CHAIN, CHASSIS], ids=lambda case: case.part)
def test_the_checker_of_the_toolbox_finds_nothing(case):
    pytest.importorskip(TOOLBOX)
    said = tool("fmutool", "-input", native3(case), "-check")
    assert "This FMU seems to be compliant with FMI-3.0." in said
    assert "No semantic error against the FMI-3 standard." in said
    assert "ERROR" not in said


def test_fmu_container_drives_a_vehicle_by_16_pairs_of_terminals(tmp_path):
    """It steps all FMUs over the same interval, with the values of its beginning: the same bits as in FMPy."""
    pytest.importorskip(TOOLBOX)
    build_native_all(scene_products([load("straight", "rigid")]), tmp_path, fmi=3)
    parts = parts_of_a_vehicle()
    for part, (kind, _) in parts.items():
        shutil.copy(tmp_path / f"{'TrackRigid' if kind == 'Track' else kind}.fmu", tmp_path / f"{part}.fmu")
    system = {
        "name": "vehicle.fmu",
        "fmu": [f"{part}.fmu" for part in parts],
        "link": [[f"{one}.fmu", terminal, f"{other}.fmu", others] for one, terminal, other, others in
                 pairs_of_terminals()],
        "start": [[f"{part}.fmu", name, repr(value)] for part, (_, values) in parts.items() for name, value in
                  values.items()],
        "output": [[f"{part}.fmu", name, f"{part}.{name}"] for part, names in SHOWN.items() for name in names],
        "step_size": H,
        **dict.fromkeys(("auto_link", "auto_input", "auto_output", "auto_parameter"), False),
    }  # fmt: skip
    (tmp_path / "vehicle.json").write_text(json.dumps(system), encoding="utf-8")
    options = ("-container", "vehicle.json", "-fmi", "3", "-fmu-directory", tmp_path)
    assert "ERROR" not in tool("fmucontainer", *options, cwd=tmp_path)
    fmus = plugged_vehicle(tmp_path, "TrackRigid")
    whole = Three(tmp_path / "vehicle.fmu", validate=False).start({})  # its Start of an array is not FMI 3.0
    references = {variable.name: variable.valueReference for variable in whole.description.modelVariables}
    shown, expected = [], []
    for k in range(STEPS):
        values = {part: fmu.read() for part, fmu in fmus.items()}
        for part, fmu in fmus.items():
            fmu.step(k * H, H, values[part])
        whole.slave.doStep(k * H, H)
        row = [value for part, names in SHOWN.items() for value in fmus[part].show(names)]
        names = [f"{part}.{name}" for part, each in SHOWN.items() for name in each]
        expected.append(row)
        shown.append(whole.slave.getFloat64([references[name] for name in names], len(row)))
    np.testing.assert_array_equal(shown, expected)
    assert expected[-1][3] > 0.3  # m/s


def test_ecos_reads_the_scalars_of_a_drive():
    """Arrays it does not read: it asks for one value of each, and takes no notice of the refusal."""
    pytest.importorskip("ecospy")
    names = ["speed", "angle", "energy.kinetic", "energy.work"]
    arguments = json.dumps([str(native3(DRIVE)), H, STEPS, PROFILE, names])
    done = subprocess.run([sys.executable, "-c", ECOS, arguments], capture_output=True, text=True, check=True)
    rows = [[float.fromhex(value) for value in row] for row in json.loads(done.stdout.splitlines()[-1])]
    drive, t = Three(native3(DRIVE)), 0.0
    references = {variable.name: variable.valueReference for variable in drive.description.modelVariables}
    drive.slave.setFloat64([references[name] for name in PROFILE], [*PROFILE.values()])
    drive.start({})
    for row in rows:
        drive.slave.doStep(t, H)
        t += H
        assert row == drive.slave.getFloat64([references[name] for name in names])
    assert rows[-1][0] == PROFILE["speed.end"]


@pytest.mark.parametrize("platform", [LINUX, WINDOWS], ids=["linux", "windows"])
def test_a_host_in_c_gives_the_bits_of_fmpy(platform, tmp_path):
    """A chassis without tracks falls; the library for Windows runs in Wine."""
    wine = shutil.which("wine")
    if platform == WINDOWS and not (wine and targets_windows()):
        pytest.skip("needs ziglang and Debian's wine")
    part = ran(CHASSIS).part
    config = with_constants(part.kind, part.config, part.parameters)
    fmu = build_native(part.kind, config, windows=platform == WINDOWS, fmi=3)
    library = unpack(fmu) / "binaries" / platform.fmi3_folder / f"{part.kind}{platform.suffix}"
    program, file = tmp_path / f"host{'.exe' if platform == WINDOWS else ''}", tmp_path / "outputs"
    linked = ["-ldl"] if platform == LINUX else []
    subprocess.run([*compiler(platform), "-std=gnu11", "-O2", "-o", program, HOST, *linked], check=True)
    chassis = Three(fmu).start({})
    outputs = [variable.valueReference for variable in chassis.of("output")]
    expected = []
    for k in range(STEPS):
        chassis.slave.doStep(k * H, H)
        expected.append(chassis.slave.getFloat64(outputs, len(ran(CHASSIS).member.y)))
    first, count, values = str(outputs[0]), str(len(outputs)), str(len(expected[0]))
    arguments = [library, chassis.description.guid, file, str(STEPS), repr(H), first, count, values]
    subprocess.run([*([wine] if platform == WINDOWS else []), program, *arguments], check=True)
    shown = np.fromfile(file).reshape(STEPS, -1)
    np.testing.assert_array_equal(shown.view(np.int64), np.array(expected).view(np.int64))
    assert np.ptp(shown, axis=0).max() > 1.0
