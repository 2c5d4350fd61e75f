"""Ranges of the numbers of a scene, and warnings about implausible values (``fmus/ranges.py``)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fmus.ranges import VEHICLE, PlausibleRange, impossible_sections, range_violations
from orchestrator.scene.wheel_gaps import overlapping_wheels

TURNING = "a sprocket of 0.25 m makes 180 km/h at 200 rad/s"
CLIMBED = "no vehicle climbs more"
SCENE = (
    PlausibleRange("run.stop", "s", (1e-4, 1e4), (1e-9, 1e9), "an hour is ten times as long as a test drive"),
    PlausibleRange(
        "run.step", "s", (1e-6, 0.2), (1e-12, 10.0), "vehicles need milliseconds, what bends slowly some more"
    ),
    PlausibleRange("track.step", "s", (1e-7, 0.02), (1e-12, 10.0), "contacts of links need steps of milliseconds"),
    *(
        range_
        for drive in ("drive", "drive.left", "drive.right", "drive.steering", "idler_drive")
        for range_ in (
            PlausibleRange(f"{drive}.speed", "rad/s", (-200.0, 200.0), (-1e5, 1e5), TURNING),
            PlausibleRange(
                f"{drive}.torque", "N m", (-2e6, 2e6), (-1e11, 1e11), "a sprocket pulls with the weight at most"
            ),
            PlausibleRange(
                f"{drive}.brake", "N m", (0.0, 2e6), (0.0, 1e11), "a sprocket pulls with the weight at most"
            ),
        )
    ),
    PlausibleRange("driver.speed", "m/s", (0.0, 40.0), (0.0, 1e3), "tracks run 20 m/s, a few twice that"),
    PlausibleRange("start.height", "m", (-0.1, 5.0), (-1e6, 1e6), "beyond, it is a crash"),
    *(
        PlausibleRange(f"ground.{key}", "m", (-2.0 if key.endswith("rise") else 0.0, 2.0), possible, CLIMBED)
        for key, possible in {
            "step.rise": (-1e3, 1e3),
            "kerb.rise": (-1e3, 1e3),
            "half_round.radius": (0.0, 1e3),
            "washboard.amplitude": (0.0, 1e3),
        }.items()
    ),
    PlausibleRange("ground.bump.rise", "m", (0.0, 2.0), (0.0, 1e3), CLIMBED),
    PlausibleRange("ground.trench.depth", "m", (0.0, 10.0), (0.0, 1e3), "a tank ditch is 3 m deep"),
    PlausibleRange("ground.trench.width", "m", (0.0, 20.0), (0.0, 1e6), "no vehicle crosses more"),
)


def implausible_numbers(scene: Mapping[str, Any], where: str) -> list[str]:
    """One sentence, beginning with ``where``, for each implausible number of a resolved scene."""
    vehicle = scene.get("vehicle")
    sentences = [*range_violations(scene, SCENE, "plausible")]
    if isinstance(vehicle, Mapping):
        sentences += range_violations(vehicle, VEHICLE, "plausible", "vehicle.")
        sentences += impossible_sections(vehicle)
        sentences += overlapping_wheels(vehicle) if scene.get("assembly") == "vehicle" else ()
    return [f"{where}: {sentence}" for sentence in sentences]
