"""Profiles of ISO 8608: spectrum, RMS, the same bits everywhere, interpolation, and their place on a terrain."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import welch
from scipy.special import j0

from fmus.ground.roughness import rough_ground, spectral_density
from fmus.ground.terrain import heights, heights_of, terrain
from fmus.physics.contact.terrain.shape import surface

TABLE = {
    "iso_class": "D", "seed": 1, "period": 100.0, "band": (0.011, 2.83), "correlated": False, "start": 2.0,
    "length": 3.0,
}  # fmt: skip


def waves(table, side: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frequencies, amplitudes and phases of a profile, from the definition."""
    k = np.arange(1, int(3.0 * table["period"]))
    n = k / table["period"]
    n = n[(n >= table["band"][0]) & (n <= table["band"][1])]
    density = 1024e-6 * 4.0 ** ("ABCDEFGH".index(table["iso_class"]) - 3) * (n / 0.1) ** -2.0
    raw = np.random.PCG64(table["seed"]).random_raw(2 * len(n))[side * len(n) : (side + 1) * len(n)]
    return n, np.sqrt(2.0 * density / table["period"]), 2.0 * np.pi * (raw // 2**11) / 2**53


@pytest.mark.parametrize("iso_class", "ADH")
@pytest.mark.parametrize("period", [100.0, 187.3])
def test_periodogram_is_the_density_of_the_standard(iso_class, period):
    profile = rough_ground(TABLE | {"iso_class": iso_class, "period": period})
    n = np.arange(len(profile.nodes) // 2 + 1) / period
    inside = (n >= 0.011) & (n <= 2.83)
    for side in (0, 2):
        found = 2.0 * period * np.abs(np.fft.rfft(profile.nodes[:, side]) / len(profile.nodes)) ** 2
        expected = 16e-6 * 4.0 ** "ABCDEFGH".index(iso_class) * (n[inside] / 0.1) ** -2.0
        assert found[inside] == pytest.approx(expected, rel=1e-9)
        assert found[~inside].max() < 1e-15 * expected.max()
        assert found[inside] != pytest.approx(1.001 * expected, rel=1e-9)


def test_root_mean_square_of_class_d():
    """31.16 mm over the whole band with a period of 1 km, and twice that of the class before."""
    n = np.arange(11, 2831) / 1000.0
    assert np.sqrt(spectral_density("D", n).sum() / 1000.0) == pytest.approx(31.16e-3, abs=5e-6)
    short = rough_ground(TABLE)
    assert short.nodes[:, 0].std() == pytest.approx(2.0 * rough_ground(TABLE | {"iso_class": "C"}).nodes[:, 0].std())


def test_a_seed_gives_the_same_bits():
    """2026-11-26: first profiles, from PCG64's raw numbers and our own cosine; changes with nodes a wave."""
    digest = hashlib.sha256(rough_ground(TABLE).nodes.tobytes()).hexdigest()
    assert digest[:16] == "08ab9d8bd57d0733"
    assert hashlib.sha256(rough_ground(TABLE | {"seed": 2}).nodes.tobytes()).hexdigest() != digest


def test_splines_between_the_nodes():
    """Heights of the definition to 0.3 um in class D, slopes to 3e-5; heights, slopes and bends are continuous."""
    shape = terrain({"rough": TABLE})
    x = np.random.default_rng(0).uniform(6.0, 90.0, 200)
    for side, y in enumerate((1.0, -1.0)):
        n, amplitude, phase = waves(TABLE, side)
        angle = 2.0 * np.pi * np.outer(x - TABLE["start"], n) + phase
        found = np.array([surface(shape, each, y) for each in x])
        assert np.abs(found[:, 0] - np.cos(angle) @ amplitude).max() < 3e-7
        assert np.abs(found[:, 1] + np.sin(angle) @ (amplitude * 2.0 * np.pi * n)).max() < 3e-5
        assert np.abs(found[:, 1:4:2]).max(0) == pytest.approx([0.1, 1.0], rel=0.5)
    spacing = shape.rough.spacing
    for i in (300, 301, 302):
        place = TABLE["start"] + i * spacing
        before, after = (np.array(surface(shape, place + e, 1.0)) for e in (-1e-9, 1e-9))
        assert after == pytest.approx(before, abs=1e-5)
    period = np.array([surface(shape, each + TABLE["period"], 1.0) for each in x])
    assert period == pytest.approx(np.array([surface(shape, each, 1.0) for each in x]), abs=1e-9)


def test_sides_and_start():
    ground = {"rough": TABLE}
    x = np.linspace(6.0, 90.0, 400)
    left, right = heights(ground, x, 1.0), heights(ground, x, -1.0)
    assert abs(np.corrcoef(left, right)[0, 1]) < 0.5
    assert (heights(ground, x, 0.6) == left).all()
    assert heights(ground, x, 0.0) == pytest.approx(0.5 * (left + right))
    same = {"rough": TABLE | {"correlated": True}}
    assert heights(same, x, 1.0) == pytest.approx(left, abs=1e-15)
    assert heights(same, x, -1.0) == pytest.approx(left, abs=1e-15)
    assert (heights(ground, np.linspace(-9.0, 2.0, 50), 1.0) == 0.0).all()
    rises = np.abs(heights(ground, np.linspace(2.0, 2.3, 50), 1.0)).max()
    assert 0.0 < rises < 1e-3
    assert heights(ground, x, 1.0).max() < terrain(ground).rough.highest


def test_a_period_without_frequencies_of_the_band_is_refused():
    with pytest.raises(ValueError, match="take a longer period"):
        rough_ground(TABLE | {"period": 0.2})


# surface

SURFACE = TABLE | {"period": 200.0, "isotropic": True, "start": None}
LEVEL = 1024e-6 * 0.1**2  # Gd n^2 of class D, m


def waves_along(made, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies along a line, cycles/m, and mean squares, m^2, of all waves of a surface."""
    count, k = len(made.nodes), np.arange(1, 567)
    powers = 2.0 * np.abs(np.fft.rfft(made.nodes[:, ::2], axis=0)[k] / count) ** 2
    cosines = np.abs(made.directions @ [np.cos(angle), np.sin(angle)])
    return np.outer(k / (count * made.spacing), cosines), powers


def test_density_of_a_surface_along_any_line():
    """Mean squares of all waves by what a line shows of them: Gd in thirds of an octave, from 20 waves a period on."""
    made = rough_ground(SURFACE)
    assert np.hypot(*made.directions.T) == pytest.approx(np.ones(16), rel=1e-15)
    edges = np.geomspace(0.1, 2.0, 14)
    exact = LEVEL * (1.0 / edges[:-1] - 1.0 / edges[1:])
    for angle in np.linspace(0.0, np.pi, 37):
        n, powers = waves_along(made, angle)
        found = np.histogram(n, edges, weights=powers)[0]
        assert found == pytest.approx(exact, rel=0.06)
        assert found.sum() == pytest.approx(exact.sum(), rel=0.01)
        assert found.sum() != pytest.approx(1.02 * exact.sum(), rel=0.01)
        assert n.max() <= 2.83


def test_variance_and_correlation_of_a_surface():
    """Correlation over a distance is int g(v) J0(2 pi v r) dv, whatever the direction: so lines beside cohere."""
    low, high = band = (0.05, 2.83)
    made = rough_ground(SURFACE | {"band": band})
    total = LEVEL * np.arccos(low / high) / low
    assert waves_along(made, 0.0)[1].sum() == pytest.approx(total, rel=1e-9)

    def density(v):
        b = np.arccos(v / high)
        return LEVEL * (b + 1.0 / np.tan(b)) / v**2

    for r in (0.3, 1.0, 2.159, 5.0):
        exact = quad(lambda v, r=r: density(v) * j0(2.0 * np.pi * v * r), low, high, limit=500, epsrel=1e-7)[0]
        for angle in (0.0, 0.4, 0.7854, 1.5708, 2.5):
            n, powers = waves_along(made, angle)
            found = (powers * np.cos(2.0 * np.pi * n * r)).sum()
            assert found == pytest.approx(exact, abs=0.003 * total)
            assert found != pytest.approx(exact + 0.004 * total, abs=0.003 * total)


def slope_and_level(shape, angle: float, end: float = 2.5) -> tuple[float, float]:
    """Slope of the density over the frequency and its mean over Gd, by Welch's method along 8 km.

    Between 0.03 cycles/m and ``end``.
    """
    along, step = np.arange(64_000) * 0.125, 0.125
    n, density = welch(heights_of(shape, along * np.cos(angle), along * np.sin(angle)), 1.0 / step, nperseg=1600)
    inside = (n > 0.03) & (n < end)
    n, ratio = n[inside], density[inside] * n[inside] ** 2 / LEVEL
    third = np.digitize(np.log(n), np.linspace(np.log(0.03), np.log(end), 20))
    means = [(np.log(n[third == i]).mean(), np.log(ratio[third == i].mean())) for i in np.unique(third)]
    return float(np.polyfit(*np.transpose(means), 1)[0] - 2.0), float(ratio.mean())


@pytest.mark.parametrize("degrees", [0, 45, 90])
def test_measured_spectrum_of_a_surface(degrees):
    slope, level = slope_and_level(terrain({"rough": SURFACE}), np.radians(degrees))
    assert slope == pytest.approx(-2.0, abs=0.05)
    assert level == pytest.approx(1.0, abs=0.1)


def test_lanes_have_the_density_along_x_alone():
    shape = terrain({"rough": TABLE | {"period": 200.0, "correlated": True, "start": -1e6}})
    assert slope_and_level(shape, 0.0)[1] == pytest.approx(1.0, abs=0.1)
    assert slope_and_level(shape, np.radians(45), 1.9)[1] == pytest.approx(np.sqrt(0.5), abs=0.1)
    assert np.ptp(heights_of(shape, 7.0, np.linspace(0.0, 100.0, 50))) == 0.0  # 90 degrees: smooth


def test_a_vehicle_meets_the_same_ground_at_any_heading():
    """Heave and roll of the plane of least squares under the wheels of an m113, over 1 km of way."""
    shape, moved = terrain({"rough": SURFACE}), []
    along, across = (each.ravel() for each in np.meshgrid(np.linspace(-1.33, 1.33, 5), [-1.08, 1.08]))
    design = np.linalg.pinv(np.stack([np.ones(10), along, across], axis=1))
    way = np.arange(8000)[:, None] * 0.125
    for heading in np.radians([0, 45, 90]):
        c, s = np.cos(heading), np.sin(heading)
        h = heights_of(shape, c * (way + along) - s * across, s * (way + along) + c * across)
        moved.append(np.diff(h @ design.T, axis=0).std(axis=0)[[0, 1, 2]])
    assert moved[1] == pytest.approx(moved[0], rel=0.06)
    assert moved[2] == pytest.approx(moved[0], rel=0.06)


@pytest.mark.long
def test_a_seed_gives_the_same_bits_of_a_surface():
    """2026-11-27: first surfaces."""
    made = rough_ground(SURFACE)
    digest = hashlib.sha256(made.nodes.tobytes() + made.directions.tobytes()).hexdigest()
    assert digest[:16] == "350816deb6057934"
    x, y = np.random.default_rng(0).uniform(-60.0, 60.0, (2, 2000))
    assert np.abs(heights({"rough": SURFACE}, x, y)).max() < made.highest
    fading = SURFACE | {"start": 2.0, "length": 3.0}
    assert (heights({"rough": fading}, [1.0, 2.0], [0.3, 9.0]) == 0.0).all()
    assert heights({"rough": fading}, x[x > 5.0], y[x > 5.0]) == pytest.approx(
        heights({"rough": SURFACE}, x, y)[x > 5.0]
    )
