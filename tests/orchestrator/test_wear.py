"""Wear of pins: growth of the pitch by hand, convergence in the step; a belt is in ``tests/fmus/test_bushing.py``."""

import numpy as np
import pytest
from life_logs import BUSHING, worn

from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results.analyses import wear
from orchestrator.results.run_data import Missing, RunData, Window
from orchestrator.scene.scene import load


def test_growth_of_the_pitch_by_hand(tmp_path):
    with Log(worn(tmp_path / "worn.mcap", BUSHING)) as log:
        found = wear.of(RunData(log), window=Window(2.0, 8.0))
    (track,) = found.tracks
    assert track.travel == pytest.approx(12.0, rel=1e-12)
    assert track.circuits == pytest.approx(60.0)
    assert track.rubbed == pytest.approx([18.0, 30.0])
    volume = 1e-13 * np.array([18.0, 30.0]) / 0.2  # m3
    growth = volume / (2.0 * 0.01 * 0.25) * 1e6 / 12.0
    assert track.growth == pytest.approx(growth, rel=1e-12)
    assert f"vehicle.track.pitch={0.1 + growth.mean():.7g} --set vehicle.sprocket.pitch=0.1" in found.notes()[-1]
    rows = found.table().rows
    assert rows[0][1:4] == pytest.approx((60.0, 3.0 / 60.0, 24.0 / 60.0))
    assert [row[1] for row in found.series().rows] == [1, 2]


def test_what_is_missing_is_said(tmp_path):
    refused = pytest.raises(Missing, match=r"no pin of the vehicle rubs \(vehicle.track.bushing.friction\)")
    with Log(worn(tmp_path / "a.mcap", {**BUSHING, "friction": 0.0})) as log, refused:
        wear.of(RunData(log))
    with Log(worn(tmp_path / "b.mcap", {**BUSHING, "wear": 0.0, "bearing": None})) as log:
        found = wear.of(RunData(log), window=Window(0.0, 0.1))
    assert "needs track.bushing.wear" in found.notes()[-1]
    assert len(found.table().columns) == 4


@pytest.mark.long
def test_wear_of_straight_converges_in_the_step_and_is_the_loss_of_the_ledger(tmp_path):
    settings = ["vehicle.track.bushing={friction=0.15, radius=0.012, wear=1e-13, bearing=0.3}"]
    settings += ['track.link_outputs=["turned", "rubbed"]', "run.stop=4"]
    growths = []
    for h in (1.25e-3, 6.25e-4):
        path = tmp_path / f"{h}.mcap"
        simulate(load("straight", "rigid", [*settings, f"run.step={h}", f"track.step={h}"]), path)
        with Log(path) as log:
            run = RunData(log)
            growths.append([each.growth.mean() for each in wear.of(run, window=Window(2.5, 4.0)).tracks])
            for each in wear.of(run).tracks:
                _, lost = run.signal(f"{each.track}.energy.dissipated.pins", Window(0.0, 4.0))
                assert each.rubbed.sum() == pytest.approx(lost[-1] - lost[0], rel=1e-6)
    assert growths[0] == pytest.approx(growths[1], rel=0.02)
    assert growths[0] != pytest.approx(1.03 * np.array(growths[1]), rel=0.02)
