"""Random sequences of FMI calls and altered saved states: all sorts of FMU keep the standard's order."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import build_toy
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


@pytest.mark.filterwarnings("ignore:overflow encountered in dot")  # of values up to 1e308
@pytest.mark.parametrize(("make", "count"), [(lambda: native(DRIVE), 30), (lambda: native3(DRIVE), 30), (build_toy, 8)])
def test_an_fmu_answers_as_the_rules_say(make, count):
    done = [call for seed in range(count) for call in calls.sequence(make(), seed)]
    assert {"enter", "exit", "step", "save", "restore", "terminate", "reset"} <= {call.name for call in done}
    outcomes = states.run(make(), 0, count)
    assert min(outcomes["refused"], outcomes["done"]) > 0


@pytest.mark.study
@pytest.mark.parametrize(
    ("make", "case"),
    [*((python_fmu, case) for case in PYTHON), *((native3 if fmi == 3 else native, case) for case, fmi in VERSIONS)],
    ids=str,
)
def test_every_fmu_answers_as_the_rules_say(make, case):
    for seed in range(SEQUENCES):
        calls.sequence(make(case), seed)
    states.run(make(case), 1, 1000 if make is python_fmu else 3000)


@pytest.mark.study
@pytest.mark.parametrize("case", PYTHON, ids=str)
def test_altered_states_stay_within_arrays(case, environment):
    """Kernels that check their indices, which are compiled for this test, find none outside."""
    command = [sys.executable, "-m", "tests.fuzz.states", python_fmu(case), "2000"]
    checked = environment | {"NUMBA_BOUNDSCHECK": "1"}
    done = subprocess.run(command, env=checked, cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, done.stdout[:1]) == (0, "{"), done.stderr[-2000:]


@pytest.mark.parametrize(
    ("make", "call", "status"),
    [(native, "terminate", 0), (native3, "terminate", 0), (native3, "step", 0), (native3, "get too few", 0),
     (native3, "restore", 3)],
)  # fmt: skip
def test_the_rules_notice_an_fmu_that_breaks_them(monkeypatch, make, call, status):
    kind = driven.Driven if make is native else driven.Driven3
    do = kind.do
    lying = lambda self, name, argument: (do(self, name, argument), status)[name == call]  # noqa: E731
    monkeypatch.setattr(kind, "do", lying)
    with pytest.raises(driven.Wrong, match=rf"seed \d+: .*has status {status} instead of"):
        [calls.sequence(make(DRIVE), seed) for seed in range(20)]


@pytest.mark.study
@pytest.mark.parametrize("tool", ["valgrind", "gcc"])
@pytest.mark.parametrize(("case", "fmi"), VERSIONS, ids=str)
def test_no_native_fmu_has_a_memory_error(case, fmi, tool, tmp_path):
    """Neither valgrind nor gcc's sanitizers find one."""
    if not shutil.which(tool):
        pytest.skip(f"{tool} is not installed")
    part = ran(case).part
    config = with_constants(part.kind, part.config, part.parameters)
    if tool == "valgrind":
        assert memory.valgrind_errors(part.kind, config, 300, 300, tmp_path, fmi) == []
    else:
        memory.run_sanitised(memory.sanitised(part.kind, config, tmp_path, fmi), 100, 300)
