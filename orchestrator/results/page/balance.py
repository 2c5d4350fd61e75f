"""Sections with the energy balance by component, and with means over the last part of a run."""

from __future__ import annotations

from typing import NamedTuple

from orchestrator.log.recorded_system import signal_description
from orchestrator.results.energy import CAUSE, STORED, STORED_ENERGIES, Ledger, changes, powers
from orchestrator.results.page.embedded import instance, plain, quantity, text
from orchestrator.results.page.section import Content, PageSection, Pair, Trace, lines, table, waterfall
from orchestrator.results.run_data import RunData, Window
from orchestrator.results.units import number, percent
from orchestrator.vocabulary import and_list

SHARE, SMALL = 1e-4, 5e-3  # of the supplied energy: smaller parts are left out, or not named by kind
NAMES = {"work": "put in", "stored": "stored", "lost": "lost"}
BARS = "Each bar begins where the one above ends: what is stored or lost is taken from what came in."
LOSSES = "A component gives the sum of its losses, not their parts: what is in it is told in the words of its FMU."
PARTS = "By the integration of each component (of one, where the vehicle has two alike), and by the coupling."


class Loss(NamedTuple):
    """Energy lost by a component."""

    dissipated: float  # J, both sides of a half vehicle
    covered: float  # J, as contacts moved along links, both sides
    parts: str  # of the dissipated energy: by cause, or the description in the model description


def losses(run: RunData) -> dict[str, Loss]:
    """Losses of each component that has any; raises Missing, LogUnreadable."""
    by_component = {}
    for name, account in changes(run).items():
        if "dissipated" in account:
            copies = run.copies(name)
            causes = {
                part.removeprefix(CAUSE): copies * lost for part, lost in account.items() if part.startswith(CAUSE)
            }
            parts = _causes(causes) or signal_description(run.log, f"{name}.energy.dissipated")
            by_component[name] = Loss(copies * account["dissipated"], copies * account.get("covered", 0.0), parts)
    return by_component


def _causes(causes: dict[str, float]) -> str:
    """Losses by cause, the largest first; empty without causes."""
    parts = sorted(((cause, lost) for cause, lost in causes.items() if lost), key=lambda each: -abs(each[1]))
    return ", ".join(f"{cause.replace('_', ' ')} {quantity(lost, 'J')}" for cause, lost in parts)


def sources(ledger: Ledger) -> str:
    """Sources of energy, HTML: "53.26 kJ put in by the drives and 3.658 kJ released (height)"."""
    return and_list(_sources(ledger))


def supply(ledger: Ledger) -> str:
    """Sources of energy after their sum if there are two: "56.92 kJ: 53.26 kJ put in by the drives and ..."."""
    total = f"{quantity(ledger.supplied, 'J')}: " if len(_sources(ledger)) > 1 else ""
    return total + sources(ledger)


def _sources(ledger: Ledger) -> list[str]:
    released = {kind: -energy for kind, energy in ledger.stored.items() if -energy > SHARE * ledger.supplied}
    parts = [f"{quantity(ledger.work, 'J')} put in by the drives"] if ledger.work > 0.0 else []
    parts += [
        f"{quantity(-energy, 'J')} delivered by {instance(name)}"
        for name, energy in ledger.delivered.items()
        if -energy > SHARE * ledger.supplied
    ]
    if released:
        kinds = and_list([STORED_ENERGIES[kind] for kind in sorted(released, key=lambda kind: -released[kind])])
        parts.append(f"{quantity(sum(released.values()), 'J')} released ({kinds})")
    return parts


