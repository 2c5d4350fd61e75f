"""Two short runs for tests of analyses."""

from orchestrator.execution.simulate import simulate
from orchestrator.scene.scene import load

GROUPS = "['tension', 'position', 'force', 'ground', 'fibres', 'slopes']"


def driven_log(tmp_path_factory):
    """The left half of a vehicle that drives off at once, with heading 0.6 rad."""
    settings = (
        "run.stop=0.2 s", "drive.ramp_start=0 s", "drive.ramp_time=0.15 s", "drive.speed=6 rad/s", "symmetric=true",
        "start.heading=0.6", "seats=['driver']", f"track.link_outputs={GROUPS}",
    )  # fmt: skip
    path = tmp_path_factory.mktemp("analyses") / "driven.mcap"
    assert simulate(load("straight", "flexible", settings), path)["message"] == ""
    return path


def spinning_log(tmp_path_factory):
    """A log of the free loop that spins."""
    path = tmp_path_factory.mktemp("analyses") / "spinning.mcap"
    assert simulate(load("spinning_loop", "flexible", ("run.stop=0.05 s", "run.links=20")), path)["message"] == ""
    return path
