"""Elements of the suspension: exact solutions of each, and its energy."""

import numpy as np
import pytest
from chassis_probe import TABLE, Probe
from scipy.integrate import quad
from suspensions import BAR, CURVE, DAMPER, ELEMENTS, FAR, GAS, LAST, LINE, SLOW, STOP

from fmus.chassis.dynamics import rates
from fmus.chassis.leaf import ROOT
from fmus.chassis.tree import WHOLE
from fmus.physics.vector import vector

HELD = {"chassis.mass": 1e12, "chassis.inertia": (1e12, 1e12, 1e12), "gravity": 0.0}  # a hull that nothing moves
ARM, WHEEL = TABLE["road_arm"], TABLE["road_wheel"]["mass"]
AHEAD, UP = ARM["pivot"]  # of the pivot from the wheel centre, m
LENGTH = float(np.hypot(AHEAD, UP))
INERTIA = WHEEL * LENGTH**2 + ARM["mass"] * 0.25 * LENGTH**2 + ARM["pin_inertia"]  # of arm and wheel about the pivot
DRAWN = float(np.hypot(0.484, 0.406))  # length of the spring-damper, m


def suspension(**tables):
    """Changes of the vehicle table to these elements; the last wheel has all others, so that one kernel does."""
    return {"suspension": {**dict.fromkeys(TABLE["suspension"]), **LINE, **LAST, **tables}, "tensioner": FAR}


def held(**tables):
    """Chassis whose hull nothing moves, with these elements."""
    return Probe({**HELD, **suspension(**tables)})


def settled(force, **tables):
    """Held hull with an upward force on wheel 2 at the left, at rest; a damper slows it."""
    probe = Probe({**HELD, **suspension(**{**SLOW, **tables})}, step=1e-3)
    probe["left.road_wheel[2].force.z"] = force
    probe.run(12.0, 0.01)
    assert abs(probe.model.state[ROOT + 2 * len(probe.model.tree.is_arm) + 1]) < 1e-7
    return probe


def lever(angle):
    """Horizontal distance of the wheel centre behind the pivot, m."""
    return AHEAD * np.cos(angle) + UP * np.sin(angle)


def rise(angle):
    """Rise of the wheel centre from the drawn position, m."""
    return AHEAD * np.sin(angle) + UP * (1.0 - np.cos(angle))


def line(angle):
    """Compression of the spring-damper, m, and its moment arm about the pivot, m, from the drawn points."""
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    end = turn @ (np.array(LINE["on_arm"]) - ARM["pivot"])
    to_hull = np.array(LINE["on_chassis"]) - ARM["pivot"] - end
    length = np.hypot(*to_hull)
    return DRAWN - length, abs(end[0] * to_hull[1] - end[1] * to_hull[0]) / length


def at(probe, angle, rate=0.0):
    """Acceleration of arm 2 at the left, rad/s2, with this angle and rate; sets the state."""
    x, n = probe.model.state, len(probe.model.tree.is_arm)
    x[ROOT + 1], x[ROOT + 2 * n + 1] = angle, rate
    out = np.zeros_like(x)
    rates(probe.model.tree, None, None, x, probe.u, out)
    return out[ROOT + 2 * n + 1], out[-2]


# --- exact solutions ---


def push_of_gas(exponent):
    """Force, N, of the gas spring by its compression: p V^n is that of the drawn position; a twin has more pressure."""
    return lambda c, more: 3e-3 * (8e6 * more * (9e-4 / (9e-4 - 3e-3 * c)) ** exponent - 101325.0)


def push_of_curve(compression, more):
    """Force, N, between points, and beyond the last one along the last line."""
    points, forces = np.array(CURVE["compression"]), more * np.array(CURVE["force"])
    k = int(np.clip(np.searchsorted(points, compression) - 1, 0, len(points) - 2))
    slope = (forces[k + 1] - forces[k]) / (points[k + 1] - points[k])
    return forces[k] + slope * (compression - points[k])


