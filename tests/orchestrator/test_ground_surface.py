"""The drawn line of the ground against the ground of the contact law."""

import numpy as np
import pytest

from fmus.ground.contact import ground_shape
from fmus.physics.contact.ground import surface_depth
from orchestrator.results.ground_surface import ground
from orchestrator.results.rotation import link_axes
from orchestrator.scene.scene import load

BUMP = "ground.bump={start=2, rise=0.2, slope=0.35, length=0.6, radius=0.15}"


@pytest.mark.parametrize("settings", [(), (BUMP,), (BUMP, "start.position=[3.0, -1.0, 0.5]", "start.heading=0.4")])
def test_points_of_the_line_lie_on_the_ground(settings):
    scene = load("straight", "rigid", settings)
    profile = ground(scene.model_dump())
    bump = scene.ground.bump and scene.ground.bump.model_dump()
    shape = ground_shape(scene.vehicle.model_dump(), {"bump": bump}, {"start.height": 0.0})
    along = np.concatenate([np.linspace(-1.0, 6.0, 300), profile.along])
    depths = [
        surface_depth(shape, x, z - profile.start[2])[0] for x, z in zip(along, profile.height_at(along), strict=True)
    ]
    # a straight line between two points of an arc is below it by less than this
    assert np.abs(depths).max() < 0.15 * (0.35 / 8) ** 2 / 8 * 1.1
    assert len(profile.along) == (36 if bump else 0)
    assert not bump or profile.height_at(np.array([profile.along.mean()]))[0] == pytest.approx(profile.level + 0.2)


def test_axes_of_a_loop_point_outwards():
    angle = -np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)  # in the direction of tracks: forward over the top
    pins = np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=-1)
    axes = link_axes(pins, np.array([0.0, 1.0, 0.0]), 12)
    middle = 0.5 * (pins + np.roll(pins, -1, axis=0))
    outwards = np.sign(np.einsum("ni,ni->n", axes[..., 2], middle))
    np.testing.assert_allclose(
        np.einsum("nij,nik->njk", axes, axes), np.broadcast_to(np.eye(3), (12, 3, 3)), atol=1e-14
    )
    assert (outwards == outwards[0]).all()
    np.testing.assert_allclose(axes[..., 1], np.broadcast_to([0.0, 1.0, 0.0], (12, 3)), atol=1e-15)
