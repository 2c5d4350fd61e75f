"""Random sequences of FMI calls and altered saved states: both sorts of FMU keep the standard's order."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from fmi3_instance import native3
from native_cases import CHAIN, CHASSIS, DRIVE, FEW, MANY, native, ran

from fmus.fmi.build import build
from fmus.native.pack import with_constants
from tests.fuzz import calls, driven, memory, states

VERSIONS = [*((case, 2) for case in (*FEW, *MANY[1:3])), (CHAIN, 3), (DRIVE, 3)]  # whose kernels are the same
PYTHON = [CHASSIS, *FEW[3:], *MANY[:2]]
ROOT = Path(__file__).parents[2]
SEQUENCES = 10_000  # of each FMU; native ones take 1 to 6 min, those of Python 15 to 40 min


def python_fmu(case):
    part = ran(case).part
    return build(part.kind, {**part.config, "parameters": part.parameters})


@pytest.mark.parametrize(
    ("case", "make"),
    [(DRIVE, native), (DRIVE, native3), pytest.param(CHAIN, native, marks=pytest.mark.long)],
    ids=["drive", "drive, FMI 3.0", "chain"],
)
def test_a_native_fmu_answers_as_the_rules_say(case, make):
    done = [call for seed in range(30) for call in calls.sequence(make(case), seed)]
    assert {"enter", "exit", "step", "save", "restore", "terminate", "reset"} <= {call.name for call in done}
    outcomes = states.run(make(case), 0, 30)
    assert min(outcomes["refused"], outcomes["done"]) > 0


@pytest.mark.long
@pytest.mark.parametrize("case", PYTHON[:2], ids=lambda case: case.part)
def test_an_fmu_of_python_answers_as_the_rules_say(case):
    for seed in range(10):
        calls.sequence(python_fmu(case), seed)
    assert states.run(python_fmu(case), 0, 30)["refused"] > 0


@pytest.mark.study
@pytest.mark.parametrize("case", PYTHON, ids=str)
def test_every_fmu_of_python_answers_as_the_rules_say(case):
    for seed in range(SEQUENCES):
        calls.sequence(python_fmu(case), seed)
    states.run(python_fmu(case), 1, 1000)


@pytest.mark.study
@pytest.mark.parametrize("case", PYTHON, ids=str)
def test_altered_states_stay_within_arrays(case, environment):
    """Kernels that check their indices, which are compiled for this test, find none outside."""
    command = [sys.executable, "-m", "tests.fuzz.states", python_fmu(case), "2000"]
    checked = environment | {"NUMBA_BOUNDSCHECK": "1"}
    done = subprocess.run(command, env=checked, cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, done.stdout[:1]) == (0, "{"), done.stderr[-2000:]


@pytest.mark.study
@pytest.mark.parametrize(("case", "fmi"), VERSIONS, ids=str)
def test_every_native_fmu_answers_as_the_rules_say(case, fmi):
    fmu = native3(case) if fmi == 3 else native(case)
    for seed in range(SEQUENCES):
        calls.sequence(fmu, seed)
    states.run(fmu, 1, 3000)


@pytest.mark.parametrize(
    ("make", "call", "status", "said"),
    [
        (native, "terminate", 0, r"has status 0 instead of \(3,\)"),
        (native3, "terminate", 0, r"has status 0 instead of \(3,\)"),
        (native3, "step", 0, r"has status 0 instead of \(\d,\)"),
        (native3, "get too few", 0, r"has status 0 instead of \(3,\)"),
        (native3, "restore", 3, r"has status 3 instead of \(0,\)"),
    ],
)
def test_the_rules_notice_an_fmu_that_breaks_them(monkeypatch, make, call, status, said):
    kind = driven.Driven if make is native else driven.Driven3
    do = kind.do
    lying = lambda self, name, argument: (do(self, name, argument), status)[name == call]  # noqa: E731
    monkeypatch.setattr(kind, "do", lying)
    with pytest.raises(driven.Wrong, match=rf"seed \d+: .*{said}"):
        [calls.sequence(make(DRIVE), seed) for seed in range(20)]


@pytest.mark.study
@pytest.mark.skipif(not shutil.which("valgrind"), reason="valgrind is not installed")
@pytest.mark.parametrize(("case", "fmi"), VERSIONS, ids=str)
def test_no_native_fmu_has_a_memory_error(case, fmi, tmp_path):
    part = ran(case).part
    config = with_constants(part.kind, part.config, part.parameters)
    assert memory.valgrind_errors(part.kind, config, 300, 300, tmp_path, fmi) == []


@pytest.mark.study
@pytest.mark.skipif(not shutil.which("gcc"), reason="gcc is not installed")
@pytest.mark.parametrize(("case", "fmi"), VERSIONS, ids=str)
def test_the_c_sources_pass_the_sanitizers(case, fmi, tmp_path):
    part = ran(case).part
    fmu = memory.sanitised(part.kind, with_constants(part.kind, part.config, part.parameters), tmp_path, fmi)
    memory.run_sanitised(fmu, 100, 300)
