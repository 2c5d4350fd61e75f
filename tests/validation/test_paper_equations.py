"""Equations of the paper hold for the project's elements, knots and curvatures."""

from itertools import pairwise

import numpy as np
import pytest

from fmus.physics.ancf import cable
from orchestrator.results.analyses.deformation import Deformation
from tests.validation.paper import curvature, equations, knots


def values(rows):
    return {row.figures["key"]: row for row in rows}


@pytest.mark.long
def test_equations_of_the_paper_hold_for_the_elements(monkeypatch):
    rows = values(equations.rows())
    assert all(row.ok is True for row in rows.values()), [row.case for row in rows.values() if not row.ok]
    shape, mass, pin = cable.shape, cable.mass, equations.joints.pin_cable

    def heavier(c, M):
        mass(c, M)
        M[0, 0] *= 1.03

    monkeypatch.setattr(equations.cable, "shape", lambda c, xi, S: shape(c, 1.03 * xi, S))
    assert {key for key, row in values(equations.rows()).items() if not row.ok} == {"cubic", "rigid", "mass", "kinetic"}
    monkeypatch.setattr(equations.cable, "shape", shape)
    monkeypatch.setattr(equations.cable, "mass", heavier)
    monkeypatch.setattr(equations.joints, "pin_cable", lambda axis: equations.joints.spherical(2, 2))
    assert {key for key, row in values(equations.rows()).items() if not row.ok} == {"mass", "kinetic", "inertia", "pin"}
    monkeypatch.setattr(equations.joints, "pin_cable", pin)


def test_knots_join_what_section_5_says(monkeypatch):
    rows = values(knots.rows())
    assert all(row.ok is True for row in rows.values())
    assert rows["continuity_3"]["value"] == 0, "the paper's 'multiplicity three which corresponds to C2'"
    assert rows["pin_equations"]["value"] % 3 == 1
    assert rows["sliding_weaker"]["value"] == 4, "no equation of a knot is one of the joint's"
    spline = knots.spline
    monkeypatch.setattr(knots, "spline", lambda m: spline(min(m + 1, 4)))
    assert {key for key, row in values(knots.rows()).items() if not row.ok} >= {"continuity_1", "continuity_2"}


def test_curvature_at_pins_falls_as_elements_squared():
    rows = curvature.rows()
    assert all(row.ok is True for row in rows)
    ends = [row["ends"] for row in rows]
    assert [a / b for a, b in pairwise(ends)] == pytest.approx([4.0, 4.0, 4.0], rel=1e-3)
    assert rows[0]["middle"] == pytest.approx(2.0 / 3.0, rel=1e-6), "one element: the mean all along"
    assert rows[-1]["middle"] == pytest.approx(1.0, abs=0.02)


def test_curvature_of_recorded_links_is_that_of_their_cubics():
    x = np.linspace(0.0, 0.1524, 21)
    shape = 2e-3 * x**2 - 5e-3 * x**3  # curvature 4e-3 - 0.03 x: 4e-3 and -5.72e-4 at the pins
    moved = np.zeros((1, 3, 21, 3))
    moved[0, 0, :, 1], moved[0, 2, :, 1] = shape, 1e3 * shape
    ends, middle = curvature.of_links(Deformation("right_track", np.array([5.0]), x, moved))
    assert ends == pytest.approx(4e-3, rel=1e-9)
    assert middle == pytest.approx(4e-3 - 0.03 * 0.0762, rel=1e-9)
