"""Checks of FMUs of FMI 3.0: those of FMI 2.0 find the same planted faults, by the names of FMI 3.0."""

import re
import shutil
import subprocess
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import fmpy
import pytest
from test_fmu_check import HERE, PLANTED

from fmus.native import link
from fmus.native.pack import build_native
from orchestrator.cosim.graph import ComponentFailed
from orchestrator.execution.simulate import simulate
from orchestrator.fmu_check.instance import Instance, Subject
from orchestrator.fmu_check.runner import CHECKS, judged, verdicts
from orchestrator.log.reader import Log
from orchestrator.scene.products import scene_products
from orchestrator.scene.scene import any_from_table, load

XML = (HERE / "oscillator3.xml").read_text(encoding="utf-8")
DECLARED = re.compile(r"^FMI3_Export fmi3\w+TYPE\s+(fmi3\w+);", re.MULTILINE)
TERMINALS = """<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals><Terminal name="mass" matchingRule="plug">
<TerminalMemberVariable variableName="{}" memberName="force" variableKind="signal"/></Terminal></Terminals>
</fmiTerminalsAndIcons>"""
WORDS = {
    "fmi2Instantiate": "fmi3InstantiateCoSimulation", "fmi2": "fmi3", "another guid": "another instantiation token",
    "in x, v": "in motion[1], motion[2]", "x, v differ": "motion[1], motion[2] differ",
    "v depends": "motion[2] depends", "x = nan, v = nan": "motion[1] = nan, motion[2] = nan",
}  # fmt: skip
OWN = {
    "EARLY": ("repeatability", "fmi3DoStep returns early, which is not allowed"),
    "EVENT": ("repeatability", "fmi3DoStep asks for event mode, which is not used"),
}


def of_fmi3(words):
    for old, new in WORDS.items():
        words = words.replace(old, new)
    return words


