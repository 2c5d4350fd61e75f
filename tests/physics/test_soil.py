"""Soil under a point: exact set-ups of pressing, letting go and dragging, energy, memory and rut."""

from __future__ import annotations

import re
from importlib import resources
from math import exp, radians, tan

import numpy as np
import pytest
from soil_points import AREA, LOAM, PITCH, SAND, WIDTH, SoilPoint, law

from fmus.ground.soils import SoilTable, named
from fmus.physics.chain.state import FORGOTTEN
from fmus.physics.contact.soil import pressure
from fmus.physics.contact.soil.memory import (
    CELL,
    DEEPEST,
    FIRST,
    INSIDE,
    MADE,
    PRESSURE,
    RUT,
    SHEAR,
    SIDE,
    TILE,
    TILES,
    deepest_at,
    press,
)
from fmus.physics.contact.soil.shear import mobilise

LOAD, K, PHI = 10e3, 0.025, radians(28.0)
STIFFNESS = 0.99e3 / PITCH + 1528.43e3


def moved(point: SoilPoint, path: np.ndarray) -> float:
    """Work put into the soil along a ``path`` (steps, 3), by the trapezoidal rule, J."""
    forces = np.array([point.go(x).f for x in path])
    return float(-(0.5 * (forces[1:] + forces[:-1]) * np.diff(path, axis=0)).sum())


def pressed_work(point: SoilPoint, depth: float) -> float:
    """Work of pressing to a ``depth``, m, by Gauss's rule, J; the memory stays."""
    x, weight = np.polynomial.legendre.leggauss(20)
    return (
        0.5
        * depth
        * sum(b * point.force((0.0, 0.0, -0.5 * depth * (1.0 + a))).normal for a, b in zip(x, weight, strict=True))
    )


@pytest.mark.long
def test_a_pressed_plate_sinks_and_takes_work():
    """10 kN on a link on dry sand: 137.8755 mm, 656.550 J."""
    point = SoilPoint(law())
    z = point.sink(LOAD)
    assert z == pytest.approx((LOAD / (AREA * STIFFNESS)) ** (1.0 / 1.1), rel=1e-9)
    assert z == pytest.approx(0.1378755, abs=5e-8)
    work = pressed_work(SoilPoint(law()), z)
    assert work == pytest.approx(656.550, abs=1e-2)
    assert AREA * pressure.first_work(point.soil, z) == pytest.approx(656.550, abs=5e-4)
    for wrong in (law(n=1.1 * 1.02), law(kphi=1.02 * SAND["kphi"]), law(width=WIDTH)):
        assert SoilPoint(wrong).sink(LOAD) != pytest.approx(0.1378755, abs=5e-8)


def test_a_mass_let_go_sinks_deeper_and_oscillates_on_the_reload_line():
    """1000 kg let go on the surface: 265.9745 mm; then w^2 = A k_u / m."""
    point, mass, h, g = SoilPoint(law()), 1000.0, 2e-5, 9.81
    z, v = 0.0, 0.0
    while v >= 0.0:
        rate = v + 0.5 * h * (g - point.force((0.0, 0.0, -z)).normal / mass)
        z += h * rate
        v = rate + 0.5 * h * (g - point.go((0.0, 0.0, -z)).normal / mass)
    assert point.memory[0, DEEPEST] == pytest.approx(0.2659745, abs=1e-7)
    assert point.memory[0, DEEPEST] == pytest.approx((2.1 * mass * g / (AREA * STIFFNESS)) ** (1.0 / 1.1), rel=1e-6)
    stiffness = -np.diff([point.force((0.0, 0.0, -z + d)).normal for d in (0.0, 1e-5)])[0] / 1e-5
    assert stiffness == pytest.approx(AREA * 503e6 * 0.2659745, rel=1e-6)