@pytest.mark.parametrize(("force", "tables", "push"), [
    *((40e3, {"gas_spring": {**GAS, "exponent": n}}, push_of_gas(n)) for n in (1.0, 1.3)),
    *((force, {"spring": CURVE}, push_of_curve) for force in (-12e3, 10e3, 60e3, 250e3)),
])  # fmt: skip
def test_a_spring_balances_by_hand(force, tables, push):
    """The moment about the pivot is that of the force on the wheel."""
    probe = settled(force, **LINE, **tables)
    angle = probe["left.road_arm[2].angle"]
    compression, arm = line(angle)
    assert compression > CURVE["compression"][-1] or force < 250e3
    assert probe["left.suspension[2].length"] == pytest.approx(DRAWN - compression, rel=1e-12)
    assert push(compression, 1.0) * arm == pytest.approx(force * lever(angle), rel=1e-5)
    assert push(compression, 1.03) * arm != pytest.approx(force * lever(angle), rel=1e-2)
    assert probe["left.suspension[2].force"] == pytest.approx(push(compression, 1.0), rel=1e-6)


def test_a_torsion_bar_balances_by_hand():
    probe = settled(50e3, torsion_bar=BAR)
    angle = probe["left.road_arm[2].angle"]
    moment = 50e3 * lever(angle)
    assert 1.2e5 * (0.1 + angle) == pytest.approx(moment, rel=1e-5)
    assert probe["left.torsion_bar[2].moment"] == pytest.approx(moment, rel=1e-5)
    assert 1.2e5 * (0.103 + angle) != pytest.approx(moment, rel=1e-2)


def test_a_torsion_bar_of_a_leading_arm_pushes_its_wheel_down():
    ends = {key: (-x, z) for key, (x, z) in LINE.items()}
    leading = {"road_arm": {**ARM, "pivot": (-AHEAD, UP)}}
    probe = Probe({**HELD, **suspension(torsion_bar=BAR, **SLOW, **ends), **leading}, step=1e-3)
    probe["left.road_wheel[2].force.z"] = 50e3
    probe.run(12.0, 0.01)
    assert probe["left.road_wheel[2].position"][2] - TABLE["road_wheel"]["z"] == pytest.approx(
        rise(-probe["left.road_arm[2].angle"]), rel=5e-3
    )
    assert probe["left.road_arm[2].angle"] < 0.0 < probe["left.torsion_bar[2].moment"]


def test_a_damper_by_a_curve_and_one_about_the_pivot():
    """Accelerations at a rate by hand: bump and rebound differ; a rotary damper alone slows exponentially."""
    probe = held(**LINE, damper=DAMPER)
    arm = line(0.0)[1]
    for rate, force in ((0.1 / arm, 1e3), (-0.1 / arm, -4.5e3), (2.0 / arm, 5e3 + 2e3 / 0.7), (-0.6 / arm, -1.2e4)):
        acceleration, power = at(probe, 0.0, rate)
        assert acceleration == pytest.approx(-force * arm / INERTIA, rel=1e-7)
        assert power == pytest.approx(force * rate * arm, rel=1e-9)
    probe = held(rotary_damper={"damping": 300.0, "wheels": None})
    x, n = probe.model.state, len(probe.model.tree.is_arm)
    x[ROOT + 2 * n + 1] = 0.5
    probe.run(0.3)
    assert x[ROOT + 2 * n + 1] == pytest.approx(0.5 * np.exp(-300.0 * 0.3 / INERTIA), rel=1e-8)
    assert x[ROOT + 2 * n + 1] != pytest.approx(0.5 * np.exp(-306.0 * 0.3 / INERTIA), rel=1e-3)


