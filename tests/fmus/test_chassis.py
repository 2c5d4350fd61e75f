"""Chassis: exact solutions, accelerations by constraint equations, cost, refusals."""

import copy

import numpy as np
import pytest
from chassis_by_constraints import accelerations_by_constraints
from chassis_probe import LEAVES, ROLLERS, TABLE, Probe, stir
from scipy.spatial.transform import Rotation

from fmus.chassis.dynamics import rates
from fmus.chassis.leaf import ROOT
from fmus.chassis.model import Model, default_step
from fmus.chassis.tree import WHOLE, tree

WHEEL = TABLE["road_wheel"]["mass"]
BODY_MASS = 15891.58 - 128 * 18.02


def cross2(a, b):
    """Cross product of two vectors in a plane."""
    return a[0] * b[1] - a[1] * b[0]


# --- exact solutions ---


def test_the_right_tensioner_keeps_its_difference():
    """The parameter is the left preload; the right one differs from it as in the vehicle table."""
    own = {"tensioner.preload": 5e3, "right": {"tensioner": {"preload": 3e3}}}
    for parameters, pushes in (({}, (5e3, 3e3)), ({"tensioner.preload": 9e3}, (9e3, 7e3))):
        probe = Probe(own, **parameters)
        assert (probe["left.tensioner.force"], probe["right.tensioner.force"]) == pushes


def test_a_deep_static_deflection_by_hand():
    """A deep static deflection satisfies the moment balance about the pin, from the drawn points alone."""
    heavy = {"chassis.mass": 1e12, "chassis.inertia": (1e12, 1e12, 1e12), "suspension.damping": 6e4, "gravity": 0.0}
    probe = Probe(heavy, **{"suspension.preload": 5e3})
    probe["right.road_wheel[4].force.z"] = 25e3
    probe.run(3.0)
    angle = probe["right.road_arm[4].angle"]
    assert angle > 0.05  # up
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])  # about +y, on (x, z)
    wheel, end, top = turn @ [-0.288, -0.134], turn @ [-0.104, -0.240], np.array([-0.588, 0.166])
    line = top - end
    length = np.hypot(*line)
    push = 5e3 + 1e6 * (np.hypot(0.484, 0.406) - length)
    moment = -wheel[0] * 25e3  # upward force on a trailing wheel lifts it
    spring = push * cross2(end, line / length)  # the spring pushes the arm along -line
    assert abs(spring) == pytest.approx(moment, rel=1e-6)
    assert probe["right.suspension[4].force"] == pytest.approx(push, rel=1e-6)
    assert probe["right.suspension[4].length"] == pytest.approx(length, rel=1e-12)
    assert push * 1.02 * abs(cross2(end, line / length)) != pytest.approx(moment, rel=1e-2)


def top(changes=None):
    """Return a symmetric gyrostat about y: one spinning idler, all masses but the chassis negligible."""
    light = {
        "gravity": 0.0,
        "chassis.inertia": (1000.0, 600.0, 1000.0), "chassis.centre": (0.0, 0.0, 0.0), "chassis.mass": 1e3,
        "sprocket.mass": 1e-9, "sprocket.transverse_inertia": 1e-9,
        "road_arm.mass": 1e-5, "road_arm.pin_inertia": 1e-7, "road_arm.long_inertia": 1e-7,
        "road_wheel.mass": 1e-5, "road_wheel.transverse_inertia": 1e-9, "road_wheel.spin_inertia": 1e-9,
        "idler.mass": 1e-5, "idler.transverse_inertia": 1e-9,
        "suspension.stiffness": 0.1, "suspension.damping": 1e-3,
        "tensioner.stiffness": 0.1, "tensioner.damping": 1e-3,
    }  # fmt: skip
    return Probe({**light, **(changes or {})}, step=2e-3)


@pytest.mark.parametrize("spin", [0.0, 40.0])
def test_precession_of_a_symmetric_gyrostat(spin):
    """Without torque the axis turns about the momentum H at |H| / I_t; H includes the wheel's spin."""

    def axis_after(time, changes=None):
        probe = top(changes)
        x = probe.model.state
        x[10:13] = 0.3, 0.8, 0.0
        x[ROOT + 3 * LEAVES + 5] = spin  # the left idler
        probe.run(time, 2e-3)
        return Rotation.from_quat(x[3:7], scalar_first=True).apply([0, 1, 0])

    H = np.array([1000 * 0.3, 600 * 0.8 + 14.70 * spin, 0.0])
    expected = Rotation.from_rotvec(H / 1000 * 2.0).apply([0, 1, 0])
    assert np.allclose(axis_after(2.0), expected, rtol=0, atol=2e-5)
    if spin:
        assert not np.allclose(axis_after(2.0, {"idler.spin_inertia": 1.03 * 14.70}), expected, atol=1e-3)


# --- an independent formulation ---


