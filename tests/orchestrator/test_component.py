"""A component is any FMI 2.0 co-simulation FMU: its arrays and its messages."""

import logging
import re
import zipfile
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest
from built_toy import build_toy

from orchestrator.cosim.component import Component
from orchestrator.cosim.program import Program, Stage
from orchestrator.files.messages import RUN
from orchestrator.fmi.fmu_files import unpack
from orchestrator.fmi.model_description import has_start_value
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.kernels.compiled import CAN_STEP

H = 1e-3


def changed(fmu, target, change):
    """Copy an FMU with other contents of its files by name; without a file for None."""
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(target, "w") as copy:
        for name in source.namelist():
            content = change(name, source.read(name))
            if content is not None:
                copy.writestr(name, content)
    return target


def described(fmu, target, old, new):
    """Copy an FMU with another text in its modelDescription.xml."""
    return changed(
        fmu, target, lambda name, text: re.sub(old, new, text, flags=re.S) if name.endswith("n.xml") else text
    )


def test_arrays_follow_the_description_and_inputs_count_during_initialisation(toy):
    with Component(toy, "toy") as component:
        assert component.inputs == ("force", "spare[1]", "spare[2]", "spare[3]")
        assert component.outputs == ("x", "v", "copy[1]", "copy[2]", "copy[3]")
        assert component.links == ("link[1].tension", "link[2].tension", "link[3].tension")
        assert component.integers == ("solver.steps", "status")
        assert component.variables.parameters == ("start.x", "stiffness", "damping", "substeps", "trouble")
        assert (component.unit("stiffness"), component.unit("v"), component.unit("status")) == ("N/m", "m/s", "1")
        arrays = component.u, component.y, component.y_links, component.counters
        component.u[:] = 5.0, 0.0, 0.0, 0.0
        for force in (5.0, 1.0):
            component.initialise({"start.x": 0.25, "substeps": 5})
            assert component.y_links.tolist() == [25.0, 50.0, 75.0]
            if force == 1.0:
                component.u[:] = 1.0, 2.0, 3.0, 4.0
                component.write()
            component.step(0.0, H)
            component.read()
            assert component.y[1] == pytest.approx(H * (force - 25.0), rel=1e-3)
            assert component.y_links.tolist() == [25.0, 50.0, 75.0], "links are read when asked"
            component.read_links()
            assert component.y_links[0] == 100.0 * component.y[0]
        component.read_counters()
        after = component.u, component.y, component.y_links, component.counters
        assert all(a is b for a, b in zip(arrays, after, strict=True))
        assert component.counters.tolist() == [5, 0]
        assert 0.0 < component.wall_time < 60.0
    with pytest.raises(ComponentFailed, match="toy: the component is closed"):
        component.step(0.0, H)


def test_values_are_copied_where_they_lie(toy, tmp_path):
    """Inputs and outputs copied at their addresses have the bits of those that are set and read.

    Checked for FMUs with and without the address, in Python and in machine code.
    """
    bits = {}
    for fmu, addressed in (
        (toy, True),
        (described(toy, tmp_path / "silent.fmu", b"reals.size", b"reals.length"), False),
    ):
        with Component(fmu, "toy") as component:
            for _ in range(2):  # a reset changes the address
                component.initialise({"start.x": 0.25})
            for k in range(3):
                component.step(k * H, H)
                component.read_links()
                bits[addressed, k] = component.y_links.tobytes()
            if CAN_STEP:
                due = np.ones(1, dtype=np.int64)
                program = Program([Stage([component], [])], threads=False)
                places = [component.step_call[f"{name}_array"][0] for name in ("u", "y", "links")]
                assert all(places) == any(places) == addressed
                component.read_links_when(due.ctypes.data)
                for k in range(3, 6):
                    component.y_links[:], component.y[:], component.u[0] = 0.0, 0.0, 100.0 * k
                    program.run(k * H, H)
                    assert component.y_links[0] == 100.0 * component.y[0]
                    bits[addressed, k] = component.y_links.tobytes() + component.y.tobytes()
                due[0] = 0
                program.run(6 * H, H)
                assert bits[addressed, 5].startswith(component.y_links.tobytes())
                program.close()
    assert all(bits[True, k] == bits[False, k] for _, k in bits)
    assert len(set(bits.values())) == len(bits) // 2


def test_components_step_side_by_side_in_threads(toy, caplog):
    """Each has its own numbers, failures and messages."""
    caplog.set_level(logging.DEBUG, RUN.name)

    def run(component):
        component.initialise({})
        for i in range(200):
            component.u[0] = np.cos(i)
            component.write()
            component.step(i * H, H)
            component.read()
        y = component.y.copy()
        component.initialise({"trouble": "raise"})
        for i in range(5):
            component.step(i * H, H)
        with pytest.raises(ComponentFailed, match=f"{component.name}: the spring broke"):
            component.step(5 * H, H)
        return y

    with (
        Component(toy, "one") as one,
        Component(toy, "two") as two,
        Component(toy, "three") as three,
        ThreadPoolExecutor(2) as pool,
    ):
        alone, *both = run(three), *pool.map(run, (one, two))
    assert all(np.array_equal(each, alone) for each in both)
    heard = sorted(message.partition(":")[0] for message in caplog.messages)
    assert heard == ["one", "one", "three", "three", "two", "two"]  # message and traceback