@pytest.mark.parametrize(("name", "sense"), [("bump_stop", 1.0), ("rebound_stop", -1.0)])
def test_a_stop_carries_what_pushes_past_its_gap(name, sense):
    """At rest the stop's force is the force on the wheel; before its gap it has none."""
    probe = settled(sense * 30e3, **{name: STOP})
    angle = probe["left.road_arm[2].angle"]
    assert probe[f"left.{name}[2].force"] == pytest.approx(30e3, rel=1e-5)
    assert sense * rise(angle) == pytest.approx(0.02 + 30e3 / 4e5, rel=1e-5)
    assert probe[f"left.{name}[1].force"] == 0.0
    near = held(**{name: STOP})
    short = sense * 0.9 * 0.02 / AHEAD
    assert at(near, short)[0] == pytest.approx(0.0, abs=1e-6)
    assert near[f"left.{name}[2].force"] == 0.0


def test_recoil_gives_beyond_its_preload_only():
    """Two springs in line: the tensioner's until the recoil's preload, then both."""
    recoil = {"preload": 60e3, "stiffness": 3e5}
    changes = {**HELD, **suspension(), "tensioner": {**FAR, "recoil": recoil, "damping": 4e4}}
    for force, stroke in ((50e3, 0.0), (90e3, 30e3 / 3e5)):
        probe = Probe(changes, **{"tensioner.preload": 20e3})
        probe["left.idler.force.x"], start = force, probe.energy
        probe.run(4.0, 0.01)
        slid = probe["left.idler.position"][0] - TABLE["idler"]["x"]
        assert slid == pytest.approx((force - 20e3) / 1e6 + stroke, rel=1e-4)
        assert probe["left.recoil.stroke"] == pytest.approx(stroke, rel=1e-5, abs=1e-12)
        assert probe["left.tensioner.force"] == pytest.approx(force, rel=1e-6)
        assert probe.energy + probe["energy.dissipated"] - probe["port.work"] == pytest.approx(start, rel=1e-3)


@pytest.mark.long
def test_a_further_wheel_has_a_recoil_of_its_own():
    """On a vehicle with no other element; the idler is without it. The push of the spring is as of an idler."""
    spring = {"stiffness": 8e5, "damping": 4e4, "preload": 20e3, "recoil": {"preload": 60e3, "stiffness": 3e5}}
    further = {**TABLE["idler"], "x": -3.9, "z": 0.35, "tensioner": spring}
    probe = Probe({**HELD, "wheel": {"rear_idler": further}})
    assert [port.name for port in probe.model.ports if port.causality == "output" and "recoil" in port.name] == [
        "left.rear_idler.recoil.stroke", "right.rear_idler.recoil.stroke"
    ]  # fmt: skip
    probe["left.rear_idler.force.x"] = 90e3
    probe.run(4.0, 0.01)
    stroke = 30e3 / 3e5
    assert probe["left.rear_idler.recoil.stroke"] == pytest.approx(stroke, rel=1e-5)
    assert probe["left.rear_idler.position"][0] + 3.9 == pytest.approx((90e3 - 20e3) / 8e5 + stroke, rel=1e-4)
    assert probe["left.rear_idler.tensioner.force"] == pytest.approx(90e3, rel=1e-6)
    assert probe["right.rear_idler.tensioner.force"] == pytest.approx(0.0, abs=60.0)  # it is out by its preload


def test_wheels_on_fixed_axles_are_a_part_of_the_hull():
    """Without arms and suspension a force on a wheel moves the whole vehicle, and a torque spins the wheel alone."""
    probe = Probe({"suspension": None, "road_arm": None, "gravity": 0.0})
    mass = probe.model.tree.masses[WHOLE]
    assert mass == pytest.approx(15891.58 - 128 * 18.02 - 10 * ARM["mass"], abs=1e-9)
    for k in range(1, 6):
        probe[f"left.road_wheel[{k}].force.x"] = probe[f"right.road_wheel[{k}].force.x"] = 1e3
    probe["left.road_wheel[2].torque.y"] = 7.0
    probe.run(0.5)
    assert probe["left.road_wheel[2].angular_velocity"][1] == pytest.approx(7.0 * 0.5 / 26.06, rel=1e-9)
    bodies = {"chassis": TABLE["chassis"]["mass"]}
    for side in ("left", "right"):
        bodies |= {f"{side}.road_wheel[{k}]": WHEEL for k in range(1, 6)}
        bodies |= {f"{side}.{name}": TABLE[name]["mass"] for name in ("idler", "sprocket")}
    total = sum(mass * probe[f"{name}.velocity"] for name, mass in bodies.items())
    assert total[0] == pytest.approx(1e4 * 0.5, rel=1e-6)


