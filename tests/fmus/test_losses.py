"""Dissipation of a track by cause: each cause alone, with a known amount."""

from __future__ import annotations

from functools import cache

import pytest
from vehicle_in_process import InProcess

from orchestrator.scene.scene import load

PREFIX = "energy.dissipated."
PARAMETERS = {  # by cause: parameters that make it the only one
    "ground_friction": "contact.ground.friction", "ground_damping": "contact.ground.damping",
    "wheel_friction": "contact.wheel.friction", "wheel_damping": "contact.wheel.damping",
    "tooth_friction": "contact.sprocket.friction", "tooth_damping": "contact.sprocket.damping",
}  # fmt: skip
DRIVE = "drive.ramp_start=0 s", "drive.ramp_time=0.1 s", "drive.speed=6 rad/s", "run.step=1 ms", "symmetric=true"


@cache
def scene():
    return load("straight", "rigid", [*DRIVE, "track.link_outputs=false"])


def losses(track) -> dict[str, float]:
    return {name.removeprefix(PREFIX): track[name] for name in track.outputs if name.startswith(PREFIX)}


def driven(**parameters: float):
    return InProcess(scene(), {"*_track": parameters}).run(0.05)["left_track"]


def test_causes_add_up_and_all_contacts_lose():
    track = driven()
    by_cause = losses(track)
    assert sum(by_cause.values()) == pytest.approx(track["energy.dissipated"], rel=1e-12)
    assert all(by_cause[cause] > 1e-3 for cause in PARAMETERS)
    assert [by_cause[cause] for cause in ("guides", "material", "joints")] == [0.0, 0.0, 0.0]
    for cause in PARAMETERS:
        others = sum(lost for name, lost in by_cause.items() if name != cause)
        assert others != pytest.approx(track["energy.dissipated"], rel=1e-6), cause


@pytest.mark.parametrize("cause", PARAMETERS)
def test_without_its_cause_a_loss_is_nothing_and_the_others_stay(cause):
    by_cause = losses(driven(**{PARAMETERS[cause]: 0.0}))
    lost = by_cause.pop(cause)
    # a face that separates fast takes the energy of its spring with it, with or without a damper
    assert lost == 0.0 if cause.endswith("friction") else abs(lost) < 1e-2 * sum(by_cause.values())
    assert all(by_cause[other] > 1e-3 for other in by_cause if other in PARAMETERS)


@pytest.mark.parametrize(("friction", "right"), [(0.3, True), (0.31, False)])
def test_a_locked_track_that_is_dragged_loses_friction_times_load_times_way(friction, right):
    """A locked track that is dragged loses friction x load x distance.

    The wheels press it 1 cm into the ground, move at 1 m/s and do not turn.
    """
    track, speed, h = InProcess(scene(), {"*_track": {"contact.ground.friction": friction}})["left_track"], 1.0, 1e-3
    u, deep = track.u.copy(), 0.01
    x, z = ([name.endswith(f".position.{axis}") for name in track.inputs] for axis in "xz")
    vx, vz = ([name.endswith(f".velocity.{axis}") and "angular" not in name for name in track.inputs] for axis in "xz")
    load_times_way = lost = 0.0
    for k in range(400):
        before = track[f"{PREFIX}ground_friction"]
        track.u[x], track.u[vx] = u[x] + speed * h * k, speed
        track.u[z], track.u[vz] = u[z] - deep * min(k / 100, 1.0), -deep / (100 * h) if k < 100 else 0.0
        track.step(k * h, h)
        if k >= 300:
            load_times_way += h * speed * track["ground.force.z"]
            lost += track[f"{PREFIX}ground_friction"] - before
    assert load_times_way > 3e3
    assert (lost == pytest.approx(0.3 * load_times_way, rel=4e-3)) == right
