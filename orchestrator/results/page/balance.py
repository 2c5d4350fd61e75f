"""Where the work of the drives went: the ledger's sums, by what holds it, who lost it, and by what."""

from __future__ import annotations

from typing import NamedTuple

from orchestrator.log.described import said_of
from orchestrator.results.energy import CAUSE, Ledger
from orchestrator.results.page.words import and_list, instance, percent, quantity
from orchestrator.results.run_data import RunData

KINDS = {
    "kinetic": "motion",
    "gravity": "height",
    "strain": "strain of links",
    "spring": "springs",
    "contact": "contacts",
}
SHARE, SMALL = 1e-4, 5e-3  # of what came in: less is not told, or not by its kind


class Loss(NamedTuple):
    """What a component lost: it gives no more than these sums, so their parts are known by name alone."""

    dissipated: float  # J, both sides of a half vehicle
    covered: float  # J, as contacts moved along links, both sides
    parts: str  # what is in the first: by cause, or as its model description says


class Balance(NamedTuple):
    """Energies over the run, J."""

    stored: dict[str, float]  # by kind: change, without what has none
    losses: dict[str, Loss]  # by component
    ledger: Ledger

    @property
    def lost(self) -> dict[str, float]:
        """What was dissipated by component, J, both sides of a half vehicle."""
        return {name: loss.dissipated for name, loss in self.losses.items()}


def balance(run: RunData, found: Ledger) -> Balance:
    """The parts of a ledger's sums; raises Missing, LogUnreadable."""
    losses = {}

    def change(name: str, kind: str) -> float:
        first, last = run.ends(f"{name}.energy.{kind}") if run.has(f"{name}.energy.{kind}") else (0.0, 0.0)
        return run.copies(name) * (last - first)

    for name in run.instances:
        if run.has(f"{name}.energy.dissipated"):
            parts = _causes(run, name) or said_of(run.log, f"{name}.energy.dissipated")
            losses[name] = Loss(change(name, "dissipated"), change(name, "covered"), parts)
    return Balance({kind: energy for kind, energy in found.stored.items() if energy}, losses, found)


def sources(found: Balance) -> str:
    """What the energy came from, HTML: "53.26 kJ put in by the drives and 3.658 kJ released (height)"."""
    return and_list(_sources(found))


def supply(found: Balance) -> str:
    """The same with the sum where there are two: "56.92 kJ: 53.26 kJ put in by the drives and 3.658 kJ released"."""
    total = f"{quantity(found.ledger.supplied, 'J')}: " if len(_sources(found)) > 1 else ""
    return total + sources(found)


def _sources(found: Balance) -> list[str]:
    released = {kind: -energy for kind, energy in found.stored.items() if -energy > SHARE * found.ledger.supplied}
    parts = [f"{quantity(found.ledger.work, 'J')} put in by the drives"] if found.ledger.work > 0.0 else []
    if released:
        kinds = and_list([KINDS[kind] for kind in sorted(released, key=lambda kind: -released[kind])])
        parts.append(f"{quantity(sum(released.values()), 'J')} released ({kinds})")
    return parts


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
    books, supplied = found.ledger, found.ledger.supplied
    if max(supplied, abs(books.dissipated)) < 1e-3:
        return "Next to no energy moved in this run."
    told = [f"<b>{quantity(supplied, 'J')}</b> came in: {sources(found)}."] if supplied > 0.0 else []
    if books.work < -SHARE * supplied:
        told.append(f"{quantity(-books.work, 'J')}{_share(-books.work, supplied)} went back into the drives.")
    kinds = sorted(((kind, energy) for kind, energy in found.stored.items() if energy > 0.0), key=lambda each: -each[1])
    if kept := sum(energy for _, energy in kinds):
        named = [f"{KINDS[kind]} {quantity(energy, 'J')}" for kind, energy in kinds if energy > SMALL * supplied]
        parts = f": {and_list(named)}" if named else ""
        told.append(f"{quantity(kept, 'J')}{_share(kept, supplied)} is stored at the end{parts}.")
    losers = sorted(found.lost.items(), key=lambda each: -abs(each[1]))[:3]
    named = [f"{instance(name)} {quantity(energy, 'J')}" for name, energy in losers if energy > 0.01 * books.dissipated]
    most = f", most of it in {and_list(named)}" if named else ""
    told.append(f"{quantity(books.dissipated, 'J')}{_share(books.dissipated, supplied)} was dissipated{most}.")
    told.append(
        f"{quantity(books.residual, 'J')} is unaccounted for, {percent(books.residual_relative, 2)} of the largest sum:"
        " that is an error of the steps, not a physical loss."
    )
    return " ".join(told)


def _share(energy: float, supplied: float) -> str:
    return f" ({percent(energy / supplied)})" if supplied > 1e-3 * abs(energy) else ""