@pytest.mark.parametrize("kind", [SAND, LOAM])
def test_pressed_unloaded_and_reloaded(kind):
    """Residual sinkage, dissipated energy, and the way back to the first loading."""
    point = SoilPoint(law(**kind))
    z = point.sink(LOAD)
    p, k = LOAD / AREA, pressure.unloading_slope(point.soil, z)
    residual = z - p / k
    n, c = point.soil.n, point.soil.stiffness
    assert k == pytest.approx(max(503e6 * z, max(1.0, n) * p / z), rel=1e-12)
    assert point.force((0.0, 0.0, -residual * (1.0 - 1e-9))).normal == 0.0
    assert point.force((0.0, 0.0, -0.5 * (residual + z))).normal == pytest.approx(0.5 * LOAD, rel=1e-9)
    deeper = 1.1 * z
    assert point.force((0.0, 0.0, -deeper)).normal == pytest.approx(AREA * c * deeper**n, rel=1e-12)
    point.go((0.0, 0.0, -0.5 * residual))
    assert point.lost[0] == pytest.approx(AREA * (p * z / (n + 1.0) - 0.5 * p * p / k), rel=1e-6)
    assert point.lost[1] == 0.0
    assert point.memory[0, PRESSURE] == 0.0
    assert point.lost[0] != pytest.approx(AREA * (p * z / (n + 1.0) - 0.5 * p * p / (1.03 * k)), rel=1e-6)


def test_a_declared_rebound_is_the_part_of_the_sinkage_that_springs_back():
    point = SoilPoint(law(Au=0.0, rebound=0.05))
    z = point.sink(LOAD)
    assert point.force((0.0, 0.0, -0.9501 * z)).normal > 0.0
    assert point.force((0.0, 0.0, -0.9499 * z)).normal == 0.0


@pytest.mark.parametrize("steps", [1, 7, 500])
def test_a_dragged_link_pulls_as_janosi_and_hanamoto_say(steps):
    """10 kN at 0.05 m/s: 3398.916 N at 0.5 s, at any step; the work of it."""
    point = SoilPoint(law())
    z = point.sink(LOAD)
    for way in np.linspace(0.0, 0.025, steps + 1)[1:]:
        force = point.go((way, 0.0, -z))
    most = AREA * 1040.0 + LOAD * tan(PHI)
    assert -force.f[0] == pytest.approx(3398.916, abs=1e-3)
    assert -force.f[0] == pytest.approx(most * (1.0 - exp(-1.0)), rel=1e-9)
    kept = force.energy - 0.5 * LOAD**2 / AREA / pressure.unloading_slope(point.soil, z)
    assert point.lost[1] + kept == pytest.approx(most * (0.025 - K * (1.0 - exp(-1.0))), rel=1e-9)
    assert point.lost[1] == pytest.approx(
        most * K * (1.0 - 2.0 * (1.0 - exp(-1.0)) + 0.5 * (1.0 - exp(-2.0))), rel=1e-9
    )
    assert -force.f[0] != pytest.approx(most * (1.0 - exp(-1.0 / 1.02)), rel=1e-3)


@pytest.mark.parametrize("slip", [0.05, 0.2, 1.0])
def test_a_treadmill_pulls_as_the_integral_over_its_length(slip):
    """18 links with 2 points each: the mean over one pitch of passage is F(i)."""
    links, phases, total = 18, 50, 0.0
    length = links * PITCH
    for s in (np.arange(phases) + 0.5) / phases * PITCH:
        for middle in PITCH * (np.arange(links + 1) + 0.5) - s:
            for place in (middle - 0.5 * PITCH / np.sqrt(3.0), middle + 0.5 * PITCH / np.sqrt(3.0)):
                if 0.0 <= place <= length:
                    total += mobilise(K, (0.0, 0.0, 0.0), (slip * place, 0.0, 0.0)).m[0]
    most = links * AREA * 1040.0 + LOAD * tan(PHI)
    expected = most * (1.0 - K / (slip * length) * (1.0 - exp(-slip * length / K)))
    assert most * total / (2 * links * phases) == pytest.approx(expected, rel=1e-4)
    assert most * total / (2 * links * phases) != pytest.approx(1.01 * expected, rel=1e-4)


def test_mobilised_shear_stays_within_the_strength_and_no_way_is_an_advantage():
    """|m| <= 1 on a random way; steps of any length along a line are one step."""
    rng, m = np.random.default_rng(1), (0.0, 0.0, 0.0)
    for u in rng.normal(scale=K, size=(300, 2)):
        m = mobilise(K, m, (*u, 0.0)).m
        assert np.linalg.norm(m) <= 1.0
    there = mobilise(K, m, (0.03, -0.01, 0.0)).m
    for _ in range(10):
        m = mobilise(K, m, (0.003, -0.001, 0.0)).m
    assert m == pytest.approx(there, abs=1e-15)


