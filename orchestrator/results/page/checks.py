"""Section with the checks of the scene."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any

from orchestrator.results import measures
from orchestrator.results.page.section import PageSection, Pair, table
from orchestrator.results.page.words import and_list, plain, text
from orchestrator.results.units import number

HEAD = ("Check", "Value", "Expected", "Tolerance", "Verdict")


def checks(pair: Pair) -> PageSection:
    """Section with the value, expectation and verdict of each check."""
    evaluation = pair.run
    expected = evaluation.run.scene.get("expect")
    rows = [_row(name, check, expected) for name, check in evaluation.summary.checks.items()]
    left_out = [text(plain(name)) for name in evaluation.summary.after_end]
    if rows:
        html = "<p>Made anew from this record when the page was written. Ratios and counts have no unit.</p>"
        html += table(HEAD, rows, "checks")
    else:
        html = ""
    if evaluation.summary.note:
        html += f"<p>Checks were not made: {text(evaluation.summary.note)}.</p>"
    elif not rows:
        html += "<p>This record names no check to make. The page shows what happened, not whether it is right.</p>"
    if left_out and not evaluation.summary.note:
        html += (
            f"<p>Not made, because the record does not reach the end of what they look at: {and_list(left_out)}.</p>"
        )
    return PageSection("checks", "Checks", "Did the checks hold?", html, {})


def _row(name: str, check: Any, expected: Any) -> tuple[str, ...]:
    entry = expected.get(name) if isinstance(expected, dict) else None
    note = f'<br><span class="muted">{text(check["note"])}</span>' if check["note"] else ""
    return (
        f"<b>{text(name.replace('_', ' '))}</b><br><span class='muted'>{_subject(entry)}</span>{_reason(entry)}{note}",
        number(check["value"], 6),
        number(check["expected"], 6),
        f"\N{PLUS-MINUS SIGN} {number(check['tolerance'], 3)}",
        '<span class="pill good">met</span>' if check["ok"] else '<span class="pill bad">not met</span>',
    )


def _measure(check: Any) -> Callable[..., Any] | None:
    return measures.NAMES.get(str(check.get("measure"))) if isinstance(check, dict) else None


def _paragraphs(measure: Callable[..., Any]) -> list[str]:
    """Paragraphs of a measure's docstring: its meaning and, after that, the reason of its bounds."""
    return [" ".join(part.split()) for part in (measure.__doc__ or "").split("\n\n")]


def _reason(check: Any) -> str:
    """Reason of a check's bounds, HTML; empty if its measure does not give one."""
    measure = _measure(check)
    reasons = _paragraphs(measure)[1:] if measure else []
    return "".join(f'<br><span class="muted why">{escape(part.replace("``", ""))}</span>' for part in reasons)


def _subject(check: Any) -> str:
    """Measured quantity and window of a check, HTML."""
    if not isinstance(check, dict):
        return ""
    measure = _measure(check)
    if measure is not None:
        what = text(_paragraphs(measure)[0].partition("; raises ")[0].rstrip("."))
    else:
        what = f"{text(check.get('reduce', ''))} of {text(check.get('signal', ''))}"
    of = f", {text(check['of'])}" if check.get("of") else ""
    try:
        start, end = float(check.get("from") or 0.0), check.get("to")
        when = f"; {number(start)} to {number(float(end))} s" if end is not None else f"; from {number(start)} s on"
    except (TypeError, ValueError):
        when = ""
    return f"{what}{of}{when}"
