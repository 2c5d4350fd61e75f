"""Sentences of FMUs, their build and their cache: how each is caused, and its essential part."""

from __future__ import annotations

import shutil
from ctypes import c_double, c_int32, c_int64

import fmpy
import numpy as np
import pytest
from built_toy import TOY, build_toy
from fmi3_instance import begun3
from native_cases import CHAIN, CHASSIS, DRIVE, H, begun, native, ran
from scene_parts import drive, parts
from toy.model import Model as Toy

from fmus.cache import limit
from fmus.cache.pack import has_level
from fmus.components import model_of
from fmus.fmi.build import BuildFailed, build, build_shapes, build_shell, start_values
from fmus.interface.defaults import check_names, configured_ports
from fmus.interface.model import InvalidParameter
from fmus.kernels import jit
from fmus.kernels.numba_internals.references import Reference
from fmus.native import machine_code, numbers_file
from fmus.native import pack as native_pack
from fmus.native.pack import build_native, build_native_shape
from fmus.vehicles.tables import BadInput, to_si
from orchestrator.cosim.component import Component
from orchestrator.execution.truth import truth
from orchestrator.fmi.fmu_files import unpack
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.scene.scene import load


def told(kind, cause, *arguments, **more):
    """Sentence of the error of a kind that a call raises: one line."""
    with pytest.raises(kind) as caught:
        cause(*arguments, **more)
    assert "\n" not in str(caught.value)
    return str(caught.value)


# --- defaults and build ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"stifness": 1.0}, "there is no parameter 'stifness'"),
        ({"x": 1.0}, "there is no parameter 'x'"),
        ({"stiffness": "high"}, "stiffness = 'high': must be a number"),
        ({"stiffness": True}, "stiffness = True: must be a number"),
        ({"stiffness": float("inf")}, "stiffness = inf: must be a finite number"),
        ({"substeps": 2.0}, "substeps = 2.0: must be a whole number"),
        ({"trouble": 3}, "trouble = 3: must be a text"),
        ({"trouble": "explode"}, "trouble = 'explode': must be one of none, raise, nan, zero, warn"),
    ],
)
def test_defaults(given, sentence):
    config = {"spare": 0, "start": 0.1, "parameters": given}
    ports = Toy(config).ports
    assert told(InvalidParameter, lambda: check_names(ports, config) or configured_ports(ports, config)) == sentence


BUILDS = {
    "no kind of component is called 'Submarine': there are TrackFlexible": lambda _: build("Submarine", {}),
    "the configuration of toy_fmu is not JSON: ": lambda _: build_toy(start=float("nan")),
    "cannot build toy_fmu: TypeError: ": lambda _: build_toy(spare="many"),
    "cannot build toy_fmu: there is no parameter 'stifness'": lambda _: build_toy(parameters={"stifness": 1.0}),
    "cannot build ending_fmu: the end": lambda folder: build_shell(folder / "ending_fmu.py", {}),
    "cannot build toy_fmu.fmu: ": lambda folder: build_toy(folder / "ending_fmu.py" / "folder"),
    "no FMU shell at ": lambda _: build_shell(TOY / "none_fmu.py", {}),
    "cannot build sprocket_drive_fmu: drive.inertia = -1.0 kg m2 must be positive": lambda _: start_values(*drive(-1)),
    "native FMUs cannot be built: numba is 1.0, not 0.68.x, whose inside is known": "version",
    "libraries for Windows need the compiler ziglang: pip install ": "no ziglang",
    "native FMUs need a C compiler: pip install -c constraints.txt -e '.[native]'": "no compiler",
}


@pytest.mark.parametrize("sentence", BUILDS)
def test_builds(sentence, tmp_path, monkeypatch):
    (tmp_path / "ending_fmu.py").write_text("raise SystemExit('the end')", encoding="utf-8")
    cause = BUILDS[sentence]
    if cause == "version":
        monkeypatch.setattr("numba.__version__", "1.0")
    elif isinstance(cause, str):
        monkeypatch.setattr(machine_code, "find_spec", lambda name: None)
        found = {"no ziglang": "/bin/cc", "no compiler": None}[cause]
        monkeypatch.setattr(shutil, "which", lambda name: found)
    if isinstance(cause, str):
        cause = lambda _: build_native(*drive(), windows=True)  # noqa: E731
    assert told(BuildFailed, cause, tmp_path).startswith(sentence)


