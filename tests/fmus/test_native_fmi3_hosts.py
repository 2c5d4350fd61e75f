"""FMUs of FMI 3.0 in other hosts than FMPy: one of ours in C, `fmi3_host.c`, which Wine runs too.

FMUContainer of the FMU Manipulation Toolbox (extra `hosts`) checks them; it and Ecos run them in `tests/tools`.
"""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fmi3_instance import Three, native3
from native_cases import CHAIN, CHASSIS, DRIVE, H, ran

from fmus.native.machine_code import LINUX, WINDOWS, compiler
from fmus.native.pack import build_native, targets_windows, with_constants
from orchestrator.fmi.fmu_files import unpack

pytestmark = pytest.mark.study
STEPS = 300
HOST = Path(__file__).parents[1] / "host" / "fmi3_host.c"


@pytest.mark.parametrize("case", [DRIVE, CHAIN, CHASSIS], ids=lambda case: case.part)
def test_the_checker_of_the_toolbox_finds_nothing(case):
    pytest.importorskip("fmu_manipulation_toolbox")
    command = [sys.executable, "-m", "fmu_manipulation_toolbox.cli.fmutool", "-input", str(native3(case)), "-check"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    said = done.stdout + done.stderr
    assert "This FMU seems to be compliant with FMI-3.0." in said
    assert "No semantic error against the FMI-3 standard." in said
    assert "ERROR" not in said


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
