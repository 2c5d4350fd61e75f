"""Studies: one fast case from the command to the figure, tables, what a missed tolerance and a failure do."""

import csv
import inspect
import io
import math
import os
import select
import signal
import subprocess
import sys
from contextlib import suppress
from functools import partial
from importlib import import_module
from pathlib import Path

import pytest
from logged import logged

from fmus.vehicles.tables import BadInput
from orchestrator import studies
from orchestrator.files.progress import Progress
from orchestrator.studies import Case, Row, pool
from orchestrator.studies.pool import Store
from tests.validation import compared, element_cases, estimates, mechanics, meshes
from tests.validation.__main__ import STUDIES, app
from tests.validation.compared import checked
from tests.validation.made_cases import BAD, SUM, counts, dies, fails_once, overflows, sleeps, talks

ROOT = Path(__file__).parents[2]
FRAME = Case("11", "L-frame", element_cases.l_frame, ("beam",))
FAST = Case("11", "L-frame", element_cases.l_frame, ("small deformation (11)-(15)",))


@pytest.fixture
def validate(call):
    """Call ``python -m tests.validation``."""
    return partial(call, app)


def only(monkeypatch, *cases):
    monkeypatch.setattr(mechanics, "cases", lambda quick: list(cases))


def test_a_case_from_the_command_to_the_figure(validate, monkeypatch, tmp_path):
    only(monkeypatch, FRAME)
    status, out, err = validate("mechanics", "--quick", "--workers", 1, "-o", "found")
    assert status == 0, err
    assert "| 11 | L-frame of beams with a rigid corner, tip x, m |" in out
    made = {file.name for file in (tmp_path / "found").iterdir() if file.is_file()}
    assert made == {"mechanics.csv", "mechanics-convergence.csv", "mechanics.md", "mechanics.png", "mechanics.svg"}
    assert (tmp_path / "found" / "mechanics.png").read_bytes()[:4] == b"\x89PNG"
    assert "elements" in (tmp_path / "found" / "mechanics.svg").read_text()
    assert out.split("\n\n")[0] in (tmp_path / "found" / "mechanics.md").read_text()
    rows = list(csv.DictReader((tmp_path / "found" / "mechanics.csv").open()))
    assert [row["ok"] for row in rows] == ["ok", "ok", ""]
    points = list(csv.DictReader((tmp_path / "found" / "mechanics-convergence.csv").open()))
    assert [float(p["size"]) for p in points] == [6, 12, 24, 6, 12, 24]


def test_each_case_that_is_done_is_told():
    with Progress("study", (lines := []).append):
        pool.run([SUM, BAD], done=pool.finished_cases(2, lambda rows: ": failed" * (rows[0].ok is False)))
    assert lines == ["1/2 sum", "2/2 bad: failed"]


def test_what_the_runs_of_a_study_say_is_not_told():
    with Progress("study", (lines := []).append), logged() as said:
        pool.run([Case("0", "talks", talks)])
        talks()
    assert (lines, said) == (["components are built"], ["a spring creaks"]), "once, outside the study"


def test_a_missed_tolerance_is_exit_1(validate, monkeypatch):
    """The twin: a frame whose corner is not rigid is a tenth too soft."""
    frame_tip = meshes.frame_tip
    monkeypatch.setattr(meshes, "frame_tip", lambda kind, n, **_: frame_tip(kind, n, rigid=0.0))
    only(monkeypatch, FRAME)
    status, out, err = validate("mechanics", "--workers", 1, "-o", "found")
    assert status == 1
    assert "| NOT |" in out
    assert "misses its tolerance" in err


def test_a_case_that_fails_is_a_row_and_the_others_go_on(validate, monkeypatch):
    only(monkeypatch, BAD, FAST)
    status, out, err = validate("mechanics", "--workers", 1, "-o", "found")
    assert status == 1
    assert "| 0 | bad |  |  |  |  |  | NOT | ValueError: no equilibrium \\| found |" in out
    assert sum(line.endswith("| ok |  |") for line in out.splitlines()) == 2
    assert "0: bad: ValueError" in err


