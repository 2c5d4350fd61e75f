"""Native FMUs against the models that they are built from: the same bits and messages, without Python."""

from __future__ import annotations

import ctypes
import io
import re
import shutil
import subprocess
import zipfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu
from named_ports import parameters
from native_cases import CHAIN, CHASSIS, DRIVE, FEW, MANY, SOIL, STEPS, H, begun, follow, native, ran

from fmus.cache.files import CHECKSUM
from fmus.fmi.build import BuildFailed, packed_config
from fmus.interface.model import StepFailed
from fmus.native import link, pack
from fmus.native.link import LINUX, WINDOWS
from fmus.native.pack import build_native, with_constants
from fmus.physics.contact.soil.memory import MADE
from orchestrator.cosim.component import Component
from orchestrator.cosim.fmu_files import unpack
from orchestrator.cosim.graph import ComponentFailed

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
@pytest.mark.parametrize("case", FEW, ids=lambda case: f"{case.part}-{case.links}")
def test_a_replay_gives_the_same_bits(case):
    assert_same(case)


@pytest.mark.study
@pytest.mark.parametrize("case", [*MANY, *FEW], ids=str)
def test_a_long_replay_of_every_kind_gives_the_same_bits(case):
    assert_same(case._replace(steps=2000))


@pytest.mark.long
@pytest.mark.parametrize("case", FEW[:3], ids=lambda case: f"{case.part}-{case.links}")
def test_the_library_needs_libc_alone_and_validates(case):
    file = native(case)
    assert validate_fmu(str(file)) == []
    with zipfile.ZipFile(file) as archive:
        names = archive.namelist()
        (library,) = (archive.read(name) for name in names if name.endswith(".so"))
    pages = ["documentation/index.html", "documentation/licenses/license.txt"]
    numbers = ["resources/numbers.bin", "resources/shape.txt"]
    assert sorted(names) == [
        f"binaries/linux64/{ran(case).part.kind}.so",
        *pages,
        "model.png",
        "modelDescription.xml",
        *numbers,
    ]
    needed = set(re.findall(rb"\0(lib[a-z]+\.so[.0-9]*)(?=\0)", library))
    assert needed == {b"libc.so.6"}
    strings = set(re.findall(rb"(?<=\0)[A-Za-z_]\w*(?=\0)", library))
    assert not strings & {name.encode() + end for name in MATHEMATICAL for end in (b"", b"f", b"l")}
    assert b"memcpy" in strings, "the table of imported names was not found"
    assert not re.search(rb"\0_?(Py|NRT_|numba)\w+(?=\0)", library)


def bent(case, place, value):
    """Inputs of a run's first step with one invalid value."""
    u = ran(case).u[0].copy()
    u[place] = value
    return u


@pytest.mark.parametrize(
    ("case", "place", "value", "h"),
    [
        (DRIVE, slice(3, 7), 0.1, H),
        pytest.param(CHASSIS, 2, 1e12, H, marks=pytest.mark.long),
        pytest.param(CHASSIS, 0, 0.0, 1e6, marks=pytest.mark.long),
    ],
)
def test_failures_say_what_the_python_component_says_and_change_nothing(case, place, value, h):
    assert_same_failure(case, place, value, h)


@pytest.mark.study
@pytest.mark.parametrize("case", [each for each in MANY if each.part.endswith("track")], ids=str)
@pytest.mark.parametrize(("place", "value", "h"), [(slice(3, 7), 0.1, H), (0, 5.0, H), (0, 0.0, 1e6), (11, 1e150, H)])
def test_tracks_fail_alike(case, place, value, h):
    assert_same_failure(case, place, value, h)


def assert_same_failure(case, place, value, h):
    run, u = ran(case), bent(case, place, value)
    model = type(run.member.model)(run.part.config)
    model.initialise(parameters(model, **run.part.parameters))
    with begun(case) as component:
        y = component.y.copy()
        component.u[:] = u
        component.write()
        try:
            model.step(0.0, h, u)
        except StepFailed as error:
            said = str(error)
        else:
            pytest.fail("the model does it")
        for _ in range(2):
            with pytest.raises(ComponentFailed, match=re.escape(said)):
                component.step(0.0, h)
        component.read()
        np.testing.assert_array_equal(component.y, y)
        component.u[:] = run.u[0]
        component.write()
        component.step(0.0, H)  # goes on with good input


