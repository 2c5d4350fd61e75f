"""Section of a page with measured signals: figures from the raw log and the CSV file, curves, refusals."""

import re
from pathlib import Path

import numpy as np
import pytest
from motion_logs import motion_log, phases_of, times, trapezoid
from report_pages import embedded, unpacked

import orchestrator as package
from orchestrator.log.reader import Log
from orchestrator.results.units import number, percent

MAPPED = ("--map", "chassis.speed=v", "--map", "left_track.tension.max=F")
EARLIER = 12.5  # s, of the clock of the test


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Log of a vehicle that accelerates and brakes, with a tension that rises with the time."""
    t = times(8.5)
    return motion_log(tmp_path_factory.mktemp("measured") / "v.mcap", t, trapezoid(t), tension=1e4 + 1e3 * t)


@pytest.fixture(scope="module")
def measured_csv(tmp_path_factory):
    """Record of a test of 7.5 s at 100 Hz, with a gap in the force."""
    t = np.arange(0.0, 7.505, 0.01)
    force = np.where((t > 2.0) & (t < 4.0), np.nan, 1e4 + 990.0 * t)
    rows = zip(t + EARLIER, 100.0 * (trapezoid(t) + 0.2 * np.sin(3.0 * t)), force / 1e3, strict=True)
    lines = [",".join("" if value != value else repr(float(value)) for value in row) for row in rows]
    path = tmp_path_factory.mktemp("measured") / "test.csv"
    path.write_text("\n".join(["time [s],v [%],F [kN]", *lines]))
    return path


def section(html):
    """Cells of the section's table by row, without HTML."""
    found = re.search(r'<section id="measured">(.*?)</section>', html, re.S)[1]
    rows = re.findall(r"<tr>(<td>.*?)</tr>", found)
    return found, [[re.sub("<.*?>", " ", cell).split() for cell in re.findall("<td>(.*?)</td>", row)] for row in rows]


def test_the_figures_are_those_of_the_raw_log_and_the_file(run, measured_csv, cotrack, tmp_path):
    shifted = ("--shift", -EARLIER, "-o", "x.html")
    assert cotrack.done("report", run, "--with", measured_csv, *MAPPED, *shifted) == "x.html\n"
    found, rows = section((tmp_path / "x.html").read_text(encoding="utf-8"))
    times, speed, force = np.genfromtxt(measured_csv, delimiter=",", skip_header=1).T
    t, expected = np.round(times - EARLIER, 6), []
    windows = [("whole", 0.0, 8.5), *((one.kind, one.start, one.end) for one in phases_of(run))]
    with Log(run) as log:
        for name, column in (("chassis.speed", speed / 100.0), ("left_track.tension.max", 1e3 * force)):
            recorded, values = log.signal(name)
            apart = values[np.searchsorted(recorded, t - 1e-6)] - column
            for window, start, end in windows:
                inside = (t >= start - 1e-9) & (t <= end + 1e-9)
                known = inside & ~np.isnan(column)
                rms, of = np.sqrt(np.mean(apart[known] ** 2)), np.sqrt(np.mean(column[known] ** 2))
                k = np.flatnonzero(known)[np.abs(apart[known]).argmax()]
                figures = number(rms, 3), percent(rms / of), number(apart[known].mean(), 3), number(apart[k], 3)
                expected.append((window, *figures, number(t[k]), int(known.sum()), int((inside & ~known).sum())))
    shown = [
        (row[1][0], row[2][0], " ".join(row[3]), row[4][0], row[5][0], row[5][-2], *map(int, [*row[7], 0][:2]))
        for row in rows
    ]
    assert shown == expected
    assert {"acceleration", "braking", "steady"} < {window for window, *_ in expected}
    assert sum(left_out for *_, left_out in expected if left_out) == 2 * 199, "whole, and the phases that the gap is in"
    assert "<b>test.csv</b>, \N{MINUS SIGN}12.5 s added to its times" in found
    assert [row[0] for row in rows if row[0]] == [["speed", "chassis"], ["tension.max", "left_track"]]


def charts_with(log, path, columns, **options):
    """Charts of the page of a log with measured columns, and its HTML."""
    html = package.Run(log).report(path, columns=columns, **options).read_text(encoding="utf-8")
    return embedded(html)["charts"], html


def test_both_curves_are_drawn(run, measured_csv, tmp_path):
    plain = package.Run(run).report(tmp_path / "x.html").read_text(encoding="utf-8")
    assert 'id="measured"' not in plain
    columns = {"chassis.speed": "v", "left_track.tension.max": "F"}
    charts, _ = charts_with(run, tmp_path / "x.html", columns, measured=measured_csv, shift=-EARLIER)
    assert embedded(plain)["charts"].keys() == {key for key in charts if not key.startswith("measured")}
    speed, force = charts["measured-0"], charts["measured-1"]
    assert [trace["name"] for trace in speed["traces"]] == ["run", "measured"]
    assert (speed["y"], force["y"]) == ("speed", "tension.max, kN")
    own, test = ((unpacked(trace["t"]), unpacked(trace["y"])) for trace in force["traces"])
    assert own[1] == pytest.approx(10.0 + own[0], rel=1e-6)
    gap = np.isnan(test[1])
    assert (gap.sum(), test[0][gap][0]) == (1, pytest.approx(3.0, abs=1e-6))
    assert test[1][~gap] == pytest.approx(10.0 + 0.99 * test[0][~gap], rel=1e-6)
    assert test[0][[0, -1]] == pytest.approx([0.0, 7.5], abs=1e-6)
    t, v = (unpacked(speed["traces"][1][axis]) for axis in "ty")
    assert v == pytest.approx(trapezoid(t) + 0.2 * np.sin(3.0 * t), abs=1e-5)


def test_moving_means_end_where_nothing_was_measured(tmp_path):
    """A run that is drawn as a band is drawn with moving means of both."""
    t = times(4.0)
    log = motion_log(tmp_path / "band.mcap", t, 0.0 * t, tension=1e4 + 500.0 * np.sin(200.0 * np.pi * t))
    rows = [f"{0.01 * k!r},{'' if 100 < k < 200 else 9.9}" for k in range(50, 301)]
    (tmp_path / "m.csv").write_text("\n".join(["t,F [kN]", *rows]))
    columns = {"left_track.tension.max": "F"}
    charts, _ = charts_with(log, tmp_path / "x.html", columns, measured=tmp_path / "m.csv")
    run, test = charts["measured-0"]["traces"]
    assert run["mean"]
    moments, values = unpacked(test["t"]), unpacked(test["y"])
    known = ~np.isnan(values)
    assert values[known] == pytest.approx(9.9, rel=1e-6)
    assert not (known & (moments > 1.0001) & (moments < 1.9999)).any()
    assert moments[[0, -1]] == pytest.approx([0.5, 3.0], abs=0.01)


def test_a_run_without_a_hull_has_no_phases(tmp_path):
    log = Path(__file__).with_name("logs") / "without_fmu.mcap"
    with Log(log) as opened:
        name = opened.signals[0]
        t, values = opened.signal(name)
    np.savetxt(tmp_path / "m.csv", np.stack([t, values], axis=1), delimiter=",", header="t,x", comments="")
    _, rows = section(charts_with(log, tmp_path / "x.html", {name: "x"}, measured=tmp_path / "m.csv")[1])
    assert [row[1][0] for row in rows] == ["whole"]
