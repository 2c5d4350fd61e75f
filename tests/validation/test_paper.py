"""The study of the paper: models, logs, the command."""

import csv

import pytest

from fmus.vehicles.tables import BadInput
from orchestrator.execution.simulate import simulate
from orchestrator.scene.scene import load
from orchestrator.studies import Row
from tests.validation import paper
from tests.validation.__main__ import app
from tests.validation.made_up import rows
from tests.validation.paper import recorded, rules, theory
from tests.validation.paper.models import MODELS, PRICED, TRANSFORMED, Model, scene
from tests.validation.paper.results import HOLDS, UNMEASURED
from tests.validation.paper.statements import STATEMENTS


def test_models_are_told_apart_and_one_that_is_missing_is_a_sentence():
    assert len({model.name for model in PRICED}) == len({model.label for model in PRICED}) == len(PRICED)
    assert {model.track for model in MODELS} == {"rigid", "flexible"}
    assert scene(TRANSFORMED).track.coordinates == "cholesky"
    with pytest.raises(BadInput, match=r"unknown key 'track\.nonsense'"):
        scene(Model("a", "b", "rigid", ("track.nonsense=1",), "-", "k"))


@pytest.mark.long
def test_a_log_fits_by_its_scene_its_fmus_and_its_end(tmp_path, monkeypatch):
    path = tmp_path / "a.mcap"
    settings = ("run.stop=0.02 s", "chain.links=6", "track.start=displaced")
    wanted = load("hanging_chain", "flexible", settings)
    assert not recorded.fits(path, wanted)
    assert simulate(wanted, path)["status"] == "ok"
    assert recorded.fits(path, wanted)
    assert not recorded.fits(path, load("hanging_chain", "flexible", (*settings, "vehicle.gravity=9.8")))
    assert not recorded.fits(path, load("hanging_chain", "rigid", settings))
    with monkeypatch.context() as other:
        other.setattr(recorded, "identity", lambda file: "another FMU's")
        assert not recorded.fits(path, wanted), "of other sources"
    path.write_bytes(path.read_bytes()[:-2000])
    assert not recorded.fits(path, wanted)


def test_an_interrupted_run_ends_the_study(tmp_path, monkeypatch):
    """An interruption is not stored as the result of a case."""
    results = {"status": "interrupted", "message": "interrupted at t = 1 s"}
    monkeypatch.setattr(recorded, "simulate", lambda wanted, file: results)
    with pytest.raises(KeyboardInterrupt):
        recorded.ran(None, tmp_path)
    results["status"] = "failed"
    with pytest.raises(RuntimeError, match="interrupted at"):
        recorded.ran(None, tmp_path)


def test_the_command_writes_the_page_and_a_statement_that_does_not_hold_is_exit_0(call, monkeypatch, tmp_path):
    from orchestrator.studies import Case

    monkeypatch.setattr(paper, "cases", lambda quick, folder: [Case("cost", "made up", rows, (0.5, 0.2, 5.0, 6.0))])
    status, out, err = call(app, "paper", "--quick", "--workers", 1, "-o", "found")
    assert status == 0, err
    assert "does not hold" in out
    page = (tmp_path / "found" / "paper.md").read_text()
    assert "| 8.3 | At 5 s the chain is tight before the sprocket" in page
    table = list(csv.DictReader((tmp_path / "found" / "paper.csv").open()))
    assert [row["verdict"] for row in table].count("does not hold") == 3
    failed = lambda: [Row("count", "pins", {"value": 125, "reference": 126}, False)]  # noqa: E731
    monkeypatch.setattr(paper, "cases", lambda quick, folder: [Case("count", "made up", failed)])
    status, _, err = call(app, "paper", "--workers", 1, "-o", "other")
    assert status == 1
    assert "minutes on two cores" in err, "the long form says before how long it takes"


def test_both_forms_have_the_same_cases(tmp_path):
    quick, full = paper.cases(True, tmp_path), paper.cases(False, tmp_path)
    assert [case.name for case in quick] == [case.name for case in full]
    assert {case.item for case in full} == {
        "run", "count", "equation", "curvature", "piece", "each", "stiffness", "modulus", "fmus", "spectrum", "links",
        "elasticity",
    }  # fmt: skip
    assert sum(case.item == "piece" for case in full) == len(PRICED) == len(MODELS) + 1


@pytest.mark.study
def test_the_quick_form(call, tmp_path):
    status, _, err = call(app, "paper", "--quick", "-o", "found")
    assert status == 0, err
    made = {file.name for file in (tmp_path / "found").iterdir()}
    numbers = [*range(10, 18), 20, 21, "18-19"]
    assert {f"figure-{n}.{suffix}" for n in numbers for suffix in ("png", "svg")} <= made
    assert {"high-frequencies.png", "conditions.png", "paper-ratio.csv", "paper-effect.csv"} <= made
    rows = list(csv.DictReader((tmp_path / "found" / "paper.csv").open()))
    verdicts = {row["statement"]: row["verdict"] for row in rows}
    assert [text for text, v in verdicts.items() if v == UNMEASURED] == [STATEMENTS[-1].text], "no such frame here"
    for statement in STATEMENTS:
        if statement.rule in (rules.counted, rules.violated, rules.settled, rules.alike, rules.sections, rules.singular,
                              rules.fast, theory.cheaper):  # fmt: skip
            assert verdicts[statement.text] == HOLDS, statement.text
