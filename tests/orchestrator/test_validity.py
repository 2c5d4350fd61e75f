"""The validity ledger as a whole: a kind that breaks, messages of a run, kinds that a scene allows."""

import html
import inspect
import json
import sys

import numpy as np
import pytest
from ledger_logs import running
from mcap.reader import make_reader

from orchestrator.execution.simulate import simulate
from orchestrator.files.command import command_scope
from orchestrator.log.container import LogUnreadable
from orchestrator.log.reader import Log, Missing
from orchestrator.results.analyses import validity
from orchestrator.results.analyses.catalogue import analyse
from orchestrator.results.page import heading
from orchestrator.results.page.evaluation import RunSummary, attempt, evaluate
from orchestrator.results.run_data import RunData
from orchestrator.results.validity.exceedance import recorded_entries
from orchestrator.scene.scene import load
from orchestrator.vocabulary import limits

# faults


@pytest.mark.parametrize("error", [NameError("n"), AttributeError("n"), KeyError("n"), TypeError("n"), IndexError("n")])
def test_a_kind_that_breaks_is_a_crash_when_all_else_is_done(tmp_path, monkeypatch, error):
    """A fault of ours ends a command after the other kinds, and a call at once; what a log lacks is no fault."""
    path = running(tmp_path / "a.mcap", np.linspace(0.0, 1.0, 20), np.zeros(20))
    with Log(path) as log:
        whole = validity.of(RunData(log))

    def broken(piece):
        raise error
        yield

    monkeypatch.setitem(validity.CHECKS, "creep", validity.CHECKS["creep"]._replace(find=broken))
    with Log(path) as log, pytest.raises(type(error)):
        validity.of(RunData(log))
    with pytest.raises(type(error)), command_scope(), Log(path) as log:
        found = validity.of(RunData(log))
    assert found.entries == whole.entries
    assert f"not looked at, creep: {type(error).__name__}: {error}" in found.table().notes
    error = Missing("the log has no 'speed'")
    with Log(path) as log:
        lacking = validity.of(RunData(log))
    assert (lacking.passed_over, lacking.unchecked["creep"]) == ([], "the log has no 'speed'")


def test_a_section_that_breaks_is_a_crash_when_all_else_is_done():
    """The same of the report; an error of the log's reader ends it at once."""
    missing = []
    with pytest.raises(ZeroDivisionError):
        attempt(lambda: 1 / 0, missing)

    @command_scope()
    def command():
        attempt(lambda: 1 / 0, missing)
        attempt(lambda: [][0], missing)
        sys.exit(0)

    with pytest.raises(ZeroDivisionError):
        command()
    assert missing == ["ZeroDivisionError: division by zero", "IndexError: list index out of range"]
    with pytest.raises(LogUnreadable), command_scope():
        attempt(lambda: (_ for _ in ()).throw(LogUnreadable("damaged")), missing)


# messages of a run


def said_on_page(path):
    with Log(path) as log:
        return heading.verdict(evaluate(RunData(log), RunSummary({}, {})))


@pytest.fixture(scope="module")
def pressed():
    """Settings of a rig whose sprocket jumps to 30 rad/s: pins 76 mm in the teeth, a tooth jump."""
    return ("run.stop=40 ms", "run.step=0.25 ms", "track.step=0.25 ms", "drive.ramp_time=0", "drive.speed=30")


@pytest.mark.long
def test_a_run_that_is_not_valid_fails_and_says_so_everywhere(cotrack, pressed, tmp_path):
    changes = [part for each in pressed for part in ("--set", each)]
    status, out, err = cotrack("run", "rig", "--track", "rigid", "--no-estimate", "--json", *changes)
    result = json.loads(out.splitlines()[-1])
    assert (status, result["status"]) == (1, "failed")
    assert result["message"].startswith("not valid from 0.0")
    assert result["message"] in err
    entries = result["validity"]
    keys = {"what", "component", "time", "place", "value", "limit", "severity"}
    assert all(set(entry) == keys for entry in entries)
    failures = [entry for entry in entries if entry["severity"] == "failure"]
    assert {entry["what"] for entry in failures} == {"penetration", "tooth_jump"}
    assert all(entry["value"] > entry["limit"] >= 0.0 for entry in failures)
    with Log(result["log"]) as log:
        assert log.closing["status"] == "failed"
        assert log.closing["message"] == result["message"]
        assert recorded_entries(log.closing["results"]) == entries
    with open(result["log"], "rb") as file:
        messages = [json.loads(message.data) for _, _, message in make_reader(file).iter_messages("/events")]
    assert len([one for one in messages if one["kind"] == "validity"]) == len(entries)
    again = [entry._asdict() for entry in analyse(result["log"], "validity").entries]
    assert again == entries, "the log gives other entries"
    assert "validity, failure: track from" in cotrack("log", "info", result["log"])[1]
    assert "penetration" in cotrack("analyse", result["log"], "validity")[1]
    verdict = said_on_page(result["log"])
    assert (verdict.word, result["message"] in html.unescape(verdict.sentence)) == ("Not valid", True)
    assert verdict.sentence.startswith("The run went on to its end at 0.04 s: ")


@pytest.mark.long
def test_a_scene_allows_what_it_names(pressed, tmp_path):
    scene = load("rig", "rigid", (*pressed, 'run.allow=["penetration", "tooth_jump"]'))
    result = simulate(scene, tmp_path / "allowed.mcap")
    assert (result["status"], result["message"]) == ("ok", "")
    assert {entry["severity"] for entry in result["validity"]} == {"warning"}
    assert "penetration" in {entry["what"] for entry in result["validity"]}
    with Log(result["log"]) as log:
        assert log.closing["status"] == "ok"
    assert f"; {len(result['validity'])} limits of validity passed" in said_on_page(result["log"]).sentence


def test_kinds_are_siblings():
    for name, check in validity.CHECKS.items():
        assert [*inspect.signature(check.find).parameters] == ["piece"], name
        assert [*inspect.signature(check.signals).parameters] == ["run"], name
        assert check.find.__doc__
    assert set(limits.ALLOWED) < set(limits.VALIDITY_KINDS)
