"""Native FMUs against the models that they are built from: the same bits and messages, without Python."""

from __future__ import annotations

import ctypes
import io
import re
import shutil
import zipfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu
from vehicle_in_process import InProcess

from fmus.build import BuildFailed
from fmus.components import KINDS
from fmus.model import InvalidParameter, StepFailed
from fmus.native import link, pack
from fmus.native.pack import build_native, with_constants
from fmus.native.platform import LINUX, WINDOWS
from fmus.track_choices import TRACKS
from orchestrator.cosim.component import Component, ComponentFailed, unpack
from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load

H, STEPS = 1e-3, 120
QUICK = "run.stop=1 s", "run.step=1 ms", "track.step=1 ms"
MOVING = *QUICK, "drive.ramp_start=0", "drive.ramp_time=0.1"
JOINTED = "track.formulation=recursive", "track.integrator=runge_kutta"
CHOLESKY = "track.coordinates=cholesky", "track.integrator=runge_kutta"
ROUND = "drive.ramp_start=0", "drive.ramp_time=0.05", "drive.left.speed=4", "drive.right.speed=12"


class Case(NamedTuple):
    """A part of a scene."""

    scene: str
    links: str
    part: str
    settings: tuple[str, ...] = QUICK
    steps: int = STEPS


FEW = [
    Case("hanging_chain", "flexible", "chain"),
    Case("straight", "rigid", "left_drive", MOVING),
    Case("straight", "rigid", "chassis", MOVING),
    Case("serpentine", "rigid", "driver"),
    Case("serpentine", "rigid", "right_drive"),
    Case("differential", "rigid", "differential"),
]
MANY = [
    Case("hanging_chain", "rigid", "chain"),
    Case("straight", "flexible", "left_track", MOVING),
    Case("straight", "rigid", "right_track", MOVING),
    Case("straight", "flexible", "left_track", (*MOVING, "track.element=beam")),
    Case("straight", "flexible", "left_track", (*MOVING, "symmetric=true", "planar=true")),
    Case("turn", "flexible", "left_track", (*QUICK, *ROUND)),
    Case("turn", "rigid", "right_track", (*QUICK, *ROUND)),
    Case("hanging_chain", "flexible", "chain", (*QUICK, "track.integrator=runge_kutta", "track.start=displaced")),
    Case("hanging_chain", "rigid", "chain", (*QUICK, "track.integrator=runge_kutta", "track.start=displaced")),
    Case("hanging_chain", "flexible", "chain", (*QUICK, "track.integrator=adams", "track.start=displaced")),
    Case("hanging_chain", "rigid", "chain", (*QUICK, "track.integrator=adams", "track.start=displaced")),
    Case("hanging_chain", "flexible", "chain", (*QUICK, "track.integrator=hht")),
    Case("hanging_chain", "flexible", "chain", (*QUICK, *CHOLESKY, "track.start=displaced")),
    Case("straight", "rigid", "left_track", (*MOVING, *JOINTED)),
    Case("straight", "rigid", "left_track", (*MOVING, *JOINTED, "track.closure=spring")),
    Case("straight", "rigid", "left_track", (*MOVING, "track.closure=spring")),
    Case("hanging_chain", "flexible", "chain", (*QUICK, "track.elasticity=general")),
    Case("straight", "flexible", "right_track", (*QUICK, "drive.speed=0")),
    Case("straight", "rigid", "left_track", (*QUICK, "drive.speed=0")),
    Case("straight", "rigid", "chassis", (*MOVING, "ground.hull=true", "vehicle.chassis.hull=[[-2.0, 0.0, -0.9]]")),
]


class Run(NamedTuple):
    """A part of a scene that ran as Python: its model, and its inputs and all outputs at each step."""

    part: object
    member: object
    u: np.ndarray
    y: np.ndarray
    links: np.ndarray


@cache
def ran(case):
    vehicle = InProcess(load(case.scene, case.links, case.settings))
    member = vehicle[case.part]
    u, y, links = [], [], []
    step = member.step

    def recorded(t, h):
        u.append(member.u.copy())
        step(t, h)
        y.append(member.y.copy())
        links.append(member.link_outputs())

    member.step = recorded
    for _ in range(case.steps):
        vehicle.step()
    (part,) = (part for part in assemble(vehicle.scene).parts if part.name == case.part)
    return Run(part, member, np.array(u), np.array(y), np.array(links))


def native(case):
    part = ran(case).part
    return build_native(part.kind, with_constants(part.kind, part.config, part.parameters))


