"""Power through the ports of the hull and of the drives, relative to the hull.

The wrench on a wheel also does work on the motion of the whole vehicle; these parts circulate between ports and mask
the transmitted power. So the power of each port is split:
    F.v + T.w = [F.(v - v_h) + T.(w - w_h)] + [F.v_h + T.w_h],
with the motion v, w of the wheel and v_h, w_h of the hull at the wheel. The first part is the power relative to the
hull, the second is the power of the wrench on the hull as a whole. Their sums over a run are the works of the ledger
(``results/energy.py``). Without a hull all power is relative, because axles are fixed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses.record_blocks import RECOVER, named_columns
from orchestrator.results.energy import Block
from orchestrator.results.run_data import BLOCK, EVER, RunData, Window, WrenchPort, vectors
from orchestrator.results.table import Table

WRENCH = ("force", "torque")
MOTION = ("position", "velocity", "angular_velocity")


class Power(NamedTuple):
    """Mean powers over each step; positive into the wheel, for motors into the sprocket."""

    t: Floats  # (m,) s, ends of the steps
    h: Floats  # (m,) s, their lengths
    ports: tuple[str, ...]  # "left_track.sprocket": source of the wrench, and wheel
    relative: Floats  # (m, ports) W, on the motion relative to the hull
    carried: Floats  # (m, ports) W, on the motion of the hull
    drives: tuple[str, ...]  # "left_drive.power", of the motor; a differential has half shafts and motors
    drive: Floats  # (m, drives) W, into the sprocket
    halves: int  # 2 if each value stands for both sides of a symmetric vehicle

    @property
    def energy(self) -> Floats:
        """Energy through each port relative to the hull (ports,), J."""
        return self.h @ self.relative

    @property
    def energy_carried(self) -> Floats:
        """Energy of each port on the motion of the hull (ports,), J."""
        return self.h @ self.carried

    @property
    def energy_drive(self) -> Floats:
        """Energy of each motor (drives,), J."""
        return self.h @ self.drive

    def series(self) -> Table:
        """Table of all powers over time."""
        heads = [(f"{name} {part}", "W") for part in ("relative", "on hull's motion") for name in self.ports]
        columns = (("t", "s"), ("h", "s"), *heads, *((name, "W") for name in self.drives))
        rows = np.column_stack([self.t, self.h, self.relative, self.carried, self.drive]).tolist()
        return Table.of("Power over time", columns, rows)

    def table(self) -> Table:
        """Table of mean power and energy of each port and motor."""
        return _summed([self]).table()


class Energies(NamedTuple):
    """Energies over a window; positive into the wheel, for motors into the sprocket."""

    window: Window  # s, of the steps
    ports: tuple[str, ...]
    relative: Floats  # (ports,) J, on the motion relative to the hull
    carried: Floats  # (ports,) J, on the motion of the hull
    drives: tuple[str, ...]
    drive: Floats  # (drives,) J
    halves: int

    def table(self) -> Table:
        """Table of mean power and energy of each port and motor."""
        begin, end = self.window
        every = [*zip(self.ports, self.relative.tolist(), self.carried.tolist(), strict=True)]
        every += [(name, energy, float("nan")) for name, energy in zip(self.drives, self.drive.tolist(), strict=True)]
        rows = [
            (name, *(energy / (end - begin) / 1e3 for energy in both), *(e / 1e3 for e in both))
            for name, *both in every
        ]
        columns = (
            ("port", ""), ("power", "kW"), ("power on hull's motion", "kW"), ("energy", "kJ"),
            ("energy on hull's motion", "kJ"),
        )  # fmt: skip
        title = f"Power into wheels relative to the hull, {begin:.6g} to {end:.6g} s"
        note = ("the other side of the symmetric vehicle has the same again",) if self.halves > 1 else ()
        return Table.of(title, columns, rows, note)


def of(run: RunData, window: Window = EVER) -> Power:
    """Power of every port and motor over time; raises Missing unless every step is recorded."""
    parts = [*blocks(run, window)]
    t, h, relative, carried, drive = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("t", "h", "relative", "carried", "drive")
    )
    return parts[0]._replace(t=t, h=h, relative=relative, carried=carried, drive=drive)


def summary(run: RunData, window: Window = EVER) -> Energies:
    """Energies only, so long runs need no more memory; raises as ``of``."""
    return _summed(blocks(run, window))


def _summed(parts: Iterable[Power]) -> Energies:
    energies = [
        Energies(
            Window(float(part.t[0] - part.h[0]), float(part.t[-1])), part.ports, part.energy, part.energy_carried,
            part.drives, part.energy_drive, part.halves,
        )
        for part in parts
    ]  # fmt: skip
    relative, carried, drive = (
        np.sum([getattr(part_energies, name) for part_energies in energies], axis=0)
        for name in ("relative", "carried", "drive")
    )
    window = Window(energies[0].window.start, energies[-1].window.end)
    return energies[0]._replace(window=window, relative=relative, carried=carried, drive=drive)


def blocks(run: RunData, window: Window = EVER) -> Iterator[Power]:
    """Powers in blocks of steps; raises as ``of``."""
    wrench_ports = [port for port in run.ports if run.has(f"{port.taker}.{port.taker_connector}.velocity.x")]
    sprocket_instances = {port.taker for port in wrench_ports if port.giver_connector == "sprocket"} - {"chassis"}
    drives = [
        name for name in run.log.signals if name.endswith(".power") and name.partition(".")[0] in sprocket_instances
    ]
    if not wrench_ports:
        raise Missing(f"{run.log.path} holds no port of a wheel")
    hull = run.has("chassis.chassis.velocity.x")
    if "chassis" in run.instances and not hull:
        raise Missing(f"{run.log.path} holds no 'chassis.chassis.velocity.x': power is relative to the hull")
    read: list[tuple[str, tuple[str, ...]]] = []
    read += [(f"{port.giver}.{port.giver_connector}", WRENCH) for port in wrench_ports]
    read += [(f"{port.taker}.{port.taker_connector}", MOTION) for port in wrench_ports]
    read += [("chassis.chassis", MOTION)] if hull else []
    names = [*(f"{body}.{part}.{axis}" for body, parts in read for part in parts for axis in "xyz"), *drives]
    columns_read = named_columns(run, names)
    sparse = [topic for topic in columns_read if run.log.topics[topic].every > 1]
    if sparse:
        raise Missing(
            f"{run.log.path} holds one step in {run.log.topics[sparse[0]].every} of {sparse[0]}: power needs all"
        )
    empty = True
    for block in run.log.blocks(columns_read, BLOCK, 1, window):
        series = next(iter(block.values()))
        if not all(np.array_equal(other.t, series.t) for other in block.values()):
            raise Missing(f"{run.log.path} holds different steps of its components: {RECOVER}")
        if len(series.t) > 1:
            empty = False
            t, h, relative, carried, drive = _in_block(block, wrench_ports, drives, hull)
            titles = tuple(f"{port.giver}.{port.giver_connector}" for port in wrench_ports)
            yield Power(t, h, titles, relative, carried, tuple(drives), drive, run.copies(wrench_ports[0].giver))
    if empty:
        raise Missing(f"{run.log.path} holds no step between {window.start:g} and {window.end:g} s")


def _in_block(block: Block, wrench_ports: list[WrenchPort], drives: list[str], hull: bool) -> tuple[Floats, ...]:
    """Times, step lengths, relative and carried power, and power of motors, for a block."""
    series = next(iter(block.values()))
    t, h = series.t[1:], np.diff(series.t)
    c, v_c, w_c = np.zeros((3, len(t), 3))
    if hull:
        c, v_c, w_c = (_mid(vectors(block["/chassis/out"], "chassis", f"chassis.{part}")) for part in MOTION)
    relative, carried = np.empty((len(t), len(wrench_ports))), np.empty((len(t), len(wrench_ports)))
    for k, port in enumerate(wrench_ports):
        force, torque = (
            vectors(block[f"/{port.giver}/out"], port.giver, f"{port.giver_connector}.{part}")[1:] for part in WRENCH
        )
        x, v, w = (
            _mid(vectors(block[f"/{port.taker}/out"], port.taker, f"{port.taker_connector}.{part}")) for part in MOTION
        )
        v_h = v_c + np.cross(w_c, x - c)
        carried[:, k] = np.sum(force * v_h + torque * w_c, axis=1)
        relative[:, k] = np.sum(force * (v - v_h) + torque * (w - w_c), axis=1)
    motors = [(block[f"/{owner}/out"], variable) for owner, _, variable in (name.partition(".") for name in drives)]
    drive = [series_of_motor.values[1:, series_of_motor.names.index(variable)] for series_of_motor, variable in motors]
    return t, h, relative, carried, np.stack(drive, axis=1) if drive else np.empty((len(t), 0))


def _mid(values: Floats) -> Floats:
    """Midpoint values of each step, because wrenches are means over it."""
    return 0.5 * (values[1:] + values[:-1])
