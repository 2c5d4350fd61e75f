"""Analyses as commands, as plots and as cells of a notebook."""

import inspect
import json
import sys
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from life_logs import worn
from made_logs import STEP, made
from short_runs import driven_log

from orchestrator.log.reader import Log
from orchestrator.results.analyses import circuit, power, signal_curves, signal_picture
from orchestrator.results.analyses.catalogue import analyse, module_of
from orchestrator.results.approximations import TimeEnvelope
from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.results.table import Table
from orchestrator.vocabulary.analyses import ANALYSES, TRACK, Analysis

driven = pytest.fixture(scope="module")(driven_log)


# the commands


def test_analyse_prints_tables_and_json_and_files(cotrack, driven, tmp_path):
    answer = json.loads(cotrack.done("analyse", driven, "power", "--json", "--from", "0.1", "-o", tmp_path / "p.csv"))
    assert answer["units"]["power"] == "kW"
    with Log(driven) as log:
        port_power = power.of(RunData(log), Window(0.1, 1.0))
    assert answer["rows"][0]["energy"] == pytest.approx(port_power.energy[0] / 1e3, rel=1e-12)
    rows = np.genfromtxt(tmp_path / "p.csv", delimiter=",", skip_header=1)
    np.testing.assert_allclose(rows[:, 2], port_power.relative[:, 0])
    out = cotrack.done("analyse", driven, "spectrum", "--signal", "left_track.link[3].tension", "--order")
    assert "tooth order" in out


@pytest.mark.parametrize("options", [
    ("left_track.link[*].tension",), ("left_track.tension.max", "left_track.speed", "chassis.speed"),
    ("left_track.link[*].tension", "--waterfall"), ("left_track.link[*].tension", "--place"),
    ("left_track.link[*].tension", "--place", "--at", "0.1", "--at", "0.15"),
    ("left_track.link[*].tension", "--spectrum", "--waterfall"), ("left_track.tension.max", "--order"),
])  # fmt: skip
def test_plot_draws_every_kind(cotrack, driven, tmp_path, options):
    assert cotrack("plot", driven, *options, "-o", "a.png") == (0, "a.png\n", "")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert [file.name for file in tmp_path.iterdir()] == ["a.png"]


@pytest.mark.parametrize("given", [{"at": [0.1999]}, {"window": Window(0.2, 0.2)}])
def test_a_profile_has_every_link_at_its_place(driven, given):
    """Tension along the chain at 0.2 s: each link's value at its place from the analysis of places."""
    with Log(driven) as log:
        run = RunData(log)
        series = log.read("/left_track/links")
        row = np.abs(series.t - 0.2).argmin()
        tension = [series.values[row, series.names.index(f"link[{i + 1}].tension")] for i in range(64)]
        places = next(circuit.records(run, "left_track", Window(series.t[row], series.t[row]))).links[0]
    figure = signal_picture.figure_of([driven], ["left_track.link[*].tension"], **{"place": True, **given})
    curve = figure.axes[0].get_lines()[0]
    order = np.argsort(places)
    assert (order != np.arange(64)).any(), "the chain has not moved"
    np.testing.assert_allclose(curve.get_xdata(), places[order])
    np.testing.assert_allclose(curve.get_ydata(), np.array(tension)[order] / 1e3)
    assert figure.axes[0].get_xlabel().startswith("along the chain")


def test_curves_of_long_records_are_thinned_as_those_of_the_page(tmp_path):
    t = np.arange(20_001) * STEP
    values = np.sin(3.0 * t)
    values[7777], values[12345] = 9.0, -8.0
    rows = {"/track/out": (t, np.stack([values, t], axis=1))}
    path = made(tmp_path / "s.mcap", {"/track/out": [("force", "N"), ("travel", "m")]}, rows)
    with Log(path) as log:
        (curve,) = signal_curves.curves(RunData(log), ["track.force"], EVER, False, False, 0, False)
    assert (curve.x[curve.y.argmax()], curve.x[curve.y.argmin()]) == (t[7777], t[12345]), "wrong instants"
    assert {*zip(curve.x, curve.y, strict=True)} <= {*zip(t, values, strict=True)}
    same = TimeEnvelope(0.0, float(t[-1]), 1, signal_curves.CURVE)
    same.add(t, values[:, None])
    assert np.array_equal(curve.x, same.curve(0).t)
    assert np.array_equal(curve.y, same.curve(0).y)


