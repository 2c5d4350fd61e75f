"""Figures of phases in the summary and on the page of a run, computed again from the log by another reader.

This reader is that of the package mcap with plain protobuf messages, without code of the product. ``full``: the scenes
of the gallery and a manoeuvre; by default a short manoeuvre on rigid links.
"""

import html
import re
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.reader import make_reader

MANOEUVRE = (  # drive off, turn right, brake: speed of both sprockets over time
    "drive.left.speed_points=[[0.5,0],[2,8],[3.5,8],[4,10],[5.5,10],[6,8],[6.5,8],[7.5,0]]",
    "drive.right.speed_points=[[0.5,0],[2,8],[3.5,8],[4,6],[5.5,6],[6,8],[6.5,8],[7.5,0]]",
    "run.stop=9",
)
SHORT = (
    "drive.left.speed_points=[[0.5,0],[1.7,6],[2.3,6],[2.6,8],[3.8,8],[4.1,6],[4.4,6],[5.4,0]]",
    "drive.right.speed_points=[[0.5,0],[1.7,6],[2.3,6],[2.6,4],[3.8,4],[4.1,6],[4.4,6],[5.4,0]]",
    "run.stop=6.2", "track.model=rigid",
)  # fmt: skip
RUNS = {
    "short": ("turn", SHORT, ["rest", "acceleration", "turn right", "braking", "rest"]),
    "straight": ("straight", (), ["rest", "acceleration", "steady"]),
    "turn": ("turn", (), ["rest", "acceleration", "acceleration, turning left", "turn left"]),
    "serpentine": ("serpentine", (), ["rest", "acceleration", "turn left", "acceleration, turning right", "braking"]),
    "manoeuvre": ("turn", MANOEUVRE, ["rest", "acceleration", "steady", "turn right", "steady", "braking", "rest"]),
}


class PrintedPhase(NamedTuple):
    """Figures of a phase in the text; NaN where there is none."""

    name: str
    start: float
    end: float
    way: float
    speed: float
    yaw_rate: float
    yaw_most: float
    radius: float
    power: float
    tension: float
    slips: tuple[float, ...]


def number(text):
    return float("nan") if not text else float(text.replace("\N{MINUS SIGN}", "-"))


def rows(out, first):
    """Rows of the printed table whose first head is ``first``: cells by head; columns end where their heads do."""
    lines = iter(out.splitlines())
    heads = next((line for line in lines if re.match(f"  {first} +from ", line)), "")
    if not heads:
        return
    units = next(lines)
    names, ends = zip(*((found[0], found.end()) for found in re.finditer(r"\S+(?: \S+)*", heads)), strict=True)
    assert len(units) <= ends[-1], "units end below their heads"
    for line in lines:
        if not re.match(r"  [a-z]+ +[\d.]+ +[\d.]+(?: |$)", line):
            return
        name, begin = line[: ends[1]].split()
        cells = [line[a:b].strip() for a, b in pairwise(ends[1:])]
        yield dict(zip(names, (name, begin, *cells), strict=True))


def printed(out):
    """Phases of a printed summary, from its two tables."""
    turns = {(row["from"], row["to"]): row for row in rows(out, "turn")}
    for row in rows(out, "phase"):
        turn = turns.get((row["from"], row["to"]), {})
        joint = " " if row["phase"] == "turn" else ", turning "
        speed = row["speed"] if " to " not in row["speed"] else ""
        slips = [turn["slip left"], turn["slip right"]] if turn else row.get("slip", "").split(" and ")
        yield PrintedPhase(
            row["phase"] + (joint + turn["turn"] if turn else ""), number(row["from"]), number(row["to"]),
            number(row["way"]), number(speed), number(turn.get("yaw rate")), number(turn.get("largest")),
            number(turn.get("radius")), number(row["power"]), number(row["tension"]),
            tuple(number(slip) for slip in slips if slip),
        )  # fmt: skip


def on_page(text):
    """Phases of the table on a page."""
    table = re.search(r'<table class="phases">.*?<tbody>(.*?)</tbody>', text, re.S)[1]
    for row in re.findall(r"<tr>(.*?)</tr>", table, re.S):
        row = re.sub(r"</b><br><span class='muted'>(turning \w+)</span>", r", \1</b>", row)
        cells = [html.unescape(cell) for cell in re.findall(r"<td>(.*?)</td>", row, re.S)]
        name, start, end, way, speed, yaw, radius, power, slips, tension = (
            re.sub(r"<b>|</b>|<br>.*", "", cell) for cell in cells
        )
        mean, _, most = yaw.replace(")", "").partition(" (")
        slip = tuple(number(each) for each in slips.split(" / "))
        values = (number(each) for each in (start, end, way, speed, mean, most, radius, power))
        yield PrintedPhase(name, *values, number(tension.removesuffix(" kN")), slip)


@cache
def message_type(name, descriptors):
    """Message class of a schema."""
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(descriptors).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(name))