# --- energy, over all elements ---


@pytest.mark.parametrize("name", ELEMENTS)
def test_what_an_element_takes_is_stored_or_lost(name):
    """J q'' q' = -dE/dt - lost power at any angle and rate; the energy is the integral of the force."""
    probe = held(**ELEMENTS[name])
    shift = 1e-6
    for angle, rate in ((0.02, 0.7), (0.2, -0.9), (-0.15, 1.1), (-0.25, -0.4)):
        energies = []
        for moved in (angle - shift, angle + shift):
            at(probe, moved)
            energies.append(probe["energy.spring"])
        acceleration, lost = at(probe, angle, rate)
        growth = (energies[1] - energies[0]) / (2.0 * shift) * rate
        taken = -acceleration * INERTIA * rate
        assert taken == pytest.approx(growth + lost, rel=1e-5, abs=1e-3)
        assert lost >= -1e-9
    work = quad(lambda q: -at(probe, q)[0] * INERTIA, 0.0, 0.2, epsabs=1e-8, limit=400, points=(0.05, 0.07))[0]
    at(probe, 0.0)
    start = probe["energy.spring"]
    at(probe, 0.2)
    assert probe["energy.spring"] - start == pytest.approx(work, rel=1e-6, abs=1e-4)


def test_a_lively_vehicle_with_all_elements_keeps_its_energy():
    """Kinetic + gravity + spring + dissipated stays, with the order of the method; a false damping is seen."""
    tables = {name: table for each in ELEMENTS.values() for name, table in each.items()}
    tables |= {key: TABLE["suspension"][key] for key in ("stiffness", "damping", "preload")}
    tables |= {"gas_spring": GAS, "bump_stop": {**STOP, "gap": 0.3}, "rebound_stop": {**STOP, "gap": 0.3}}
    tables["spring"] = {**CURVE, "compression": (-0.5, 0.5), "force": (-1e5, 1e5)}  # without kinks
    tables["damper"] = {**DAMPER, "speed": (0.0, 9.0), "force": (0.0, 9e4)}

    def drift(step, **changes):
        probe = Probe(suspension(**{**tables, **changes}), step=step)
        probe.model.state[7:13] = 0.5, -0.3, 0.2, 0.4, -0.6, 0.3
        before = probe.energy
        probe.run(0.2, 4e-3)
        return abs(probe.energy + probe["energy.dissipated"] - before) / probe["energy.dissipated"]

    coarse, fine = drift(4e-3), drift(2e-3)
    assert fine < 1e-4, (coarse, fine)
    assert 3.0 < np.log2(coarse / fine) < 6.5


def test_elements_are_on_the_wheels_that_are_named_and_sides_may_differ():
    own = {"suspension": TABLE["suspension"] | {"bump_stop": {**STOP, "wheels": (1, 3)}}}
    probe = Probe(own | {"right": {"suspension": {"bump_stop": {**STOP, "gap": 0.5}}}})
    stops = probe.model.tree.suspension.bump_stop
    assert stops.stiffness.tolist() == [4e5, 0, 4e5, 0, 0, 0, *5 * [4e5], 0]
    assert stops.gap.tolist() == [0.02, 0, 0.02, 0, 0, 0, *5 * [0.5], 0]
    assert vector(probe.model.tree.hinge[0], 0)[2] == vector(probe.model.tree.hinge[6], 0)[2]
