"""Measures and observables of a run by name: figures of several signals, for the checks of scenes and for the summary.

A measure is a function ``measure(run, of, window) -> float``; ``of`` is a side ("left", "right"), a span, or empty.
Their units, and what they read, are in ``vocabulary/analyses.py``. An observable has a label, a unit and digits for
summary, report and sweep.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from orchestrator.results import chain_measures, largest_forces, turning, vehicle_measures
from orchestrator.results.energy import drift, ledger
from orchestrator.results.run_data import Floats, RunData, Unrecorded, Window, mean
from orchestrator.vocabulary.analyses import MEASURES

Measure = Callable[[RunData, str, Window], float]

REDUCTIONS: dict[str, Callable[[Floats, Floats], float]] = {
    "mean": mean,
    "min": lambda t, values: values.min(),
    "max": lambda t, values: values.max(),
    "last": lambda t, values: values[-1],
    "drop": lambda t, values: values[0] - values[-1],
    "ripple": lambda t, values: np.ptp(values) / abs(mean(t, values)),  # peak to peak over the mean
    "rms": lambda t, values: mean(t, values**2) ** 0.5,
}


def reduce(t: Floats, values: Floats, how: str) -> float:
    """Reduce the samples of a window to one number; a mean weights each by the time since the last one."""
    return float(REDUCTIONS[how](t, values))


# --- energy, over the whole run --------------------------------------------------------------------


def energy_residual(run: RunData, of: str, window: Window) -> float:
    """Residual of the energy ledger over the largest of work, change and dissipation."""
    return ledger(run).residual_relative


def port_residual(run: RunData, of: str, window: Window) -> float:
    """Ports' part of the energy residual, over the work of the drives."""
    energies = ledger(run)
    return energies.port / energies.work


def energy_drift(run: RunData, of: str, window: Window) -> float:
    """Largest change of stored and lost energy less work, at any instant, over the largest kinetic energy."""
    return drift(run, window)


_OWN = (*largest_forces.MEASURES, energy_residual, port_residual, energy_drift)
_BY_NAME = {name: one for module in (chain_measures, vehicle_measures, turning) for name, one in vars(module).items()}
_BY_NAME |= {one.__name__: one for one in _OWN}
NAMES: dict[str, Measure] = {name: _BY_NAME[name] for name in MEASURES}


def value(run: RunData, name: str, of: str, window: Window) -> float:
    """Value of a measure; raises Unrecorded where it needs more than its log holds, and Missing."""
    if MEASURES[name].every_step:
        every = [run.log.topics[topic].every if topic in run.log.topics else 0
                 for instance in run.instances for topic in (f"/{instance}/in", f"/{instance}/out")]  # fmt: skip
        if not min(every):
            raise Unrecorded(f"{name} needs the inputs of every step: run.inputs = true")
        if max(every) > 1:
            raise Unrecorded(f"{name} needs the outputs of every step: run.outputs = 1, not {max(every)}")
    return float(NAMES[name](run, of, window))


class RunObservable(NamedTuple):
    """Figure of a run."""

    label: str  # in a sentence
    unit: str  # in which it is shown
    digits: int  # that are shown
    value: Callable[[RunData, Window], float] | None  # SI, raises Missing; None: of the scene alone
    whole: bool = False  # of the whole run: largest value, or difference from start to end; others are means
    place: Callable[[RunData], str] | None = None  # words for where and when, after the value; raises Missing

    @property
    def title(self) -> str:
        """Label at the beginning of a line."""
        return f"{self.label[0].upper()}{self.label[1:]}"


def _speed(run: RunData, window: Window) -> float:
    return run.mean("chassis.speed" if run.scene.get("assembly") == "vehicle" else f"{run.tracks[0]}.speed", window)


def _tension_max(run: RunData, window: Window) -> float:
    return run.largest([f"{track}.tension.max" for track in run.tracks])


def _tension_mean(run: RunData, window: Window) -> float:
    return float(np.mean([run.mean(f"{track}.tension.mean", window) for track in run.tracks]))


def _pad_velocity(run: RunData, window: Window) -> float:
    return float(np.mean([turning.track_slip(run, side, window) for side in run.sides]))


def _of(measure: Callable[[RunData, str, Window], float], of: str = "") -> Callable[[RunData, Window], float]:
    """Value of a measure of a part of the run."""
    return lambda run, window: measure(run, of, window)


def _largest_forces() -> dict[str, RunObservable]:
    found = {}
    for name, force in largest_forces.FORCES.items():
        words, unit, high = name.replace("_", " "), f"k{force.unit}", f"{name}{largest_forces.HIGH}"
        place = partial(lambda name, run: largest_forces.largest(run, name).place, name)
        found[name] = RunObservable(f"largest {words}", unit, 4, _of(NAMES[name]), True, place)
        found[high] = RunObservable(f"99.9 % of {words}s below", unit, 4, _of(NAMES[high]), True)
    return found


_slip, _power = partial(_of, turning.track_slip), partial(_of, turning.drive_power)

OBSERVABLES = {
    "distance": RunObservable(
        "distance along the start heading", "m", 5, lambda run, _: run.ends("chassis.distance")[1], whole=True
    ),
    "speed": RunObservable("speed", "m/s", 4, _speed),
    "settlement": RunObservable("settlement", "mm", 4, _of(vehicle_measures.settlement)),
    "ground_force": RunObservable("ground carries", "kN", 5, _of(vehicle_measures.ground_force)),
    "weight": RunObservable("weight", "kN", 5, None),
    "slip": RunObservable("slip", "%", 2, _of(vehicle_measures.slip)),
    "pad_slip": RunObservable("slip of the pads", "%", 2, _of(vehicle_measures.pad_slip)),
    "pad_velocity": RunObservable("pads slide at", "m/s", 3, _pad_velocity),
    "path_error": RunObservable("largest distance from the path", "m", 3, _of(turning.path_error), whole=True),
    "yaw_rate": RunObservable("yaw rate", "rad/s", 4, _of(turning.yaw_rate)),
    "turn_radius": RunObservable("turn radius", "m", 4, _of(turning.turn_radius)),
    "steering_moment": RunObservable("steering moment", "kN m", 4, _of(turning.steering_moment)),
    "slip_left": RunObservable("slip left", "m/s", 3, _slip("left")),
    "slip_right": RunObservable("slip right", "m/s", 3, _slip("right")),
    "power_left": RunObservable("power left", "kW", 4, _power("left")),
    "power_right": RunObservable("power right", "kW", 4, _power("right")),
    "power_propulsion": RunObservable("power of propulsion", "kW", 4, _power("propulsion")),
    "power_steering": RunObservable("power of steering", "kW", 4, _power("steering")),
    "power_regenerated": RunObservable("power from side to side", "kW", 4, _of(turning.regenerated_power)),
    "tension_max": RunObservable("largest link tension", "kN", 4, _tension_max, whole=True),
    "tension_mean": RunObservable("mean link tension", "kN", 4, _tension_mean),
    **_largest_forces(),
    "stop_force": RunObservable(
        "largest force of a stop",
        "kN",
        4,
        _of(vehicle_measures.stop_force),
        True,
        lambda run: vehicle_measures.stop_forces(run).place,
    ),
    "recoil_stroke": RunObservable("largest recoil stroke", "mm", 4, _of(vehicle_measures.recoil_stroke), whole=True),
    "sag": RunObservable("sag", "m", 6, _of(chain_measures.sag)),
    "end_tension": RunObservable("tension at the ends", "kN", 5, _of(chain_measures.end_tension)),
}
