"""Claims of fmus/coupling.md on masters that copy the latest outputs before each step."""

from contextlib import ExitStack

import pytest

from orchestrator.cosim.coupling.tracks_first import TracksFirst
from orchestrator.cosim.graph import wire
from orchestrator.execution.loading import load_scene
from orchestrator.scene.scene import load

STEP, STOP = 2e-3, 4.0  # s
SETTINGS = ("run.step=2 ms", "run.stop=4 s", "drive.ramp_start=0 s", "drive.ramp_time=3 s")


class Latest(TracksFirst):
    """Master that gives each component the latest outputs of the others."""

    def rule(self, feed, source_stepped):
        return "end" if source_stepped else "start"


def mean_tension(stages=None):
    """Mean link tension of the left track at speed, N; ``stages``: order of the steps, None: that of cotrack."""
    with ExitStack() as stack:
        _, graph, components = load_scene(load("straight", "rigid", SETTINGS), stack, None)
        if stages:
            instances = (i._replace(stage=stages.index(i.name.split("_")[-1])) for i in graph.instances)
            graph = graph._replace(instances=tuple(instances))
        track, samples = components["left_track"], []
        with (Latest if stages else TracksFirst)(wire(graph, components)) as scheme:
            for k in range(round(STOP / STEP)):
                scheme.advance(k * STEP, STEP)
                if (k + 1) * STEP > STOP - 0.5:
                    samples.append(track.y[track.outputs.index("tension.mean")])
        assert components["chassis"].y[components["chassis"].outputs.index("speed")] == pytest.approx(4.9, abs=0.1)
    return sum(samples) / len(samples)


@pytest.mark.long
def test_a_track_must_see_its_wheels_at_one_instant():
    right = mean_tension()
    assert mean_tension(("track", "drive", "chassis")) == right
    for wrong in (("drive", "track", "chassis"), ("chassis", "drive", "track")):
        assert mean_tension(wrong) / right == pytest.approx(1.08, abs=0.02), wrong
