"""Energy ledger: work, stored energy, dissipation, and the errors of coupling and integration.

For each component, with the powers of its ports by its own inputs and outputs,
    integration part = work of drives + received through ports - change of stored energy - dissipated - covered.
The ports' part of a port is the work of its wrench on the motion at the giver's input less that on the taker's motion.
The giver extrapolates this motion, which jumps at the next communication point; the mean of the wrenches before and
after the jump works on it.
The residual is the sum of all parts: work - change - dissipated - covered - towed - delivered.
Covered is the energy defect of the moving contact patch (loss or gain): ``fmus/physics/README.md``. Delivered is the
work of the ports on components without energies, as FMUs of the user may be: what becomes of it there is unknown.
Towed is the work of the hitch on its load and on FMUs of the user that feed its force; those that have energies stand
in the ledger themselves.

The relative residual has the largest of these sums, or of the changes of stored energies, as its scale, but at least a
tenth of the energies held. A system at rest exchanges nothing, but its contacts hold energy at their loads, on which an
error of the exchange acts: 0.7 kJ in each track of a standing m113. The first steps of a coupling with old values lose
0.4 J.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Series
from orchestrator.results.figures import figure
from orchestrator.results.run_data import BLOCK, Floats, RunData, Unrecorded, Window, WrenchPort, vectors

Block = Mapping[str, Series]  # messages of the same steps, by topic
PUSHED = re.compile(r"\.(force|torque)\.[xyz]$")  # inputs through which work comes
LEAST = 1.0  # J: less counts as rest
LEAST_OWN = 100.0  # J, scale of a component beside others: a link lifted by half a metre
CAUSE = "dissipated."  # prefix of a track's dissipated energies by cause
STORED_ENERGIES = {  # stored energy: its words
    "kinetic": "motion",
    "gravity": "height",
    "strain": "strain of links",
    "spring": "springs",
    "contact": "contacts",
}
STORED = tuple(STORED_ENERGIES)
ABSOLUTE = ("kinetic", "strain", "contact")  # they are 0 at rest and unloaded; the zero of the others is a convention
HELD = 0.1  # share of such an energy that counts where less is exchanged


class Ledger(NamedTuple):
    """Energies between the first and the last recorded output, J."""

    work: float
    change: float
    dissipated: float
    covered: float
    residual: float
    residual_relative: float  # to the largest of work, change, dissipated, delivered and the energies held, or LEAST
    port: float  # ports' part of the residual
    integration: dict[str, float]  # integration part of each component; a mirrored one counts for its original
    integration_relative: dict[str, float]  # to the largest of the component's own energies, or LEAST_OWN
    causes: dict[str, float]  # dissipated energy: of all tracks by cause, of others by component
    stored: dict[str, float]  # change by kind, as in STORED; negative: released
    delivered: dict[str, float]  # work through ports into each component without energies; negative: out of it
    towed: float = 0.0  # work on a towed load

    @property
    def supplied(self) -> float:
        """Energy put in and released from store, J: it is dissipated, stored elsewhere or unaccounted for."""
        released = sum(min(change, 0.0) for change in (*self.stored.values(), *self.delivered.values()))
        return max(self.work, 0.0) - released


def ledger(run: RunData) -> Ledger:
    """Ledger of a log; raises Missing if it lacks energies or steps."""
    return run.compute_once("ledger", _ledger)


def changes(run: RunData) -> dict[str, dict[str, float]]:
    """Change of each ``energy.*`` output over the run by component, J; raises Missing."""
    return run.compute_once(
        "changes of energy", lambda run: {name: _energy_changes(run, name) for name in run.instances}
    )


def powers(run: RunData, window: Window) -> dict[str, dict[str, float]]:
    """Mean change of each energy of a component over a window, W; of both sides if the other side mirrors it.

    Empty if the energies of a component are missing.
    """
    found: dict[str, dict[str, float]] = {}
    if without_energies(run):
        return found
    for name in run.instances:
        for kind in ("work", "dissipated", "covered", "towed", *STORED):
            if run.has(signal := f"{name}.energy.{kind}"):
                t, values = run.signal(signal, window)
                rate = float(values[-1] - values[0]) / float(t[-1] - t[0]) if len(t) > 1 else 0.0
                found.setdefault(name, {})[kind] = run.copies(name) * rate
    return found


def _ledger(run: RunData) -> Ledger:
    accounts = changes(run)
    if not any(accounts.values()):
        raise Missing("the log holds no energies")
    known = {(port.giver, port.taker, port.taker_connector) for port in run.ports}
    for source, output, target, into in run.wires:
        connector, is_push = PUSHED.subn("", into)
        if (
            is_push
            and accounts[target]
            and (source, target, connector) not in known
            and not into.startswith("hitch.force.")
        ):
            wire = f"{source}.{output} -> {target}.{into}"
            raise Missing(f"the work of {wire} is not known: it is a force without its torque, or a torque without it")
    received = dict.fromkeys(run.instances, 0.0)
    port_loss = 0.0
    for port, (given, taken) in port_works(run).items():
        received[port.giver] -= given
        received[port.taker] += run.copies(port.giver) / run.copies(port.taker) * taken
        port_loss += run.copies(port.giver) * (given - taken)
    fed = hitch_works(run, accounts)
    for name, done in fed.items():
        received[name] += done
    copies = [run.copies(name) for name in accounts]

    def total(*parts: str) -> float:
        return sum(
            n * account.get(part, 0.0) for n, account in zip(copies, accounts.values(), strict=True) for part in parts
        )

    work, change, dissipated = total("work"), total(*STORED), total("dissipated")
    covered, towed = total("covered"), total("towed") - sum(fed.values())
    delivered = {name: run.copies(name) * received[name] for name in without_energies(run)}
    residual = work - change - dissipated - covered - towed - sum(delivered.values())
    largest_stored = _largest_stored(run)
    moved = [abs(energy) for energy in (work, change, dissipated, towed, *delivered.values())]
    scale = max(*moved, *largest_stored.values(), LEAST)
    integration = {
        name: account.get("work", 0.0)
        + received[name]
        - sum(account.get(kind, 0.0) for kind in STORED)
        - account.get("dissipated", 0.0)
        - account.get("covered", 0.0)
        - account.get("towed", 0.0)
        for name, account in accounts.items()
        if name not in delivered
    }
    transfers = {
        name: [abs(account.get(part, 0.0)) for part in ("work", "dissipated", "towed")]
        for name, account in accounts.items()
    }
    relative = {
        name: part / max(*transfers[name], largest_stored[name], LEAST_OWN) for name, part in integration.items()
    }
    stored = {kind: total(kind) for kind in STORED}
    causes = _causes(dict(zip(accounts, copies, strict=True)), accounts)
    return Ledger(
        work, change, dissipated, covered, residual, residual / scale, port_loss, integration, relative, causes, stored,
        delivered,
        towed,
    )  # fmt: skip


def _causes(copies: Mapping[str, int], accounts: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """Dissipated energy by cause, J."""
    found: dict[str, float] = {}
    for name, account in accounts.items():
        parts = {part.removeprefix(CAUSE): lost for part, lost in account.items() if part.startswith(CAUSE)}
        for cause, lost in (parts or {name: account.get("dissipated", 0.0)}).items():
            found[cause] = found.get(cause, 0.0) + copies[name] * lost
    return {cause: lost for cause, lost in found.items() if lost}


@figure("1", whole=True)
def energy_residual(run: RunData, of: str, window: Window) -> float:
    """Residual of the energy ledger over the largest of work, change and dissipation."""
    return ledger(run).residual_relative


@figure("1", whole=True)
def port_residual(run: RunData, of: str, window: Window) -> float:
    """Ports' part of the energy residual, over the work of the drives."""
    return ledger(run).port / ledger(run).work


