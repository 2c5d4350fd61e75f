"""Angles: whole turns do not count in comparisons, shifts, fits and checks; curves of angles have no jumps."""

import numpy as np
import pytest
from fit_formulas import EVERYWHERE
from made_logs import made

import orchestrator as package
from orchestrator.execution import summary
from orchestrator.log.angles import Continuous, continuous, turn_of, turns_beside
from orchestrator.log.reader import Log
from orchestrator.results.analyses import curves
from orchestrator.results.analyses.signal_picture import figure_of
from orchestrator.results.divergence import _TopicGrowth
from orchestrator.results.measured_record import MeasuredSignal
from orchestrator.results.run_data import EVER, RunData
from orchestrator.scene.scene import load
from orchestrator.studies import Row, least_squares
from orchestrator.studies.free_numbers import FreeNumber
from orchestrator.studies.least_squares import Experiment, Objective, search
from orchestrator.studies.uncertainty import fitted_numbers

TURN = 2.0 * np.pi
T = 1e-3 * np.arange(8001)
YAW = 2.9 + 1.3 * T - 0.15 * np.sin(2.0 * T) ** 2  # 10.4 rad, over the jump at 180 degrees twice
YAW_SIGNAL = "chassis.yaw"


def wrapped(angles, low=-np.pi):
    return (angles - low) % TURN + low


FORMS = {  # head of the column, and heading in it
    "wrapped": ("h [rad]", wrapped),
    "continuous": ("h [rad]", lambda yaw: yaw),
    "compass": ("h [deg]", lambda yaw: np.degrees(wrapped(yaw, 0.0))),
    "degrees": ("h [deg]", lambda yaw: np.degrees(wrapped(yaw))),
    "negative": ("h [deg]", lambda yaw: np.degrees(wrapped(yaw, -TURN))),
    "turns before": ("h [rev]", lambda yaw: yaw / TURN - 7.0),
}


@pytest.fixture(scope="module", params=["rad", "deg"])
def run(request, tmp_path_factory):
    """A log of a vehicle that turns; its hull may be a part of others, with an angle in degrees."""
    unit = {"rad": 1.0, "deg": 180.0 / np.pi}[request.param]
    topics = {"/chassis/out": [("yaw", request.param), ("way", "m"), ("counter", request.param)]}
    values = np.stack([unit * wrapped(YAW), wrapped(YAW), unit * YAW], axis=1)
    path = tmp_path_factory.mktemp("angles") / "a.mcap"
    made(path, topics, {"/chassis/out": (T, values)}, None, ("chassis",))
    found = package.Run(path)
    found.unit = unit
    return found


@pytest.fixture
def record(tmp_path):
    """Return ``record(form, t, yaw)``, which writes ``m.csv``; NaN is an empty cell."""

    def write(form, t, yaw):
        head, of = FORMS[form]
        rows = [f"{a!r},{'' if b != b else repr(b)}" for a, b in zip(t.tolist(), of(yaw).tolist(), strict=True)]
        (tmp_path / "m.csv").write_text("\n".join([f"t [s],{head}", *rows]) + "\n")
        return tmp_path / "m.csv"

    return write


def compared(run, file, **options):
    found = run.compare_measured(file, {YAW_SIGNAL: "h"}, **options)
    return found, found.differences[0]


@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_a_heading_has_the_same_figures(run, record, form):
    """0.01 rad and a sine of 0.02 rad beside the run, at other instants, with a gap in which it turns on."""
    t = np.arange(0.0, 8.0, 0.0173)
    off = 0.01 + 0.02 * np.sin(3.0 * t)
    yaw = np.interp(t, T, YAW) + off
    yaw[100:140] = np.nan
    known = np.isfinite(yaw)
    lengths = np.diff(t, prepend=-t[1])[known]
    expected = np.sqrt(np.average(off[known] ** 2, weights=lengths))
    found, one = compared(run, record(form, t, yaw))
    assert one.rms == pytest.approx(run.unit * expected, abs=run.unit * 1e-9)
    assert one.rms != pytest.approx(run.unit * 1.02 * expected, abs=run.unit * 1e-9)
    size = np.sqrt(np.average(yaw[known] ** 2, weights=lengths))
    assert one.relative == pytest.approx(expected / size, rel=1e-9)  # of angles beside the run's
    a, b = np.interp(t, T, YAW)[known], yaw[known]
    covariance = np.cov(a, b, aweights=lengths, ddof=0)
    assert one.correlation == pytest.approx(covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1]), abs=1e-9)
    assert (one.instants, one.left_out, found.notes) == (known.sum(), 40, ())
    _, late = compared(run, record(form, t, yaw), start=4.0)
    inside = known & (t >= 4.0)
    assert late.rms == pytest.approx(
        run.unit * np.sqrt(np.average(off[inside] ** 2, weights=np.diff(t, prepend=-t[1])[inside])), abs=run.unit * 1e-9
    )


