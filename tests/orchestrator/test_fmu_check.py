"""Checks of FMUs: a clean FMU of FMI 2.0 or 3.0 passes all, each planted fault is found by its check."""

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
from fmus.native import machine_code
from fmus.native.pack import build_native
from orchestrator.execution.simulate import simulate
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.fmu_check import runner
from orchestrator.fmu_check.instance import Instance, Subject, Verdict
from orchestrator.fmu_check.runner import CHECKS, in_child, judged, verdicts
from orchestrator.log.reader import Log
from orchestrator.scene.products import scene_products
from orchestrator.scene.scene import any_from_table, load

HERE = Path(__file__).parent / "checked"
XMLS = {fmi: (HERE / f"oscillator{'3' * (fmi == 3)}.xml").read_text(encoding="utf-8") for fmi in (2, 3)}
XML = XMLS[2]
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
OF_FMI_3 = {
    "EARLY": ("repeatability", "fmi3DoStep returns early, which is not allowed"),
    "EVENT": ("repeatability", "fmi3DoStep asks for event mode, which is not used"),
    "FEW_FUNCTIONS": ("description", "undefined symbol: fmi3"),
}
WORDS = {
    "fmi2Instantiate": "fmi3InstantiateCoSimulation", "fmi2": "fmi3", "another guid": "another instantiation token",
    "in x, v": "in motion[1], motion[2]", "x, v differ": "motion[1], motion[2] differ",
    "v depends": "motion[2] depends", "x = nan, v = nan": "motion[1] = nan, motion[2] = nan",
}  # fmt: skip
# version, text of modelDescription.xml, another one, the check that finds it, and words of the finding
CHANGED = [
    *((fmi, 'causality="input"', 'causality="input" colour="red"', "description", "attribute 'colour' is not allowed")
      for fmi in (2, 3)),
    (2, 'modelIdentifier="oscillator"', 'modelIdentifier="other"', "description", "has no binary for linux64"),
    (3, 'modelIdentifier="oscillator"', 'modelIdentifier="other"', "description", "has no binary for x86_64-linux"),
    *((fmi, 'unit="N" start', 'unit="kN" start', "units", "unit 'kN' is not defined") for fmi in (2, 3)),
    (2, '<BaseUnit kg="1" m="1" s="-2"/>', "", "units", "unit 'N' has no base units: connections cannot be checked"),
    (2, " unit=", " quantity=", "units", "none of 6 Reals has a unit: connections cannot be checked"),
    (2, '<Unknown index="3" dependencies=""/>', "", "dependencies", "ModelStructure/Outputs lacks v"),
    (3, '<Output valueReference="1" dependencies=""/>', "", "dependencies", "ModelStructure/Outputs lacks motion"),
    (3, '<Dimension start="2"/>', "", "states", "fmi3GetFloat64 has the status fmi3Error"),
]  # fmt: skip
UNAPPLICABLE = [
    ('canGetAndSetFMUstate="true"', "", "states", "canGetAndSetFMUstate is not declared"),
    ('modelIdentifier="oscillator"', 'modelIdentifier="other"', "memory", "has no binary for"),
    ('causality="input"', 'causality="parameter"', "units", "bad modelDescription.xml"),
]
TERMINALS = """<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals><Terminal name="mass" matchingRule="plug">
<TerminalMemberVariable variableName="{}" memberName="force" variableKind="signal"/></Terminal></Terminals>
</fmiTerminalsAndIcons>"""
DECLARED = re.compile(r"^FMI3_Export fmi3\w+TYPE\s+(fmi3\w+);", re.MULTILINE)


def worded(fmi, words):
    """A finding in the names of a version."""
    for old, new in WORDS.items() if fmi == 3 else ():
        words = words.replace(old, new)
    return words


