"""Section with the fatigue of links, of runs that recorded the stress of their fibres."""

from __future__ import annotations

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import fatigue as analysis
from orchestrator.results.analyses import link_records
from orchestrator.results.analyses.fatigue import FIBRES, TrackFatigue
from orchestrator.results.page.charts import Trace, lines
from orchestrator.results.page.evaluation import attempt
from orchestrator.results.page.section import Content, PageSection, Pair, table
from orchestrator.results.page.words import instance, plain, quantity
from orchestrator.results.run_data import RunData
from orchestrator.results.thinned import Curve
from orchestrator.results.units import hours, number

HEAD = (
    "Track", "First link to break", "Fibre", "After", "Damage, run repeated", "Damage, run once", "Cycles",
    "Largest range", "Equivalent range",
)  # fmt: skip


def fatigue(pair: Pair) -> PageSection | None:
    """Section of the fatigue of each track; None without stress of fibres, or without the library."""
    run, content = pair.run.run, Content()
    if not run.tracks or not all(_recorded(run, track) for track in run.tracks):
        return None
    result = attempt(lambda: analysis.of(run, sn=pair.line), pair.run.missing)
    if result is None:
        return None
    found = result.tracks
    drawn = [
        Trace(f"{fibre} fibre, {plain(each.track)}", _by_link(each.damage_repeated[:, column]), 2 * k + column)
        for k, each in enumerate(found)
        for column, fibre in enumerate(FIBRES)
    ]
    line, *_, counts, same, along, recorded = result.notes()
    counts, along, same = (f"{sentence[0].upper()}{sentence[1:]}." for sentence in (counts, along, same))
    note = f"Miner's sum of each link over each repeat of the run. {line}. {counts} {along} Stress is {recorded}."
    note += f" {same} Notches and mean stress are left out."
    content.add_figure("damage", lines("damage", "", drawn, x="link", timed=False), "Damage", note, "wide")
    content.html = table(HEAD, [_row(each) for each in found]) + content.html
    return PageSection("fatigue", "Fatigue", "How long do the links last?", content.html, content.charts)


def _by_link(values: Floats) -> Curve:
    return Curve(np.arange(1.0, len(values) + 1.0), values)


def _recorded(run: RunData, track: str) -> bool:
    return all(link_records.has(run, track, f"link[*].fibre.{fibre}") for fibre in FIBRES)


def _row(found: TrackFatigue) -> tuple[str, ...]:
    link, fibre = found.worst
    return (
        instance(found.track), f"link {link + 1}", FIBRES[fibre],
        f"{hours(found.life)} of this, repeated" if np.isfinite(found.life) else "none breaks",
        number(float(found.damage_repeated[link, fibre]), 3), number(float(found.damage_once[link, fibre]), 3),
        number(float(found.cycles[link, fibre])),
        quantity(float(found.largest[link, fibre]), "Pa"), quantity(float(found.equivalent[link, fibre]), "Pa"),
    )  # fmt: skip
