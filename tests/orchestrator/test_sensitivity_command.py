"""``cotrack sensitivity``: derivatives by exact laws and by full runs, and cells without one."""

from pathlib import Path

import numpy as np
import pytest

from fmus.vehicles.tables import BadInput
from orchestrator.studies import Row, sensitivity

SETTINGS = ("chain.links=8", "run.stop=0.02", "expect={}")
MASS, GRAVITY, SPAN, WIDTH = "vehicle.track.mass", "vehicle.gravity", "chain.span", "vehicle.track.width"


def of(folder, *keys, settings=SETTINGS):
    return sensitivity.sensitivity("hanging_chain", folder, keys, track="rigid", settings=settings)[0]


def derivative(found, key, figure):
    return found.derivatives[list(found.numbers).index(key), list(found.figures).index(figure)]


def test_a_hanging_chain_pulls_in_proportion_to_its_weight(tmp_path):
    """All forces are in proportion to mass and gravity, the sag to neither; the span acts as two runs say."""
    found = of(tmp_path / "s", MASS, GRAVITY, SPAN, WIDTH)
    for name in ("tension_max", "tension_mean", "end_tension"):
        for key in (MASS, GRAVITY):
            assert derivative(found, key, name) == pytest.approx(found.figures[name], rel=1e-4)
            assert derivative(found, key, name) != pytest.approx(1.02 * found.figures[name], rel=1e-4)
        assert derivative(found, WIDTH, name) == 0.0
    assert abs(derivative(found, MASS, "sag")) < 1e-4 * found.figures["sag"]
    low, high = (
        of(tmp_path / f"{span}", WIDTH, settings=(*SETTINGS, f"{SPAN}={span}")).figures for span in (0.796, 0.804)
    )
    for name in ("tension_max", "sag"):
        by_runs = (high[name] - low[name]) / 0.01
        assert derivative(found, SPAN, name) == pytest.approx(by_runs, rel=1e-3)
        assert derivative(found, SPAN, name) != pytest.approx(1.02 * by_runs, rel=1e-3)


def test_a_switch_and_noise_have_no_derivative(tmp_path, monkeypatch):
    """A figure that jumps beside the number, one that jumps behind 0.05 %, and one with noise of 1e-5."""

    def figures(scene, *_):
        x = scene.vehicle.track.mass / 18.02
        noise = 1e-5 * np.sin(1e9 * x)
        known = {
            "tension_max": x**2,
            "tension_mean": 1.0 + (x > 1.0),
            "sag": x + (x > 1.0005),
            "end_tension": x + noise,
        }
        return [Row("", "", {"status": "ok", **known})]

    monkeypatch.setattr(sensitivity, "run_case", figures)
    found = of(tmp_path / "s", MASS)
    assert derivative(found, MASS, "tension_max") == pytest.approx(2.0, rel=1e-3)
    assert np.isnan(derivative(found, MASS, "tension_mean"))
    assert derivative(found, MASS, "sag") == pytest.approx(1.0, rel=1e-6)
    assert derivative(found, MASS, "end_tension") == pytest.approx(1.0, rel=sensitivity.AGREE)
    assert found.steps[0].tolist()[:1] == [1e-4]
    assert found.steps[0, list(found.figures).index("end_tension")] > 1e-4
    assert "rough" in found.table().markdown()


def test_the_command_goes_on_where_it_was_interrupted(cotrack, monkeypatch):
    settings = [part for text in SETTINGS for part in ("--set", text)]
    asked = "sensitivity", "hanging_chain", "--track", "rigid", *settings, "--of", MASS, "--workers", "1", "-o", "s"
    out = cotrack.done(*asked, "--for", "max:chain.tension.max")
    assert f"| {MASS} | 18.02 | 7." in out
    assert Path("s/sensitivity.png").stat().st_size > 5_000

    def none(*_):
        raise AssertionError("a run that is finished is not made again")

    monkeypatch.setattr("orchestrator.studies.parameter_sweep.simulate", none)
    assert cotrack.done(*asked, "--for", "max:chain.tension.max") == out


def test_all_numbers_of_a_vehicle_by_default():
    found = sensitivity._numbers(sensitivity.load("straight", "rigid"), ())
    assert {"vehicle.suspension.stiffness", "vehicle.road_wheel.x.1", "vehicle.contact.ground.friction"} <= {*found}
    assert not [key for key in found if key.startswith("vehicle.life")]
    assert all(found.values())


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("vehicle.track.mas", "--of vehicle.track.mas: hanging_chain.toml has no such number"),
        ("start.heading", "--of start.heading: is 0 in hanging_chain.toml, and one per cent of it is 0"),
    ],
)
def test_a_number_without_a_per_cent_is_refused(tmp_path, key, said):
    with pytest.raises(BadInput) as refused:
        of(tmp_path / "s", key)
    assert str(refused.value).startswith(said)
    assert not (tmp_path / "s").exists()
