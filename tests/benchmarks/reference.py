"""Write ``reference.json``, the true pin positions of each case.

The command is ``python -m tests.benchmarks.reference``. Explicit Runge-Kutta of order 4 of the same equations. With
twice the step the pins of the free loops agree to 1e-12 m, those on the ground to 6e-8 m.
"""

from __future__ import annotations

import json

import numpy as np

from tests.benchmarks.motion import CASES, REFERENCE, Case, Floats, model, pins

STEPS = {
    "flexible": 1.25e-6,
    "rigid": 25e-6,
    "rigid, on the ground": 12.5e-6,
    "rigid, released": 25e-6,
    "rigid, folded": 12.5e-6,
}  # s
H = 1e-3  # s between instants at which the path of a pin is measured
DIGITS = 13


def states(case: Case, step: float) -> dict[str, tuple[Floats, float]]:
    """Pins (n, 2) at the ends of the quick and full form, and RMS of the lengths of their paths, m."""
    truth = model(case, step, integrator="runge_kutta")
    before, way, end_states = pins(truth), np.zeros(truth.nodes), {}
    for k in range(round(case.stop / H)):
        truth.step(k * H, H, np.zeros(0))
        now = pins(truth)
        way += np.linalg.norm(now - before, axis=1)
        before = now
        for stop in (case.quick, case.stop):
            if k + 1 == round(stop / H):
                end_states[f"{stop:g}"] = now, float(np.sqrt(np.mean(way**2)))
    return end_states


def main() -> None:
    """Write the reference file."""
    about = "pins (x, z) in m at the time in s, and the RMS of the ways that they went; see reference.py"
    cases = {
        name: {
            stop: {"way": round(way, DIGITS), "pins": [[round(x, DIGITS) for x in pin] for pin in places.tolist()]}
            for stop, (places, way) in states(case, STEPS[name]).items()
        }
        for name, case in CASES.items()
    }
    REFERENCE.write_text(json.dumps({"about": about, "steps": STEPS, "cases": cases}) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
