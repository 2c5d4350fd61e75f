"""Free parameters of native FMUs act as in the models that they are built from."""

from __future__ import annotations

import re
from ctypes import c_char_p, c_uint
from pathlib import Path

import numpy as np
import pytest
from native_cases import CHASSIS, DRIVE, FEW, MANY, H, begun, native, ran

from fmus.chassis.tree import BODY, WHOLE
from fmus.components import KINDS, model_of
from fmus.fmi.build import packed_config
from fmus.interface import numbers
from fmus.interface.defaults import configured_ports, parameter_values
from fmus.interface.model import InvalidParameter
from fmus.interface.ports import variables
from fmus.native.arrays import arrays
from fmus.native.entries import free_names
from fmus.native.pack import build_native, with_constants
from fmus.start import part_at_rest
from fmus.track.choices import TRACKS
from fmus.track.ports import start_stance
from fmus.vehicles.vehicle import number_meanings
from orchestrator.cosim.component import Component
from orchestrator.cosim.graph import ComponentFailed
from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.products import scene_products
from orchestrator.scene.scene import load

FMUS = Path(__file__).parents[2] / "fmus"
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
        "demand.lag": 0.2, "sprocket.spin_inertia": 15.0,
    },
    "SteeringDifferential": {
        **PLACE, **{f"{shaft}.{name}": value for shaft in ("propulsion", "steering") for name, value in MOTOR.items()},
        "start.angle": 0.3, "steering.mode": "torque", "extrapolation": "velocity",
    },
    "Chassis": {
        **PLACE, "step": 4e-4, "suspension.preload": 9e3, "tensioner.preload": 2.1e4, "hitch.load.force": 2e4,
        "hitch.load.ramp.start": 0.005, "hitch.load.ramp.end": 0.03, "gravity": 9.7, "chassis.mass": 5600.0,
        "chassis.inertia[1]": 1800.0, "chassis.inertia[2]": 10900.0, "chassis.inertia[3]": 11300.0,
        "sprocket.mass": 440.0, "sprocket.transverse_inertia": 9.0, "suspension.stiffness": 1.1e5,
        "suspension.damping": 9e3, "tensioner.stiffness": 1.1e6, "tensioner.damping": 1.2e4,
    },
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


def told(page, pattern):
    """Text of a page of ``fmus/``, unwrapped."""
    (found,) = re.findall(pattern, " ".join((FMUS / page).read_text(encoding="utf-8").split()))
    return found


def test_pages_say_how_many_parameters_there_are_and_which_are_free_natively():
    counts, arrayed, free = {}, {}, set()
    for kind, config, _ in scene_products([load("straight", model) for model in ("flexible", "rigid")]):
        packed = packed_config(kind, config)
        model = model_of(kind)(packed)
        own = numbers.ports(packed, number_meanings(), model.ports)
        ports = configured_ports((*model.ports, *own), packed)
        rows = [each.elements[0] for each in arrays(variables(model.ports).reals)]
        arrayed[kind] = sum(port.causality == "output" for port in rows)
        counts[kind] = sum(port.causality == "parameter" for port in ports)
        names = free_names(model.free_parameters(parameter_values(ports, {})))
        free |= {port.name.partition("[")[0] for port in own if port.name in names}
    assert [*map(int, told("README.md", r"has (\d+) parameters \(flexible links\) or (\d+) \(rigid\)"))] == [
        counts["TrackFlexible"], counts["TrackRigid"]]  # fmt: skip
    assert int(told("README.md", r"a chassis has (\d+) in")) == counts["Chassis"]
    assert (
        int(told("native/README.md", r"A track has (\d+) Real outputs"))
        == arrayed["TrackFlexible"]
        == arrayed["TrackRigid"]
    )
    named = re.findall(r"`([\w.]+)`", told("coupling.md", r"native FMUs let you set (.*?), no more"))
    assert sorted(named) == sorted(free)


def others(case):
    """Other values of all free parameters of a part."""
    part = ran(case).part
    constant = with_constants(part.kind, part.config, dict(part.parameters) | OTHERS[part.kind])["parameters"]
    known = {port.name for port in ran(case).member.model.ports} | {*numbers.places(part.config)}
    return {name: value for name, value in OTHERS[part.kind].items() if name not in constant and name in known}


