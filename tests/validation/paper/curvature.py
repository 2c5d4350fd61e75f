"""Curvature at the moment-free ends of links in figure 19, explained by a beam under a uniform load.

A link is one cubic element: its curvature is linear along it, and the condition of zero moment at pinned ends holds
only in the mean with the loads along the link (wheels, ground, its own inertia), not at the pins. Under a uniform load
q the slopes at the pins are exact and the curvature is constant, q l^2 / (12 E I), the mean of the parabola that is 0
at the pins and q l^2 / (8 E I) in the middle. With n elements a link the curvature left at the pins falls as 1 / n^2:
it is 2 / (3 n^2) of the exact one in the middle.
"""

from __future__ import annotations

import numpy as np

from fmus.physics.ancf import cable
from fmus.physics.arrays import Floats
from orchestrator.results.analyses.deformation import Deformation
from orchestrator.studies import Row
from tests.validation import meshes
from tests.validation.ancf import joints, loads, statics

ELEMENTS = (1, 2, 4, 8)  # a link
LOAD = 1e4  # N, on the whole link: half of what a road wheel carries
NEAR = 1e-3  # relative


def rows() -> list[Row]:
    """Rows by number of elements: curvatures of a pinned link over the exact one in the middle."""
    exact = LOAD * meshes.PITCH / (8.0 * meshes.STEEL.EI)
    results = []
    for n in ELEMENTS:
        curved = (pinned(n) / exact).tolist()
        figures = {"elements": n, "ends": curved[0], "middle": curved[len(curved) // 2]}
        expected = 2.0 / (3.0 * n**2)
        good = abs(figures["ends"] / expected - 1.0) < NEAR
        results.append(Row("curvature", "link between held pins", {**figures, "expected": expected}, good))
    return results


def pinned(n: int) -> Floats:
    """Curvature (2 n,), 1/m, at both ends of ``n`` elements of a pinned link under the uniform LOAD."""
    link = meshes.STEEL._replace(l=meshes.PITCH / n)
    mesh = meshes.line(cable, link, n, [((0, 0), joints.held), ((n - 1, 1), joints.held)])
    mesh = mesh.loaded(loads.gravity(mesh, [0.0, 0.0, -LOAD / (link.rhoA * meshes.PITCH)]))
    q = statics.equilibrium(mesh, mesh.start(), steps=1, tolerance=1e-14)
    e = mesh.coordinates(q).reshape(n, 4, 3)
    return np.array([cable.end_curvatures(link, cable.parts(each, 2)) for each in e]).ravel()


def of_links(deformation: Deformation) -> tuple[float, float]:
    """Largest curvature at pins and in the middle of links, 1/m, without the last link (at the cut).

    Computed from second differences of the cubics, which are linear along a link.
    """
    step = deformation.x[1] - deformation.x[0]
    second = np.diff(deformation.displacement[:, :-1, :, 1], 2, axis=2) / step**2
    slope = (second[..., -1] - second[..., 0]) / (second.shape[-1] - 1)
    ends = np.stack([second[..., 0] - slope, second[..., -1] + slope])
    return float(np.abs(ends).max()), float(np.abs(second[..., second.shape[-1] // 2]).max())
