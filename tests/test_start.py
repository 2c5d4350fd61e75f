"""Every wheel is where its track was laid round it at the start, on both sides and in any pose."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.track.start import drawn
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load


@pytest.mark.long
@pytest.mark.parametrize(
    ("model", "height", "pitch"), [("flexible", 0.0, 0.0), ("rigid", 0.0, 0.0), ("rigid", 2.0, 2.8)]
)
def test_wheels_stand_where_their_tracks_were_laid(tmp_path, model, height, pitch):
    x, y, z, heading = 5.0, -2.0, 0.25, 0.6
    settings = [f"start.position=[{x}, {y}, {z}]", f"start.heading={heading}"]
    settings += [f"start.height={height}", f"start.pitch={pitch}"]
    scene = placed(load("straight", model, [*settings, "run.stop=2.5e-3"]))
    path = tmp_path / "start.mcap"
    simulate(scene, path)
    log = Log(path)
    c, s = np.cos(heading), np.sin(heading)
    checked = 0
    for part in assemble(scene).parts:
        if part.kind.startswith("Track"):
            lateral = part.parameters["start.lateral"]
            for wheel in drawn(part.config["vehicle"], part.config["track"]["wheels"]):
                assert ("start" in wheel) == (height == 0.0), "a raised vehicle must start as drawn"
                ahead, over = wheel["start"][0:3:2] if "start" in wheel else wheel["position"]
                forward = np.cos(pitch) * ahead + np.sin(pitch) * over
                up = np.cos(pitch) * over - np.sin(pitch) * ahead + height
                expected = x + c * forward - s * lateral, y + s * forward + c * lateral, z + up
                for axis, value in zip("xyz", expected, strict=True):
                    series = log.read(f"/{part.name}/in")
                    coordinate = series.values[0, series.names.index(f"{wheel['name']}.position.{axis}")]
                    assert coordinate == pytest.approx(value, abs=1e-9), (part.name, wheel["name"], axis)
                    checked += 1
    assert checked == 2 * 7 * 3


def ended(tmp_path, *settings):
    """Summary and components of a run with rigid links."""
    path = tmp_path / "run.mcap"
    result = simulate(load("settle", "rigid", settings), path)
    assert result["status"] == "ok", result["message"]
    return result, set(result["components"])


@pytest.mark.long
def test_a_side_without_a_track_stands_on_its_wheels(tmp_path):
    result, components = ended(tmp_path, 'tracks=["left"]', "run.stop=1.5")
    assert components == {"left_track", "left_drive", "chassis"}
    seen = result["observables"]
    assert seen["weight"] == pytest.approx(155896.4 - 64 * 18.02 * 9.81, rel=1e-6)
    assert seen["ground_force"] == pytest.approx(seen["weight"], rel=0.02)
    assert abs(result["energy"]["residual_relative"]) < 0.02


@pytest.mark.long
def test_a_vehicle_falls_as_a_whole_until_it_touches(tmp_path):
    """A vehicle falls as a whole by g t^2 / 2 until it touches the ground, also upside down."""
    settings = ("start.height=2.5", "start.pitch=180 deg", "ground.hull=true", "run.step=1 ms", "track.step=1 ms")
    result, _ = ended(tmp_path, *settings, "run.stop=0.3")
    log = Log(tmp_path / "run.mcap")
    heights = [log.signal(f"{name}.energy.gravity")[1] for name in ("chassis", "left_track", "right_track")]
    fallen = sum(height[0] - height[-1] for height in heights) / result["observables"]["weight"]
    assert fallen == pytest.approx(0.5 * 9.81 * 0.3**2, rel=1e-6)
    assert not log.signal("chassis.ground.force.z")[1].any()
    assert not log.signal("left_track.ground.force.z")[1].any()
    ended(tmp_path, "start.height=0.7", "start.pitch=180 deg", "ground.hull=true", "run.stop=0.1")
    assert Log(tmp_path / "run.mcap").signal("chassis.ground.force.z")[1][-1] > 1e4