def test_a_cache_that_is_no_folder(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path / "file"))
    monkeypatch.setattr("fmus.fmi.build.temporary_folder", lambda: tmp_path / "file")
    assert "cannot build toy_fmu.fmu: [Errno 20] Not a directory: '" in told(BuildFailed, build_toy)
    scene = load("hanging_chain", "flexible", ("run.stop=0.02",))
    assert told(BadInput, truth, scene).startswith("truth: it cannot be kept in the cache: ")


@pytest.mark.parametrize(("text", "said"), [("-1", "must be a size in GB"), ("many", "'many'"), ("nan", "0 or more")])
def test_a_bad_size_of_the_cache(fresh_cache, cotrack, monkeypatch, text, said):
    monkeypatch.setenv(limit.SIZE, text)
    assert said in cotrack.refused("cache")


# --- kernels ---------------------------------------------------------------------------------------


@jit.kernel
def handed_back(a):
    return a


def test_kernels():
    assert "handed_back at " in (said := told(TypeError, handed_back, np.zeros(3)))
    assert said.endswith("returns an array: it must be ``allocating``")
    assert told(TypeError, lambda: Reference((1.0, "a")).address) == "a tuple by reference holds no unicode_type"


# --- instances -------------------------------------------------------------------------------------


def of_toy(parameters=(), h=H, steps=1, first=None):
    with Component(build_toy(), "toy") as component:
        component.initialise(dict(parameters))
        if first is not None:
            component.u[1] = first
        component.write()
        for k in range(steps):
            component.step(k * H, h)


def of_native(case, parameters=(), h=H, place=None):
    with begun(case) as component:
        component.initialise(ran(case).part.parameters | dict(parameters))
        if place is not None:
            component.u[place] = np.nan
        component.write()
        component.step(0.0, h)


LENGTH = "a step needs a finite time and a length of at least 1e-09 s"
INSTANCES = [
    (
        of_toy,
        {"parameters": {"trouble": "explode"}},
        "trouble = 'explode': must be one of none, raise, nan, zero, warn",
    ),
    (of_toy, {"parameters": {"stiffness": -1.0}}, "stiffness = -1.0: 100 % of springs push back"),
    (of_toy, {"parameters": {"damping": np.nan}}, "damping = nan: must be a finite number"),
    (of_toy, {"first": np.inf}, "input 'spare[1]' is inf at t = 0"),
    *((of_toy, {"h": h}, LENGTH) for h in (0.0, -H, np.nan, np.inf, 1e300, 4.94e-324, 1e-310, 0.9e-9)),
    (of_native, {"case": DRIVE, "place": 4}, "input 'mount.orientation.x' is nan at t = 0"),
    *((of_native, {"case": DRIVE, "h": h}, f"at most 1e+06 s, not t = 0, h = {h:.9g}") for h in (1.001e6, 1e300)),
    (
        of_native,
        {"case": DRIVE, "parameters": {"mode": "fast"}},
        "mode = 'fast': must be one of speed, torque, control",
    ),
    (of_native, {"case": DRIVE, "parameters": {"nonsense": 3.0}}, "there is no parameter 'nonsense'"),
]


@pytest.mark.parametrize(("run", "terms", "sentence"), INSTANCES)
def test_instances(run, terms, sentence):
    assert sentence in told(ComponentFailed, run, **terms)


@pytest.mark.long
def test_a_constant():
    said = "chain: 'start.pitch' = 3.0: it is a constant of this FMU, 0.0"
    assert said in told(ComponentFailed, of_native, CHAIN, {"start.pitch": 3.0})


@pytest.mark.parametrize(
    ("case", "parameters", "sentence"),
    [
        (DRIVE, {"gear.ratio": 0.0}, "gear.ratio = 0: must be greater than 0"),
        (DRIVE, {"ramp.start": 0.5, "ramp.end": 0.2}, "ramp.end = 0.2 s must not be before ramp.start"),
        (DRIVE, {"ramp.end": -1.0}, "ramp.end = -1: must be 0 or more"),
        (DRIVE, {"start.angle": float("inf")}, "start.angle = inf: must be a finite number"),
        pytest.param(CHASSIS, {"step": -2.5e-4}, "step = -0.00025: must be greater than 0", marks=pytest.mark.long),
    ],
)
def test_free_parameters_of_models_and_native_fmus(case, parameters, sentence):
    model = model_of(ran(case).part.kind)(ran(case).part.config)
    assert sentence in told(InvalidParameter, model.initialise, ran(case).part.parameters | parameters)
    assert sentence in told(ComponentFailed, of_native, case, parameters)


