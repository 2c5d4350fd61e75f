"""How a track loads its road wheels: the force on each of them that points up in the hull."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull
from orchestrator.results.analyses.at_steps import RECOVER
from orchestrator.results.analyses.table import Table
from orchestrator.results.run_data import BLOCK, EVER, Missing, RunData, Window, since

LIFTED = 0.02  # of the mean load of all road wheels: what carries less is lifted off


class WheelLoads(NamedTuple):
    """Over the window, weighed by time."""

    wheels: tuple[str, ...]  # "left_track.road_wheel[1]"
    mean: Floats  # (wheels,) N
    least: Floats  # (wheels,) N
    most: Floats  # (wheels,) N
    rms: Floats  # (wheels,) N, about the mean
    lifted: Floats  # (wheels,) share of the time
    threshold: float  # N: what carries less is lifted off

    def table(self) -> Table:
        """A row for each wheel."""
        values = (self.mean / 1e3, self.least / 1e3, self.most / 1e3, self.rms / 1e3, 100.0 * self.lifted)
        rows = list(zip(self.wheels, *(each.tolist() for each in values), strict=True))
        columns = (
            ("wheel", ""), ("mean", "kN"), ("least", "kN"), ("largest", "kN"), ("rms about mean", "kN"),
            ("lifted", "% of time"),
        )  # fmt: skip
        note = f"a wheel is lifted where it carries less than {self.threshold / 1e3:.3g} kN"
        return Table("Load of road wheels, up in the hull", columns, rows, (note,))


def loads(run: RunData, window: Window = EVER) -> tuple[tuple[str, ...], Floats, Floats]:
    """Names of the road wheels, times (m,), s, and their loads (m, wheels), N; raises Missing."""
    names = [
        f"{track}.{name.removesuffix('.force.x')}"
        for track in run.tracks
        for name in run.log.topics[f"/{track}/out"].names
        if name.startswith("road_wheel[") and name.endswith(".force.x")
    ]
    if not names:
        raise Missing(f"{run.log.path} holds no road wheel")
    forces = [[run.log.find(f"{name}.force.{axis}") for axis in "xyz"] for name in names]
    wanted: dict[str, list[int]] = {}
    for topic, column in (place for force in forces for place in force):
        wanted.setdefault(topic, []).append(column)
    turned = [f"chassis.orientation.{part}" for part in "wxyz"] if run.has("chassis.chassis.orientation.w") else []
    if turned:
        wanted["/chassis/out"] = [run.log.topics["/chassis/out"].names.index(name) for name in turned]
    times, found = [], []
    for block in run.log.blocks(wanted, BLOCK, window=window):
        series = next(iter(block.values()))
        if not all(np.array_equal(each.t, series.t) for each in block.values()):
            raise Missing(f"{run.log.path} holds different steps of its components: {RECOVER}")
        force = np.concatenate([block[topic].values for topic in wanted if topic != "/chassis/out"], axis=1)
        if not len(series.t):
            continue
        up = np.tile([0.0, 0.0, 1.0], (len(series.t), 1))
        if turned:
            up = hull.matrices(block["/chassis/out"].values)[..., 2]
        times.append(series.t)
        found.append(np.einsum("mki,mi->mk", force.reshape(len(series.t), -1, 3), up))
    if not times:
        raise Missing(f"{run.log.path} holds no step between {window.start:g} and {window.end:g} s")
    return tuple(names), np.concatenate(times), np.concatenate(found)


def of(run: RunData, window: Window = EVER) -> WheelLoads:
    """Of every road wheel; raises Missing."""
    names, t, load = loads(run, window)
    weights = since(t)
    mean = np.average(load, axis=0, weights=weights)
    threshold = LIFTED * float(mean.mean())
    rms = np.sqrt(np.average((load - mean) ** 2, axis=0, weights=weights))
    lifted = np.average(load < threshold, axis=0, weights=weights)
    return WheelLoads(names, mean, load.min(axis=0), load.max(axis=0), rms, lifted, threshold)
