"""Forces on links, by component, by place on the circuit (``envelope.py``) or by wheel (``patches.py``).

Components are in the axes of the link: along from pin to pin, across along the pins, outwards from the wheels. Axial
force and bending moment follow from the stress at both fibres and the section of the vehicle table; they are means
along flexible links. A positive moment stretches the inner fibre.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import circuit, envelope, hull, patches, record_blocks
from orchestrator.results.analyses.envelope import Envelope
from orchestrator.results.analyses.patches import Patches
from orchestrator.results.analyses.record_blocks import Extreme, larger, smaller
from orchestrator.results.rotation import link_axes
from orchestrator.results.run_data import EVER, TENSION, RunData, Window
from orchestrator.results.table import Table, without_rounding
from orchestrator.vocabulary.analyses import check_by

FORCE_SIGNALS = {"joint": "joint[*].force", "ground": "link[*].ground.force", "wheels": "link[*].wheels.force"}
AXES = ("along", "across", "outwards")
COLUMNS = (
    ("track", ""), ("component", ""), ("unit", ""), ("least", ""), ("least at", "s"), ("least in link", ""),
    ("mean", ""), ("largest", ""), ("largest at", "s"), ("largest in link", ""), ("largest on", ""),
)  # fmt: skip
UNKNOWN = Extreme(np.nan, np.nan, 0)


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

    def components(self) -> dict[tuple[str, str], Floats]:
        """Recorded components (m, links) by name and unit."""
        found: dict[tuple[str, str], Floats] = {}
        for kind in FORCE_SIGNALS:
            force = getattr(self, kind)
            sized = np.concatenate([force, np.linalg.norm(force, axis=2, keepdims=True)], axis=2)
            found |= {(f"{kind} force {axis}", "kN"): sized[..., k] / 1e3 for k, axis in enumerate((*AXES, "size"))}
        found |= {("axial force", "kN"): self.axial / 1e3, ("bending moment", "N.m"): self.moment}
        return {key: values for key, values in found.items() if values.size}


class Links(NamedTuple):
    """Forces on the links of one or more tracks."""

    rows: tuple[tuple[Any, ...], ...]  # cells of COLUMNS for each track and component
    forces: tuple[LinkForces, ...]  # of each track in all records; none in a summary
    interval: float  # s, averaging interval of the forces; 0: instantaneous

    def table(self) -> Table:
        """Table with a row for each track and component."""
        note = () if self.interval == 0.0 else (f"means over {1e3 * self.interval:.4g} ms, as recorded",)
        return Table.of(
            "Forces on links in their axes; joint force: of the pin where the link begins", COLUMNS, self.rows, note
        )


def of(
    run: RunData,
    track: str = "",
    by: str = "",
    signal: str | Sequence[str] = "",
    bins: int = 0,
    window: Window = EVER,
    *,
    whole: bool = True,
) -> Links | Envelope | Patches:
    """Forces on the links of all tracks or one, by component, place or wheel; by place of the first track.

    By component it needs 160 bytes per link and record, unless only the summary is asked for. Raises Missing, BadInput.
    """
    check_by("links", by)
    if by == "place":
        return envelope.of(run, track, signal or TENSION, window, bins)
    if signal or bins:
        raise BadInput("signal and bins are of links by place")
    if by == "wheel":
        return patches.of(run, track, window)
    rows: list[tuple[Any, ...]] = []
    forces = []
    tracks = hull.tracks(run, track)
    for name in tracks:
        parts: Iterable[LinkForces] = blocks(run, name, window)
        if whole:
            parts = [*parts]
            columns = (np.concatenate(each) for each in zip(*(part[1:] for part in parts), strict=True))
            forces.append(LinkForces(name, *columns))
        rows += _rows(run, name, parts)
    steps = max(record_blocks.interval(run, name) for name in tracks)
    return Links(tuple(rows), tuple(forces), steps * float(run.entry("run", "step", default=0.0)))


summary = partial(of, whole=False)


def _rows(run: RunData, track: str, parts: Iterable[LinkForces]) -> Iterator[tuple[Any, ...]]:
    """Cells of the components of a track by its forces in blocks of records."""
    found: dict[tuple[str, str], tuple[Extreme | None, Extreme | None, list[tuple[float, float]]]] = {}
    for part in parts:
        for key, values in part.components().items():
            least, most, sums = found.get(key, (None, None, []))
            sums.append((part.since @ values.sum(axis=1), part.since.sum() * values.shape[1]))
            found[key] = smaller(least, part.t, values), larger(most, part.t, values), sums
    for (name, unit), (*extremes, sums) in found.items():
        total, time = np.array(sums).T
        least, most = (one._replace(value=without_rounding(one.value, unit)) if one else UNKNOWN for one in extremes)
        mean = without_rounding(float(total.sum() / time.sum()), unit)
        yield track, name, unit, *least, mean, *most, _part(run, track, name, most)


def _part(run: RunData, track: str, name: str, extreme: Extreme) -> str:
    """Part of the circuit of a link, of a joint force of its first pin; "" for open chains and without wheels."""
    try:
        block = next(circuit.records(run, track, Window(extreme.t, extreme.t)))
    except Missing:
        return ""
    place = float((block.joints if name.startswith("joint") else block.links)[0, extreme.member - 1])
    parts = block.stretches(run.scene)
    nearest = min(parts, key=lambda one: max(one.start - place, place - one.end), default=None)
    return nearest.name if nearest else ""


def blocks(run: RunData, track: str, window: Window = EVER) -> Iterator[LinkForces]:
    """Forces on links in blocks of records, so long runs need no more memory; raises Missing."""
    kinds = [kind for kind, signal in FORCE_SIGNALS.items() if record_blocks.has(run, track, signal)]
    fibres = record_blocks.has(run, track, "link[*].fibre.outer")
    links = record_blocks.count(run, track)
    if not links or not (kinds or fibres):
        raise Missing(f"{run.log.path} holds no force and no fibre stress of the links of '{track}'")
    signals = [record_blocks.POSITION, *(FORCE_SIGNALS[kind] for kind in kinds)]
    signals += ["joint[*].axis"] * record_blocks.has(run, track, "joint[*].axis")
    signals += ["link[*].fibre.outer", "link[*].fibre.inner"] * fibres
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
        if any(values[FORCE_SIGNALS[kind]][:, :links].shape != axes.shape[:3] for kind in kinds):
            raise Missing(f"{run.log.path} holds other numbers of links than of pins of '{track}'")
        forces = {kind: np.einsum("mni,mnij->mnj", values[FORCE_SIGNALS[kind]][:, :links], axes) for kind in kinds}
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
