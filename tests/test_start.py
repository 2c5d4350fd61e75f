"""At the start every wheel is where its track was laid out round it, on both sides and at any pose."""

from __future__ import annotations

import numpy as np
import pytest

from orchestrator.reader import Log
from orchestrator.scene import load
from orchestrator.simulate import simulate
from orchestrator.system import assemble, placed


@pytest.mark.parametrize("model", ["flexible", "rigid"])
def test_wheels_stand_where_their_tracks_were_laid(tmp_path, model):
    x, y, z, heading = 5.0, -2.0, 0.25, 0.6
    settings = [f"start.position=[{x}, {y}, {z}]", f"start.heading={heading}"]
    scene = placed(load("straight", model, [*settings, "run.stop=2e-3"]))
    path = tmp_path / "start.mcap"
    simulate(scene, path)
    log = Log(path)
    c, s = np.cos(heading), np.sin(heading)
    checked = 0
    for part in assemble(scene).parts:
        if part.kind.startswith("Track"):
            lateral = part.parameters["start.lateral"]
            for wheel in part.config["track"]["wheels"]:
                forward, up = wheel["position"]
                expected = x + c * forward - s * lateral, y + s * forward + c * lateral, z + up
                for axis, value in zip("xyz", expected, strict=True):
                    series = log.read(f"/{part.name}/in")
                    found = series.values[0, series.names.index(f"{wheel['name']}.position.{axis}")]
                    assert found == pytest.approx(value, abs=1e-9), (part.name, wheel["name"], axis)
                    checked += 1
    assert checked == 2 * 7 * 3