@figure("1")
def energy_drift(run: RunData, of: str, window: Window) -> float:
    """Largest change of stored and lost energy less work, at any instant, over the largest kinetic energy."""
    names = [  # ports are left out
        (f"{name}.energy.{part}", -1.0 if part == "work" else 1.0)
        for name in run.instances
        for part in (*STORED, "dissipated", "covered", "towed", "work")
        if run.has(f"{name}.energy.{part}")
    ]
    most = _largest_kinetic(run)
    if not most:
        raise Missing("the log holds no kinetic energy")
    total = np.sum([sign * run.signal(name, window)[1] for name, sign in names], axis=0)
    return float(np.abs(total - total[0]).max() / most)


def _largest_kinetic(run: RunData) -> float:
    """Largest kinetic energy of a component, J: scale for free fall and free spin."""
    names = [f"{name}.energy.kinetic" for name in run.instances if run.has(f"{name}.energy.kinetic")]
    return run.largest(names) if names else 0.0


def _largest_stored(run: RunData) -> dict[str, float]:
    """Largest change of an energy, or share HELD of one in ABSOLUTE, that each component held, J.

    A hull that sinks into its springs and rises again ends without change, but the steps had to transfer this energy.
    """
    columns_by_topic: dict[str, list[int]] = {}
    for name in run.instances:
        topic = f"/{name}/out"
        stored = [f"energy.{kind}" for kind in STORED]
        columns_by_topic[topic] = [k for k, variable in enumerate(run.log.topics[topic].names) if variable in stored]
    most = dict.fromkeys(run.instances, 0.0)
    start: dict[str, Floats] = {}
    for block in run.log.blocks({topic: columns for topic, columns in columns_by_topic.items() if columns}, BLOCK):
        for topic, series in block.items():
            if not len(series.t):
                continue
            absolute = np.array([name.removeprefix("energy.") in ABSOLUTE for name in series.names])
            changes = np.abs(series.values - start.setdefault(topic, series.values[0]))
            held = np.where(absolute, HELD * np.abs(series.values), 0.0)
            name = topic.split("/")[1]
            most[name] = max(most[name], float(np.nan_to_num(np.maximum(changes, held), nan=0.0).max()))
    return most


