"""Sweeps: rows equal to single runs, what continues after an end, further figures."""

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

import pytest
from matplotlib.figure import Figure
from short_run import last

import orchestrator as offered
from fmus.vehicles.tables import BadInput
from orchestrator.cosim.graph import ComponentFailed
from orchestrator.execution import summary
from orchestrator.log.log_file import LogFailed
from orchestrator.log.reader import Log
from orchestrator.results import chain_measures, output_files
from orchestrator.results.analyses import joints
from orchestrator.results.run_data import EVER, RunData
from orchestrator.results.table import Column, Table
from orchestrator.studies import Case, parameter_sweep, pool
from orchestrator.studies.variations import Design

CHAIN = ("--set", "chain.links=8", "--set", "run.stop=0.02 s")
MODELS = ("sweep", "hanging_chain", *CHAIN, "--vary", "track.model=rigid,flexible")
SPANS = ("--vary", "chain.span=0.7:0.8:2", "--workers", 1)  # in this process


def rows_of(folder):
    return list(csv.DictReader((folder / "sweep.csv").open()))


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
        forces = dict.fromkeys(("tension_max", "pin_force", "pin_force_high", "tension_mean", "end_tension"), "N")
        units = {**forces, "sag": "m"}
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
        assert (options["native"], options["estimated"], options["answer"]) == (False, True, True)
        end = queue.pop(0)
        if isinstance(end, BaseException):
            raise end
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
    assert "4 rows, 3 not as they should be, 1 miss checks of the scene\n" in err
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


def test_an_interrupted_sweep_continues_where_it_stopped(cotrack, monkeypatch, tmp_path):
    """The second start runs what is missing; a number planted into the stored row shows that the first row is read."""
    first = fake(monkeypatch, {"observables": {"sag": 0.5}}, KeyboardInterrupt())
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


@pytest.mark.parametrize(("end", "again"), [
    (OSError(errno.EMFILE, "Too many open files"), True),
    (MemoryError(), True),
    (LogFailed("no space left on device"), True),
    (KeyError("a fault of ours"), True),
    (BadInput("no idler position"), False),
    (ComponentFailed("chain: no convergence"), False),
    ({"status": "failed", "message": "link 7 is lost", "energy": None}, False),
])  # fmt: skip
def test_only_answers_of_the_model_are_kept(cotrack, monkeypatch, end, again):
    """A case that the machine failed runs again, and the command says so; a refusal is a row for ever."""
    fake(monkeypatch, end, {})
    one = ("sweep", "hanging_chain", *CHAIN, "--track", "rigid", *SPANS, "-o", "found")
    assert cotrack(*one)[0] == 1
    second = fake(monkeypatch, {})
    status, _, err = cotrack(*one)
    assert (len(second), status) == ((1, 0) if again else (0, 1))
    assert ("runs that the machine failed are done again: 1" in err) == again


def test_a_failure_of_the_machine_under_another_error_is_one():
    def reads():
        try:
            raise OSError(errno.EMFILE, "Too many open files")
        except OSError:
            raise BadInput("the scene cannot be read") from None

    assert pool.attempt(Case("0", "0", reads)) == ("BadInput: the scene cannot be read", False)


def test_a_folder_holds_one_sweep(cotrack, monkeypatch, tmp_path):
    fake(monkeypatch, *({} for _ in range(8)))
    assert cotrack(*MODELS, *SPANS, "-o", "found")[0] == 0
    kept = {file: file.read_bytes() for file in (tmp_path / "found").iterdir() if file.is_file()}
    vary = "['track.model=rigid,flexible', 'chain.span=0.7:0.8:2']"
    for other, differs in (
        (("--no-estimate",), "estimated is true there and false here"),
        (("--native",), "native is false there and true here"),
        (("--set", "run.step=2 ms"), "setting run.step is 'not set' there and '2 ms' here"),
        (("--vary", "run.links=1,2"), f"vary is {vary} there and {vary[:-1]}, 'run.links=1,2'] here"),
    ):
        status, out, err = cotrack(*MODELS, *SPANS, *other, "-o", "found")
        assert (status, out) == (2, "")
        assert err == (
            f"cotrack: output 'found': holds another sweep, of hanging_chain over {vary}: {differs}:"
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
@pytest.mark.parametrize(
    "where", ["two processes", *(pytest.param(study, marks=pytest.mark.study) for study in ("one process", "Dask"))]
)
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