def sentence(ledger: Ledger, component_losses: dict[str, Loss]) -> str:
    """Balance in sentences, HTML."""
    supplied = ledger.supplied
    if max(supplied, abs(ledger.dissipated)) < 1e-3:
        return "Next to no energy moved in this run."
    sentences = [f"<b>{quantity(supplied, 'J')}</b> came in: {sources(ledger)}."] if supplied > 0.0 else []
    if ledger.work < -SHARE * supplied:
        sentences.append(f"{quantity(-ledger.work, 'J')}{_share(-ledger.work, supplied)} went back into the drives.")
    kinds = sorted(
        ((kind, energy) for kind, energy in ledger.stored.items() if energy > 0.0), key=lambda item: -item[1]
    )
    if stored := sum(energy for _, energy in kinds):
        named = [
            f"{STORED_ENERGIES[kind]} {quantity(energy, 'J')}" for kind, energy in kinds if energy > SMALL * supplied
        ]
        parts = f": {and_list(named)}" if named else ""
        sentences.append(f"{quantity(stored, 'J')}{_share(stored, supplied)} is stored at the end{parts}.")
    sentences += [
        f"{quantity(energy, 'J')}{_share(energy, supplied)} was delivered to {instance(name)}, an FMU without energies:"
        " what became of it there is unknown."
        for name, energy in ledger.delivered.items()
        if energy > 0.0
    ]
    losers = sorted(
        ((name, loss.dissipated) for name, loss in component_losses.items()), key=lambda item: -abs(item[1])
    )[:3]
    named = [f"{instance(name)} {quantity(loss, 'J')}" for name, loss in losers if loss > 0.01 * ledger.dissipated]
    most = f", most of it in {and_list(named)}" if named else ""
    sentences.append(f"{quantity(ledger.dissipated, 'J')}{_share(ledger.dissipated, supplied)} was dissipated{most}.")
    sentences.append(
        f"{quantity(ledger.residual, 'J')} is unaccounted for, {percent(ledger.residual_relative, 2)} of the largest"
        " sum: that is an error of the steps, not a physical loss."
    )
    return " ".join(sentences)


def _share(energy: float, supplied: float) -> str:
    return f" ({percent(energy / supplied)})" if supplied > 1e-3 * abs(energy) else ""


def energy(pair: Pair) -> PageSection | None:
    """Section of the energy balance; None without a ledger."""
    run, ledger = pair.run.run, pair.run.ledger
    if ledger is None:
        return None
    component_losses = losses(run)
    content = Content()
    content.html = f'<p class="lead">{sentence(ledger, component_losses)}</p>'
    if max(abs(ledger.work), abs(ledger.change), abs(ledger.dissipated)) > 1e-3:
        chart = waterfall(_bars(run, ledger, component_losses))
        content.add_figure("energy", chart, "From what was put in to what is unaccounted for", BARS, "tall")
        if drawn := _curves(pair):
            chart = lines("energy", "J", drawn)
            content.add_figure("energy-time", chart, "Energy since the start", "All components together.")
    parts = [(instance(name), quantity(left, "J", 3)) for name, left in ledger.integration.items()]
    parts.append(("ports between components", quantity(ledger.port, "J", 3)))
    content.html += (
        f"{_losses(run, component_losses)}<details><summary>Which part makes what is unaccounted for</summary>"
        f"<p class='muted'>{PARTS}</p>{table(('Component', 'Unaccounted for'), parts)}</details>"
    )
    return PageSection("energy", "Energy", "Where does the work go?", content.html, content.charts)


def _bars(run: RunData, ledger: Ledger, component_losses: dict[str, Loss]) -> list[tuple[str, float, str]]:
    """Name, energy, J, and role of each bar, without bars too small to be seen."""
    rows = [("put in by drives", ledger.work, "work")]
    rows += [
        (f"released: {STORED_ENERGIES[kind]}", change, "stored")
        for kind, change in ledger.stored.items()
        if change < 0.0
    ]
    rows += [
        (f"stored: {STORED_ENERGIES[kind]}", change, "stored") for kind, change in ledger.stored.items() if change > 0.0
    ]
    rows += [
        (f"dissipated: {plain(name)}{_sides(run, name)}", loss.dissipated, "lost")
        for name, loss in component_losses.items()
        if loss.dissipated
    ]
    rows += [
        (f"delivered {'by' if energy < 0.0 else 'to'} {plain(name)}", energy, "stored")
        for name, energy in ledger.delivered.items()
    ]
    rows.append(("lost: contacts moving along links", ledger.covered, "lost"))
    rows.append(("done on the towed load", ledger.towed, "lost"))
    least = 1e-5 * max(abs(amount) for _, amount, _ in rows)
    return [*(row for row in rows if abs(row[1]) > least), ("unaccounted for", ledger.residual, "open")]


def _sides(run: RunData, name: str) -> str:
    return ", both sides" if run.copies(name) > 1 else ""


def _curves(pair: Pair) -> list[Trace]:
    """Energies over time of the run and its reference."""
    return [
        Trace(f"{NAMES[part]}{', reference' * is_reference}", curve, k, reference=bool(is_reference))
        for is_reference, (evaluation, _) in enumerate(pair.named)
        for k, (part, curve) in enumerate(evaluation.energies.items())
    ]


