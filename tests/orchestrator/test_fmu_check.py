"""Checks of FMUs: a clean FMU passes all, each planted fault is found by its check."""

import json
import re
import shutil
import subprocess
import sys
import time
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import fmpy
import foreign_fmus
import pytest
from foreign_fmus import Variable

from fmus.fmi.build import build
from fmus.native import link
from fmus.native.pack import build_native
from orchestrator.fmu_check import runner
from orchestrator.fmu_check.instance import Instance, Subject, Verdict
from orchestrator.fmu_check.runner import CHECKS, in_child, judged, verdicts
from orchestrator.scene.products import scene_products
from orchestrator.scene.scene import load

HERE = Path(__file__).parent / "checked"
XML = (HERE / "oscillator.xml").read_text(encoding="utf-8")
H = 0.01

# macro of oscillator.c, the check that finds its fault, and words of the finding
PLANTED = {
    "FEEDTHROUGH": ("dependencies", "after a step v depends on force, which its dependencies do not declare"),
    "STATE_WITHOUT_SPEED": ("states", "steps after restoring a state the first time differ in x, v"),
    "BYTES_WITHOUT_SPEED": ("states", "steps of a second instance with the state's bytes differ in x, v"),
    "RANDOM": ("repeatability", "in a second run x, v differ"),
    "SHARED": ("repeatability", "of two instances that step in turn x, v differ"),
    "OF_THREAD": ("repeatability", "in another thread than that of the instantiation x, v differ"),
    "ANY_STEP": ("odd steps", "step of length 0: x = nan, v = nan"),
    "ANY_INPUT": ("non-finite inputs", "force = nan: x = nan, v = nan"),
    "ANY_PHASE": ("phases", "accepted: fmi2DoStep before initialisation, "),
    "ANY_GUID": ("phases", "accepted: fmi2Instantiate with another guid"),
    "RESET_KEEPS_SPEED": ("phases", "after fmi2Reset a run differs from that of a new instance in x, v"),
}
IN_CHILDREN = {  # these faults may end or fill the process of the tests
    "REFUSALS_ARE_FATAL": ("phases", "fmi2Fatal, after which no instance may be used: fmi2Terminate before"),
    "TERMINATE_ABORTS": ("phases", "the process was ended by SIGABRT in fmi2Terminate twice"),
    "HANGS": ("odd steps", "the process was stopped after 10 s in a step of negative length"),
    "TERMINATE_EXITS": ("phases", "the process ended with exit status 7 in fmi2Terminate twice"),
    "TERMINATE_ENDS": ("states", "the process ended with exit status 7 in fmi2Terminate"),
    "EXIT_ABORTS": ("states", "the process was ended by SIGABRT at its exit"),
    "LEAK": ("memory", "resident memory grows by "),
}
# text of modelDescription.xml, another one, the check that finds it, and words of the finding
CHANGED = [
    ('causality="input"', 'causality="input" colour="red"', "description", "The attribute 'colour' is not allowed"),
    ('modelIdentifier="oscillator"', 'modelIdentifier="other"', "description", "has no binary for linux64"),
    ('<Real unit="N" start', '<Real unit="kN" start', "units", "unit 'kN' is not defined"),
    ('<BaseUnit kg="1" m="1" s="-2"/>', "", "units", "unit 'N' has no base units: connections cannot be checked"),
    (" unit=", " quantity=", "units", "none of 6 Reals has a unit: connections cannot be checked"),
    ('<Unknown index="3" dependencies=""/>', "", "dependencies", "ModelStructure/Outputs lacks v"),
]


@pytest.fixture(scope="module")
def oscillator(tmp_path_factory):
    """Return a function that returns the oscillator with a planted fault, "" for none."""
    folder = tmp_path_factory.mktemp("oscillator")
    compiler = [shutil.which("cc")] if shutil.which("cc") else link.compiler()

    def compiled(fault):
        library = folder / f"{fault}.so"
        flags = ["-std=c11", "-shared", "-fPIC", "-w", *([f"-D{fault}"] if fault else [])]
        command = [*compiler, *flags, f"-I{link.HERE}", "-o", library, HERE / "oscillator.c", "-lm"]
        subprocess.run([*map(str, command)], check=True)
        return packed(folder / f"oscillator-{fault or 'clean'}.fmu", library, XML)

    faults = ["", "SMALL_INPUT", "ONCE", "SLOW", *PLANTED, *IN_CHILDREN]
    with ThreadPoolExecutor(2) as pool:
        files = dict(zip(faults, pool.map(compiled, faults), strict=True))
    return lambda fault="": files[fault]


