"""The command view."""

from decimal import Decimal

import numpy as np
import pytest
from short_run import SHORT

from fmus.vehicles.tables import BadInput
from orchestrator.log.reader import Log
from orchestrator.results.run_data import RunData
from orchestrator.results.views import flat_views
from orchestrator.results.views.bodies import EVERY, Bodies
from orchestrator.scene.scene import load


@pytest.mark.parametrize(("step", "refused"), [("0.3e-3", 557), ("0.7e-3", 71), ("1e-3", 0)])
def test_view_takes_the_end_as_it_is_written(step, refused):
    """View accepts the end as printed, which rounding puts above the last record for some k H."""
    above = 0
    for k in range(1, 1001):
        recorded = np.arange(k + 1) * float(step)
        end = float(k * Decimal(step))
        above += end > recorded[-1]
        assert flat_views._moving_instants(recorded, recorded[-1], [end]) == [recorded[k]]
        assert flat_views._moving_instants(recorded, recorded[-1], None)[-1] == recorded[k]
        with pytest.raises(BadInput, match=f"from 0 to {end:.9g} s"):
            flat_views._moving_instants(recorded, recorded[-1], [end + 1e-3 * float(step)])
    assert above == refused


@pytest.mark.long
def test_view_draws(cotrack, tmp_path):
    assert cotrack(*SHORT, "--log", "a.mcap")[0] == 0
    assert cotrack("view", "a.mcap", "-o", "a.png")[0] == 0
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    assert "cannot be written" in cotrack.refused("view", "a.mcap", "-o", "nowhere/a.png")
    assert "it is a directory" in cotrack.refused("view", "a.mcap", "-o", ".")
    assert cotrack(*SHORT, "--log", "b.mcap", "--set", "track.link_outputs=false")[0] == 0
    cut = (tmp_path / "a.mcap").read_bytes()
    with Log("a.mcap") as log:
        (tmp_path / "cut.mcap").write_bytes(cut[: next(iter(log._file.spans))])
    assert "cut.mcap holds no links to draw" in cotrack.refused("view", "cut.mcap", "-o", "cut.png")
    assert "from 0 to 0.02 s" in cotrack.refused("view", "a.mcap", "--at", "0.03", "-o", "b.png")
    assert not (tmp_path / "b.png").exists()


@pytest.mark.long
def test_view_from_above(cotrack, tmp_path):
    brief = ("run", "turn", "--track", "rigid", "--stop", "0.02", "--no-estimate")
    assert cotrack(*brief, "--log", "a.mcap")[0] in (0, 1)
    status, out, err = cotrack("view", "a.mcap", "--above", "-o", "a.png")
    assert (status, out) == (0, "a.png\n"), err
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    with Log("a.mcap") as log:
        bodies = Bodies(RunData(log), EVERY)
        bodies.select_instants([0.0, 0.02])
        views = [flat_views.top_view(bodies, poses) for poses in bodies.blocks(1)]
        whole = [log.signal(f"left_track.ground.force.{axis}")[1] for axis in "xy"]
    corners = np.concatenate(views[1].links)
    left = corners[corners[:, 1] > 0.0]
    assert np.ptp(left[:, 0]) == pytest.approx(4.5, abs=0.3)  # as long as a track, as wide as a link
    assert [left[:, 1].min(), left[:, 1].max()] == pytest.approx([1.0795 - 0.189, 1.0795 + 0.189], abs=1e-3)
    force = [view.force[:64] for view in views]
    assert [view.feet.shape for view in views] == [(128, 2), (128, 2)]
    every = load("turn", "rigid").links_every  # steps over which link forces are averaged
    for k, rows in ((0, slice(1)), (1, slice(21 - every, 21))):
        assert force[k].sum(axis=0) == pytest.approx([part[rows].mean() for part in whole], abs=1e-6)
    assert "from 0 to 0.02 s" in cotrack("view", "a.mcap", "--above", "--at", "1", "-o", "b.png")[2]
    assert cotrack(*SHORT, "--log", "chain.mcap")[0] == 0
    short = ("--set", "track.link_outputs=false", "--log", "short.mcap")
    assert cotrack(*brief, *short)[0] in (0, 1)
    assert "short.mcap holds no vehicle" in cotrack("view", "short.mcap", "--above", "-o", "d.png")[2]
    status, _, err = cotrack("view", "chain.mcap", "--above", "-o", "c.png")
    assert (status, "chain.mcap holds no 'chassis.yaw'" in err) == (2, True)
