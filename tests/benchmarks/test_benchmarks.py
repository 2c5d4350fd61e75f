"""Benchmarks run and report what they should; no test depends on speed."""

import json
import os
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.log.log_metadata import CHECKPOINT
from orchestrator.log.reader import Log
from orchestrator.scene.scene import load
from tests import benchmarks as bench
from tests.benchmarks import against, guests, machine, memory_run, picture, sweep, tables
from tests.benchmarks import recording as recording_part
from tests.benchmarks import vehicle as vehicle_part
from tests.benchmarks.__main__ import app
from tests.benchmarks.chain import LAYERS
from tests.benchmarks.process import Failed, isolated
from tests.benchmarks.tables import ABOUT, COST, Column, Table
from tests.benchmarks.timing import least

COLUMNS = (Column("what", "what", "", ABOUT), Column("time", "us", ".1f", COST), Column("count", "count", ",d"))
TABLE = Table.of_records(
    "Title", COLUMNS, [{"what": "a", "time": 2.0, "count": 1000}, {"what": "b", "time": None}], ("A note.",)
)


def test_what_comes_out(call, monkeypatch):
    asked = []

    def measured(name, **options):
        asked.append((name, options))
        if name == "sweep":
            raise Failed("no reason")
        return json.loads(json.dumps([TABLE]))

    monkeypatch.setattr(bench, "isolated", measured)
    status, out, _ = call(app, "--only", "vehicle,sweep", "--quick", "--json")
    answer = json.loads(out.splitlines()[-1])
    assert (status, answer["ok"]) == (1, False)
    assert asked == [(name, {"quick": True, "repeats": bench.QUICK_REPEATS}) for name in ("vehicle", "sweep")]
    assert set(answer) == {"machine", "busy", "quick", "repeats", "ok", "parts"}
    assert {"cpu", "cores", "load_average", "python", "packages", "commit"} <= set(answer["machine"])
    assert answer["parts"]["vehicle"] == [tables.plain(TABLE)]
    assert "| a | 2.0 | 1,000 |\n| b |  |  |\n\nA note." in out
    assert "not measured: no reason" in out
    assert call(app, "--only", "vehicle", "--repeat", "2")[0] == 0
    assert asked[-1] == ("vehicle", {"quick": False, "repeats": 2})


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--only", "chian"], "--only chian: no part 'chian': did you mean 'chain'?"),
        (["--only", "x"], "no part 'x': there are chain, vehicle, sweep, recording"),
        (["--repeat", "0"], "--repeat'"),
        (["--against", "nowhere"], "--against nowhere: there is no checkout of cotrack with benchmarks"),
    ],
)
def test_what_is_refused(call, arguments, says):
    status, out, err = call(app, *arguments)
    assert status == 2
    assert says in " ".join(err.replace("│", " ").split())
    assert "|" not in out


def test_the_old_command_says_where_it_is(cotrack):
    err = cotrack.refused("bench", "--only", "chain", "--against", "there")
    assert err.endswith("clone of cotrack: python -m tests.benchmarks --only chain --against there\n")


def test_a_busy_machine_is_named():
    quiet = machine.facts() | {"load_average": 0.9, "cores_allowed": 2}
    assert machine.busy(quiet) == machine.busy(quiet | {"load_average": None}) == ""
    assert "load average 1.1 on 2 cores" in machine.busy(quiet | {"load_average": 1.1})


def test_a_measurement_that_ends_with_an_error_is_a_sentence():
    with pytest.raises(Failed, match=r"No module named 'tests.benchmarks.nothing'"):
        isolated("nothing")


def test_the_least_of_repeats():
    runs = iter([(2.0, "a"), (1.0, "b"), (3.0, "c")])
    assert least(3, lambda: next(runs)) == (1.0, "b")


def test_pairs_are_measured_in_turn(monkeypatch, tmp_path):
    (tmp_path / "tests" / "benchmarks").mkdir(parents=True)
    roots = []

    def measured(root, names, quick):
        roots.append(root)
        drift = float(len(roots))  # the machine slows down
        return {("sweep", "step"): (1.0 if root == against.ROOT else 2.0) * drift, ("sweep", str(root)): 1.0}

    monkeypatch.setattr(against, "measured", measured)
    table = against.paired(tmp_path, ["sweep"], True, 4, lambda said: None)
    assert [root == against.ROOT for root in roots] == [True, False, False, True, True, False, False, True]
    (row,) = table.records()
    assert row["figure"] == "step"
    assert row["ratio"] == pytest.approx(0.5, rel=0.3)
    assert row["least"] < 0.5 < row["most"]