def test_reversal_dissipates_and_holding_does_not_creep():
    point = SoilPoint(law())
    z = point.sink(LOAD)
    turns = np.concatenate([np.linspace(0.0, 0.05, 400), np.linspace(0.05, -0.05, 800), np.linspace(-0.05, 0.05, 800)])
    forth = moved(point, np.stack([turns[:400], 0.0 * turns[:400], -z + 0.0 * turns[:400]], axis=1))
    assert forth > 0.0
    losses = []
    for way in turns[400:]:
        before = point.lost[1]
        force = point.go((way, 0.0, -z))
        losses.append(point.lost[1] - before)
    assert min(losses) >= 0.0
    assert sum(losses) > 0.5 * (AREA * 1040.0 + LOAD * tan(PHI)) * 0.2
    for _ in range(1000):
        held = point.go((turns[-1], 0.0, -z))
    assert held.f == force.f


def lifted(kind, share, way=0.02, over=0.0):
    """Mobilised shear of a point that was pressed, dragged, lifted by a share of its rebound, and let down."""
    point = SoilPoint(law(**kind))
    z = point.sink(LOAD)
    rebound = LOAD / AREA / pressure.unloading_slope(point.soil, z)
    point.go((way, 0.0, -z))
    point.go((way, 0.0, -z + rebound * (1.0 + share)))
    place = (way + over, 0.0, -z + 0.5 * rebound)
    force = point.go(place)
    assert force == point.go(place)
    return -force.f[0] / (AREA * (point.soil.cohesion + point.memory[0, PRESSURE] * point.soil.tan))


@pytest.mark.parametrize("kind", [SAND, LOAM])
def test_a_lifted_link_leaves_its_print_by_the_height_of_the_rebound(kind):
    """A touch of the height 0 changes nothing; then shear is limited by 1 - height / rebound."""
    full = 1.0 - exp(-0.02 / K)
    for share in (-0.5, -1e-9, 1e-9, 0.4):
        assert lifted(kind, share) == pytest.approx(full, rel=1e-9)
    for share in (0.5, 0.6, 0.9):
        assert lifted(kind, share) == pytest.approx(min(full, 1.0 - share), rel=1e-9)
        assert lifted(kind, 1.03 * share) != pytest.approx(min(full, 1.0 - share), rel=1e-2) or full < 1.0 - share
    assert lifted(kind, 1.0 + 1e-9) == lifted(kind, 5.0) == 0.0
    assert lifted(kind, 0.6, over=0.01) == pytest.approx(0.4, rel=1e-9)


def test_shear_after_a_hop_follows_its_height_without_a_jump():
    """A link that hops by a little more keeps a little less: no step decides alone whether shear is forgotten."""
    shares = np.linspace(-0.2, 1.2, 71)
    kept = np.array([lifted(SAND, share, way=0.1) for share in shares])
    assert np.max(-np.diff(kept) / np.diff(shares)) == pytest.approx(1.0, rel=1e-6)
    assert np.diff(kept).max() < 1e-12
    assert kept[-1] == 0.0


@pytest.mark.parametrize("kind", [SAND, LOAM, SAND | {"Au": 0.0, "rebound": 0.1}])
def test_energy_is_stored_or_lost_by_a_cause(kind):
    """Along a way that presses, turns, lifts and slides: work = stored + compaction + shear, to 1e-6."""
    point, t = SoilPoint(law(**kind), 0.25), np.linspace(0.0, 1.0, 20001)
    z = 0.06 * (1.0 - np.cos(4.0 * np.pi * t)) * (1.0 + t)
    x, y = 0.03 * np.sin(5.0 * np.pi * t) + 0.1 * t**2, 0.02 * np.sin(9.0 * t)
    path = np.stack([x, y, -z], axis=1)
    for end in (14000, 20001):
        point = SoilPoint(law(**kind), 0.25)
        work = moved(point, path[:end])
        stored = point.force(path[end - 1]).energy
        assert work == pytest.approx(stored + point.lost.sum(), rel=1e-6)
        assert work != pytest.approx(stored + point.lost.sum() * 1.001, rel=1e-6)
    assert point.lost.min() > 0.0