def begun(case, stack=None, messages=None):
    component = Component(native(case), case.part, messages)
    component.initialise(ran(case).part.parameters)
    return component


def follow(component, run, steps):
    """Return outputs (steps, ports) and link outputs (steps, link ports) after each of the steps."""
    shown = []
    for k in steps:
        component.u[:] = run.u[k]
        component.write()
        component.step(k * H, H)
        component.read()
        component.read_links()
        component.read_counters()
        shown.append((component.y.copy(), component.y_links.copy()))
    return [np.array(each) for each in zip(*shown, strict=True)]


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
def test_the_library_needs_libc_and_libm_alone_and_validates(case):
    file = native(case)
    assert validate_fmu(str(file)) == []
    with zipfile.ZipFile(file) as archive:
        names = archive.namelist()
        (library,) = (archive.read(name) for name in names if name.endswith(".so"))
    assert sorted(names) == [f"binaries/linux64/{ran(case).part.kind}.so", "modelDescription.xml"]
    needed = set(re.findall(rb"\0(lib[a-z]+\.so[.0-9]*)(?=\0)", library))
    assert needed <= {b"libc.so.6", b"libm.so.6"}
    assert needed
    assert not re.search(rb"\0_?(Py|NRT_|numba)\w+(?=\0)", library)


CHAIN, DRIVE, CHASSIS = FEW[:3]


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
    model.initialise({port.name: port.start for port in model.ports if port.causality == "parameter"}
                     | run.part.parameters)  # fmt: skip
    with begun(case) as component:
        y = component.y.copy()
        component.u[:] = u
        component.write()
        try:
            model.step(0.5, h, u)
        except StepFailed as error:
            said = str(error)
        else:
            pytest.fail("the model does it")
        with pytest.raises(ComponentFailed, match=re.escape(said)):
            component.step(0.5, h)
        with pytest.raises(ComponentFailed, match=r"an earlier call failed .*restore a saved state or reset"):
            component.step(0.5, H)
        component.read()
        np.testing.assert_array_equal(component.y, y)


def test_what_is_not_finite_is_named():
    with begun(DRIVE) as component:
        component.u[4] = np.nan
        component.write()
        with pytest.raises(ComponentFailed, match=r"input 'mount\.orientation\.x' is nan at t = 0\.25"):
            component.step(0.25, H)


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


def test_threads_disturb_nothing():
    run = ran(CHASSIS)
    with ExitStack() as stack, ThreadPoolExecutor(4) as pool:
        eight = [stack.enter_context(begun(CHASSIS)) for _ in range(8)]
        for y, _ in pool.map(lambda component: follow(component, run, range(STEPS)), eight):
            np.testing.assert_array_equal(y, run.y)


def test_a_thousand_instances_leave_no_memory_behind():
    with begun(CHASSIS) as component:
        library, guid = component._library, component.description.guid.encode()
    library.fmi2Instantiate.restype = ctypes.c_void_p

    def cycles(count):
        for _ in range(count):
            instance = ctypes.c_void_p(library.fmi2Instantiate(b"a", 1, guid, b"", None, 0, 0))
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


# --- free parameters --------------------------------------------------------------------------------------

PLACE = {
    "start.position.x": 3.0, "start.position.y": -2.0, "start.position.z": 0.25, "start.heading": 0.7,
    "start.height": 0.01, "start.pitch": 0.02,
}  # fmt: skip
MOTOR = {
    "speed.start": 1.5, "speed.end": 3.5, "ramp.start": 0.01, "ramp.end": 0.05, "stop.start": 0.06, "stop.time": 0.02,
    "torque.drive": 700.0, "gear.ratio": 1.3, "brake.torque": 900.0, "brake.speed": 0.2,
    "controller.proportional": 5000.0, "controller.integral": 9000.0, "torque.limit": 4000.0,
}  # fmt: skip
LAWS = {f"contact.{pair}.{key}": value for pair in ("sprocket", "wheel", "ground")
        for key, value in {"damping": 900.0, "friction": 0.35, "friction_velocity": 0.03}.items()}  # fmt: skip
