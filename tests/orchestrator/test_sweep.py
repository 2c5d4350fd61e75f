"""Sweeps: their points, rows equal to single runs, what continues after an end, what is refused."""

import csv
import errno
import json
import os
import pickle
import re
import signal
import subprocess
import sys
import time
from contextlib import ExitStack

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.stats import qmc
from short_run import last

import orchestrator as offered
from fmus.vehicles.tables import BadInput
from orchestrator.execution import summary
from orchestrator.log.reader import Log
from orchestrator.results import chain_measures, output_files
from orchestrator.results.analyses import joints
from orchestrator.results.run_data import EVER, RunData
from orchestrator.results.table import Column, Table
from orchestrator.studies import parameter_sweep, sweep_picture
from orchestrator.studies.variations import MOST, Design

CHAIN = ("--set", "chain.links=8", "--set", "run.stop=0.02 s")
MODELS = ("sweep", "hanging_chain", *CHAIN, "--vary", "track.model=rigid,flexible")
SPANS = ("--vary", "chain.span=0.7:0.8:2", "--workers", 1)  # in this process


def shown(design):
    return [tuple(value.shown for value in point) for point in design.points]


def rows_of(folder):
    return list(csv.DictReader((folder / "sweep.csv").open()))


# --- points ---


def test_a_grid_has_every_combination_in_exact_decimals():
    design = Design.of(["x.mu=0.3:0.8:6", "track.model=rigid, flexible", "rig.tension=20:40:3 kN"])
    numbers = [0.3, 0.4, 0.5, 0.6, 0.7, 0.8]
    assert shown(design) == [(x, m, f) for x in numbers for m in ("rigid", "flexible") for f in (20.0, 30.0, 40.0)]
    assert design.settings(design.points[10]) == ("x.mu=0.4", "track.model=flexible", "rig.tension=30 kN")
    assert [(one.key, one.unit, one.is_number) for one in design.variations] == [
        ("x.mu", "", True), ("track.model", "", False), ("rig.tension", "kN", True),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "numbers", "settings"),
    [
        ("k=20 kN,25 kN", [20.0, 25.0], ["20 kN", "25 kN"]),
        ("k=20,22.5, 25 kN", [20.0, 22.5, 25.0], ["20 kN", "22.5 kN", "25 kN"]),
        ("k=20 kN:40 kN:2", [20.0, 40.0], ["20 kN", "40 kN"]),
        ("k=1:-1:3", [1.0, 0.0, -1.0], ["1", "0", "-1"]),
        ("k=1e-3:1e-2:2", [1e-3, 1e-2], ["0.001", "0.01"]),
        ("k=5:9:1", [5.0], ["5"]),
        ("k=8,0.30,1e3", [8.0, 0.3, 1000.0], ["8", "0.30", "1e3"]),
        ("k=1 kN/m, 2 kN/m", [1.0, 2.0], ["1 kN/m", "2 kN/m"]),
        ("k=2,off", ["2", "off"], ["2", "off"]),
        ("k=0:1:4", [0.0, 1 / 3, 2 / 3, 1.0], ["0", repr(1 / 3), repr(2 / 3), "1"]),
    ],
)
def test_values_of_a_key(text, numbers, settings):
    design = Design.of([text])
    assert shown(design) == [(number,) for number in numbers]
    assert [design.settings(point)[0] for point in design.points] == [f"k={setting}" for setting in settings]


