"""The log of a short run of the rig with checkpoints."""

from orchestrator.execution.simulate import simulate
from orchestrator.scene.scene import load

RIG = ("run.stop=0.06", "run.checkpoints=0.02", "run.links=7", "expect={}", "drive.ramp_start=0")


def ran(path, scene, track, *settings, native=False):
    """Log of a run that ended well."""
    summary = simulate(load(scene, track, settings), path, native=native)
    assert summary["status"] == "ok", summary["message"]
    return path


def rig_log(tmp_path_factory):
    """Log of the rig with three checkpoints."""
    return ran(tmp_path_factory.mktemp("logs") / "rig.mcap", "rig", "rigid", *RIG)
