"""Stiff and extreme cases: what becomes of each, the margin to the predicted limit, and the limit that is observed.

A case (``extreme``) runs a scene of the gallery with settings and asks for two things: that the energy ledger closes to
5 % (``summary.energy_warning``), and one physical expectation, named in the table (``expectations``); ``verdict``
judges the run. The predicted limit is the longest communication step of the linearised coupling, or internal step of an
explicit integrator (``limits``); an observed limit is bisected in the same way of asking.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from fmus.vehicle import BadInput
from orchestrator.studies import Case
from orchestrator.studies.expectations import ASKED
from orchestrator.studies.extreme import BISECTED, FAMILIES, loaded
from orchestrator.studies.limits import predicted
from orchestrator.studies.stability_map import to_markdown, write
from orchestrator.studies.verdict import CLEAN, MUTE, RIGHT, WRONG, Row, judged

__all__ = ["TITLE", "Row", "cases", "failed", "measure", "missed", "to_markdown", "write"]

TITLE = "Stability: stiff and extreme cases"
LIMIT = 600.0  # s of a case: longer is a case that hangs
BISECTIONS = 5


def cases(quick: bool) -> list[Case]:
    """Every value of every family, then the limits that are bisected."""
    wanted = []
    for number, family in enumerate(FAMILIES):
        values = family.values if not quick or family.quick is None else family.quick
        for value in values:
            limit = max(LIMIT, 3.0 * family.seconds)
            wanted.append(Case(family.name, f"{family.name}: {value:g}", one, (number, value), family.seconds, limit))
    for number, (name, *_) in enumerate(BISECTED):
        if not quick or number == 1:
            wanted.append(Case(name, f"{name}: limit", bisected, (number,), 60.0, LIMIT))
    return wanted


def measure(case: Case) -> list[Row]:
    """The row of a case."""
    found = case.name.rpartition(": ")[2]
    return [row._replace(item=case.item, case=found) for row in case.function(*case.arguments)]


def one(number: int, value: float) -> list[Row]:
    """A member of a family."""
    family = FAMILIES[number]
    asked = family.asked if isinstance(family.asked, str) else family.asked(value)
    sensible = family.sensible[0] <= value <= family.sensible[1]
    row = Row("", "", value, MUTE, sensible, ASKED[asked][1])
    try:
        scene = loaded(family.scene, family.track, family.settings(value))
    except BadInput as refusal:
        return [row._replace(verdict=CLEAN, note=str(refusal))]
    limit, cause = predicted(scene)
    return [judged(scene, asked)._replace(value=value, sensible=sensible, predicted=limit, cause=cause)]


def bisected(number: int) -> list[Row]:
    """The longest step that keeps a run stable, from 1 to 100 times the given one; the predicted one beside it."""
    _, scene, track, settings, key, least = BISECTED[number]
    asked = "weight" if scene == "settle" else "ledger"
    limit, cause = predicted(loaded(scene, track, settings))
    stop = loaded(scene, track, settings).run.stop

    def run(step: float) -> Row:
        whole = stop / round(stop / step) if key == "run.step" else step
        return judged(loaded(scene, track, [*settings, f"{key}={whole!r}"]), asked)._replace(step=whole)

    def longest(good: tuple[str, ...]) -> tuple[Row, Row]:
        """The longest step that ends well, and the shortest beyond it that does not."""
        low, high = run(least), run(min(100.0 * least, stop))
        for _ in range(BISECTIONS if low.verdict in good and high.verdict not in good else 0):
            middle = run(math.sqrt(low.step * high.step))
            low, high = (middle, high) if middle.verdict in good else (low, middle)
        return (high, high) if high.verdict in good else (low, high)

    (right, _), (stable, beyond) = longest((RIGHT,)), longest((RIGHT, WRONG))
    end = f"at {beyond.step:.3g} s {beyond.verdict}: {beyond.note}" if beyond is not stable else "no limit up to there"
    note = f"right up to {right.step:.3g} s, stable up to {stable.step:.3g} s; {end}"
    return [right._replace(value=stable.step, predicted=limit, cause=cause, observed=stable.step, note=note)]


def failed(item: str, case: str, reason: str) -> Row:
    """A case that raised, took too long or lost its process: that is what must not happen."""
    return Row(item, case, math.nan, MUTE, True, "an end", note=reason)


def missed(rows: Sequence[Row]) -> list[Row]:
    """No end or no sentence; or a case that somebody could mean and that is not right."""
    return [row for row in rows if row.verdict == MUTE or (row.sensible and row.verdict != RIGHT)]
