"""Fits of known numbers: five numbers of a vehicle from the signals of its own run with noise of 1 %.

The truth, noise included, is ours, so a fit must find it within its errors. Linear theory: draws of noise e move
the numbers by inv(J'J) J'e with the Jacobian at the truth. Whole fits from a start that is 3 to 30 % off: the sum of
the squares of the deviations in units of the standard errors is chi-squared.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2

from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.log.time_series import Floats
from orchestrator.results.measured_record import MeasuredSignal
from orchestrator.results.run_data import EVER, RunData
from orchestrator.scene.scene import load
from orchestrator.studies import Case, Row
from orchestrator.studies.fit import fit
from orchestrator.studies.free_numbers import free_numbers
from orchestrator.studies.least_squares import Experiment, Objective, smooth_steps
from tests.validation.compared import checked, table, write

__all__ = ["TITLE", "cases", "table", "write"]

TITLE = "Fits of known numbers of straight and turn, rigid links, 1 % noise"
LASTS = "an hour of two cores"

STOP, RATE = 3.0, 100.0  # s, Hz
# Slow enough for smooth signals: at a slip of 20 % impacts amplify a change of 1e-4 in tension ten times.
GENTLE = ("drive.ramp_start=0.5 s", f"run.stop={STOP}", "run.links=1000", "expect={}")
SCENES = {
    "straight": (*GENTLE, "drive.ramp_time=4 s", "symmetric=true"), "turn": (*GENTLE, "drive.ramp_time=2.5 s"),
}  # fmt: skip
SIGNALS = (
    "chassis.speed", "chassis.pitch", "chassis.settlement", "left_drive.torque", "left_track.tension.mean",
    "chassis.left.road_arm[3].angle",
)  # fmt: skip
NOISE = 0.01  # of the RMS of a signal
TRUTH = {
    "vehicle.contact.ground.friction": 0.3, "vehicle.suspension.damping": 1.6e4, "vehicle.track.tension": 16.3e3,
    "vehicle.suspension.stiffness": 1.04e6, "vehicle.chassis.mass": 5650.0,
}  # fmt: skip
START = {
    "vehicle.contact.ground.friction": 0.4, "vehicle.suspension.damping": 1.5e4, "vehicle.track.tension": 14e3,
    "vehicle.suspension.stiffness": 1e6, "vehicle.chassis.mass": 5489.24,
}  # fmt: skip
DRAWS, WHOLE = 1000, 10
LIMIT = 7200.0  # s, of ten fits on a busy machine
T = np.arange(0.0, STOP, 1.0 / RATE)


def signals(scene: str, numbers: dict[str, float], track: str = "rigid") -> Floats:
    """Signals (signals, instants) of a run."""
    settings = [*SCENES[scene], *(f"{key}={value!r}" for key, value in numbers.items())]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        result = simulate(load(scene, track, settings), path, estimated=False)
        if result["status"] != "ok":
            raise RuntimeError(result["message"])
        with Log(path) as log:
            run = RunData(log)
            return np.array([np.interp(T, *run.signal(name, EVER)) for name in SIGNALS])


def sizes(values: Floats) -> Floats:
    """Noise of each signal, (signals,)."""
    return NOISE * np.sqrt(np.mean(values**2, axis=1))


def write_data(folder: Path, scene: str, seed: int | None, track: str = "rigid") -> tuple[Path, dict[str, float]]:
    """File of a record of a run with the truth, and its noise by signal, which is not added without a seed."""
    values = signals(scene, TRUTH, track)
    noise = sizes(values)
    drawn = np.random.default_rng(seed).standard_normal(values.shape) if seed is not None else 0.0
    drawn = values + noise[:, None] * drawn
    path = folder / f"{scene}-{seed}.csv"
    np.savetxt(path, np.vstack([T, drawn]).T, "%.12g", ",", header=",".join(["t", *SIGNALS]), comments="")
    return path, dict(zip(SIGNALS, noise.tolist(), strict=True))


def fitted(scene: str, seed: int | None, track: str = "rigid", measured: str = "rigid") -> dict[str, Any]:
    """Deviations in units of the standard errors, chi2/n, runs and time of a whole fit."""
    settings = [*SCENES[scene], *(f"{key}={value!r}" for key, value in START.items())]
    with tempfile.TemporaryDirectory() as folder:
        file, noise = write_data(Path(folder), scene, seed, measured)
        began = time.process_time()
        found = fit(
            scene, file, {name: name for name in SIGNALS}, [*TRUTH], Path(folder) / "fit", track=track,
            settings=settings, noise=noise,
        )  # fmt: skip
        cpu = time.process_time() - began
    apart = np.array(found.answer.numbers) - [*TRUTH.values()]
    return {
        "ok": found.ok, "cpu": cpu, "numbers": found.answer.numbers, "chi2": found.answer.chi2, "runs": found.runs,
        "deviations": (apart / found.answer.errors).tolist(),
    }  # fmt: skip


def linear(scene: str) -> list[Row]:
    """Scatter of the numbers over draws of noise, by the Jacobian at the truth, against their errors."""
    values = signals(scene, TRUTH)
    noise = sizes(values)
    at_truth = load(scene, "rigid", [*SCENES[scene], *(f"{key}={value!r}" for key, value in TRUTH.items())])
    told = [MeasuredSignal(n, n, "", T, v, False, {}) for n, v in zip(SIGNALS, values, strict=True)]
    task = Objective((Experiment(at_truth, signals=tuple(told)),), free_numbers([at_truth], [*TRUTH]), {})
    _, jacobian, rough = smooth_steps(task, np.zeros(len(TRUTH)), noise.tolist())
    inverse = np.linalg.inv(jacobian.T @ jacobian)
    errors = np.sqrt(np.diag(inverse))
    drawn = np.random.default_rng(7).standard_normal((DRAWS, jacobian.shape[0])) @ jacobian @ inverse
    rows = []
    for k, key in enumerate(TRUTH):
        inside = 100.0 * float(np.mean(np.abs(drawn[:, k]) < 2.0 * errors[k]))
        scatter, note = (
            float(np.std(drawn[:, k])),
            f"error {100.0 * errors[k]:.2g} % of the number, rough {rough[k]:.2g}",
        )
        rows.append(checked("draws", f"{scene}, {key}, % within 2 errors", inside, 95.0, 5.0, abs(inside - 95.0), note))
        rows.append(checked("draws", f"{scene}, {key}, scatter over error", scatter / errors[k], 1.0, 0.2))
    return rows


def whole(scene: str, count: int) -> list[Row]:
    """Deviations of whole fits in units of their errors."""
    found = [fitted(scene, seed) for seed in range(count)]
    deviations = np.array([one["deviations"] for one in found])
    squares, freedom = float(np.sum(deviations**2)), deviations.size
    low, high = chi2.ppf([0.005, 0.995], freedom)
    cpu, runs = (np.mean([one[key] for one in found]) for key in ("cpu", "runs"))
    note = f"{sum(one['ok'] for one in found)} of {count} say fitted; {runs:.0f} runs, {cpu:.0f} s of a processor each"
    return [
        checked("whole fits", f"{scene}, sum of squared deviations", squares, freedom, (high - low) / 2.0,
                abs(squares - (low + high) / 2.0), note),
        checked("whole fits", f"{scene}, largest deviation", float(np.abs(deviations).max()), 0.0, 4.0),
    ]  # fmt: skip


def swapped(scene: str, measured: str, track: str) -> list[Row]:
    """Numbers of one model of a chain fitted to the run of the other, without noise: which take up the difference."""
    found = fitted(scene, None, track, measured)
    return [
        Row("swapped", f"{scene}, {track} fitted to {measured}, {key}",
            {"value": number, "reference": true, "error": number / true - 1.0}, None,
            f"{off:+.2f} errors of noise of 1 %; chi2/n {found['chi2']:.3g}")
        for (key, true), number, off in zip(TRUTH.items(), found["numbers"], found["deviations"], strict=True)
    ]  # fmt: skip


def cases(quick: bool) -> list[Case]:
    """Cases of both scenes; ``quick``: two whole fits of each, nothing swapped."""
    found = [Case("draws", scene, linear, (scene,), 60.0) for scene in SCENES]
    found += [Case("whole fits", scene, whole, (scene, 2 if quick else WHOLE), 900.0, LIMIT) for scene in SCENES]
    for measured, track in (("flexible", "rigid"), ("rigid", "flexible")) * (not quick):
        found += [Case("swapped", f"{measured} {track}", swapped, ("straight", measured, track), 300.0)]
    return found