@pytest.mark.long
def test_processes_give_the_same_rows():
    alone, side_by_side = (pool.run([SUM, BAD], workers) for workers in (1, 10**400))  # no more than cases
    assert repr(alone) == repr(side_by_side)  # NaN is not itself


@pytest.mark.long
def test_warnings_of_numpy_in_processes_do_not_reach_stderr(capfd):
    pool.run([Case("0", str(k), overflows) for k in range(2)], 2)
    assert capfd.readouterr().err == ""


LATE = """
import fcntl, os, signal
from multiprocessing.context import SpawnProcess
from orchestrator.studies import Case, Row, pool

def row():
    if os.path.exists("pipe"):
        open("pipe").close()  # when the second process has come so far
    return [Row("0", "in time")]

def start(process, start=SpawnProcess.start):
    start(process)
    os.environ["PLACE"] = "second"

if __name__ == "__main__":
    os.mkfifo("pipe")
    os.environ["PLACE"] = "first"
    SpawnProcess.start = start
    pool.run([Case("0", str(k), row) for k in range(2)], 2)
else:
    file = open("lock", "w")
    if os.environ["PLACE"] == "first":
        fcntl.flock(file, fcntl.LOCK_EX)
    else:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        with open("pipe", "w"):
            os.unlink("pipe")
        fcntl.flock(file, fcntl.LOCK_EX)  # until the first has ended
        open("late", "w").close()
"""


