"""Hints at the nearest keys and signals."""

from importlib import resources

import pytest
from short_run import last

from fmus.vehicles.tables import BadInput
from orchestrator.execution import loading
from orchestrator.scene import commented_file
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import KINDS, load
from orchestrator.scene.settings import keys, near_keys


@pytest.mark.parametrize(
    ("key", "near"),
    [
        ("run.stepp", ["run.step"]),
        ("drive.sped", ["drive.speed"]),
        ("drive.left.sped", ["drive.left.speed"]),
        ("runn", ["run"]),
        ("stepp", ["run.step"]),
        ("vehicle.contact.ground.frction", ["vehicle.contact.ground.friction"]),
        ("expect.rest.signl", ["expect.rest.signal"]),
        ("hull", ["vehicle.chassis.hull", "ground.hull"]),
        ("qqq", []),
    ],
)
def test_near_keys(key, near):
    assert near_keys(key, keys(KINDS["vehicle"])) == near
    assert near_keys("vehicle.mass", keys(KINDS["vehicle"]))[:2] == ["vehicle.chassis.mass", "vehicle.sprocket.mass"]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('step = "1.25', 'stepp = "1.25', "own.toml: unknown key 'run.stepp': did you mean 'run.step'?"),
        ("speed = ", "sped = ", "own.toml: unknown key 'drive.sped': did you mean 'drive.speed'?"),
        ("model = ", "modell = ", "own.toml: unknown key 'track.modell': did you mean 'track.model'?"),
        ("[drive]", "[drives]", "own.toml: unknown key 'drives': did you mean 'drive'?"),
        ("[drive]", "[chain]\nlinks = 8\n[drive]", "own.toml: unknown key 'chain': it needs assembly = 'chain'"),
        (
            "tolerance = 0.002,",
            "tolerence = 0.002,",
            "'expect.chain_left.tolerence': did you mean 'expect.chain_left.tolerance'?",
        ),
        (
            'vehicle = "m113"',
            'vehicle = { base = "m113", mass = 3 }',
            "own.toml: unknown key 'vehicle.mass': did you mean 'vehicle.chassis.mass' or 'vehicle.sprocket.mass' or"
            " 'vehicle.idler.mass'?",
        ),
        (
            'vehicle = "m113"',
            'vehicle = "tank.toml"',
            "own.toml with vehicle 'tank.toml': unknown key 'vehicle.track.lateal': did you mean 'vehicle.track.late",
        ),
    ],
)
def test_a_misspelt_key_of_a_file_is_told_the_nearest(tmp_path, monkeypatch, old, new, said):
    monkeypatch.chdir(tmp_path)
    text = (resources.files("orchestrator") / "gallery" / "straight.toml").read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "own.toml").write_text(text.replace(old, new, 1))
    commented_file.new_file("vehicle", "tank")
    vehicle = (tmp_path / "tank.toml").read_text(encoding="utf-8")
    (tmp_path / "tank.toml").write_text(vehicle.replace("lateral = ", "lateal = "))
    with pytest.raises(BadInput) as caught:
        load("own.toml")
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("scene", "signal", "said"),
    [
        (
            "turn",
            "chassis.yaw_rate",
            "no such signal: did you mean 'chassis.chassis.angular_velocity.z'? Or measure = 'yaw_rate'?\n",
        ),
        ("turn", "yaw_rate", "no component 'yaw_rate': did you mean 'chassis.chassis.angular_velocity.z'? Or measure"),
        ("straight", "left_track.tension", "no such signal: did you mean 'left_track.tension.min' or 'left_track.tens"),
        ("straight", "left_track.tension.maxx", "no such signal: did you mean 'left_track.tension.max'?"),
        ("straight", "leftrack.tension.max", "no component 'leftrack': did you mean 'left_track'?"),
        ("straight", "driver.path.progress", "no component 'driver': did you mean 'left_drive'?"),
        ("straight", "left_track.link[65].tension", "no such signal: did you mean 'left_track.link["),
        ("straight", "hull.speed", "no component 'hull': there are left_track, right_track, left_drive, "),
        ("straight", "left_track", "no such signal: "),
        ("hanging_chain", "chain.solver.steps", "no such signal: "),
    ],
)
def test_signals_of_checks_are_known_before_anything_is_built(cotrack, monkeypatch, scene, signal, said):
    monkeypatch.setattr("orchestrator.execution.simulate.load_scene", lambda *_: pytest.fail("it is built"))
    check = f'expect.own={{signal="{signal}", expected=1, tolerance=1}}'
    status, out, err = cotrack("run", scene, "--json", "--set", check)
    assert (status, len(err.splitlines())) == (2, 1)
    assert err.startswith(f"cotrack: {scene}.toml: expect.own.signal = '{signal}': {said}")
    assert last(out)["message"] in err


def require_signals(scene):
    loading.require_signals(scene, assemble(scene).parts)


@pytest.mark.parametrize(
    ("settings", "signal"),
    [
        ((), "left_track.link[64].tension"),
        ((), "chassis.settlement"),
        ((), "chassis.left.idler.force.x"),
        ((), "stats.left_track.steps"),
        (("run.between=true",), "left_track.link[64].tension.mean"),
        (("expect.own.track=rigid",), "no.matter"),
    ],
)
def test_known_signals_of_checks_are_not_refused(settings, signal):
    check = f'expect.own={{signal="{signal}", expected=1, tolerance=1}}'
    require_signals(load("straight", None, [check, *settings]))
    other = {"run.between=true": "run.between=false", "expect.own.track=rigid": "expect.own.track=flexible"}
    if settings:
        with pytest.raises(BadInput, match=r"expect\.own\.signal"):
            require_signals(load("straight", None, [check, *(other[one] for one in settings)]))
    if signal.startswith("chassis.left"):
        with pytest.raises(BadInput, match="no such signal"):
            require_signals(load("straight", None, [check, "run.inputs=false"]))