@pytest.mark.parametrize(
    ("signals", "styles"), [(["tension.max"], "--"), (["tension.max", "tension.min"], ["-", "--"])]
)
def test_curves_of_several_logs_are_told_apart(driven, tmp_path, signals, styles):
    """Colours tell the logs of one signal apart; of several signals, colours and line styles do; labels name both."""
    again = tmp_path / "again.mcap"
    again.write_bytes(driven.read_bytes())
    names = [f"left_track.{signal}" for signal in signals]
    (pane,) = signal_picture.figure_of([driven, again], names).axes
    lines = {line.get_label(): line for line in pane.get_lines()}
    of_logs = [[lines[f"{name}, {log}"] for name in names] for log in ("driven", "again")]
    assert [{line.get_linestyle() for line in each} for each in of_logs] == [{style} for style in styles]
    assert len({line.get_color() for line in lines.values()}) == len(lines) == 2 * len(names)


# cells of a notebook

CELL = """import cotrack
found = cotrack.analyse({path!r}, {what!r}, {window}{options})
table = found.table().frame()"""
OPTIONS = {"spectrum": ", signals='left_track.tension.max'"}
WAYS = [(what, f", by='{way}'") for what, one in ANALYSES.items() for way in one.ways]


@pytest.mark.parametrize(("what", "options"), [*((what, OPTIONS.get(what, "")) for what in ANALYSES), *WAYS])
def test_every_analysis_takes_three_lines_of_a_notebook(driven, what, options, tmp_path):
    log = worn(tmp_path / "worn.mcap") if what == "wear" else driven
    cell = CELL.format(path=str(log), what=what, window=(0.05, 0.2), options=options)
    names = {}
    exec(cell, names)
    assert len(cell.splitlines()) == 3
    assert len(names["table"]) == len(names["found"].table().rows) > -(what in ("events", "validity"))
    assert all(name == " ".join(name.split()) for name in names["table"].columns), "blanks in the name of a column"
    assert names["table"].columns.is_unique
    assert list(names["table"].columns) == [column.key for column in names["found"].table().columns]


@pytest.mark.parametrize(("what", "analysis"), ANALYSES.items())
def test_what_is_declared_is_what_an_analysis_takes(what, analysis):
    module = module_of(what)
    drawn = getattr(module, "picture", None), analysis.picture_options
    for function, options in ((module.of, analysis.options), drawn):
        names = set(inspect.signature(function).parameters) if function else set()
        assert {option.name for option in options} <= names
    assert hasattr(module, "summary") <= analysis.full_series or what == "links"


def test_an_analysis_takes_one_module_and_one_entry(cotrack, driven, monkeypatch):
    class Toy(NamedTuple):
        def table(self):
            return Table.of("toy", (("weight", "N"),), [(1.5,)])

    of = SimpleNamespace(of=lambda run, window, track="": Toy())
    monkeypatch.setitem(sys.modules, "orchestrator.results.analyses.toy", of)
    monkeypatch.setitem(ANALYSES, "toy", Analysis("weighs", (TRACK,)))
    assert "weight, N\n      1.5" in cotrack.done("analyse", driven, "toy", "--track", "left_track")
    note = "of left_track alone: --track right_track for the other\n"
    for tracks, given, ends_with_note in ((1, "", False), (2, "", True), (2, "left_track", False)):
        monkeypatch.setattr(RunData, "tracks", ("left_track", "right_track")[:tracks])
        out = cotrack("analyse", driven, "toy", *(("--track", given) if given else ()))[1]
        assert (out.endswith(note), "alone" in out) == (ends_with_note, ends_with_note)
    assert cotrack.refused("analyse", driven, "toy", "--teeth")


def test_options_have_the_names_of_the_command_line_and_older_ones(driven):
    by_name = analyse(driven, "fatigue", sn="90 MPa,1e6,5", track="left").tracks[0]
    assert by_name.line == analyse(driven, "fatigue", line="90e6,1e6,5").tracks[0].line
    peaks = [analyse(driven, "spectrum", **{name: "left_track.tension.max"}).peak() for name in ("signal", "signals")]
    assert peaks[0] == peaks[1]
    assert "    spectrum: signal, shape, order\n" in analyse.__doc__