def packed(fmu, library, xml):
    with zipfile.ZipFile(fmu, "w") as archive:
        archive.writestr("modelDescription.xml", xml)
        archive.write(library, f"binaries/{fmpy.platform}/oscillator{fmpy.sharedLibraryExtension}")
    return fmu


@pytest.mark.parametrize("name", CHECKS)
def test_nothing_is_wrong_with_a_clean_fmu(oscillator, name):
    verdict = in_child(name, oscillator(), None, 60.0) if name == "memory" else judged(name, Subject(oscillator()))
    assert (verdict.result, verdict.faults) == ("ok", ()), verdict


def test_steps_of_the_clean_fmu_are_exact(oscillator):
    """One step of 0.3 s ends where thirty of 0.01 s do: the FMU is an example, so it has to be right."""
    subject = Subject(oscillator())
    assert (subject.step, subject.start, subject.amplitude) == (H, 0.0, 1e-3)
    ends = []
    for count in (1, 30):
        with Instance(subject) as instance:
            instance.initialise()
            for k in range(count):
                instance.must("DoStep", k * 0.3 / count, 0.3 / count, 0)
            ends.append(instance.outputs())
    assert ends[0] == pytest.approx(ends[1], rel=1e-12)
    assert ends[0][0] < 0.0 > ends[0][1]
    assert Subject(oscillator("SMALL_INPUT")).amplitude == 1e-6


@pytest.mark.parametrize("fault", PLANTED)
def test_a_planted_fault_is_found_by_its_check(oscillator, fault):
    name, words = PLANTED[fault]
    verdict = judged(name, Subject(oscillator(fault)))
    assert verdict.result == "wrong"
    assert any(words in sentence for sentence in verdict.faults), verdict


def described(fmu, target, old, new):
    """Copy an FMU with another text in its modelDescription.xml."""
    assert old in XML
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(target, "w") as copy:
        for name in source.namelist():
            copy.writestr(name, XML.replace(old, new) if name == "modelDescription.xml" else source.read(name))
    return target


@pytest.mark.parametrize(("old", "new", "name", "words"), CHANGED)
def test_a_fault_of_the_description_is_found(oscillator, tmp_path, old, new, name, words):
    verdict = judged(name, Subject(described(oscillator(), tmp_path / "changed.fmu", old, new)))
    assert any(words in sentence for sentence in verdict.faults), verdict


@pytest.mark.parametrize(
    ("old", "new", "name", "words"),
    [
        ('canGetAndSetFMUstate="true"', "", "states", "canGetAndSetFMUstate is not declared"),
        ('modelIdentifier="oscillator"', 'modelIdentifier="other"', "memory", "has no binary for"),
        ('causality="input"', 'causality="parameter"', "units", "bad modelDescription.xml"),
    ],
)
def test_a_check_that_the_fmu_does_not_allow_is_not_applicable(oscillator, tmp_path, old, new, name, words):
    verdict = judged(name, Subject(described(oscillator(), tmp_path / "changed.fmu", old, new)))
    assert (verdict.result, verdict.faults) == ("not applicable", ())
    assert words in verdict.detail


@pytest.mark.parametrize(
    "fault", [pytest.param(name, marks=[pytest.mark.long] if name == "HANGS" else []) for name in IN_CHILDREN]
)
def test_a_crash_a_hang_and_a_leak_are_faults(oscillator, fault):
    name, words = IN_CHILDREN[fault]
    verdict = in_child(name, oscillator(fault), None, 10.0 if fault == "HANGS" else 60.0)
    assert verdict.result == "wrong"
    assert verdict.faults[-1].startswith(words), verdict


ONE = "<CoSimulation", '<CoSimulation canBeInstantiatedOnlyOncePerProcess="true"'


@pytest.mark.parametrize("name", [name for name in CHECKS if name != "memory"])
def test_an_fmu_that_can_be_instantiated_once_is_checked(oscillator, tmp_path, name):
    """It refuses a second instance in a process; it is reset instead."""
    fmu = described(oscillator("ONCE"), tmp_path / "once.fmu", *ONE)
    verdict = in_child(name, fmu, None, 60.0)
    assert (verdict.result, verdict.faults) == ("ok", ())
    if name in ("states", "repeatability", "odd steps", "non-finite inputs"):  # a fault without the declaration
        assert in_child(name, oscillator("ONCE"), None, 60.0).result == "wrong"