def test_a_pair_needs_both_sides(monkeypatch):
    def said(parts):
        out = json.dumps({"parts": parts})
        monkeypatch.setattr(against.subprocess, "run", lambda *_, **__: SimpleNamespace(stdout=out, stderr=""))
        return against.measured(against.ROOT, ["sweep"], True)

    assert said({"sweep": [tables.plain(TABLE)]}) == {("sweep", "a: us"): 2.0}
    with pytest.raises(Failed, match="not measured: no reason"):
        said({"sweep": [tables.plain(tables.failed("Title", "no reason"))]})


@pytest.mark.long
def test_runs_are_counted_by_their_clocks():
    """A vehicle by its own clock; a sweep by what its three processes take to import, load and run."""
    row = vehicle_part.row("rigid", ["run.stop=5 ms", "drive.ramp_start=0 s"], 1)
    assert row["least"] == row["factor"] == row["most"] == pytest.approx(1e3 / row["wall"])
    row = sweep.row("rigid", False, "drive.speed", (4.0, 6.0), 3, (*sweep.QUICK, "run.step=1 ms"))
    wall, processors = 0.3 / row["by_wall"], 0.3 / row["by_processor"]
    assert row["sweep"] == f"drive.speed: 3 runs, 0.3 s in all, {max(2, len(os.sched_getaffinity(0)))} processes"
    assert 1.0 < processors < 1.1 * wall * os.cpu_count()
    assert row["cpu"] == pytest.approx(1e3 * processors / 0.3)
    assert 50.0 < memory_run.measure("hanging_chain", "flexible", [0.01])[0] < 20_000.0


def test_the_picture_has_a_pane_for_each_free_chain():
    cases, codes = ("rigid", "rigid, on the ground"), ("ours, model", LAYERS[0])
    rows = [{"case": case, "code": code, "cpu": 1.0, "error": 1e-5} for case in cases for code in codes]
    figure = picture.draw(rows)
    assert [pane.get_title() for pane in figure.axes] == ["rigid"]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["ours, model"]


def test_pieces_with_a_record_stand_between_pieces_without(tmp_path):
    """The log of pieces is whole, and its inputs are verified across the gaps."""
    rig = load("rig", "rigid", ("expect={}", "drive.ramp_start=0", "run.checkpoints=0.02"))
    times = recording_part.pieces_of(rig, False, 2, 30, tmp_path / "pieces.mcap")
    assert len(times) == 5
    with Log(tmp_path / "pieces.mcap") as log:
        steps = log.read("/track/out").t / rig.run.step
        assert np.array_equal(np.round(steps), [*range(31), *range(61, 91), *range(121, 151)])
        assert any(name.startswith(CHECKPOINT) for name in log.attachments)


def test_the_share_of_a_record_is_that_of_its_pieces(monkeypatch):
    def times(*given):
        given[-1].write_bytes(b"log!")
        return [1.0, 2.0, 3.0, 5.0, 2.0]  # shares of 0 and 50 %

    monkeypatch.setattr(recording_part, "pieces_of", times)
    row = recording_part.row(load("rig", "rigid", ("run.step=1 ms", "run.links=3")), False, 2, 1000)
    assert (row["fmus"], row["links"]) == ("Python", "one step in 3")
    printed = [row[key] for key in ("step", "low", "share", "high", "size")]
    assert printed == pytest.approx([2000.0, 12.5, 25.0, 37.5, 2e-6])


@pytest.mark.long
def test_guests_are_measured_both_ways():
    table = guests.measured(repeats=1, steps=50)
    assert [n for n, _, _ in table.rows] == [1, 2, 8]
    assert all(own > inside > 0.0 for _, own, inside in table.rows)


@pytest.mark.benchmark
def test_the_quick_form_as_a_whole(call):
    status, out, _ = call(app, "--quick", "--repeat", "1", "--json")
    answer = json.loads(out.splitlines()[-1])
    assert status == 0, out
    assert list(answer["parts"]) == list(bench.PARTS)
    assert all(table["rows"] for part in answer["parts"].values() for table in part)


@pytest.mark.benchmark
def test_a_checkout_against_itself():
    if machine.busy(machine.facts()):
        pytest.skip("the machine is busy")
    table = against.paired(against.ROOT, ["vehicle"], True, 5, lambda said: None)
    assert [row["ratio"] for row in table.records()] == pytest.approx([1.0] * len(table.rows), abs=0.03)