class Record:
    """Signals of a log by topic and field, read without code of the product."""

    def __init__(self, path):
        self._rows = {}
        with path.open("rb") as file:
            for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
                if channel.topic.endswith("/out"):
                    row = message_type(schema.name, schema.data).FromString(message.data)
                    self._rows.setdefault(channel.topic, []).append(row)
        self.tracks = [topic for topic in self._rows if topic.endswith("_track/out")]
        self.drives = [topic for topic in self._rows if "_drive/" in topic or "differential" in topic]
        self.t = self.of("/chassis/out", "t")

    def of(self, topic, field):
        return np.array([getattr(row, field) for row in self._rows[topic]])

    def phase(self, printed_phase):
        """The same figures from the records between two instants; each record has the weight of its step."""
        a, b = (int(np.abs(self.t - instant).argmin()) for instant in (printed_phase.start, printed_phase.end))
        hull, h = "/chassis/out", np.diff(self.t[a : b + 1])
        length = self.t[b] - self.t[a]

        def integral(values):
            return float(np.sum(0.5 * (values[a + 1 : b + 1] + values[a:b]) * h))

        far = integral(np.hypot(self.of(hull, "chassis_velocity_x"), self.of(hull, "chassis_velocity_y")))
        rate = self.of(hull, "chassis_angular_velocity_z")
        turned, held = integral(rate), min(0.5, length)
        total = np.concatenate([[0.0], np.cumsum(0.5 * (rate[a + 1 : b + 1] + rate[a:b]) * h)])
        begins = np.arange(self.t[a], self.t[b] - held + 1e-9, 0.01)
        means = [
            (np.interp(t + held, self.t[a : b + 1], total) - np.interp(t, self.t[a : b + 1], total)) / held
            for t in begins
        ]
        work = sum(self.of(drive, "energy_work")[[a, b]] for drive in self.drives)
        forward = [np.where(self.of(track, "speed") < 0.0, -1.0, 1.0) for track in sorted(self.tracks)]
        slips = tuple(
            float((self.of(track, "slip") * way)[a + 1 : b + 1] @ h / length)  # positive where the track drives
            for track, way in zip(sorted(self.tracks), forward, strict=True)
        )
        tension = max(self.of(track, "tension_max")[a + (a > 0) : b + 1].max() for track in self.tracks)
        return PrintedPhase(
            printed_phase.name, float(self.t[a]), float(self.t[b]), far, integral(self.of(hull, "speed")) / length,
            turned / length, max(means, key=abs), far / abs(turned) if turned else float("nan"),
            float(work[1] - work[0]) / length / 1e3, float(tension) / 1e3, slips,
        )  # fmt: skip


def within_rounding(phase):
    """The phase, and it with bounds moved by half of the last digit: of four digits, 5 ms from 10 s on."""
    half = [5e-3 if t >= 10.0 else 0.0 for t in (phase.start, phase.end)]
    yield phase
    for a, b in ((-1, 0), (1, 0), (0, -1), (0, 1)):
        yield phase._replace(start=phase.start + a * half[0], end=phase.end + b * half[1])


FIGURES = "way", "speed", "yaw_rate", "yaw_most", "radius", "power", "tension"


@pytest.mark.long
@pytest.mark.parametrize(
    "name", ["short", *(pytest.param(name, marks=pytest.mark.study) for name in RUNS if name != "short")]
)
def test_figures_of_summary_and_page_are_those_of_the_log(cotrack, tmp_path, name):
    scene, settings, kinds = RUNS[name]
    log, page = tmp_path / "run.mcap", tmp_path / "run.html"
    changes = [part for each in settings for part in ("--set", each)]
    _, out, _ = cotrack("run", scene, "--no-estimate", "--verbose", "--log", log, *changes)
    cotrack.done("report", log, "-o", page)
    record, counted = Record(log), 0
    for phases in ([*printed(out)], [*on_page(page.read_text(encoding="utf-8"))]):
        rest = iter([phase.name for phase in phases])
        assert all(kind in rest for kind in kinds)  # in this order; others may be between and after
        for phase in phases:
            other, *moved = (record.phase(one) for one in within_rounding(phase))
            for figure in FIGURES:
                told, wanted = getattr(phase, figure), getattr(other, figure)
                shift = max(abs(getattr(one, figure) - wanted) for one in moved)
                if told == told:  # NaN: it is not told of this phase
                    counted += 1
                    assert told == pytest.approx(wanted, rel=6e-3, abs=6e-3 + shift), (phase.name, figure)
            if phase.slips:
                assert np.resize(phase.slips, len(other.slips)) == pytest.approx(other.slips, abs=1.6e-3), phase.name
        largest = max(record.phase(phase).tension for phase in phases)
    assert counted >= 6 * len(kinds), "little was compared: of rest a summary tells nothing, a page four figures"
    _bounds_are_where_the_speed_changes(record, phases)
    assert float(re.search(r"largest link tension +([\d.]+)", out)[1]) == pytest.approx(largest, rel=1e-3)


def _bounds_are_where_the_speed_changes(record, printed_phases):
    """Bounds of phases are where the speed changes, by half-second means of the speed at both ends."""
    v = record.of("/chassis/out", "speed")
    top = np.abs(v).max()
    for phase in printed_phases:
        inside = (record.t >= phase.start) & (record.t <= phase.end)
        if phase.name == "rest":
            assert np.abs(np.mean(v[inside])) < 0.05 * top
        elif phase.name.startswith(("steady", "turn")):
            assert np.ptp(v[inside]) < 0.4 * top
        else:
            a, b = np.flatnonzero(inside)[[0, -1]]
            assert abs(abs(v[b]) - abs(v[a])) > 0.1 * top
