"""Numbers of a scene: the impossible is refused, the implausible is told."""

import json

import pytest

from fmus.ground.soils import named
from fmus.vehicles.tables import BadInput
from orchestrator.log.reader import Log
from orchestrator.scene.scene import load, scene_names
from orchestrator.scene.values import implausible_numbers


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("vehicle.chassis.mass=1e300", "chassis.mass = 1e+300 kg: must be 0.001 to 1e+08 kg"),
        ("vehicle.contact.ground.friction=1e3", "contact.ground.friction = 1000: must be 0 to 100"),
        ("drive.speed=1e6", "drive.speed = 1e+06 rad/s: must be -100000 to 100000 rad/s"),
    ],
)
def test_the_impossible_is_refused(setting, said):
    with pytest.raises(BadInput) as refused:
        load("settle", None, [setting])
    assert str(refused.value).startswith("settle.toml: ")
    assert said in str(refused.value)


CURVE = "vehicle.suspension.spring={{compression=[0, 0.1, 0.2], force=[0, 5e4, {}]}}"  # beside 1e6 N/m
WHEELS = "vehicle.road_wheel.x=[-0.655, -1.322, {}, {}, -3.322]"


@pytest.mark.parametrize(
    ("setting", "sound", "fault", "said"),
    [
        ("vehicle.chassis.inertia=[1786.92, 10449.67, {}]", 12236.0, 12400.0, "chassis.inertia = [1786.92, 10449.67,"),
        ("vehicle.chassis.inertia=[{}, 10449.67, 10721.22]", 280.0, 160.0, "no body has these, one is more"),
        ("vehicle.track.inertia=[0.22, 0.04, {}]", 0.26, 0.265, "track.inertia = [0.22, 0.04, 0.265] kg m^2: no body"),
        ("vehicle.track.lateral={}", 0.189, 0.185, "track.lateral = 0.185 m: the tracks are in one another"),
        (CURVE, -4.9e4, -5.1e4, "suspension.spring.force: falls by 1.01e+06 N/m of compression, more than"),
        ("vehicle.life.pin.ultimate={}", 4.51e8, 4.5e8, "life.pin.ultimate = 4.5e+08 Pa: must be more than life.pin"),
        (WHEELS, (-1.989, -2.656), (-2.656, -1.989), "road_wheel.x = [-0.655, -1.322, -2.656, -1.989, -3.322] m"),
    ],
)  # fmt: skip
def test_what_no_vehicle_is_is_refused(setting, sound, fault, said):
    """Runs with it went through, with other numbers: each value has a twin beside it that is taken."""
    given, other = (setting.format(*(each if isinstance(each, tuple) else (each,))) for each in (sound, fault))
    load("settle", None, [given])
    with pytest.raises(BadInput) as refused:
        load("settle", None, [other])
    assert said in str(refused.value)


def test_the_implausible_is_said_everywhere(cotrack, caplog):
    changes = ("--set", "drive.speed=250", "--set", "drive.ramp_start=5", "--stop", "10 ms")
    status, out, _ = cotrack("run", "settle", "--track", "rigid", "--no-estimate", "--json", *changes)
    result = json.loads(out.splitlines()[-1])
    (warning,) = (each for each in result["warnings"] if each["component"] == "scene")
    assert (status, warning["count"]) == (0, 1)
    text = "settle.toml: drive.speed = 250 rad/s: plausible is -200 to 200 rad/s (a sprocket of 0.25 m"
    assert warning["text"].startswith(text)
    assert text in caplog.text
    with Log(result["log"]) as log:
        assert warning in log.closing["warnings"]


