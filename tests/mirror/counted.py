"""Count the calls of the chain integrators' parts, beside the integrators' own counters.

Run with NUMBA_DISABLE_JIT=1. A chain of three links is released in short steps, and then in steps so long that they are
halved. Writes JSON: for each kind of link the integrator's counters after every step, and the counted calls.
"""

from __future__ import annotations

import json
import sys
from collections import Counter

import numpy as np

from fmus.physics.chain.flexible import dynamics as flexible_dynamics
from fmus.physics.chain.rigid import dynamics as rigid_dynamics
from fmus.physics.chain.rigid import newton as rigid
from fmus.track_flexible.model import Model as Flexible
from fmus.track_rigid.model import Model as Rigid
from fmus.vehicles.vehicle import read_table, vehicle

STEPS = (1e-3, 1e-3, 0.3, 1e-3)
CALLS = {  # per kind: functions called once per evaluation, per iteration, per accepted step, per started step
    "rigid": {"residual": rigid, "solve": rigid.augmented, "end_work": rigid_dynamics, "newton": rigid_dynamics},
    "cable": {
        "evaluate": flexible_dynamics,
        "correct": flexible_dynamics,
        "end_work": flexible_dynamics,
        "newton": flexible_dynamics,
    },
}
calls: Counter[str] = Counter()


def count(module, name: str) -> None:
    function = getattr(module, name)

    def counting(*args):
        calls[name] += 1
        return function(*args)

    setattr(module, name, counting)


def run(kind: str) -> list[dict[str, list[int]]]:
    track = {"links": 3, "closed": False, "wheels": [], "ground": False, "gravity": 9.81, "transverse_damping": 0.0,
             "ends": {"kind": "held", "first": [0.0, 0.0]}}  # fmt: skip
    table = vehicle(*read_table("m113")).model_dump()
    model = (Rigid if kind == "rigid" else Flexible)({"vehicle": table, "track": track, "link_outputs": False})
    given = {port.name: port.start for port in model.ports if port.causality == "parameter"}
    model.initialise(given | {"start": "straight", "step": max(STEPS)})
    calls.clear()
    counts, t = [], 0.0
    for h in STEPS:
        model.step(t, h, np.zeros(0))
        t += h
        evaluations, iterations, steps, tries = (calls[name] for name in CALLS[kind])
        counts.append({
            "shown": model.counters.tolist(), "counted": [steps, evaluations, iterations, tries - steps],
        })  # fmt: skip
    return counts


if __name__ == "__main__":
    for names in CALLS.values():
        for name, module in names.items():
            count(module, name)
    rigid.MAX_ITERATIONS = 8  # rigid links would converge in any step with more iterations
    json.dump({kind: run(kind) for kind in CALLS}, sys.stdout)
