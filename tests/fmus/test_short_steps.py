"""Steps of very different lengths in turn: oscillations hardly grow, vehicles go on, drives keep what they know."""

import numpy as np
import pytest
from vehicle_in_process import InProcess

from fmus.drives import mount
from fmus.kernels.jit import plain
from fmus.physics.chain.implicit import SINCE, is_short, set_length
from fmus.physics.chain.link_columns import GROUND
from fmus.physics.integrate.generalized_alpha import WITHOUT_MEMORY, auxiliary, coefficients
from orchestrator.scene.scene import load

H = 1e-3  # s
LOAD = 8e4  # N on a track
SHORT = [(1e-9,), (1e-9, 1e-7, 1e-9), (1e-6,), (1e-5, 1e-8), (5e-5,), (1e-4,), (1.9e-4,), (1e-4,) * 5, (1e-5,) * 20]


def swing(radius, omega, lengths, memory=True):
    """Matrix of the steps of an oscillator, of its state [x, v / omega, a / omega^2, vdot / omega^2]."""
    alpha, kept = plain(coefficients)(radius), np.zeros(2)
    columns = []
    for unit in np.eye(4):
        x, v, a, vdot = unit * (1.0, omega, omega**2, omega**2)
        plain(set_length)(kept, H)
        for h in lengths:
            short = memory and plain(is_short)(kept, h)
            c = WITHOUT_MEMORY if short else alpha
            x0 = x + h * v + h * h * (0.5 - c.beta) * a + h * h * c.beta * plain(auxiliary)(c, a, vdot, 0.0)
            x1 = x0 / (1.0 + omega**2 * h * h * c.beta * (1.0 - c.alpha_f) / (1.0 - c.alpha_m))
            after = plain(auxiliary)(c, a, vdot, -(omega**2) * x1)
            x, v, vdot = x1, v + h * ((1.0 - c.gamma) * a + c.gamma * after), -(omega**2) * x1
            if short:
                kept[SINCE] += h
            else:
                a = after
                plain(set_length)(kept, h)
        columns.append(np.array([x, v / omega, a / omega**2, vdot / omega**2]))
    return np.array(columns).T


def growth(radius, lengths, memory=True):
    """Largest growth of an oscillation by the steps, over all rates below those of a link."""
    matrices = (swing(radius, omega, lengths, memory) for omega in np.logspace(2, 6, 60))
    return max(np.abs(np.linalg.eigvals(matrix)).max() for matrix in matrices)


@pytest.mark.parametrize("short", SHORT, ids=str)
def test_no_oscillation_grows_by_much(short):
    for radius, bound in ((0.0, 1.005), (0.4, 1.005), (0.9, 1.05)):
        assert growth(radius, (H, *short)) < bound


def test_one_method_for_all_lengths_would_let_them_grow():
    assert growth(0.4, (H, 1e-5), memory=False) > 10.0
    assert growth(0.4, (H, 1e-4), memory=False) > 1.1
    assert growth(0.4, (H, H / 4.0), memory=False) < 1.0 + 1e-3, "halved steps need nothing"


@pytest.mark.long
@pytest.mark.parametrize("links", ["flexible", "rigid"])
@pytest.mark.parametrize("short", [(1e-9, 1e-7, 1e-9), (2e-5,)], ids=str)
def test_a_vehicle_under_steps_of_very_different_lengths(links, short):
    """A host that meets events takes such steps; the tracks tore at 1e6 N or the arms left their reach."""
    settings = ("drive.ramp_start=0", "drive.ramp_time=0.2", "run.step=1 ms", "track.step=1 ms", "run.links=1")
    ends = []
    for lengths in ((H,), (H, *short)):
        vehicle, t = InProcess(load("straight", links, settings)), 0.0
        track = vehicle["left_track"]
        while t < 0.25:
            for h in lengths:
                vehicle.step(h)
                t += h
                s = track.model.s
                by_links, by_wrench = s.on_links_sum[:, GROUND : GROUND + 3].sum(axis=0), h * s.mean[-1, :3]
                assert np.abs(by_links + by_wrench).max() < 1e-9 * LOAD * h + 1e-12
            tension = track.y[track.outputs.index("tension.mean")]
        extremes = [track.y[track.outputs.index(f"tension.{name}")] for name in ("min", "max")]
        ends.append((tension, *extremes))
        assert track.model.counters[3] == 0, "no step is halved"
    np.testing.assert_allclose(ends[1], ends[0], rtol=0.0, atol=1.5e3)


def moved(steps, kick=0.0):
    """Error of the extrapolated end velocity of a mount with constant acceleration, m/s, after each step."""
    x, t, errors = np.zeros(mount.WIDTH), 0.0, []
    for h in steps:
        u = np.zeros(19)
        u[3], u[7] = 1.0, 5.0 + 9.0 * t + (kick if t > 2.5 * H else 0.0)
        m = plain(mount.extrapolate)(1, x, h, u, 0)
        plain(mount.finish_step)(1.0, x, h, u, 0, m)
        t += h
        errors.append(abs(m.velocity[0] - 5.0 - 9.0 * t))
    return errors


def test_a_drive_keeps_the_acceleration_of_its_mount_over_a_short_step():
    """The difference of velocities a nanosecond apart is noise, which a step of a millisecond multiplies by 1e6."""
    errors = moved((H, H, H, 1e-9, H, 1e-5, 1e-8, H), kick=1e-7)
    assert errors[0] == pytest.approx(9.0 * H), "the first step knows no acceleration"
    assert max(errors[1:]) < 1e-6
    assert max(moved((1e-9, H, H))[2:]) < 1e-12
    assert moved((1e-9, H, H))[1] == pytest.approx(9.0 * H), "the acceleration of a much shorter time is not used"
