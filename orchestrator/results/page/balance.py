"""Where the work of the drives went: the ledger's sums, by what holds it, who lost it, and by what."""

from __future__ import annotations

from typing import NamedTuple

from orchestrator.log.described import said_of
from orchestrator.results.energy import CAUSE, STORED, Ledger
from orchestrator.results.page.words import and_list, instance, percent, quantity
from orchestrator.results.run_data import RunData

KINDS = {
    "kinetic": "motion",
    "gravity": "height",
    "strain": "strain of links",
    "spring": "springs",
    "contact": "contacts",
}


class Loss(NamedTuple):
    """What a component lost: it gives no more than these sums, so their parts are known by name alone."""

    dissipated: float  # J, both sides of a half vehicle
    covered: float  # J, as contacts moved along links, both sides
    parts: str  # what is in the first: by cause, or as its model description says


class Balance(NamedTuple):
    """Energies over the run, J."""

    stored: dict[str, float]  # by kind, as in STORED: change
    losses: dict[str, Loss]  # by component
    ledger: Ledger

    @property
    def lost(self) -> dict[str, float]:
        """What was dissipated by component, J, both sides of a half vehicle."""
        return {name: loss.dissipated for name, loss in self.losses.items()}


def balance(run: RunData, found: Ledger) -> Balance:
    """The parts of a ledger's sums; raises Missing, LogUnreadable."""
    stored = dict.fromkeys(STORED, 0.0)
    losses = {}

    def change(name: str, kind: str) -> float:
        first, last = run.ends(f"{name}.energy.{kind}") if run.has(f"{name}.energy.{kind}") else (0.0, 0.0)
        return run.copies(name) * (last - first)

    for name in run.instances:
        for kind in STORED:
            stored[kind] += change(name, kind)
        if run.has(f"{name}.energy.dissipated"):
            parts = _causes(run, name) or said_of(run.log, f"{name}.energy.dissipated")
            losses[name] = Loss(change(name, "dissipated"), change(name, "covered"), parts)
    return Balance({kind: energy for kind, energy in stored.items() if energy}, losses, found)


def _causes(run: RunData, name: str) -> str:
    """What a component lost by each cause, the most first; nothing where it does not say."""
    topic = run.log.topics.get(f"/{name}/out")
    prefix = f"energy.{CAUSE}"
    found = {}
    for output in (each for each in (topic.names if topic else ()) if each.startswith(prefix)):
        first, last = run.ends(f"{name}.{output}")
        found[output.removeprefix(prefix).replace("_", " ")] = run.copies(name) * (last - first)
    parts = sorted(((cause, lost) for cause, lost in found.items() if lost), key=lambda each: -abs(each[1]))
    return ", ".join(f"{cause} {quantity(lost, 'J')}" for cause, lost in parts)


def sentence(found: Balance) -> str:
    """In words, HTML."""
    work, change = found.ledger.work, found.ledger.change
    lost, left = found.ledger.dissipated, found.ledger.residual
    scale = max(abs(work), abs(change), abs(lost))
    if scale < 1e-3:
        return "Next to no energy moved in this run."
    told = []
    if abs(work) > 1e-6 * scale:
        told.append(f"The drives put in <b>{quantity(work, 'J')}</b>.")
    kinds = sorted(found.stored.items(), key=lambda each: -abs(each[1]))
    kinds = [(kind, energy) for kind, energy in kinds if abs(energy) > 0.01 * scale][:3]
    of_work = f" ({percent(change / work)} of the work)" if work > 1e-3 * scale else ""
    named = [f"{KINDS[kind]} {quantity(energy, 'J')}" for kind, energy in kinds]
    parts = f": {and_list(named)}" if named else ""
    verb = "more" if change >= 0.0 else "less"
    told.append(f"At the end {quantity(abs(change), 'J')}{of_work} {verb} is stored than at the start{parts}.")
    losers = sorted(found.lost.items(), key=lambda each: -abs(each[1]))[:3]
    named = [f"{instance(name)} {quantity(energy, 'J')}" for name, energy in losers if abs(energy) > 0.01 * abs(lost)]
    most = f", most of it in {and_list(named)}" if named else ""
    of_work = f" ({percent(lost / work)})" if work > 1e-3 * scale else ""
    told.append(f"{quantity(lost, 'J')}{of_work} was dissipated{most}.")
    told.append(
        f"{quantity(left, 'J')} is unaccounted for, {percent(found.ledger.residual_relative, 2)} of the largest sum:"
        " that is an error of the steps, not a physical loss."
    )
    return " ".join(told)