def test_energy_of_a_link_that_hops_in_its_print_is_stored_or_lost_by_a_cause():
    """Lifted by 0.6 of the rebound, four times: the loss has what the hops take of the stored shear."""
    errors = []
    for steps in (2000, 8000):
        point, t = SoilPoint(law(), 0.25), np.linspace(0.0, 1.0, steps + 1)
        z = point.sink(0.25 * LOAD)
        rebound = LOAD / AREA / pressure.unloading_slope(point.soil, z)
        before = point.force((0.0, 0.0, -z)).energy + point.lost.sum()
        height = 0.8 * rebound * (1.0 - np.cos(25.0 * t))
        work = moved(point, np.stack([0.08 * t, 0.0 * t, height - z], axis=1))
        after = point.force((0.08, 0.0, height[-1] - z)).energy + point.lost.sum()
        errors.append(work / (after - before) - 1.0)
        assert work / (after - before + 0.01 * point.lost[1]) != pytest.approx(1.0, abs=1e-3)
    assert abs(errors[1]) < 1e-4
    assert abs(errors[0] / errors[1]) > 3.0


def test_ground_never_gives_back_more_than_was_put_in():
    """Published slopes of unloading are softer than the secant at high pressure; then the secant counts."""
    lete = law(kc=102e3, kphi=5301e3, n=0.79, elastic=1e9)
    z = 0.0136
    assert 503e6 * z < pressure.first_loading(lete, z)[0] / z
    assert pressure.unloading_slope(lete, z) == pytest.approx(pressure.first_loading(lete, z)[0] / z)
    for kind in (lete, law(), law(**LOAM), law(Au=0.0, k0=1e3)):
        z = np.geomspace(1e-9, 0.5, 60)
        lost, work = (
            np.array([function(kind, a) for a in z]) for function in (pressure.compaction, pressure.first_work)
        )
        assert (np.diff(lost) > -1e-14 * work[1:]).all()


def test_the_first_slope_of_stiff_soil_is_capped():
    clay = law(**LOAM | {"n": 0.13, "kphi": 1555.95e3, "kc": 12.7e3})
    join = clay.elastic_depth
    assert join > 1e-4
    below, above = (pressure.first_loading(clay, join * a) for a in (1.0 - 1e-9, 1.0 + 1e-9))
    assert below[0] == pytest.approx(above[0], rel=1e-8)
    assert max(pressure.first_loading(clay, z)[1] for z in np.geomspace(1e-12, 1.0, 60)) == 1e8
    a, b = (pressure.first_work(clay, join * a) for a in (1.0 - 1e-9, 1.0 + 1e-9))
    assert a == pytest.approx(b, rel=1e-8)


NORMAL = np.array([0.2, -0.1, 1.0]) / np.sqrt(1.05)


@pytest.mark.parametrize("n", [(0.0, 0.0, 1.0), NORMAL])
@pytest.mark.parametrize("depth", [0.05, 0.0395, 0.041])
@pytest.mark.parametrize("kind", [SAND, LOAM | {"damping": 3e4}])
def test_the_matrix_is_the_derivative_of_the_force(n, depth, kind):
    """On the first loading and on the reload line, sheared, on level and on sloping ground."""
    point, by_rate = SoilPoint(law(**kind), 0.25, n), 200.0
    n = np.array(n)
    for x in (-0.03 * n, np.array([0.004, 0.003, 0.0]) - 0.04 * n):
        point.go(x)
    x, v = np.array([0.007, -0.002, 0.0]) - n * (depth + np.dot(n, [0.007, -0.002, 0.0])), np.array([0.1, 0.05, -0.02])
    g = np.reshape(point.force(x, v, by_rate, True).g, (3, 3))
    numeric = np.transpose(
        [
            np.subtract(point.force(x + d, v + by_rate * d).f, point.force(x - d, v - by_rate * d).f) / 2e-7
            for d in 1e-7 * np.eye(3)
        ]
    )
    assert g == pytest.approx(numeric, abs=1e-6 * abs(numeric).max())
    assert 1.01 * g != pytest.approx(numeric, abs=1e-6 * abs(numeric).max())


def test_the_matrix_of_a_curved_face_turns_the_normal_with_the_place():
    """By its force times the curvature, in the direction of the curvature alone."""
    point, x = SoilPoint(law(**SAND), 0.25, NORMAL), -0.03 * NORMAL
    u = np.array([0.5, 0.9, 0.0]) - NORMAL * (NORMAL @ [0.5, 0.9, 0.0])
    point.u = tuple(u / np.linalg.norm(u))
    flat = point.force(x, tangent=True)
    point.curvature = 0.8
    turned = np.reshape(np.subtract(point.force(x, tangent=True).g, flat.g), (3, 3))
    assert turned == pytest.approx(0.8 * flat.normal * np.outer(point.u, point.u), rel=1e-9)
    assert turned != pytest.approx(0.82 * flat.normal * np.outer(point.u, point.u), rel=1e-2)


