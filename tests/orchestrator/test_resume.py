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

from fmus.vehicles.tables import BadInput
from orchestrator.cosim.checkpoint import UnusableCheckpoint
from orchestrator.cosim.coupling import SCHEMES
from orchestrator.cosim.coupling.power_residual import PowerResidual
from orchestrator.cosim.coupling.variable_step import VariableStep
from orchestrator.cosim.observers import TimedCheckpoints
from orchestrator.execution import replay_model
from orchestrator.execution.resume import branched_scene, resume
from orchestrator.execution.simulate import simulate
from orchestrator.log.log_metadata import CHECKPOINT, checkpoint_step
from orchestrator.log.reader import Log
from orchestrator.log.tools import RECOVERED, WHOLE, recover, verify
from orchestrator.results.divergence import divergence
from orchestrator.results.energy import ledger
from orchestrator.results.run_data import RunData
from orchestrator.scene.scene import load

RIG = ("run.stop=0.06", "run.checkpoints=0.02", "run.links=7", "expect={}", "drive.ramp_start=0")


def ran(path, scene, track, *settings, native=False):
    summary = simulate(load(scene, track, settings), path, native=native)
    assert summary["status"] == "ok", summary["message"]
    return path


@pytest.mark.parametrize(
    ("t", "due"), [(0.0, 0.1), (0.3 - 1e-12, 0.4), (0.3, 0.4), (0.3 + 1e-12, 0.4), (0.35, 0.4), (0.299, 0.3)]
)
def test_a_checkpoint_is_due_once_at_each_multiple_of_the_period(t, due):
    """A time that rounding puts beside a multiple counts as that multiple."""
    checkpoints = TimedCheckpoints(None, None, None, period=0.1, every=1, start=t)
    assert checkpoints._due == pytest.approx(due, rel=1e-12)


def digest(path):
    assert verify(path).code == WHOLE
    with Log(path) as log:
        return log.digest()


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    return ran(tmp_path_factory.mktemp("logs") / "rig.mcap", "rig", "rigid", *RIG)


@pytest.mark.long
@pytest.mark.parametrize("coupling", SCHEMES)
def test_every_coupling_goes_on_as_if_nothing_had_been(tmp_path, coupling):
    whole = ran(tmp_path / "whole.mcap", "rig", "rigid", *RIG, f"run.coupling={coupling}")
    for at, step in ((0.02, 20), (0.05, 40)):
        summary = resume(whole, tmp_path / "again.mcap", at)
        assert (summary["status"], summary["communication_steps"]) == ("ok", 60)
        assert digest(tmp_path / "again.mcap") == digest(whole)
        with Log(tmp_path / "again.mcap") as log:
            assert log.metadata["resumed"] == {"of": str(whole), "step": str(step)}


def forget(pace, scheme, memory):
    """Forget the lengths of past steps, as at a start (twin)."""
    pace._start = pace._start._replace(t=float(memory["pace"][0]))


@pytest.mark.long
@pytest.mark.parametrize("estimate", ["doubling", "power"])
def test_variable_steps_go_on(tmp_path, monkeypatch, estimate):
    """A run with variable steps resumes with the same steps, from checkpoints where they allow it."""
    variable = (f"run.variable.estimate={estimate}", "run.variable.tolerance=1e-5")
    whole = ran(tmp_path / "whole.mcap", "rig", "rigid", *RIG, *variable)
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
        monkeypatch.setattr(kind, "restore_memory", forget)
    resume(whole, tmp_path / "again.mcap", 0.05)
    assert digest(tmp_path / "again.mcap") != digest(whole), "the twin, which forgets the step lengths, must differ"


@pytest.mark.parametrize(
    ("track", "native"),
    [("flexible", False), ("rigid", False), pytest.param("flexible", True, marks=pytest.mark.study)],
)
def test_vehicles_go_on(tmp_path, track, native):
    settings = ("run.stop=0.03", "run.checkpoints=0.01", "expect={}", "drive.ramp_start=0")
    whole = ran(tmp_path / "whole.mcap", "straight", track, "run.step=1 ms", *settings, native=native)
    resume(whole, tmp_path / "again.mcap", 0.01)
    assert digest(tmp_path / "again.mcap") == digest(whole)
    with replay_model.open_replay(tmp_path / "again.mcap", "chassis", None) as again:
        assert again.verify().equal