@pytest.mark.parametrize("fault", [name for name in PLANTED if name not in ("SHARED", "RESET_KEEPS_SPEED")])
def test_a_planted_fault_is_found_in_an_fmu_that_can_be_instantiated_once(oscillator, tmp_path, fault):
    name, words = PLANTED[fault]
    verdict = judged(name, Subject(described(oscillator(fault), tmp_path / "once.fmu", *ONE)))
    assert any(words in sentence for sentence in verdict.faults), verdict


def test_a_check_without_time_enough_is_not_finished(oscillator, cotrack, monkeypatch):
    """Instances that take 20 ms are no fault, though 250 do not fit into the limit."""
    subject = Subject(oscillator("ANY_STEP"))
    assert judged("odd steps", subject).result == "wrong"
    subject.deadline = 0.0
    assert judged("odd steps", subject) == ("not finished: 0 of 7", (), "not finished")
    assert judged("dependencies", subject) == ("not finished: 0 of 1", (), "not finished")
    assert (
        Verdict("not finished: 1 of 7", (*"abcd",), "not finished").detail
        == "a; b; c; and 1 more; not finished: 1 of 7"
    )
    monkeypatch.setattr(runner, "CHECKS", dict.fromkeys(("memory",)))
    status, out, _ = cotrack("check", oscillator("SLOW"), "--limit", "2")
    assert status == 0, out
    assert re.search(r"^  memory  not finished    not finished: \d+ of 250$", out, re.MULTILINE), out


@pytest.mark.parametrize(("unit", "shown", "factor", "right"), [
    ("N", "kN", 1000.0, 1e-3), ("m", "mm", 0.001, 1e3), ("m", "mm", 1.0, None), ("N/m", "kN", 3.0, None),
])  # fmt: skip
def test_inverse_display_factors_are_told(oscillator, tmp_path, unit, shown, factor, right):
    at = XML.index(f'<Unit name="{unit}">')
    old = XML[at : XML.index("</Unit>", at)]
    for given in (factor, 1.0 / factor):
        new = f'{old}<DisplayUnit name="{shown}" factor="{given!r}"/>'
        verdict = judged("units", Subject(described(oscillator(), tmp_path / "changed.fmu", old, new)))
        said = f"'{unit}' is shown in '{shown}' by {given:g}, the inverse of {1.0 / given:g}"
        assert verdict.faults == ((said,) if right and given == factor else ())


