"""Slip of the pads and torque of the sprocket of a driving track, from its pins alone.

A short turn records every step of both tracks. Planes, velocities and loads are computed here from places; laws and
numbers are those of the vehicle's table.
"""

from typing import NamedTuple

import numpy as np
import pytest
from rolling_links import WHEELS, rocking
from scipy.optimize import brentq

from fmus.track.choices import TRACKS
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results.run_data import Window
from orchestrator.scene.scene import load

G, PITCH, MASS, INERTIA, FACE, WIDTH = 9.81, 0.1524, 18.02, 0.04, 0.029, 0.378
STIFFNESS, DAMPING, SOFT, MU, CREEP, LEVEL = 2e6, 5e3, 1e-3, 0.3, 0.01, -0.578  # per link on the ground
RADIUS, TIP = 10.0 * PITCH / (2.0 * np.pi), 0.28  # m; no tooth reaches a pin beyond the tip
FIRST = 2.006 - 0.655  # m, first wheel forward of the hull's middle
STEADY = Window(2.2, 3.0)
SIDES = ("left", "right")
DRIVEN = {(4, 8): STEADY, (8, 12): STEADY, (14, 18): Window(4.0, 6.0)}


class Track(NamedTuple):
    """A track of 64 links over time, world axes, SI, with signals of its vehicle."""

    t: np.ndarray  # (k,)
    pins: np.ndarray  # (k, 64, 3)
    force: np.ndarray  # (2, k, 64, 3) of each pin on the link that begins there, at begin and end of the step before
    axis: np.ndarray  # (k, 3) of the pins, to the left: normal of the plane through them
    hub: np.ndarray  # (k, 3) centre of the sprocket
    torque: np.ndarray  # (k, 3) on the sprocket, mean over the step before
    ground: np.ndarray  # (k, 3) force of the ground
    slip: np.ndarray  # (k,)
    wheels: np.ndarray  # (k, 5) upward force on each road wheel
    yaw: np.ndarray  # (k,)
    place: np.ndarray  # (k, 3) of the hull
    velocity: np.ndarray  # (k, 3)
    turning: np.ndarray  # (k,) rad/s

    def within(self, window):
        rows = (self.t > window.start + 1e-9) & (self.t <= window.end + 1e-9)
        return Track(*(each[:, rows] if each is self.force else each[rows] for each in self))


@pytest.fixture(scope="module")
def tracks(tmp_path_factory):
    """Return a function that gives both tracks of a run by kind of link and sprocket speeds, rad/s."""
    made = {}

    def once(kind, speeds=(8, 12)):
        if (kind, speeds) not in made:
            path = tmp_path_factory.mktemp("logs") / "pulling.mcap"
            settings = (f"run.stop={DRIVEN[speeds].end}", "run.links=1", 'track.link_outputs=["position", "force"]')
            of_drives = (f"drive.left.speed={speeds[0]}", f"drive.right.speed={speeds[1]}", "drive.ramp_start=0.1")
            assert simulate(load("turn", kind, (*settings, *of_drives)), path)["status"] == "ok"
            with Log(path) as log:
                made[kind, speeds] = {side: read(log, side) for side in SIDES}
        return made[kind, speeds]

    return once


def read(log, side):
    """Track of a side from a log, from 0.2 s on."""
    hull, track, links, drive = (
        log.read(topic)
        for topic in ("/chassis/out", f"/{side}_track/out", f"/{side}_track/links", f"/{side}_drive/out")
    )
    rows = links.t > 0.2
    assert np.array_equal(links.t, track.t)

    def columns(series, *names):
        place = {name: k for k, name in enumerate(series.names)}
        return series.values[rows][:, [place[name] for name in names]]

    def vector(series, name):
        return columns(series, *(f"{name}.{axis}" for axis in "xyz"))

    pins, force = (
        np.stack([vector(links, f"joint[{i}].{what}") for i in range(1, 65)], axis=1) for what in ("position", "force")
    )
    means = "link_outputs.interval" in str(log.attachment("system.json"))  # else forces are instantaneous
    force = np.stack([force if means else np.concatenate([force[:1], force[:-1]]), force])
    yaw = columns(hull, "yaw")[:, 0]
    normal = np.linalg.svd(pins - pins.mean(axis=1, keepdims=True), full_matrices=False)[2][:, 2]
    to_left = np.sign(normal[:, 1] * np.cos(yaw) - normal[:, 0] * np.sin(yaw))
    return Track(
        links.t[rows], pins, force, to_left[:, None] * normal,
        vector(drive, "sprocket.position"), vector(track, "sprocket.torque"), vector(track, "ground.force"),
        columns(track, "slip")[:, 0], columns(track, *(f"road_wheel[{i}].force.z" for i in range(1, 6))),
        yaw, vector(hull, "chassis.position"), vector(hull, "chassis.velocity"),
        columns(hull, "chassis.angular_velocity.z")[:, 0],
    )  # fmt: skip


