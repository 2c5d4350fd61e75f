"""A run that continues from a checkpoint equals the uninterrupted run, bit by bit."""

import json
import os
import signal
import subprocess
import sys
import time
from functools import reduce
from operator import getitem

import numpy as np
import pytest
from mutated import Content
from short_runs import RIG, rig_log, simulated

from fmus.vehicles.tables import BadInput
from orchestrator.cosim.checkpoint import UnusableCheckpoint
from orchestrator.cosim.coupling import COUPLINGS
from orchestrator.cosim.coupling.power_residual import PowerResidual
from orchestrator.cosim.coupling.variable_step import VariableStep
from orchestrator.execution import replay_model, summary_text
from orchestrator.execution.resume import branched_scene, resume
from orchestrator.log.log_metadata import CHECKPOINT, checkpoint_step
from orchestrator.log.reader import Log
from orchestrator.log.tools import RECOVERED, WHOLE, recover, verify
from orchestrator.results.divergence import divergence
from orchestrator.results.energy import ledger
from orchestrator.results.run_data import RunData
from orchestrator.scene.scene import load


def digest(path):
    assert verify(path).code == WHOLE
    with Log(path) as log:
        return log.digest()


rig = pytest.fixture(scope="module")(rig_log)


@pytest.mark.long
@pytest.mark.parametrize("coupling", COUPLINGS)
def test_every_coupling_goes_on_as_if_nothing_had_been(tmp_path, coupling):
    whole = simulated(tmp_path / "whole.mcap", "rig", "rigid", *RIG, f"run.coupling={coupling}")
    for at, step in ((0.02, 20), (0.05, 40)):
        summary = resume(whole, tmp_path / "again.mcap", at)
        assert (summary["status"], summary["communication_steps"]) == ("ok", 60)
        assert digest(tmp_path / "again.mcap") == digest(whole)
        with Log(tmp_path / "again.mcap") as log:
            assert log.metadata["resumed"] == {"of": str(whole), "step": str(step)}


@pytest.mark.long
@pytest.mark.parametrize("estimate", ["doubling", "power"])
def test_variable_steps_go_on(tmp_path, monkeypatch, estimate):
    """A run with variable steps resumes with the same steps, from checkpoints where they allow it.

    The brake slips: where it holds the idler, steps become as long as the time between checkpoints.
    """
    variable = (f"run.variable.estimate={estimate}", "run.variable.tolerance=1e-5", "idler_drive.brake=5 N m")
    whole = simulated(tmp_path / "whole.mcap", "rig", "rigid", *RIG, *variable)
    with Log(whole) as log:
        numbers = sorted(step for name in log.attachments if (step := checkpoint_step(name)) is not None)
        out = log.read("/track/out")
        steps = log.closing["steps"]
    assert np.floor(out.t[numbers] / 0.02 + 1e-6).tolist() == [1.0, 2.0, 3.0]
    for at, number in ((0.03, numbers[0]), (0.05, numbers[1])):
        summary = resume(whole, tmp_path / "again.mcap", at)
        assert (summary["status"], summary["communication_steps"]) == ("ok", steps)
        assert digest(tmp_path / "again.mcap") == digest(whole)
        with Log(tmp_path / "again.mcap") as log:
            assert log.metadata["resumed"] == {"of": str(whole), "step": str(number)}
    for kind in (VariableStep, PowerResidual):

        def shorter(pace, scheme, memory, restore=kind.restore_memory):
            half = memory["pace"] * np.where(np.arange(len(memory["pace"])) == 1, 0.5, 1.0)
            restore(pace, scheme, memory | {"pace": half})

        monkeypatch.setattr(kind, "restore_memory", shorter)
    resume(whole, tmp_path / "again.mcap", 0.05)
    assert digest(tmp_path / "again.mcap") != digest(whole), "the twin, whose next step is half as long, must differ"