def test_what_is_not_finite_is_named():
    with begun(DRIVE) as component:
        component.u[4] = np.nan
        component.write()
        with pytest.raises(ComponentFailed, match=r"input 'mount\.orientation\.x' is nan at t = 0$"):
            component.step(0.0, H)


def test_states_go_on_to_the_bit_also_in_another_instance():
    run = ran(CHASSIS)
    with begun(CHASSIS) as one, begun(CHASSIS) as other:
        follow(one, run, range(40))
        state = one.save()
        y, _ = follow(one, run, range(40, 80))
        one.restore(state)
        again, _ = follow(one, run, range(40, 80))
        np.testing.assert_array_equal(again, y)
        content = one.dump(state)
        flawed = bytearray(content)
        flawed[-1] ^= 1
        for broken, said in ((content[:-1], "not a saved state of this FMU"), (bytes(flawed), "checksum")):
            with pytest.raises(ComponentFailed, match=said):
                other.load(broken)
        with begun(DRIVE) as drive, pytest.raises(ComponentFailed, match="not a saved state of this FMU"):
            drive.load(content)
        other.restore(other.load(content))
        elsewhere, _ = follow(other, run, range(40, 80))
        np.testing.assert_array_equal(elsewhere, y)


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
        library, guid = component._library, component.description.guid.encode()
        place = (unpack(native(CHASSIS)) / "resources").as_uri().encode()
    library.fmi2Instantiate.restype = ctypes.c_void_p

    def cycles(count):
        for _ in range(count):
            instance = ctypes.c_void_p(library.fmi2Instantiate(b"a", 1, guid, place, None, 0, 0))
            assert instance
            assert library.fmi2EnterInitializationMode(instance) == library.fmi2ExitInitializationMode(instance) == 0
            library.fmi2FreeInstance(instance)
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096

    before = cycles(50)
    assert cycles(1000) - before < 3e6  # an instance has 30 kB


@pytest.mark.long
def test_constants_are_constants():
    file = native(CHAIN)
    with Component(file, "chain") as component:
        with pytest.raises(ComponentFailed, match=r"chain: 'start\.pitch' = 3\.0: it is a constant of this FMU, 0\.0"):
            component.initialise({"start.pitch": 3.0})
        with pytest.raises(ComponentFailed, match="there is no parameter 'nonsense'"):
            component.initialise({"nonsense": 3.0})


def test_a_wrong_guid_is_refused():
    file = native(DRIVE)
    slave = FMU2Slave(guid="{0}", modelIdentifier="SprocketDrive", unzipDirectory=str(unpack(file)), instanceName="a")
    with pytest.raises(Exception, match="instantiate"):
        slave.instantiate()


def made(part, **parameters):
    """Bytes of the FMU of a part."""
    config = with_constants(part.kind, part.config, part.parameters)
    return build_native(part.kind, {**config, "parameters": {**config["parameters"], **parameters}}).read_bytes()


@pytest.mark.long
def test_equal_sources_give_equal_bytes(monkeypatch, tmp_path):
    part, contents = ran(DRIVE).part, []
    for cache in ("one", "other"):
        monkeypatch.setenv("COTRACK_CACHE", str(tmp_path / cache))
        contents.append(made(part)[:-CHECKSUM])
    assert contents[0] == contents[1]
    assert contents[0] != made(part, **{"speed.end": 3.0})[:-CHECKSUM]