OTHERS = {  # other values of all free parameters, by kind
    "SprocketDrive": {
        **PLACE, **MOTOR, "start.lateral": 0.1, "start.angle": 0.3, "mode": "controller", "extrapolation": "velocity",
        "demand.lag": 0.2,
    },
    "SteeringDifferential": {
        **PLACE, **{f"{shaft}.{name}": value for shaft in ("propulsion", "steering") for name, value in MOTOR.items()},
        "start.angle": 0.3, "steering.mode": "torque", "extrapolation": "velocity",
    },
    "Chassis": {**PLACE, "step": 4e-4, "suspension.preload": 9e3, "tensioner.preload": 2.1e4},
    "Driver": {
        **PLACE, "heading": 0.2, "speed.start": 1.0, "speed.end": 2.0, "ramp.start": 0.01, "ramp.end": 0.05,
        "deceleration": 0.8, "reach": 2.5, "preview": 1.2, "curvature.largest": 0.4, "acceleration.lateral": 0.9,
        "heading.gain": 1.1, "yaw.gain": 0.9, "yaw.integral": 1.2, "width": 3.0, "friction": 0.5, "grip": 0.7,
        "drive.lag": 0.15, "path.tolerance": 0.15,
    },
    "TrackFlexible": {
        **PLACE, **LAWS, "start.lateral": -1.2, "step": 5e-4, "tolerance": 1e-8, "material.relaxation_time": 2e-4,
    },
    "TrackRigid": {**PLACE, **LAWS, "start.lateral": -1.2, "step": 5e-4},
}  # fmt: skip


def test_every_kind_of_component_is_among_the_cases():
    assert set(OTHERS) == set(KINDS)
    parts = ((case, part) for case in (*FEW, *MANY) for part in assemble(load(*case[:2], case.settings)).parts)
    assert {part.kind for case, part in parts if part.name == case.part} == set(KINDS)


def others(case):
    """Other values of all free parameters of a part."""
    part = ran(case).part
    constant = with_constants(part.kind, part.config, dict(part.parameters) | OTHERS[part.kind])["parameters"]
    known = {port.name for port in ran(case).member.model.ports}
    return {name: value for name, value in OTHERS[part.kind].items() if name not in constant and name in known}


def assert_free(case):
    """Assert that an FMU with other parameters set equals a model that was initialised with them."""
    run, parameters = ran(case), others(case)
    assert len(parameters) > 5
    model = type(run.member.model)(run.part.config)
    own = {port.name: port.start for port in model.ports if port.causality == "parameter"} | run.part.parameters
    model.initialise(own | parameters)
    links = np.zeros(model.link_ports)
    with begun(case) as component:
        usual = component.y.copy()
        component.initialise(run.part.parameters | parameters)
        y = np.zeros_like(component.y)
        model.outputs(y)
        np.testing.assert_array_equal(component.y, y)
        assert not np.array_equal(y, usual)
        state = component.save()
        u = still(run, model, y)
        for k in range(20):
            model.step(k * H, H, u)
            model.outputs(y)
            model.link_outputs(links)
            component.u[:] = u
            component.write()
            component.step(k * H, H)
            component.read()
            component.read_links()
            np.testing.assert_array_equal(component.y, y)
            np.testing.assert_array_equal(component.y_links, links)
        content = component.dump(state)
        component.restore(state)
        with begun(case) as other:  # has other parameters until it restores the state
            other.restore(other.load(content))
            other.u[:] = u
            other.write()
            other.step(0.0, H)
            other.read()
            component.u[:] = u
            component.write()
            component.step(0.0, H)
            component.read()
            np.testing.assert_array_equal(other.y, component.y)
    assert all(own[name] != value for name, value in parameters.items())


def still(run, model, y):
    """Inputs of a part whose surroundings rest at its start position."""
    wheels = [port.name.rpartition(".position")[0] for port in model.ports
              if port.causality == "input" and port.name.endswith(".position.x")]  # fmt: skip
    if run.part.kind.startswith("Track"):
        x, z = np.array([wheel["position"] for wheel in model.wheel_list]).T
        return np.concatenate([model.pose.point_at_rest(a, model.lateral, b) for a, b in zip(x, z, strict=True)])
    u = run.u[-1].copy()
    if wheels:  # a mount or a hull: near the output position
        u[:3] = y[:3]
    return u


@pytest.mark.long
@pytest.mark.parametrize("case", FEW[1:], ids=lambda case: f"{case.part}-{case.links}")
def test_free_parameters_act_as_in_the_model(case):
    assert_free(case)


@pytest.mark.study
@pytest.mark.parametrize("case", [case for case in MANY if case.part.endswith("track")], ids=str)
def test_free_parameters_of_tracks_act_as_in_the_model(case):
    assert_free(case)


