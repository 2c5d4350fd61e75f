"""HTML of a page: head, sections, data, style, script and the plotting library."""

from __future__ import annotations

import re
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from orchestrator.log.extra import library
from orchestrator.results.analyses.fatigue import StressLifeLine
from orchestrator.results.measured_difference import MeasuredComparison
from orchestrator.results.output_files import atomic_write
from orchestrator.results.page import heading
from orchestrator.results.page.balance import ending, energy
from orchestrator.results.page.chain import fatigue, orders, tension
from orchestrator.results.page.embedded import script, text
from orchestrator.results.page.evaluation import Evaluation, RunSummary, attempt, evaluate
from orchestrator.results.page.events import event_section
from orchestrator.results.page.loads import loads
from orchestrator.results.page.motion import drive, motion, phases, turn
from orchestrator.results.page.player import player as player_of
from orchestrator.results.page.section import PageSection, Pair
from orchestrator.results.page.trust import checks, comparison, exactness, measured, provenance
from orchestrator.results.run_data import RunData
from orchestrator.results.units import number

SUFFIXES = (".html", ".htm")
# the page and its library must not request anything from other machines
POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"


def plotting() -> str:
    """Script of the plotting library; raises NotInstalled."""
    return str(library("plotly.offline", "report").get_plotlyjs())


def write(
    run: RunData,
    summary: RunSummary,
    output: Path,
    reference: tuple[RunData, RunSummary] | None = None,
    compared: MeasuredComparison | None = None,
    line: StressLifeLine | None = None,
) -> None:
    """Write the page of a run and its reference, whole or not at all; raises LogUnreadable, NotInstalled, BadInput.

    ``compared``: difference of the run from measured signals; ``line``: S-N line of the fatigue.
    """
    plots = plotting()
    page = document(evaluate(run, summary), evaluate(*reference) if reference else None, plots, compared, line)
    with atomic_write(output) as temporary:
        temporary.write_text(page, encoding="utf-8")


def document(
    run: Evaluation,
    reference: Evaluation | None,
    plots: str,
    compared: MeasuredComparison | None = None,
    line: StressLifeLine | None = None,
) -> str:
    """HTML page of a run and its reference; ``plots``: script of the plotting library. Raises LogUnreadable.

    ``compared``: difference of the run from measured signals; ``line``: S-N line of the fatigue.
    """
    figures = heading.figures(run)
    pair = Pair(run, reference, figures, compared, line)
    player = _player(run, reference)
    version = re.search(r"plotly\.js v([\d.]+)", plots[:400])
    parts = [
        checks(pair),
        exactness(pair),
        *filter(None, [phases(pair), player, comparison(pair), measured(pair)]),
        *(section for make in (ending, motion, turn, drive, orders, energy, tension, fatigue, loads)
          if (section := attempt(lambda make=make: make(pair), run.missing))),  # type: ignore[misc]
        event_section(pair),
        provenance(pair, f"plotly.js {version[1]}" if version else "plotly.js"),
    ]  # fmt: skip
    charts = {name: chart for part in parts for name, chart in part.charts.items() if name != "player"}
    data = {
        "figures": figures,
        "charts": charts,
        "player": player.charts["player"] if player else None,
        "span": list(run.run.span),
    }
    return "".join(_pieces(run, reference, figures, parts, data, plots))


def _player(run: Evaluation, reference: Evaluation | None) -> PageSection | None:
    """Section with the side view of the track with the largest tension; from above as well if the vehicle turns."""
    chain = run.most_loaded
    if chain is None:
        return None
    other = reference.chains.get(chain.track) if reference else None
    other_run = reference.run if reference and other and other.pins else None
    view = attempt(lambda: player_of(run.run, chain.track, other_run, bool(run.turns)), run.missing)
    if view is None:
        return None
    html = _VIEW.replace('<div class="controls">', f'{_ABOVE}<div class="controls">') if view["above"] else _VIEW
    return PageSection("view", "View", "What does it look like?", html, {"player": view})


_ABOVE = '<canvas id="above" role="img" aria-label="the vehicle from above"></canvas>'
_VIEW = """<figure class="player"><canvas id="picture" role="img" aria-label="side view of one track"></canvas>
<div class="controls"><button type="button" id="play" aria-label="play or pause">Play</button>
<input type="range" id="time" min="0" value="0" step="1" aria-label="time">
<output id="clock"></output>
<select id="pace" aria-label="pace"><option value="0.1">0.1 &times;</option>
<option value="0.25">&frac14; &times;</option>
<option value="0.5">&frac12; &times;</option><option value="1" selected>real time</option>
<option value="2">2 &times;</option></select></div>
<div class="legend"><span id="coloured"></span><span id="least"></span><i id="scale"></i><span id="most"></span></div>
<figcaption><p id="viewed"></p><p class="muted">At first it shows the picture nearest to the instant of the
largest tension. Space plays and
pauses, the arrow keys go picture by picture. A click on a curve over time brings that instant here. The ring is
round the link that bears the most.</p></figcaption></figure>"""


def _pieces(
    run: Evaluation,
    reference: Evaluation | None,
    figures: dict[str, Any],
    parts: Sequence[PageSection],
    data: dict[str, Any],
    plots: str,
) -> list[str]:
    """Pieces of the HTML, in order."""
    verdict, title = heading.verdict(run), heading.title(run)
    against = f", against the reference {text(reference.run.log.path.name)}" if reference else ""
    tiles = "".join(
        f'<div class="tile"><div class="label">{tile.label}</div><div class="value {tile.kind}">{tile.value}</div>'
        f'<div class="note">{tile.note}</div></div>'
        for tile in heading.tiles(run, figures)
    )
    setting = "".join(f"<div><dt>{name}</dt><dd>{value}</dd></div>" for name, value in heading.setting(run))
    contents = "".join(f'<a href="#{part.key}">{part.name}</a>' for part in parts)
    body = "".join(f'<section id="{part.key}"><h2>{part.title}</h2>{part.html}</section>' for part in parts)
    return [
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        '<meta name="color-scheme" content="light dark">',
        f'<title>{title}</title><link rel="icon" href="data:,"><style>{_asset("page.css")}</style></head><body>',
        f'<header><p class="kicker">Report of the run {text(run.run.log.path.name)}{against} &middot;'
        f" {number(run.run.span[1] - run.run.span[0])} s</p><h1>{title}</h1>",
        f'<p class="verdict {verdict.grade}"><b>{verdict.word}.</b> {verdict.sentence}</p>',
        *(
            f'<p class="verdict bad"><b>Reference.</b> {text(cut)}.</p>'
            for cut in [reference and reference.run.log.cut_off]
            if cut
        ),
        f'<div class="tiles">{tiles}</div><dl class="setting">{setting}</dl></header>',
        f'<nav aria-label="contents">{contents}</nav><main>{body}</main>',
        f'<script type="application/json" id="data">{script(data)}</script>',
        f"<script>{plots}</script><script>{_asset('page.js')}</script></body></html>\n",
    ]


def _asset(name: str) -> str:
    return files("orchestrator.results.page").joinpath(name).read_text(encoding="utf-8")