def test_numbers_that_exclude_each_other():
    part = parts()["left_track"]
    (fmu,) = build_shapes([(part.kind, part.config, None)])
    wanted = {**start_values(part.kind, part.config).parameters, **part.parameters}
    with Component(fmu, "track") as component:
        for name, value, sentence in (
            ("sprocket.outer_radius", 0.1, "track: sprocket.outer_radius = 0.1 m must exceed the pitch radius 0.2"),
            ("track.mass", -1.0, "track.mass = -1: must be greater than 0"),
        ):
            assert sentence in told(ComponentFailed, component.initialise, {**wanted, name: value})
        component.initialise(wanted)


@pytest.mark.long
@pytest.mark.skipif(not has_level(), reason="this processor is an older one")
def test_a_library_for_the_runs_of_this_machine_does_not_run_on_an_older_one(monkeypatch):
    flags = (*machine_code.FLAGS, "-DONLY_ANY_PROCESSOR")
    for module in (machine_code, native_pack):
        monkeypatch.setattr(module, "FLAGS", flags)
    native_pack._tools.cache_clear()
    try:
        fmu, resources, starts = build_native_shape(*drive(9.0))
        said = told(ComponentFailed, Component, fmu, "drive", resources=resources, starts=starts)
    finally:
        native_pack._tools.cache_clear()
    assert "for runs on processors with AVX2: cotrack build --native makes one for all" in said


@pytest.mark.long
def test_files_of_numbers(tmp_path):
    fmu, resources, starts = build_native_shape(*drive(points="0.0 0.0; 0.004 4.0"))
    content = (resources / numbers_file.FILE).read_bytes()
    foreign = (build_native_shape(*drive(9.0, demanded=True)).resources / numbers_file.FILE).read_bytes()
    for sentence, each in (
        ("the numbers of this FMU cannot be read: '", None),
        (f"{tmp_path.name}/numbers.bin'", b""),
        ("is damaged", content[:24] + bytes([content[24] ^ 1]) + content[25:]),
        ("is no file of numbers of this version", content[:8] + b"\3" + content[9:]),
        ("holds the numbers of another kind of FMU", foreign),
    ):
        if each is not None:
            (tmp_path / numbers_file.FILE).write_bytes(each)
        assert sentence in told(ComponentFailed, Component, fmu, "drive", resources=tmp_path)
    usual, other = (build_native(*drive(inertia)) for inertia in (9.0, 11.0))
    guids = [fmpy.read_model_description(file).guid for file in (usual, other)]
    said = told(ComponentFailed, Component, usual, "drive", resources=unpack(other) / "resources")
    assert f"the guid {guids[0]} is not {guids[1]}, which this FMU has" in said
    with Component(fmu, "drive", resources=resources, starts=starts) as component:
        said = told(ComponentFailed, component.initialise, {"speed.points": "0.0 1.0"})
        assert "'speed.points' is a constant of this FMU" in said


@pytest.mark.long
def test_states(toy):
    fmu, resources, _ = build_native_shape(*drive())
    others = {"resources": build_native_shape(*drive(11.0)).resources}
    for one, options, other, foreign, flaw in (
        (toy, {}, build_toy(start=0.2), "belongs to another FMU", "not a saved state"),
        (native(DRIVE), {}, native(CHASSIS), "not a saved state of this FMU", "checksum"),
        (fmu, {"resources": resources}, fmu, "the state is one of an instance with other numbers", "checksum"),
    ):
        with Component(one, "one", **options) as component:
            component.initialise({})
            content = component.dump(component.save())
            flipped = content[:-20] + bytes([content[-20] ^ 1]) + content[-19:]
            for bad, sentence in ((content[:-8], "not a saved state"), (flipped, flaw)):
                assert sentence in told(ComponentFailed, component.load, bad)
        with Component(other, "other", **(others if options else {})) as component:
            component.initialise({})
            assert foreign in told(ComponentFailed, lambda c=component, s=content: c.restore(c.load(s)))


