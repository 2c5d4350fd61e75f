"""Runs outside the range of their model say so: reversals, and random plausible settings of a vehicle on rigid links.

A run with such settings either exceeds a limit of the validity ledger, or warns otherwise, or agrees with the run at
half its step within ``AGREES`` in every observable but peaks.
"""

import math

import numpy as np
import pytest

from orchestrator.execution import summary
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results.run_data import RunData, Window
from orchestrator.scene.scene import load

HALF = ("symmetric=true", "expect={}", "run.stop=2.2 s")


@pytest.mark.study
@pytest.mark.parametrize("time", [0.01, 0.2])
def test_a_reversal_fails_or_warns(tmp_path, time):
    """From 20 to -20 rad/s within 0.01 s: pins 82 mm deep in the teeth, and a chain that jumps; in 0.2 s 33 mm."""
    points = [[0, 0], [1.0, 20], [1.5, 20], [1.5 + time, -20]]
    result = simulate(load("straight", "rigid", (*HALF, f"drive.speed_points={points}")), tmp_path / "a.mcap")
    failures, warnings = (
        {entry["what"] for entry in result["validity"] if entry["severity"] == severity}
        for severity in ("failure", "warning")
    )
    if time > 0.1:
        assert (result["status"], result["message"], failures) == ("ok", "", set())
        assert "penetration" in warnings
        return
    assert (result["status"], failures) == ("failed", {"penetration", "tooth_jump"})
    assert max(entry["value"] for entry in result["validity"] if entry["what"] == "penetration") > 0.058
    assert all(1.5 < entry["time"] < 1.75 for entry in result["validity"] if entry["severity"] == "failure")


SEED, COUNT = 34, 60
STOP = 1.2  # s
AGREES = 0.1
# smallest reference of a relative difference; the largest tensions are peaks
FLOORS = {
    "distance": 0.1, "speed": 0.1, "settlement": 0.01, "ground_force": 1e4, "slip": 0.1, "tension_mean": 1e3,
}  # fmt: skip


def settings_of(k):
    """Settings of case ``k``: masses, stiffness, damping, friction, tension, step and drive."""
    rng = np.random.default_rng([SEED, k])
    vehicle = load("straight").vehicle

    def about(low, high):
        return math.exp(rng.uniform(math.log(low), math.log(high)))

    hull, link = about(0.5, 1.6), about(0.7, 1.5)
    settings = {
        "vehicle.chassis.mass": hull * vehicle.chassis.mass,
        "vehicle.chassis.inertia": [hull * inertia for inertia in vehicle.chassis.inertia],
        "vehicle.track.mass": link * vehicle.track.mass,
        "vehicle.track.inertia": [link * inertia for inertia in vehicle.track.inertia],
        "vehicle.track.tension": round(about(9e3, 25e3), -1),
        "vehicle.suspension.stiffness": about(0.5, 2.0) * vehicle.suspension.stiffness,
        "vehicle.suspension.damping": about(0.5, 2.0) * vehicle.suspension.damping,
        "vehicle.contact.ground.friction": rng.uniform(0.2, 0.9),
        "vehicle.contact.ground.friction_velocity": about(0.005, 0.03),
    }
    for pair in ("sprocket", "wheel", "ground"):
        law = getattr(vehicle.contact, pair)
        settings[f"vehicle.contact.{pair}.stiffness"] = about(0.3, 10.0) * law.stiffness
        settings[f"vehicle.contact.{pair}.damping"] = about(0.5, 2.0) * law.damping
    step = float(rng.choice([0.5, 1.0, 1.25, 2.0, 4.0]))
    settings |= {"run.step": step * 1e-3, "track.step": step * float(rng.choice([0.5, 1.0])) * 1e-3}
    return [*(f"{key}={value}" for key, value in settings.items()), *drive(rng)]


def drive(rng):
    """Settings of a drive: half-cosine ramp, ramp and reversal, or torque and brake."""
    speed = float(rng.uniform(3.0, 20.0)) * float(rng.choice([-1.0, 1.0]))
    kind = rng.choice(["ramp", "reversal", "torque"], p=[0.6, 0.2, 0.2])
    rise = float(rng.uniform(0.3, 1.0))
    if kind == "ramp":
        return [f"drive.speed={speed}", "drive.ramp_start=0.1", f"drive.ramp_time={rise}"]
    if kind == "reversal":
        back = 0.7 + float(rng.uniform(0.02, 0.4))
        points = [[0.1, 0.0], [0.1 + 0.5 * rise, speed], [0.7, speed], [back, -speed]]
        return [f"drive.speed_points={points}"]
    torque = float(rng.uniform(2e3, 15e3)) * float(rng.choice([-1.0, 1.0]))
    brake = float(rng.uniform(2e3, 20e3))
    points = [[0.1, 0.0], [0.2, torque], [0.7, torque], [0.71, 0.0]]
    brakes = [[0.75, 0.0], [0.8, brake]]
    return ["drive.mode=torque", "drive.speed=0", f"drive.torque_points={points}", f"drive.brake_points={brakes}"]


def scene(k, halved):
    """Scene of case ``k``; ``halved``: with half of both steps."""
    settings = settings_of(k)
    whole = load("straight", "rigid", [f"run.stop={STOP}", "symmetric=true", "expect={}", *settings])
    if not halved:
        return whole
    run = whole.run.model_copy(update={"step": 0.5 * whole.run.step})
    track = whole.track.model_copy(update={"step": 0.5 * whole.track.step})
    return whole.model_copy(update={"run": run, "track": track})


@pytest.mark.study
@pytest.mark.parametrize("case", range(COUNT))
def test_settings_warn_or_agree_with_half_the_step(case, tmp_path):
    results, observed, path = [], [], tmp_path / "run.mcap"
    for halved in (False, True):
        results.append(simulate(scene(case, halved), path))
        if results[-1]["status"] == "ok" or results[-1]["observables"]:
            with Log(path) as log:  # slip as a velocity, m/s: a ratio means nothing in a reversal
                slip = RunData(log).mean("left_track.slip", Window(STOP - summary.LAST, STOP))
            observed.append({**results[-1]["observables"], "slip": slip})
        path.unlink()
    if any(results[0][said] for said in ("validity", "warnings", "message")):
        return
    whole, half = observed
    off = {
        name: abs(whole[name] - half[name]) / max(abs(half[name]), floor)
        for name, floor in FLOORS.items()
        if name in whole
    }
    assert max(off.values()) <= AGREES, off