@pytest.fixture(scope="module")
def oscillator(tmp_path_factory):
    """Return a function that returns the oscillator with a planted fault, "" for none."""
    folder = tmp_path_factory.mktemp("oscillator3")
    compiler = [shutil.which("cc")] if shutil.which("cc") else link.compiler()
    header = (Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h").read_text(encoding="utf-8")
    refused = (f"__attribute__((weak)) int {name}(void) {{ return 3; }}" for name in DECLARED.findall(header))
    (folder / "refused.c").write_text("\n".join(refused), encoding="utf-8")  # functions that the oscillator lacks

    def compiled(fault):
        library = folder / f"{fault}.so"
        flags = ["-std=c11", "-shared", "-fPIC", "-w", *([f"-D{fault}"] if fault else []), f"-I{link.HERE}"]
        sources = [HERE / "oscillator3.c", *([folder / "refused.c"] if fault != "FEW_FUNCTIONS" else [])]
        subprocess.run([*map(str, [*compiler, *flags, "-o", library, *sources, "-lm"])], check=True)
        return packed(folder / f"oscillator-{fault or 'clean'}.fmu", library)

    faults = ["", "FEW_FUNCTIONS", *PLANTED, *OWN]
    with ThreadPoolExecutor(2) as pool:
        files = dict(zip(faults, pool.map(compiled, faults), strict=True))
    return lambda fault="": files[fault]


@pytest.fixture
def described(oscillator, tmp_path):
    """Return a function that returns the oscillator with another description or terminal."""
    with zipfile.ZipFile(oscillator()) as source:
        library = source.extract(f"binaries/{fmpy.platform_tuple}/oscillator{fmpy.sharedLibraryExtension}", tmp_path)
    return lambda *changes: packed(tmp_path / "changed.fmu", library, *changes)


def packed(fmu, library, xml=XML, terminal="force"):
    with zipfile.ZipFile(fmu, "w") as archive:
        archive.writestr("modelDescription.xml", xml)
        archive.writestr("terminalsAndIcons/terminalsAndIcons.xml", TERMINALS.format(terminal))
        archive.write(library, f"binaries/{fmpy.platform_tuple}/oscillator{fmpy.sharedLibraryExtension}")
    return fmu


@pytest.mark.parametrize("name", [name for name in CHECKS if name != "memory"])
def test_nothing_is_wrong_with_a_clean_fmu(oscillator, name):
    verdict = judged(name, Subject(oscillator()))
    assert (verdict.result, verdict.faults) == ("ok", ()), verdict


def test_steps_of_the_clean_fmu_are_exact(oscillator):
    """One step of 0.3 s ends where thirty of 0.01 s do: the array is read as it lies."""
    subject, ends = Subject(oscillator()), []
    for count in (1, 30):
        with Instance(subject) as instance:
            instance.initialise()
            for k in range(count):
                instance.must("DoStep", *subject.fmi.step(k * 0.3 / count, 0.3 / count))
            ends.append(instance.outputs())
    assert ends[0] == pytest.approx(ends[1], rel=1e-12)
    assert ends[0][0] < 0.0 > ends[0][1]


@pytest.mark.parametrize("fault", [*PLANTED, *OWN])
def test_a_planted_fault_is_found_by_its_check(oscillator, fault):
    name, words = {**PLANTED, **OWN}[fault]
    verdict = judged(name, Subject(oscillator(fault)))
    assert verdict.result == "wrong"
    assert any(of_fmi3(words) in sentence for sentence in verdict.faults), verdict


@pytest.mark.parametrize(
    ("old", "new", "name", "words"),
    [
        ('causality="input"', 'causality="input" colour="red"', "description", "The attribute 'colour' is not allowed"),
        ('modelIdentifier="oscillator"', 'modelIdentifier="other"', "description", "has no binary for x86_64-linux"),
        ('unit="N" start', 'unit="kN" start', "units", "unit 'kN' is not defined"),
        ('<Output valueReference="1" dependencies=""/>', "", "dependencies", "ModelStructure/Outputs lacks motion"),
        ('<Dimension start="2"/>', "", "states", "fmi3GetFloat64 has the status fmi3Error"),
    ],
)
def test_a_fault_of_the_description_is_found(described, old, new, name, words):
    assert old in XML
    verdict = judged(name, Subject(described(XML.replace(old, new))))
    assert any(words in sentence for sentence in verdict.faults), verdict


def test_an_alias_is_no_further_output(described):
    size = '<Dimension start="2"/>'
    subject = Subject(described(XML.replace(size, f'{size}<Alias name="place"/>')))
    assert judged("dependencies", subject).faults == judged("repeatability", subject).faults == ()
    assert [variable.name for variable in subject.outputs] == ["motion"]


@pytest.mark.parametrize(("start", "values"), [("1 2 3 4", [1.0, 2.0, 3.0, 4.0]), ("5", [5.0] * 4)])
def test_an_array_starts_with_its_elements_or_one_for_all(described, start, values):
    array = f'start="{start}"><Dimension start="2"/><Dimension start="2"/></Float64>'
    subject = Subject(described(XML.replace('unit="N" start="0"/>', f'unit="N" {array}')))
    assert subject.input_values(0, 0.0).tolist() == values
    assert [*subject.owner][:4] == ["force[1,1]", "force[1,2]", "force[2,1]", "force[2,2]"]


def test_faults_of_terminals_are_found(described):
    verdict = judged("description", Subject(described(XML, "none")))
    assert verdict.faults == ("terminalsAndIcons.xml: there is no variable 'none'",)
    verdict = judged("description", Subject(described(XML, 'force" colour="red')))
    assert "The attribute 'colour' is not allowed" in verdict.faults[0]


def test_a_library_without_a_function_of_the_standard_is_found(oscillator):
    assert "undefined symbol: fmi3" in judged("description", Subject(oscillator("FEW_FUNCTIONS"))).faults[0]


@pytest.mark.parametrize("argument", ["--replace=drive=FMU", "--set=fmu.drive.file=FMU"])
def test_a_run_takes_fmus_of_fmi_3_where_they_fit(oscillator, cotrack, argument):
    shutil.copy(oscillator(), "FMU")
    status, out, err = cotrack("run", "rig", "--track", "rigid", argument)
    assert (status, out) == (2, "")
    assert "FMU': it has no output 'sprocket.position.x', which goes to track" in err


@pytest.mark.parametrize(("part", "kind"), [("ModelExchange", "model exchange"), ("ScheduledExecution", "scheduled")])
def test_other_interfaces_are_not_checked(cotrack, part, kind):
    with zipfile.ZipFile("other.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", XML.replace("<CoSimulation", f"<{part}"))
    status, out, err = cotrack("check", "other.fmu")
    assert (status, out) == (2, "")
    assert f"'other.fmu' is an FMU for {kind}" in err
    assert err.endswith(": only FMI 2.0 and 3.0 for co-simulation are supported\n")


@pytest.mark.study
def test_native_fmus_of_ours_have_no_fault():
    kind, config, _ = next(each for each in scene_products([load("rig", "rigid")]) if each[0] == "SprocketDrive")
    native = verdicts(build_native(kind, config, fmi=3), None, 300.0, print)
    assert {name: verdict.faults for name, verdict in native.items() if verdict.faults} == {}
    assert {verdict.result for verdict in native.values()} == {"ok"}


# --- runs ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def oscillator2(oscillator, tmp_path_factory):
    """The same oscillator as an FMU of FMI 2.0."""
    folder = tmp_path_factory.mktemp("oscillator2")
    compiler = [shutil.which("cc")] if shutil.which("cc") else link.compiler()
    library = folder / f"oscillator{fmpy.sharedLibraryExtension}"
    flags = ["-std=c11", "-shared", "-fPIC", "-w", f"-I{link.HERE}"]
    subprocess.run([*map(str, [*compiler, *flags, "-o", library, HERE / "oscillator.c", "-lm"])], check=True)
    with zipfile.ZipFile(folder / "2.fmu", "w") as archive:
        archive.write(HERE / "oscillator.xml", "modelDescription.xml")
        archive.write(library, f"binaries/{fmpy.platform}/{library.name}")
    return folder / "2.fmu"


@pytest.mark.parametrize("coupling", ["jacobi", "iterative"])  # an iterative one saves and restores states
def test_a_run_has_the_bits_of_the_one_of_fmi_2(oscillator, oscillator2, tmp_path, coupling):
    """Elements of an array are variables; parameters, start values of inputs and times pass too."""
    given = {"start.x": 0.2, "stiffness": 55.0, "force": 3.0}
    found = {}
    for name, file in (("2", oscillator2), ("3", oscillator())):
        run = {"step": 0.01, "stop": 0.5, "start": 2.0, "coupling": coupling}
        fmus = {each: {"file": str(file), "parameters": given} for each in "ab"}
        table = {"name": "o", "title": "o", "assembly": "fmus", "run": run, "fmu": fmus}
        summary = simulate(any_from_table(table, "o.toml"), tmp_path / f"{name}.mcap")
        assert (summary["status"], summary["warnings"]) == ("ok", [])
        with Log(tmp_path / f"{name}.mcap") as log:
            series = log.read("/a/out")
            found[name] = dict(zip(series.names, series.values.T.copy(), strict=True))
            assert log.unit(f"a.{series.names[0]}") == "m"
    assert list(found["3"]) == ["motion[1]", "motion[2]"]
    assert found["3"]["motion[1]"].tobytes() == found["2"]["x"].tobytes()
    assert found["3"]["motion[2]"].tobytes() == found["2"]["v"].tobytes()
    assert abs(found["2"]["x"]).max() > 0.1


def test_an_early_return_ends_a_run_with_a_sentence(oscillator, tmp_path):
    fmu = {"a": {"file": str(oscillator("EARLY"))}}
    table = {"name": "o", "title": "o", "assembly": "fmus", "run": {"step": 0.01, "stop": 0.5}, "fmu": fmu}
    summary = simulate(any_from_table(table, "o.toml"), tmp_path / "o.mcap")
    assert summary["status"] == "failed"
    assert summary["message"].startswith("a: fmi3DoStep failed with FMI status 2; the step from t = 0 s ended at")


def test_an_fmu_of_fmi_3_has_a_process_of_its_own(oscillator, tmp_path):
    fmu = {"a": {"file": str(oscillator()), "in_process": True}}
    table = {"name": "o", "title": "o", "assembly": "fmus", "run": {"step": 0.01, "stop": 0.5}, "fmu": fmu}
    with pytest.raises(ComponentFailed, match=r"only a process of its own runs it .* build them of FMI 2\.0"):
        simulate(any_from_table(table, "o.toml"), tmp_path / "o.mcap")