def without_energies(run: RunData) -> list[str]:
    """Components at wheels and mounts that output no energies, as an FMU of the user may."""
    joined = dict.fromkeys(name for port in run.ports for name in (port.giver, port.taker))
    topics = {name: run.log.topics.get(f"/{name}/out") for name in joined}
    return [
        name for name, topic in topics.items()
        if topic is not None and not any(variable.startswith("energy.") for variable in topic.names)
    ]  # fmt: skip


def hitch_works(run: RunData, accounts: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """Work of the hitch on each component with energies that feeds its force, J: the force is held over each step."""
    feeders = {
        into: connection["source"]
        for connection in run.system["connections"]
        for into in connection["inputs"]
        if connection["target"] == "chassis" and into.startswith("hitch.force.") and accounts[connection["source"]]
    }
    works, axes = dict.fromkeys(feeders.values(), 0.0), "".join(into[-1] for into in feeders)
    if works:
        forces = run.vectors("chassis", "in", "hitch.force", axes)[1]
        positions = run.vectors("chassis", "out", "hitch.position", axes)[1]
        if len(positions) != len(forces) + 1:
            raise Unrecorded("the work of the hitch needs outputs of every step: run.outputs = 1")
        for source, done in zip(feeders.values(), -np.sum(forces * np.diff(positions, axis=0), axis=0), strict=True):
            works[source] += float(done)
    return works


def _energy_changes(run: RunData, instance: str) -> dict[str, float]:
    """Compute the change of each ``energy.*`` output of an instance over the run, J; raises Missing."""
    topic = f"/{instance}/out"
    if topic in run.log.topics and not any(name.startswith("energy.") for name in run.log.topics[topic].names):
        return {}  # unread: there may be thousands of such components
    if topic not in run.log.topics or not len((series := run.log.ends(topic)).t):
        raise Missing(f"the log holds no outputs of '{instance}'")
    return {
        name.removeprefix("energy."): float(series.values[-1, i] - series.values[0, i])
        for i, name in enumerate(series.names)
        if name.startswith("energy.")
    }


def port_works(run: RunData) -> dict[WrenchPort, tuple[float, float]]:
    """Work of every port's wrench, J: on the motion at the giver's input, and on the taker's motion.

    Summed in blocks of BLOCK steps, so the rounding of long runs depends on the blocks; raises Missing.
    """
    inputs = {name: f"/{name}/in" for name in run.instances}
    outputs = {name: f"/{name}/out" for name in run.instances}
    if lacking := [topic for topic in inputs.values() if topic not in run.log.topics]:
        raise Unrecorded(f"the log lacks the topic '{lacking[0]}': run.inputs = true records it")
    end = min(float(run.log.ends(topic).t[-1]) for topic in outputs.values())
    ports_of_run = run.ports
    lengths = run.log.lengths()
    # If not every step is recorded, the wrench is that at the taker's input.
    fully_recorded = {port for port in ports_of_run if lengths[outputs[port.giver]] == lengths[inputs[port.taker]] + 1}
    works = dict.fromkeys(ports_of_run, (0.0, 0.0))
    gaps: dict[str, tuple[float, float]] = {}
    topics = [*inputs.values(), *sorted({outputs[port.giver] for port in fully_recorded})]
    for number, block in enumerate(run.log.blocks(topics, BLOCK, 2)):
        for name, topic in inputs.items():
            series = block[topic]
            if name not in gaps and (gap := series.gap(float(series.t[0]) if number else 0.0)):
                gaps[name] = gap
        if gaps or len({len(block[topic].t) for topic in inputs.values()}) > 1:
            continue
        for port in ports_of_run:
            block_work = _work_in(block, port, ports_of_run, port in fully_recorded, end)
            works[port] = works[port][0] + block_work[0], works[port][1] + block_work[1]
    for name in run.instances:
        if name in gaps:
            raise Missing(f"the log lacks the inputs of '{name}' from t = {gaps[name][0]:.6g} to {gaps[name][1]:.6g} s")
    if len({lengths[topic] for topic in inputs.values()}) > 1:
        raise Missing("the log holds different steps of its components: 'cotrack log recover' leaves those of all")
    return works


def _work_in(
    block: Block, port: WrenchPort, others: Sequence[WrenchPort], fully_recorded: bool, end: float
) -> tuple[float, float]:
    """Works of a port in a block; ``whole``: every output of the giver is recorded."""
    t = block[f"/{port.taker}/in"].t
    taken = _wrench(block, port.taker, "in", port.taker_connector)
    given = _wrench(block, port.giver, "out", port.giver_connector)[1:] if fully_recorded else taken
    extrapolated, actual = _motions(block, port)
    taker_jump = np.zeros_like(actual)  # jump of the taker itself, which moves with an extrapolated mount
    for upstream in others:
        if upstream.giver == port.taker:
            upstream_motions = _motions(block, upstream)
            taker_jump += upstream_motions[1] - upstream_motions[0]
    finished = int(np.count_nonzero(t < end - 1e-9))
    steps = min(finished, BLOCK if len(t) == BLOCK + 2 else len(actual))
    return (
        _work(given[:finished], extrapolated[:steps], (actual - extrapolated)[:steps]),
        _work(taken[:finished], (actual - taker_jump)[:steps], taker_jump[:steps]),
    )


def _work(wrench: Floats, motion: Floats, jump: Floats) -> float:
    """Work of mean wrenches (m, 6) on the motion in each step and on the jump after it; m steps or fewer."""
    steps = len(motion)
    mean_wrench = 0.5 * (wrench + np.vstack([wrench[1:], wrench[-1:]]))[:steps]
    return float(np.sum(wrench[:steps] * motion) + np.sum(mean_wrench * jump))


def _wrench(block: Block, instance: str, topic: str, connector: str) -> Floats:
    """Force and torque (m, 6)."""
    series = block[f"/{instance}/{topic}"]
    return np.hstack([vectors(series, instance, f"{connector}.{part}") for part in ("force", "torque")])


def _motions(block: Block, port: WrenchPort) -> tuple[Floats, Floats]:
    """Shift and rotation of a connector in every step, (m, 6) each: extrapolated by the giver, and actual.

    The inputs have no value after the last step: its motion is taken as extrapolated.
    """
    giver, connector = port.giver, port.giver_connector
    series = block[f"/{giver}/in"]
    position = vectors(series, giver, f"{connector}.position")
    q = vectors(series, giver, f"{connector}.orientation", "wxyz")
    rates = [vectors(series, giver, f"{connector}.{rate}") for rate in ("velocity", "angular_velocity")]
    extrapolated = series.h[:, None] * np.hstack(rates)
    actual = extrapolated.copy()
    actual[:-1] = np.hstack([np.diff(position, axis=0), rotation_vectors(q)])
    return extrapolated, actual


def rotation_vectors(q: Floats) -> Floats:
    """Rotation vectors (m - 1, 3), world, between successive quaternions (m, 4), body to world."""
    w, v = q[:, 0], q[:, 1:]
    # q[k + 1] times the conjugate of q[k]
    scalar = w[1:] * w[:-1] + np.sum(v[1:] * v[:-1], axis=1)
    vector = w[:-1, None] * v[1:] - w[1:, None] * v[:-1] - np.cross(v[1:], v[:-1])
    vector *= np.where(scalar < 0, -1.0, 1.0)[:, None]
    sine = np.linalg.norm(vector, axis=1)
    angle = 2.0 * np.arctan2(sine, np.abs(scalar))
    return vector * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-300), 2.0)[:, None]
