"""Phases of the run as a table: what it did when, and how."""

from __future__ import annotations

from orchestrator.results.analyses.phases import HELD, Phase, called
from orchestrator.results.page.sections import Pair, Section, table
from orchestrator.results.page.study import Study
from orchestrator.results.page.words import instance, number, quantity, text

TOLD = (
    "Found from speed and yaw rate of the hull. Speed, power of the drives, slip of the links on the ground and yaw"
    f" rate are means over the phase, in brackets the largest yaw rate, over {HELD:g} s. To the left is positive."
)
HEAD = ("Phase", "From, s", "To, s", "Way", "Speed", "Yaw rate", "Radius", "Power", "Slip", "Largest link tension")


def phases(pair: Pair) -> Section | None:
    """Of the run, and of the reference; nothing where no hull moved."""
    if not pair.run.phases:
        return None
    html = f"<p class='muted'>{TOLD}</p>{_table(pair.run)}"
    if pair.reference and pair.reference.phases:
        html += f"<h3>Of the reference</h3>{_table(pair.reference)}"
    return Section("phases", "Phases", "What did it do, and when?", html, {})


def _table(study: Study) -> str:
    return table(HEAD, [_row(one) for one in study.phases], "phases")


def _row(one: Phase) -> tuple[str, ...]:
    speed = quantity(one.speed, "m/s")
    if one.kind in ("acceleration", "braking"):
        speed += f"<br><span class='muted'>{number(one.speed_start, 3)} to {number(one.speed_end, 3)}</span>"
    tension = f"{quantity(one.tension, 'N')}<br><span class='muted'>{instance(one.tension_track)}, at"
    tension += f" {number(one.tension_t)} s</span>"
    slips = [f"{number(slip, 3)}" for slip in (one.slip_left, one.slip_right) if slip == slip]
    turns = (f"{number(one.yaw_rate, 3)} ({number(one.yaw_rate_most, 3)}) rad/s", quantity(one.radius, "m"))
    return (
        f"<b>{text(called(one))}</b>",
        number(one.start),
        number(one.end),
        quantity(one.way, "m"),
        speed,
        *(turns if one.turning else ("", "")),
        quantity(one.power, "W", 3) if one.power == one.power else "",
        f"{' / '.join(slips)} m/s" if slips else "",
        tension if one.tension_track else "",
    )