@pytest.mark.parametrize(
    ("case", "parameters", "said"),
    [
        (DRIVE, {"brake.speed": 0.0}, r"brake\.speed = 0: must be greater than 0"),
        (DRIVE, {"ramp.end": -1.0}, r"ramp\.end = -1 s must not be before ramp\.start"),
        (DRIVE, {"start.angle": float("inf")}, r"start\.angle = inf: must be a finite number"),
        (CHASSIS, {"step": -2.5e-4}, r"step = -0\.00025: must be greater than 0"),
    ],
)
def test_what_free_parameters_cannot_be_is_refused_as_in_the_model(case, parameters, said):
    run = ran(case)
    with pytest.raises(InvalidParameter, match=said):
        type(run.member.model)(run.part.config).initialise(run.part.parameters | parameters)
    with Component(native(case), "part") as component, pytest.raises(ComponentFailed, match=said):
        component.initialise(run.part.parameters | parameters)


def test_choices_are_refused_by_what_there_is():
    said = r"mode = 'fast': must be one of speed, torque, controller"
    with Component(native(DRIVE), "part") as component, pytest.raises(ComponentFailed, match=said):
        component.initialise({"mode": "fast"})


@pytest.mark.parametrize("links", TRACKS)
def test_one_file_serves_both_sides(links):
    """One FMU serves both sides of a vehicle: tracks differ by lateral place, drives by speed."""
    parts = {part.name: part for part in assemble(placed(load("turn", links))).parts}
    for name in ("track", "drive"):
        left, right = (parts[f"{side}_{name}"] for side in ("left", "right"))
        assert left.parameters != right.parameters
        one, other = (with_constants(part.kind, part.config, part.parameters) for part in (left, right))
        assert one == other


def test_a_wrong_guid_is_refused():
    file = native(DRIVE)
    slave = FMU2Slave(guid="{0}", modelIdentifier="SprocketDrive", unzipDirectory=str(unpack(file)), instanceName="a")
    with pytest.raises(Exception, match="instantiate"):
        slave.instantiate()


@pytest.mark.long
def test_equal_sources_give_equal_bytes():
    part = ran(DRIVE).part
    config = with_constants(part.kind, part.config, part.parameters)
    one, other = (pack._pack(part.kind, config, "a") for _ in range(2))
    assert one == other
    assert one != pack._pack(part.kind, {**config, "parameters": {"speed.end": 3.0}}, "a")


@pytest.mark.study
@pytest.mark.parametrize("case", [FEW[0], FEW[2]], ids=lambda case: f"{case.part}-{case.links}")
def test_kernels_for_any_processor_give_the_bits_of_those_for_newer_ones(case, monkeypatch, tmp_path):
    """Kernels for any processor give the bits of those for newer ones.

    A library chooses when it is instantiated; one without a choice has the kernels for any processor.
    """
    run = ran(case)
    config = with_constants(run.part.kind, run.part.config, run.part.parameters)
    monkeypatch.setattr(link, "FLAGS", (*link.FLAGS, "-DONLY_ANY_PROCESSOR"))
    file = tmp_path / "any.fmu"
    file.write_bytes(pack._pack(run.part.kind, config, "any"))
    assert (unpack(file) / f"binaries/linux64/{run.part.kind}.so").read_bytes() != (
        unpack(native(case)) / f"binaries/linux64/{run.part.kind}.so"
    ).read_bytes()
    with Component(file, case.part) as component:
        component.initialise(run.part.parameters)
        y, links = follow(component, run, range(40))
    np.testing.assert_array_equal(y, run.y[:40])
    np.testing.assert_array_equal(links, run.links[:40])


@pytest.mark.study
def test_a_library_for_windows_needs_what_windows_has():
    pytest.importorskip("ziglang")
    part = ran(DRIVE).part
    content = pack._pack(part.kind, with_constants(part.kind, part.config, part.parameters), "a", (LINUX, WINDOWS))
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


def test_what_is_missing_is_a_sentence(monkeypatch):
    part = ran(DRIVE).part
    changed = {**part.config, "parameters": {"speed.end": 4.0}}
    with monkeypatch.context() as patch:
        patch.setattr(pack, "version", lambda name: "1.0")
        with pytest.raises(BuildFailed, match=r"made with numba 0\.6x, whose insides they know, not 1\.0"):
            build_native(part.kind, changed)
    monkeypatch.setattr(link, "find_spec", lambda name: None)
    with pytest.raises(BuildFailed, match="libraries for Windows need the compiler ziglang"):
        build_native(part.kind, changed, windows=True)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(BuildFailed, match=r"native FMUs need a C compiler: pip install 'cotrack\[native\]'"):
        build_native(part.kind, changed)
    with pytest.raises(BuildFailed, match="no kind of component is called 'Nothing'"):
        build_native("Nothing", {})
