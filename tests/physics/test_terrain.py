"""Terrain: derivatives, true distances, normals, curvatures, frames, and friction by region."""

from __future__ import annotations

import numpy as np
import pytest
from contacts import LAW, assert_derivatives, assert_power, soil
from scipy.optimize import minimize

from fmus.ground.tables import is_terrain
from fmus.ground.terrain import heights, terrain
from fmus.kernels.jit import plain
from fmus.physics.contact import grounds
from fmus.physics.contact.ground import bumpy_ground
from fmus.physics.contact.hunt_crossley import HuntCrossley
from fmus.physics.contact.terrain import face
from fmus.physics.contact.terrain.face import first_foot, ground_face, is_above, wheel_normal
from fmus.physics.contact.terrain.heightmap import map_top
from fmus.physics.contact.terrain.profile import X, Z, curve_point, half_round, nearest, profile, step
from fmus.physics.contact.terrain.shape import smooth_height, surface, top

STILL = (0.0, 0.0, 0.0)
HALF_ROUND = {"x": [2.0], "radius": 0.2, "fillet": 0.02}
STEP = {"x": [4.0], "rise": 0.3, "radius": 0.05}
PRIMITIVES = {
    "plane": {"grade": 0.2, "bank": -0.1},
    "incline": {"grade": 0.2, "bank": -0.1, "incline_start": 1.0, "incline_length": 2.5},
    "step": {"step": STEP},
    "low step": {"step": STEP | {"rise": -0.04, "x": [2.0, 3.0]}},
    "half rounds": {"half_round": HALF_ROUND | {"x": [2.0, 3.0]}},
    "bump": {"bump": {"start": 1.0, "rise": 0.3, "slope": 0.6, "length": 0.4, "radius": 0.2}},
    "trench": {"trench": {"start": 1.5, "width": 1.0, "depth": 0.4, "radius": 0.05}},
    "washboard": {"washboard": {"amplitude": 0.05, "wavelength": 1.3, "phase": 1.1, "start": 1.0, "end": 4.5}},
    "kerb": {"kerb": {"y": 0.3, "rise": 0.3, "radius": 0.3, "start": 1.0, "length": 3.0}},
    "kerb on the right": {"kerb": {"y": -0.3, "rise": 0.15, "radius": 0.1}},
}
PRIMITIVES["rough"] = {
    "rough": {
        "iso_class": "E", "seed": 3, "period": 40.0, "band": (0.05, 2.83), "correlated": False, "start": 1, "length": 2,
    },
}  # fmt: skip
PRIMITIVES["height map"] = {
    "heightmap": {
        "heights": 0.05 * np.random.default_rng(4).normal(size=(20, 12)),
        "corner": (1.0, -1.4),
        "spacing": (0.25, 0.3),
        "start": 1.0,
        "length": 1.0,
    }
}
GROUNDS = PRIMITIVES | {
    "uneven": PRIMITIVES["incline"] | PRIMITIVES["washboard"],
    "surface": {"rough": PRIMITIVES["rough"]["rough"] | {"isotropic": True}},
    "all": {key: value for ground in PRIMITIVES.values() for key, value in ground.items() if key != "bump"}
    | {"trench": {"start": 5.0, "width": 1.0, "depth": 0.4, "radius": 0.05}, "half_round": HALF_ROUND, "step": STEP},
}


