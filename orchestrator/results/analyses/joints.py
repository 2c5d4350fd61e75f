"""Extreme joint forces in the axes of the link that begins at the pin, with joint and time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import circuit, hull, links, record_blocks
from orchestrator.results.analyses.record_blocks import Extreme, larger, smaller
from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.results.table import Table


class JointForces(NamedTuple):
    """Least and largest force on the link, by track: along, across, outwards, norm."""

    tracks: tuple[str, ...]
    least: Floats  # (tracks, 4) N: along, across, outwards, norm
    most: Floats  # (tracks, 4) N
    least_joint: Floats  # (tracks, 4) pin numbers, from 1
    most_joint: Floats  # (tracks, 4)
    least_t: Floats  # (tracks, 4) s
    most_t: Floats  # (tracks, 4) s
    most_part: tuple[tuple[str, ...], ...]  # (tracks, 4) part of the circuit (``circuit.py``); "" on an open chain
    interval: float  # s, averaging interval of the forces; 0: instantaneous

    def table(self) -> Table:
        """Table with a row for each track and axis."""
        rows = [
            (
                track, axis,
                float(self.least[i, k]) / 1e3, int(self.least_joint[i, k]), float(self.least_t[i, k]),
                float(self.most[i, k]) / 1e3, int(self.most_joint[i, k]), float(self.most_t[i, k]),
                self.most_part[i][k],
            )
            for i, track in enumerate(self.tracks)
            for k, axis in enumerate((*links.AXES, "size"))
        ]  # fmt: skip
        columns = (
            ("track", ""), ("axis", ""), ("least", "kN"), ("least at joint", ""), ("least at", "s"), ("largest", "kN"),
            ("largest at joint", ""), ("largest at", "s"), ("largest on", ""),
        )  # fmt: skip
        note = () if self.interval == 0.0 else (f"means over {1e3 * self.interval:.4g} ms, as recorded",)
        return Table.of("Joint forces on the link that begins at the pin, in its axes", columns, rows, note)


def of(run: RunData, track: str = "", window: Window = EVER) -> JointForces:
    """Extreme joint forces of all tracks or one; raises Missing."""
    names = hull.tracks(run, track)
    extremes = np.array([_extremes(run, name, window) for name in names])
    parts = tuple(_parts(run, name, each[3], each[5]) for name, each in zip(names, extremes, strict=True))
    steps = max(record_blocks.interval(run, name) for name in names)
    return JointForces._make([names, *(extremes[:, k] for k in range(6)), parts, steps * _step(run)])


def _parts(run: RunData, track: str, joints: Floats, times: Floats) -> tuple[str, ...]:
    """Part of the circuit of a track on which each pin is at its time, s; "" for open chains and without wheels."""
    found = []
    for joint, t in zip(joints.astype(int), times, strict=True):
        try:
            block = next(circuit.records(run, track, Window(t, t)))
        except Missing:
            return ("",) * len(joints)
        parts = block.stretches(run.scene)
        place = float(block.joints[0, joint - 1])
        nearest = min(parts, key=lambda one: max(one.start - place, place - one.end), default=None)
        found.append(nearest.name if nearest else "")
    return tuple(found)


def _step(run: RunData) -> float:
    """Communication step, s; 0 if the log does not state it."""
    run_table = run.scene.get("run")
    step = run_table.get("step") if isinstance(run_table, dict) else None
    return float(step) if isinstance(step, int | float) else 0.0


def _extremes(run: RunData, track: str, window: Window) -> Floats:
    """Least and largest forces, their joints and times (6, 4)."""
    least: list[Extreme | None] = [None] * 4
    most: list[Extreme | None] = [None] * 4
    for block in links.blocks(run, track, window):
        if not block.joint.size:
            raise Missing(f"{run.log.path} holds no '{track}.joint[*].force'")
        force = np.concatenate([block.joint, np.linalg.norm(block.joint, axis=2, keepdims=True)], axis=2)
        least = [smaller(known, block.t, force[..., k]) for k, known in enumerate(least)]
        most = [larger(known, block.t, force[..., k]) for k, known in enumerate(most)]
    tables = [[extreme or Extreme(np.nan, np.nan, 0) for extreme in extremes] for extremes in (least, most)]
    return np.array([[getattr(e, name) for e in extremes] for name in ("value", "member", "t") for extremes in tables])