def ahead(track, x, y):
    """Components forward and to the left of the hull; x, y (k, ...)."""
    c, s = (f(track.yaw).reshape(-1, *[1] * (np.ndim(x) - 1)) for f in (np.cos, np.sin))
    return x * c + y * s, y * c - x * s


class Pads(NamedTuple):
    """Points of the links on the ground, shape (k, 64, 2 along, 2 across)."""

    load: np.ndarray  # N
    back: np.ndarray  # m/s backwards over the ground
    left: np.ndarray  # m/s to the left

    def push(self, friction=MU):
        """Forward force of the ground, mean over time, N."""
        return force_of(self.load, self.back, self.left, friction) / len(self.load)

    @property
    def slip(self):
        return (self.load * self.back).sum() / self.load.sum()


def force_of(load, back, left, friction=MU):
    """Sum of the forward friction of the ground, N."""
    return (friction * load * back / np.sqrt(back**2 + left**2 + CREEP**2)).sum()


def pads(track):
    pins = track.pins
    e = np.roll(pins, -1, axis=1) - pins
    middle, e = pins + 0.5 * e, e / np.linalg.norm(e, axis=2, keepdims=True)
    out = np.cross(e, track.axis[:, None])
    shift = PITCH / np.sqrt(12.0) * np.array([-1.0, 1.0])
    across = 0.25 * WIDTH * np.array([-1.0, 1.0])
    place = (
        (middle + FACE * out)[:, :, None, None]
        + shift[:, None, None] * e[:, :, None, None]
        + across[:, None] * track.axis[:, None, None, None]
    )
    speed = np.gradient(place, track.t, axis=0)
    depth = LEVEL - place[..., 2]
    fading = np.clip(depth / SOFT, 0.0, 1.0)
    fading = fading**2 * (3.0 - 2.0 * fading)
    load = 0.25 * np.maximum(STIFFNESS * depth - DAMPING * fading * speed[..., 2], 0.0) * (depth > 0.0)
    along, left = ahead(track, speed[..., 0], speed[..., 1])
    return Pads(load, -along, left)


@pytest.mark.long
@pytest.mark.parametrize(("kind", "band"), [("rigid", 1e-3), ("flexible", 8e-3)])
def test_pads_slip_and_push_as_their_motion_says(tracks, kind, band):
    """Load, friction and slip of pads follow from places alone, for chains whose axes the places show."""
    for side in SIDES:
        track = tracks(kind)[side].within(STEADY)
        contact = pads(track)
        push = ahead(track, *track.ground[:, :2].T)[0].mean()
        assert contact.load.sum() / len(track.t) == pytest.approx(track.ground[:, 2].mean(), rel=band)
        assert contact.push() == pytest.approx(push, rel=band)
        assert contact.slip == pytest.approx(track.slip.mean(), rel=band)
        assert contact.push(1.03 * MU) != pytest.approx(push, rel=band)


@pytest.mark.long
@pytest.mark.parametrize(
    ("speeds", "kind", "band"),
    [
        ((8, 12), "rigid", 0.02),
        ((8, 12), "flexible", 0.02),
        pytest.param((4, 8), "rigid", 0.02, marks=pytest.mark.study),
        pytest.param((14, 18), "rigid", 0.06, marks=pytest.mark.study),
    ],
)
def test_rocking_links_explain_the_slip_of_a_track(tracks, speeds, kind, band):
    """The slip of a track follows from thrust, yaw and the static rocking of its links."""
    for side, speed in zip(SIDES, speeds, strict=True):
        track = tracks(kind, speeds)[side].within(DRIVEN[speeds])
        rocked = rocked_by_loads(track, RADIUS * speed)
        ratios = rocking_of(pads(track), track) / (RADIUS * speed)
        np.testing.assert_allclose([rocked.mean, rocked.spread], ratios, rtol=0.2)
        assert slip_of(track, rocked, RADIUS * speed) == pytest.approx(track.slip.mean(), rel=band)
    # without rocking, and with pads nearer to the pins, the result would differ for the right track
    assert slip_of(track, rocked, 0.0) < (1.0 - 2.0 * band) * track.slip.mean()
    assert abs(rocked_by_loads(track, RADIUS * speed, 0.65 * FACE).mean / ratios[0] - 1.0) > 0.2


def rocked_by_loads(track, speed, face=FACE):
    """``Rocking`` of the ground run under the mean loads of its wheels and the pull of its rear strand.

    A chain at ``speed``, m/s, needs m v^2 of the pull (m per length) to follow its own curves.
    """
    push, load = ahead(track, *track.ground[:, :2].T)[0].mean(), track.ground[:, 2].mean()
    x, _ = ahead(track, *(track.pins[..., k] - track.place[:, None, k] for k in range(2)))
    behind = FIRST + WHEELS[-1] - x
    strand = (behind > 0.1) & (behind < 0.4) & (track.pins[..., 2] < track.hub[:, 2:])
    pull = np.linalg.norm(track.force[1], axis=2)[strand].mean() - MASS / PITCH * speed**2
    return rocking(track.wheels.mean(axis=0), pull, push / load, face)


