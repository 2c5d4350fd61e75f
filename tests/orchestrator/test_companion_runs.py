"""Coarser runs of an estimate: the bits of single runs, failures as a status, signals."""

import pytest

from orchestrator.execution import simulate as simulation
from orchestrator.execution import summary
from orchestrator.execution.interrupt import Interrupt
from orchestrator.execution.simulate import record_companion, simulate
from orchestrator.log.reader import Log
from orchestrator.results.validity.exceedance import FAILURE, Exceedance
from orchestrator.scene.scene import load

SWING = ("chain.links=8", "track.start=displaced", "run.stop=0.032 s", "run.links=1")


def scenes(folder, *settings):
    return [
        (load("hanging_chain", "flexible", (*SWING, each)), folder / f"{k}.mcap") for k, each in enumerate(settings)
    ]


def test_companions_have_the_bits_of_single_runs(tmp_path):
    runs = scenes(tmp_path, "run.step=1 ms", "run.step=2 ms")
    outcomes = [record_companion(Interrupt(), *run) for run in runs]
    for (scene, path), outcome in zip(runs, outcomes, strict=True):
        single = simulate(scene, path.with_suffix(".single.mcap"))
        same = ("status", "message", "communication_steps", "energy", "validity")
        assert {name: outcome[name] for name in same} == {name: single[name] for name in same}
        with Log(path) as log, Log(single["log"]) as other:
            assert log.digest() == other.digest()
    assert outcomes[0]["communication_steps"] == 2 * outcomes[1]["communication_steps"] == 32


def test_a_failed_run_is_a_status(tmp_path):
    ((scene, _),) = scenes(tmp_path, "run.step=1 ms")
    (tmp_path / "file").touch()
    failed = record_companion(Interrupt(), scene, tmp_path / "file" / "a.mcap")
    assert failed["status"] == "failed"
    assert "cannot be written" in failed["message"]


def test_a_run_that_is_not_valid_has_failed(tmp_path, monkeypatch):
    found = Exceedance("penetration", "chain", 0.01, "", 0.2, 0.1, FAILURE)
    monkeypatch.setattr(summary, "balance", lambda run: {"energy": None, "validity": [found._asdict()]})
    outcome = record_companion(Interrupt(), *scenes(tmp_path, "run.step=1 ms")[0])
    assert outcome["status"] == "failed"
    assert f"chain: {found.sentence}" in outcome["message"]


def test_a_signal_ends_a_run(tmp_path):
    interrupt = Interrupt()
    interrupt.requested = True
    outcome = record_companion(interrupt, *scenes(tmp_path, "run.step=1 ms")[0])
    assert (outcome["status"], outcome["message"]) == ("failed", "interrupted at t = 0 s")
    assert not interrupt.deferring, "a signal in what follows would not end it"


@pytest.mark.long
def test_the_estimate_of_a_native_run_is_native_and_the_same(tmp_path, monkeypatch):
    scene, natives, errors = scenes(tmp_path, "run.step=1 ms")[0][0], [], []
    load_scene = simulation.load_scene

    def loaded(*given, **named):
        natives.append(given[4])
        return load_scene(*given, **named)

    monkeypatch.setattr(simulation, "load_scene", loaded)
    for native in (False, True):
        summary = simulate(scene, tmp_path / "run.mcap", estimated=True, native=native)
        errors.append({name: value for name, value in summary["error"].items() if name != "wall_time"})
    assert errors[0] == errors[1]
    assert errors[0]["total"] > 0.0
    assert natives == [False] * (len(natives) // 2) + [True] * (len(natives) // 2)
    assert len(natives) >= 4
