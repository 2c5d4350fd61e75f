"""Short runs of scenes, by commands and as logs; tests of one process share some of them."""

import json

from orchestrator.execution.simulate import simulate
from orchestrator.scene.scene import load

SHORT = ("run", "hanging_chain", "--stop", "0.02", "--json")


def last(out):
    """JSON object in the last line of an output."""
    return json.loads(out.splitlines()[-1])


RIG = ("run.stop=0.06", "run.checkpoints=0.02", "run.links=7", "expect={}", "drive.ramp_start=0")


def simulated(path, scene, track, *settings, native=False):
    """Log of a run that ended well."""
    summary = simulate(load(scene, track, settings), path, native=native)
    assert summary["status"] == "ok", summary["message"]
    return path


def rig_log(tmp_path_factory):
    """Log of the rig with three checkpoints."""
    return simulated(tmp_path_factory.mktemp("logs") / "rig.mcap", "rig", "rigid", *RIG)


CHAIN = ("run.stop=0.02", "chain.links=8", "run.links=7", "expect={}")


def chain_log(tmp_path_factory):
    """Log of a hanging chain of eight links."""
    return simulated(tmp_path_factory.mktemp("replay") / "chain.mcap", "hanging_chain", "flexible", *CHAIN)


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


STEP = 1e-3
WHAT_RUNS = (
    f"run.step={STEP}", "run.links=1", "expect={}", "start.state=drawn", "start.heading=0.4",
    "start.position=[1.0, -2.0, 0.3]",
    'track.link_outputs=["tension", "position", "ground", "sliding", "depth", "axis"]',
)  # fmt: skip
LOW_BUMP = "ground.bump={start=-2.4, rise=0.01, slope=0.1, length=0.5, radius=0.02}"
TERRAIN = "ground.grade=0.2", "ground.bank=-0.1", "ground.half_round={x=[-1.0], radius=0.05}"
RAN = {}  # by scene, model and settings


def ran(tmp_path_factory, name, model, settings):
    """Log of a run, which all modules of a process share."""
    key = name, model, tuple(settings)
    if key not in RAN:
        RAN[key] = tmp_path_factory.mktemp(name) / "run.mcap"
        simulate(load(name, model, settings), RAN[key])
    return RAN[key]


def settling_log(tmp_path_factory):
    """Log of a vehicle that settles on a low bump, turned by 0.4 rad; links are recorded at each step."""
    return ran(tmp_path_factory, "straight", "flexible", (*WHAT_RUNS, "run.stop=0.04", LOW_BUMP))


def terrain_log(tmp_path_factory):
    """Log of a vehicle of rigid links that falls on a slope, banked, with a half round under its wheels."""
    return ran(tmp_path_factory, "straight", "rigid", (*WHAT_RUNS, "run.stop=0.02", *TERRAIN))


def hanging_log(tmp_path_factory):
    """Log of an open chain, without wheels, hull and ground."""
    settings = ("run.stop=0.02", "chain.links=8", "run.links=5", "expect={}")
    return ran(tmp_path_factory, "hanging_chain", "flexible", settings)


# the vehicle falls onto its springs, so that there is motion
BUMP = "ground.bump={start=0.5, rise=0.2, slope=0.35, length=0.6, radius=0.15}"
FALLING = ["run.stop=0.06 s", "start.state=drawn", BUMP]
CHECKS = ("sag", "sag_discrete", "tension", "tension_discrete")
CHECKED = ["run.stop=0.02 s", *(f"expect.{name}.{end}" for name in CHECKS for end in ("from=0 s", "to=0.02 s"))]


def falling_log(tmp_path_factory):
    """Log of a vehicle of rigid links that falls onto its springs."""
    return ran(tmp_path_factory, "straight", "rigid", FALLING)


def checked_log(tmp_path_factory, *settings):
    """Log of a short run of a hanging chain, with its checks."""
    return ran(tmp_path_factory, "hanging_chain", "flexible", [*CHECKED, *settings])