@pytest.mark.study
@pytest.mark.parametrize("case", [FEW[0], FEW[2]], ids=lambda case: f"{case.part}-{case.links}")
def test_kernels_for_any_processor_give_the_bits_of_those_for_newer_ones(case, monkeypatch, tmp_path):
    """Kernels for any processor give the bits of those for newer ones.

    A library chooses when it is instantiated; one without a choice has the kernels for any processor.
    """
    run = ran(case)
    usual, file = native(case), tmp_path / "any.fmu"
    with monkeypatch.context() as patch:
        for module in (link, pack):
            patch.setattr(module, "FLAGS", (*link.FLAGS, "-DONLY_ANY_PROCESSOR"))
        pack._tools.cache_clear()
        file.write_bytes(made(run.part)[:-CHECKSUM])
    pack._tools.cache_clear()
    assert (unpack(file) / f"binaries/linux64/{run.part.kind}.so").read_bytes() != (
        unpack(usual) / f"binaries/linux64/{run.part.kind}.so"
    ).read_bytes()
    with Component(file, case.part) as component:
        component.initialise(run.part.parameters)
        y, links = follow(component, run, range(40))
    np.testing.assert_array_equal(y, run.y[:40])
    np.testing.assert_array_equal(links, run.links[:40])


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_c_sources_compile_for_windows(fmi, tmp_path):
    """Its headers have names of their own, as GUID; the whole library takes minutes."""
    pytest.importorskip("ziglang")
    part = ran(DRIVE).part
    component = pack._Component(part.kind, packed_config(part.kind, part.config), fmi, pack._tools(fmi, (LINUX,)))
    names = f'#define GUID "{component.guid}"\n#define SHAPE "{component.shape}"\n'
    (tmp_path / "model.h").write_text(names + component.header)
    target = tmp_path / "shell.obj"
    command = [*link.compiler(WINDOWS), "-std=c11", "-c", f"-I{tmp_path}", str(link.sources(fmi)[0]), "-o", str(target)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert target.stat().st_size > 0


@pytest.mark.study
def test_a_library_for_windows_needs_what_windows_has():
    pytest.importorskip("ziglang")
    part = ran(DRIVE).part
    file = build_native(part.kind, with_constants(part.kind, part.config, part.parameters), windows=True)
    content = file.read_bytes()
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        names = archive.namelist()
        library = archive.read(f"binaries/win64/{part.kind}.dll")
    assert f"binaries/linux64/{part.kind}.so" in names
    assert library[:2] == b"MZ"
    needed = set(re.findall(rb"[\w-]+\.dll", library)) - {f"{part.kind}.dll".encode()}
    assert needed
    assert all(name.lower().startswith((b"kernel32", b"api-ms-win-crt-")) for name in needed), needed
    exported = set(re.findall(rb"fmi2[A-Z]\w+", library))
    assert {b"fmi2Instantiate", b"fmi2DoStep", b"fmi2GetReal", b"fmi2SerializeFMUstate"} <= exported


@pytest.mark.skipif(not shutil.which("cc"), reason="needs the compiler of the system")
@pytest.mark.parametrize("fmi", [2, pytest.param(3, marks=pytest.mark.long)])
def test_the_compiler_of_the_system_links_a_library(monkeypatch, tmp_path, fmi):
    part = ran(DRIVE).part
    monkeypatch.setattr(link, "find_spec", lambda name: None)
    changed = {**part.config, "parameters": {"speed.end": 4.25}}
    file = build_native(part.kind, changed, tmp_path, fmi=fmi)
    with zipfile.ZipFile(file) as packed:
        assert any(name.endswith("SprocketDrive.so") for name in packed.namelist())


def test_what_is_missing_is_a_sentence(monkeypatch):
    part = ran(DRIVE).part
    changed = {**part.config, "parameters": {"speed.end": 4.0}}
    with monkeypatch.context() as patch:
        patch.setattr(pack, "version", lambda name: "1.0")
        pack._tools.cache_clear()
        with pytest.raises(BuildFailed, match=r"made with numba 0\.6x, whose insides they know, not 1\.0"):
            build_native(part.kind, changed)
    monkeypatch.setattr(link, "find_spec", lambda name: None)
    with pytest.raises(BuildFailed, match="libraries for Windows need the compiler ziglang"):
        build_native(part.kind, changed, windows=True)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    pack._tools.cache_clear()
    with pytest.raises(BuildFailed, match=r"native FMUs need a C compiler: pip install .* -e '\.\[native\]'"):
        build_native(part.kind, changed)
    with pytest.raises(BuildFailed, match="no kind of component is called 'Nothing'"):
        build_native("Nothing", {})