@pytest.mark.parametrize("form", FORMS)
def test_a_shift_is_found_in_every_form(run, record, form):
    t = np.arange(0.5, 7.0, 0.0173)
    found, one = compared(run, record(form, t - 3.21, np.interp(t, T, YAW)), shift="find")
    assert found.shift == pytest.approx(3.21, abs=2e-5)
    assert one.rms < run.unit * 3e-5
    assert compared(run, record(form, t - 3.21, np.interp(t, T, 1.01 * YAW)), shift="find")[1].rms > run.unit * 1e-3


def test_a_turn_that_only_the_run_makes_is_a_difference(run, record):
    """The record stands: the difference is what the run has turned, not the remainder of it."""
    t = np.arange(0.0, 8.001, 0.01)
    _, one = compared(run, record("compass", t, np.full(len(t), YAW[0])))
    assert one.largest == pytest.approx(run.unit * (YAW[-1] - YAW[0]), abs=1e-6)


@pytest.mark.parametrize(("step", "told"), [(0.5, False), (2.0, True), (3.0, True)])
def test_samples_between_which_it_turns_by_half_a_turn_are_told(run, record, step, told):
    """2.6 and 3.9 rad from sample to sample: 150 degrees, which may as well be 210 the other way, and 223."""
    t = np.arange(0.0, 8.0, step)
    found, one = compared(run, record("wrapped", t, np.interp(t, T, YAW)))
    assert one.rms == pytest.approx(0.0, abs=1e-9)
    assert any("its whole turns there are taken from the run" in note for note in found.notes) == told


def test_a_gap_in_which_it_turns_by_half_a_turn_is_named(run, record):
    t = np.concatenate([np.arange(0.0, 3.0, 0.1), np.arange(5.0, 8.0, 0.1)])
    (note,) = compared(run, record("wrapped", t, np.interp(t, T, YAW)))[0].notes
    assert note.startswith("'h' has no sample between 2.9 and 5 s, where it or the run turns"), note


def test_a_signal_that_is_no_angle_keeps_its_jumps(run, record, tmp_path):
    (tmp_path / "w.csv").write_text(
        "t [s],w [m]\n" + "".join(f"{t},{w}\n" for t, w in zip(T[::10], YAW[::10], strict=True))
    )
    found = run.compare_measured(tmp_path / "w.csv", {"chassis.way": "w"})
    assert found.differences[0].largest == pytest.approx(-2.0 * TURN, abs=1e-9)


def test_curves_have_no_jumps_and_are_on_one_turn(run, record):
    """In blocks of a thousand records, of pictures and of a page; values between records, spectra, reduced values."""
    t = np.arange(0.0, 8.0, 0.01)
    file = record("compass", t, np.interp(t, T, YAW))
    measured = run.compare_measured(file, {YAW_SIGNAL: "h"}).record.signals
    (pane,) = figure_of([run.log], [YAW_SIGNAL], measured=measured).axes
    for line in pane.lines:
        assert np.interp(t[5:-5], *line.get_data()) == pytest.approx(
            run.unit * np.interp(t[5:-5], T, YAW), abs=0.01 * run.unit
        )
    between = 0.5 * (T[:-1] + T[1:])
    with Log(run.log) as log:
        data = RunData(log)
        curve = curves.of(data, [YAW_SIGNAL])[YAW_SIGNAL]
        assert (curve.least.value, curve.most.value) == pytest.approx((run.unit * YAW.min(), run.unit * YAW.max()))
        assert log.sample([YAW_SIGNAL], between)[:, 0] == pytest.approx(run.unit * np.interp(between, T, YAW))
        assert log.signal(YAW_SIGNAL)[1] == pytest.approx(run.unit * wrapped(YAW))  # as it was recorded
        data.prefetch([YAW_SIGNAL], EVER)
        assert data.signal(YAW_SIGNAL, EVER)[1] == pytest.approx(run.unit * YAW)
    signal = run[YAW_SIGNAL]
    assert signal.at(between[3000]) == pytest.approx(run.unit * np.interp(between[3000], T, YAW))


def test_continuous_angles():
    steps = np.random.default_rng(1).uniform(-3.0, 3.0, 400)
    angles = 3.0 + np.cumsum(steps)
    gaps = np.where(np.arange(400) % 7 == 3, np.nan, wrapped(angles))
    small = np.where(np.isnan(gaps), np.nan, 3.0 + 0.4 * (angles - 3.0))
    for whole in (angles, small):
        for low in (-np.pi, 0.0, -TURN):
            found = continuous(wrapped(whole, low), TURN)
            assert np.diff(found[~np.isnan(found)]) == pytest.approx(np.diff(whole[~np.isnan(whole)]), abs=1e-9)
    rounded = np.array([359.0, 360.0, 1.0, 0.0, 360.0])  # some compasses write both ends of a turn
    assert continuous(rounded, 360.0).tolist() == [359.0, 360.0, 361.0, 360.0, 360.0]
    for step in (3.9, 20.0):  # of a shaft that turns by more than half a turn from record to record
        counter = step * np.arange(50.0)
        assert (continuous(counter, TURN) == counter).all()
    blocks = np.stack([wrapped(angles), np.where(np.arange(400) > 200, np.inf, wrapped(angles))], axis=1)
    units = Continuous(["rad", "m"])
    joined = np.vstack([units(blocks[k : k + 7]) for k in range(0, 400, 7)])
    assert joined[:, 0] == pytest.approx(continuous(blocks[:, 0], TURN), abs=1e-9)
    assert (joined[:, 1] == blocks[:, 1]).all()
    beside = wrapped(angles) + turns_beside(wrapped(angles), angles + 0.3, TURN, first=5)
    assert beside == pytest.approx(angles)
    assert [turn_of(unit) for unit in ("rad", "deg", "m", "", "rad/s", "1", "furlong")] == pytest.approx(
        [TURN, 360.0, 0, 0, 0, 0, 0]
    )


