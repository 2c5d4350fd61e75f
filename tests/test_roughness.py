"""Profiles of ISO 8608: spectrum, RMS, the same bits everywhere, interpolation, and their place on a terrain."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

from fmus.ground import heights, terrain
from fmus.physics.contact.terrain.surface import surface
from fmus.roughness import CLASSES, REFERENCE, rough_ground, spectral_density

TABLE = {
    "iso_class": "D",
    "seed": 1,
    "period": 100.0,
    "band": (0.011, 2.83),
    "correlated": False,
    "start": 2.0,
    "length": 3.0,
}


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
    assert [CLASSES[name] for name in "ABDH"] == [16e-6, 64e-6, 1024e-6, 262144e-6]
    assert pytest.approx(1024e-6) == spectral_density("D", np.array([REFERENCE]))[0]


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
