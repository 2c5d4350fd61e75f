"""Verdict on one run, one of ``VERDICTS``, from its end, its ledger and one expectation.

Expectations for runs of extreme cases are value, expected value and tolerance, by name.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq

from fmus.fmi.build import BuildFailed
from fmus.vehicles.sides import way_a_turn
from fmus.vehicles.tables import BadInput
from orchestrator.execution.simulate import simulate
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.log.reader import Log, Missing
from orchestrator.results import chain_measures, vehicle_measures
from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.scene.kinds import ChainScene, RigScene, Scene, VehicleScene
from orchestrator.studies import Row
from orchestrator.vocabulary.limits import ALLOWED, LARGEST_RESIDUAL

Expectation = tuple[float, float, float]  # value, expected, tolerance


def _last(run: RunData, seconds: float = 1.0) -> Window:
    end = min(float(run.log.read(f"/{name}/out").t[-1]) for name in run.instances)
    return Window(max(0.0, end - seconds), end)


def weight(run: RunData, scene: VehicleScene, within: float = 0.03) -> Expectation:
    """Ground reaction: mean of the last second against the weight, N."""
    heavy = vehicle_measures.weight(run, "", EVER)
    return vehicle_measures.ground_force(run, "", _last(run)), heavy, within * heavy


def afloat(run: RunData, scene: Scene) -> Expectation:
    """Drift without gravity: largest settlement, m; the tracks push the hull slowly when they settle."""
    return float(abs(run.signal("chassis.settlement")[1]).max()), 0.0, 0.05


def speed(run: RunData, scene: Scene) -> Expectation:
    """Vehicle speed over pins a turn x pitch x omega / 2 pi, less 1, mean of the last half second."""
    return vehicle_measures.speed_excess(run, "", _last(run, 0.5)), 0.02, 0.04


def stays(run: RunData, scene: Scene) -> Expectation:
    """Mean speed without ground friction, m/s: the vehicle only rocks in place."""
    return run.mean("chassis.speed", _last(run)), 0.0, 0.03


def sliding(run: RunData, scene: VehicleScene) -> Expectation:
    """Deceleration with locked sprockets against friction times gravity, m/s2."""
    t, v = run.signal("chassis.speed", Window(float(scene.drive.stop or 0.0) + 0.3, scene.run.stop))
    moving = v > 0.3
    expected = scene.vehicle.contact.ground.friction * scene.vehicle.gravity
    return float(-np.polyfit(t[moving], v[moving], 1)[0]), expected, 0.1 * expected


def uphill(run: RunData, scene: VehicleScene) -> Expectation:
    """Force of the ground up the slope, mean of the last second, N: W sin(slope); the hull still surges."""
    assert scene.ground.grade
    expected = vehicle_measures.weight(run, "", EVER) * math.sin(math.atan(scene.ground.grade))
    return vehicle_measures.uphill_force(run, "", _last(run)), expected, 0.02 * expected


def climbs(run: RunData, scene: VehicleScene) -> Expectation:
    """Rise of the hull over an obstacle, m, against the obstacle's height; 0 if it does not get across.

    The centre of mass rises by most of the height, or more if the nose rears up.
    """
    assert scene.ground.bump
    rise = scene.ground.bump.rise
    across = float(run.signal("chassis.distance")[1][-1]) > scene.ground.bump.start + 2.0
    return (float(-run.signal("chassis.settlement")[1].min()) if across else 0.0), rise, 0.35 * rise


def at_rest(run: RunData, scene: VehicleScene) -> Expectation:
    """Ground reaction of a vehicle that has come to rest, but for the last oscillation of contacts, N."""
    return weight(run, scene, 0.06)


def sag(run: RunData, scene: ChainScene) -> Expectation:
    """Sag of the discrete catenary of rigid links, m: tan(angle) = weight from the middle over pull."""
    n, pitch = scene.chain.links, scene.vehicle.track.pitch
    from_middle = np.arange(n) - 0.5 * (n - 1)
    pull = brentq(
        lambda w: np.cos(np.arctan(from_middle / w)).mean() - scene.chain.span, 1e-3 * n, 10.0 * n
    )  # weights of a link
    depth = pitch * np.sin(np.arctan(from_middle / pull))[from_middle > 0].sum()
    return chain_measures.sag(run, "", _last(run)), float(depth), 2e-3 * float(depth)


def hoop(run: RunData, scene: ChainScene) -> Expectation:
    """Pin force of a free loop of rigid links, N: m omega^2 Rc / (2 sin(pi/N)), Rc = p / (2 tan(pi/N))."""
    track, half = scene.vehicle.track, math.pi / scene.chain.links
    force = track.mass * scene.chain.spin**2 * track.pitch / (4.0 * math.tan(half) * math.sin(half))
    return chain_measures.joint_force(run, "", _last(run)), force, 1e-3 * force


def rides(run: RunData, scene: RigScene) -> Expectation:
    """Chain speed over pins a turn x pitch x omega / 2 pi, over the last turn."""
    pace = way_a_turn(scene.vehicle.model_dump()) / (2.0 * math.pi)
    window = _last(run, 2.0 * math.pi / scene.drive.speed)
    return run.mean("track.speed", window) / (pace * run.mean("drive.speed", window)), 1.0, 0.005


def ledger(run: RunData, scene: Scene) -> Expectation:
    """No expectation besides the energy ledger, which closes to 5 %."""
    return 0.0, 0.0, 0.0


EXPECTATIONS: dict[str, tuple[Callable[[RunData, Any], Expectation], str]] = {  # each fits scenes of its own kind
    "weight": (weight, "ground reaction, last second, N: the weight, 3 %"),
    "afloat": (afloat, "largest way up or down, m: 0 to 0.05"),
    "speed": (speed, "speed over that of the sprocket, less 1, last 0.5 s"),
    "stays": (stays, "mean speed of the last second, m/s: 0"),
    "sliding": (sliding, "deceleration of the locked vehicle, m/s2: friction x gravity, 10 %"),
    "uphill": (uphill, "ground force up the slope, last second, N: W sin(slope), 2 %"),
    "climbs": (climbs, "rise of the centre of mass, m: that of the obstacle, 35 %"),
    "at_rest": (at_rest, "ground reaction, last second, N: the weight, 6 %"),
    "sag": (sag, "sag, m: that of the discrete catenary, 0.2 %"),
    "hoop": (hoop, "force in the pins, N: m omega^2 Rc / (2 sin(pi/N)), 0.1 %"),
    "rides": (rides, "chain speed over pins a turn x pitch x omega / 2 pi, last turn: 1, 0.5 %"),
    "ledger": (ledger, "the energy ledger closes"),
}


RIGHT, WRONG, CLEAN, BLOWN, MUTE = VERDICTS = (
    "stable and right", "stable and wrong", "failed cleanly", "blown up", "no sentence"
)  # fmt: skip
REFUSED = (BadInput, BuildFailed, ComponentFailed)
WITHOUT_VERDICT = {
    "verdict": MUTE,
    "sensible": True,
    "asked": "an end",
    "seconds": 0.0,
}  # sentences for cases without one of their own


def with_verdict(row: Row, verdict: str, note: str) -> Row:
    """Set the verdict of a row: one that is not right needs a sentence; a realistic case must be right."""
    if not note and verdict != RIGHT:
        verdict = MUTE
    ok = verdict == RIGHT or (verdict != MUTE and not row.figures.get("sensible", True))
    return replace(row.with_figures(verdict=verdict), ok=ok, note=" ".join(note.split()))


def judged_run(scene: Scene, expectation: str, row: Row | None = None) -> Row:
    """Run a scene and judge it; only the row is kept, with its earlier figures."""
    began = time.perf_counter()
    row = (row or Row("", "")).with_figures(asked=EXPECTATIONS[expectation][1])
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        row = _judged_log(scene, expectation, row, Path(folder) / "run.mcap")
    return row.with_figures(seconds=time.perf_counter() - began)


def _judged_log(scene: Scene, expectation: str, row: Row, path: Path) -> Row:
    try:
        run = scene.run.model_copy(update={"allow": ALLOWED})  # the question is what integrators bear
        result = simulate(scene.model_copy(update={"expect": {}, "run": run}), path, raise_faults=True)
    except REFUSED as refusal:
        return with_verdict(row, CLEAN, str(refusal))
    if result["communication_steps"]:
        with Log(path) as log:
            data = RunData(log)
            if not all(np.isfinite(log.read(f"/{name}/out").values).all() for name in data.instances):
                return with_verdict(row, BLOWN, result["message"] or "a recorded output is not finite")
            row = row.with_figures(open=(result["energy"] or {}).get("residual_relative", math.nan))
            if result["status"] == "ok":
                try:
                    value, expected, tolerance = EXPECTATIONS[expectation][0](data, scene)
                except Missing as missing:
                    return with_verdict(row, WRONG, str(missing))
                row = row.with_figures(found=value, expected=expected, tolerance=tolerance)
    if result["status"] != "ok":
        return with_verdict(row, CLEAN, result["message"])
    if abs(row["open"]) > LARGEST_RESIDUAL:
        return with_verdict(row, BLOWN if abs(row["open"]) > 1.0 else WRONG, result["message"])
    if not abs(row["found"] - row["expected"]) <= row["tolerance"]:
        deviation = f"{row['found']:.4g} instead of {row['expected']:.4g} +- {row['tolerance']:.2g}"
        return with_verdict(row, WRONG, f"{row['asked'].split(':')[0]}: {deviation}")
    return with_verdict(row, RIGHT, result["message"])
