"""Section with the phases of the run: rest, acceleration, steady motion, turns and braking."""

from __future__ import annotations

from orchestrator.results.analyses.phases import HELD, Phase, phase_name, rounded
from orchestrator.results.page.evaluation import Evaluation
from orchestrator.results.page.section import PageSection, Pair, table
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


def _table(evaluation: Evaluation) -> str:
    return table(HEAD, [_row(phase) for phase in evaluation.phases], "phases")


def _row(phase: Phase) -> tuple[str, ...]:
    speed = f"{phase.speed:.3f}"
    if phase.kind in ("acceleration", "braking"):
        speed += f"<br><span class='muted'>{rounded(phase.speed_start)} to {rounded(phase.speed_end)}</span>"
    slips = " / ".join(f"{slip:.3f}" for slip in (phase.slip_left, phase.slip_right) if slip == slip)
    tension = f"{quantity(phase.tension, 'N')}<br><span class='muted'>{instance(phase.tension_track)}, at"
    tension += f" {number(phase.tension_t)} s</span>"
    name, _, turning = phase_name(phase).partition(", ")
    cells = (
        f"<b>{text(name)}</b>" + (f"<br><span class='muted'>{text(turning)}</span>" if turning else ""),
        number(phase.start),
        number(phase.end),
        f"{phase.way:.2f}",
        speed,
        f"{phase.yaw_rate:.3f} ({phase.yaw_rate_most:.3f})" if phase.turning else "",
        number(phase.radius, 3) if phase.turning else "",
        f"{phase.power / 1e3:.2f}" if phase.power == phase.power else "",
        slips,
        tension if phase.tension_track else "",
    )
    return tuple(cell.replace("-0.000", "0.000").replace("-", "\N{MINUS SIGN}") for cell in cells)
