"""Errors of runs against the truth of their scene, by the steps of the baseline, over windows of minutes at most."""

from __future__ import annotations

from typing import NamedTuple

from orchestrator.execution.truth import ORDER, truth
from orchestrator.results.difference import differences_of_logs
from orchestrator.scene.scene import load
from orchestrator.studies.growth import THEN
from orchestrator.studies.runs import logged, sampled


class Window(NamedTuple):
    """A scene, from its beginning to ``stop`` s."""

    scene: str
    track: str
    stop: float
    settings: tuple[str, ...] = ()
    seconds: float = 30.0  # that its truth takes, roughly

    @property
    def name(self) -> str:
        """In words."""
        return f"{self.scene}, {self.track}, {self.stop:g} s"


# no long rest before; no friction beyond that of the ground
EARLY = ("drive.ramp_start=0.2 s", "drive.ramp_time=2 s", *THEN)
WINDOWS = (
    Window("straight", "flexible", 2.0, EARLY, 150.0),
    Window("straight", "rigid", 2.0, EARLY, 60.0),
    Window("hard_stop", "flexible", 2.0, (), 150.0),
    Window("hard_stop", "rigid", 2.0, (), 60.0),
    Window("settle", "flexible", 0.3, THEN),
    Window("settle", "rigid", 0.3, THEN),
    Window("rig", "flexible", 1.0, ("drive.ramp_time=0.5 s",), 60.0),
    Window("rig", "rigid", 1.0, ("drive.ramp_time=0.5 s",)),
    Window("sprocket_bench", "flexible", 0.5),
    Window("sprocket_bench", "rigid", 0.5),
    Window("hanging_chain", "flexible", 0.3, ("track.start=displaced",)),
    Window("hanging_chain", "rigid", 0.3, ("track.start=displaced",)),
    Window("released_chain", "flexible", 0.3),
    Window("released_chain", "rigid", 0.3),
)


def errors(window: Window) -> dict[str, dict[str, float]]:
    """Relative error of the run by observable, and how far the truth itself can be doubted.

    Builds the truth where the cache has none. Raises TruthFailed, BadInput, ComponentFailed or RuntimeError.
    """
    scene = load(window.scene, window.track, [f"run.stop={window.stop}", *window.settings])
    exact = truth(scene)
    with logged(sampled(scene), window.name) as path:
        off = differences_of_logs(path, exact.log)
    share = 1.0 / (2.0**ORDER - 1.0)
    return {
        name: {"error": one.relative, "doubt": share * exact.difference[name].relative} for name, one in off.items()
    }