@pytest.mark.long
@pytest.mark.parametrize("track", [
    "rigid", pytest.param("flexible", marks=pytest.mark.long), pytest.param("native", marks=pytest.mark.study),
])  # fmt: skip
def test_vehicles_go_on(tmp_path, track):
    settings = ("run.stop=0.03", "run.checkpoints=0.01", "expect={}", "drive.ramp_start=0", "run.step=1 ms")
    native = track == "native"
    whole = simulated(tmp_path / "whole.mcap", "straight", "flexible" if native else track, *settings, native=native)
    resume(whole, tmp_path / "again.mcap", 0.01)
    assert digest(tmp_path / "again.mcap") == digest(whole)
    with replay_model.open_replay(tmp_path / "again.mcap", "chassis", None) as again:
        assert again.verify().equal


@pytest.mark.parametrize(
    ("track", "key"), [("rigid", "vehicle.contact.sprocket.damping"), ("flexible", "vehicle.material.youngs_modulus")]
)
def test_a_branch_with_the_same_number_is_the_run_that_was_not_interrupted(tmp_path, track, key):
    whole = simulated(tmp_path / "whole.mcap", "rig", track, *RIG)
    with Log(whole) as log:
        number = reduce(getitem, key.split("."), log.table("scene.json"))
    summary = resume(whole, tmp_path / "same.mcap", 0.02, settings=[f"{key}={number!r}"])
    assert summary["status"] == "ok"
    assert digest(tmp_path / "same.mcap") == digest(whole)
    with Log(tmp_path / "same.mcap") as log:
        assert log.metadata["branched"] == {"of": str(whole), "step": "20", "set": f"{key}={number!r}"}


@pytest.mark.long
def test_a_branch_parts_at_the_step_after_its_checkpoint(rig, tmp_path):
    """A branch with other settings differs from the step after its checkpoint on.

    Stiffer teeth and rims with the same penetration hold 10 % more energy, which no work has put in.
    """
    settings = [f"vehicle.contact.{where}.stiffness=2.2e6" for where in ("sprocket", "wheel")]
    branch = tmp_path / "branch.mcap"
    assert resume(rig, branch, 0.04, settings=settings)["status"] == "ok"
    with Log(rig) as one, Log(branch) as other:
        first = divergence(one, other).first
        assert (first.step, first.variable) == (40, "sprocket.force.x"), "an input of the step that begins there"
        for name in ("track", "drive", "idler_drive"):
            a, b = (log.read(f"/{name}/out").values for log in (one, other))
            assert a[:41].tobytes() == b[:41].tobytes()
            assert a[41].tobytes() != b[41].tobytes()
        assert other.table("scene.json")["vehicle"]["contact"]["wheel"]["stiffness"] == 2.2e6
        held, own = (log.signal("track.energy.contact")[1] for log in (one, other))
        jump = own[41] - own[40]
        assert own[:41].tolist() == held[:41].tolist()
        assert held[41] == pytest.approx(held[40], rel=0.01)
        assert own[41] == pytest.approx(1.1 * held[40], rel=0.01)
        open_by = [ledger(RunData(log)).residual for log in (one, other)]
        assert open_by[1] - open_by[0] == pytest.approx(-jump, rel=0.05)
    with pytest.raises(BadInput), replay_model.open_replay(branch, "track", None):
        pass
    resume(branch, tmp_path / "again.mcap", 0.06, stop=0.07)
    with Log(branch) as log, Log(tmp_path / "again.mcap") as again:
        assert again.metadata["branched"] == log.metadata["branched"]
    resume(branch, tmp_path / "twig.mcap", 0.06, stop=0.07, settings=["idler_drive.brake=0"])
    with Log(branch) as log, Log(tmp_path / "twig.mcap") as twig:
        assert json.loads(twig.metadata["branched"]["before"]) == log.metadata["branched"]


def test_a_branch_may_have_other_obstacles_soil_and_loads():
    """They are numbers of parts; a slope everywhere would be another frame of the start (``test_sentences_log``)."""
    branched_scene(load("half_round"), ["ground.half_round.radius=0.21"], "scene.json")
    branched_scene(load("soft_ground"), ["ground.soil.n=1.2", "hitch.force=2e4"], "scene.json")