def _losses(run: RunData, component_losses: dict[str, Loss]) -> str:
    """Table of the losses of each component and their causes, HTML."""
    nonzero = {name: loss for name, loss in component_losses.items() if loss.dissipated or loss.covered}
    if not nonzero:
        return ""
    whole = sum(loss.dissipated + loss.covered for loss in nonzero.values())
    rows = [
        (
            f"{instance(name)}{_sides(run, name)}<br>"
            f"<span class='muted'>{text(loss.parts) or 'its model description does not say'}</span>",
            quantity(loss.dissipated, "J"),
            quantity(loss.covered, "J", 3) if loss.covered else "",
            percent((loss.dissipated + loss.covered) / whole) if whole else "",
        )
        for name, loss in nonzero.items()
    ]
    head = "Component, and what its losses are", "Dissipated", "Contacts moving<br>along links", "Of all losses"
    return f"<h3>What was lost where</h3><p class='muted'>{LOSSES}</p>{table(head, rows, 'numbers')}"


PART, LONGEST = 0.25, 10.0  # of the run, and s
LEAST = 1e-3  # W
MINOR = 1e-3  # of the largest power: smaller ones are added up
CHASSIS, TRACK, DRIVE = "chassis", "track", "drive"
MEANS = (  # output, its name, kind of its instances, and unit
    ("speed", "speed of the hull", CHASSIS, "m/s"),
    ("speed", "speed of the chain along itself", TRACK, "m/s"),
    ("speed", "speed of the sprocket", DRIVE, "rad/s"),
    ("torque", "torque", DRIVE, "N.m"),
    ("power", "power of the motor", DRIVE, "W"),
    ("slip", "rearward slip of the pads", TRACK, "m/s"),
    ("tension.mean", "mean tension", TRACK, "N"),
    ("tension.max", "largest tension, on average", TRACK, "N"),
    ("tension.min", "smallest tension, on average", TRACK, "N"),
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
    for output, title, kind, unit in MEANS:
        owners = {
            name: "" if kind == CHASSIS else f" <span class='muted'>{instance(name)}</span>"
            for name in run.instances
            if kinds[name] == kind and run.has(f"{name}.{output}")
        }
        cells = [
            "<br>".join(
                f"{quantity(data.mean(f'{name}.{output}', window), unit)}{owner}"
                for name, owner in owners.items()
                if data.has(f"{name}.{output}")
            )
            for data in runs
        ]
        if owners:
            rows.append((title, *cells))
    return rows


def flows(run: RunData, window: Window) -> list[Flow]:
    """Work put in, lost and stored a second; a half vehicle counts for both sides. Their sum is unaccounted for."""
    all_flows, stored = [], dict.fromkeys(STORED, 0.0)
    for name, power in powers(run, window).items():
        place = f"{instance(name)}{_sides(run, name)}"
        all_flows.append(Flow(f"put in by the {place}", power.get("work", 0.0)))
        all_flows.append(Flow(f"dissipated in the {place}", -power.get("dissipated", 0.0)))
        all_flows.append(Flow(f"lost as contacts move along links, {place}", -power.get("covered", 0.0)))
        all_flows.append(Flow(f"put into what the {place} tows", -power.get("towed", 0.0)))
        for kind in STORED:
            stored[kind] += power.get(kind, 0.0)
    how = {kind: "stored in" if power > 0.0 else "given back by" for kind, power in stored.items()}
    return all_flows + [Flow(f"{how[kind]} {STORED_ENERGIES[kind]}", -power) for kind, power in stored.items()]


def _powers(flows: list[Flow]) -> str:
    """Table of powers, the largest sources first, HTML; empty without power."""
    largest = max((abs(flow.power) for flow in flows), default=0.0)
    if not largest > LEAST:
        return ""
    supplied = max(sum(flow.power for flow in flows if flow.power > 0.0), LEAST)
    large_flows = [flow for flow in sorted(flows, key=lambda flow: -flow.power) if abs(flow.power) > MINOR * largest]
    unaccounted = sum(flow.power for flow in flows)
    if rest := unaccounted - sum(flow.power for flow in large_flows):
        large_flows.append(Flow("all smaller ones together", rest))
    rows = [(flow.name, quantity(flow.power, "W"), percent(flow.power / supplied)) for flow in large_flows]
    rows.append(("<b>sum, unaccounted for</b>", quantity(unaccounted, "W", 3), percent(unaccounted / supplied, 2)))
    head = "Where power comes from, and (\N{MINUS SIGN}) where it goes", "", "of what comes"
    return table(head, rows, "numbers")
