"""The driver's plan and slip against exact answers and the independent general theory."""

import numpy as np
import pytest
from planar_vehicle import RATE, _rates
from scipy.optimize import root
from skid_steering import Vehicle, turn

from fmus.driver import path as route
from fmus.driver import plan as planning
from fmus.driver.pursuit import LARGEST_FRICTION_SHARE
from fmus.driver.skid import skid_vehicle, slips
from orchestrator.scene.scene import load

TABLE = load("straight").vehicle.model_dump()
FREE = planning.Bounds(speed=4.0, lateral=1e3, grip=np.inf, deceleration=0.5, yaw_acceleration=np.inf, tolerance=0.1,
                       turn_resistance=0.7)  # fmt: skip
BOUND = planning.Bounds(speed=20.0, lateral=1e3, grip=2.0, deceleration=1.0, yaw_acceleration=0.4, tolerance=0.1,
                        turn_resistance=0.7)  # fmt: skip


def planned(arcs, bounds):
    """Return a path and its plan."""
    path = route.path_of_arcs("path.arcs", arcs)
    plan = planning.empty_plan(path)
    planning.compute(plan, path, bounds)
    return path, plan


def test_the_plan_turns_no_faster_than_the_vehicle_can():
    """The speed is reduced until the yaw acceleration exceeds its bound by 1 % at most, on sharp paths too."""
    reached = []
    for arcs in ("10 0; 15.7 0.1; 15.7 -0.1; 10 0", "5 0; 8 0.4; 8 -0.4; 5 0", "4 0.5; 4 -0.5; 4 0.5"):
        for tolerance in (0.02, 0.1, 0.5):
            path, plan = planned(arcs, BOUND._replace(tolerance=tolerance))
            ds = path.length / (plan.first[1] - 1)
            slope = abs(plan.curvature[2:] - plan.curvature[:-2]) / (2.0 * ds)
            reached.append((plan.reached_squared[1:-1] * slope).max() / BOUND.yaw_acceleration)
    assert 1.001 < max(reached) < 1.01


@pytest.mark.parametrize(("off", "found"), [(0.99, True), (3.99, False)])
def test_the_nearest_point_is_found_unless_the_path_is_lost(off, found):
    """Within 1 m, beyond which a run warns, on arcs of 4 m radius; near their middle it is not."""
    path, rng, worst = route.path_of_arcs("path.arcs", "10 0; 6 0.25; 6 -0.25; 10 0"), np.random.default_rng(0), 0.0
    for s in rng.uniform(10.0, 22.0, 60):
        x, y, heading, curvature = route.point(path, 0, s)
        left = off * (1.0 if curvature > 0.0 else -1.0)
        x, y = x - left * np.sin(heading), y + left * np.cos(heading)
        near, _ = route.nearest(path, 0, x, y, s + rng.uniform(-0.1, 0.1))
        px, py, heading, _ = route.point(path, 0, near)
        worst = max(worst, abs((x - px) * np.cos(heading) + (y - py) * np.sin(heading)))
    assert (worst < 1e-8) == found


def test_slips_of_all_demands_within_the_friction_are_found():
    """Demands of the driver have slips; far beyond the friction there are none."""
    feet, rng = skid_vehicle(TABLE)[0], np.random.default_rng(0)
    turning = 0.5 * feet.mass * feet.half_gauge / feet.inertia * feet.gravity
    for friction in (0.05, 0.3, 0.8):
        for _ in range(100):
            angle, part = (
                rng.uniform(0.0, 2.0 * np.pi),
                LARGEST_FRICTION_SHARE * rng.uniform() * friction * feet.gravity,
            )
            demand = (
                rng.uniform(-2.0, 2.0),
                part * np.cos(angle),
                part * np.sin(angle),
                rng.uniform(-0.3, 0.3) * friction * turning,
            )
            assert slips(feet, (friction, 0.01), *demand, tuple(rng.uniform(-1.0, 1.0, 3)))[1]
    assert not slips(feet, (0.3, 0.01), 0.0, 0.0, 30.0 * feet.gravity, 0.0, (0.0, 0.0, 0.0))[1]


