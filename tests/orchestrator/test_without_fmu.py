"""Scenes without an FMU: the same command, log and summary; what they cannot do is said."""

import json

import numpy as np
import pytest
from test_cli import KEYS

from orchestrator.cosim.component import ComponentFailed
from orchestrator.log.reader import Log
from orchestrator.log.tools import WHOLE, verify
from orchestrator.results.measures import energy_drift
from orchestrator.results.run_data import Missing, RunData, Window
from orchestrator.scene.scene import load
from orchestrator.without_fmu.models import ModelComponent, model_of


def stepped(name, *settings):
    scene = load(name, None, settings)
    return ModelComponent(scene.assembly, model_of(scene))


def test_a_model_without_fmu_is_run_logged_and_summed_up_like_a_system(cotrack, tmp_path):
    status, out, err = cotrack("run", "elastica", "--set", "run.stop=1", "--json")
    assert status == 0, err
    result = json.loads(out.splitlines()[-1])
    assert set(result) == KEYS
    assert result["track"] is None
    assert (result["status"], result["communication_steps"]) == ("ok", 20)
    assert set(result["checks"]) == {"alpha_1", "energy"}
    assert result["components"]["cantilever"]["steps"] == 20
    path = tmp_path / "logs" / "elastica.mcap"
    assert verify(path).code == WHOLE
    with Log(path) as log:
        assert set(log.topics) == {
            "/cantilever/in",
            "/cantilever/out",
            "/cantilever/links",
            "/stats/cantilever",
        }
        ends = log.read("/cantilever/links")
        assert ends.names[-1] == "point[17].position.z"
        assert ends.values[-1, -1] == log.signal("cantilever.tip.displacement.z")[1][-1]
        with pytest.raises(Missing, match="no kinetic energy"):
            energy_drift(RunData(log), "", Window(0.0, 1.0))
    status, out, _ = cotrack("run", "elastica", "--stop", "0.1")
    assert out.startswith("elastica: ok; 1 of 1 checks are met\n  0.1 s simulated")


def test_what_needs_an_fmu_or_a_track_is_refused(cotrack):
    cotrack("run", "l_frame", "--stop", "0.1")
    for arguments, said in (
        (("run", "l_frame", "--track", "rigid"), "scene 'l_frame' has no track"),
        (("build", "l_frame", "-o", "x"), "scene 'l_frame' needs no FMU"),
        (
            ("replay", "logs/l_frame.mcap", "--component", "frame"),
            "'frame' of the log was stepped without an FMU",
        ),
        (("view", "logs/l_frame.mcap", "-o", "x.png"), "l_frame.mcap holds no links to draw"),
    ):
        status, _, err = cotrack(*arguments)
        assert status == 2
        assert said in err
        assert len(err.splitlines()) == 1


def test_a_model_without_fmu_that_cannot_go_on_ends_its_run_in_one_sentence(cotrack, tmp_path):
    status, out, _ = cotrack("run", "flexible_pendulum", "--set", "pendulum.step=2 ms", "--stop", "0.2", "--json")
    assert status == 1
    result = json.loads(out.splitlines()[-1])
    assert result["status"] == "failed"
    assert "is no longer finite at t = 0.1" in result["message"]
    with Log(tmp_path / "logs" / "flexible_pendulum.mcap") as log:
        assert np.isfinite(log.read("/pendulum/out").values).all()
        assert log.closing["status"] == "failed"
    steep = stepped("elastica", "cantilever.elements=1", "cantilever.load_rate=1e6", "cantilever.slenderness=5")
    with pytest.raises(ComponentFailed, match=r"^cantilever: Newton: no equilibrium found under 1e\+07 N"):
        steep.step(0.0, 10.0)


def test_a_mass_leaves_its_beam():
    sliding = stepped("sliding_mass", "slider.place=1.99")
    sliding.model.state.V[-1, 0] = 50.0
    with pytest.raises(ComponentFailed, match="slider: the sliding joint left its rail of 2 m"):
        sliding.step(0.0, 0.2)


@pytest.mark.parametrize("name", ["flexible_pendulum", "sliding_mass"])
def test_internal_steps_do_not_depend_on_the_communication_step(name):
    """Equal internal steps: the same motion to rounding, whatever the communication step."""
    found = []
    for h in (4e-3, 8e-3):
        one = stepped(name)
        for k in range(round(0.016 / h)):
            one.step(h * k, h)
        found.append(one.y.copy())
    np.testing.assert_allclose(found[0], found[1], rtol=1e-9, atol=1e-11)
