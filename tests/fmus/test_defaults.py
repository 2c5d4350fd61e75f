"""Defaults of an FMU's parameters and inputs."""

import json
from functools import cache

import named_ports
import numpy as np
import pytest
from built_toy import build_toy

from fmus.driver.model import Model as Driver
from fmus.fmi.description import bounds
from fmus.interface.model import StepFailed
from fmus.sprocket_drive.model import Model as Drive
from fmus.steering_differential.model import Model as Differential
from fmus.track_rigid.model import Model as RigidTrack
from orchestrator.cosim.component import Component
from orchestrator.scene.assembly import assemble
from orchestrator.scene.keys import scene_keys
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load

H = 1e-3
DRIVE = {"inertia": 2.0, "mount": [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]}
PLACE = {"start.position.x": 3.0, "start.position.y": -2.0, "start.heading": 0.7, "start.pitch": 0.2}


def starts(component):
    return {v.name: v.start for v in component.description.modelVariables if v.causality == "parameter"}


def trace(component, parameters):
    component.initialise(parameters)
    rows = []
    for k in range(5):
        component.step(k * H, H)
        component.read()
        rows.append(component.y.copy())
    return np.array(rows)


@pytest.mark.long
def test_parameters_of_a_config_are_the_defaults_of_its_fmu(toy):
    given = {"start.x": 0.1 + 0.2, "stiffness": 130, "substeps": 7, "trouble": "warn"}
    with Component(build_toy(parameters=given), "toy") as own, Component(toy, "toy") as plain:
        assert starts(own) == {
            "start.x": "0.30000000000000004", "stiffness": "130.0", "damping": "0.1", "substeps": "7",
            "trouble": "warn",
        }  # fmt: skip
        assert np.array_equal(trace(own, {}), trace(plain, given))
        assert not np.array_equal(trace(own, {}), trace(plain, {**given, "stiffness": 133}))
        assert np.array_equal(trace(own, {"stiffness": 133}), trace(plain, {**given, "stiffness": 133}))


@cache
def part(scene, name):
    return next(part for part in assemble(placed(load(scene, "rigid"))).parts if part.name == name)


def unconnected(model, parameters, shift=0.0, blank=()):
    """Outputs after ten steps with the declared inputs; ``shift`` moves the first connector's x, m.

    In the steps ``blank`` all inputs are zero.
    """
    model.initialise(named_ports.parameters(model, **parameters))
    u = np.array([port.start for port in model.ports if port.causality == "input"])
    u[0] += shift
    for k in range(10):
        model.step(k * H, H, 0.0 * u if k in blank else u)
    return named_ports.outputs(model, links=False)


@pytest.mark.parametrize("lateral", [1.0795, -1.0795])
def test_a_track_that_nothing_moves_stays_on_its_wheels(lateral):
    """A track whose wheels do not move stays on them, wherever its configuration places it."""
    own = {**PLACE, "start.lateral": lateral}
    drawn = unconnected(RigidTrack(part("rig", "track").config), {})
    model = RigidTrack(part("rig", "track").config | {"parameters": own})
    outputs, off = unconnected(model, own), unconnected(model, own, 1e-3)
    assert 1.4e4 < drawn["tension.mean"] < 1.6e4
    for name in ("tension.mean", "tension.max", "energy.contact"):
        assert outputs[name] == pytest.approx(drawn[name], rel=1e-6)
        assert off[name] != pytest.approx(drawn[name], rel=1e-3)


PARTS = {
    "track": (RigidTrack, "rig", "sprocket"), "drive": (Drive, "rig", "mount"),
    "differential": (Differential, "differential", ""), "driver": (Driver, "serpentine", ""),
}  # fmt: skip


@pytest.mark.parametrize("name", ["drive", "track"])
def test_declared_motions_of_inputs_are_those_of_the_configured_start(name):
    kind, scene, connector = PARTS[name]
    own = {**part(scene, name).parameters, **PLACE, "start.lateral": -1.0795}
    config = json.loads(json.dumps(part(scene, name).config | {"parameters": own}))
    declared = {port.name: port.start for port in kind(config).ports}
    c, s = np.cos(0.7), np.sin(0.7)
    assert declared[f"{connector}.position.x"] == pytest.approx(3.0 + s * 1.0795)
    assert declared[f"{connector}.position.y"] == pytest.approx(-2.0 - c * 1.0795)
    assert declared[f"{connector}.orientation.w"] == pytest.approx(np.cos(0.35) * np.cos(0.1))
    assert declared[f"{connector}.orientation.y"] == pytest.approx(np.cos(0.35) * np.sin(0.1))


@pytest.mark.parametrize("name", PARTS)
def test_zeros_before_the_first_exchange_are_no_motion(name):
    """Tools that exchange after their first step begin with zeros: the part stays where it starts, at its own place."""
    model, scene, _ = PARTS[name]
    own = {**part(scene, name).parameters, **PLACE}
    config = part(scene, name).config | {"parameters": own}
    outputs = unconnected(model(config), own)
    assert unconnected(model(config), own, blank=(0,)) == pytest.approx(outputs, rel=1e-6, abs=1e-8)
    with pytest.raises(StepFailed, match="is no rotation"):
        unconnected(model(config), own, blank=(1,))


def test_a_drive_that_nothing_moves_is_a_fixed_axle_on_either_side():
    model = Drive(part("rig", "drive").config | {"parameters": {"start.lateral": 1.0795}})
    assert unconnected(model, {})["sprocket.position.y"] == 1.0795
    assert unconnected(model, {"start.lateral": -1.0795})["sprocket.position.y"] == -1.0795


@pytest.mark.parametrize(
    ("key", "name"),
    [
        ("start.position", "start.position.y"), ("start.height", "start.height"), ("drive.speed", "speed.end"),
        ("drive.torque", "torque.drive"), ("drive.brake", "brake.torque"), ("drive.ramp_start", "ramp.start"),
        ("drive.stop_time", "stop.time"), ("drive.gear_ratio", "gear.ratio"),
    ],
)  # fmt: skip
def test_parameters_have_the_ranges_of_their_keys(key, name):
    allowed = next(each.allowed for each in scene_keys() if each.key == key)
    (port,) = (port for port in Drive({"drive": DRIVE}).ports if port.name == name)
    least, most, _ = port.allowed
    both = f"{least:g} to {most:g}" if np.isfinite(most) else ">= 0" if least == 0.0 else "> 0"
    assert both in allowed
    said = {side: float(text) for side, text in bounds(port).items()}
    assert said == {"min": 0.0 if least > -1.0 else least, **({"max": most} if np.isfinite(most) else {})}