def rocking_of(contact, track):
    """Backward speed of pads relative to their link's middle, m/s: mean and root mean square, by load."""
    middles = 0.5 * (track.pins + np.roll(track.pins, -1, axis=1))
    speed = np.gradient(middles, track.t, axis=0)
    along, _ = ahead(track, speed[..., 0], speed[..., 1])
    load = contact.load.sum(axis=3)
    relative = contact.back.mean(axis=3) + along[..., None]
    mean = (load * relative).sum() / load.sum()
    return np.array([mean, np.sqrt((load * (relative - mean) ** 2).sum() / load.sum())])


def slip_of(track, rocked, speed):
    """Mean slip at which pads that rock at a chain's ``speed`` give the thrust of a track, m/s."""
    push, load = ahead(track, *track.ground[:, :2].T)[0].mean(), track.ground[:, 2].mean()
    _, v = ahead(track, *track.velocity[:, :2].T)
    turning = track.turning.mean()
    left = v.mean() + turning * (rocked.x + FIRST)
    across = turning * 0.25 * WIDTH * np.array([[-1.0], [1.0]])
    uneven = speed * (rocked.ahead - rocked.mean) + across

    def missing(slip):
        return force_of(0.5 * load * rocked.share, slip + uneven, left) - push

    return brentq(missing, -1.0, 1.0)


@pytest.mark.long
@pytest.mark.parametrize("kind", TRACKS)
def test_forces_of_pins_turn_the_sprocket(tracks, kind):
    """Moments and momentum of the links between two cuts give the sprocket's torque."""
    for side in SIDES:
        pulled, rest, torque, strands = moments(tracks(kind)[side])
        for steps, band in ((100, 0.005), (500, 0.001)):
            assert apart(pulled + rest, torque, steps) < band
            assert apart(1.01 * pulled + rest, torque, steps) > band
        assert apart(RADIUS * strands, torque, 100) > 0.08  # the pulls of the strands at the pitch circle


def apart(values, wanted, steps):
    """Largest error of sums over windows of ``steps`` steps, over the sum of amounts."""
    whole = len(wanted) // steps * steps
    open_by, size = (each[:whole].reshape(-1, steps).sum(axis=1) for each in (values - wanted, np.abs(wanted)))
    return float(np.abs(open_by / size).max())


def moments(track):
    """Impulses between two records about the pins' axis, N m s, and of the strands' pulls, N s.

    The axis is that through the hub. Returns the impulses of the pulls at the two cuts, of weight and momentum of the
    links between them, and of the sprocket's torque, which is the sum of both; and the difference of the amounts of the
    pulls. The links are those from the last pin before the teeth to the first one after them. About the moving hub c, M
    = dL/dt + c' x P; a pin has no moment about its own axis, but one about the sprocket's axis where that is inclined.
    """
    t, arm = track.t, track.pins - track.hub[:, None]
    speed, moved = np.gradient(track.pins, t, axis=0), np.gradient(track.hub, t, axis=0)
    axis, h = 0.5 * (track.axis[1:] + track.axis[:-1]), np.diff(t)
    near = np.linalg.norm(arm, axis=2) < TIP
    near = near[1:] | near[:-1]
    links = 1.0 * (near | np.roll(near, -1, axis=1))  # (k, 64) 1: between the cuts
    cuts = links - np.roll(links, 1, axis=1)  # 1 at the first pin, -1 at the last

    def between(of_links, where):
        """Component along the pins of the sum of (2, k, 64, 3), mean of both ends of each interval."""
        return np.einsum("skic,ki,kc->k", of_links, where, axis) / 2.0

    def ends(a):
        return np.stack([a[:-1], a[1:]])

    after = np.roll(arm, -1, axis=1)
    middle, v = 0.5 * (arm + after), 0.5 * (speed + np.roll(speed, -1, axis=1))
    turned = np.cross(after - arm, np.roll(speed, -1, axis=1) - speed) / PITCH**2
    spin = MASS * np.cross(middle, v) + INERTIA * turned
    force = track.force[:, 1:]
    pulled = h * between(np.cross(ends(arm), force), cuts)
    carried = np.cross(middle, [0.0, 0.0, -MASS * G]) - np.cross(moved[:, None], MASS * v)
    rest = h * between(ends(carried), links) - np.einsum("kic,ki,kc->k", np.diff(spin, axis=0), links, axis)
    strands = h * (np.linalg.norm(force, axis=3).mean(axis=0) * -cuts).sum(axis=1)
    return pulled, rest, h * (track.torque[1:] * axis).sum(axis=1), strands