def assert_free(case):
    """Assert that an FMU with other parameters set equals a model that was initialised with them."""
    run, parameters = ran(case), others(case)
    assert len(parameters) > 5
    model = type(run.member.model)(numbers.with_values(run.part.config, parameters))
    own = {port.name: port.start for port in run.member.model.ports if port.causality == "parameter"}
    own |= numbers.values(run.part.config) | run.part.parameters
    model.initialise(own | parameters)
    links = np.zeros(model.link_ports)
    with begun(case) as component:
        usual = component.y.copy()
        component.initialise(run.part.parameters | parameters)
        y = np.zeros_like(component.y)
        model.outputs(y)
        np.testing.assert_array_equal(component.y, y)
        assert np.array_equal(y, usual) == ("start.position.x" not in parameters), "laws of contact act in steps alone"
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
        motions = [np.array(part_at_rest(model.pose, start_stance(wheel))) for wheel in model.wheel_list]
        lateral = model.pose.point_at_rest(0.0, model._parameters["start.lateral"], 0.0)[:3]
        aside = np.array(lateral) - model.pose.point_at_rest(0.0, 0.0, 0.0)[:3]
        for motion in motions:
            motion[:3] += aside
        return np.concatenate(motions)
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
        (DRIVE, {"ramp.start": 0.5, "ramp.end": 0.2}, r"ramp\.end = 0\.2 s must not be before ramp\.start"),
        (DRIVE, {"ramp.end": -1.0}, r"ramp\.end = -1: must be 0 or more"),
        (DRIVE, {"start.angle": float("inf")}, r"start\.angle = inf: must be a finite number"),
        pytest.param(CHASSIS, {"step": -2.5e-4}, r"step = -0\.00025: must be greater than 0", marks=pytest.mark.long),
    ],
)
def test_what_free_parameters_cannot_be_is_refused_as_in_the_model(case, parameters, said):
    run = ran(case)
    with pytest.raises(InvalidParameter, match=said):
        type(run.member.model)(run.part.config).initialise(run.part.parameters | parameters)
    with Component(native(case), "part") as component, pytest.raises(ComponentFailed, match=said):
        component.initialise(run.part.parameters | parameters)


@pytest.mark.parametrize("factor", [1.0, 1.05])
def test_a_mass_that_is_set_alone_is_said_once(factor):
    """More mass m on the springs of the start falls with m g over the mass of the hull, to which leaves add a part."""
    run = ran(CHASSIS._replace(settings=("run.stop=1 s", "run.step=1 ms"), steps=3))  # on level ground
    mass = {"chassis.mass": factor * numbers.values(run.part.config)["chassis.mass"]}
    model, messages = type(run.member.model)(numbers.with_values(run.part.config, mass)), []
    model.initialise(run.part.parameters)
    file = build_native(run.part.kind, with_constants(run.part.kind, run.part.config, run.part.parameters))
    with Component(file, "chassis", lambda name, status, text: messages.append(text)) as component:
        component.initialise(run.part.parameters | mass)
        for k in range(3):
            model.step(k * H, H, run.u[k])
            component.u[:] = run.u[k]
            component.write()
            component.step(k * H, H)
            component.read()
    warnings, tree = model.warnings(), model.tree
    assert warnings == messages
    assert len(warnings) == (factor != 1.0)
    for warning in warnings:
        push = (1.0 - 1.0 / factor) * mass["chassis.mass"] * tree.gravity[0]
        said = float(re.search(r"the hull rises or falls with (\S+) m/s2", warning)[1])
        assert push / tree.masses[WHOLE] < said < push / tree.masses[BODY]


def test_choices_are_refused_by_what_there_is():
    said = r"mode = 'fast': must be one of speed, torque, controller"
    with Component(native(DRIVE), "part") as component, pytest.raises(ComponentFailed, match=said):
        component.initialise({"mode": "fast"})


def test_a_refused_call_sets_none_of_its_texts():
    with Component(native(DRIVE), "part") as component:
        places = [component._variables[name].valueReference for name in ("mode", "extrapolation")]

        def call(way, *texts):
            values = (c_char_p * 2)(*texts)
            function = getattr(component._library, f"fmi2{way}String")
            return function(component._handle, (c_uint * 2)(*places), 2, values), [*values]

        component.enter({})
        _, before = call("Get")
        other = [b"torque", b"velocity"]
        assert before != other
        assert call("Set", other[0], b"none such")[0] == 3
        assert call("Get") == (0, before)
        assert call("Set", *other)[0] == 0
        assert call("Get") == (0, other)


@pytest.mark.parametrize("h", [1.001e6, 1e300])
def test_a_step_that_is_too_long_is_refused(h):
    said = f"a step needs .* and at most 1e\\+06 s, not t = 0, h = {h:.9g}".replace("e+", r"e\+")
    with Component(native(DRIVE), "part") as component:
        component.initialise({})
        before = component.y.copy()
        with pytest.raises(ComponentFailed, match=said):
            component.step(0.0, h)
        component.read()
        assert np.array_equal(component.y, before)
        component.step(0.0, 1e6)


@pytest.mark.parametrize("links", TRACKS)
def test_one_file_serves_both_sides(links):
    """One FMU serves both sides of a vehicle: tracks differ by lateral place, drives by speed."""
    parts = {part.name: part for part in assemble(placed(load("turn", links))).parts}
    for name in ("track", "drive"):
        left, right = (parts[f"{side}_{name}"] for side in ("left", "right"))
        assert left.parameters != right.parameters
        one, other = (with_constants(part.kind, part.config, part.parameters) for part in (left, right))
        assert one == other
