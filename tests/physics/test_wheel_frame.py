"""The speed of a chain is relative to the wheel frame of its wheels: passing pins times the pitch."""

import numpy as np
import pytest
from numba import njit
from scipy.spatial.transform import Rotation

from fmus.physics.chain import wheel_frame as frames
from fmus.physics.chain.layout import closed_polygon
from fmus.physics.wheels import WIDTH

PITCH, LINKS = 0.1524, 64
CENTRES = np.array([[0.0, 0.0], *([x, -0.215] for x in (-0.655, -1.322, -1.989, -2.656, -3.322)), [-4.0, -0.12]])
RADII = np.array([0.2466, *5 * [0.334], 0.291])
PASSING = 4.85  # m/s relative to the wheel frame

_wheel_frame, _chain_speed = frames.wheel_frame, frames.chain_speed  # callable from kernels only


@njit
def wheel_frame(rows, mount):
    return _wheel_frame(rows, mount)


@njit
def chain_speed(x, v, closed, frame):
    return _chain_speed(x, v, closed, frame)


def vehicle(turned=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0), turning=(0.0, 0.0, 0.0), spin=20.0):
    """Rows of the wheels, and pins of a track that moves as a body while its pins pass.

    Pins have positions and velocities. Pins pass along the chords of the polygon at PASSING; ``turned`` (rad, z y x),
    ``turning`` rad/s in the world.
    """
    A, w, c = Rotation.from_euler("ZYX", turned).as_matrix(), np.array(turning), np.array([3.0, -2.0, 1.0])
    rows = np.zeros((len(CENTRES), WIDTH))
    flat = np.column_stack([CENTRES[:, 0], np.zeros(len(CENTRES)), CENTRES[:, 1]])
    rows[:, :3] = flat @ A.T + c
    rows[:, 3:6] = np.array(velocity) + np.cross(w, flat @ A.T)
    rows[:, 6:9] = w + spin * A[:, 1]
    rows[:, 9:12], rows[:, 12:15] = A[:, 1], A[:, 0]
    grows = np.arange(len(CENTRES)) > 0
    pins = closed_polygon(CENTRES, RADII, grows, PITCH, LINKS, 10)
    chord = np.roll(pins, -1, axis=0) - pins
    along = chord / np.linalg.norm(chord, axis=1)[:, None]
    along = 0.5 * (along + np.roll(along, 1, axis=0))
    x = np.column_stack([pins[:, 0], np.zeros(LINKS), pins[:, 1]]) @ A.T
    v = np.array(velocity) + np.cross(w, x)
    v = v + PASSING * np.column_stack([along[:, 0], np.zeros(LINKS), along[:, 1]]) @ A.T
    return rows, x + c, v


MOTIONS = {
    "at rest": {},
    "drives": {"velocity": (4.85, 0.0, 0.0)},
    "nods": {"turning": (0.0, 0.5, 0.0)},
    "drives turned and pitched": {"turned": (0.7, 0.2, 0.1), "velocity": (3.0, 2.0, -0.5)},
    "tumbles": {"turned": (0.7, -0.4, 0.3), "velocity": (3.0, 2.0, 1.0), "turning": (0.4, 0.6, -0.8)},
}


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS.keys())
def test_speed_is_the_same_however_the_vehicle_moves(motion):
    rows, x, v = vehicle()
    still = chain_speed(x, v, True, wheel_frame(rows, 0))
    assert still == pytest.approx(PASSING, rel=2e-3)  # chords bend a little in the straight runs too
    rows, x, v = vehicle(**motion)
    assert chain_speed(x, v, True, wheel_frame(rows, 0)) == pytest.approx(still, rel=1e-12)


@pytest.mark.parametrize("off", [{"velocity": (0.1, 0.0, 0.0)}, {"turning": (0.0, 0.02, 0.0)}])
def test_a_carrier_that_moves_otherwise_is_noticed(off):
    """An error of 2 % in the wheel frame's motion (case 'tumbles') is noticed."""
    rows, x, v = vehicle()
    other, _, _ = vehicle(**off)
    true, wrong = (chain_speed(x, v, True, wheel_frame(each, 0)) for each in (rows, other))
    assert abs(wrong / true - 1.0) > 1e-3


def test_a_chain_in_its_plane_sees_the_same_carrier():
    """A chain in its plane (columns x and z), driving and pitching, has the same wheel frame."""
    rows, x, v = vehicle(velocity=(4.85, 0.0, 0.3), turning=(0.0, 0.5, 0.0))
    rows[:, 1], x[:, 1] = 0.0, 0.0
    flat = [np.ascontiguousarray(each[:, [0, 2]]) for each in (x, v)]
    seen = wheel_frame(rows, 0)
    assert chain_speed(*flat, True, seen) == pytest.approx(chain_speed(x, v, True, seen), rel=1e-14)


@pytest.mark.parametrize("turned", [(0.0, 0.0, 0.0), (0.7, 0.0, 0.0), (-2.0, 0.3, 0.0), (1.0, 0.2, 0.1)])
def test_heading_is_where_the_wheels_would_roll(turned):
    """The heading is level and perpendicular to the axle, whatever the wheel's spin and speed."""
    rows, _, _ = vehicle(turned, velocity=(1.0, 2.0, 3.0), turning=(0.1, 0.2, 0.3), spin=-7.0)
    axle = rows[0, 9:12]
    heading = np.array([*wheel_frame(rows, 0)[3], 0.0])
    assert heading @ axle == pytest.approx(0.0, abs=1e-15)
    assert np.linalg.norm(heading) == pytest.approx(1.0, abs=1e-15)
    assert np.cross(axle, [0.0, 0.0, 1.0]) @ heading > 0.9
    yaw = np.arctan2(heading[1], heading[0])
    assert yaw == pytest.approx(np.arctan2(-axle[0], axle[1]), abs=1e-15)


def test_a_chain_without_wheels_has_a_carrier_at_rest():
    rows = np.zeros((0, WIDTH))
    assert wheel_frame(rows, -1) == ((0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (1.0, 0.0))
