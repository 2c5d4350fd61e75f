"""``cotrack warm``: starts of scenes in processes of their own."""

import signal
import subprocess
import sys
from contextlib import ExitStack

import pytest

from fmus.fmi.build import BuildFailed
from fmus.track.choices import TRACKS
from fmus.vehicles.tables import BadInput
from orchestrator.execution import loading, warm
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load


def test_the_gallery_s_vehicles_and_chains_with_both_tracks():
    variants = warm.variants()
    assert {("straight", "flexible"), ("straight", "rigid"), ("hanging_chain", "rigid")} <= set(variants)


def test_an_unknown_scene_is_refused():
    with pytest.raises(BadInput, match="no scene 'strait'"):
        warm.variants(["strait"])


@pytest.mark.parametrize(
    ("scene", "track", "compiled"),
    [
        ("straight", "flexible", [[], ["Chassis", "SprocketDrive", "TrackFlexible"]]),
        ("straight", "rigid", [["TrackRigid"], ["Chassis", "SprocketDrive"]]),
        ("hanging_chain", "flexible", [[], []]),
    ],
)
def test_kernels_are_compiled_beside_with_the_step_of_cables_last(monkeypatch, scene, track, compiled):
    kinds = []
    monkeypatch.setattr(
        loading, "start_compilation", lambda parts, patience=0: kinds.append([kind for kind, _, _ in parts])
    )
    loading._compile_in_processes(assemble(load(scene, track)).parts)
    assert kinds == compiled


@pytest.mark.long
def test_scenes_begin_and_say_how_long_it_took(environment):
    """Scenes start and report their time, from a process that has loaded no FMU.

    Processes that it spawns would otherwise find the packages of its FMUs.
    """
    command = [sys.executable, "-m", "orchestrator", "warm", "hanging_chain"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
    lines = sorted(line.partition(" ")[2] for line in done.stdout.splitlines())
    assert [line.partition(":")[0] for line in lines] == [f"hanging_chain, {track}" for track in sorted(TRACKS)]
    assert all(": starts after " in line for line in lines)


@pytest.mark.parametrize("error", [KeyboardInterrupt, BuildFailed])
def test_a_start_that_fails_ends_the_processes_that_compile(monkeypatch, error):
    def fail(scene):
        raise error

    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    monkeypatch.setattr(loading, "_compile_in_processes", lambda parts: [process])
    monkeypatch.setattr(loading, "placed", fail)
    with pytest.raises(error), ExitStack() as stack:
        loading.load_scene(scene := load("settle"), assemble(scene), stack, None)
    assert process.returncode == -signal.SIGTERM