ONE = "these variables have 3 values, not"
REFUSED = [  # of FMI 3.0: function, references, values, type; "first": of the first input, an array of three
    (f"{ONE} 2", "fmi3SetFloat64", ["first"], [7.0] * 2, c_double),
    (f"{ONE} 4", "fmi3GetFloat64", ["first"], [7.0] * 4, c_double),
    ("an output cannot be set (sprocket.position.x", "fmi3SetFloat64", ["first", "shown"], [7.0] * 6, c_double),
    ("the time cannot be set", "fmi3SetFloat64", ["time"], [7.0], c_double),
    ("no Float64 variable has the value reference ", "fmi3GetFloat64", ["beyond"], [7.0], c_double),
    ("no Float64 variable has the value reference 4294967295", "fmi3SetFloat64", [2**32 - 1], [7.0], c_double),
    ("no Int32 variable has the value reference 0", "fmi3GetInt32", [0], [7], c_int32),
    ("output 'solver.steps' cannot be set", "fmi3SetInt64", ["counted"], [7], c_int64),
    ("parameter 'start.position.x' is fixed", "fmi3SetFloat64", ["fixed"], [7.0] * 3, c_double),
]


def test_refused_calls_of_fmi_3_change_nothing():
    run = ran(DRIVE)
    with begun3(DRIVE, parameters=False) as three:

        def said(function, references, values, type_):
            assert three.status(function, [places.get(each, each) for each in references], values, type_) == 3
            assert three.messages[-1][0] == 3
            return three.messages[-1][1]

        described = {v.name: v.valueReference for v in three.description.modelVariables}
        time = len(described) - 1
        places = {"time": time, "beyond": time + 1, "fixed": described["start.position"]}
        groups = {"first": ("input",), "shown": ("output",), "counted": ("output", "Int64")}
        places |= {name: three.of(*group)[0].valueReference for name, group in groups.items()}
        get = "fmi3GetFloat64", ["first"], [0.0] * 3, c_double
        assert "fmi3GetFloat64 is not allowed in the phase instantiated" in said(*get)
        choice = "mode = '{}': must be one of speed, torque, controller"
        for value in (0, 4):
            assert said("fmi3SetInt64", [described["mode"]], [value], c_int64) == choice.format(value)
        with pytest.raises(fmpy.fmi1.FMICallException):
            three.slave.doStep(0.0, H)
        assert "fmi3DoStep is not allowed in the phase instantiated, only when running" in three.messages[-1][1]
        three.start(run.part.parameters)
        before = three.slave.getFloat64([places["first"]], 3)
        for sentence, *call in REFUSED:
            assert sentence in said(*call)
        for unsupported in (three.slave.enterEventMode, three.slave.enterStepMode, three.slave.updateDiscreteStates):
            with pytest.raises(fmpy.fmi1.FMICallException):
                unsupported()
            assert three.messages[-1][1].endswith("is not supported by this FMU")
        assert three.slave.getFloat64([places["first"]], 3) == before
        with begun3(DRIVE) as other:
            np.testing.assert_array_equal(three.follow(run, range(3))[0], other.follow(run, range(3))[0])


# --- units -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "unit", "words"),
    [
        ("Grad", "rad", "say deg or gon"), ("grads/s", "rad/s", "say deg or gon"), ("mil", "rad", "say mrad or thou"),
        ("tons", "kg", "say t or lb"), ("1/s", "rad/s", "'1/s' does not convert to rad/s; an angle needs deg, r"),
        ("Hz", "rad/s", "an angle needs"), ("%", "rad", "an angle needs"), ("deg", "1", "'deg' does not convert to 1$"),
        ("N m/rad", "N m", "does not convert"), ("N/m s", "N", "put it in brackets"), ("m s", "m", "does not convert"),
        ("knts", "m/s", "'knts' is no known unit: did you mean 'knots' or"), ("m9 9", "m", "'9' is no known unit"),
        ("x" * 9999, "m", "'x{40}' is no known unit$"), ("(" * 9999, "m", "no known unit"),
        ("1 m", "m", "must be a number or a quantity in m"),
    ],
)  # fmt: skip
def test_what_is_ambiguous_or_unknown_is_refused_with_the_remedy(given, unit, words):
    with pytest.raises(ValueError, match=words):
        to_si(unit)(f"3 {given}")
