"""Section with means over the last part of a run: motion, drives, tracks, and powers."""

from __future__ import annotations

from typing import NamedTuple

from orchestrator.results.energy import STORED, powers
from orchestrator.results.page.balance import KINDS
from orchestrator.results.page.section import PageSection, Pair, table
from orchestrator.results.page.words import instance, quantity
from orchestrator.results.run_data import RunData, Window
from orchestrator.results.units import number, percent

PART, LONGEST = 0.25, 10.0  # of the run, and s
LEAST = 1e-3  # W
SMALL = 1e-3  # of the largest power: smaller ones are added up
CHASSIS, TRACK, DRIVE = "chassis", "track", "drive"
MEANS = (  # output, its name, and its unit by the kind of instance
    ("speed", "speed of the hull", {CHASSIS: "m/s"}),
    ("speed", "speed of the chain along itself", {TRACK: "m/s"}),
    ("speed", "speed of the sprocket", {DRIVE: "rad/s"}),
    ("torque", "torque", {DRIVE: "N.m"}),
    ("power", "power of the motor", {DRIVE: "W"}),
    ("slip", "rearward slip of the pads", {TRACK: "m/s"}),
    ("tension.mean", "mean tension", {TRACK: "N"}),
    ("tension.max", "largest tension, on average", {TRACK: "N"}),
    ("tension.min", "smallest tension, on average", {TRACK: "N"}),
)


class Flow(NamedTuple):
    """Mean power of one source or sink."""

    name: str  # HTML
    power: float  # W, positive is put in


def window_of(span: tuple[float, float]) -> Window:
    """Last part of a run of that time span, s."""
    start, end = span
    return Window(end - min(PART * (end - start), LONGEST), end)


def ending(pair: Pair) -> PageSection | None:
    """Section with means of the run and its reference; None if the run has fewer than two steps there."""
    run, reference = pair.run.run, pair.reference and pair.reference.run
    window = window_of(run.span)
    runs = [run, *([reference] if reference and reference.span == run.span else [])]
    sample_counts = [_read(data, window) for data in runs]
    if sample_counts[0] < 2:
        return None
    html = f"<p>Means from {number(window.start)} to {number(window.end)} s, the last part of the run.</p>"
    means = table(("Mean", "Run" if runs[1:] else "", *["Reference"] * len(runs[1:])), _means(runs, window))
    html += f"<div class='grid'><div>{means}</div><div>{_powers(flows(run, window))}</div></div>"
    return PageSection("ending", "In the end", "What was it like in the end?", html, {})


def _read(run: RunData, window: Window) -> int:
    """Read all outputs of the section in one pass; return the largest number of their samples."""
    outputs = {f"energy.{kind}" for kind in ("work", "dissipated", "covered", "towed", *STORED)} | {
        data[0] for data in MEANS
    }
    names = [f"{name}.{output}" for name in run.instances for output in outputs if run.has(f"{name}.{output}")]
    run.prefetch(names, window)
    return max((len(run.signal(name, window)[0]) for name in names), default=0)


def _means(runs: list[RunData], window: Window) -> list[tuple[str, ...]]:
    """Row for each output, with the values of all instances that have it."""
    run = runs[0]
    kinds = {name: TRACK if name in run.tracks else CHASSIS if name == CHASSIS else DRIVE for name in run.instances}
    rows = []
    for output, title, units in MEANS:
        for kind, unit in units.items():
            names = [name for name in run.instances if kinds[name] == kind and run.has(f"{name}.{output}")]
            cells = [
                "<br>".join(
                    quantity(data.mean(f"{name}.{output}", window), unit)
                    + ("" if kind == CHASSIS else f" <span class='muted'>{instance(name)}</span>")
                    for name in names
                    if data.has(f"{name}.{output}")
                )
                for data in runs
            ]
            if names:
                rows.append((title, *cells))
    return rows


def flows(run: RunData, window: Window) -> list[Flow]:
    """Work put in, lost and stored a second; a half vehicle counts for both sides. Their sum is unaccounted for."""
    all_flows, stored = [], dict.fromkeys(STORED, 0.0)
    for name, power in powers(run, window).items():
        place = f"{instance(name)}{', both sides' if run.copies(name) > 1 else ''}"
        all_flows.append(Flow(f"put in by the {place}", power.get("work", 0.0)))
        all_flows.append(Flow(f"dissipated in the {place}", -power.get("dissipated", 0.0)))
        all_flows.append(Flow(f"lost as contacts move along links, {place}", -power.get("covered", 0.0)))
        all_flows.append(Flow(f"put into what the {place} tows", -power.get("towed", 0.0)))
        for kind in STORED:
            stored[kind] += power.get(kind, 0.0)
    how = {kind: "stored in" if power > 0.0 else "given back by" for kind, power in stored.items()}
    return all_flows + [Flow(f"{how[kind]} {KINDS[kind]}", -power) for kind, power in stored.items()]


def _powers(flows: list[Flow]) -> str:
    """Table of powers, the largest sources first, HTML; empty without power."""
    largest = max((abs(flow.power) for flow in flows), default=0.0)
    if not largest > LEAST:
        return ""
    supplied = max(sum(flow.power for flow in flows if flow.power > 0.0), LEAST)
    large_flows = [flow for flow in sorted(flows, key=lambda flow: -flow.power) if abs(flow.power) > SMALL * largest]
    unaccounted = sum(flow.power for flow in flows)
    if rest := unaccounted - sum(flow.power for flow in large_flows):
        large_flows.append(Flow("all smaller ones together", rest))
    rows = [(flow.name, quantity(flow.power, "W"), percent(flow.power / supplied)) for flow in large_flows]
    rows.append(("<b>sum, unaccounted for</b>", quantity(unaccounted, "W", 3), percent(unaccounted / supplied, 2)))
    head = "Where power comes from, and (\N{MINUS SIGN}) where it goes", "", "of what comes"
    return table(head, rows, "numbers")