SLAVE = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class {name}(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.force, self.x, self.speed = 0.0, 0.1, 0.0
        self.register_variable(Real("force", causality=Fmi2Causality.input))
        self.register_variable(Real("x", causality=Fmi2Causality.output))

    def do_step(self, t, h):
        {first}
        self.speed += h * (self.force - 40.0 * self.x)
        self.x += h * self.speed
        return True
"""
BUILD = """
import sys
from pythonfmu.builder import FmuBuilder
for script in sys.argv[1:]:
    FmuBuilder.build_FMU(script, canGetAndSetFMUstate=True, canSerializeFMUstate=True)
"""
SLAVES = {"Forgetful": "pass", "Raising": 'raise ValueError("the spring broke")'}
# of plain pythonfmu FMUs: slave, check, words of a finding
PLAIN = [
    ("Forgetful", "units", "none of 2 Reals has a unit"),
    ("Forgetful", "dependencies", "ModelStructure/InitialUnknowns lacks x"),
    ("Forgetful", "states", "steps after restoring a state the first time differ in x"),
    ("Forgetful", "phases", "fmi2Instantiate with another guid"),
    ("Raising", "repeatability", "fmi2DoStep has the status"),
]


@pytest.fixture(scope="module")
def slaves(tmp_path_factory):
    folder = tmp_path_factory.mktemp("slaves")
    for name, first in SLAVES.items():
        (folder / f"{name}.py").write_text(SLAVE.format(name=name, first=first), encoding="utf-8")
    build = [sys.executable, "-c", BUILD, *(f"{name}.py" for name in SLAVES)]
    subprocess.run(build, cwd=folder, check=True, capture_output=True)
    return folder


@pytest.mark.parametrize(("slave", "name", "words"), PLAIN)
def test_faults_of_a_plain_pythonfmu_fmu_are_found(slaves, slave, name, words):
    verdict = in_child(name, slaves / f"{slave}.fmu", None, 60.0)
    assert any(words in sentence for sentence in verdict.faults), verdict


def test_the_command_prints_a_table_and_an_object(oscillator, cotrack, monkeypatch):
    monkeypatch.setattr(runner, "CHECKS", dict.fromkeys(("units", "states")))
    clean, wrong = oscillator(), oscillator("STATE_WITHOUT_SPEED")
    out = cotrack.done("check", clean)
    assert out.splitlines() == [
        f"{clean}: nothing is wrong",
        "  units   ok              6 Reals in 5 units with base units",
        "  states  ok              restored twice, the same bits; as 64 bytes into a second instance too",
    ]
    status, out, _ = cotrack("check", clean, wrong, "--json")
    one, other = json.loads(out.splitlines()[-1])["fmus"]
    assert (status, one["ok"], other["ok"], other["file"]) == (1, True, False, str(wrong))
    assert {name: check["result"] for name, check in other["checks"].items()} == {"units": "ok", "states": "wrong"}
    assert len(other["checks"]["states"]["faults"]) == 3


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["no.fmu"], "there is no FMU 'no.fmu'"),
        (["text.fmu"], "'text.fmu' is not an FMU"),
        (["exchange.fmu"], "'exchange.fmu' is an FMU for model exchange"),
        (["exchange.fmu", "--step", "0"], "--step 0: must be a finite number greater than 0"),
    ],
)
def test_bad_input_has_status_2(oscillator, cotrack, arguments, sentence):
    Path("text.fmu").write_text("no archive", encoding="utf-8")
    with zipfile.ZipFile("exchange.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", XML.replace("<CoSimulation", "<ModelExchange"))
    status, out, err = cotrack("check", oscillator(), *arguments)
    assert (status, out) == (2, "")
    assert sentence in err


@pytest.mark.study
def test_native_fmus_of_ours_have_no_fault_and_python_ones_the_known_ones():
    """pythonfmu makes fmi2Fatal of every exception, and takes any guid."""
    kind, config, _ = next(each for each in scene_products([load("rig", "rigid")]) if each[0] == "SprocketDrive")
    native = verdicts(build_native(kind, config), None, 300.0, print)
    assert {name: verdict.faults for name, verdict in native.items() if verdict.faults} == {}
    python = build(kind, config)
    assert in_child("description", python, None, 300.0).result == in_child("states", python, None, 300.0).result == "ok"
    accepted, fatal = in_child("phases", python, None, 300.0).faults
    assert fatal.startswith(
        "fmi2Fatal, after which no instance may be used: fmi2ExitInitializationMode without entry, "
    )
    assert accepted == "accepted: fmi2Instantiate with another guid"


# --- FMUs that change their process, or end or block it ----------------------------------------------

ENDS, DIES, HANGS, _, _, _, MOVES, ROUNDS, PRINTS = range(1, 10)  # of foreign/guest.c


@pytest.fixture(scope="module")
def guest(tmp_path_factory):
    """FMU that behaves in a manner from t = 0 on."""
    folder = tmp_path_factory.mktemp("guest")
    reals = [Variable("u", "input"), *(Variable(name, "output") for name in ("y", "together"))]

    def make(manner):
        whole = Variable("manner", "parameter", manner, "Integer"), Variable("steps", "output", 0, "Integer")
        file = folder / f"{manner}.fmu"
        return foreign_fmus.build(file, "guest", [*reals, Variable("when", "parameter", 5e-3), *whole])

    return make


@pytest.mark.parametrize(("manner", "said"), [
    (MOVES, "fmi2DoStep leaves another working folder (/)"),
    (ROUNDS, "fmi2DoStep leaves another rounding mode (0x0, then 0x800)"),
])  # fmt: skip
def test_an_fmu_that_changes_its_process_is_found(guest, manner, said):
    assert in_child("surroundings", guest(manner), 1e-3, 30.0).faults == (said,)
    assert not in_child("surroundings", guest(0), 1e-3, 30.0).faults


def test_what_an_fmu_prints_is_said(guest):
    verdict = in_child("surroundings", guest(PRINTS), 1e-3, 30.0)
    assert (verdict.result, "prints" in verdict.note, "nothing" in verdict.note) == ("ok", True, False)
    assert "prints nothing" in in_child("surroundings", guest(0), 1e-3, 30.0).note


@pytest.mark.parametrize("name", ["dependencies", "odd steps", "repeatability", "memory", "surroundings"])
def test_no_verdict_is_a_fault(guest, name):
    """The FMU ends the process with status 0."""
    (fault,) = in_child(name, guest(ENDS), 1e-3, 30.0).faults
    assert fault.startswith("the process ended with exit status 0 ")


def test_an_fmu_that_hangs_takes_little_more_than_one_limit(guest):
    began = time.monotonic()
    found = verdicts(guest(HANGS), 1e-3, 5.0, lambda name: None)
    assert time.monotonic() - began < 30.0
    assert "the process was stopped after 5 s" in found["dependencies"].faults[0]
    assert (found["memory"].result, found["memory"].faults) == ("not finished", ())
    assert found["memory"].note == "not made, because other checks did not come to an end"
