"""Random plausible settings of a vehicle on rigid links: each runs as it is, then with half the step.

A run either exceeds a limit of the validity ledger, or warns otherwise, or agrees with the run at half its step within
``AGREES`` in every observable but peaks.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.execution import summary
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results.run_data import RunData, Window
from orchestrator.scene.kinds import Scene
from orchestrator.scene.scene import load

SEED, COUNT = 34, 60
STOP = 1.2  # s
AGREES = 0.1
# smallest reference of a relative difference; the largest tensions are peaks
FLOORS = {
    "distance": 0.1, "speed": 0.1, "settlement": 0.01, "ground_force": 1e4, "slip": 0.1, "tension_mean": 1e3,
}  # fmt: skip


def settings_of(k: int) -> list[str]:
    """Settings of case ``k``: masses, stiffness, damping, friction, tension, step and drive."""
    rng = np.random.default_rng([SEED, k])
    vehicle = load("straight").vehicle  # type: ignore[attr-defined]

    def about(low: float, high: float) -> float:
        return float(math.exp(rng.uniform(math.log(low), math.log(high))))

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
    return [*(f"{key}={value}" for key, value in settings.items()), *_drive(rng)]


def _drive(rng: np.random.Generator) -> list[str]:
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


def scene(k: int, halved: bool) -> Scene:
    """Scene of case ``k``; ``halved``: with half of both steps."""
    settings = settings_of(k)
    whole = load("straight", "rigid", [f"run.stop={STOP}", "symmetric=true", "expect={}", *settings])
    if not halved:
        return whole
    run = whole.run.model_copy(update={"step": 0.5 * whole.run.step})
    track = whole.track.model_copy(update={"step": 0.5 * whole.track.step})  # type: ignore[attr-defined]
    return whole.model_copy(update={"run": run, "track": track})


def observables(path: Path, result: dict[str, Any]) -> dict[str, float]:
    """Observables of a run, with slip as a velocity, m/s (a ratio means nothing in a reversal)."""
    with Log(path) as log:
        run = RunData(log)
        slip = run.mean("left_track.slip", Window(STOP - summary.LAST, STOP))
    return {name: value for name, value in result["observables"].items() if name in FLOORS} | {"slip": slip}


def compare_with_half_step(k: int, folder: Path) -> dict[str, Any]:
    """Messages of case ``k``, and its largest difference from the run with half the step, by observable."""
    results = []
    for halved in (False, True):
        path = folder / f"{k}-{halved}.mcap"
        results.append(simulate(scene(k, halved), path))
        if results[-1]["status"] == "ok" or results[-1]["observables"]:
            results[-1]["observed"] = observables(path, results[-1])
        path.unlink()
    whole, half = results
    differences = {
        name: abs(value - half["observed"][name]) / max(abs(half["observed"][name]), FLOORS[name])
        for name, value in whole.get("observed", {}).items()
        if "observed" in half
    }
    entries = [(entry["what"], entry["severity"], entry["value"], entry["limit"]) for entry in whole["validity"]]
    kinds = sorted({(entry["what"], entry["severity"]) for entry in whole["validity"]})
    return {
        "case": k,
        "said": kinds,
        "entries": entries,
        "warnings": [warning["text"] for warning in whole["warnings"]],
        "message": whole["message"],
        "off": differences,
        "steps": (scene(k, False).run.step, scene(k, False).track.step),  # type: ignore[attr-defined]
    }


def has_warning(result: dict[str, Any]) -> bool:
    """Whether a run reported a problem."""
    return bool(result["said"] or result["warnings"] or result["message"])


def row(result: dict[str, Any]) -> str:
    """Line of the table for a case."""
    worst = max(result["off"], key=lambda name: result["off"][name], default="")
    difference = f"{100 * result['off'][worst]:6.2f} % {worst}" if worst else "     - %"
    kinds = ", ".join(f"{what} {severity}" for what, severity in result["said"])
    steps = "/".join(f"{1e3 * step:g}" for step in result["steps"])
    return f"{result['case']:2d}  {steps:9}  {difference:22}  {kinds or '-'}  {'; '.join(result['warnings'])[:60]}"
