"""Runs outside the range of their model say so: reversals, and random plausible settings."""

import pytest
from plausible_settings import AGREES, COUNT, compare_with_half_step, has_warning, row

from orchestrator.execution.simulate import simulate
from orchestrator.scene.scene import load

HALF = ("symmetric=true", "expect={}", "run.stop=2.2 s")
SLOW, AT_ONCE = 0.2, 0.01  # s, from 20 to -20 rad/s


def reversed_in(time, path, *settings):
    """Summary of a vehicle at 20 rad/s whose sprockets reverse within ``time`` s."""
    points = [[0, 0], [1.0, 20], [1.5, 20], [1.5 + time, -20]]
    return simulate(load("straight", "rigid", (*HALF, f"drive.speed_points={points}", *settings)), path)


def kinds(result, severity):
    return {entry["what"] for entry in result["validity"] if entry["severity"] == severity}


@pytest.mark.study
def test_a_reversal_at_once_fails(tmp_path):
    """A reversal within 0.01 s fails: pins 82 mm deep in the teeth, and a chain that jumps."""
    result = reversed_in(AT_ONCE, tmp_path / "a.mcap")
    assert result["status"] == "failed"
    assert kinds(result, "failure") == {"penetration", "tooth_jump"}
    deepest = max(entry["value"] for entry in result["validity"] if entry["what"] == "penetration")
    assert deepest > 0.058
    assert all(1.5 < entry["time"] < 1.75 for entry in result["validity"])


@pytest.mark.study
def test_a_reversal_in_a_fifth_of_a_second_warns(tmp_path):
    """A reversal within 0.2 s warns of a penetration of 33 mm, more than half of a link."""
    result = reversed_in(SLOW, tmp_path / "b.mcap")
    assert (result["status"], result["message"]) == ("ok", "")
    assert kinds(result, "failure") == set()
    assert "penetration" in kinds(result, "warning")


@pytest.mark.study
@pytest.mark.parametrize("case", range(COUNT))
def test_settings_warn_or_agree_with_half_the_step(case, tmp_path):
    comparison = compare_with_half_step(case, tmp_path)
    worst = max(comparison["off"].values(), default=float("inf"))
    assert has_warning(comparison) or worst <= AGREES, row(comparison)
