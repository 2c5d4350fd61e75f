"""The answer of another model beside the recorded one: known differences."""

import made_logs
import numpy as np
import pytest

from fmus.vehicles.tables import BadInput
from orchestrator.log.reader import Log
from orchestrator.results import answer_comparison

T = 0.001 * np.arange(101)
FORCE = 100.0 * np.sin(2.0 * np.pi * 20.0 * T)


def wrote(path, rows, every=1, names=("sprocket.force.x", "none", "own")):
    topic = {"/left_track/out": [(name, "N") for name in names]}
    rows = {"/left_track/out": (T, np.stack(rows, axis=1))}
    return made_logs.made(path, topic, rows, every={"/left_track/out": every})


@pytest.fixture
def made(tmp_path):
    """A log of every second step, and an answer 3 N larger from 40 ms on and 7 N less at 50 ms."""
    now = FORCE + 3.0 * (T > 0.0395)
    now[50] = FORCE[50] - 7.0
    zero, log = np.zeros(len(T)), wrote(tmp_path / "a.mcap", (FORCE, 0 * T, 0 * T + 1.0), every=2)
    return log, wrote(tmp_path / "b.mcap", (now, zero, zero + 1.0), names=("sprocket.force.x", "none", "other"))


def test_peak_rms_and_parting(made):
    with Log(made[0]) as log, Log(made[1]) as answer:
        (comparison,) = answer_comparison.answers(log, answer, "left_track")
    assert (comparison.signal, comparison.unit, len(comparison.t)) == ("sprocket.force.x", "N", 51)
    assert comparison.peak == pytest.approx((-7.0, 0.05))
    assert comparison.parting_time == pytest.approx(0.04)
    assert comparison.largest == pytest.approx(abs(np.append(FORCE[::2], (FORCE + 3.0)[40::2])).max())
    row = answer_comparison.lines([comparison])[1].split()
    n = np.count_nonzero(T[::2] > 0.0395) - 1
    assert float(row[4]) == pytest.approx(np.sqrt((9.0 * n + 49.0) / 51.0), rel=1e-4)
    assert float(row[2]) == pytest.approx(np.sqrt(np.mean(FORCE[::2] ** 2)), rel=1e-4)


def test_what_never_parts_says_so(tmp_path):
    same = wrote(tmp_path / "a.mcap", (FORCE, T, T))
    near = wrote(tmp_path / "b.mcap", (FORCE + 0.99, T, T))
    far = wrote(tmp_path / "c.mcap", (FORCE + 1.05, T, T))
    with Log(same) as log, Log(near) as one, Log(far) as other:
        assert np.isnan(answer_comparison.answers(log, one, "left_track")[0].parting_time)
        assert "never" in answer_comparison.lines(answer_comparison.answers(log, one, "left_track"))[1]
        assert answer_comparison.answers(log, other, "left_track")[0].parting_time == 0.0


def test_the_picture(made, tmp_path):
    with Log(made[0]) as log, Log(made[1]) as answer:
        comparisons = answer_comparison.answers(log, answer, "left_track")
    answer_comparison.draw(comparisons, tmp_path / "x.png", "one & <other> $x$")
    assert (tmp_path / "x.png").stat().st_size > 10_000
    with pytest.raises(BadInput, match=r"x\.nothing cannot be written"):
        answer_comparison.draw(comparisons, tmp_path / "x.nothing", "")
