"""Life of the pins and bodies of links: stress by the force in a pin, rainflow cycles, mean stress, Miner's sum.

A pin is a beam on its lugs: the load of an outer lug acts in its middle, that of an inner lug at its quarter points
(Melcon and Hoblit, Product Engineering 24, June 1953). Cycles: ASTM E1049-85, 5.4.5; the residue of a repeated
record closes, so that no cycle is lost at its seams. Mean stress: Goodman; Morrow, SAE Fatigue Design Handbook, 1968;
Walker, ASTM STP 462, 1970; Smith, Watson and Topper, Journal of Materials 5, 1970. Slope below a knee: Haibach, LBF
TM 50, 1970.

The force in a pin counts by its size: that its direction turns against the pin is left out, which is on the safe side.
The damage of a cycle is booked where the pin is, and when, at the cycle's largest force.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import circuit, envelope, hull, phases, record_blocks
from orchestrator.results.analyses.fatigue import closed_places, cycles_with_peaks
from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.results.table import Table
from orchestrator.vocabulary.analyses import check_by

FORCE = "joint[*].force"
DETAILS = ("pin bending", "pin shear", "body")
PARTS = ("pin", "pin", "body")  # tables of their materials
MAX_PINS = 5  # pins of a track in the printed table
CYCLES = ("pin", ""), ("range", "kN"), ("mean", "kN"), ("cycles", ""), ("largest force at", "s")
MATRIX = ("range from", "kN"), ("range to", "kN"), ("mean from", "kN"), ("mean to", "kN"), ("cycles", "")
BY = {  # and columns
    "place": (("part", ""), ("place", "m")), "phase": (("phase", ""), ("from", "s"), ("to", "s")),
    "cycle": CYCLES, "matrix": MATRIX,
}  # fmt: skip
CLASSES = 32  # of ranges and of means in a matrix


def stresses(life: Mapping[str, Any]) -> dict[str, float]:
    """Stress, Pa, of each of DETAILS, and pressure in the lugs, for a force of 1 N in a pin; ``life``: that table."""
    d, n, inner, outer, gap = (life[key] for key in ("pin_diameter", "lugs", "inner_lug", "outer_lug", "gap"))
    share = 1.0 / n  # of a lug
    moment = 0.5 * share * (0.5 * outer + gap + 0.25 * inner)  # Melcon and Hoblit 1953
    shear = 4.0 / 3.0 * 0.5 * share / (0.25 * np.pi * d**2)  # largest, in the middle of a solid circle
    return {
        "pin bending": life["pin_factor"] * 32.0 * moment / (np.pi * d**3),
        "pin shear": float(np.sqrt(3.0) * shear),  # the tension of equal distortion energy (von Mises)
        "body": life["body_factor"] / life["body_area"],
        "inner lug": share / (inner * d),
        "outer lug": 0.5 * share / (outer * d),
    }


def equivalent_amplitude(amplitude: Floats, mean: Floats, line: Mapping[str, Any]) -> Floats:
    """Amplitude about 0 that does what cycles with an amplitude (n) and a mean (n), Pa, do; infinite at fracture.

    ``line``: table ``life.pin`` or ``life.body``. Pressure, a negative mean, does not lengthen the life.
    """
    rule, pulled = line["mean_stress"], np.maximum(mean, 0.0)
    if rule == "none":
        return amplitude
    if rule in ("goodman", "morrow"):
        left = 1.0 - pulled / line["ultimate" if rule == "goodman" else "fracture"]
        return np.where(left > 0.0, amplitude / np.where(left > 0.0, left, 1.0), np.inf)
    most, exponent = pulled + amplitude, 0.5 if rule == "swt" else line["exponent"]
    return most ** (1.0 - exponent) * amplitude**exponent


def damage_of(amplitude: Floats, line: Mapping[str, Any]) -> Floats:
    """Share of life that one cycle with an amplitude (n) about 0, Pa, takes."""
    ratio = amplitude / line["stress"]
    beyond = line.get("slope_beyond") or 2.0 * line["slope"] - 1.0
    return np.where(ratio >= 1.0, ratio ** line["slope"], ratio**beyond) / line["cycles"]


class TrackLife(NamedTuple):
    """Life of the pins of a track, if the window repeats; n pins."""

    track: str
    window: Window  # recorded time, s
    travel: float  # length of chain that passed in the window, m
    circuits: float  # of the chain in the window
    most: Floats  # (n) largest force, N
    damage: Floats  # (n, details) share of life in each repeat, at half of the parts
    factors: Mapping[str, float]  # Pa of each detail and pressure for 1 N
    scatter: tuple[float, ...]  # of each detail
    interval: float  # s between records
    halved: float  # damage of the worst pin and detail by every second record alone, over that of all
    booked: Sequence[tuple[tuple[Any, ...], Floats]]  # cells of BY, (details) damage of all pins; empty without

    @property
    def worst(self) -> tuple[int, int]:
        """Pin and detail with the largest damage, places in the arrays."""
        pin, detail = np.unravel_index(int(self.damage.argmax()), self.damage.shape)
        return int(pin), int(detail)

    @property
    def life(self) -> float:
        """Way in m until the worst pin breaks, at half of the parts; infinite without damage."""
        most = float(self.damage.max(initial=0.0))
        return self.travel / most if most else float("inf")

    @property
    def safe_life(self) -> float:
        """The life that 90 % of the parts reach, m, lives being lognormal."""
        return self.life / float(np.sqrt(self.scatter[self.worst[1]]))


class Life(NamedTuple):
    """Life of one or more tracks."""

    tracks: tuple[TrackLife, ...]
    by: str = ""  # key of BY
    unsound: str = ""  # sentence about a run that failed or a log that was cut off

    def table(self) -> Table:
        """Table of the most damaged pins of each track; with ``by`` of shares of the damage, by part or phase."""
        if self.by == "cycle":
            whole = self._shares(None)
            worst = sorted(whole.rows, key=lambda row: -row[2])[:MAX_PINS]
            return whole._replace(
                rows=worst, notes=(f"the {MAX_PINS} largest of {len(whole.rows)}; -o FILE.csv has all",)
            )
        return self._shares(1 if self.by == "place" else None) if self.by else self._table(MAX_PINS)

    def series(self) -> Table:
        """Table of all pins; with ``by`` of shares of the damage, by place or phase."""
        return self._shares(None) if self.by else self._table(None)

    def _shares(self, columns: int | None) -> Table:
        heads = BY[self.by][:columns]
        rows: dict[tuple[Any, ...], Floats] = {}
        for each in self.tracks:
            whole = np.where((damage := each.damage.sum(axis=0)) > 0.0, damage, np.nan)
            for cells, part in each.booked:
                key = each.track, *cells[: len(heads)]
                rows[key] = rows.get(key, 0.0) + 100.0 * part / whole
        names = (("track", ""), *heads, *((name, "% of its damage") for name in DETAILS))
        start, end = self.tracks[0].window
        title = {"cycle": "Rainflow cycles of pins", "matrix": "Rainflow cycles of all pins by range and mean"}.get(
            self.by, f"Damage of all pins by the {self.by} of a cycle's largest force"
        )
        title += f", {start:.6g} to {end:.6g} s repeated"
        return Table.of(title, names, [(*key, *share.tolist()) for key, share in rows.items()])

    def _table(self, most: int | None) -> Table:
        columns = (
            ("track", ""), ("pin", ""), ("largest force", "kN"), *((f"largest {name}", "MPa") for name in DETAILS),
            ("pressure in lugs", "MPa"), ("breaks by", ""), ("damage a repeat", ""), ("life", "km"),
        )  # fmt: skip
        rows: list[tuple[Any, ...]] = []
        for each in self.tracks:
            pressure = max(each.factors["inner lug"], each.factors["outer lug"])
            for pin in np.argsort(-each.damage.max(axis=1), kind="stable")[:most]:
                force, worst = float(each.most[pin]), int(each.damage[pin].argmax())
                damage = float(each.damage[pin, worst])
                stress = (1e-6 * force * each.factors[name] for name in DETAILS)
                life = 1e-3 * each.travel / damage if damage else float("inf")
                row = each.track, int(pin) + 1, 1e-3 * force, *stress, 1e-6 * force * pressure, DETAILS[worst]
                rows.append((*row, damage, life))
        start, end = (f"{moment:.6g}" for moment in self.tracks[0].window)
        return Table.of(f"Life of pins and links, {start} to {end} s repeated", columns, rows, self.notes())

    def notes(self) -> tuple[str, ...]:
        """Sentences on lives, scatter, circuits and records."""
        found = []
        for each in self.tracks:
            pin, detail = each.worst
            if np.isfinite(each.life):
                found.append(
                    f"the first pin of {each.track} ({pin + 1}, {DETAILS[detail]}) breaks after"
                    f" {1e-3 * each.life:.4g} km of this; 90 % of such pins last {1e-3 * each.safe_life:.4g} km"
                )
            else:
                found.append(f"no pin of {each.track} is damaged")
            if abs(each.circuits - round(each.circuits)) > 0.1 or each.circuits < 0.9:
                found.append(
                    f"{each.track} went round {each.circuits:.2f} times: links have not all had the same cycles, the"
                    " worst had more or less than its share; take a window of whole circuits"
                )
        first = max(self.tracks, key=lambda each: float(each.damage.max(initial=0.0)))
        return (
            *filter(None, [self.unsound]),
            *found,
            f"recorded every {1e3 * first.interval:.4g} ms (run.links); by every second record alone the worst pin"
            f" would have {100.0 * (1.0 - first.halved):.2g} % less damage",
            "cycles by rainflow with the residue closed; stress by the size of the force, whatever its direction",
        )


def of(run: RunData, track: str = "", window: Window = EVER, by: str = "") -> Life:
    """Life of each pin of a track, by default of all; ``by``: key of BY. Raises Missing, NotInstalled, BadInput."""
    check_by("life", by)
    life = table_of(run)
    tracks = tuple(_of_track(run, name, window, life, by) for name in hull.tracks(run, track))
    return Life(tracks, by, run.log.unsound)


def table_of(run: RunData) -> Mapping[str, Any]:
    """Table ``life`` of the vehicle; raises Missing."""
    if life := run.entry("vehicle", "life"):
        return dict(life)
    raise Missing(f"{run.log.path}: the vehicle has no table life (pin, lugs and material): see cotrack keys life")


def worst(run: RunData) -> Table:
    """Table of the worst pin of a run alone, for sweeps; raises Missing, NotInstalled."""
    each = min((found := of(run)).tracks, key=lambda one: one.life)
    columns = ("track", ""), ("pin", ""), ("damage", "1/km"), ("of half", "km"), ("of 90 %", "km")
    row = each.track, each.worst[0] + 1, 1e3 / each.life, 1e-3 * each.life, 1e-3 * each.safe_life
    return Table.of("Life of the worst pin", columns, [row], found.notes())


class PinForces(NamedTuple):
    """Forces in the m records and n pins of a track, and the way of its chain."""

    t: Floats  # (m) s
    force: Floats  # (m, n) N
    way: Floats  # (m) m, length of chain that has passed, either way
    net: float  # m, that passed without what came back
    length: float  # m, of the chain


def pin_forces(run: RunData, track: str, window: Window) -> PinForces:
    """Recorded forces in the pins of a track; raises Missing."""
    times, forces = [], []
    for block in record_blocks.records(run, track, window, FORCE):
        times.append(block.t)
        forces.append(record_blocks.sizes(block.values[0]))
    t, force = np.concatenate(times), np.concatenate(forces)
    if not np.isfinite(force).all():
        raise Missing(f"{run.log.path}: the forces in pins of '{track}' are not all finite numbers")
    moment, passed = run.signal(f"{track}.travel", EVER)
    travel, length = np.interp(t, moment, passed), force.shape[1] * run.scene["vehicle"]["track"]["pitch"]
    return PinForces(t, force, np.append(0.0, np.abs(np.diff(travel)).cumsum()), float(np.ptp(travel)), length)


def _of_track(run: RunData, track: str, window: Window, life: Mapping[str, Any], by: str) -> TrackLife:
    found = pin_forces(run, track, window)
    t, force, travel = found.t, found.force, float(found.way[-1])
    span, factors = Window(float(t[0]), float(t[-1])), stresses(life)
    cycles = [rainflow(column) for column in force.T]
    damages, peaks = [damages_of(each, factors, life) for each in cycles], [each[3] for each in cycles]
    damage = np.array([each.sum(axis=0) for each in damages])
    pin, detail = np.unravel_index(int(damage.argmax()), damage.shape)
    sparse = damages_of(rainflow(force[::2, pin]), factors, life).sum(axis=0)[detail]
    halved = float(sparse / damage[pin, detail]) if damage[pin, detail] else 1.0
    interval, scatter = (span.end - span.start) / max(len(t) - 1, 1), tuple(life[part]["scatter"] for part in PARTS)
    cells: list[tuple[Any, ...]] = []
    if by == "phase":
        known = phases.of(run).phases
        cells = [(phases.phase_name(each), each.start, each.end) for each in known]
        number = np.searchsorted([each.start for each in known[1:]], t[np.concatenate(peaks)], side="right")
    elif by in ("cycle", "matrix"):
        ranges, means, counts, records = (np.concatenate(each) for each in zip(*cycles, strict=True))
        if by == "cycle":
            pins = np.repeat(np.arange(len(cycles)) + 1, [len(each[0]) for each in cycles])
            every = np.stack([pins, 1e-3 * ranges, 1e-3 * means, t[records]])
            found_cycles, number = np.unique(every, axis=1, return_inverse=True)  # a cycle may be two equal halves
            number = number.ravel()
            *sizes, moments = found_cycles.tolist()
            cells = [*zip(map(int, sizes[0]), *sizes[1:], np.bincount(number, counts).tolist(), moments, strict=True)]
        else:
            cells, number = _classes(1e-3 * np.stack([ranges, means]), counts)
    elif by:
        cells, bins = _places(run, track, window)
        number = np.concatenate([column[peak] for column, peak in zip(bins.T, peaks, strict=True)])
    booked = []
    if by:
        np.add.at(sums := np.zeros((len(cells), len(DETAILS))), number, np.concatenate(damages))
        booked = [*zip(cells, sums, strict=True)]
    parts = span, travel, travel / found.length, force.max(axis=0), damage, factors, scatter, interval, halved, booked
    return TrackLife(track, *parts)


def _places(run: RunData, track: str, window: Window) -> tuple[list[tuple[Any, ...]], np.ndarray]:
    """Parts and places of the circuit, one a link, and the number of that of each record and pin (m, n); Missing."""
    where, names = envelope.of(run, track=track, window=window), {}
    if run.scene.get("assembly") == "vehicle":  # the lower run in three
        wheels = run.scene["vehicle"]["road_wheel"]["x"]
        names = {1: "front run", 0: "ground run", -1: "rear run"}
        sides = (where.forward > max(wheels)) * 1 - (where.forward < min(wheels))
    parts = [names[sides[k]] if names and part == "lower run" else part for k, part in enumerate(where.part)]
    at = np.concatenate([block.joints / block.length[:, None] for block in circuit.records(run, track, window)])
    return list(zip(parts, where.place.tolist(), strict=True)), (at * len(parts)).astype(int) % len(parts)


def _classes(sizes: Floats, counts: Floats) -> tuple[list[tuple[float, ...]], np.ndarray]:
    """Classes with cycles, of CLASSES of ranges from 0 and of means, as cells of MATRIX, and that of each cycle (k).

    ``sizes``: ranges and means (2, k), kN; ``counts`` (k).
    """
    low = np.array([[0.0], [sizes[1].min(initial=0.0)]])
    wide = (sizes.max(axis=1, keepdims=True, initial=0.0) - low) / CLASSES
    wide = np.where(wide > 0.0, wide, 1.0)
    at = np.minimum((sizes - low) // wide, CLASSES - 1)
    found, number = np.unique(at, axis=1, return_inverse=True)
    edges = np.stack([low + wide * found, low + wide * (found + 1)], axis=1).reshape(4, -1)
    return [*zip(*edges.tolist(), np.bincount(number.ravel(), counts).tolist(), strict=True)], number.ravel()


def rainflow(force: Floats) -> tuple[Floats, Floats, Floats, np.ndarray]:
    """Ranges, means, N, and counts (k) of the cycles of a repeated record (m), and records of peaks; NotInstalled."""
    places = closed_places(force)
    ranges, means, counts, peaks = cycles_with_peaks(force[places])
    return ranges, means, counts, places[peaks]


def damages_of(cycles: Sequence[Floats], factors: Mapping[str, float], life: Mapping[str, Any]) -> Floats:
    """Damage (k, details) of each of the ``rainflow`` cycles."""
    ranges, means, counts, _ = cycles
    found = []
    for name, part in zip(DETAILS, PARTS, strict=True):
        amplitude = equivalent_amplitude(0.5 * factors[name] * ranges, factors[name] * means, life[part])
        found.append(counts * damage_of(amplitude, life[part]))
    return np.array(found).T
