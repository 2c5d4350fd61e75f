"""States of chains, kept in a few hundred bytes each, and completed for every kind of link.

What is kept is the motion in the plane of the track that a run has shown: directions of the links, how fast they turn,
where and how fast the first pin is, the mean stretch, and the wheels. The rest is drawn from seeded numbers that no
version of numpy changes: slopes and normals at the ends of a link, lateral places and turns, accelerations, pin forces.
So all kinds of links are evaluated on the same motion. Everything is made by the four operations and square roots, in a
fixed order: a kept state is the same to the last bit on every machine.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.physics.arrays import Floats

Ints = NDArray[Any]

QUARTER = 1 << 14  # directions in a quarter of a turn
PLACE, PACE = 1e-6, 1e-5  # m and m/s: what first pin and wheels are rounded to
TURNING = 2.0**-6  # rad/s, of links and wheels
SPEED = 1e-3  # m/s, of wheels
FARTHEST, FASTEST = 2e3, 2e4  # m and m/s, what can be kept
CLOSINGS = 5  # of Newton's iteration that closes a loop
# Lateral motion by the number of a state: none, as in most runs; small; as much as guides allow; beyond that.
OFFSET = np.array([0.0, 1e-4, 5e-3, 1.6e-2])  # m
LEAN = np.array([0.0, 1e-3, 5e-3, 2e-2])  # rad
ACCELERATION = 500.0  # 1/s2 of slopes and rad/s2 of links; m/s2 of rigid links, 200 of flexible pins
PULL = 4e4  # N, the most that rigid links carry
STEPS = np.array([2e-3, 1e-3, 5e-4, 1.25e-4])  # s, those that an iteration matrix is made for


class Kept(NamedTuple):
    """S states of one chain of n links and m wheels, in the frame of its track: x ahead, z up."""

    first: Ints  # (S, 2) int32, place of the first pin, PLACE
    pace: Ints  # (S, 2) int32, its velocity, PACE
    stretch: NDArray[np.float32]  # (S,) mean strain of the links
    turned: Ints  # (S, n) uint16, direction of a link, see ``direction``
    turning: Ints  # (S, n) int16, how fast it turns from x to z, TURNING
    centre: Ints  # (S, m, 2) int32, place of a wheel, PLACE
    angle: Ints  # (S, m) uint16, half the angle that it has turned by, from x to z, as a direction
    speed: Ints  # (S, m, 2) int16, velocity of a wheel, SPEED
    spin: Ints  # (S, m) int16, angular velocity about y, TURNING


class Elastic(NamedTuple):
    """Coordinates of chains of flexible links, their rates or their accelerations."""

    position: Floats  # (..., nodes, 3) of the pins
    begin: Floats  # (..., links, 3) gradient along a link at its first pin
    end: Floats  # (..., links, 3) at its second pin
    sideways: Floats  # (..., nodes) lateral slope at a pin that the two links of a cable chain share
    axis: Floats  # (..., nodes, 3) gradient along the pin
    begin_normal: Floats  # (..., links, 3) gradient across the link, outwards, at its first pin
    end_normal: Floats  # (..., links, 3) at its second pin


class Rigid(NamedTuple):
    """Motion of chains of rigid links, and the multipliers of their pins."""

    centre: Floats  # (..., links, 3)
    turn: Floats  # (..., links, 4) quaternion
    velocity: Floats  # (..., links, 6) with the angular velocity in the link's own axes
    acceleration: Floats  # (..., links, 6)
    pull: Floats  # (..., pins, 5) three forces, two moments
    increment: Floats  # (..., links, 6) over the step


class Completed(NamedTuple):
    """S states with all that an evaluation needs."""

    coordinates: Elastic
    rates: Elastic
    accelerations: Elastic
    rigid: Rigid
    wheels: Floats  # (S, m, 13) position, quaternion, velocity, angular velocity, in the frame of the track
    jump: Floats  # (S, nodes, 3) m/s, by which the iteration before had other velocities
    step: Floats  # (S,) s

    def at(self, k: int) -> Completed:
        """One of them, without the leading axis."""
        return Completed(*(_at(part, k) for part in self))


def _at(part: Any, k: int) -> Any:
    return type(part)(*(array[k] for array in part)) if isinstance(part, tuple) else part[k]


# --- directions -------------------------------------------------------------------------------------


def direction(code: Ints) -> Floats:
    """Unit vectors (..., 2) of codes: the quarter of the turn, and in it the tangent of half the angle."""
    quarter, u = np.asarray(code, dtype=np.int64) // QUARTER, (np.asarray(code, dtype=np.int64) % QUARTER) / QUARTER
    c, s = (1.0 - u * u) / (1.0 + u * u), 2.0 * u / (1.0 + u * u)
    x = np.choose(quarter, [c, -s, -c, s])
    z = np.choose(quarter, [s, c, -s, -c])
    return np.stack([x, z], axis=-1)


def code(vectors: Floats) -> Ints:
    """The nearest codes of vectors (..., 2), of any length but zero."""
    x, z = vectors[..., 0], vectors[..., 1]
    quarter = np.where((x > 0) & (z >= 0), 0, np.where((x <= 0) & (z > 0), 1, np.where((x < 0) & (z <= 0), 2, 3)))
    along = np.choose(quarter, [x, z, -x, -z])
    across = np.choose(quarter, [z, -x, -z, x])
    u = across / (np.sqrt(along * along + across * across) + along)
    return ((quarter * QUARTER + np.rint(u * QUARTER).astype(np.int64)) % (4 * QUARTER)).astype(np.uint16)


# --- keeping ----------------------------------------------------------------------------------------


def keep(pins: Floats, velocities: Floats, wheels: Floats, pitch: float, closed: bool) -> Kept:
    """States from pins and their velocities (S, nodes, 2), and wheels (S, m, 6): place, half turn, velocity, spin.

    The wheels' columns are x, z, angle/2 in rad from x to z, x', z', and the angular velocity about y. Directions are
    rounded so that no pin is off by more than a link's own rounding. Raises ValueError where there is nothing to keep.
    """
    links = pins.shape[1] if closed else pins.shape[1] - 1
    if not (np.isfinite(pins).all() and np.isfinite(velocities).all() and np.abs(pins).max() < FARTHEST):
        raise ValueError("a state is not finite, or too far away to be kept")
    chords = (np.roll(pins, -1, axis=1) - pins)[:, :links]
    stretch = np.sqrt((chords**2).sum(axis=-1)).mean(axis=1) / pitch - 1.0
    length = pitch * (1.0 + stretch.astype(np.float32).astype(float))[:, None]
    at, speed = _rounded(pins[:, 0], PLACE) * PLACE, _rounded(velocities[:, 0], PACE) * PACE
    turned, turning = np.zeros((len(pins), links), np.uint16), np.zeros((len(pins), links), np.int16)
    for i in range(links):
        j = (i + 1) % pins.shape[1]
        turned[:, i] = code(pins[:, j] - at)
        t = direction(turned[:, i])
        across = np.stack([-t[:, 1], t[:, 0]], axis=1)
        rate = ((velocities[:, j] - speed) * across).sum(axis=1) / length[:, 0]
        turning[:, i] = np.clip(np.rint(rate / TURNING), -(2**15), 2**15 - 1)
        at = at + length * t
        speed = speed + length * (turning[:, i] * TURNING)[:, None] * across
    return Kept(
        _rounded(pins[:, 0], PLACE), _rounded(velocities[:, 0], PACE), stretch.astype(np.float32), turned, turning,
        _rounded(wheels[..., :2], PLACE),
        code(np.stack([np.cos(wheels[..., 2]), np.sin(wheels[..., 2])], axis=-1)),
        np.clip(np.rint(wheels[..., 3:5] / SPEED), -(2**15), 2**15 - 1).astype(np.int16),
        np.clip(np.rint(wheels[..., 5] / TURNING), -(2**15), 2**15 - 1).astype(np.int16),
    )  # fmt: skip


def _rounded(values: Floats, unit: float) -> Ints:
    return np.clip(np.rint(values / unit), -(2**31), 2**31 - 1).astype(np.int32)


# --- completing -------------------------------------------------------------------------------------


class _Plane(NamedTuple):
    """What is kept, as numbers: links that are closed to a loop where they are one."""

    t: Floats  # (S, n, 2) direction of each link
    length: Floats  # (S, 1) of the links, m
    omega: Floats  # (S, n) rad/s from x to z
    pins: Floats  # (S, nodes, 2)
    velocities: Floats  # (S, nodes, 2)


def _sum(a: Floats) -> Floats:
    """Over the links, one after the other."""
    return np.cumsum(a, axis=1)[:, -1]


def _plane(kept: Kept, pitch: float, closed: bool) -> _Plane:
    t, omega = direction(kept.turned), kept.turning * TURNING
    length = pitch * (1.0 + kept.stretch.astype(float))[:, None]
    if closed:
        for _ in range(CLOSINGS):  # turn the links so that their sum is zero
            n = np.stack([-t[..., 1], t[..., 0]], axis=-1)
            t = t - (n * _solved(n, _sum(t))[:, None]).sum(axis=-1)[..., None] * n
            t = t / np.sqrt(t[..., 0] * t[..., 0] + t[..., 1] * t[..., 1])[..., None]
        n = np.stack([-t[..., 1], t[..., 0]], axis=-1)
        omega = omega - (n * _solved(n, _sum(omega[..., None] * n))[:, None]).sum(axis=-1)
    n = np.stack([-t[..., 1], t[..., 0]], axis=-1)
    last = -1 if closed else None
    first, pace = kept.first * PLACE, kept.pace * PACE
    pins = _along(first, (length[..., None] * t)[:, :last])
    velocities = _along(pace, (length[..., None] * omega[..., None] * n)[:, :last])
    return _Plane(t, length, omega, pins, velocities)


def _solved(n: Floats, b: Floats) -> Floats:
    """Solution (S, 2) of (sum n n^T) x = b."""
    a = _sum(np.stack([n[..., 0] * n[..., 0], n[..., 0] * n[..., 1], n[..., 1] * n[..., 1]], axis=-1))
    det = a[:, 0] * a[:, 2] - a[:, 1] * a[:, 1]
    x = a[:, 2] * b[:, 0] - a[:, 1] * b[:, 1], a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return np.stack(x, axis=1) / det[:, None]


def _along(first: Floats, steps: Floats) -> Floats:
    return np.cumsum(np.concatenate([first[:, None], steps], axis=1), axis=1)


class _Lateral(NamedTuple):
    """Motion out of the plane, and what a state is otherwise completed with."""

    drawn: Callable[..., Floats]  # numbers between -1 and 1, (S, ...)
    y: Floats  # (S, nodes) places of the pins, m
    phi: Floats  # (S, n) slopes of the links
    roll: Floats  # (S, n) rad
    lean: Floats  # (S, 1) rad
    askew: Floats  # (S, 1) 0 where all is in the plane, 1 elsewhere


def completed(kept: Kept, pitch: float, closed: bool, seed: int) -> Completed:
    """All that an evaluation needs, the same for the same ``seed``."""
    plane = _plane(kept, pitch, closed)
    states, links, nodes = *plane.omega.shape, plane.pins.shape[1]
    draw = np.random.RandomState(seed)

    def drawn(*shape: int) -> Floats:
        return 2.0 * draw.random_sample((states, *shape)) - 1.0

    number = np.arange(states)
    kind = number % len(OFFSET)
    offset, lean, askew = OFFSET[kind][:, None], LEAN[kind][:, None], (kind > 0)[:, None].astype(float)
    # an offset, a slow way to and fro, and a little of each pin's own
    wave = 1.0 - 4.0 * np.abs(np.arange(nodes) / nodes - 0.5)
    y = offset * (drawn(1) + 0.5 * drawn(1) * wave) + 1e-5 * askew * drawn(nodes)
    before, after = _joined(links, nodes)
    phi = (y[:, after] - y[:, before]) / plane.length
    lateral = _Lateral(drawn, y, phi, lean * drawn(links), lean, askew)
    coordinates, rates = _elastic(plane, lateral, kept.stretch.astype(float)[:, None, None], pitch)
    accelerations = Elastic(*(ACCELERATION * drawn(*part.shape[1:]) for part in coordinates))
    accelerations = accelerations._replace(position=0.4 * accelerations.position)
    rigid = _rigid(plane, lateral, coordinates.position, rates.position)
    jump = 0.05 * drawn(nodes, 3) * np.array([1.0, 0.2, 1.0])
    step = STEPS[number // len(OFFSET) % len(STEPS)]
    return Completed(coordinates, rates, accelerations, rigid, _wheels(kept, lateral), jump, step)


def _joined(links: int, nodes: int) -> tuple[Ints, Ints]:
    """The pins where links begin, and where they end."""
    return np.arange(links), (np.arange(links) + 1) % nodes


def _elastic(plane: _Plane, lateral: _Lateral, strain: Floats, pitch: float) -> tuple[Elastic, Elastic]:
    """Coordinates and rates of links whose mean ``strain`` (S, 1, 1) says how much they are stretched and sheared."""
    drawn, y, phi, roll, _, askew = lateral
    links, nodes = plane.omega.shape[1], y.shape[1]
    t = _in_space(plane.t, 0.0)
    n = _in_space(np.stack([-plane.t[..., 1], plane.t[..., 0]], axis=-1), 0.0)
    give, across, turning = 1e-5 + 0.1 * np.abs(strain), np.array([0.0, 1.0, 0.0]), plane.omega[..., None]
    places = plane.pins + (1e-7 + 0.02 * pitch * np.abs(strain)) * drawn(nodes, 2)
    bends = 1e-4 * drawn(links, 1), 1e-4 * drawn(links, 1)
    begin, end = (
        (1.0 + strain) * (1.0 + give * drawn(links, 1)) * (t + bend * n) / np.sqrt(1.0 + bend * bend)
        + phi[..., None] * across
        for bend in bends
    )
    begin_normal, end_normal = (n - bend * t + give * drawn(links, 3) + roll[..., None] * across for bend in bends)
    # a pin's axis is square to the links that it joins
    mean_t, mean_n, mean_phi, mean_roll = (_of_pins(part, nodes) for part in (t, n, phi[..., None], roll[..., None]))
    axis = across - mean_phi * mean_t - mean_roll * mean_n + give * drawn(nodes, 3)
    sideways = mean_phi[..., 0] + 1e-4 * askew * drawn(nodes)
    coordinates = Elastic(_in_space(places, y), begin, end, sideways, axis, begin_normal, end_normal)
    rates = Elastic(
        _in_space(plane.velocities + 1e-4 * drawn(nodes, 2), 0.05 * askew * drawn(nodes)),
        turning * n + 0.1 * drawn(links, 3),
        turning * n + 0.1 * drawn(links, 3),
        0.1 * askew * drawn(nodes),
        0.1 * drawn(nodes, 3),
        -turning * t + 0.1 * drawn(links, 3),
        -turning * t + 0.1 * drawn(links, 3),
    )
    return coordinates, rates


def _of_pins(part: Floats, nodes: int) -> Floats:
    """Means over the links of each pin of what links have (S, links, ...)."""
    before, after = _joined(part.shape[1], nodes)
    count = np.bincount(before, minlength=nodes) + np.bincount(after, minlength=nodes)
    total = np.zeros((len(part), nodes, part.shape[-1]))
    total[:, before] += part
    total[:, after] += part
    return total / count[:, None]


def _rigid(plane: _Plane, lateral: _Lateral, position: Floats, velocity: Floats) -> Rigid:
    """Rigid links between pins (S, nodes, 3), which they fit to a little."""
    drawn, _, phi, roll, _, askew = lateral
    links, nodes = plane.omega.shape[1], position.shape[1]
    before, after = _joined(links, nodes)
    spin = np.stack([0.1 * askew * drawn(links), -plane.omega, 0.1 * askew * drawn(links)], axis=-1)
    pull = PULL * 0.5 * (1.0 + drawn(1)) * (1.0 + 0.1 * drawn(nodes))
    along = _of_pins(_in_space(plane.t, 0.0), nodes)
    forces = pull[..., None] * along + 500.0 * drawn(nodes, 3)
    forces[..., 1] *= askew
    return Rigid(
        0.5 * (position[:, before] + position[:, after]),
        _turns(plane.t, roll, 1e-3 * drawn(links), phi),
        np.concatenate([0.5 * (velocity[:, before] + velocity[:, after]), spin], axis=-1),
        ACCELERATION * drawn(links, 6),
        np.concatenate([forces, 50.0 * askew[..., None] * drawn(nodes, 2)], axis=-1),
        1e-3 * drawn(links, 6),
    )


def _in_space(plane: Floats, y: Floats | float) -> Floats:
    return np.stack([plane[..., 0], np.broadcast_to(y, plane.shape[:-1]), plane[..., 1]], axis=-1)


def _turns(t: Floats, roll: Floats, nod: Floats, yaw: Floats) -> Floats:
    """Quaternions of links along ``t`` (..., 2), then turned a little about their own axes."""
    c, s = t[..., 0], t[..., 1]
    # of cosine and sine of half the angle the larger one first, then the other
    large = np.sqrt(0.5 * (1.0 + np.abs(c)))
    small = np.abs(s) / (2.0 * large)
    w, y = np.where(c >= 0.0, large, small), np.where(s >= 0.0, -1.0, 1.0) * np.where(c >= 0.0, small, large)
    a, b, d = 0.5 * roll, 0.5 * nod, 0.5 * yaw
    # (w, 0, y, 0) times (1, a, b, d)
    return _normalised(np.stack([w - y * b, w * a + y * d, w * b + y, w * d - y * a], axis=-1))


def _wheels(kept: Kept, lateral: _Lateral) -> Floats:
    """Positions, quaternions, velocities and angular velocities (S, m, 13)."""
    drawn, lean, askew = lateral.drawn, lateral.lean, lateral.askew
    m, half = kept.spin.shape[1], direction(kept.angle)
    w, y = half[..., 0], -half[..., 1]
    a, d = 0.5 * lean * drawn(m), 0.5 * lean * drawn(m)
    # (1, a, 0, d) times (w, 0, y, 0)
    turn = _normalised(np.stack([w, a * w - d * y, y, d * w + a * y], axis=-1))
    places = _in_space(kept.centre * PLACE, 1e-3 * askew * drawn(m))
    speeds = _in_space(kept.speed * SPEED, 0.05 * askew * drawn(m))
    spins = np.stack([0.1 * askew * drawn(m), kept.spin * TURNING, 0.1 * askew * drawn(m)], axis=-1)
    return np.concatenate([places, turn, speeds, spins], axis=-1)


def _normalised(q: Floats) -> Floats:
    square = q * q
    return q / np.sqrt(square[..., :1] + square[..., 1:2] + square[..., 2:3] + square[..., 3:])