def points(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform((0.5, -1.2), (5.5, 1.2), (count, 2))


@pytest.mark.parametrize("name", GROUNDS)
def test_derivatives_match_finite_differences(name):
    shape, e, seen = terrain(GROUNDS[name]), 1e-5, 0
    for x, y in points(200):
        middle = np.array(surface(shape, x, y))
        a, b = np.array(surface(shape, x + e, y)), np.array(surface(shape, x - e, y))
        c, d = np.array(surface(shape, x, y + e)), np.array(surface(shape, x, y - e))
        differences = np.array([(a - b)[0], (c - d)[0], (a - b)[1], (c - d)[1], (c - d)[2]]) / (2.0 * e)
        steep = np.abs([a - b, c - d]).max() > 0.02 * max(1.0, np.abs(middle).max())  # near an edge or a wall
        if not steep and np.abs(middle).max() < 20.0:
            assert differences == pytest.approx(middle[1:], rel=1e-4, abs=1e-5)
            assert differences[1] != pytest.approx(middle[2] + 1e-3, rel=1e-4, abs=1e-5)
            seen += 1
    assert seen > 150


@pytest.mark.parametrize("name", GROUNDS)
def test_six_of_the_eight_corrections_find_the_foot_point(name, monkeypatch):
    """Six of eight corrections end at the same bits, up to 0.15 m deep; none is too few where the ground bends."""
    shape, rng = terrain(GROUNDS[name]), np.random.default_rng(1)
    deep = [(x, y, surface(shape, x, y)[0] - rng.uniform(0.0, 0.15)) for x, y in points(100, 1)]
    starts = [(p, first_foot(shape, p, smooth_height(shape, p[0], p[1])[0])) for p in deep]

    def feet(most):
        monkeypatch.setattr(face, "MAX_CORRECTIONS", most)
        return [plain(face.foot_point)(shape, *start) for start in starts]

    whole = feet(face.MAX_CORRECTIONS)
    assert feet(6) == whole
    if name in ("washboard", "rough", "height map", "uneven", "all"):
        assert feet(0) != whole


def nearest_distance(ground, p: np.ndarray) -> float:
    """Distance of a point to the surface, by minimising over the heights alone."""
    x, y = np.meshgrid(p[0] + np.linspace(-0.08, 0.08, 81), p[1] + np.linspace(-0.08, 0.08, 81))
    at = np.hypot(np.hypot(x - p[0], y - p[1]), heights(ground, x, y) - p[2])
    shape, first = terrain(ground), np.unravel_index(at.argmin(), at.shape)

    def distance2(place):
        x, y = place
        return (x - p[0]) ** 2 + (y - p[1]) ** 2 + (surface(shape, x, y)[0] - p[2]) ** 2

    options = {"xatol": 1e-11, "fatol": 1e-18, "maxiter": 2000, "initial_simplex": None}
    found = minimize(distance2, (x[first], y[first]), method="Nelder-Mead", options=options)
    return float(np.sqrt(found.fun))


@pytest.mark.parametrize(
    "name", ["incline", "half rounds", "bump", "washboard", "kerb", "rough", "surface", "height map", "uneven", "all"]
)
def test_depth_is_the_true_distance(name):
    ground, rng = GROUNDS[name], np.random.default_rng(4)
    shape, below = terrain(ground), rng.uniform(0.001, 0.02, 12)
    seen = 0
    for (x, y), depth in zip(points(12, 3), below, strict=True):
        h, h_x, h_y, *_ = surface(shape, x, y)
        if max(abs(h_x), abs(h_y)) > 3.0:
            continue
        p = np.array([x, y, h - depth])
        found, _ = ground_face(shape, p, STILL)
        assert found == pytest.approx(nearest_distance(ground, p), abs=1e-9)
        seen += 1
    assert seen > 8


@pytest.mark.parametrize("name", GROUNDS)
def test_normal_and_curvature_are_derivatives_of_depth(name):
    """grad depth = -n; along u the normal turns by the curvature, across it by less."""
    shape, rng, e, seen = terrain(GROUNDS[name]), np.random.default_rng(5), 1e-6, 0
    for x, y in points(60, 6):
        p = np.array([x, y, surface(shape, x, y)[0] - rng.uniform(0.002, 0.015)])

        def face(move, p=p):
            depth, face = ground_face(shape, p + e * np.array(move), STILL)
            return depth, np.array(face.n)

        depth, at = ground_face(shape, p, STILL)
        n, u = np.array(at.n), np.array(at.u)
        gradient = [(face(axis)[0] - face(-axis)[0]) / (2.0 * e) for axis in np.eye(3)]
        assert np.abs(np.array(gradient) + n).max() < 1e-5 or depth > 0.01  # deep, between two faces of an edge
        assert np.array([n @ u, n @ n, u @ u]) == pytest.approx([0.0, 1.0, 1.0], abs=1e-12)
        turns = [(face(way)[1] - face(-way)[1]) / (2.0 * e) for way in (u, np.cross(n, u))]
        if np.abs(turns).max() < 60.0:  # not across an edge
            smooth = abs(at.curvature - turns[0] @ u) < 1e-3 * max(1.0, abs(at.curvature))
            largest = abs(turns[1] @ np.cross(n, u)) < abs(at.curvature) + 1e-4
            principal = abs(turns[0] @ np.cross(n, u)) < 1e-3 * max(1.0, abs(at.curvature))
            seen += smooth and largest and principal
    assert seen >= 57  # both curvatures may have one size


@pytest.mark.parametrize("name", ["uneven", "all", "curved one way"])
def test_power_of_the_force_and_its_tangent(name):
    """The tangent takes the ground as curved one way."""
    curved = {"washboard": PRIMITIVES["washboard"]["washboard"] | {"phase": 0.0}, "grade": 0.1}
    shape, v = terrain(GROUNDS.get(name, curved)), np.array([0.3, -0.2, 0.1])

    def touched(x, v, s):
        return soil(LAW, 0.5, shape, x, v, s)

    for x, y in points(12, 8):
        p = np.array([x, y, surface(shape, x, y)[0] - 0.004])
        assert_power(touched, p, v, v)
        if name not in GROUNDS:
            assert_derivatives(touched, p, v, 2e-5)


def test_walls_and_edges():
    shape = terrain({"step": STEP, "bank": 0.1})
    for z in np.linspace(0.06, 0.24, 5):
        depth, face = ground_face(shape, (4.0 + 0.013, 0.0, z), STILL)
        assert depth == pytest.approx(0.013, abs=1e-12)
        assert face.n == pytest.approx((-1.0, 0.0, 0.0), abs=1e-12)
    down = terrain({"step": STEP | {"rise": -0.3}})
    assert ground_face(down, (3.987, 0.0, -0.1), STILL)[1].n == pytest.approx((1.0, 0.0, 0.0), abs=1e-12)
    corner = np.array([4.05, 0.0, 0.25])  # centre of the rounded edge
    for angle in np.linspace(0.05, 1.5, 6):
        way = np.array([-np.cos(angle), 0.0, np.sin(angle)])
        depth, face = ground_face(terrain({"step": STEP}), corner + 0.044 * way, STILL)
        assert depth == pytest.approx(0.006, abs=1e-12)
        assert face.n == pytest.approx(way, abs=1e-9)
        assert face.curvature == pytest.approx(1.0 / 0.044)


def test_a_profile_of_one_bump_is_the_ground_of_one_bump():
    """Depths of a bump on a terrain are those of ``ground.GroundShape``."""
    bump = PRIMITIVES["bump"]["bump"]
    ours, theirs, rng = terrain({"bump": bump}), bumpy_ground(0.0, **bump), np.random.default_rng(1)
    seen = 0
    for x, z in rng.uniform((0.5, -0.05), (3.5, 0.35), (400, 2)):
        depth, face = grounds.ground_face(theirs, (x, 0.0, z), STILL)
        if 0.0 < depth < 0.1:
            mine, at = ground_face(ours, (x, 0.4, z), STILL)
            assert mine == pytest.approx(depth, abs=1e-12)
            assert at.n == pytest.approx(face.n, abs=1e-9)
            assert at.curvature == pytest.approx(face.curvature, abs=1e-9)
            seen += 1
        elif depth <= 0.0:
            assert ground_face(ours, (x, 0.4, z), STILL)[0] <= 0.0
    assert seen > 50


def test_wheel_over_a_half_round():
    """The centre of a rigid wheel follows an arc of the sum of both radii; it never touches the fillets."""
    a, R = HALF_ROUND["radius"], 0.305
    shape, reach = terrain({"half_round": HALF_ROUND}), np.sqrt((R + a) ** 2 - R**2)
    for x in np.linspace(-0.999 * reach, 0.999 * reach, 9):
        centre = np.array([2.0 + x, 0.3, np.sqrt((R + a) ** 2 - x * x)])
        n = np.array(wheel_normal(shape, tuple(centre), (0.0, 1.0, 0.0), R))
        assert n == pytest.approx([x / (R + a), 0.0, np.sqrt(1.0 - (x / (R + a)) ** 2)], abs=1e-9)
        assert ground_face(shape, centre - (R - 1e-9) * n, STILL)[0] <= 0.0
        assert ground_face(shape, centre - (R + 1e-9) * n, STILL)[0] == pytest.approx(1e-9, abs=1e-13)
        for angle in np.linspace(-np.pi, np.pi, 100):
            rim = centre + R * np.array([np.cos(angle), 0.0, np.sin(angle)])
            assert ground_face(shape, rim, STILL)[0] < 1e-12
    for x in (-1.01 * reach, 1.01 * reach):
        assert wheel_normal(shape, (2.0 + x, 0.3, R), (0.0, 1.0, 0.0), R) == pytest.approx((0.0, 0.0, 1.0), abs=1e-12)


def test_wheel_on_waves_touches_at_the_nearest_point():
    waves = {"washboard": {"amplitude": 0.05, "wavelength": 1.0, "phase": 0.0, "start": -5.0, "end": 1e9}}
    shape, R = terrain(waves), 0.3
    along = np.linspace(0.0, 4.0, 40001)
    drawn = np.stack([along, heights(waves, along, 0.0)], axis=-1)
    for x in np.linspace(1.0, 2.0, 11):
        low = (np.sqrt(np.maximum(R**2 - (along - x) ** 2, 0.0)) + drawn[:, 1])[abs(along - x) < R].max()
        foot = drawn[np.hypot(*(drawn - [x, low]).T).argmin()]
        n = wheel_normal(shape, (x, 0.2, low), (0.0, 1.0, 0.0), R)
        assert n == pytest.approx(((x - foot[0]) / R, 0.0, (low - foot[1]) / R), abs=1e-3)


def rotation(seed: int) -> np.ndarray:
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def test_frames_move_the_ground():
    """A component whose frame is displaced and turned feels the same ground as moved points."""
    shape, R, origin = terrain(GROUNDS["all"]), rotation(2), np.array([0.3, -0.7, 1.9])
    moved = shape._replace(frame=np.concatenate([origin, R.ravel()]))
    for x, y in points(20, 7):
        p, v = np.array([x, y, surface(shape, x, y)[0] - 0.01]), np.array([0.3, -0.2, 0.4])
        depth, face = ground_face(shape, p, tuple(v))
        there, at = ground_face(moved, R.T @ (p - origin), tuple(R.T @ v))
        assert there == pytest.approx(depth, abs=1e-12)
        assert R @ at.n == pytest.approx(face.n, abs=1e-9)
        assert abs(R @ at.u @ face.u) == pytest.approx(1.0)
        assert R @ at.w == pytest.approx(v)
        assert ground_face(moved, R @ (p - origin), STILL)[0] != pytest.approx(depth, abs=1e-6), "a twin"
        centre, axle = p + 0.4 * np.eye(3)[2], np.eye(3)[1]
        n = wheel_normal(moved, R.T @ (centre - origin), R.T @ axle, 0.3)
        assert R @ n == pytest.approx(wheel_normal(shape, tuple(centre), tuple(axle), 0.3), abs=1e-9)


@pytest.mark.parametrize("name", GROUNDS)
def test_links_that_are_passed_over_touch_nothing(name):
    shape, rng, above = terrain(GROUNDS[name]), np.random.default_rng(3), 0
    for x, y in points(200, 2):
        a = np.array([x, y, rng.uniform(0.0, 2.5)])
        b = a + rng.normal(size=3) * 0.08
        if is_above(shape, tuple(a), tuple(b), 0.1):
            above += 1
            below = rng.uniform(-0.15, 0.15, (20, 3)) + a
            below[:, 2] = min(a[2], b[2]) - 0.1
            assert (heights(GROUNDS[name], below[:, 0], below[:, 1]) < below[:, 2]).all()
    assert above > 20


def test_the_bound_of_a_map_holds_between_its_points():
    uneven = grid(lambda x, y: 0.1 * np.sin(9.0 * x) * np.cos(7.0 * y))
    shape = terrain({"heightmap": uneven})
    for x, y in np.random.default_rng(2).uniform((0.0, -2.0), (6.0, 2.0), (50, 2)):
        around = np.random.default_rng(3).uniform(-0.3, 0.3, (2, 400)) + np.array([[x], [y]])
        highest = heights({"heightmap": uneven}, *around).max()
        assert 0.0 <= map_top(shape.heightmap, x, y, 0.3) - highest < 0.4


@pytest.mark.parametrize("name", GROUNDS)
def test_the_bound_of_heights_holds(name):
    """Also far to the side, where the bank of a bend is steep."""
    table, rng = GROUNDS[name], np.random.default_rng(5)
    shape = terrain(table)
    for x, y in rng.uniform((0.0, -20.0), (6.0, 20.0), (60, 2)):
        around = rng.uniform(-0.3, 0.3, (2, 100)) + np.array([[x], [y]])
        assert top(shape, x, y, 0.3) >= heights(table, *around).max() - 1e-12


def test_waves_of_both_sides():
    """The left side is a sine from the start; the right side is behind it."""
    waves = PRIMITIVES["washboard"]["washboard"] | {"end": 1e9}
    x, k = np.linspace(2.4, 9.0, 50), 2.0 * np.pi / waves["wavelength"]
    for y, phase in ((0.6, 0.0), (-0.6, waves["phase"])):
        expected = waves["amplitude"] * np.sin(k * (x - waves["start"]) - phase)
        assert heights({"washboard": waves}, x, y) == pytest.approx(expected, abs=1e-12)


def test_friction_by_region():
    regions = [
        {"x": [1.0, 3.0], "y": [-9.0, 9.0], "factor": 0.5},
        {"x": [2.0, 9.0], "y": [0.0, 9.0], "coefficient": 0.7},
    ]
    shape = terrain({"friction": regions})
    for law in (LAW, HuntCrossley(2e6, 5e3, 0.3, 0.05)):
        for place, mu in [((0.0, 0.0), 0.3), ((1.5, 1.0), 0.15), ((2.5, -1.0), 0.15), ((2.5, 1.0), 0.7)]:
            there = grounds.ground_law(shape, law, (*place, 0.0))
            assert there == law._replace(mu=mu)
            assert type(there) is type(law)
    assert grounds.ground_law(shape.without_friction(), LAW, (2.5, 1.0, 0.0)) == LAW
    assert grounds.ground_law(bumpy_ground(0.0, 1.0, 0.1, 0.5, 1.0, 0.1), LAW, (2.5, 1.0, 0.0)) == LAW


@pytest.mark.parametrize("region", [{"factor": 1.0}, {"coefficient": 0.3}])
def test_a_region_of_equal_friction_changes_no_bit(region):
    shape = terrain({"friction": [{"x": [-9.0, 9.0], "y": [-9.0, 9.0]} | region]})
    assert grounds.ground_law(shape, LAW, (0.1, 0.2, 0.3)) == LAW
    assert grounds.ground_law(terrain({}), LAW, (0.1, 0.2, 0.3)) == LAW


def test_profiles_are_smooth_chains():
    chain = profile([step("a", 1.0, 0.3, 0.05), half_round("b", 2.0, 0.2, 0.02), step("c", 3.0, -0.03, 0.1)])
    for i in range(len(chain) - 1):
        before, after = curve_point(chain, i, chain[i + 1, 0]), curve_point(chain, i + 1, chain[i + 1, 0])
        assert before[:4] == pytest.approx(after[:4], abs=1e-14)
    assert chain[-1, Z] == pytest.approx(0.27)
    assert chain[0, X] == pytest.approx(0.95)
    assert nearest(chain, 5.0, 1.0)[0] == len(chain) - 1


def test_a_level_or_a_bump_needs_no_terrain():
    assert not is_terrain({"hull": True, "bump": PRIMITIVES["bump"]["bump"], "grade": 0.0, "friction": None})
    assert all(is_terrain(ground) for name, ground in GROUNDS.items() if name != "bump")


def grid(function, n=41, m=31, dx=0.1, dy=0.08, corner=(1.0, -1.2)):
    x, y = corner[0] + dx * np.arange(n), corner[1] + dy * np.arange(m)
    return {"heights": function(*np.meshgrid(x, y, indexing="ij")), "corner": corner, "spacing": (dx, dy)}


def test_a_height_map_of_a_plane_is_the_plane():
    mapped = terrain({"heightmap": grid(lambda x, y: 0.2 * x - 0.1 * y)})
    plane = terrain({"grade": 0.2, "bank": -0.1})
    rng = np.random.default_rng(0)
    for x, y, z in rng.uniform((1.1, -1.1, -0.02), (4.9, 1.1, 0.0), (300, 3)):
        assert surface(mapped, x, y) == pytest.approx(surface(plane, x, y), abs=1e-12)
        p = (x, y, surface(plane, x, y)[0] + z)
        depth, face = ground_face(mapped, p, STILL)
        expected, there = ground_face(plane, p, STILL)
        assert depth == pytest.approx(expected, abs=1e-12)
        assert face.n == pytest.approx(there.n, abs=1e-12)
        assert expected == pytest.approx(-z / np.sqrt(1.05), abs=1e-12)


def test_a_height_map_of_a_parabola_inside_and_of_a_sine():
    """Parabolas are exact inside; the largest error of a sine falls with the third power of the spacing."""
    mapped = terrain({"heightmap": grid(lambda x, y: x * x - x * y + 0.5 * y * y)})
    for x, y in np.random.default_rng(1).uniform((1.2, -1.0), (4.8, 1.0), (50, 2)):
        expected = (x * x - x * y + 0.5 * y * y, 2.0 * x - y, y - x, 2.0, -1.0, 1.0)
        assert surface(mapped, x, y) == pytest.approx(expected, abs=1e-10)
    errors = []
    for fine in (1, 2, 4):
        wave = grid(lambda x, y: 0.05 * np.sin(np.pi * x), 40 * fine + 1, 9, 0.1 / fine)
        x = np.linspace(1.5, 4.5, 2001)
        errors.append(np.abs(heights({"heightmap": wave}, x, -1.0) - 0.05 * np.sin(np.pi * x)).max())
    assert errors[0] == pytest.approx(2.53e-5, rel=0.02)  # bilinear: 6.2e-4
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx([3.0, 3.0], abs=0.2)


def test_a_height_map_goes_on_beyond_its_edges():
    uneven = grid(lambda x, y: 0.1 * np.sin(3.0 * x) * np.cos(2.0 * y))
    ground = {"heightmap": uneven}
    assert (heights(ground, [0.3, -5.0], [0.2, 0.2]) == heights(ground, 1.0, 0.2)).all()
    assert heights(ground, 2.0, 7.0) == heights(ground, 2.0, -1.2 + 0.08 * 30)
    fading = {"heightmap": uneven | {"start": 2.0, "length": 1.0}}
    assert heights(fading, 2.0, 0.1) == 0.0
    assert heights(fading, 3.0, 0.1) == heights(ground, 3.0, 0.1)