def test_a_latin_hypercube_is_that_of_scipy():
    design = Design.of(["a=2:1 s", "m=x,y", "b=-10:30"], sample=5, seed=3)
    unit = qmc.LatinHypercube(2, seed=np.random.default_rng(3)).random(5)
    points = qmc.scale(unit, [1.0, -10.0], [2.0, 30.0])
    assert shown(design) == [(a, m, b) for m in "xy" for a, b in points.tolist()]
    assert float(design.settings(design.points[0])[0][2:-2]) == points[0, 0], "a setting lost digits"
    for column, low, width in ((0, 1.0, 1.0), (1, -10.0, 40.0)):
        assert sorted(np.floor((points[:, column] - low) / width * 5)) == [0, 1, 2, 3, 4]
    assert shown(Design.of(["a=1:2 s", "m=x,y", "b=-10:30"], 5, 4)) != shown(design)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("x",), "--vary x: must be KEY=a:b:n or KEY=x,y,z"),
        (("x=",), "must be KEY=a:b:n or KEY=x,y,z"),
        (("x=1,,2",), "a value is empty"),
        (("x=1,1",), "a value is given twice"),
        (("x=1 N,2 kN",), "all numbers must have one unit"),
        (("x=1,2 N,3 kN",), "all numbers must have one unit"),
        (("chain.span=0.7,0.8", "--for", "sga"), "--for sga: did you mean 'sag'"),
        (("chain.span=0.7,0.8", "--for", "max"), "--for max: needs a signal, as max:left_track.tension.max"),
        (("chain.span=0.7,0.8", "--for", "joints:chain"), "an analysis is given by its name alone"),
        (("x=1 N:2 kN:3",), "all numbers must have one unit"),
        (("x=1:2:0",), f"a whole number from 1 to {MOST}"),
        (("x=1:2:-3",), "a whole number from 1"),
        (("x=1:2:2.5",), "a whole number from 1"),
        (("x=1:2:1e999999999",), "a whole number from 1"),
        (("x=2:2:3",), "the range is empty"),
        (("x=:2:3",), "must be a:b:n"),
        (("x=a:b:3",), "must be a:b:n"),
        (("x=1:2:3:4",), "must be a:b:n"),
        (("x=1:1e999:3",), "must have finite ends"),
        (("x=1:2",), "a range a:b needs a number of points, a:b:n, or --sample N"),
        (("x=1,2", "--vary", "x=3,4"), "--vary x: is given twice"),
        (("x=1:2:3", "--sample", 4), "--sample 4: needs a range --vary KEY=a:b"),
        (("x=1:2", "--sample", 0), "--sample 0: must be at least 1"),
        (("x=1:2", "--sample", 4, "--seed", -1), "--seed -1: must be at least 0"),
        (("x=1:2", "--sample", 10**9), f"these are 1000000000 cases, and {MOST} are allowed"),
        (("x=0:1:200", "--vary", "y=0:1:51"), f"these are 10200 cases, and {MOST} are allowed"),
        (("chain.lnks=8,9",), "unknown key 'chain.lnks': did you mean 'chain.links'?"),
        (("chain.span=0.5:2:4",), "chain.span = "),
        (("chain.links=8:9:3",), "chain.links = 8.5"),
        (("chain.span=0.7 kg,0.8 kg",), "chain.span = '0.7 kg'"),
        (("track.model=rigid,soft",), "track.model = 'soft'"),
        (("track=rigid,flexible", "--track", "rigid"), "track=rigid,flexible: its key is set by another option"),
        (("run.stop=1,2", "--set", "run.stop=3"), "run.stop=1,2: its key is set by another option"),
    ],
)
def test_bad_input_is_one_sentence_before_anything_runs(cotrack, monkeypatch, tmp_path, options, said):
    monkeypatch.setattr(parameter_sweep, "simulate", lambda *_, **__: pytest.fail("a case has run"))
    status, out, err = cotrack("sweep", "hanging_chain", "--vary", *options, "-o", "found")
    assert (status, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_what_is_varied_must_be_given(cotrack):
    with pytest.raises(BadInput, match="a sweep needs a key to vary"):
        Design.of([])
    assert cotrack("sweep", "hanging_chain", "-o", "found")[0] == 2
    assert cotrack("sweep", "hanging_chian", "--vary", "x=1,2", "-o", "found")[2].endswith("'hanging_chain'?\n")


# --- rows ---


@pytest.mark.long
def test_rows_equal_single_runs_bit_by_bit(cotrack, tmp_path):
    status, out, err = cotrack(*MODELS, *SPANS, "-o", "found")
    assert status == 0, err
    assert "4/4 track.model=flexible, chain.span=0.8" in err
    assert "| rigid | 0.7 | ok | 1 of 5; 4 begin after the end |" in out
    names = {"sweep.csv", "sweep.md", "sweep.parquet", "sweep.png", "sweep.svg"}
    assert {file.name for file in (tmp_path / "found").iterdir()} == {*names, "cases", "sweep.json"}
    assert {line.removeprefix("found/") for line in out.splitlines()[-5:]} == names
    assert not list(tmp_path.rglob("*.mcap")), "a log was kept"
    rows = rows_of(tmp_path / "found")
    places = [(model, span) for model in ("rigid", "flexible") for span in ("0.7", "0.8")]
    assert [(row["track.model"], row["chain.span"]) for row in rows] == places
    for row in (rows[0], rows[3]):
        own = ("--set", f"track.model={row['track.model']}", "--set", f"chain.span={row['chain.span']}")
        single = last(cotrack("run", "hanging_chain", *CHAIN, *own, "--json")[1])
        units = {"tension_max": "N", "tension_mean": "N", "sag": "m", "end_tension": "N"}
        assert {name: float(row[f"{name}, {unit}"]) for name, unit in units.items()} == single["observables"]
        assert float(row["check rest"]) == single["checks"]["rest"]["value"]
        assert float(row["energy residual"]) == single["energy"]["residual_relative"]
        assert float(row["estimated error"]) == single["error"]["total"] > 0.0
        errors = single["error"]["observables"]
        assert {*errors} == {"pins", "tension"}
        for name, error in errors.items():
            assert float(row[f"estimated error of {name}"]) == error["total"]
            assert float(row[f"estimated error of {name}, {error['unit']}"]) == error["absolute"]
        assert (row["status"], row["checks not met"]) == ("ok", "")
        assert row["checks"] == ("1 of 5; 4" if row["track.model"] == "rigid" else "1 of 3; 2") + " begin after the end"
    assert len({row["sag, m"] for row in rows}) == 4, "rows do not belong to their settings"


def test_the_function_returns_the_table_that_it_writes(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    settings = ["chain.links=8", "run.stop=0.02", "expect.rest.expected=1"]
    vary = ["vehicle.track.mass=20:25 kg"]
    arguments = dict(sample=2, seed=7, settings=settings, track="flexible", estimate=False, keep_logs=True)
    table = offered.sweep("hanging_chain", vary, tmp_path, **arguments)
    assert table.csv() == (tmp_path / "sweep.csv").read_text()
    assert table.notes == ("Latin hypercube of 2 points, seed 7",)
    assert json.loads((tmp_path / "sweep.json").read_text())["seed"] == 7
    read, frame = parquet.read_table(tmp_path / "sweep.parquet"), table.frame()
    assert read.schema.field("sag").metadata == {b"unit": b"m"}
    assert read.schema.field("vehicle.track.mass").metadata == {b"unit": b"kg"}
    assert read["sag"].to_pylist() == frame["sag"].tolist()
    assert "estimated error" not in read.column_names
    assert frame["checks not met"].tolist() == ["rest", "rest"]
    for name in frame["log"]:
        with offered.Log(tmp_path / name) as log:
            assert (log.closing["status"], log.metadata["run"]["track"]) == ("ok", "flexible")


def test_cases_have_the_track_model_of_the_option(tmp_path):
    design = Design.of(["chain.span=0.7,0.8"])
    planned = parameter_sweep.plan(design, "hanging_chain", tmp_path / "found", track="rigid")
    assert [case.arguments[0].variant for case in planned.cases] == ["rigid", "rigid"]


def test_values_and_settings_may_be_tables(tmp_path):
    """The same folder goes on with texts: both are one sweep."""
    options = dict(track="flexible", estimate=False)
    settings = {"chain.links": 8, "run.stop": 0.02}
    table = offered.sweep("hanging_chain", {"chain.span": [0.7, 0.75]}, tmp_path, settings=settings, **options)
    texts = [f"{key}={value}" for key, value in settings.items()]
    again = offered.sweep("hanging_chain", ["chain.span=0.7,0.75"], tmp_path, settings=texts, **options)
    assert again == table
    assert table.frame()["sag"].nunique() == 2


def test_units_of_observables_are_those_of_the_json_object():
    names = ("settlement", "weight", "slip", "steering_moment", "power_left", "yaw_rate", "speed")
    assert [parameter_sweep.UNITS[name] for name in names] == ["m", "N", "", "N m", "W", "rad/s", "m/s"]
    assert {*parameter_sweep.UNITS.values()} <= {"", "m", "m/s", "N", "N m", "W", "rad/s", "s"}


def fake(monkeypatch, *ends):
    """Replace the runs by these: exceptions to raise, or entries of a summary; return the scenes that ran."""
    scenes, queue = [], list(ends)

    def simulate(scene, path, **options):
        scenes.append(scene)
        assert (options["native"], options["estimated"]) == (False, True)
        end = queue.pop(0)
        if isinstance(end, BaseException):
            raise end
        if end.pop("signal", False):
            options["interrupt"].requested = True
        return summary.empty(scene.name, scene.variant) | {"status": "ok", "observables": {"sag": 1.0}} | end

    monkeypatch.setattr(parameter_sweep, "simulate", simulate)
    return scenes


def test_a_case_that_fails_is_a_row_with_its_sentence(cotrack, monkeypatch, tmp_path):
    open_ledger = {"residual_relative": 0.4, "integration_relative": {}}
    unknown = {"total": None, "observables": {}, "message": "the run is too short"}
    checks = {"rest": {"value": 0.5, "ok": False}}
    lost = {"status": "failed", "message": "link 7 is lost", "error": None}
    ended = {"error": unknown, "checks": checks}
    fake(monkeypatch, BadInput("no idler position"), {"energy": open_ledger, "message": "40 % is open"}, lost, ended)
    status, out, err = cotrack(*MODELS, *SPANS, "-o", "found")
    assert status == 1
    head, _, *shown = out.splitlines()
    assert head == (
        "| track.model | chain.span | status | checks | checks not met | sag, m | check rest | estimated error |"
        " energy residual | note |"
    )
    assert shown[3].startswith("| flexible | 0.8 | ok | 0 of 1 | rest | 1 | 0.5 |")
    assert "4 rows, 3 not as they should be" in err
    assert "cotrack: hanging_chain: track.model=rigid, chain.span=0.7: BadInput: no idler position\n" in err
    rows = rows_of(tmp_path / "found")
    assert [*rows[0]] == [
        "track.model", "chain.span", "status", "checks", "checks not met", "sag, m", "check rest", "estimated error",
        "energy residual", "warnings", "wall_time, s", "log", "note",
    ]  # fmt: skip
    assert [row["status"] for row in rows] == ["failed", "ok", "failed", "ok"]
    assert [row["sag, m"] for row in rows] == ["", "1.0", "1.0", "1.0"]
    assert (rows[0]["track.model"], rows[0]["note"]) == ("rigid", "BadInput: no idler position")
    assert rows[1]["note"] == "40 % is open"
    assert rows[2]["note"] == "link 7 is lost"
    assert rows[3]["note"] == "estimated error: not known, the run is too short"


# --- continuation ---


@pytest.mark.parametrize("end", [KeyboardInterrupt(), {"signal": True}])
def test_an_interrupted_sweep_continues_where_it_stopped(cotrack, monkeypatch, tmp_path, end):
    """The second start runs what is missing; a number planted into the stored row shows that the first row is read."""
    first = fake(monkeypatch, {"observables": {"sag": 0.5}}, end)
    status, _, err = cotrack(*MODELS, *SPANS, "-o", "found")
    assert (status, len(first)) == (1, 2)
    assert err.endswith("cotrack: interrupted\n")
    assert not (tmp_path / "found" / "sweep.csv").exists()
    (stored,) = (tmp_path / "found" / "cases").iterdir()
    assert '"sag": 0.5' in stored.read_text()
    stored.write_text(stored.read_text().replace('"sag": 0.5', '"sag": 0.25'))
    second = fake(monkeypatch, *({} for _ in range(3)))
    assert cotrack(*MODELS, *SPANS, "-o", "found")[0] == 0
    assert [(scene.variant, scene.chain.span) for scene in second] == [
        ("rigid", 0.8),
        ("flexible", 0.7),
        ("flexible", 0.8),
    ]
    assert [row["sag, m"] for row in rows_of(tmp_path / "found")] == ["0.25", "1.0", "1.0", "1.0"]


def test_a_folder_holds_one_sweep(cotrack, monkeypatch, tmp_path):
    fake(monkeypatch, *({} for _ in range(8)))
    assert cotrack(*MODELS, *SPANS, "-o", "found")[0] == 0
    kept = {file: file.read_bytes() for file in (tmp_path / "found").iterdir() if file.is_file()}
    vary = "['track.model=rigid,flexible', 'chain.span=0.7:0.8:2']"
    for other, differs in (
        (("--no-estimate",), "estimated is True there and False here"),
        (("--native",), "native is False there and True here"),
        (("--set", "run.step=2 ms"), "--set run.step is 'not set' there and '2 ms' here"),
        (("--vary", "run.links=1,2"), f"vary is {vary} there and {vary[:-1]}, 'run.links=1,2'] here"),
    ):
        status, out, err = cotrack(*MODELS, *SPANS, *other, "-o", "found")
        assert (status, out) == (2, "")
        assert err == (
            f"cotrack: -o 'found': holds another sweep, of hanging_chain over {vary}: {differs}:"
            " choose another folder\n"
        )
    assert kept == {file: file.read_bytes() for file in kept}
    assert cotrack(*MODELS, *SPANS, "-o", "found")[0] == 0
    (tmp_path / "found" / "sweep.json").write_text("[]")
    status, _, err = cotrack(*MODELS, *SPANS, "-o", "found")
    assert (status, err) == (2, "cotrack: 'found/sweep.json' is not that of a sweep: choose another folder\n")
    assert cotrack(*MODELS, *SPANS, "-o", "found/sweep.csv")[0] == 2


def figures_of(folder):
    """Rows without what the clock says."""
    return [{key: cell for key, cell in row.items() if key != "wall_time, s"} for row in rows_of(folder)]


KILLED = [*map(str, MODELS), "--vary", "chain.span=0.7:0.8:12", "--no-estimate"]  # 24 cases


def begin(environment, folder, *options):
    """Start the sweep in a process group of its own."""
    command = [sys.executable, "-m", "orchestrator", *KILLED, *options, "-o", folder.name]
    return subprocess.Popen(command, env=environment, cwd=folder.parent, start_new_session=True)


@pytest.fixture(scope="module")
def whole(environment, tmp_path_factory):
    """Folder of the sweep without an interruption."""
    folder = tmp_path_factory.mktemp("sweep") / "whole"
    assert begin(environment, folder, "--workers", "2").wait() == 0
    return folder


def stored(folder):
    """Time of writing of each finished case, ns."""
    return {file.name: file.stat().st_mtime_ns for file in (folder / "cases").glob("*.json")}


def kill_with_more_cases(process, folder):
    """Kill the process group once it has finished a case; return what is stored."""
    before, until = len(stored(folder)), time.monotonic() + 120
    while len(stored(folder)) == before and time.monotonic() < until and process.poll() is None:
        time.sleep(0.005)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert before < len(stored(folder)) < 24
    return stored(folder)


@pytest.mark.long
@pytest.mark.parametrize("where", ["one process", "two processes", pytest.param("Dask", marks=pytest.mark.study)])
def test_a_sweep_that_is_killed_twice_ends_with_the_rows_of_one_that_was_not(whole, environment, tmp_path, where):
    """A kill takes the workers too; cases that are finished are not run again."""
    with ExitStack() as stack:
        options = ["--workers", "2" if where == "two processes" else "1"]
        if where == "Dask":
            distributed = pytest.importorskip("dask.distributed")
            local = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
            options = ["--scheduler", stack.enter_context(local).scheduler_address]
        folder = tmp_path / "killed"
        first = kill_with_more_cases(begin(environment, folder, *options), folder)
        second = kill_with_more_cases(begin(environment, folder, *options), folder)
        assert not (folder / "sweep.csv").exists()
        assert begin(environment, folder, *options).wait() == 0
    assert first.items() < second.items() < stored(folder).items()
    assert figures_of(folder) == figures_of(whole)
    assert {file.name for file in folder.iterdir()} == {file.name for file in whole.iterdir()}, "a partial file is left"


def test_cases_can_be_sent_to_other_machines(tmp_path):
    """A case contains its scene, so it needs no file of the sweep; equal cases have equal stores."""
    design = Design.of(["chain.span=0.7,0.8"])
    cases = parameter_sweep.plan(design, "hanging_chain", tmp_path, settings=["chain.links=8"]).cases
    sent = pickle.loads(pickle.dumps(cases))
    assert [case.arguments[0].chain.span for case in sent] == [0.7, 0.8]
    assert [repr(case) for case in sent] == [repr(case) for case in cases]
    assert re.search("chain.span=0.7$", cases[0].name)


def test_tables_and_pictures_are_written_whole_or_not_at_all(tmp_path):
    class Full(Figure):
        """Picture for which the disk has no room."""

        def savefig(self, path):
            path.write_bytes(b"half")
            raise OSError(errno.ENOSPC, "No space left on device")

    (tmp_path / "sweep.png").write_bytes(b"before")
    with pytest.raises(BadInput, match=r"sweep\.png.* cannot be written: No space left on device"):
        output_files.save_results(tmp_path, "sweep", Table("", (Column("a", "a"),), [(1.0,)]), Full())
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir() if file.suffix != ".md"} == {
        "sweep.csv": b"a\n1.0\n", "sweep.png": b"before",
    }  # fmt: skip


# --- picture ---


def picture(vary, sample=None):
    """Picture of the figure 10 a + b of a design over a, b and perhaps words, and its points."""
    design = Design.of(vary, sample)
    rows = [(*point, 10.0 * point[0] + point[1]) for point in shown(design)]
    rows[-1] = (*rows[-1][:-1], None)  # a case that failed
    columns = [Column(one.key, one.head) for one in design.variations]
    return sweep_picture.draw(design, Table("", (*columns, Column("y", "y, N")), rows), "Sweep"), rows


def test_curves_and_a_map_of_a_grid():
    figure, _ = picture(["a=1:3:3", "b=5,4"])
    over_a, over_b, cells = figure.axes[:3]
    assert [[*line.get_xydata().ravel()] for line in over_a.lines][1] == [
        1.0,
        14.0,
        2.0,
        24.0,
        3.0,
        pytest.approx(np.nan, nan_ok=True),
    ]
    assert [line.get_label() for line in over_a.lines] == ["b = 5", "b = 4"]
    assert [*over_b.lines[0].get_xydata().ravel()] == [4.0, 14.0, 5.0, 15.0]
    mesh = cells.collections[0]
    np.testing.assert_array_equal(np.ma.filled(mesh.get_array(), np.nan), [[14.0, 24.0, np.nan], [15.0, 25.0, 35.0]])
    assert (over_a.get_xlabel(), over_a.get_ylabel(), cells.get_title()) == ("a", "y, N", "y, N")


def test_dots_and_a_map_of_a_sample_for_each_word():
    figure, rows = picture(["a=1:3", "b=4:5 m", "m=x,y"], 4)
    over_a, _, over_m, map_x, map_y = figure.axes[:5]
    assert [line.get_linestyle() for line in over_a.lines] == ["None", "None"]
    assert len(over_m.lines) == 1
    np.testing.assert_array_equal(map_x.collections[0].get_offsets(), [row[:2] for row in rows[:4]])
    np.testing.assert_array_equal(map_x.collections[0].get_array(), [row[3] for row in rows[:4]])
    assert (map_y.get_title(), map_y.get_ylabel()) == ("y, N, y", "b, m")
    assert map_x.collections[0].get_clim() == map_y.collections[0].get_clim(), "two maps, two scales"


def test_no_map_of_three_numbers_and_no_figure_of_failures():
    assert len(picture(["a=1,2", "b=1,2", "c=1,2"])[0].axes) == 3
    design = Design.of(["a=1,2"])
    table = Table("", (Column("a", "a"), Column("status", "status"), Column("y", "y")), [(1.0, "failed", None)] * 2)
    assert sweep_picture.draw(design, table, "Sweep").axes[0].lines[:] == []


def test_no_figure_of_a_constant_and_units_with_a_prefix():
    design = Design.of(["a=1,2"])
    columns = (Column("a", "a"), Column("c", "c"), Column("f", "f, N", unit="N"), Column("m", "m, m", unit="m"))
    figure = sweep_picture.draw(design, Table("", columns, [(1.0, 3.0, 5e4, 2e3), (2.0, 3.0, 6e4, 3e3)]), "Sweep")
    drawn = [pane for pane in figure.axes if pane.lines]
    assert [pane.get_ylabel() for pane in drawn] == ["f, kN", "m, m"]
    np.testing.assert_allclose(drawn[0].lines[0].get_ydata(), [50.0, 60.0])


def test_a_colour_has_one_meaning():
    over_a, over_b, _ = picture(["a=1:3:3", "b=5,4"])[0].axes[:3]
    colours = [{line.get_color() for line in pane.lines} for pane in (over_a, over_b)]
    assert [len(each) for each in colours] == [2, 3]
    assert not colours[0] & colours[1]


# --- further figures ---


def test_further_figures_are_those_of_the_log(cotrack, tmp_path):
    wanted = ("--for", "sag", "--for", "max:chain.tension.max", "--for", "joints", "--for", "ride")
    options = (*CHAIN, "--no-estimate", "--keep-logs", *SPANS)
    status, _, err = cotrack("sweep", "hanging_chain", *wanted, *options, "-o", "found")
    assert status == 0, err
    assert "1/2 chain.span=0.7: tension max 699.25 N, " in err
    for number, row in enumerate(rows_of(tmp_path / "found"), 1):
        with Log(tmp_path / "found" / "logs" / f"{number}.mcap") as log:
            run = RunData(log)
            _, tension = run.signal("chain.tension.max")
            assert float(row["max:chain.tension.max, N"]) == tension.max()
            assert float(row["sag, m"]) == chain_measures.sag(run, "", EVER)
            largest = joints.of(run).table().records()
        heads = [head for head in row if head.startswith("joints ") and head.endswith("largest, kN")]
        assert sorted(float(row[head]) for head in heads) == sorted(each["largest"] for each in largest)
        assert row["note"].startswith("ride: ")