SIX = "vehicle.road_wheel.x=[-0.655, -1.19, -1.725, -2.26, -2.79, -3.322]"


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (
            (SIX,),
            "own.toml: vehicle.road_wheel.x[4] = -2.26 m and vehicle.road_wheel.x[5] = -2.79 m: these wheels overlap,"
            " 0.53 m apart; plausible is at least 0.61 m, vehicle.road_wheel.radius + vehicle.road_wheel.radius",
        ),
        ((SIX, "vehicle.road_wheel.radius=0.265"), None),
        ((SIX, "vehicle.road_wheel.radius=0.266"), "0.53 m apart; plausible is at least 0.532 m"),
        (("vehicle.road_wheel.x.4=-3.5",), "vehicle.road_wheel.x[5] = -3.5 m and vehicle.idler.x = -4 m: these wheels"),
        (("vehicle.section.outer_fibre=0.0116",), None),  # a section of two thin flanges, 2.04e-6 m^4
        (
            ("vehicle.section.outer_fibre=0.0115",),
            "own.toml: vehicle.section.bending = 2.03e-06 m^4: is more than any section of area = 0.01516 m^2 within"
            " outer_fibre = 0.0115 m has, area x outer_fibre^2 = 2.005e-06 m^4",
        ),
        (("vehicle.road_wheel.x[1]=-0.4",), "the sprocket's place = 0 m and vehicle.road_wheel.x[1] = -0.4 m: these"),
        (
            ("vehicle.right={road_wheel={x=[-0.655, -1.322, -1.989, -2.656, -3.5]}}",),
            "vehicle.right.road_wheel.x[5] = -3.5 m and vehicle.right.idler.x = -4 m: these wheels",
        ),
    ],
)
def test_wheels_that_overlap_are_told(settings, said):
    warnings = implausible_numbers(load("straight", "rigid", settings).resolved(), "own.toml")
    assert [said in each for each in warnings] == ([True] if said else [])


@pytest.mark.parametrize(("inertia", "said"), [("0.48", True), ("0.51", False)])
def test_a_wheel_that_friction_turns_round_within_a_step_is_told(inertia, said):
    """At 0.4 kg m2 76 % of the energy of a run is unaccounted for, at 0.5 kg m2 0.12 %."""
    wheel = ("vehicle.road_wheel.radius=0.3", f"vehicle.road_wheel.spin_inertia={inertia}")
    warnings = implausible_numbers(load("crawler", "rigid", wheel).resolved(), "own.toml")
    assert any("plausible is at least 0.496 kg m^2, or a shorter step" in each for each in warnings) == said


@pytest.mark.parametrize(("inertia", "said"), [(2.0, True), (5.8, True), (6.0, False)])
def test_an_idler_that_friction_turns_round_within_a_step_is_told(inertia, said):
    """A belt of 8 kN round an idler of 2 kg m2 chatters by 4 % of its tension at 1 ms, and rests at 0.25 ms."""
    idler = ("vehicle.contact.wheel.friction=0.3", "vehicle.track.tension=8 kN", "vehicle.idler.radius=0.28")
    idler = (*idler, f"vehicle.idler.spin_inertia={inertia}", "run.step=1 ms", "track.step=1 ms")
    warnings = implausible_numbers(load("straight", "rigid", idler).resolved(), "own.toml")
    assert (
        any("vehicle.idler.radius = 0.28 m with spin_inertia" in each and "5.91 kg" in each for each in warnings)
        == said
    )


@pytest.mark.parametrize("name", scene_names())
def test_the_gallery_is_plausible(name):
    assert implausible_numbers(load(name).resolved(), name) == []


def test_named_soils_are_plausible_and_forgotten_kilonewtons_are_not():
    for name in named():
        assert implausible_numbers(load("soft_ground", None, [f"ground.soil.name='{name}'"]).resolved(), name) == []
    kilo = load("soft_ground", None, ["ground.soil.kphi=1528.43"])
    said = "own.toml: ground.soil.kphi = 1528.43 N/m^(n+2): plausible is 10000 to 1e+08 N/m^(n+2) (tables in kN say"
    assert [each[: len(said)] for each in implausible_numbers(kilo.resolved(), "own.toml")] == [said]
    with pytest.raises(BadInput, match=r"soft_ground\.toml: ground\.soil\.k0 = 1e\+16 Pa/m: must be 0 to 1e\+15 Pa/m"):
        load("soft_ground", None, ["ground.soil.k0=1e16"])
