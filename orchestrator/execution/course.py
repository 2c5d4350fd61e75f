"""Life of a track on a course: Miner's sum over runs, each by its share of the way, and how well it is known.

A link goes round, so that on a long course every link gets what all links get: the mean of all links over whole
circuits is the damage of each. The km are the mean way of the chains of a run, as an odometer at the drives counts.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import BeforeValidator, Field, ValidationError

from fmus.vehicles.tables import BadInput, FrozenTable, In, first_error, foremost, path_text
from orchestrator.execution.log_report import changed_settings
from orchestrator.execution.manifest import decode_results
from orchestrator.log.reader import Log, Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull
from orchestrator.results.analyses.life import (
    DETAILS,
    PARTS,
    PinForces,
    damages_of,
    pin_forces,
    rainflow,
    stresses,
    table_of,
)
from orchestrator.results.run_data import RunData, Window
from orchestrator.results.table import Table
from orchestrator.scene.scene import read_file_table
from orchestrator.scene.settings import hint

REPORTED = 0.05  # share of the damage below the knee that is told
ALMOST = 0.01  # of a circuit, that a whole one may lack
ESTIMATES = ("all links", "worst links", "seeds", "halves", "records", "error", "rest")
ALL, WORST, SEEDS, HALVES, RECORDS, ERROR, REST = range(len(ESTIMATES))
OneOrMore = BeforeValidator(lambda given: [given] if isinstance(given, str) else given)


class RunTable(FrozenTable):  # noqa: D101
    log: Annotated[list[str], OneOrMore, Field(min_length=1)]
    km: Annotated[float, In("km", gt=0)]
    start: Annotated[float, In("s")] = Field(default=-math.inf, alias="from")
    end: Annotated[float, In("s")] = Field(default=math.inf, alias="to")


class CourseTable(FrozenTable):  # noqa: D101
    run: Annotated[list[RunTable], Field(min_length=1)]


class CourseLife(NamedTuple):
    """Life of the links of the tracks on a course of k runs."""

    names: tuple[str, ...]  # of the runs
    share: Floats  # (k) of the way
    circuits: tuple[int, ...]  # (k) least of the tracks and logs
    rates: dict[str, Floats]  # by track: (k, estimates, 2, details) least and most damage, 1/km; NaN: not known
    scatter: tuple[float, ...]  # of each detail
    below_knee: dict[str, Floats]  # by track: (k, details) share of the damage by cycles below the knee of the S-N line

    def damage(self, track: str) -> Floats:
        """Damage (k, estimates, 2, details) by each run in a km of the course, that of all links where not known."""
        rates = self.rates[track]
        return np.where(np.isnan(rates), rates[:, :1], rates) * self.share[:, None, None, None]

    @property
    def order(self) -> list[tuple[str, int]]:
        """Tracks with the places of details, by their lives."""
        every = product(self.rates, range(len(DETAILS)))
        return sorted(every, key=lambda of: -self.damage(of[0])[:, ALL, 0, of[1]].sum())

    def table(self, every: bool = False) -> Table:
        """Table of the life by each estimate, of what breaks first or of every track and detail."""
        rows = []
        for track, k in self.order[: None if every else 1]:
            rates = self.damage(track)[..., ::-1, k].sum(axis=0)
            unknown = np.isnan(self.rates[track][..., 0, k])  # (k, estimates)
            lives = np.divide(1.0, rates, out=np.full_like(rates, math.inf), where=rates > 0.0)
            lives[unknown.all(axis=0)] = math.nan
            for name, each, runs in zip(ESTIMATES, lives, (~unknown).sum(axis=0), strict=True):
                safe = each / math.sqrt(self.scatter[k])
                rows.append((track, DETAILS[k], name, int(runs), *each.tolist(), *safe.tolist()))
        bounds = ((f"{part} % last, {which}", "km") for part in (50, 90) for which in ("least", "most"))
        columns = ("track", ""), ("breaks by", ""), ("estimate", ""), ("known of runs", ""), *bounds
        track, k = self.order[0]
        damage = self.damage(track)[:, ALL, 0, k]
        share = float(damage @ self.below_knee[track][:, k]) / (float(damage.sum()) or 1.0)
        knee = f"{100.0 * share:.3g} % of the damage by {DETAILS[k]} is by cycles below the knee of its S-N line, where"
        notes = (f"{knee} slope_beyond counts: few tests reach that far",) if share >= REPORTED else ()
        return Table.of(f"Life on a course of {len(self.names)} runs", columns, rows, notes)

    def runs(self) -> Table:
        """Table of what each run does to the track and detail that break first."""
        track, k = self.order[0]
        damage, worst = self.damage(track)[:, :2, 0, k].T
        with np.errstate(invalid="ignore"):  # no damage at all
            figures = 100.0 * self.share, damage / self.share, 100.0 * damage / damage.sum(), worst / damage
        columns = (
            ("run", ""),
            ("circuits", ""),
            ("way", "%"),
            ("damage", "1/km"),
            ("of it", "%"),
            ("worst over all", ""),
        )
        rows = zip(self.names, self.circuits, *(each.tolist() for each in figures), strict=True)
        return Table.of(f"Runs, by {DETAILS[k]} of {track}", columns, list(rows))


def life(path: str | os.PathLike[str]) -> CourseLife:
    """Life of a track on the course of a TOML file; raises BadInput, Missing, LogUnreadable, NotInstalled."""
    file, found, circuits, below = Path(path), [], [], []
    known: dict[str, Any] = {}
    try:
        runs = CourseTable.model_validate(read_file_table(file, "course")).run
    except ValidationError as error:
        sentence, first = first_error(error, path_text(file), CourseTable.model_json_schema()), foremost(error)
        if first["type"] == "extra_forbidden":
            fields = (RunTable if len(first["loc"]) > 1 else CourseTable).model_fields
            may = [field.alias or name for name, field in fields.items()]
            sentence += f": {hint(str(first['loc'][-1]), may, 'there are')}"
        raise BadInput(sentence) from None
    for k, each in enumerate(runs, 1):
        if len({*each.log}) < len(each.log):
            raise BadInput(f"{path_text(file)}: run[{k}].log = {each.log}: names a log twice")
        logs: list[tuple[int, Floats, Floats]] = []
        scene: dict[str, Any] = {}
        for name in each.log:
            with Log(file.parent / name, unfinished=True) as log:
                if not log.closing or log.closing["status"] == "failed":
                    raise Missing(f"{log.path} was cut off, or its run failed: a course takes whole runs")
                run = RunData(log)
                life, track = table_of(run), run.scene["vehicle"]["track"]
                own = {"life": life, "pitch": track["pitch"], "links": track.get("links"), "tracks": hull.tracks(run)}
                known = known or {"of": log.path, **own}
                for key, value in changed_settings(known, own):
                    raise Missing(f"{log.path}: {key} = {value} is not as in {known['of']}: a course is of one track")
                scene = scene or dict(run.scene)
                for key, _ in (*changed_settings(scene, run.scene), *changed_settings(run.scene, scene)):
                    if not key.endswith((".seed", "title")):
                        raise Missing(
                            f"{log.path}: {key} is not as in {each.log[0]}: logs of one run differ in the"
                            " seed of the ground alone; others are a run of their own"
                        )
                log.notice_seal()
                logs.append(_of_log(run, Window(each.start, each.end)))
        circuits.append(min(count for count, *_ in logs))
        every = np.array([rates for _, rates, _ in logs])
        below.append(np.mean([share for *_, share in logs], axis=0))
        joined, means = every.mean(axis=0), every[:, :, ALL, 0]
        joined[:, WORST] = every[:, :, WORST].max(axis=0)
        if len(logs) > 1:
            joined[:, SEEDS] = np.stack([means.min(axis=0), means.max(axis=0)], axis=1)
        found.append(joined)
    names = tuple(f"{k}: {one.log[0]}{', ...' * (len(one.log) > 1)}" for k, one in enumerate(runs, 1))
    km, scatter = np.array([each.km for each in runs]), tuple(known["life"][part]["scatter"] for part in PARTS)
    rates = dict(zip(known["tracks"], np.swapaxes(found, 0, 1), strict=True))
    shares = dict(zip(known["tracks"], np.swapaxes(below, 0, 1), strict=True))
    return CourseLife(names, km / km.sum(), tuple(circuits), rates, scatter, shares)


def _of_log(run: RunData, window: Window) -> tuple[int, Floats, Floats]:
    """Least number of whole circuits, rates (tracks, estimates, 2, details) in a window, and shares (tracks, details).

    Shares of the damage are those of cycles below the knee. Raises Missing.
    """
    forces = {name: pin_forces(run, name, window) for name in hull.tracks(run)}
    odometer = 1e-3 * float(np.mean([each.way[-1] for each in forces.values()]))
    results = decode_results((run.log.closing or {}).get("results", {}))
    error = (results.get("error") or {}).get("observables", {}).get("joint_force", {}).get("total")
    life, found, counts = table_of(run), [], [int(each.way[-1] / each.length + ALMOST) for each in forces.values()]
    factors, below = stresses(life), []
    cut = {part: {**life[part], "slope_beyond": math.inf} for part in PARTS}  # no damage below the knee
    for (name, each), count in zip(forces.items(), counts, strict=True):
        whole, net = each.way[-1] / each.length, each.net / each.length
        if min(count, net + ALMOST) < 1.0:
            raise Missing(f"{run.log.path}: the chain of {name} went round {net:.2f} times; a run needs one circuit")

        def pins(first: float, last: float, step: int = 1, scale: float = 1.0, each: PinForces = each,
                 of: Mapping[str, Any] = life) -> Floats:  # fmt: skip
            """Damage (pins, details) a km by scaled forces from one number of circuits to another."""
            ends = first, last + 1e-9  # with the time that the chain stands at the end
            a, b = np.searchsorted(each.way, np.multiply(ends, each.length))
            damage = [damages_of(rainflow(pull), factors, of).sum(axis=0) for pull in scale * each.force[a:b:step].T]
            return np.array(damage) * each.way[-1] / ((last - first) * each.length * odometer)

        links = pins(0, count)
        every, above = links.mean(axis=0), pins(0, count, of=cut).mean(axis=0)
        below.append(1.0 - np.divide(above, every, out=np.ones_like(every), where=every > 0.0))
        rates = np.full((len(ESTIMATES), 2, len(DETAILS)), math.nan)
        rates[ALL], rates[WORST] = every, links.max(axis=0)
        rates[RECORDS] = every, 2.0 * every - pins(0, count, 2).mean(axis=0)
        rates[REST] = every, pins(0, whole).mean(axis=0)
        if half := count // 2:
            rates[HALVES] = pins(0, half).mean(axis=0), pins(count - half, count).mean(axis=0)
        if error is not None:
            rates[ERROR] = [pins(0, count, 1, 1.0 + each).mean(axis=0) for each in (-error, error)]
        found.append(np.sort(rates, axis=1))
    return min(counts), np.array(found), np.array(below)
