"""A run that goes on from a checkpoint is, bit by bit, the run that was not interrupted."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest
from mutated import Content

from orchestrator.cosim.checkpoint import Unusable
from orchestrator.execution import replay_model
from orchestrator.execution.resume import resume
from orchestrator.execution.simulate import simulate
from orchestrator.log.log_format import CHECKPOINT, checkpoint_step
from orchestrator.log.reader import Log
from orchestrator.log.tools import RECOVERED, WHOLE, recover, verify
from orchestrator.scene.scene import load

RIG = ("run.stop=0.06", "run.checkpoints=0.02", "run.links=7", "expect={}", "drive.ramp_start=0")
COUPLINGS = ("tracks_first", "jacobi", "gauss_seidel", "iterative", "energy_corrected")


def ran(path, scene, track, *settings, native=False):
    told = simulate(load(scene, track, settings), path, native=native)
    assert told["status"] == "ok", told["message"]
    return path


def digest(path):
    assert verify(path).code == WHOLE
    with Log(path) as log:
        return log.digest()


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    return ran(tmp_path_factory.mktemp("logs") / "rig.mcap", "rig", "rigid", *RIG)


@pytest.mark.parametrize("coupling", COUPLINGS)
def test_every_coupling_goes_on_as_if_nothing_had_been(tmp_path, coupling):
    whole = ran(tmp_path / "whole.mcap", "rig", "rigid", *RIG, f"run.coupling={coupling}")
    for at, step in ((0.02, 20), (0.05, 40)):
        told = resume(whole, tmp_path / "again.mcap", at)
        assert (told["status"], told["communication_steps"]) == ("ok", 60)
        assert digest(tmp_path / "again.mcap") == digest(whole)
        with Log(tmp_path / "again.mcap") as log:
            assert log.metadata["resumed"] == {"of": str(whole), "step": str(step)}


@pytest.mark.parametrize(
    ("track", "native"),
    [("flexible", False), ("rigid", False), pytest.param("flexible", True, marks=pytest.mark.study)],
)
def test_vehicles_go_on(tmp_path, track, native):
    settings = ("run.stop=0.03", "run.checkpoints=0.01", "expect={}", "drive.ramp_start=0")
    whole = ran(tmp_path / "whole.mcap", "straight", track, "run.step=1 ms", *settings, native=native)
    resume(whole, tmp_path / "again.mcap", 0.01)
    assert digest(tmp_path / "again.mcap") == digest(whole)
    with replay_model.opened(tmp_path / "again.mcap", "chassis", None) as again:
        assert again.verify().equal


def test_a_longer_run_is_that_of_a_longer_scene(rig, tmp_path):
    longer = ran(tmp_path / "longer.mcap", "rig", "rigid", *RIG, "run.stop=0.1")
    resume(rig, tmp_path / "on.mcap", stop=0.1)
    assert digest(tmp_path / "on.mcap") == digest(longer)


def test_a_killed_run_goes_on(rig, tmp_path):
    """Its log ends somewhere; what follows the last checkpoint is done again."""
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
    whole = ran(tmp_path / "whole.mcap", "rig", "rigid", *RIG, "run.stop=2")
    resume(killed, tmp_path / "again.mcap")
    assert digest(tmp_path / "again.mcap") == digest(whole)
    assert recover(killed, tmp_path / "saved.mcap").code == RECOVERED
    with Log(tmp_path / "saved.mcap") as log:
        steps = [step for name in log.attachments if (step := checkpoint_step(name)) is not None]
        assert 100 <= max(steps) <= log.closing["steps"]
    resume(tmp_path / "saved.mcap", tmp_path / "third.mcap")
    assert digest(tmp_path / "third.mcap") == digest(whole)


def test_what_does_not_go_on_is_a_sentence(rig, cotrack, tmp_path):
    def refused(*arguments):
        status, out, err = cotrack("resume", *arguments, "-o", tmp_path / "new.mcap")
        assert (status, out, len(err.splitlines())) == (2, "", 1)
        assert not (tmp_path / "new.mcap").exists()
        return err

    assert f"--at 0.01: the first checkpoint of {rig} is at 0.02 s" in refused(rig, "--at", "0.01")
    assert "stop = 0.02 s is before the checkpoint at 0.06 s" in refused(rig, "--stop", "0.02")
    assert "must be a multiple of step" in refused(rig, "--stop", "0.0705")
    none = ran(tmp_path / "none.mcap", "rig", "rigid", *RIG, "run.checkpoints=false")
    assert "has no checkpoint to go on from" in refused(none)
    chain = ran(tmp_path / "variable.mcap", "rig", "rigid", *RIG, "run.variable.tolerance=1e-2", "run.stop=0.03")
    assert "has no checkpoint to go on from" in refused(chain)
    status, _, err = cotrack("resume", rig, "-o", rig)
    assert (status, "is the log itself" in err) == (2, True)

    content = Content(rig)
    system = json.loads(content.attachments["system.json"])
    system["instances"][0]["sha256"] = "0" * 64
    content.attachments["system.json"] = json.dumps(system).encode()
    assert "made by another build of 'TrackRigid" in refused(content.write(tmp_path / "other.mcap"))


def test_bytes_that_are_no_checkpoint_are_a_sentence(rig, tmp_path):
    good = Content(rig).attachments[f"{CHECKPOINT}40"]
    other = Content(rig).attachments[f"{CHECKPOINT}20"]
    for bad in (
        b"",
        b"x" * 1000,
        good[:-100],
        good[: len(good) // 2],
        other,
        good.replace(b"state:drive", b"state:drove"),
    ):
        content = Content(rig)
        content.attachments[f"{CHECKPOINT}40"] = bad
        path = content.write(tmp_path / "bad.mcap")
        with pytest.raises(Unusable, match="the checkpoint does not fit these components"):
            resume(path, tmp_path / "new.mcap", 0.05)
        assert not (tmp_path / "new.mcap").exists()


def test_what_was_warned_of_is_not_forgotten(tmp_path):
    settings = ("run.stop=0.14", "expect={}", 'tracks=["left"]', "track.axes=fixed", "run.checkpoints=0.13")
    whole = ran(tmp_path / "whole.mcap", "settle", "flexible", *settings)
    resume(whole, tmp_path / "again.mcap")
    with Log(whole) as log, Log(tmp_path / "again.mcap") as again:
        assert len(log.closing["warnings"]) == 1
        assert again.closing["warnings"] == log.closing["warnings"]


def test_a_checkpoint_is_small_and_changes_nothing(rig, tmp_path):
    without = ran(tmp_path / "without.mcap", "rig", "rigid", *RIG, "run.checkpoints=false")
    assert digest(without) == digest(rig)
    with Log(rig) as log:
        sizes = [len(log.attachment(name)) for name in log.attachments if checkpoint_step(name)]
    assert len(sizes) == 3
    assert max(sizes) < 60_000