EACH = {  # springs that differ from wheel to wheel and side to side, one wheel without a damper, a leading last arm
    "suspension": {
        "stiffness": (1e6, 8e5, 8e5, 8e5, 1.2e6), "damping": (2e4, 0.0, 1e4, 1e4, 2e4),
        "preload": (5e3, 4e3, 3e3, 2e3, 1e3), "on_chassis": (*4 * [(-0.3, 0.3)], (0.3, 0.3)),
        "on_arm": (*4 * [(0.184, -0.106)], (-0.184, -0.106)),
    },
    "road_arm": {"pivot": (*4 * [(0.288, 0.134)], (-0.288, 0.134))},
    "right": {"suspension": {"stiffness": 9e5, "preload": (1e3, 2e3, 3e3, 4e3, 5e3)}},
}  # fmt: skip
PAIRS = {
    "road_wheel": {"x": (-0.6, -1.2, -1.9, -2.5)},
    "road_arm": {"pairs": True, "pivot": ((-0.3, 0.1), (0.3, 0.1), (-0.2, 0.1), (0.4, 0.1))},
}
FREE_PAIRS = {**PAIRS, "suspension": None}
BEAMS = {  # of three and two wheels, the second one below the pivot; each arm has a mass of its own
    "road_wheel": {"x": (-0.6, -1.2, -1.9, -2.6, -3.2)},
    "road_arm": {
        "beams": ((1, 2, 3), (4, 5)),
        "pivot": ((-0.6, 0.3), (0.0, 0.3), (0.7, 0.3), (-0.2, 0.1), (0.4, 0.1)),
        "mass": (90.0, 40.0, 120.0, 60.0, 30.0),
        "pin_inertia": (3.0, 0.5, 5.0, 1.0, 0.6),
        "long_inertia": (0.4, 0.2, 0.5, 0.3, 0.1),
    },
}
FREE_BEAMS = {**BEAMS, "suspension": None}
LONE = {
    **BEAMS,
    "road_arm": {**BEAMS["road_arm"], "beams": ((2, 3, 4),), "pivot": (*3 * [(0.3, 0.1)], (1.0, 0.1), (0.4, 0.1))},
}


@pytest.mark.parametrize(
    ("seed", "rollers", "idler_x", "changes"),
    [
        (0, None, -4.0, {}),
        (1, None, -4.0, {}),
        (2, ROLLERS, -4.0, {}),
        (3, ROLLERS, 0.9, {}),
        (4, ROLLERS, -4.0, EACH),
        (5, ROLLERS, -4.0, PAIRS),
        (6, None, -4.0, FREE_PAIRS),
        (7, ROLLERS, -4.0, BEAMS),
        (8, None, -4.0, FREE_BEAMS),
        (9, None, -4.0, LONE),
        (10, None, -4.0, {"tensioner": {"angle": 0.4}}),
        (11, ROLLERS, 0.9, {"tensioner": {"angle": -0.7}}),
    ],
)
def test_accelerations_agree_with_maximal_coordinates(seed, rollers, idler_x, changes):
    table = {**copy.deepcopy(TABLE), "return_roller": rollers}
    for key, part in changes.items():
        table[key] = part and {**(table[key] or {}), **part}
    table["idler"]["x"] = idler_x  # ahead of the sprocket the tensioner pushes forwards
    table["chassis"]["centre"] = (-2.006, 0.13, 0.406)  # an asymmetric vehicle: no error may cancel by symmetry
    table["tensioner"]["preload"] = 9e3
    if table["suspension"] and not changes:
        table["suspension"]["preload"] = 4e3
    model = Model({"vehicle": table, "chassis": {"sides": ["left", "right"]}})
    model.initialise({})
    x = stir(model, seed=seed)
    for k in np.flatnonzero(model.tree.joined):
        for first in (ROOT, ROOT + 2 * len(model.tree.is_arm)):
            x[first + k] = x[first + k - 1]
    u = 1e4 * np.random.default_rng(seed).normal(size=model.inputs)
    linear, angular, rate, spin = accelerations_by_constraints(table, x, u)
    n = len(model.tree.is_arm)

    def agrees(numbers, tolerance):
        out = np.empty_like(x)
        rates(numbers, None, None, x, u, out)
        return all(
            np.allclose(ours, theirs, rtol=tolerance, atol=tolerance * np.abs(theirs).max())
            for ours, theirs in (
                (out[7:10], linear),
                (out[10:13], angular),
                (out[ROOT + 2 * n : ROOT + 3 * n], rate),
                (out[ROOT + 3 * n : ROOT + 4 * n], spin),
            )
        )

    numbers = tree(table, 2)
    assert agrees(numbers, 1e-9)
    springs = ("stiffness", "damping") if table["suspension"] else ()
    for name in ("across", "along", "transverse", "spin_inertia", "leaf_mass", *springs, "inertia"):
        assert not agrees(numbers._replace(**{name: 1.03 * getattr(numbers, name)}), 1e-6), name