def test_a_longer_run_is_that_of_a_longer_scene(rig, tmp_path):
    longer = simulated(tmp_path / "longer.mcap", "rig", "rigid", *RIG, "run.stop=0.1")
    result = resume(rig, tmp_path / "on.mcap", stop=0.1)
    assert digest(tmp_path / "on.mcap") == digest(longer)
    (pace,) = (line for line in summary_text.lines(result) if " simulated in " in line)
    assert "  0.04 of 0.1 s simulated in " in pace  # from 0.06 s on
    with pytest.raises(BadInput, match=r"--at 9: .* ends at 0.06 s"):
        resume(rig, tmp_path / "no.mcap", at=9.0)
    assert not (tmp_path / "no.mcap").exists()


@pytest.mark.long
def test_a_killed_run_goes_on(rig, tmp_path):
    """A killed run resumes: its log ends anywhere, and the steps after the last checkpoint are done again."""
    script = (
        "from pathlib import Path\n"
        "from orchestrator.execution.simulate import simulate\n"
        "from orchestrator.scene.scene import load\n"
        f"simulate(load('rig', 'rigid', {(*RIG, 'run.stop=2')!r}), Path('killed.mcap'))\n"
    )
    process = subprocess.Popen([sys.executable, "-c", script], cwd=tmp_path)
    until = time.monotonic() + 60.0
    killed = tmp_path / "killed.mcap"
    while not (killed.exists() and b"checkpoint/100" in killed.read_bytes()):
        assert time.monotonic() < until
        assert process.poll() is None
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    with Log(killed) as log:
        assert log.closing is None
    whole = simulated(tmp_path / "whole.mcap", "rig", "rigid", *RIG, "run.stop=2")
    resume(killed, tmp_path / "again.mcap")
    assert digest(tmp_path / "again.mcap") == digest(whole)
    assert recover(killed, tmp_path / "saved.mcap").code == RECOVERED
    with Log(tmp_path / "saved.mcap") as log:
        steps = [step for name in log.attachments if (step := checkpoint_step(name)) is not None]
        assert 100 <= max(steps) <= log.closing["steps"]
    resume(tmp_path / "saved.mcap", tmp_path / "third.mcap")
    assert digest(tmp_path / "third.mcap") == digest(whole)


@pytest.mark.long
def test_bytes_that_are_no_checkpoint_are_refused(rig, tmp_path):
    good = Content(rig).attachments[f"{CHECKPOINT}40"]
    other = Content(rig).attachments[f"{CHECKPOINT}20"]
    endless = b'[["at", "<f8", [1' + b"0" * 30 + b"]]]"
    for bad in (
        b"", b"x" * 1000, good[:-100], good[: len(good) // 2], other, good.replace(b"state:drive", b"state:drove"),
        len(endless).to_bytes(8, "little") + endless,
    ):  # fmt: skip
        content = Content(rig)
        content.attachments[f"{CHECKPOINT}40"] = bad
        path = content.write(tmp_path / "bad.mcap")
        with pytest.raises(UnusableCheckpoint):
            resume(path, tmp_path / "new.mcap", 0.05)
        assert not (tmp_path / "new.mcap").exists()


@pytest.mark.long
def test_what_was_warned_of_is_not_forgotten(tmp_path):
    settings = ("run.stop=0.14", "expect={}", 'tracks=["left"]', "track.axes=fixed", "run.checkpoints=0.13")
    whole = simulated(tmp_path / "whole.mcap", "settle", "flexible", *settings)
    resume(whole, tmp_path / "again.mcap")
    with Log(whole) as log, Log(tmp_path / "again.mcap") as again:
        assert len(log.closing["warnings"]) == 1
        assert again.closing["warnings"] == log.closing["warnings"]


def test_a_checkpoint_is_small_and_changes_nothing(rig, tmp_path):
    without = simulated(tmp_path / "without.mcap", "rig", "rigid", *RIG, "run.checkpoints=false")
    assert digest(without) == digest(rig)
    with Log(rig) as log:
        sizes = [len(log.attachment(name)) for name in log.attachments if checkpoint_step(name)]
    assert len(sizes) == 3
    assert max(sizes) < 60_000