@pytest.mark.parametrize(("unit", "is_fitted"), [("rad", True), ("1", False)])
def test_a_heading_is_fitted_over_turns(monkeypatch, unit, is_fitted):
    """Start heading and rate, from a start on the other side of 180 degrees and a turn behind at the end."""
    t, truth = np.linspace(0.0, 10.0, 101), (3.2, 0.9)

    def heading(start, rate):
        return wrapped(start) + rate * t  # as a run's signal begins, without jumps

    def runs(experiment, numbers, wanted):
        return [Row("", "", {"values": [heading(*numbers.values()).tolist()]}, True)]

    monkeypatch.setattr(least_squares, "run_signals", runs)
    noise = 0.01 * np.random.default_rng(1).standard_normal(len(t))
    values = 2.0 * TURN + continuous(wrapped(heading(*truth) + noise), TURN)
    signal = MeasuredSignal("y", "y", unit, t, values, False, {})
    experiment = Experiment(load("hanging_chain"), signals=(signal,), files=("field.csv",))
    free = FreeNumber("p0", 3.0, *EVERYWHERE, 3.0), FreeNumber("p1", 0.3, *EVERYWHERE, 0.3)
    task = Objective((experiment,), free, {"y": 0.01})
    found = fitted_numbers(task, search(task))
    assert (found.chi2 < 1.5 and abs(found.numbers[1] - truth[1]) < 3.0 * found.errors[1]) == is_fitted
    if is_fitted:
        assert wrapped(found.numbers[0] - truth[0]) == pytest.approx(0.0, abs=3.0 * found.errors[0])
        assert not found.problems


def test_whole_turns_count_from_the_first_common_sample(run, record):
    """The record turned twice before the run began."""
    t = np.arange(-10.0, 8.0, 0.01)
    yaw = np.where(t < 0.0, YAW[0] + 1.3 * t, np.interp(t, T, YAW))
    assert compared(run, record("continuous", t, yaw + 0.1))[1].mean == pytest.approx(-0.1 * run.unit, abs=1e-6)


@pytest.mark.parametrize(("how", "expected", "ok"), [
    ("last", YAW[-1] - TURN, True), ("last", YAW[-1], True), ("last", YAW[-1] - 0.9 * TURN, False),
    ("drop", YAW[0] - YAW[-1], True), ("drop", YAW[0] - YAW[-1] + TURN, False), ("mean", YAW.mean() - TURN, True),
])  # fmt: skip
def test_a_check_of_an_angle_counts_no_whole_turns(run, how, expected, ok):
    """Of a value of the heading; a change of it has its turns."""
    numbers = f"expected={run.unit * expected}, tolerance={run.unit * 1e-3}"
    check = f'expect.a={{signal="{YAW_SIGNAL}", reduce="{how}", {numbers}}}'
    scene = load("straight", "rigid", ["run.stop=8", "expect={}", check])
    with Log(run.log) as log:
        (result,) = summary.checks(RunData(log), scene, 8.0)[0].values()
        counted = load("straight", "rigid", ["run.stop=8", "expect={}", check.replace("yaw", "counter")])
        (of_counter,) = summary.checks(RunData(log), counted, 8.0)[0].values()  # a shaft's turns count
    assert result["ok"] == ok
    assert of_counter["ok"] == (ok and abs(expected - {"last": YAW[-1], "mean": YAW.mean()}.get(how, expected)) < 1.0)


def test_the_difference_of_two_logs_grows_the_smaller_way_round(run, tmp_path):
    """The second one crosses 180 degrees a record later; a length in its place is a turn apart."""
    values = np.stack([run.unit * wrapped(YAW - 1e-3), wrapped(YAW - 1e-3)], axis=1)
    topics = {"/chassis/out": [("yaw", run[YAW_SIGNAL].unit), ("way", "m")]}
    made(tmp_path / "b.mcap", topics, {"/chassis/out": (T, values)}, None, ("chassis",))
    with Log(run.log) as a, Log(tmp_path / "b.mcap") as b:
        largest = []
        for k in (0, 1):
            growth = _TopicGrowth([a.topics["/chassis/out"].units[k]])
            growth.add(*(log.read("/chassis/out").columns([k]) for log in (a, b)), True)
            largest.append(growth.curve().difference.max() * np.pi)
    assert largest == pytest.approx([1e-3, TURN - 1e-3], rel=1e-3)
