"""The divergence of two logs: found at the very bit, in any chunks, with its spread and growth."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded import STEP, TOPICS, record

from orchestrator.execution.simulate import simulate
from orchestrator.log import recorder as module
from orchestrator.log.bitwise import ulps
from orchestrator.log.reader import Log
from orchestrator.results.divergence import divergence, draw
from orchestrator.scene.scene import load

STEPS = 600


def altered(changes):
    """Return a change for ``record``: (topic, step, column) -> factor of the value, or an int in ULP."""

    def change(topic, k, row):
        for (where, step, column), what in changes.items():
            if where == topic and k >= step:
                if isinstance(what, int):
                    row[column] = (row[column : column + 1].view(np.int64) + what * (k == step)).view(np.float64)[0]
                else:
                    row[column] *= what
        return row

    return change


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    return record(tmp_path_factory.mktemp("logs") / "reference.mcap", STEPS, flush=60)


def parted(path, reference, window=(-np.inf, np.inf)):
    with Log(path) as one, Log(reference) as other:
        return divergence(one, other, window)


def in_pieces(path, changes, size):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "CHUNK", size)
        return record(path, STEPS, change=altered(changes), flush=60)


def test_equal_runs_are_equal(reference, tmp_path):
    difference = parted(in_pieces(tmp_path / "a.mcap", {}, 7000), reference)
    numbers = sum(len(names) * (STEPS // 5 + 1 if topic.endswith("links") else STEPS + 1)
                  for topic, names in TOPICS.items() if "stats" not in topic)  # fmt: skip
    assert (difference.first, difference.spread, difference.growth, difference.unmatched) == (None, (), {}, ())
    assert (difference.value_count, difference.end) == (numbers, pytest.approx(STEPS * STEP))


@pytest.mark.long
@settings(max_examples=12, deadline=None)
@given(st.integers(1, STEPS), st.sampled_from([2_000, 9_000, 40_000]), st.sampled_from([-3, 1, 17]))
def test_one_bit_is_found_where_it_is(reference, tmp_path_factory, step, size, off):
    path = tmp_path_factory.mktemp("logs") / "a.mcap"
    in_pieces(path, {("/left_track/out", step, 1): off}, size)
    first = parted(path, reference).first
    assert (first.instance, first.variable, first.step, first.ulps) == ("left_track", "tension.mean", step, abs(off))
    assert first.t == step * STEP
    later = parted(path, reference, ((step + 0.5) * STEP, np.inf))
    assert later.first is None
    assert parted(path, reference, (step * STEP, np.inf)).first == first


@pytest.mark.long
def test_what_it_spreads_to_and_how_it_grows(reference, tmp_path):
    changes = {
        ("/chassis/out", 100, 0): 1,
        ("/left_track/links", 200, 4): 1.0 + 1e-9,
        ("/left_track/out", 150, 0): 1.01,
    }
    difference = parted(in_pieces(tmp_path / "a.mcap", changes, 9_000), reference)
    assert [(each.instance, each.variable, each.step) for each in difference.spread] == [
        ("chassis", "speed", 100), ("left_track", "speed", 150)
    ]  # fmt: skip
    assert set(difference.growth) == {"/chassis/out", "/left_track/links", "/left_track/out"}
    with Log(reference) as log:
        speed = log.read("/left_track/out").values[:, 0]
    growth = difference.growth["/left_track/out"]
    assert growth.difference.max() == pytest.approx(0.01 * np.abs(speed[150:]).max() / np.abs(speed).max())
    assert 150 * STEP <= growth.t[0] <= growth.t[-1] == STEPS * STEP
    draw(difference, tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 5_000


def test_runs_of_other_steps_part_at_once(reference, tmp_path, monkeypatch):
    monkeypatch.setattr("recorded.STEP", 1.0001 * STEP)
    difference = parted(record(tmp_path / "a.mcap", STEPS, flush=60), reference)
    assert (difference.first.variable, difference.first.step) == ("t", 1)


def test_what_only_one_has_is_said(reference, tmp_path, monkeypatch):
    less = {topic: names[:-1] if topic == "/left_track/out" else names for topic, names in TOPICS.items()}
    del less["/chassis/out"]
    monkeypatch.setattr("recorded.TOPICS", less)
    monkeypatch.setattr("recorded.EVERY", {"/left_track/links": 10})
    path = record(tmp_path / "a.mcap", STEPS, change=lambda topic, k, row: row[: len(less[topic])], flush=60)
    only = parted(path, reference).unmatched
    assert any("reference.mcap: /chassis/out" in each for each in only)
    assert {"/left_track/links: one step in 10 and 5", "/left_track/out: tension.mean"} <= set(only)


@given(st.floats(), st.integers(-50, 50))
def test_ulps_are_counted_across_zero(x, n):
    if np.isnan(x):
        assert ulps(x, 1.0) is ulps(1.0, x) is None
        return
    y = x
    for _ in range(abs(n)):
        y = math.nextafter(y, math.inf if n > 0 else -math.inf)
    zeros = (x < 0.0) != (y < 0.0) or (x == 0.0) != (y == 0.0)  # nextafter treats -0.0 and 0.0 as equal
    assert abs(ulps(x, float(y)) - abs(n)) <= (1 if zeros or np.isinf(y) else 0) or np.isinf(y)
    assert ulps(-0.0, 0.0) == 0
    assert ulps(5e-324, -5e-324) == 2


# ------------------------------------------------------------------ the command

SHORT = ("run.stop=0.02", "expect={}", "chain.links=8")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Logs of a chain, and of one whose gravity differs in the last bit."""
    folder = tmp_path_factory.mktemp("runs")
    for name, more in (("a", ()), ("b", ("vehicle.gravity=9.810000000000002",))):
        assert simulate(load("hanging_chain", None, (*SHORT, *more)), folder / f"{name}.mcap")["status"] == "ok"
    return str(folder / "a.mcap"), str(folder / "b.mcap")


def test_compare_is_a_diff(runs, cotrack, tmp_path):
    a, b = runs
    assert "bit by bit equal: " in cotrack.done("compare", a, a, "--bits", "--allow", "0")
    status, out, _ = cotrack("compare", b, a, "--different", "--bits", "--json", "-o", str(tmp_path / "g.svg"))
    verdict = json.loads(out)
    assert (status, verdict["ok"], verdict["reference"]["log"]) == (1, False, a)
    first = verdict["bits"]["first"]
    assert (first["instance"], first["step"]) == ("chain", 0)
    assert first["ulps"] > 0
    assert first["run"] != first["reference"]
    assert (tmp_path / "g.svg").read_text().startswith("<?xml")
    status, out, _ = cotrack("compare", b, a, "--different", "--bits", "--from", "0.005", "--to", "0.01")
    assert "from 0.005 to 0.01 s" in out
    assert "at step 5, t = 0.005 s" in out


def test_compare_holds_what_is_allowed(runs, cotrack):
    a, b = runs
    assert cotrack("compare", b, a, "--different", "--allow", "1e-9")[0] == 0
    status, out, _ = cotrack("compare", b, a, "--different", "--allow", "1e-9", "--allow", "tension=1e-18")
    assert status == 1
    assert "NOT, allowed 1e-18" in out
    for bad in ("x", "tension=-1", "tension=nan"):
        status, _, err = cotrack("compare", b, a, "--different", "--allow", bad)
        assert (status, f"--allow {bad}: must be [NAME=]RELATIVE" in err) == (2, True)
    status, _, err = cotrack("compare", b, a, "--different", "--allow", "tenson=1")
    assert (status, "no observable 'tenson': one of pins, tension" in err) == (2, True)