@pytest.mark.long
def test_a_process_that_starts_when_all_cases_are_done_ends_without_a_word(tmp_path, environment):
    """The second process imports the study when the first one, which did both cases, has ended."""
    (tmp_path / "study.py").write_text(LATE)
    done = subprocess.run(
        [sys.executable, "study.py"], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (tmp_path / "late").exists()


@pytest.mark.long
def test_processes_take_our_modules_not_those_of_an_fmu_that_ran_here(tmp_path, monkeypatch):
    (tmp_path / "fmus").mkdir()
    (tmp_path / "fmus" / "__init__.py").write_text("raise ImportError('these are the modules of an FMU')")
    monkeypatch.syspath_prepend(tmp_path)
    assert [row.ok for row in pool.run([SUM], 2)] == [True]


@pytest.mark.long
def test_a_dead_process_and_an_endless_case_are_recorded():
    cases = [Case("0", "dead", dies), Case("0", "endless", sleeps, limit=1.0), SUM]
    rows = pool.run(cases, 2)
    assert [row.ok for row in rows] == [False, False, True]
    assert rows[0].note == "its process ended with status 3"
    assert rows[1].note == "took longer than 1 s"


ENDLESS = """
import os, time
from orchestrator.studies import Case, pool

def endless(pipe):
    with open(pipe, "w") as file:
        print(os.getpid(), file=file)
    while True:
        time.sleep(3600)

if __name__ == "__main__":
    pool.run([Case("0", str(k), endless, ("pids",)) for k in range(2)], 2)
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_processes_end_with_a_study_that_a_signal_ends(tmp_path, environment, number):
    """Nothing waits on the clock: a pipe gives the processes' numbers, their descriptors say when they have ended."""
    (tmp_path / "study.py").write_text(ENDLESS)
    os.mkfifo(tmp_path / "pids")
    study = subprocess.Popen([sys.executable, "study.py"], env=environment, cwd=tmp_path)
    pipe, pids = os.open(tmp_path / "pids", os.O_RDWR), []  # also for writing: it has no end before both have written
    while len(pids) < 2:
        assert select.select([pipe], [], [], 120)[0], "the processes did not begin"
        pids += [int(pid) for pid in os.read(pipe, 100).split()]
    os.close(pipe)
    ends = [os.pidfd_open(pid) for pid in pids]
    study.send_signal(number)
    assert study.wait(timeout=60) == -number
    try:
        for end in ends:
            assert select.select([end], [], [], 60)[0], "a process went on computing"
    finally:
        for end in ends:
            with suppress(ProcessLookupError):
                signal.pidfd_send_signal(end, signal.SIGKILL)
            os.close(end)


@pytest.mark.long
def test_a_study_goes_on_where_it_was(tmp_path):
    """Finished cases are not repeated; cases that lost their process are."""
    trace = tmp_path / "trace"
    trace.mkdir()
    kept = Store(tmp_path / "cases")
    counted, once = Case("0", "counted", counts, (trace,)), Case("0", "once", fails_once, (tmp_path,))
    first = pool.run([counted, once], 2, store=kept)
    assert [row.ok for row in first] == [True, False]
    again = pool.run([counted, once], 2, store=kept)
    assert [row.ok for row in again] == [True, True]
    assert len(list(trace.iterdir())) == 1
    assert repr(again[0].with_figures(series=())) == repr(first[0].with_figures(series=()))
    other = Case("0", "counted", counts, (tmp_path,))
    assert kept.get(other) is None, "other arguments, another case"


@pytest.mark.long
def test_a_cluster_gives_the_same_rows_and_outlives_a_worker(tmp_path):
    from dask.distributed import LocalCluster

    kept = Store(tmp_path / "cases")
    cases = [SUM, BAD, Case("0", "once", fails_once, (tmp_path,))]
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        rows = pool.run(cases, scheduler=cluster.scheduler_address, store=kept)
    assert [row.ok for row in rows] == [True, False, True]
    assert [bool(kept.get(case)) for case in cases] == [True, False, True], "a fault is no answer to keep"
    with pytest.raises(BadInput, match="no Dask scheduler answers"):
        pool.run(cases, scheduler="tcp://127.0.0.1:9")


def test_known_studies_and_bad_input(cotrack, validate, tmp_path):
    (tmp_path / "file").touch()
    for command, known, near in (
        (validate, STUDIES, "mechanic"),
        (partial(cotrack, "study"), studies.STUDIES, "stabilty"),
    ):
        status, out, _ = command()
        assert status == 0
        assert [line.split()[0] for line in out.splitlines()] == list(known)
        first = next(iter(known))
        for arguments, said in (
            ((near, "-o", "x"), "did you mean "),
            (("zzz", "-o", "x"), f"there are {first}"),
            ((first,), "-o DIR"),
            ((first, "-o", "file/x"), "cannot be made"),
        ):
            status, _, err = command(*arguments)
            assert status == 2
            assert said in err
            assert len(err.splitlines()) == 1
    with pytest.raises(BadInput):
        studies.study_module("")


@pytest.mark.parametrize("name", [*studies.STUDIES, *STUDIES])
def test_a_study_has_a_title_cases_a_table_and_files(name, tmp_path, fresh_cache):
    """Every entry of both lists is a module of the same functions, which say so if all its cases are lost."""
    chosen = studies.study_module(name) if name in studies.STUDIES else import_module(f"tests.validation.{name}")
    cases = chosen.cases(True, *([tmp_path] if hasattr(chosen, "KEEPS") else []))
    for case in cases:
        inspect.signature(case.function).bind(*case.arguments)
    rows = [Row(case.item, case.name, ok=False, note="nothing left") for case in cases]
    assert rows
    assert chosen.TITLE
    assert chosen.table(rows).markdown()
    files = chosen.write(tmp_path, name, rows, chosen.TITLE)
    assert "nothing left" in "".join(file.read_text() for file in files if file.suffix in (".md", ".csv"))


@pytest.mark.parametrize("name", studies.MOVED)
def test_a_study_that_has_moved_says_where(cotrack, name):
    err = cotrack.refused("study", name, "--quick", "-o", "x")
    assert err == f"cotrack: study {name} is run in a clone of cotrack: {studies.MOVED[name]}\n"
    assert (ROOT / studies.MOVED[name].split()[2].replace(".", "/") / "__main__.py").is_file()


def test_cases_are_kept_with_the_sources_of_their_study(tmp_path, monkeypatch):
    of_study = pool.sources("tests.validation.element_cases")
    assert of_study == pool.sources("tests.validation.chain_cases")
    assert of_study != pool.sources("orchestrator.studies.stability"), "sources of the study are none of the product's"


def test_the_coverage_of_stated_errors_is_counted():
    """Shares and quantiles by hand; NaN, a run without an estimate, does not count."""
    said = "4: true/stated at most 1 in 75%, largest 2.00; stated/true median 1.5, 90 % below 3.4"
    assert estimates.coverage([0.5, 1.0, 2.0, math.nan, 0.25]) == said
    figures = {"part": "held out", "ratio": 0.5, "ratio_before": 2.0, "ratios": {"a": 0.5}, "before": {"a": 2.0}}
    notes = estimates.table([Row("s", "c", figures)]).notes
    assert [note.partition(":")[0] for note in notes] == [
        f"- held out, {when}, {of}" for when in ("before", "now") for of in ("runs", "observables")
    ]


@pytest.mark.long
def test_stated_errors_cover_those_of_a_released_chain():
    """At twice its steps, at its own and at half of these; the estimate of older versions did not."""
    rows = estimates.covered(*estimates.cases(True)[0].arguments)
    assert [row["step"] for row in rows] == [2e-3, 1e-3, 0.5e-3]
    for row in rows:
        assert 0.2 < row["ratio"] <= 1.0 < row["ratio_before"]
        assert set(row["ratios"]) == {"pins", "tension"}


ROWS = [
    checked("1", "a", 1.001, 1.0, 1e-2, order=2.0, over="elements", series=((4.0, 1e-2), (8.0, 0.0))),
    checked("2", "b, with a comma", 3e-6, 0.0, 1e-6),
    checked("3", "c", 2.0, 4.0, math.nan, note="for information"),
    Row("4", "d", ok=False, note="Lost: nothing left"),
]


def test_tables(tmp_path):
    assert [row.ok for row in ROWS] == [True, False, None, False]
    assert compared.of_order(ROWS[0], 1.9, 2.1).ok
    assert compared.of_order(ROWS[0], 2.1, 2.5).ok is False
    assert [row["error"] for row in ROWS[:3]] == pytest.approx([1e-3, 3e-6, 0.5])
    lines = compared.table(ROWS).markdown().splitlines()
    assert lines[0] == "| item | case | value | reference | error | tolerance | order | ok | note |"
    assert lines[2] == "| 1 | a | 1.001 | 1 | 0.001 | 0.01 | 2 | ok |  |"
    assert lines[4] == "| 3 | c | 2 | 4 | 0.5 |  |  |  | for information |"
    assert {line.count("|") for line in lines} == {len(compared.COLUMNS) + 1}
    read = list(csv.DictReader(io.StringIO(compared.table(ROWS).csv())))
    assert float(read[0]["value"]) == ROWS[0]["value"]
    assert read[1]["case"] == "b, with a comma"
    assert (read[3]["ok"], read[3]["error"], read[3]["note"]) == ("NOT", "", "Lost: nothing left")
    assert len(compared.points(ROWS).csv().splitlines()) == 3
    compared.write(tmp_path, "x", ROWS[1:], "without a series")
    assert (tmp_path / "x.png").stat().st_size > 1000


def test_cases_of_the_mechanics():
    quick, whole = mechanics.cases(True), mechanics.cases(False)
    assert {case.item for case in quick} == {str(k) for k in range(2, 14)}
    assert {case.name for case in whole} - {case.name for case in quick} == {
        "folded chain of 65",
        "folded chain of 129",
    }
    assert len({case.name for case in whole}) == len(whole)


def test_observed_orders():
    values = [1.0 + h**3 for h in (0.4, 0.2, 0.1)]
    assert compared.order_of((0.4, 0.2, 0.1), values) == pytest.approx(3.0)
    assert compared.rate_of((8, 16), (1.0, 0.25)) == pytest.approx(2.0)
    assert math.isnan(compared.order_of((1, 2, 4), (1.0, 1.0, 1.0)))
