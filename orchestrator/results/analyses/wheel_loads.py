"""Loads of road wheels: upward force of the track on each, in hull axes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses.at_steps import RECOVER
from orchestrator.results.analyses.spells import TOUCHES, Spells, spells
from orchestrator.results.rotation import body_axis
from orchestrator.results.run_data import BLOCK, EVER, Missing, RunData, Window, means, since
from orchestrator.results.table import Table


class WheelLoads(NamedTuple):
    """Loads over a window, weighted by time."""

    wheels: tuple[str, ...]  # "left_track.road_wheel[1]"
    mean: Floats  # (wheels,) N
    least: Floats  # (wheels,) N
    most: Floats  # (wheels,) N
    rms: Floats  # (wheels,) N, deviation from the mean
    lifted: Floats  # (wheels,) share of time without load
    threshold: float  # N, a smaller load counts as lifted (``spells.py``)

    def table(self) -> Table:
        """Table with a row for each wheel."""
        values = (self.mean / 1e3, self.least / 1e3, self.most / 1e3, self.rms / 1e3, 100.0 * self.lifted)
        rows = list(zip(self.wheels, *(each.tolist() for each in values), strict=True))
        columns = (
            ("wheel", ""), ("mean", "kN"), ("least", "kN"), ("largest", "kN"), ("rms about mean", "kN"),
            ("lifted", "% of time"),
        )  # fmt: skip
        least = self.threshold / 1e3
        note = f"a wheel is lifted from where it carries less than {least:.3g} kN to more than {TOUCHES * least:.3g} kN"
        return Table.of("Load of road wheels, up in the hull", columns, rows, (note,))


def names(run: RunData) -> tuple[str, ...]:
    """Names of the road wheels whose forces were recorded, "left_track.road_wheel[1]"."""
    return tuple(
        f"{track}.{name.removesuffix('.force.x')}"
        for track in run.tracks
        for name in run.log.topics[f"/{track}/out"].names
        if name.startswith("road_wheel[") and name.endswith(".force.x")
    )


def blocks(run: RunData, window: Window = EVER) -> Iterator[tuple[Floats, Floats]]:
    """Times (m,), s, and loads of the road wheels (m, wheels), N, in blocks; raises Missing.

    In a log that was cut off only steps of all components count.
    """
    wheels = names(run)
    if not wheels:
        raise Missing(f"{run.log.path} holds no road wheel")
    forces = [[run.log.find(f"{name}.force.{axis}") for axis in "xyz"] for name in wheels]
    wanted: dict[str, list[int]] = {}
    for topic, column in (place for force in forces for place in force):
        wanted.setdefault(topic, []).append(column)
    turned = [f"chassis.orientation.{part}" for part in "wxyz"] if run.has("chassis.chassis.orientation.w") else []
    if turned:
        wanted["/chassis/out"] = [run.log.topics["/chassis/out"].names.index(name) for name in turned]
    for block in run.log.blocks(wanted, BLOCK, window=window):
        count = min(len(each.t) for each in block.values())
        found = {topic: each.rows(slice(count)) for topic, each in block.items()}
        t = next(iter(found.values())).t
        if not all(np.array_equal(each.t, t) for each in found.values()):
            raise Missing(f"{run.log.path} holds different steps of its components: {RECOVER}")
        force = np.concatenate([found[topic].values for topic in wanted if topic != "/chassis/out"], axis=1)
        up = np.tile([0.0, 0.0, 1.0], (count, 1))
        if turned and count:
            up = body_axis(found["/chassis/out"].values, 2)
        yield t, np.einsum("mki,mi->mk", force.reshape(count, len(wheels), 3), up)


def lifted(run: RunData, window: Window = EVER) -> Spells:
    """Intervals in which road wheels are lifted (``spells.py``), by wheel; raises Missing."""
    return run.once(f"lifted wheels, {window}", lambda run: spells(names(run), lambda: blocks(run, window)))


def of(run: RunData, window: Window = EVER) -> WheelLoads:
    """Loads of all road wheels; raises Missing."""
    t, load = (np.concatenate(parts) for parts in zip(*blocks(run, window), strict=True))
    if not len(t):
        raise Missing(f"{run.log.path} holds no step between {window.start:g} and {window.end:g} s")
    mean = means(t, load)
    rms = np.sqrt(means(t, (load - mean) ** 2))
    found = lifted(run, window)
    share = np.array([sum(spell.time for spell in found.of[name]) for name in names(run)]) / since(t).sum()
    return WheelLoads(names(run), mean, load.min(axis=0), load.max(axis=0), rms, share, found.threshold)
