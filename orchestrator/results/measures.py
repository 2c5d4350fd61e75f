"""Measures of a run that combine several signals; the checks of scenes refer to them by name.

A measure is a function ``measure(run, of, window) -> float``; ``of`` is a side ("left", "right"), a span, or empty.
Their units are in ``vocabulary/measures.py``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from orchestrator.results import chain_measures, turning, vehicle_measures
from orchestrator.results.energy import drift, ledger
from orchestrator.results.run_data import Floats, RunData, Window, mean

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


NAMES: dict[str, Measure] = {
    measure.__name__: measure
    for measure in (
        chain_measures.sag,
        chain_measures.end_tension,
        chain_measures.joint_force,
        chain_measures.joint_force_spread,
        chain_measures.hoop_strain,
        chain_measures.fall_time,
        chain_measures.half_fall_time,
        chain_measures.behind_free_fall,
        chain_measures.pins_passed,
        chain_measures.pins_per_revolution,
        chain_measures.chain_speed_ratio,
        chain_measures.polygon_ripple,
        chain_measures.span_tension,
        chain_measures.span_moment_ratio,
        chain_measures.tight_span_enters,
        vehicle_measures.ground_force,
        vehicle_measures.uphill_force,
        vehicle_measures.slip,
        vehicle_measures.pad_slip,
        vehicle_measures.speed_excess,
        vehicle_measures.settlement,
        vehicle_measures.settlement_of_springs,
        vehicle_measures.settlement_of_contacts,
        vehicle_measures.rut_depth,
        vehicle_measures.tension_top,
        vehicle_measures.tension_rear,
        vehicle_measures.tension_front,
        vehicle_measures.third_law,
        energy_residual,
        port_residual,
        energy_drift,
        turning.yaw_rate,
        turning.turn_radius,
        turning.lateral_speed,
        turning.rotation_centre,
        turning.track_slip,
        turning.propulsion,
        turning.steering_moment,
        turning.drive_power,
        turning.regenerated_power,
        turning.path_error,
    )
}