# --- beams ---


def levers(spread=1.0):
    """Places x, z, m, of the wheels of the first beam of BEAMS from its pivot."""
    return np.array([(-spread * ahead, -up) for ahead, up in BEAMS["road_arm"]["pivot"][:3]])


def test_a_beam_with_three_wheels_swings_as_a_physical_pendulum():
    """Below a hull that nothing moves: about its place of rest, with the period of parallel axes, without loss.

    Wheels on their bearings do not turn with the beam. The twin: a beam 1 % longer.
    """
    hull = {"chassis.mass": 1e12, "chassis.inertia": 3 * (1e12,), "chassis.centre": 3 * (0.0,), "suspension": None}
    probe = Probe(hull | {f"{name}.{key}": value for name, part in BEAMS.items() for key, value in part.items()})
    tree, x = probe.model.tree, probe.model.state
    for side in ("left", "right"):
        probe[f"{side}.sprocket.force.z"] = 0.5 * tree.masses[WHOLE] * TABLE["gravity"]

    def pendulum(spread):
        places, arms = levers(spread), BEAMS["road_arm"]
        mass, square = np.array(arms["mass"][:3]), (places**2).sum(1)
        inertia = sum(arms["pin_inertia"][:3]) + (0.25 * mass + WHEEL) @ square
        down, ahead = -((0.5 * mass + WHEEL) @ places)[1], ((0.5 * mass + WHEEL) @ places)[0]
        return np.arctan2(ahead, down), 2.0 * np.pi * np.sqrt(inertia / (TABLE["gravity"] * np.hypot(ahead, down)))

    n, speed, (rest, period) = len(tree.is_arm), 0.05, pendulum(1.0)
    x[ROOT : ROOT + 3], x[ROOT + 2 * n : ROOT + 2 * n + 3] = rest, speed
    energy, moving = probe.energy, probe["energy.kinetic"]
    probe.run(3.0 * period, period / 1000)
    late = (probe["left.road_arm[1].angle"] - rest) / speed
    assert abs(late) < 1e-4 * 3.0 * period
    assert abs(3.0 * (pendulum(1.01)[1] - period)) > 1e-3 * 3.0 * period
    assert np.ptp([probe[f"left.road_arm[{k}].angle"] for k in (1, 2, 3)]) == 0.0
    assert probe.energy - probe["port.work"] - energy == pytest.approx(0.0, abs=1e-4 * moving)


def test_a_wheel_at_the_pivot_of_its_beam():
    """An arm without length is a body alike about all axes: one of no length to speak of with equal moments."""

    def accelerations(height, inertia):
        moments = {"pin_inertia": (3.0, 0.5, 5.0, 1.0, 0.6), "long_inertia": (0.4, inertia, 0.5, 0.3, 0.1)}
        pivot = {"pivot": ((-0.6, height), (0.0, height), (0.7, height), *BEAMS["road_arm"]["pivot"][3:])}
        parts = {"road_wheel": BEAMS["road_wheel"], "road_arm": {**BEAMS["road_arm"], **moments, **pivot}}
        probe = Probe({f"{name}.{key}": value for name, part in parts.items() for key, value in part.items()})
        x = stir(probe.model)
        out = np.zeros_like(x)
        rates(probe.model.tree, None, None, x, probe.u, out)
        return out[7:-2]

    at_pivot = accelerations(0.0, 0.2)
    np.testing.assert_allclose(at_pivot, accelerations(1e-9, 0.5), rtol=1e-6, atol=1e-5)
    assert np.abs(at_pivot - accelerations(1e-9, 0.2)).max() > 1e-4


# --- manners ---


def test_the_default_step_resolves_a_light_idler_with_a_strong_damper():
    """The default step follows the fastest spring-damper; with 1 ms this idler's damper makes energy."""
    light = {"idler.mass": 35.76, "tensioner.damping": 1e5}

    def residual(**parameters):
        probe = Probe(light, **parameters)
        probe["left.idler.force.x"] = 2e4
        probe.run(0.05)
        return abs(probe.energy + probe["energy.dissipated"] - probe["port.work"]) / probe["port.work"]

    steps = [port.start for probe in (Probe(), Probe(light)) for port in probe.model.ports if port.name == "step"]
    assert steps == [1e-3, pytest.approx(0.5 * 35.76 / 1e5)]
    ground = {"hull": False, "bare": ["left", "right"]}
    for inertia, step in ((26.06, 1e-4), (2.606, 0.5 * 2.606 * 0.01 / (0.3 * BODY_MASS * 9.81 / 10 * 0.305**2))):
        table = {**TABLE, "road_wheel": {**TABLE["road_wheel"], "spin_inertia": inertia}}
        assert default_step(tree(table, 2), table, ground) == pytest.approx(step)
    assert residual() < 1e-4
    assert residual(step=1e-3) > 1e-2