def test_a_step_that_is_not_accepted_leaves_no_trace():
    point = SoilPoint(law())
    point.go((0.0, 0.0, -0.02))
    memory, rut = point.memory.copy(), point.rut.copy()
    point.force((0.03, 0.0, -0.05))
    first = point.force((0.01, 0.0, -0.03))
    assert (point.memory == memory).all()
    assert (point.rut == rut).all()
    point.force((0.03, 0.0, -0.05))
    assert point.force((0.01, 0.0, -0.03)) == first
    point.accept()
    assert point.memory[0, DEEPEST] == 0.03


def test_a_second_pass_adds_no_compaction():
    """A point that touches down in a rut reads its depth; beside the rut the ground is new."""
    point = SoilPoint(law(), 0.25)
    point.go((0.0, 0.0, -0.05))
    point.go((0.0, 0.0, 0.0))
    assert point.memory[0, INSIDE] == 0.0
    lost = point.lost.copy()
    point.go((0.01, 0.0, -0.0499))
    assert point.memory[0, DEEPEST] == 0.05
    point.go((0.01, 0.0, -0.05))
    assert (point.lost == lost).all()
    assert not point.memory[0, SHEAR : SHEAR + 3].any()
    point.go((0.0, 0.0, 0.0))
    assert point.force((0.5, 0.0, -0.03)).normal == pytest.approx(0.25 * AREA * STIFFNESS * 0.03**1.1)
    assert point.force((0.01, 0.0, -0.03)).normal == 0.0


@pytest.mark.parametrize("heading", [0.0, 0.3, 1.2, 2.5])
def test_a_track_that_is_laid_down_presses_each_cell_once(heading):
    """Rectangles of the points of 12 links cover their area in cells, and none is pressed by two."""
    rut, ahead, aside = (
        np.zeros(RUT),
        *np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]]),
    )
    pressed = 0
    for half in range(24):
        for side in (-1.0, 1.0):
            before = np.count_nonzero(rut[FIRST:])
            middle = (half + 0.5) * 0.5 * PITCH * ahead + side * 0.25 * WIDTH * aside + [0.013, 0.007]
            press(rut, tuple(middle), tuple(0.25 * PITCH * ahead), 0.25 * WIDTH, 0.01 * (1.0 + half))
            pressed += np.count_nonzero(rut[FIRST:]) - before
            assert deepest_at(rut, *middle) == 0.01 * (1.0 + half)
    cells = [k for tile in range(int(rut[MADE])) for k in rut[FIRST + TILE * tile + 2 : FIRST + TILE * (tile + 1)]]
    assert np.count_nonzero(cells) == pytest.approx(12 * AREA / CELL**2, rel=0.1)
    assert deepest_at(rut, *(-0.1 * ahead)) == deepest_at(rut, *(0.3 * aside)) == 0.0
    assert deepest_at(rut, *(12.5 * PITCH * ahead)) == 0.0


def test_the_oldest_tile_is_forgotten_where_the_capacity_is_used_up():
    rut, side = np.zeros(RUT), CELL * SIDE
    for k in range(TILES):
        press(rut, (k * side, 0.0), (0.038, 0.0), 0.095, 0.1)
    assert rut[MADE] == TILES
    assert rut[FORGOTTEN] == 0.0
    assert deepest_at(rut, 0.0, 0.0) == 0.1
    press(rut, (-5.0 * side, 0.0), (0.0, 0.038), 0.095, 0.2)
    assert rut[FORGOTTEN] == 1.0
    assert deepest_at(rut, 0.0, 0.0) == 0.0
    assert deepest_at(rut, side, 0.0) == 0.1
    assert deepest_at(rut, -5.0 * side, 0.0) == 0.2


def test_every_named_soil_is_complete():
    """Each has a title, a source for every number, and a slope of unloading; keys given with the name count."""
    source = (resources.files("fmus.ground") / "soils.toml").read_text(encoding="utf-8")
    rows = [line for line in source.splitlines() if "=" in line and not line.startswith("#")]
    assert len(rows) > 40
    assert all(re.search(r"# \[[123]\]$", row) for row in rows)
    for name, table in named().items():
        numbers = SoilTable(name=name)
        assert numbers.k0 == 4e8
        assert numbers.n == table["n"]
    sand = SoilTable(name="dry_sand", rebound=0.1, kphi=2e6)
    assert (sand.k0, sand.rebound, sand.kphi, sand.kc) == (0.0, 0.1, 2e6, 990.0)