@pytest.mark.skipif(not CAN_STEP, reason="no kernels for this system")
def test_a_step_by_kernels_is_the_step(toy):
    """A step by kernels equals the step by Python; its failure is reported in the component's own words."""
    with Component(toy, "one") as one, Component(toy, "two") as two:
        for component in (one, two):
            component.initialise({})
        program = Program([Stage([one], [])])
        for i in range(50):
            one.u[0] = two.u[0] = np.cos(i)
            program.run(i * H, H)
            two.write()
            two.step(i * H, H)
            two.read()
            assert np.array_equal(one.y, two.y)
        assert one.wall_time > 0.0
        one.wall_time = 0.0
        assert one.wall_time == 0.0
        one.initialise({"trouble": "raise"})
        for i in range(5):
            program.run(i * H, H)
        with pytest.raises(ComponentFailed, match="one: the spring broke"):
            program.run(5 * H, H)
        one.close()
        with pytest.raises(ComponentFailed, match="one: the component is closed"):
            program.run(6 * H, H)


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"stifness": 1.0}, "toy: there is no parameter 'stifness' (did you mean 'stiffness'?)"),
        ({"x": 1.0}, "toy: there is no parameter 'x'"),
        ({"stiffness": "high"}, "toy: parameter 'stiffness' = 'high': must be of type Real"),
        ({"stiffness": True}, "toy: parameter 'stiffness' = True: must be of type Real"),
        ({"substeps": 2.5}, "toy: parameter 'substeps' = 2.5: must be of type Integer"),
        ({"trouble": 3}, "toy: parameter 'trouble' = 3: must be of type String"),
    ],
)
def test_wrong_parameters_are_refused_by_name(toy, parameters, sentence):
    with Component(toy, "toy") as component, pytest.raises(ComponentFailed) as caught:
        component.initialise(parameters)
    assert str(caught.value) == sentence


def test_what_is_not_an_fmu_is_refused_in_one_sentence(toy, tmp_path):
    (tmp_path / "text.fmu").write_text("no zip")
    with zipfile.ZipFile(tmp_path / "empty.fmu", "w") as archive:
        archive.writestr("readme", "")
    damaged = bytearray(toy.read_bytes())
    damaged[200:260] = bytes(60)  # of the first packed file
    (tmp_path / "flipped.fmu").write_bytes(damaged)
    version, bare = rb'fmiVersion="2.0"', rb'<ModelExchange modelIdentifier="Toy"/>'
    for name, old, new in (
        ("3", version, rb'fmiVersion="3.0"'), ("1", version, rb'fmiVersion="1.0"'),
        ("me", rb"<CoSimulation .*?/>", bare), ("xml", rb"<ModelVariables>.*", b""),
    ):  # fmt: skip
        described(toy, tmp_path / f"{name}.fmu", old, new)
    changed(toy, tmp_path / "bin.fmu", lambda name, content: None if name.endswith(".so") else content)
    supported = ": only FMI 2.0 and 3.0 for co-simulation are supported"
    for name, sentence in {
        "flipped.fmu": "'{}' is not an FMU: it is not a zip archive that can be read: ",
        "none.fmu": "there is no FMU ", "": "cannot read the FMU ", "text.fmu": "'{}' is not an FMU: it is not a zip ",
        "empty.fmu": "'{}' is not an FMU: it has no modelDescription.xml",
        "3.fmu": "'{}' is not an FMU: bad modelDescription.xml: ", "1.fmu": "'{}' is an FMU of FMI 1.0" + supported,
        "me.fmu": "'{}' is an FMU for model exchange" + supported, "bin.fmu": "'{}' has no binary for ",
        "xml.fmu": "'{}' is not an FMU: bad modelDescription.xml: ",
    }.items():  # fmt: skip
        with pytest.raises(ComponentFailed) as caught:
            Component(tmp_path / name, "toy")
        assert str(caught.value).startswith(sentence.format(tmp_path / name))
        assert "\n" not in str(caught.value)


def test_fmu_is_unpacked_once_by_content(toy, fresh_cache, tmp_path):
    with ThreadPoolExecutor(2) as pool:
        folders = set(pool.map(unpack, (toy, toy)))
    copy = tmp_path / "copy.fmu"
    copy.write_bytes(toy.read_bytes())
    assert {unpack(copy)} == folders
    assert [path.name for path in (fresh_cache / "unpacked").iterdir()] == [folder.name for folder in folders]


@pytest.mark.long
def test_cache_may_lie_anywhere(tmp_path, monkeypatch):
    place = tmp_path / "a b" / "größe [1] 50%"
    monkeypatch.setenv("COTRACK_CACHE", str(place))
    with Component(build_toy(), "toy") as component:
        component.initialise({})
        component.step(0.0, H)
    assert len(list((place / "unpacked").iterdir())) == 1


def test_fmu_that_cannot_save_says_so(toy, tmp_path):
    poor = described(toy, tmp_path / "poor.fmu", b'canGetAndSetFMUstate="true"', b"")
    with Component(poor, "toy") as component:
        component.initialise({})
        with pytest.raises(ComponentFailed, match="toy: the FMU cannot save its state"):
            component.save()


@pytest.mark.parametrize(
    ("causality", "variability", "initial", "start", "settable"),
    [
        ("input", "continuous", None, "0.0", True),
        ("parameter", "fixed", "exact", "1.0", True),
        ("output", "continuous", "exact", "1.0", True),
        ("local", "continuous", "approx", "1.0", True),
        ("local", "discrete", None, "1.0", True),
        ("local", "continuous", "calculated", None, False),
        ("output", "constant", "exact", "1.0", False),
        ("independent", "continuous", "exact", "1.0", False),
    ],
)
def test_start_values_that_may_be_set(causality, variability, initial, start, settable):
    """FMI 2.0.4, section 2.2.7."""
    variable = SimpleNamespace(causality=causality, variability=variability, initial=initial, start=start)
    assert has_start_value(variable) is settable