@pytest.mark.parametrize(
    ("track", "key"), [("rigid", "vehicle.contact.sprocket.damping"), ("flexible", "vehicle.material.youngs_modulus")]
)
def test_a_branch_with_the_same_number_is_the_run_that_was_not_interrupted(tmp_path, track, key):
    whole = ran(tmp_path / "whole.mcap", "rig", track, *RIG)
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
    with (
        pytest.raises(BadInput, match="has other numbers from step 40 on"),
        replay_model.open_replay(branch, "track", None),
    ):
        pass
    resume(branch, tmp_path / "again.mcap", 0.06, stop=0.07)
    with Log(branch) as log, Log(tmp_path / "again.mcap") as again:
        assert again.metadata["branched"] == log.metadata["branched"]
    resume(branch, tmp_path / "twig.mcap", 0.06, stop=0.07, settings=["idler_drive.brake=0"])
    with Log(branch) as log, Log(tmp_path / "twig.mcap") as twig:
        assert json.loads(twig.metadata["branched"]["before"]) == log.metadata["branched"]


@pytest.mark.long
def test_what_does_not_branch_off_is_a_sentence(rig, cotrack, tmp_path):
    for setting, said in (
        ("run.step=0.5 ms", "run.step stays as it is"),
        ("run.links=1", "run.links stays as it is"),
        ("track.link_outputs=all", "track.link_outputs stays as it is"),
        ("idler_drive.mode=speed", "idler_drive.mode stays as it is"),
        ("vehicle.gravitty=1", "unknown key 'vehicle.gravitty'"),
    ):
        status, out, err = cotrack("resume", rig, "--set", setting, "-o", tmp_path / "new.mcap")
        assert (status, out) == (2, "")
        assert said in err.splitlines()[-1]
        assert not (tmp_path / "new.mcap").exists()
    short = ("run.stop=0.02", "run.checkpoints=0.01", "chain.links=8", "expect={}")
    chain = ran(tmp_path / "chain.mcap", "hanging_chain", "flexible", *short)
    said = "with --set chain.links=9 the state of 'chain' has another size"
    with pytest.raises(UnusableCheckpoint, match=said):
        resume(chain, tmp_path / "new.mcap", 0.01, settings=["chain.links=9"])


@pytest.mark.parametrize(
    ("name", "setting", "kept"),
    [
        ("climb", "ground.grade=0.3", "ground.grade"),
        ("soft_ground", "start.position=[1, 0, 0]", "start.position"),
        ("half_round", "ground.half_round.radius=0.21", ""),
        ("soft_ground", "ground.soil.n=1.2", ""),
        ("soft_ground", "hitch.force=2e4", ""),
    ],
)
def test_a_branch_keeps_the_axes_of_the_start(name, setting, kept):
    """A slope everywhere is another frame of the start; obstacles, soil and loads are numbers of parts."""
    scene = load(name)
    if not kept:
        branched_scene(scene, [setting], "scene.json")
        return
    with pytest.raises(BadInput, match=f"{kept} stays as it is: the states of the parts count from the place"):
        branched_scene(scene, [setting], "scene.json")


def test_a_longer_run_is_that_of_a_longer_scene(rig, tmp_path):
    longer = ran(tmp_path / "longer.mcap", "rig", "rigid", *RIG, "run.stop=0.1")
    resume(rig, tmp_path / "on.mcap", stop=0.1)
    assert digest(tmp_path / "on.mcap") == digest(longer)


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
    status, _, err = cotrack("resume", rig, "-o", rig)
    assert (status, "cannot be written: it is a file that is read" in err) == (2, True)

    content = Content(rig)
    system = json.loads(content.attachments["system.json"])
    system["instances"][0]["sha256"] = "0" * 64
    content.attachments["system.json"] = json.dumps(system).encode()
    assert "made by another build of 'TrackRigid" in refused(content.write(tmp_path / "other.mcap"))


@pytest.mark.long
def test_bytes_that_are_no_checkpoint_are_a_sentence(rig, tmp_path):
    good = Content(rig).attachments[f"{CHECKPOINT}40"]
    other = Content(rig).attachments[f"{CHECKPOINT}20"]
    endless = b'[["at", "<f8", [1' + b"0" * 30 + b"]]]"
    for bad in (
        b"",
        b"x" * 1000,
        good[:-100],
        good[: len(good) // 2],
        other,
        good.replace(b"state:drive", b"state:drove"),
        len(endless).to_bytes(8, "little") + endless,
    ):
        content = Content(rig)
        content.attachments[f"{CHECKPOINT}40"] = bad
        path = content.write(tmp_path / "bad.mcap")
        with pytest.raises(UnusableCheckpoint, match="the checkpoint does not fit these components"):
            resume(path, tmp_path / "new.mcap", 0.05)
        assert not (tmp_path / "new.mcap").exists()


@pytest.mark.long
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
