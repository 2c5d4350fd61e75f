"""Couplings on the two-mass oscillator: order, energy, stable step; fixed against variable steps.

Predictions come from the exact amplification matrix of each coupling, observations from the coupling code itself on
exact slaves. Orders and energies are without dampers. Limits are with a coupling spring of 100 N/m, dampers of 1 N s/m
(none in the cut "spring") at the port and of 0.2 N s/m at the walls.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.linalg import expm

from fmus.physics.arrays import Floats
from orchestrator.cosim.coupling import coupling
from orchestrator.cosim.coupling.scheme import Scheme
from orchestrator.cosim.coupling.variable_step import VariableStep
from orchestrator.cosim.graph import Stages
from orchestrator.cosim.master import FixedStep, run
from orchestrator.studies import Case, Row
from orchestrator.studies.step_limits import Oscillator, radius
from tests.validation.compared import checked, table, write
from tests.validation.slaves import Slave, coupled, energy, struck, whole

__all__ = ["TITLE", "cases", "table", "write"]

TITLE = "Couplings on two masses: orders, energies, largest stable steps"

CUTS = ("wrench", "spring", "mass")
# Scheme and options. Gauss-Seidel with held inputs is left out for the wrench cut, where it equals tracks_first.
VARIANTS: dict[str, tuple[str, dict[str, Any]]] = {
    "tracks_first": ("tracks_first", {}),
    "jacobi constant": ("jacobi", {"hold": "constant"}),
    "jacobi linear": ("jacobi", {"hold": "linear"}),
    "gauss_seidel constant": ("gauss_seidel", {"hold": "constant"}),
    "gauss_seidel linear": ("gauss_seidel", {"hold": "linear"}),
    "iterative": ("iterative", {"tolerance": 1e-10}),
}
MEMBERS = [
    (cut, variant) for cut in CUTS for variant in VARIANTS if (cut, variant) != ("wrench", "gauss_seidel constant")
]
FREE = Oscillator()
DAMPED = Oscillator(k=100.0, c=1.0, c1=0.2, c2=0.2, start=(1.0, 0.5, -0.3, 0.2))
STRUCK = Oscillator(k=100.0, c=1.0, c1=0.05, c2=0.05, start=(0.1, 0.0, 0.1, 0.0))
END, STRUCK_END = 10.0, 20.0  # s
STABLE = 1.0 + 1e-9  # spectral radius to rounding
MAX_STEP = 3.0  # s: a coupling that is stable up to here counts as unlimited
STEPS, LONG = 1600, 12.0  # steps and s after which growth differs from decay
REST = 1e-6  # of the initial motion: smaller motion is rounding or the tolerance of iterations


def couple(variant: str, stages: Stages) -> Scheme:
    """Return the coupling of a variant."""
    name, options = VARIANTS[variant]
    return coupling(name)(stages, threads=False, **options)  # type: ignore[no-any-return]


def follow(
    variant: str, sides: tuple[Stages, Slave, Slave], pace: FixedStep | VariableStep, truth: Callable[[float], Floats]
) -> float:
    """Run a coupling; return the largest error of both positions, m. ``truth`` is called in order of time."""
    stages, a, b = sides
    worst = 0.0

    def watch(k: int, t: float, _: float) -> None:
        nonlocal worst
        x = truth(t)
        worst = max(worst, abs(a.x[0] - x[0]), abs(b.x[0] - x[2]))

    outcome = run(couple(variant, stages), pace, [watch])
    if outcome.status != "ok":
        raise RuntimeError(outcome.message)
    return worst


def run_free(variant: str, cut: str, h: float) -> tuple[float, float]:
    """Return the largest error of both positions over a run, m, and its final over its initial energy."""
    sides = coupled(cut, FREE)
    ahead, x = expm(whole(FREE) * h), np.array(FREE.start)

    def truth(t: float) -> Floats:
        nonlocal x
        x = ahead @ x if t else x
        return x

    worst = follow(variant, sides, FixedStep(h, round(END / h)), truth)
    _, a, b = sides
    return worst, energy(FREE, np.array([*a.x[:2], *b.x])) / energy(FREE, np.array(FREE.start))


def grows(variant: str, cut: str, h: float, o: Oscillator = DAMPED, steps: int = 0) -> bool:
    """True if the motion of the damped oscillator grows from the second quarter of the steps to the last."""
    steps = steps or max(STEPS, round(LONG / h))
    stages, a, b = coupled(cut, o)
    sizes: list[float] = []

    def watch(k: int, t: float, _: float) -> None:
        sizes.append(max(float(np.abs(a.x).max()), float(np.abs(b.x).max())))

    with np.errstate(over="ignore", invalid="ignore"):
        run(couple(variant, stages), FixedStep(h, steps), [watch], lambda: len(sizes) > 1 and not sizes[-1] < 1e100)
    if len(sizes) < steps:
        return True
    quarter = steps // 4
    return max(sizes[-quarter:]) > 1.001 * max(REST * sizes[0], *sizes[quarter : 2 * quarter])


def predicted_limit(variant: str, cut: str) -> float:
    """First step at which the spectral radius exceeds 1, s; infinite without one."""
    name, options = VARIANTS[variant]
    low = 5e-4

    def unstable(h: float) -> bool:
        return radius(name, str(options.get("hold", "linear")), cut, DAMPED, h) > STABLE

    while not unstable(low * 1.02):
        low *= 1.02
        if low > MAX_STEP:
            return math.inf
    high = low * 1.02
    for _ in range(12):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if unstable(middle) else (middle, high)
    return low


def observed_limit(variant: str, cut: str, predicted: float) -> float:
    """Step, s, to 1 %, from 0.9 to 1.08 of the predicted one, at which the coupling becomes unstable.

    Some couplings have a second range of stable steps beyond their limit, in which a wider search could end.
    """
    low, high = 0.9 * predicted, 1.08 * predicted
    while high / low > 1.01:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if grows(variant, cut, middle) else (middle, high)
    return math.sqrt(low * high)


def run_struck(variant: str, pace: FixedStep | VariableStep) -> tuple[float, int]:
    """Run with a hammer blow on mass 2; return the largest position error, m, and the steps of side a."""
    stages, a, b, truth = struck(STRUCK)
    return follow(variant, (stages, a, b), pace, truth), a.steps


# Cases --------------------------------------------------------------------------------------------------------------


def accuracy(variant: str, cut: str) -> list[Row]:
    """Rows of order and energy."""
    name = f"{variant}, cut at the {cut}"
    declared = couple(variant, coupled(cut, FREE)[0]).ORDER
    hs = (0.1, 0.02, 0.01, 0.005)
    runs = {h: run_free(variant, cut, h) for h in hs}
    errors = [runs[h][0] for h in hs]
    order = math.log2(errors[-2] / errors[-1])
    return [
        checked("orders", f"{name}, order", order, declared, 0.1, abs(order - declared), order=order,
                over="step, s", series=tuple(zip(hs, errors, strict=True))),
        checked("errors", f"{name}, largest error at H = 0.1 s, m", errors[0], 0.0, math.nan),
        checked("energies", f"{name}, E(10 s)/E(0) at H = 0.01 s", runs[0.01][1], 1.0, math.nan),
    ]  # fmt: skip


def limit(variant: str, cut: str) -> list[Row]:
    """Row of the largest stable step."""
    name = f"{variant}, cut at the {cut}, largest stable H, s"
    predicted = predicted_limit(variant, cut)
    if math.isinf(predicted):
        growing = grows(variant, cut, 0.9 * MAX_STEP, steps=200)
        note = f"none predicted up to {MAX_STEP:g} s; observed at {0.9 * MAX_STEP:g} s"
        return [checked("limits", name, math.nan, math.nan, 0.5, float(growing), note=note)]
    return [checked("limits", name, observed_limit(variant, cut, predicted), predicted, 0.05)]


FIXED = (0.1, 0.05, 0.025, 0.0125, 0.00625)
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5)


def steps_at_equal_error(tolerances: tuple[float, ...]) -> list[Row]:
    """Rows of the number of fixed steps that reach the error of variable ones, and the ratio of both."""
    rows = []
    errors, costs = np.array([run_struck("gauss_seidel linear", FixedStep(h, round(STRUCK_END / h))) for h in FIXED]).T
    for tolerance in tolerances:
        pace = VariableStep(STRUCK_END, 0.02, tolerance, 1e-5, 1.0)
        error, cost = run_struck("gauss_seidel linear", pace)
        equal = math.exp(np.interp(math.log(error), np.log(errors[::-1]), np.log(costs[::-1])))
        note = f"error {error:.2g} m; {pace.rejected_steps} pairs taken back; all tried steps are counted"
        name = f"quiet, struck, quiet: steps of a component at tolerance {tolerance:g}, against fixed at equal error"
        rows.append(checked("variable step", name, cost, equal, 0.0, max(cost / equal - 1.0, 0.0), note=note))
    return rows


def cases(quick: bool) -> list[Case]:
    """Cases of all couplings at all cuts; ``quick``: fewer tolerances of the variable step."""
    tolerances = TOLERANCES[1:3] if quick else TOLERANCES
    return [
        *(Case("orders", f"{v}, {cut}, order", accuracy, (v, cut)) for cut, v in MEMBERS),
        *(Case("limits", f"{v}, {cut}, limit", limit, (v, cut), 5.0) for cut, v in MEMBERS),
        Case("variable step", "work and precision", steps_at_equal_error, (tolerances,), 20.0),
    ]
