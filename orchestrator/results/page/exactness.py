"""Section with the estimated error of every observable, from the closing record."""

from __future__ import annotations

import math
from typing import Any

from orchestrator.results.page.section import PageSection, Pair, table
from orchestrator.results.page.words import quantity, text
from orchestrator.results.units import percent

ABOUT = (
    "RMS over the run, by runs with steps twice as long. An error is relative to the observable's own RMS, or to a"
    " floor where that is small. The largest of those that count is the error of the run. Coupling is the part of the"
    " communication step, integration that of the steps inside components; they have signs and may cancel, so that the"
    " whole is smaller than each. What many links or both drives have is one vector, the error in its unit its length."
)
SENSITIVE = "instant by instant, sensitive: does not count"


def exactness(pair: Pair) -> PageSection:
    """Section with a row for each observable, or the reason why there is none."""
    error = pair.run.result("error")
    rows = _rows(error.get("observables")) if isinstance(error, dict) else []
    if rows:
        head = "Observable", "Relative", "Coupling", "Integration", "Estimated error"
        html = f"<p>{ABOUT}</p>{table(head, rows, 'numbers')}"
    else:
        message = text(error.get("message") or "") if isinstance(error, dict) else ""
        reason = message or "no coarser run was made beside it (<code>cotrack run</code> makes one by default)"
        html = f"<p>The error of this run was not estimated: {reason}.</p>"
    return PageSection("exactness", "Error", "How large is the error of its steps?", html, {})


def _rows(observables: Any) -> list[tuple[str, ...]]:
    """Rows of observables, decisive ones first, the largest error first; without errors that are no numbers."""
    named = observables.items() if isinstance(observables, dict) else ()
    numeric = [
        (name, observable)
        for name, observable in named
        if isinstance(observable, dict) and _is_number(observable.get("total"))
    ]
    return [
        (
            text(name.replace("_", " "))
            + ("" if observable.get("decisive") else f"<br><span class='muted'>{SENSITIVE}</span>"),
            f"<b>{percent(observable['total'], 2)}</b>"
            if observable.get("decisive")
            else percent(observable["total"], 2),
            *(
                percent(observable[part], 2) if _is_number(observable.get(part)) else ""
                for part in ("coupling", "integration")
            ),
            quantity(observable["absolute"], str(observable.get("unit", "")).replace("N m", "N.m"), 3)
            if _is_number(observable.get("absolute"))
            else "",
        )
        for name, observable in sorted(numeric, key=lambda item: (not item[1].get("decisive"), -item[1]["total"]))
    ]


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
