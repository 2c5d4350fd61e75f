"""Section with the phases of the run: rest, acceleration, steady motion, turns and braking."""

from __future__ import annotations

from orchestrator.results.analyses.phases import HELD, Phase, called, near
from orchestrator.results.page.section import PageSection, Pair, table
from orchestrator.results.page.study import Study
from orchestrator.results.page.words import instance, quantity, text
from orchestrator.results.units import number

NOTE = (
    "Found from speed and yaw rate of the hull. Speed, power of the drives, slip of the links on the ground and yaw"
    f" rate are means over the phase, in brackets the largest yaw rate, over {HELD:g} s. To the left is positive."
)
HEAD = (
    "Phase", "From, s", "To, s", "Way, m", "Speed, m/s", "Yaw rate, rad/s", "Radius, m", "Power, kW",
    "Slip left / right, m/s", "Largest link tension",
)  # fmt: skip


def phases(pair: Pair) -> PageSection | None:
    """Section with the phases of the run and its reference; None without the motion of a hull."""
    if not pair.run.phases:
        return None
    html = f"<p class='muted'>{NOTE}</p>{_table(pair.run)}"
    if pair.reference and pair.reference.phases:
        html += f"<h3>Of the reference</h3>{_table(pair.reference)}"
    return PageSection("phases", "Phases", "What did it do, and when?", html, {})


def _table(study: Study) -> str:
    return table(HEAD, [_row(one) for one in study.phases], "phases")


def _row(one: Phase) -> tuple[str, ...]:
    speed = f"{one.speed:.3f}"
    if one.kind in ("acceleration", "braking"):
        speed += f"<br><span class='muted'>{near(one.speed_start)} to {near(one.speed_end)}</span>"
    slips = " / ".join(f"{slip:.3f}" for slip in (one.slip_left, one.slip_right) if slip == slip)
    tension = f"{quantity(one.tension, 'N')}<br><span class='muted'>{instance(one.tension_track)}, at"
    tension += f" {number(one.tension_t)} s</span>"
    name, _, turning = called(one).partition(", ")
    cells = (
        f"<b>{text(name)}</b>" + (f"<br><span class='muted'>{text(turning)}</span>" if turning else ""),
        number(one.start),
        number(one.end),
        f"{one.way:.2f}",
        speed,
        f"{one.yaw_rate:.3f} ({one.yaw_rate_most:.3f})" if one.turning else "",
        number(one.radius, 3) if one.turning else "",
        f"{one.power / 1e3:.2f}" if one.power == one.power else "",
        slips,
        tension if one.tension_track else "",
    )
    return tuple(cell.replace("-0.000", "0.000").replace("-", "\N{MINUS SIGN}") for cell in cells)
