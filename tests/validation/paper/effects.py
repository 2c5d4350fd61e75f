"""Effects of link inertia and of link elasticity, one at a time, from pairs of whole runs.

The inertia about the pin is that of the vehicle table, or m l^2 / 12 of a thin rod. Differences are relative: RMS of
the difference over RMS of the second run of the pair. They are taken of the first joint's force in the chassis' axes
while the sprockets turn; of the tensions of the right chain's links at ``INSTANT``; and, over the whole run, of the
chassis' motion, the sprockets' torque, and means and RMS over seconds of tensions and of joint forces.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from orchestrator.log.reader import Log
from orchestrator.log.time_series import Floats
from orchestrator.results.difference import differences_of_logs
from orchestrator.results.run_data import RunData, Window, within
from orchestrator.studies import Row
from tests.validation.paper.conventions import FIRST, INSTANT, TRACK, TURNING, in_chassis
from tests.validation.paper.models import CLOSED, CLOSED_ROD, RIGID, RIGID_ROD, Model

MOTION = ("position", "velocity", "pitch")
OBSERVABLES = (*MOTION, "torque", "tension_mean", "tension_rms", "joint_force_mean", "joint_force_rms")


class Pair(NamedTuple):
    """Two models that differ in one respect."""

    key: str
    differs: str
    run: Model
    reference: Model


PAIRS = (
    Pair("elasticity", "elasticity, inertia of the table", RIGID, CLOSED),
    Pair("elasticity", "elasticity, inertia of a rod", RIGID_ROD, CLOSED_ROD),
    Pair("inertia", "inertia, rigid links", RIGID, RIGID_ROD),
    Pair("inertia", "inertia, flexible links", CLOSED, CLOSED_ROD),
    Pair("both", "both: rigid links of the table, flexible ones of a rod", RIGID, CLOSED_ROD),
)


def rows(logs: Mapping[str, Path]) -> list[Row]:
    """Rows of all pairs with both logs, given by model; raises Missing, LookupError."""
    there = [pair for pair in PAIRS if pair.run.name in logs and pair.reference.name in logs]
    return [Row("effect", pair.differs, {"key": pair.key, **compared(logs, pair)}, True) for pair in there]


def compared(logs: Mapping[str, Path], pair: Pair) -> dict[str, float]:
    """Relative differences of a pair."""
    files = logs[pair.run.name], logs[pair.reference.name]
    apart = differences_of_logs(*files)
    (force, tension), (other_force, other_tension) = map(forces, files)
    return {
        "force": relative(force, other_force),
        "tension": relative(tension, other_tension),
        **{name: apart[name].relative for name in OBSERVABLES if name in apart},  # a short run has no seconds
    }


def forces(file: Path) -> tuple[Floats, Floats]:
    """First joint's force (m, 3), N, in chassis axes while sprockets turn; tensions (links,) at INSTANT."""
    with Log(file) as log:
        run = RunData(log)
        t, force = run.vectors(TRACK, "links", f"joint[{FIRST}].force")
        turning = within(t, TURNING)
        tension = run.links(TRACK, Window(INSTANT, INSTANT)).tension[0]
        return in_chassis(run, t, force, False)[turning], tension


def relative(values: Floats, reference: Floats) -> float:
    """RMS of the difference over RMS of the reference."""
    return float(np.linalg.norm(values - reference) / np.linalg.norm(reference))
