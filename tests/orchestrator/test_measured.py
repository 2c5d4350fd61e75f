"""Measured records beside a run: figures by hand, units, clocks, found shifts, refusals."""

import json
import re
from math import sqrt

import numpy as np
import pytest
from made_logs import made, of_columns
from measured_files import FORCE, SPEED, STEP, UNITS, T, measured_run
from motion_logs import motion_log, times, trapezoid

import orchestrator as package
from orchestrator.results.analyses.signal_picture import figure_of
from orchestrator.results.measured_record import MeasuredSignal, read, rounding

run = pytest.fixture(scope="module")(measured_run)


@pytest.fixture
def write(tmp_path):
    """Return ``write(header, *columns)``, which writes ``m.csv`` with all digits; NaN is an empty cell."""

    def write(header, *columns):
        rows = ["" if value != value else repr(float(value)) for row in zip(*columns, strict=True) for value in row]
        n = len(columns)
        lines = [header, *(",".join(rows[k : k + n]) for k in range(0, len(rows), n))]
        (tmp_path / "m.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
        return tmp_path / "m.csv"

    return write


def only(comparison):
    (difference,) = comparison.differences
    return difference


@pytest.mark.parametrize("form", ["%.3f", "%.4g", "%.12g", "float32"])
def test_the_rounding_of_a_column_is_known_by_its_digits(form):
    whole = 123.4 * np.sin(np.linspace(0.0, 3.0, 4001))
    told = whole.astype(form).astype(float) if form == "float32" else np.array([float(form % v) for v in whole])
    off = float(np.sqrt(np.mean((told - whole) ** 2)))
    assert rounding(told) == pytest.approx(off, rel=0.02)
    assert rounding(10.0 * told[told != 0.0] / 3.0) < 0.1 * off or form == "float32", "twin: digits of no file"
    assert rounding(np.zeros(3)) == 0.0


@pytest.mark.parametrize(
    ("head", "column", "factor"),
    [
        ("v [km/h]", "v", 3.6), ('"v, km/h"', "v, km/h", 3.6), (" v (mm/s) ", "v", 1e3),
        (' "v, km/h"', "v, km/h", 3.6), ("v", "v:km/h", 3.6),
        ("v [mm/s]", "v [mm/s]:km/h", 3.6), ("v", "v", 1.0), ("a:b", "a:b", 1.0), ("v (front) [m/s]", "v (front)", 1.0),
        ('"v[1,2]"', "v[1,2]", 1.0), ("v[3]", "v[3]:km/h", 3.6), ("v[3] [km/h]", "v[3]", 3.6), ("v(10)", "v(10)", 1.0),
    ],
)  # fmt: skip
def test_an_offset_in_any_unit(run, write, head, column, factor):
    d = only(run.compare_measured(write(f"{head},t", factor * (SPEED + 0.25), T), {"chassis.speed": column}))
    assert (d.unit, d.instants, d.left_out, d.start, d.end) == ("m/s", 2001, 0, 0.0, 2.0)
    expected = 0.25, 0.25 / sqrt(np.mean((SPEED + 0.25) ** 2)), -0.25, -0.25, 1.0
    assert (d.rms, d.relative, d.mean, d.largest, d.correlation) == pytest.approx(expected, abs=1e-12)


def test_everyday_units_of_a_column(tmp_path):
    """Also degrees Celsius, whose offset is no factor."""
    (tmp_path / "m.csv").write_text("t [msec],v [kmph],T [degC]\n0,36,20\n1,72,21\n")
    v, T = read(tmp_path / "m.csv", {"a.v": "v", "a.T": "T"}, {"a.v": "m/s", "a.T": "K"}.get)
    assert v.t == pytest.approx([0.0, 1e-3])
    assert v.values == pytest.approx([10.0, 20.0])
    assert T.values == pytest.approx([293.15, 294.15])


def test_a_column_without_unit_is_noted(run, write):
    file = write("t,v,F [kN]", T, SPEED, FORCE / 1e3)
    comparison = run.compare_measured(file, {"chassis.speed": "v", "chassis.force": "F"})
    assert comparison.notes == ("'v' has no unit and is taken in m/s",)
    assert [d.rms for d in comparison.differences] == pytest.approx([0.0, 0.0], abs=1e-11)
    slip = run.compare_measured(write("t,s [-],q [%]", T, 0.0 * T + 0.5, 0.0 * T + 25.0), {"chassis.slip": "s"})
    assert only(slip).mean == -0.25
    assert np.isnan(only(slip).correlation)
    assert only(run.compare_measured(slip.file, {"chassis.slip": "q"})).rms == pytest.approx(0.0, abs=1e-15)


def test_another_rate_and_unequal_steps_count_by_time(run, write):
    t = 0.01 * np.arange(201)  # two whole periods: the squares of a sine make n/2
    d = only(run.compare_measured(write("t,v", t, SPEED[::10] + 0.1 * np.sin(2 * np.pi * t)), {"chassis.speed": "v"}))
    assert (d.instants, d.rms) == (201, pytest.approx(0.1 * sqrt(100 / 201), abs=1e-12))
    assert (abs(d.largest), d.at % 0.5) == (pytest.approx(0.1, abs=1e-12), pytest.approx(0.25))
    uneven = SPEED[[0, 100, 400]] - np.array([1.0, 2.0, 3.0])
    d = only(run.compare_measured(write("time [ms],v", [0, 100, 400], uneven), {"chassis.speed": "v"}))
    assert (d.rms, d.mean) == pytest.approx((sqrt((0.1 + 0.4 + 2.7) / 0.5), (0.1 + 0.2 + 0.9) / 0.5), abs=1e-12)
    assert (d.largest, d.at) == pytest.approx((3.0, 0.4))
    finer = np.linspace(0.0, 2.0, 8001)  # the run is the sparser record
    d = only(run.compare_measured(write("t,v", finer, np.interp(finer, T, SPEED)), {"chassis.speed": "v"}))
    assert (d.instants, d.rms) == (2001, pytest.approx(0.0, abs=1e-12))


def test_gaps_are_left_out_and_counted(run, write):
    v = SPEED + 0.5
    v[[0, 700, 701, 2000]] = np.nan
    v[900] = np.inf
    d = only(run.compare_measured(write("t,v", T, v), {"chassis.speed": "v"}))
    assert (d.instants, d.left_out, d.start, d.end) == (1996, 5, STEP, 1.999)
    assert (d.rms, d.mean) == pytest.approx((0.5, -0.5), abs=1e-12)


@pytest.mark.parametrize("mark", [-9999.0, -32768.0, 1e20, float(np.finfo(np.float32).min)])
def test_marks_of_no_data_are_gaps_and_named(run, write, mark):
    v = SPEED + 0.5
    v[[700, 701]] = mark
    comparison = run.compare_measured(write("t,v [m/s]", T, v), {"chassis.speed": "v"})
    assert comparison.notes == (f"'v': 2 samples are {mark:.7g}, a mark of no data, and left out",)
    assert (only(comparison).instants, only(comparison).left_out) == (1999, 2)
    assert only(comparison).largest == pytest.approx(-0.5, abs=1e-12)
    v[[700, 701]] = -9998.0  # a value
    comparison = run.compare_measured(write("t,v [m/s]", T, v), {"chassis.speed": "v"})
    assert (comparison.notes, only(comparison).left_out) == ((), 0)


def test_windows_and_phases(run, write, tmp_path):
    file = write("t,v", T, SPEED + (T > 1.0))
    d = only(run.compare_measured(file, {"chassis.speed": "v"}, start=0.5, end=1.0))
    assert (d.start, d.end, d.instants, d.rms) == (0.5, 1.0, 501, pytest.approx(0.0, abs=1e-12))
    assert only(run.compare_measured(file, {"chassis.speed": "v"}, start=1.001)).mean == pytest.approx(-1.0, abs=1e-12)
    t = times(8.5)
    vehicle = package.Run(motion_log(tmp_path / "v.mcap", t, trapezoid(t)))
    record = write("t,v", t[t < 7.0], (trapezoid(t) + 0.2)[t < 7.0])
    compared = vehicle.compare_measured(record, {"chassis.speed": "v:1"}, by_phase=True).differences
    assert [d.window for d in compared] == ["whole", "rest", "acceleration", "steady", "braking"]  # no rest after 7 s
    assert [d.mean for d in compared] == pytest.approx([-0.2] * 5, abs=1e-12)
    assert (compared[3].start, compared[3].end) == pytest.approx((3.018, 6.052), abs=2.5e-3)


@pytest.mark.parametrize(
    ("shift", "rate"), [(1.23456789, 1000), (-0.7, 1000), (0.0, 37), (1.7e9, 100), (-123.4567891, 400)]
)
def test_a_shift_is_found(run, write, shift, rate):
    t = np.arange(0.25 if rate == 1000 else 0.2501234, 1.75, 1.0 / rate)  # if as dense, at records of the run
    v, force = np.interp(t, T, SPEED), np.interp(t, T, FORCE)
    v[5:8] = np.nan
    file = write("t,v [km/h],F [kN]", t - shift, 3.6 * v, force / 1e3)
    accuracy = 1e-8 if abs(shift) < 1e6 else 1e-6  # of a number that counts seconds since 1970
    for columns in ({"chassis.speed": "v"}, {"chassis.speed": "v", "chassis.force": "F"}):
        comparison = run.compare_measured(file, columns, shift="find")
        assert comparison.shift == pytest.approx(shift, abs=accuracy)
        assert all(d.relative < 10.0 * accuracy for d in comparison.differences)
    given = run.compare_measured(file, {"chassis.speed": "v"}, shift=shift)
    assert only(given).rms == pytest.approx(0.0, abs=1e-12 if abs(shift) < 1e6 else 1e-5)


@pytest.mark.parametrize(
    ("begin", "ahead", "told"), [(10.5, 0.0, False), (9.5, 0.0, False), (10.5, 0.5, True), (10.0, 0.15, False)]
)
def test_a_record_on_another_clock_than_the_run_is_told(write, tmp_path, begin, ahead, told):
    """Where both begin apart by a tenth of the run of 2 s from 10 s on; a topic may begin late, or early, in place."""
    late = package.Run(of_columns(tmp_path / "late.mcap", {"chassis.speed": SPEED}, 10.0 + T))
    t = np.arange(begin, 14.0, 0.01)
    v = 3.0 + np.sin(2.0 * np.pi * (t - 10.0)) + 0.3 * np.sin(9.0 * (t - 10.0))
    compared = late.compare_measured(write("t,v:1", t + ahead, v), {"chassis.speed": "v:1"})
    assert any("shift = find aligns their clocks" in note for note in compared.notes) == told, compared.notes
    assert (only(compared).rms < 1e-6) == (ahead == 0.0)


def test_the_record_may_be_longer_than_the_run_and_offset(run, write):
    """A known function over 6 s, of which the run holds 2, with an offset."""
    t = np.linspace(0.0, 6.0, 1201)
    x = t - 2.5
    v = 3.0 + np.sin(2.0 * np.pi * x) + 0.3 * np.sin(9.0 * x) + 0.05
    v[-1] = SPEED[0]  # equal in an overlap of one instant, which is too short
    comparison = run.compare_measured(write("t,v", t, v), {"chassis.speed": "v"}, shift="find")
    assert comparison.shift == pytest.approx(-2.5, abs=1e-3)
    assert only(comparison).mean == pytest.approx(-0.05, abs=1e-4)


def test_the_shift_of_an_undersampled_oscillation_is_found(write, tmp_path):
    values = SPEED + np.sin(2.0 * np.pi * 40.0 * T)
    path = made(tmp_path / "a.mcap", {"/chassis/out": [("speed", "m/s")]}, {"/chassis/out": (T, values[:, None])})
    t = np.arange(0.2501234, 1.75, 1.0 / 37.0)
    file = write("t,v", t - 1.23456789, np.interp(t, T, values))
    found = package.Run(path).compare_measured(file, {"chassis.speed": "v"}, shift="find")
    assert found.shift == pytest.approx(1.23456789, abs=1e-8)


@pytest.mark.parametrize(
    ("wave", "other"),
    [
        (np.sin(2.0 * np.pi * T / 0.4), True),
        (np.sin(2.0 * np.pi * T / 0.4) + 0.01 * np.sin(5.0 * T), True),
        (np.sin(2.0 * np.pi * T / 0.4) + 0.2 * np.sin(5.0 * T), False),
        (SPEED, False),
        (np.sin(2.0 * np.pi * (60.0 * T + 20.0 * T**2)), False),  # a sample beside the best shift begins another valley
        (np.clip(T, 0.5, 1.0), False),  # a ramp: shifts about the best one are nearly as good
    ],
)
def test_another_shift_that_is_nearly_as_good_is_named(write, tmp_path, wave, other):
    path = made(tmp_path / "a.mcap", {"/chassis/out": [("speed", "m/s")]}, {"/chassis/out": (T, wave[:, None])})
    noise = 0.002 * np.random.default_rng(1).normal(size=len(T))
    file = write("t,v [m/s]", T[400:1600] - 5.0, (wave + noise)[400:1600])
    found = package.Run(path).compare_measured(file, {"chassis.speed": "v"}, shift="find")
    if not other:
        assert (found.shift, found.notes) == (pytest.approx(5.0, abs=1e-3), ())
        return
    (note,) = found.notes
    numbers = [float(text) for text in re.findall(r"[\d.]+(?= s)", note)]
    assert found.shift == pytest.approx(numbers[1], rel=1e-5)
    assert (numbers[0] - numbers[1] + 0.2) % 0.4 == pytest.approx(0.2, abs=2e-3)
    assert re.search(
        r"s: RMS (0\.29|0\.28\d|1\.68) % of the measured variation instead of 0\.2(9|8\d) %; shift = S chooses$", note
    )
    assert note in str(found.table())


TWO = [0.0, 1.0], [1.0, 2.0]


@pytest.mark.parametrize("text", [
    "t [s];v [km/h]\n0.0;3.6\n1.0;7.2\n", "t [s];v [km/h]\n0.0,3.6,\n1.0,7.2,\n".replace(";", ","),
    '"t, s","v, km/h"\n0,3.6\n1,7.2\n', "t [s],v [km/h],n [1/min]\n0,3.6,0\n1,7.2,0\n", 't [s],v\n0," 1 "\n1, 2e0\n',
    "t [s]\tv\n\n0\t1\n1\t2\n", "\ufefft [ms],v\n0,1\n1000,2\n",
])  # fmt: skip
def test_texts_that_are_read(tmp_path, text):
    """With the marks of loggers that ``test_sentences_log`` asks for; a text of any suffix is CSV."""
    (tmp_path / "logger.txt").write_text(text, encoding="utf-8")
    (found,) = read(tmp_path / "logger.txt", {"chassis.speed": "v"}, UNITS.get)
    assert (found.t.tolist(), found.values.tolist()) == (TWO[0], pytest.approx(TWO[1]))


def test_bad_input_of_the_command_is_status_2_and_one_line(run, cotrack, tmp_path):
    (tmp_path / "m.csv").write_text("t,v\n0,1\n1,abc\n")
    status, out, err = cotrack("compare", run.log, "m.csv", "--map", "chassis.speed=v")
    assert (status, out, err.count("\n"), err[:14]) == (2, "", 1, "cotrack: m.csv")


def test_the_command_prints_and_judges(run, write, cotrack):
    apart = 0.25 + 0.5 * (T[1000] == T)
    file = write("clock,v [km/h]", T - 1.5, 3.6 * (SPEED + apart))
    command = ("compare", run.log, file, "--map", "chassis.speed=v", "--clock", "clock", "--shift", "1.5")
    out = cotrack.done(*command)
    _, title, head, row = out.splitlines()
    assert title == f"run minus {file}, 1.5 s added to its times"
    assert re.split("  +", head) == [
        "signal", "window", "from, s", "to, s", "unit", "RMS", "relative", "mean", "largest", "at, s", "correlation",
        "instants", "left out",
    ]  # fmt: skip
    rms, relative = sqrt(np.mean(apart**2)), sqrt(np.mean(apart**2) / np.mean((SPEED + apart) ** 2))
    figures = [f"{rms:.4g}", f"{relative:.3g}", f"{-apart.mean():.4g}", "-0.75", "1"]
    correlation = f"{np.corrcoef(SPEED, SPEED + apart)[0, 1]:.6f}"
    assert row.split() == ["chassis.speed", "whole", "0", "2", "m/s", *figures, correlation, "2001", "0"]
    assert cotrack(*command, "--allow", f"{relative + 1e-9}")[0] == 0
    status, out, _ = cotrack(*command, "--allow", f"chassis.speed={relative - 1e-9}")
    assert (status, out.splitlines()[-1]) == (1, f"NOT chassis.speed: relative {relative:.3g}, allowed {relative:g}")
    more = ("--map", "chassis.slip=v:1", "--allow", "10")  # one of two is met
    assert cotrack(*command, *more, "--allow", "chassis.speed=0")[0] == 1
    status, out, _ = cotrack(*command, "--json", "--allow", "0.05", "--to", "1")
    result = json.loads(out)
    assert (status, result["ok"], result["reference"]["shift"], result["window"]["to"]) == (1, False, 1.5, 1.0)
    assert result["observables"]["chassis.speed"]["rms"] == pytest.approx(sqrt(np.mean(apart[:1001] ** 2)), abs=1e-12)
    assert result["observables"]["chassis.speed"]["end"] == 1.0


def test_a_measured_curve_has_the_colour_of_its_signal(tmp_path):
    """Also where the curve of the run was not asked for."""
    topics = {"/chassis/out": [("a", "m/s"), ("b", "m/s")]}
    log = made(tmp_path / "a.mcap", topics, {"/chassis/out": (T, np.stack([SPEED, FORCE], axis=1))}, None, ("chassis",))
    measured = [MeasuredSignal(f"chassis.{name}", name, "m/s", T, SPEED, False, {}) for name in "ba"]
    (pane,) = figure_of([log], ["chassis.a"], measured=measured).axes
    a, b, measured_b, measured_a = (line.get_color() for line in pane.lines)
    assert (a, b) == (measured_a, measured_b)
    assert a != b


def test_measured_curves_are_drawn(run, write, cotrack):
    file = write("t [ms],v [km/h],F [kN]", 1e3 * T[:1500] - 100.0, 3.6 * SPEED[:1500], FORCE[:1500] / 1e3)
    options = ("--with", file, "--map", "chassis.speed=v", "--map", "chassis.force=F", "--shift", "find", "-o", "a.svg")
    status, out, err = cotrack("plot", run.log, *options)
    assert (status, out, err) == (0, f"{file}: 0.1 s added to its times\na.svg\n", "")
    measured = [each.shifted(0.1) for each in read(file, {"chassis.speed": "v"}, UNITS.get)]
    (pane,) = figure_of([run.log], ["chassis.speed"], measured=measured).axes
    first, second = pane.lines
    assert (first.get_label(), second.get_label()) == ("chassis.speed", "v, measured")
    assert second.get_xdata()[[0, -1]] == pytest.approx([0.0, 1.499], abs=2e-3)
    assert second.get_ydata().max() == pytest.approx(SPEED[:1500].max(), abs=1e-12)
    assert "as curves over time only" in cotrack.refused("plot", run.log, "chassis.speed", *options, "--spectrum")
