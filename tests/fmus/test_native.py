"""Native FMUs against the models that they are built from: the same bits and messages, without Python."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from fmpy.validation import validate_fmu
from named_ports import parameters
from native_cases import CHASSIS, DRIVE, FEW, MANY, SOIL, STEPS, H, begun, follow, native, ran

from fmus.cache.files import CHECKSUM
from fmus.interface.model import StepFailed
from fmus.native import machine_code
from fmus.native.pack import build_native, with_constants
from fmus.physics.contact.soil.memory import MADE
from orchestrator.cosim.component import Component
from orchestrator.fmi.fmu_files import unpack
from orchestrator.fmi.slave import ComponentFailed

# functions of libm, which chooses their code by processor; compilers make some of them of operators
MATHEMATICAL = (
    "sin", "cos", "tan", "sincos", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "exp2", "expm1",
    "log", "log2", "log10", "log1p", "pow", "hypot", "cbrt", "fma", "fmod", "remainder", "ldexp", "frexp",
)  # fmt: skip


def assert_same(case):
    """Assert that outputs equal those of Python, and that slightly different inputs change them."""
    run = ran(case)
    with begun(case) as component:
        y, links = follow(component, run, range(case.steps))
        np.testing.assert_array_equal(y, run.y)
        np.testing.assert_array_equal(links, run.links)
        assert component.counters[:-1].tolist() == run.member.model.counters.tolist()
    assert np.abs(run.y[-1] - run.y[0]).max() > 0.0
    if run.u.size:
        with begun(case) as component:
            other, _ = follow(component, run._replace(u=run.u * (1.0 + 1e-9)), range(10))
        assert not np.array_equal(other, run.y[:10])


@pytest.mark.study
@pytest.mark.parametrize("case", [*MANY, *FEW], ids=str)
def test_a_long_replay_of_every_kind_gives_the_same_bits(case):
    assert_same(case._replace(steps=2000))


def library(file):
    """Content of the library in an FMU."""
    with zipfile.ZipFile(file) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".so"))
        return archive.read(name)


@pytest.mark.long
@pytest.mark.parametrize(
    "case",
    [FEW[0], pytest.param(FEW[1], marks=pytest.mark.study), FEW[2]],
    ids=lambda case: f"{case.part}-{case.links}",
)
def test_the_library_needs_libc_alone_and_validates(case):
    file = native(case)
    assert validate_fmu(str(file)) == []
    with zipfile.ZipFile(file) as archive:
        assert sorted(archive.namelist()) == [
            f"binaries/linux64/{ran(case).part.kind}.so", "documentation/index.html",
            "documentation/licenses/license.txt", "model.png", "modelDescription.xml", "resources/numbers.bin",
            "resources/shape.txt", *["terminalsAndIcons/terminalsAndIcons.xml"] * (case.part != "chain"),
        ]  # fmt: skip
    content = library(file)
    assert set(re.findall(rb"\0(lib[a-z]+\.so[.0-9]*)(?=\0)", content)) == {b"libc.so.6"}
    strings = set(re.findall(rb"(?<=\0)[A-Za-z_]\w*(?=\0)", content))
    assert not strings & {name.encode() + end for name in MATHEMATICAL for end in (b"", b"f", b"l")}
    assert b"memcpy" in strings, "the table of imported names was not found"
    assert not re.search(rb"\0_?(Py|NRT_|numba)\w+(?=\0)", content)


LONG, STUDY = partial(pytest.param, marks=pytest.mark.long), partial(pytest.param, marks=pytest.mark.study)
BENT = (slice(3, 7), 0.1, H), (0, 5.0, H), (0, 0.0, 1e6), (11, 1e150, H)  # place and value of an input, step


@pytest.mark.parametrize(
    ("case", "place", "value", "h"),
    [
        (DRIVE, *BENT[0]), LONG(CHASSIS, 2, 1e12, H), LONG(CHASSIS, *BENT[2]),
        *(STUDY(case, *bent) for case in MANY if case.part.endswith("track") for bent in BENT),
    ],
)  # fmt: skip
def test_failures_say_what_the_python_component_says_and_change_nothing(case, place, value, h):
    run = ran(case)
    u = run.u[0].copy()
    u[place] = value
    model = type(run.member.model)(run.part.config)
    model.initialise(parameters(model, **run.part.parameters))
    with begun(case) as component:
        y = component.y.copy()
        component.u[:] = u
        component.write()
        with pytest.raises(StepFailed) as told:
            model.step(0.0, h, u)
        for _ in range(2):
            with pytest.raises(ComponentFailed, match=re.escape(str(told.value))):
                component.step(0.0, h)
        component.read()
        np.testing.assert_array_equal(component.y, y)
        component.u[:] = run.u[0]
        component.write()
        component.step(0.0, H)  # goes on with good input


def test_states_go_on_to_the_bit_also_in_another_instance():
    run = ran(CHASSIS)
    with begun(CHASSIS) as one, begun(CHASSIS) as other:
        follow(one, run, range(40))
        state = one.save()
        y, _ = follow(one, run, range(40, 80))
        one.restore(state)
        np.testing.assert_array_equal(follow(one, run, range(40, 80))[0], y)
        other.restore(other.load(one.dump(state)))
        np.testing.assert_array_equal(follow(other, run, range(40, 80))[0], y)


@pytest.mark.long
def test_a_track_in_its_rut_has_the_same_bits_and_goes_on_from_saved_states():
    assert_same(SOIL)
    run = ran(SOIL)
    assert run.member.model.s.rut[MADE] > 0.0
    with begun(SOIL) as one, begun(SOIL) as other:
        follow(one, run, range(400))  # on its way back
        other.load(one.dump(one.save()))
        for component in (one, other):
            y, links = follow(component, run, range(400, 600))
            np.testing.assert_array_equal(y, run.y[400:])
            np.testing.assert_array_equal(links, run.links[400:])


def test_threads_disturb_nothing():
    run = ran(CHASSIS)
    with ExitStack() as stack, ThreadPoolExecutor(4) as pool:
        eight = [stack.enter_context(begun(CHASSIS)) for _ in range(8)]
        for y, _ in pool.map(lambda component: follow(component, run, range(STEPS)), eight):
            np.testing.assert_array_equal(y, run.y)


def test_a_thousand_instances_leave_no_memory_behind():
    with begun(CHASSIS) as component:
        guid, folder = component.description.guid.encode(), unpack(native(CHASSIS))
    fmu = ctypes.CDLL(str(folder / "binaries/linux64/Chassis.so"))
    fmu.fmi2Instantiate.restype = ctypes.c_void_p

    def cycles(count):
        for _ in range(count):
            place = (folder / "resources").as_uri().encode()
            instance = ctypes.c_void_p(fmu.fmi2Instantiate(b"a", 1, guid, place, None, 0, 0))
            assert instance
            assert fmu.fmi2EnterInitializationMode(instance) == fmu.fmi2ExitInitializationMode(instance) == 0
            fmu.fmi2FreeInstance(instance)
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096

    before = cycles(50)
    assert cycles(1000) - before < 3e6  # an instance has 30 kB


def made(part, **changes):
    """Bytes of the FMU of a part."""
    config = with_constants(part.kind, part.config, part.parameters)
    return build_native(part.kind, {**config, "parameters": {**config["parameters"], **changes}}).read_bytes()


@pytest.mark.long
def test_equal_sources_give_equal_bytes(monkeypatch, tmp_path):
    part, contents = ran(DRIVE).part, []
    for cache in ("one", "other"):
        monkeypatch.setenv("COTRACK_CACHE", str(tmp_path / cache))
        contents.append(made(part)[:-CHECKSUM])
    assert contents[0] == contents[1]
    assert contents[0] != made(part, **{"speed.end": 3.0})[:-CHECKSUM]


FOR_ANY = """
import sys
from native_cases import FEW, native
from fmus.native import machine_code, pack
machine_code.FLAGS = pack.FLAGS = (*machine_code.FLAGS, "-DONLY_ANY_PROCESSOR")
print(native(FEW[int(sys.argv[1])]))
"""


@pytest.mark.study
@pytest.mark.parametrize("number", [0, 2])
def test_kernels_for_any_processor_give_the_bits_of_those_for_newer_ones(number, environment, tmp_path):
    """A library chooses when it is instantiated; one without a choice has the kernels for any processor."""
    case = FEW[number]
    env = environment | {"COTRACK_CACHE": str(tmp_path)}
    command = [sys.executable, "-c", FOR_ANY, str(number)]
    file = Path(subprocess.run(command, env=env, capture_output=True, text=True, check=True).stdout.strip())
    assert library(file) != library(native(case))
    run = ran(case)
    with Component(file, case.part) as component:
        component.initialise(run.part.parameters)
        y, links = follow(component, run, range(40))
    np.testing.assert_array_equal(y, run.y[:40])
    np.testing.assert_array_equal(links, run.links[:40])


@pytest.mark.study
def test_a_library_for_windows_needs_what_windows_has():
    pytest.importorskip("ziglang")
    part = ran(DRIVE).part
    file = build_native(part.kind, with_constants(part.kind, part.config, part.parameters), windows=True)
    assert library(file)
    with zipfile.ZipFile(file) as archive:
        content = archive.read(f"binaries/win64/{part.kind}.dll")
    assert content[:2] == b"MZ"
    needed = set(re.findall(rb"[\w-]+\.dll", content)) - {f"{part.kind}.dll".encode()}
    assert needed
    assert all(name.lower().startswith((b"kernel32", b"api-ms-win-crt-")) for name in needed), needed
    exported = set(re.findall(rb"fmi2[A-Z]\w+", content))
    assert {b"fmi2Instantiate", b"fmi2DoStep", b"fmi2GetReal", b"fmi2SerializeFMUstate"} <= exported


@pytest.mark.skipif(not shutil.which("cc"), reason="needs the compiler of the system")
@pytest.mark.parametrize("fmi", [2, pytest.param(3, marks=pytest.mark.long)])
def test_the_compiler_of_the_system_links_a_library(monkeypatch, tmp_path, fmi):
    part = ran(DRIVE).part
    monkeypatch.setattr(machine_code, "find_spec", lambda name: None)
    assert library(build_native(part.kind, {**part.config, "parameters": {"speed.end": 4.25}}, tmp_path, fmi=fmi))