def along(path, plan, places, what):
    return np.array([planning.evaluate(plan, path, 0, s)[what] for s in places])


@pytest.mark.parametrize(("deceleration", "agrees"), [(0.5, True), (0.51, False)])
def test_speed_on_a_straight_is_a_trapezoid_over_time(deceleration, agrees):
    """The speed on a straight is a trapezoid over time, exact between the points of the plan too.

    The square of the speed is linear over the distance.
    """
    path, plan = planned("40 0", FREE._replace(deceleration=deceleration))
    places = np.linspace(0.0, 40.0, 777)
    exact = np.minimum(4.0, np.sqrt(2.0 * 0.5 * (40.0 - places)))
    assert (abs(along(path, plan, places, 0) - exact).max() < 1e-9) == agrees


def test_speed_from_rest_grows_as_the_grip_allows():
    """The speed that the plan reckons with: from rest on a straight v^2 = 2 a s, until it brakes."""
    path, plan = planned("40 0", BOUND)
    s = np.linspace(0.0, path.length, plan.first[1])
    gained = 2.0 * BOUND.grip * planning.LARGEST_SHARE * s
    assert plan.reached_squared == pytest.approx(np.minimum(gained, 2.0 * BOUND.deceleration * (path.length - s)))


@pytest.mark.parametrize(("lateral", "agrees"), [(0.8, True), (0.82, False)])
def test_a_curve_is_met_at_the_speed_that_it_allows(lateral, agrees):
    """Braking for a curve begins at most one point early; the curve is driven at v^2 k = the bound."""
    path, plan = planned("20 0; 10 0.2; 40 0", FREE._replace(lateral=lateral))
    before, within = np.linspace(0.0, 19.7, 99), np.linspace(20.3, 29.7, 50)
    early, late = (np.minimum(4.0, np.sqrt(4.0 + 2.0 * 0.5 * (way - before))) for way in (19.75, 20.0))
    speeds = along(path, plan, before, 0)
    assert ((speeds > early - 1e-9) & (speeds < late + 1e-9)).all() == agrees
    assert np.allclose(along(path, plan, within, 0), 2.0, atol=1e-9) == agrees


def test_numbers_of_the_vehicle():
    """Mass and load shares agree with those of this vehicle in ``skid_steering``."""
    stands, ahead = skid_vehicle(TABLE)
    known = Vehicle()
    assert stands.mass == pytest.approx(known.mass, rel=1e-9)
    assert stands.inertia == pytest.approx(38.5e3, rel=0.02)
    assert ahead == pytest.approx(-1.9924, abs=5e-3)
    assert np.allclose(stands.shares, known.shares, atol=0.01)
    assert np.allclose(stands.wheels, known.wheels, atol=5e-3)
    assert stands.height == pytest.approx(known.height, rel=0.03)


def test_a_wheel_that_the_strands_lift_keeps_a_thousandth_of_the_load():
    """Strands that pull harder than the vehicle weighs leave a share to the wheels under them."""
    shares = skid_vehicle({**TABLE, "track": {**TABLE["track"], "tension": 1e5}})[0].shares
    assert shares.sum() == pytest.approx(1.0)
    np.testing.assert_array_less([5e-4, 0.2, 0.2, 0.2, 5e-4], shares)
    np.testing.assert_array_less(shares[[0, -1]], 2e-3)


def matched(known):
    """Vehicle with the numbers of the independent theory."""
    wheels, shares = np.array(known.wheels), np.array(known.shares)
    middle = float(shares @ wheels)
    return skid_vehicle(TABLE)[0]._replace(
        mass=known.mass, height=known.height, wheels=wheels, shares=shares, middle=middle,
        variance=float(shares @ (wheels - middle) ** 2),
    )  # fmt: skip


