"""Free parameters of native FMUs act as in the models that they are built from."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from logged import logged
from native_cases import CHASSIS, DRIVE, FEW, MANY, H, begun, ran, raw

from fmus.chassis.tree import BODY, WHOLE
from fmus.components import COMPONENT_KINDS, model_of
from fmus.fmi.build import packed_config
from fmus.ground.tables import number_meanings
from fmus.interface import numbers
from fmus.interface.defaults import configured_ports, parameter_values
from fmus.interface.ports import variables
from fmus.native.entries import free_names
from fmus.native.fmi3_description import arrays
from fmus.native.pack import build_native, with_constants
from fmus.start import part_at_rest
from fmus.track.choices import TRACKS
from fmus.track.ports import start_stance
from orchestrator.cosim.component import Component
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
    "torque.drive": 700.0, "gear.ratio": 1.3, "brake.torque": 900.0,
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
    assert set(OTHERS) == set(COMPONENT_KINDS)
    parts = ((case, part) for case in (*FEW, *MANY) for part in assemble(load(*case[:2], case.settings)).parts)
    assert {part.kind for case, part in parts if part.name == case.part} == set(COMPONENT_KINDS)


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
    of_tracks = told("in_your_tool.md", r"has (\d+) parameters \(flexible links\) or (\d+) \(rigid\)")
    assert [*map(int, of_tracks)] == [counts["TrackFlexible"], counts["TrackRigid"]]
    assert int(told("in_your_tool.md", r"a chassis has (\d+) in")) == counts["Chassis"]
    outputs = int(told("native/README.md", r"A track has (\d+) Real outputs"))
    assert outputs == arrayed["TrackFlexible"] == arrayed["TrackRigid"]
    named = re.findall(r"`([\w.]+)`", told("in_your_tool.md", r"native FMUs let you set (.*?), no more"))
    assert sorted(named) == sorted(free)


def free_values(case):
    """Other values of all free parameters of a part."""
    part = ran(case).part
    constant = with_constants(part.kind, part.config, dict(part.parameters) | OTHERS[part.kind])["parameters"]
    known = {port.name for port in ran(case).member.model.ports} | {*numbers.places(part.config)}
    return {name: value for name, value in OTHERS[part.kind].items() if name not in constant and name in known}


def stepped(component, u, t=0.0):
    """Outputs, those of links last, after a step with inputs ``u``."""
    component.u[:] = u
    component.write()
    component.step(t, H)
    component.read()
    component.read_links()
    return np.concatenate([component.y, component.y_links])


@pytest.mark.parametrize(
    "case",
    [*(pytest.param(case, marks=pytest.mark.long) for case in FEW[1:]),
     *(pytest.param(case, marks=pytest.mark.study) for case in MANY if case.part.endswith("track"))],
    ids=str,
)  # fmt: skip
def test_free_parameters_act_as_in_the_model(case):
    """An FMU with other parameters set equals a model that was initialised with them."""
    run, parameters = ran(case), free_values(case)
    assert len(parameters) > 5
    model = type(run.member.model)(numbers.with_values(run.part.config, parameters))
    own = {port.name: port.start for port in run.member.model.ports if port.causality == "parameter"}
    own |= numbers.values(run.part.config) | run.part.parameters
    assert all(own[name] != value for name, value in parameters.items())
    model.initialise(own | parameters)
    with begun(case) as component, begun(case) as other:
        usual, y, links = component.y.copy(), np.zeros_like(component.y), np.zeros(model.link_ports)
        component.initialise(run.part.parameters | parameters)
        model.outputs(y)
        np.testing.assert_array_equal(component.y, y)
        assert np.array_equal(y, usual) == ("start.position.x" not in parameters), "laws of contact act in steps alone"
        state, first = component.save(), []
        u = still(run, model, y, (own | parameters).get("start.lateral"))
        for k in range(20):
            model.step(k * H, H, u)
            model.outputs(y)
            model.link_outputs(links)
            first.append(stepped(component, u, k * H))
            np.testing.assert_array_equal(first[-1], np.concatenate([y, links]))
        other.restore(other.load(component.dump(state)))  # which had other parameters
        np.testing.assert_array_equal(stepped(other, u), first[0])


def still(run, model, y, lateral):
    """Inputs of a part whose surroundings rest at its start position."""
    if run.part.kind.startswith("Track"):
        motions = [np.array(part_at_rest(model.pose, start_stance(wheel))) for wheel in model.wheel_list]
        here, there = (np.array(model.pose.point_at_rest(0.0, aside, 0.0)[:3]) for aside in (0.0, lateral))
        for motion in motions:
            motion[:3] += there - here
        return np.concatenate(motions)
    u = run.u[-1].copy()
    if any(port.causality == "input" and port.name.endswith(".position.x") for port in model.ports):
        u[:3] = y[:3]  # a mount or a hull: near the output position
    return u


@pytest.mark.long
@pytest.mark.parametrize("factor", [1.0, 1.05])
def test_a_mass_that_is_set_alone_is_said_once(factor):
    """More mass m on the springs of the start falls with m g over the mass of the hull, to which leaves add a part."""
    run = ran(CHASSIS._replace(settings=("run.stop=1 s", "run.step=1 ms"), steps=3))  # on level ground
    mass = {"chassis.mass": factor * numbers.values(run.part.config)["chassis.mass"]}
    model = type(run.member.model)(numbers.with_values(run.part.config, mass))
    model.initialise(run.part.parameters)
    file = build_native(run.part.kind, with_constants(run.part.kind, run.part.config, run.part.parameters))
    with logged() as messages, Component(file, "chassis") as component:
        component.initialise(run.part.parameters | mass)
        for k in range(3):
            model.step(k * H, H, run.u[k])
            stepped(component, run.u[k], k * H)
    warnings, tree = model.warnings(), model.tree
    assert [f"chassis: {warning}" for warning in warnings] == messages
    assert len(warnings) == (factor != 1.0)
    for warning in warnings:
        push = (1.0 - 1.0 / factor) * mass["chassis.mass"] * tree.gravity[0]
        said = float(re.search(r"the hull rises or falls with (\S+) m/s2", warning)[1])
        assert push / tree.masses[WHOLE] < said < push / tree.masses[BODY]


def test_a_refused_call_sets_none_of_its_texts():
    with raw(DRIVE) as (slave, variables):
        both = [variables[name].valueReference for name in ("mode", "extrapolation")]
        before = slave.getString(both)
        with pytest.raises(FMICallException):
            slave.setString(both, ["torque", "none such"])
        assert slave.getString(both) == before != [b"torque", b"velocity"]
        slave.setString(both, ["torque", "velocity"])
        assert slave.getString(both) == [b"torque", b"velocity"]


@pytest.mark.parametrize("links", TRACKS)
def test_one_file_serves_both_sides(links):
    """One FMU serves both sides of a vehicle: tracks differ by lateral place, drives by speed."""
    parts = {part.name: part for part in assemble(placed(load("turn", links))).parts}
    for name in ("track", "drive"):
        left, right = (parts[f"{side}_{name}"] for side in ("left", "right"))
        assert left.parameters != right.parameters
        one, other = (with_constants(part.kind, part.config, part.parameters) for part in (left, right))
        assert one == other
