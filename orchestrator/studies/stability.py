"""Stiff and extreme cases: verdict, margin to the predicted limit, observed limit.

A case (``extreme``) runs a scene of the gallery with settings and has two requirements: the energy ledger closes to 5
% (``summary.energy_warning``), and one physical expectation, named in the table (``expectations``), is met;
``verdict`` judges the run. The predicted limit is the longest communication step of the linearised coupling, or the
internal step of an explicit integrator (``limits``); the observed limit is bisected with the same requirements.
"""

from __future__ import annotations

import math
from dataclasses import replace

from fmus.vehicle import BadInput
from orchestrator.scene.scene import load
from orchestrator.studies import Case
from orchestrator.studies.expectations import EXPECTATIONS
from orchestrator.studies.extreme import BISECTED, FAMILIES
from orchestrator.studies.limits import predicted
from orchestrator.studies.row import Row
from orchestrator.studies.stability_map import table, write
from orchestrator.studies.verdict import CLEAN, RIGHT, WRONG, judged_run, with_verdict

__all__ = ["TITLE", "cases", "table", "write"]

TITLE = "Stability: stiff and extreme cases"
LIMIT = 600.0  # s of a case; a longer one hangs
BISECTIONS = 5


def cases(quick: bool) -> list[Case]:
    """Cases: every value of every family, then the bisected limits."""
    all_cases = []
    for number, family in enumerate(FAMILIES):
        values = family.values if not quick or family.quick is None else family.quick
        for value in values:
            limit = max(LIMIT, 3.0 * family.seconds)
            all_cases.append(
                Case(family.name, f"{family.name}: {value:g}", member, (number, value), family.seconds, limit)
            )
    for number, one in enumerate(BISECTED):
        if not quick or one.quick:
            all_cases.append(Case(one.name, f"{one.name}: limit", bisected_limit, (number,), 60.0, LIMIT))
    return all_cases


def member(number: int, value: float) -> list[Row]:
    """Row of a member of a family."""
    family = FAMILIES[number]
    expectation = family.expectation if isinstance(family.expectation, str) else family.expectation(value)
    sensible = family.sensible[0] <= value <= family.sensible[1]
    row = Row("", f"{value:g}", {"value": value, "sensible": sensible, "asked": EXPECTATIONS[expectation][1]})
    try:
        scene = load(family.scene, family.track, family.settings(value))
    except BadInput as refusal:
        return [with_verdict(row, CLEAN, str(refusal))]
    limit, cause = predicted(scene)
    return [judged_run(scene, expectation, row.with_figures(step=scene.run.step, predicted=limit, cause=cause))]


def bisected_limit(number: int) -> list[Row]:
    """Longest stable step, from 1 to 100 times the given one, beside the predicted one."""
    _, scene, track, settings, key, smallest, _ = BISECTED[number]
    expectation = "weight" if scene == "settle" else "ledger"
    base = load(scene, track, settings)
    limit, cause = predicted(base)
    stop = base.run.stop

    def run(step: float) -> Row:
        length = stop / round(stop / step) if key == "run.step" else step
        row = Row("", "limit", {"step": length, "predicted": limit, "cause": cause})
        return judged_run(load(scene, track, [*settings, f"{key}={length!r}"]), expectation, row)

    def longest(good: tuple[str, ...]) -> tuple[Row, Row]:
        """Longest step with a good verdict, and shortest one without."""
        low, high = run(smallest), run(min(100.0 * smallest, stop))
        for _ in range(BISECTIONS if low["verdict"] in good and high["verdict"] not in good else 0):
            middle = run(math.sqrt(low["step"] * high["step"]))
            low, high = (middle, high) if middle["verdict"] in good else (low, middle)
        return (high, high) if high["verdict"] in good else (low, high)

    (right, _), (stable, beyond) = longest((RIGHT,)), longest((RIGHT, WRONG))
    end = (
        f"at {beyond['step']:.3g} s {beyond['verdict']}: {beyond.note}"
        if beyond is not stable
        else "no limit up to there"
    )
    note = f"right up to {right['step']:.3g} s, stable up to {stable['step']:.3g} s; {end}"
    return [replace(right.with_figures(value=stable["step"], observed=stable["step"]), note=note)]
