"""Means over the last part of a run: motion, drives, tracks, and where the power goes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.energy import STORED
from orchestrator.results.page.balance import KINDS
from orchestrator.results.page.sections import Pair, Section, table
from orchestrator.results.page.words import instance, number, percent, quantity
from orchestrator.results.run_data import RunData, Window, mean

PART, LONGEST = 0.25, 10.0  # of the run, and s
LEAST = 1e-3  # W
SMALL = 1e-3  # of the largest power: less is left out
CHASSIS, TRACK, DRIVE = "chassis", "track", "drive"
MEANS = (  # output, what it is called, its unit in the kind of instance that has it
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
NONE = np.zeros(0)
FLOWS = ("work", "dissipated", "covered", *STORED)


class Flow(NamedTuple):
    """Mean power, W; positive is put in."""

    name: str
    power: float


def window_of(span: tuple[float, float]) -> Window:
    """The last part of a run, s."""
    start, end = span
    return Window(end - min(PART * (end - start), LONGEST), end)


def ending(pair: Pair) -> Section | None:
    """What it was like in the end; nothing where the record has no two steps there."""
    study, reference = pair.run, pair.reference
    window = window_of(study.span)
    own = _recorded(study.run, window)
    if not any(len(t) > 1 for t, _ in own.values()):
        return None
    others = [_recorded(reference.run, window)] if reference and reference.span == study.span else []
    rows = _means(study.run, [own, *others])
    html = f"<p>Means from {number(window.start)} to {number(window.end)} s, the last part of the run.</p>"
    means = table(("Mean", "Run" if others else "", *["Reference"] * len(others)), rows)
    html += f"<div class='grid'><div>{means}</div><div>{_powers(flows(study.run, own))}</div></div>"
    return Section("ending", "In the end", "What was it like in the end?", html, {})


def _recorded(run: RunData, window: Window) -> dict[str, tuple[Floats, Floats]]:
    """Times and values within the window of all outputs that are asked for, by their names; in one pass."""
    asked = [f"energy.{kind}" for kind in FLOWS] + [output for output, *_ in MEANS]
    names = [f"{name}.{output}" for name in run.instances for output in asked if run.has(f"{name}.{output}")]
    wanted: dict[str, list[int]] = {}
    places = [run.log.find(name) for name in names]
    for topic, column in places:
        wanted.setdefault(topic, []).append(column)
    found = run.log.select(wanted, window)
    return {
        name: (found[topic].t, found[topic].values[:, wanted[topic].index(column)])
        for name, (topic, column) in zip(names, places, strict=True)
    }


def _means(run: RunData, recorded: list[dict[str, tuple[Floats, Floats]]]) -> list[tuple[str, ...]]:
    """A row for each output, with the values of all instances that have it."""
    kinds = {name: TRACK if name in run.tracks else CHASSIS if name == CHASSIS else DRIVE for name in run.instances}
    rows = []
    for output, called, units in MEANS:
        for kind, unit in units.items():
            names = [name for name in run.instances if kinds[name] == kind and f"{name}.{output}" in recorded[0]]
            cells = [
                "<br>".join(_told(each, name, output, unit, kind) for name in names if f"{name}.{output}" in each)
                for each in recorded
            ]
            if names:
                rows.append((called, *cells))
    return rows


def _told(recorded: dict[str, tuple[Floats, Floats]], name: str, output: str, unit: str, kind: str) -> str:
    value = quantity(mean(*recorded[f"{name}.{output}"]), unit)
    return value if kind == CHASSIS else f"{value} <span class='muted'>{instance(name)}</span>"


def flows(run: RunData, recorded: dict[str, tuple[Floats, Floats]]) -> list[Flow]:
    """Work put in, lost and stored a second; a half vehicle counts for both sides. Their sum is unaccounted for."""
    found, stored = [], dict.fromkeys(STORED, 0.0)
    for name in run.instances:
        both = ", both sides" if run.copies(name) > 1 else ""

        def power(kind: str, name: str = name) -> float:
            t, values = recorded.get(f"{name}.energy.{kind}", (NONE, NONE))
            return run.copies(name) * float(values[-1] - values[0]) / float(t[-1] - t[0]) if len(t) > 1 else 0.0

        found.append(Flow(f"put in by the {instance(name)}{both}", power("work")))
        found.append(Flow(f"dissipated in the {instance(name)}{both}", -power("dissipated")))
        found.append(Flow(f"lost as contacts move along links, {instance(name)}{both}", -power("covered")))
        for kind in STORED:
            stored[kind] += power(kind)
    how = {kind: "stored in" if power > 0.0 else "given back by" for kind, power in stored.items()}
    return found + [Flow(f"{how[kind]} {KINDS[kind]}", -power) for kind, power in stored.items()]


def _powers(found: list[Flow]) -> str:
    """As a table, the largest givers first; nothing where next to nothing flows."""
    largest = max((abs(flow.power) for flow in found), default=0.0)
    if not largest > LEAST:
        return ""
    given = max(sum(flow.power for flow in found if flow.power > 0.0), LEAST)
    shown = [flow for flow in sorted(found, key=lambda flow: -flow.power) if abs(flow.power) > SMALL * largest]
    left = sum(flow.power for flow in found)
    if rest := left - sum(flow.power for flow in shown):
        shown.append(Flow("all smaller ones together", rest))
    rows = [(flow.name, quantity(flow.power, "W"), percent(flow.power / given)) for flow in shown]
    rows.append(("<b>sum, unaccounted for</b>", quantity(left, "W", 3), percent(left / given, 2)))
    head = "Where power comes from, and (\N{MINUS SIGN}) where it goes", "", "of what comes"
    return table(head, rows)