def packed(fmu, fmi, library, xml=None, terminal="force"):
    platform = fmpy.platform if fmi == 2 else fmpy.platform_tuple
    with zipfile.ZipFile(fmu, "w") as archive:
        archive.writestr("modelDescription.xml", xml or XMLS[fmi])
        archive.write(library, f"binaries/{platform}/oscillator{fmpy.sharedLibraryExtension}")
        if fmi == 3:
            archive.writestr("terminalsAndIcons/terminalsAndIcons.xml", TERMINALS.format(terminal))
    return fmu


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """Return a function that gives the library of the oscillator with a planted fault, "" for none."""
    folder = tmp_path_factory.mktemp("oscillator")
    compiler = [shutil.which("cc")] if shutil.which("cc") else machine_code.compiler()
    header = (Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h").read_text(encoding="utf-8")
    refused = (f"__attribute__((weak)) int {name}(void) {{ return 3; }}" for name in DECLARED.findall(header))
    (folder / "refused.c").write_text("\n".join(refused), encoding="utf-8")  # functions that the oscillator lacks

    def compiled(case):
        fmi, fault = case
        flags = ["-std=c11", "-shared", "-fPIC", "-w", *([f"-D{fault}"] if fault else []), f"-I{machine_code.HERE}"]
        more = [folder / "refused.c"] if fmi == 3 and fault != "FEW_FUNCTIONS" else []
        source, file = HERE / f"oscillator{'3' * (fmi == 3)}.c", folder / f"{fmi}{fault}.so"
        subprocess.run([*map(str, [*compiler, *flags, "-o", file, source, *more, "-lm"])], check=True)
        return file

    own = {2: ("SMALL_INPUT", "ONCE", "SLOW", *IN_CHILDREN), 3: tuple(OF_FMI_3)}
    cases = [(fmi, fault) for fmi, faults in own.items() for fault in ("", *PLANTED, *faults)]
    with ThreadPoolExecutor(2) as pool:
        files = dict(zip(cases, pool.map(compiled, cases), strict=True))
    return lambda fmi=2, fault="": files[fmi, fault]


@pytest.fixture
def oscillator(library, tmp_path):
    """Return a function that makes the oscillator with a planted fault, another description or another terminal."""
    return lambda fault="", fmi=2, **changes: packed(
        tmp_path / f"{fmi}{fault}{len(changes)}.fmu", fmi, library(fmi, fault), **changes
    )


def described(old, new, fmi=2):
    """The description with another text."""
    assert old in XMLS[fmi]
    return XMLS[fmi].replace(old, new)


@pytest.mark.parametrize(("fmi", "name"), [(fmi, name) for fmi in (2, 3) for name in CHECKS])
def test_nothing_is_wrong_with_a_clean_fmu(oscillator, fmi, name):
    file = oscillator(fmi=fmi)
    verdict = in_child(name, file, None, 60.0) if name == "memory" else judged(name, Subject(file))
    assert (verdict.result, verdict.faults) == ("ok", ()), verdict


@pytest.mark.parametrize("fmi", [2, 3])
def test_steps_of_the_clean_fmu_are_exact(oscillator, fmi):
    """One step of 0.3 s ends where thirty of 0.01 s do: the FMU is an example, so it has to be right."""
    subject, ends = Subject(oscillator(fmi=fmi)), []
    assert (subject.step, subject.start, subject.amplitude) == (H, 0.0, 1e-3)
    for count in (1, 30):
        with Instance(subject) as instance:
            instance.initialise()
            for k in range(count):
                instance.must(instance.slave.step, k * 0.3 / count, 0.3 / count, False)
            ends.append(instance.outputs())
    assert ends[0] == pytest.approx(ends[1], rel=1e-12)
    assert ends[0][0] < 0.0 > ends[0][1]
    assert Subject(oscillator("SMALL_INPUT")).amplitude == 1e-6


@pytest.mark.parametrize(
    ("fmi", "fault"), [*((fmi, fault) for fmi in (2, 3) for fault in PLANTED), *((3, fault) for fault in OF_FMI_3)]
)
def test_a_planted_fault_is_found_by_its_check(oscillator, fmi, fault):
    name, words = {**PLANTED, **OF_FMI_3}[fault]
    verdict = judged(name, Subject(oscillator(fault, fmi)))
    assert verdict.result == "wrong"
    assert any(worded(fmi, words) in sentence for sentence in verdict.faults), verdict


@pytest.mark.parametrize(("fmi", "old", "new", "name", "words"), CHANGED)
def test_a_fault_of_the_description_is_found(oscillator, fmi, old, new, name, words):
    verdict = judged(name, Subject(oscillator(fmi=fmi, xml=described(old, new, fmi))))
    assert any(words in sentence for sentence in verdict.faults), verdict


@pytest.mark.parametrize(("old", "new", "name", "words"), UNAPPLICABLE)
def test_a_check_that_the_fmu_does_not_allow_is_not_applicable(oscillator, old, new, name, words):
    verdict = judged(name, Subject(oscillator(xml=described(old, new))))
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


ONCE = "<CoSimulation", '<CoSimulation canBeInstantiatedOnlyOncePerProcess="true"'


@pytest.mark.parametrize("name", [name for name in CHECKS if name != "memory"])
def test_an_fmu_that_can_be_instantiated_once_is_checked(oscillator, name):
    """It refuses a second instance in a process; it is reset instead."""
    verdict = in_child(name, oscillator("ONCE", xml=described(*ONCE)), None, 60.0)
    assert (verdict.result, verdict.faults) == ("ok", ())
    if name in ("states", "repeatability", "odd steps", "non-finite inputs"):  # a fault without the declaration
        assert in_child(name, oscillator("ONCE"), None, 60.0).result == "wrong"


@pytest.mark.parametrize("fault", [name for name in PLANTED if name not in ("SHARED", "RESET_KEEPS_SPEED")])
def test_a_planted_fault_is_found_in_an_fmu_that_can_be_instantiated_once(oscillator, fault):
    name, words = PLANTED[fault]
    verdict = judged(name, Subject(oscillator(fault, xml=described(*ONCE))))
    assert any(words in sentence for sentence in verdict.faults), verdict


def test_a_check_without_time_enough_is_not_finished(oscillator, cotrack, monkeypatch):
    """Instances that take 20 ms are no fault, though 250 do not fit into the limit."""
    subject = Subject(oscillator("ANY_STEP"))
    assert judged("odd steps", subject).result == "wrong"
    subject.deadline = 0.0
    for name, count in (("odd steps", 7), ("dependencies", 1)):
        assert judged(name, subject) == (f"not finished: 0 of {count}", (), "not finished")
    of_many = Verdict("not finished: 1 of 7", (*"abcd",), "not finished")
    assert of_many.detail == "a; b; c; and 1 more; not finished: 1 of 7"
    monkeypatch.setattr(runner, "CHECKS", dict.fromkeys(("memory",)))
    out = cotrack.done("check", oscillator("SLOW"), "--limit", "4")
    assert re.search(r"^  memory  not finished    not finished: \d+ of 250$", out, re.MULTILINE), out


@pytest.mark.parametrize(("unit", "shown", "factor", "right"), [
    ("N", "kN", 1000.0, 1e-3), ("m", "mm", 0.001, 1e3), ("m", "mm", 1.0, None), ("N/m", "kN", 3.0, None),
])  # fmt: skip
def test_inverse_display_factors_are_told(oscillator, unit, shown, factor, right):
    at = XML.index(f'<Unit name="{unit}">')
    old = XML[at : XML.index("</Unit>", at)]
    for given in (factor, 1.0 / factor):
        new = f'{old}<DisplayUnit name="{shown}" factor="{given!r}"/>'
        verdict = judged("units", Subject(oscillator(xml=described(old, new))))
        said = f"'{unit}' is shown in '{shown}' by {given:g}, the inverse of {1.0 / given:g}"
        assert verdict.faults == ((said,) if right and given == factor else ())


SIZE = '<Dimension start="2"/>'


def test_an_alias_is_no_further_output(oscillator):
    subject = Subject(oscillator(fmi=3, xml=described(SIZE, f'{SIZE}<Alias name="place"/>', 3)))
    assert judged("dependencies", subject).faults == judged("repeatability", subject).faults == ()
    assert [variable.name for variable in subject.outputs] == ["motion"]


@pytest.mark.parametrize(("start", "values"), [("1 2 3 4", [1.0, 2.0, 3.0, 4.0]), ("5", [5.0] * 4)])
def test_an_array_starts_with_its_elements_or_one_for_all(oscillator, start, values):
    array = f'start="{start}">{SIZE}{SIZE}</Float64>'
    subject = Subject(oscillator(fmi=3, xml=described('unit="N" start="0"/>', f'unit="N" {array}', 3)))
    assert subject.input_values(0, 0.0).tolist() == values
    assert [*subject.owner][:4] == ["force[1,1]", "force[1,2]", "force[2,1]", "force[2,2]"]


@pytest.mark.parametrize(("terminal", "words"), [
    ("none", "terminalsAndIcons.xml: there is no variable 'none'"),
    ('force" colour="red', "The attribute 'colour' is not allowed"),
])  # fmt: skip
def test_faults_of_terminals_are_found(oscillator, terminal, words):
    (fault,) = judged("description", Subject(oscillator(fmi=3, terminal=terminal))).faults
    assert words in fault


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


@pytest.mark.long
def test_the_command_prints_a_table_and_an_object(oscillator, cotrack, monkeypatch):
    monkeypatch.setattr(runner, "CHECKS", dict.fromkeys(("units", "states")))
    clean, wrong = oscillator(), oscillator("STATE_WITHOUT_SPEED")
    assert cotrack.done("check", clean).splitlines() == [
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
    ("fmi", "part", "kind"),
    [(2, "ModelExchange", "model exchange"), (3, "ModelExchange", "model exchange"), (3, "ScheduledExecution", "sch")],
)  # fmt: skip
def test_other_interfaces_are_not_checked(oscillator, cotrack, fmi, part, kind):
    other = oscillator(fmi=fmi, xml=described("<CoSimulation", f"<{part}", fmi))
    assert f"is an FMU for {kind}" in cotrack.refused("check", oscillator(), other)


@pytest.mark.study
@pytest.mark.parametrize("fmi", [2, 3])
def test_native_fmus_of_ours_have_no_fault_and_python_ones_the_known_ones(fmi):
    """pythonfmu makes fmi2Fatal of every exception, and takes any guid."""
    kind, config, _ = next(each for each in scene_products([load("rig", "rigid")]) if each[0] == "SprocketDrive")
    native = verdicts(build_native(kind, config, fmi=fmi), None, 300.0, print)
    assert {name: verdict.faults for name, verdict in native.items() if verdict.faults} == {}
    if fmi == 3:
        assert {verdict.result for verdict in native.values()} == {"ok"}
        return
    python = build(kind, config)
    assert in_child("description", python, None, 300.0).result == in_child("states", python, None, 300.0).result == "ok"
    accepted, fatal = in_child("phases", python, None, 300.0).faults
    assert fatal.startswith("fmi2Fatal, after which no instance may be used: fmi2ExitInitializationMode without entry")
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


@pytest.mark.parametrize(("manner", "faults", "note"), [
    (0, (), "prints nothing"),
    (PRINTS, (), "prints"),
    (MOVES, ("fmi2DoStep leaves another working folder (/)",), ""),
    (ROUNDS, ("fmi2DoStep leaves another rounding mode (0x0, then 0x800)",), ""),
])  # fmt: skip
def test_an_fmu_that_changes_its_process_is_found_and_prints_are_told(guest, manner, faults, note):
    verdict = in_child("surroundings", guest(manner), 1e-3, 30.0)
    assert (verdict.result, verdict.faults) == ("wrong" if faults else "ok", faults)
    assert (note in verdict.note, "nothing" in verdict.note) == (True, "nothing" in note or bool(faults))


@pytest.mark.parametrize("name", ["dependencies", "odd steps", "repeatability", "memory", "surroundings"])
def test_no_verdict_is_a_fault(guest, name):
    """The FMU ends the process with status 0."""
    (fault,) = in_child(name, guest(ENDS), 1e-3, 30.0).faults
    assert fault.startswith("the process ended with exit status 0 ")


@pytest.mark.long
def test_an_fmu_that_hangs_takes_little_more_than_one_limit(guest):
    began = time.monotonic()
    found = verdicts(guest(HANGS), 1e-3, 5.0, lambda name: None)
    assert time.monotonic() - began < 30.0
    assert "the process was stopped after 5 s" in found["dependencies"].faults[0]
    assert (found["memory"].result, found["memory"].faults) == ("not finished", ())
    assert found["memory"].note == "not made, because other checks did not come to an end"


# --- runs ---------------------------------------------------------------------------------------------


def run_of(path, fmus, **more):
    run = {"step": 0.01, "stop": 0.5, **more}
    return simulate(
        any_from_table({"name": "o", "title": "o", "assembly": "fmus", "run": run, "fmu": fmus}, "o.toml"), path
    )


@pytest.mark.parametrize("coupling", ["jacobi", "iterative"])  # an iterative one saves and restores states
def test_a_run_has_the_bits_of_the_one_of_the_other_version(oscillator, tmp_path, coupling):
    """Elements of an array are variables; parameters, start values of inputs and times pass too."""
    given = {"start.x": 0.2, "stiffness": 55.0, "force": 3.0}
    found = {}
    for fmi in (2, 3):
        fmus = {each: {"file": str(oscillator(fmi=fmi)), "parameters": given} for each in "ab"}
        summary = run_of(tmp_path / f"{fmi}.mcap", fmus, start=2.0, coupling=coupling)
        assert (summary["status"], summary["warnings"]) == ("ok", [])
        with Log(tmp_path / f"{fmi}.mcap") as log:
            series = log.read("/a/out")
            found[fmi] = series.names, series.values
            assert log.unit(f"a.{series.names[0]}") == "m"
    assert [names for names, _ in found.values()] == [("x", "v"), ("motion[1]", "motion[2]")]
    assert found[3][1].tobytes() == found[2][1].tobytes()
    assert abs(found[2][1][:, 0]).max() > 0.1


def test_an_early_return_ends_a_run_with_a_sentence(oscillator, tmp_path):
    summary = run_of(tmp_path / "o.mcap", {"a": {"file": str(oscillator("EARLY", 3))}})
    assert summary["status"] == "failed"
    assert summary["message"].startswith("a: fmi3DoStep failed with FMI status 2; the step from t = 0 s ended at")


def test_an_fmu_of_fmi_3_has_a_process_of_its_own_and_its_place_where_it_fits(oscillator, cotrack, tmp_path):
    with pytest.raises(ComponentFailed, match=r"only a process of its own runs it .* build them of FMI 2\.0"):
        run_of(tmp_path / "o.mcap", {"a": {"file": str(oscillator(fmi=3)), "in_process": True}})
    for argument in ("--replace=drive={}", "--set=fmu.drive.file={}"):
        err = cotrack.refused("run", "rig", "--track", "rigid", argument.format(oscillator(fmi=3)))
        assert "it has no output 'sprocket.position.x', which goes to track" in err
