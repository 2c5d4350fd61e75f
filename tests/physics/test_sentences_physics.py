"""Sentences of what kernels' parameters, and the meshes of the validation, refuse."""

import numpy as np
import pytest
from scipy.interpolate import BSpline
from soil_points import PITCH, SAND, WIDTH

from fmus.physics.ancf import cable
from fmus.physics.contact.ground import bumpy_ground
from fmus.physics.contact.soil.parameters import soil
from tests.validation.ancf import bspline, bspline_surface, joints, modes, sliding
from tests.validation.ancf.mesh import Member, Mesh, Support, Tie, nodes
from tests.validation.meshes import TRACK, rope


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"n": 0.0}, "n = 0: must be above 0"),
        ({"kphi": 0.0, "kc": 0.0}, "kc = 0 and kphi = 0"),
        ({"Au": 0.0}, "nearly elastic"),
        ({"rebound": 0.95}, "at most 1 / max"),
        ({"n": 0.7}, "elastic = 0"),
        ({"cohesion": -1.0}, "cohesion = -1: must not be negative"),
        ({"friction_angle": 28.0}, "below 1.5"),
    ],
)
def test_soil_that_cannot_be(changes, words):
    with pytest.raises(ValueError, match=words):
        soil(SAND | changes, PITCH, WIDTH)


SMOOTH = joints.smooth(2)
TIE = Tie((0, 1), (1, 0), SMOOTH)
THREE = bspline.to_cable(bspline.drawn([3], np.random.default_rng(1)))
PLATES = np.zeros((3, 2, 4, 4, 3)), np.ones(2), np.ones(2)


def meshed(*ties, supports=()):
    return Mesh([Member(cable, TRACK, nodes(cable, [0, 0, 0], np.eye(3), 1.0, 2))], ties, supports)


def slid(*velocity):
    b, r, s = rope("point", gravity=0.0)
    s = s._replace(V=np.where(r.point[:, None] > 0, velocity, 0.0))
    for _ in range(500):
        s = sliding.step(b, r, s, 2e-3)


@pytest.mark.parametrize(
    ("cause", "words"),
    [
        (lambda: bumpy_ground(0.0, 1.0, 0.1, 1.0, 1.0, 0.5), "alone rise more than"),
        (lambda: meshed(TIE, TIE), "one other end or one support"),
        (lambda: meshed(TIE, supports=[Support((1, 0), joints.clamped(2))]), "one other end or one support"),
        (lambda: meshed(TIE, Tie((1, 0), (0, 1), SMOOTH)), "follows itself"),
        (lambda: bspline.from_cable(*THREE, [2]), "node 1: a knot of multiplicity 2 joins C1"),
        (lambda: bspline.from_cable(*THREE, [5]), "multiplicity 5"),
        (lambda: bspline.to_cable(BSpline(np.array([0.0, 0, 0, 1, 1, 1]), np.zeros((3, 3)), 2)), "degree 2"),
        (lambda: bspline.demand("glue"), "joint 'glue'"),
        (lambda: bspline.knot_rows(5), "multiplicity 5"),
        (lambda: bspline.control_points(7), "7 knots"),
        (lambda: bspline_surface.from_plates(*PLATES), "are none of 2 by 2 plates"),
        (lambda: modes.displacement("wobble", np.eye(3)[1], 0.1, 1.0), "mode 'wobble': one of rotation, bending"),
        (lambda: slid(30.0, 0.0, 0.0), r"left its rail of 2 m at u = 2\.\d+ m"),
        (lambda: slid(0.0, 0.0, 1e6), r"Newton: a correction of .* at u = 0\.6 m"),
    ],
)  # fmt: skip
def test_what_is_refused_is_named(cause, words):
    with pytest.raises(ValueError, match=words):
        cause()
