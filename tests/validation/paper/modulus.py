"""Young's modulus below which flexible links cost less than rigid ones (end of section 8.3).

Measured on the piece of drive of ``pieces``, started from the state of the same modulus, and on the implicit
co-simulation of the scene's first seconds with its own settings. The relaxation time of the material is constant, so
damping falls with the modulus.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path

from fmus.vehicles.tables import BadInput
from orchestrator.studies import Row
from tests.validation.paper import pieces
from tests.validation.paper.models import Model, named, scene
from tests.validation.paper.recorded import ran

MODULI = (2e8, 2e9, 2e10, 2e11)  # Pa; the last one is steel
IMPLICIT = 2.5  # s, of the implicit runs: settling and the start of the ramp


def rows(name: str, modulus: float, piece: float) -> list[Row]:
    """Row of the costs of a model at a modulus, Pa (NaN: rigid links), s."""
    model = named(name)
    settings = () if math.isnan(modulus) else (f"vehicle.material.youngs_modulus={modulus!r}",)
    costs = {row["method"]: row for row in pieces.rows(name, piece, settings) if row.item == "cost" and row.ok}
    figures = {"model": name, "modulus": modulus, "piece": piece}
    for key, method in (("adams", pieces.ADAMS), ("runge_kutta", pieces.RUNGE_KUTTA)):
        if method in costs:
            figures[f"cpu_{key}"] = costs[method]["cpu"]
            figures[f"evaluations_{key}"] = costs[method]["evaluations"]
    figures["implicit"] = implicit(model, settings)
    return [Row("modulus", model.label, figures, True)]


def implicit(model: Model, settings: Sequence[str]) -> float:
    """CPU time of the implicit co-simulation, s per simulated second; NaN if it fails."""
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        try:
            wanted = scene(model, "track.link_outputs=false", "expect={}", f"run.stop={IMPLICIT} s", *settings)
            return float(ran(wanted, Path(folder) / "run.mcap")["cpu_time"]) / IMPLICIT
        except (BadInput, RuntimeError):
            return math.nan


def crossing(points: Sequence[tuple[float, float]], rigid: float) -> float:
    """Modulus below which flexible links cost less than ``rigid``, interpolated in logarithms.

    0 if none of the points (modulus, cost) is cheaper, infinite if all are.
    """
    known = sorted((modulus, cost) for modulus, cost in points if cost > 0.0)
    if not known or not rigid > 0.0:
        return math.nan
    below = [cost <= rigid for _, cost in known]
    if not below[0]:
        return 0.0
    if all(below):
        return math.inf
    k = below.index(False)
    (a, low), (b, high) = known[k - 1], known[k]
    share = math.log(rigid / low) / math.log(high / low)
    return math.exp(math.log(a) + share * math.log(b / a))
