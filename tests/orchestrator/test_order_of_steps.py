"""Claims of fmus/coupling.md on masters that copy the latest outputs before each step."""

from contextlib import ExitStack

import pytest

from orchestrator.cosim.coupling.tracks_first import TracksFirst
from orchestrator.cosim.graph import wire
from orchestrator.execution.loading import load_scene
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load

STEP, STOP, WINDOW = 2e-3, 3.5, 0.5  # s
SETTINGS = ("run.step=2 ms", "run.stop=3.5 s", "drive.ramp_start=0 s", "drive.ramp_time=3 s")


class Latest(TracksFirst):
    """Master that gives each component the latest outputs of the others."""

    def rule(self, feed, source_stepped):
        return "end" if source_stepped else "start"


def mean_tension(coupling, order):
    """Mean link tension of the left track at 4.9 m/s, N; ``order``: stages of track, drive and chassis."""
    stages = dict(zip(("track", "drive", "chassis"), order, strict=True))
    with ExitStack() as stack:
        scene = load("straight", "rigid", SETTINGS)
        _, graph, components = load_scene(scene, assemble(scene), stack, None)
        instances = (each._replace(stage=stages[each.name.split("_")[-1]]) for each in graph.instances)
        track, chassis, samples = components["left_track"], components["chassis"], []
        with coupling(wire(graph._replace(instances=tuple(instances)), components)) as scheme:
            for k in range(round(STOP / STEP)):
                scheme.advance(k * STEP, STEP)
                if (k + 1) * STEP > STOP - WINDOW:
                    samples.append(track.y[track.outputs.index("tension.mean")])
        assert chassis.y[chassis.outputs.index("speed")] == pytest.approx(4.9, abs=0.1)
    return sum(samples) / len(samples)


@pytest.mark.study
def test_a_track_must_see_its_wheels_at_one_instant():
    right = mean_tension(TracksFirst, (0, 1, 2))
    assert mean_tension(Latest, (0, 1, 2)) == right
    assert mean_tension(Latest, (0, 0, 0)) == pytest.approx(right, rel=2e-3)
    for wrong in ((1, 0, 2), (2, 1, 0)):  # drives before tracks
        assert mean_tension(Latest, wrong) / right == pytest.approx(1.17, abs=0.02), wrong
