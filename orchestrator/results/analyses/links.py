"""Forces on links in their own axes: along from pin to pin, across along the pins, outwards.

Outwards is away from the wheels. Axial force and bending moment follow from the stress at both fibres and the section
of the vehicle table; they are means along flexible links. A positive moment stretches the inner fibre.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, record_blocks
from orchestrator.results.rotation import link_axes
from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.results.table import ROUNDING, Table

KINDS = {"joint": "joint[*].force", "ground": "link[*].ground.force", "wheels": "link[*].wheels.force"}
AXES = ("along", "across", "outwards")


class LinkForces(NamedTuple):
    """Forces on links, one array per recorded kind; a joint force acts on the link that begins there."""

    track: str
    t: Floats  # (m,) s
    since: Floats  # (m,) s, time since the record before
    joint: Floats  # (m, links, 3) N, along, across, outwards; (m, 0, 3) if not recorded, as below
    ground: Floats  # (m, links, 3) N
    wheels: Floats  # (m, links, 3) N, of the wheels on the link and on its last pin
    axial: Floats  # (m, links) N; (m, 0) without fibres
    moment: Floats  # (m, links) N m
    axes: Floats  # (m, links, 3, 3) columns along, across, outwards, in world

    def table(self) -> Table:
        """Table of least, mean and largest value of each component over all links and records."""
        return _summarise([self]).table()


class LinkForceSummary(NamedTuple):
    """Least, mean and largest values over all links and records."""

    track: str
    rows: list[tuple[str, str, str, float, float, float]]  # force, axis, unit, least, mean, largest

    def table(self) -> Table:
        """Table with a row for each component."""
        columns = (("of a link", ""), ("axis", ""), ("unit", ""), ("least", ""), ("mean", ""), ("largest", ""))
        rows = [  # rounding is left out here, because a column of the table has several units
            (*row[:3], *(value if abs(value) > ROUNDING[row[2]] else 0.0 for value in row[3:])) for row in self.rows
        ]
        return Table.of(f"Forces on the links of {self.track} in their axes", columns, rows)


def summary(run: RunData, track: str = "", window: Window = EVER) -> LinkForceSummary:
    """Summary for a track, by default the first, computed in blocks of records; raises Missing."""
    return _summarise(blocks(run, hull.tracks(run, track)[0], window))


def _summarise(parts: Iterable[LinkForces]) -> LinkForceSummary:
    gathered: dict[tuple[str, str, str], list[Floats]] = {}
    track = ""
    for part in parts:
        track = part.track
        kinds = [(kind, k, axis) for kind in KINDS for k, axis in enumerate(AXES)]
        components = {(f"{kind} force", axis, "kN"): getattr(part, kind)[..., k] / 1e3 for kind, k, axis in kinds}
        components[("axial force", AXES[0], "kN")] = part.axial / 1e3
        components[("bending moment", AXES[1], "N.m")] = part.moment
        for key, values in components.items():
            if values.size:
                total, time = part.since @ values.sum(axis=1), part.since.sum() * values.shape[1]
                extremes = np.array([values.min(), total, values.max(), time])
                gathered.setdefault(key, []).append(extremes)
    rows = []
    for key, block_extremes in gathered.items():
        least, total, most, time = np.array(block_extremes).T
        rows.append((*key, float(least.min()), float(total.sum() / time.sum()), float(most.max())))
    return LinkForceSummary(track, rows)


def of(run: RunData, track: str = "", window: Window = EVER) -> LinkForces:
    """Forces on the links of a track, by default the first, in all records of the window.

    Needs 160 bytes per link and record. Raises Missing.
    """
    track = hull.tracks(run, track)[0]
    parts = [*blocks(run, track, window)]
    columns = (np.concatenate(each) for each in zip(*(part[1:] for part in parts), strict=True))
    return LinkForces(track, *columns)


def blocks(run: RunData, track: str, window: Window = EVER) -> Iterator[LinkForces]:
    """Forces on links in blocks of records, so long runs need no more memory; raises Missing."""
    kinds = [kind for kind, signal in KINDS.items() if record_blocks.has(run, track, signal)]
    fibres = record_blocks.has(run, track, "link[*].fibre.outer")
    if not kinds and not fibres:
        raise Missing(f"{run.log.path} holds no force and no fibre stress of the links of '{track}'")
    signals = [record_blocks.POSITION, *(KINDS[kind] for kind in kinds)]
    signals += ["joint[*].axis"] * record_blocks.has(run, track, "joint[*].axis")
    signals += ["link[*].fibre.outer", "link[*].fibre.inner"] * fibres
    links = record_blocks.count(run, track)
    area, bending, fibre = (
        hull.vehicle_number(run, "section", key) if fibres else 1.0 for key in ("area", "bending", "outer_fibre")
    )
    modulus = bending / fibre
    for block in record_blocks.records(run, track, window, *signals):
        values = dict(zip(signals, block.values, strict=True))
        across = values.get("joint[*].axis")
        if across is None:  # pins stay across the hull within the play of the guides
            across = np.repeat(hull.poses(run, track, block.t).axes[:, None, :, 1], block.pins.shape[1], axis=1)
        if across.shape[1] not in (1, block.pins.shape[1]) or block.pins.shape[1] < links:
            raise Missing(f"{run.log.path} holds other numbers of pins than of axes and links of '{track}'")
        if len({values[f"link[*].fibre.{side}"].shape for side in ("outer", "inner") if fibres}) > 1:
            raise Missing(f"{run.log.path} holds other numbers of outer than of inner fibres of '{track}'")
        axes = link_axes(block.pins, across, links)
        if any(values[KINDS[kind]][:, :links].shape != axes.shape[:3] for kind in kinds):
            raise Missing(f"{run.log.path} holds other numbers of links than of pins of '{track}'")
        forces = {kind: np.einsum("mni,mnij->mnj", values[KINDS[kind]][:, :links], axes) for kind in kinds}
        none, empty = np.empty((len(block.t), 0, 3)), np.empty((len(block.t), 0))
        outer, inner = (values.get(f"link[*].fibre.{side}", empty) for side in ("outer", "inner"))
        yield LinkForces(
            track=track,
            t=block.t,
            since=block.record_durations,
            joint=forces.get("joint", none),
            ground=forces.get("ground", none),
            wheels=forces.get("wheels", none),
            axial=0.5 * area * (outer + inner),
            moment=0.5 * (inner - outer) * modulus,
            axes=axes,
        )