CASES = [((8, 12), 0.3), ((0, 10), 0.3), ((-10, 10), 0.3), ((19, 21), 0.3), ((8, 12), 0.7), ((0, 10), 0.7)]


@pytest.mark.parametrize(("sprockets", "friction"), CASES)
def test_sprocket_speeds_of_a_steady_circle(sprockets, friction):
    """Sprocket speeds of a steady circle, from the vehicle's table alone, agree with the theory.

    Their sum and difference are within 2 % of the faster sprocket's speed.
    """
    known = Vehicle(friction=friction)
    stands, _ = skid_vehicle(TABLE)
    steady = turn(known, sprockets)
    r = steady.rate
    z, _ = slips(stands, (friction, 0.01), r, -r * steady.left, r * steady.ahead, 0.0, (-0.4 * r, 0.4 * r, 0.0))
    speeds = [(steady.ahead + sign * stands.half_gauge * r + z[k]) / known.radius for k, sign in enumerate((-1.0, 1.0))]
    kinematic = [(steady.ahead + sign * stands.half_gauge * r) / known.radius for sign in (-1.0, 1.0)]
    fast = 0.02 * max(map(abs, sprockets))
    assert np.allclose(speeds, sprockets, atol=fast)
    assert not np.allclose(speeds, np.array(sprockets) * 1.03, atol=fast)
    assert not np.allclose(kinematic, sprockets, atol=fast / 2.0)


UNSTEADY = [  # friction, speed, yaw rate and its derivative, acceleration of the centre of mass forward and left
    (0.3, 4.0, 0.3, 0.2, 0.1, 1.2), (0.3, 5.0, 0.1, -0.15, -0.5, 0.5), (0.7, 6.0, -0.5, -0.3, 0.4, -3.0),
    (1.2, 3.0, 0.6, 0.5, -0.6, 1.8), (0.2, 2.0, -0.2, 0.1, 0.05, -0.4), (0.3, -2.0, 0.2, 0.1, 0.2, -0.4),
]  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize(("friction", "speed", "rate", "turning", "ahead", "left"), UNSTEADY)
def test_slip_of_any_motion_is_that_of_a_planar_vehicle(friction, speed, rate, turning, ahead, left):
    """Slip in any motion balances the forces of an independent planar vehicle.

    Scipy solves for the sprocket speeds and the drift that give these accelerations.
    """
    known = Vehicle(friction=friction)
    stands = matched(known)
    numbers = (known.mass, stands.inertia, known.height, known.half_width, known.width, 1.0, friction, known.creep, 1.0)
    wheels, shares = np.array(known.wheels), np.array(known.shares)

    def lacks(z):
        out, x = np.zeros(8), np.array([0.0, 0.0, 0.0, speed, z[2], rate, 0.0, 0.0])
        x[6:] = speed - rate * known.half_width + z[0], speed + rate * known.half_width + z[1]
        accelerations = _rates(x, np.array([ahead, left]), np.zeros(2), wheels, shares, numbers, out)
        return accelerations[0] - ahead, accelerations[1] - left, out[RATE] - turning

    start = -0.4 * rate, 0.4 * rate, -0.4 * rate
    for mu, agrees in ((friction, True), (1.03 * friction, False)):
        z, holds = slips(stands, (mu, known.creep), rate, ahead, left, turning, start)
        assert holds
        exact = root(lacks, z, tol=1e-12)
        assert exact.success
        assert np.allclose(z, exact.x, atol=1e-6) == agrees


def test_a_yaw_acceleration_beyond_the_friction_is_reduced():
    stands, _ = skid_vehicle(TABLE)
    z, holds = slips(stands, (0.3, 0.01), 0.3, 0.0, 1.0, 0.9, (0.0, 0.0, 0.0))
    assert holds
    assert z[1] > 0.2
