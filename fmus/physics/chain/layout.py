"""Pin positions of a chain at the start: a closed polygon round wheels, or an open one between ends.

All in the plane of the track, (x, z), m, z up. Round the wheels the index grows rearwards (towards -x) on the lower
run, so tangent x lateral axis is the outward normal, and a vehicle driving forward moves its chain along the index.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import ceil

import numpy as np
import scipy  # loads its parts when they are used
from numpy.typing import NDArray

from fmus.kernels.jit import allocating
from fmus.physics.arrays import Floats
from fmus.physics.elementary import atan, atan2, cos, exp, hypot, log, of_each, sin, sinh
from fmus.physics.elimination import solved

SAMPLES = 360  # points on each circle of the belt, or more: a multiple of the teeth


def _directions(angles: Floats) -> Floats:
    """Unit vectors (n, 2) at ``angles`` (n) to the x axis, rad."""
    return np.stack([of_each(cos, angles), of_each(sin, angles)], axis=1)


@cache
def _rim(samples: int) -> Floats:
    """Unit vectors (samples, 2) round a circle."""
    return _directions(-(2.0 * np.pi * np.arange(samples) / samples))


def _belt(centres: Floats, radii: Floats, start: Floats | None, samples: int) -> Floats:
    """Convex belt (k, 2) round circles as a polyline, over the bottom first; begins at ``start`` (2), or foremost."""
    rim = _rim(samples)
    points = (centres[:, None, :] + radii[:, None, None] * rim[None]).reshape(-1, 2)
    try:
        corners = scipy.spatial.ConvexHull(points).vertices
    except scipy.spatial.QhullError:
        raise ValueError("no belt lies round the wheels: their places and radii do not fit together") from None
    hull = points[corners][::-1]  # scipy's order is from x to z, ours from x to -z
    nearness = hull[:, 0] if start is None else -((hull - start) ** 2).sum(axis=1)
    return np.roll(hull, -int(np.argmax(nearness)), axis=0)


def belt_length(centres: Floats, radii: Floats) -> float:
    """Length, m, of a belt round circles of ``centres`` (m, 2) and ``radii`` (m); raises ValueError."""
    belt = _belt(centres, radii, None, SAMPLES)
    return float(of_each(hypot, *(np.roll(belt, -1, axis=0) - belt).T).sum())


def sag_of_longest_span(centres: Floats, radii: Floats, borne: NDArray[np.bool_], pins: Floats) -> float:
    """Largest distance, m, of ``pins`` (n, 2) from a taut belt over its longest span, as with a straightedge.

    The belt lies round circles of ``centres`` (m, 2) and ``radii`` (m); between two circles that ``borne`` (m) marks
    the ground bears the chain, so that it has no free span. 0 for a chain outside of the belt. Raises ValueError.
    """
    belt = _belt(centres, radii, None, SAMPLES)
    chord = np.roll(belt, -1, axis=0) - belt
    on_road = borne[abs(_distances(belt, centres) - radii).argmin(axis=1)]
    length = np.where(on_road & np.roll(on_road, -1), 0.0, of_each(hypot, *chord.T))
    k = int(length.argmax())
    ends = belt[[k, (k + 1) % len(belt)]]
    first, last = _distances(pins, ends).argmin(axis=0)
    x, z = (np.roll(pins, -first, axis=0)[: (last - first) % len(pins) + 1] - ends[0]).T
    along = chord[k] / length[k]
    return float(np.max(x * along[1] - z * along[0], initial=0.0))


def _distances(points: Floats, centres: Floats) -> Floats:
    """Distances (n, m), m, of ``points`` (n, 2) from ``centres`` (m, 2)."""
    away = points[:, None] - centres
    return np.sqrt((away * away).sum(axis=2))


def _seat(centres: Floats, toothed: int, radius: float, teeth: int) -> Floats:
    """Place (2) between two teeth of a sprocket, the one that is furthest from the other wheels."""
    others = np.delete(centres, toothed, axis=0).sum(axis=0) - (len(centres) - 1) * centres[toothed]
    step = 2.0 * np.pi / teeth
    return centres[toothed] + radius * _directions(step * np.round(np.array([atan2(-others[1], -others[0])]) / step))[0]


@allocating
def _walk(path: Floats, pitch: float, links: int) -> tuple[Floats, float]:
    """Pins (links, 2) at chords of one ``pitch``, m, along a closed polyline (k, 2); gap to a full turn, m."""
    k = path.shape[0]
    start = np.zeros(k + 1)
    for i in range(k):
        j = (i + 1) % k
        start[i + 1] = start[i] + hypot(path[j, 0] - path[i, 0], path[j, 1] - path[i, 1])
    pins = np.empty((links + 1, 2))
    pins[0, 0], pins[0, 1] = path[0, 0], path[0, 1]
    i, travelled = 0, 0.0  # the pin lies on segment i
    for n in range(1, links + 1):
        x, z = pins[n - 1, 0], pins[n - 1, 1]
        while hypot(path[(i + 1) % k, 0] - x, path[(i + 1) % k, 1] - z) < pitch:
            i += 1
            if i > 3 * k:
                return pins[:links], np.inf
        here, next_ = i % k, (i + 1) % k
        a0, a1 = path[here, 0] - x, path[here, 1] - z
        b0, b1 = path[next_, 0] - path[here, 0], path[next_, 1] - path[here, 1]
        p, q, r = b0 * b0 + b1 * b1, 2.0 * (a0 * b0 + a1 * b1), a0 * a0 + a1 * a1 - pitch * pitch
        s = (-q + np.sqrt(max(q * q - 4.0 * p * r, 0.0))) / (2.0 * p)
        pins[n, 0], pins[n, 1] = path[here, 0] + s * b0, path[here, 1] + s * b1
        travelled = start[here] + (i // k) * start[k] + s * np.sqrt(p)
    # numpy types a length as Any, with which start[k] might be an array
    return pins[:links], travelled - start[k]  # type: ignore[return-value]


def closed_polygon(
    centres: Floats, radii: Floats, grows: NDArray[np.bool_], pitch: float, links: int, teeth: int, lugs: int = 1
) -> Floats:
    """Pins (links, 2) of a closed polygon of equal chords round circles.

    The circles have ``centres`` (m, 2) and ``radii`` (m). The first pin is the foremost one, or the last one before
    it of every ``lugs`` pins, which alone have lugs. Circles that ``grows`` (m) marks (rims, not teeth) are passed at a
    small distance, which makes up for the difference between the lengths of belt and links. Between the ``teeth`` of
    others the lugs lie in gaps: pins on flanks come to rest there too, at another tension. Raises ValueError if that
    distance exceeds a third of the ``pitch``, m: the track cannot wrap its wheels; if ``lugs`` are not evenly round.
    """
    if links % lugs:
        raise ValueError(f"its number of links, {links}, must be divisible by sprocket.pins_per_gap = {lugs}")
    start, samples = None, SAMPLES
    if not grows.all():
        toothed = int(np.argmin(grows))
        start, samples = _seat(centres, toothed, float(radii[toothed]), teeth), teeth * ceil(SAMPLES / teeth)

    def belt(distance: float) -> Floats:
        return _belt(centres, radii + distance * grows, start, samples)

    limit = pitch / 3.0
    low, high = (_walk(belt(distance), pitch, links)[1] for distance in (-limit, limit))
    if not low > 0.0 > high:
        length, needed = belt_length(centres, radii), links * pitch
        raise ValueError(
            f"{links} links of {pitch} m make {needed:.4f} m, the belt round the wheels {length:.4f} m: it is"
            f" {abs(length - needed):.3g} m too {'long' if length > needed else 'short'}"
        )
    distance = scipy.optimize.brentq(lambda x: _walk(belt(x), pitch, links)[1], -limit, limit, xtol=1e-13)
    pins = _walk(belt(distance), pitch, links)[0]
    return close_exactly(np.roll(pins, -(int(np.argmax(pins[:, 0])) // lugs * lugs), axis=0), pitch, closed=True)


def encloses(pins: Floats, points: Floats) -> bool:
    """Whether all ``points`` (m, 2) lie within the closed polygon ``pins`` (n, 2): an odd number of chords above."""
    (x, z), (next_x, next_z) = pins.T, np.roll(pins, -1, axis=0).T
    u, w = points.T[:, :, None]
    across = (x > u) != (next_x > u)
    above = (next_z - z) * (u - x) > (w - z) * (next_x - x)  # of a chord that goes forward
    return bool(((across & (above == (next_x > x))).sum(axis=1) % 2).all())


def close_exactly(pins: Floats, pitch: float, closed: bool) -> Floats:
    """Nearest polygon to ``pins`` (n, 2) with all chords equal to the ``pitch``, m, to rounding.

    An open polygon keeps its two ends. Raises ValueError where it cannot be closed.
    """
    pins = pins.copy()
    n = len(pins)
    last = n if closed else n - 1
    free = np.ones(n, dtype=bool) if closed else np.r_[False, np.ones(n - 2, dtype=bool), False]
    rounding = max(1e-16, np.finfo(float).eps * pitch * abs(pins).max())  # rounding of a chord far from the origin
    for _ in range(50):
        chord = np.roll(pins, -1, axis=0)[:last] - pins[:last]
        residual = (np.einsum("ij,ij->i", chord, chord) - pitch * pitch) / 2.0
        if abs(residual).max() < rounding:
            return pins
        # the shortest change dp with J dp = -residual is J^T x, J J^T x = -residual
        link, next_link = np.arange(last), (np.arange(last) + 1) % n
        both = free[link] * 1.0 + free[next_link]
        A = np.diag(np.einsum("ij,ij->i", chord, chord) * both)  # J J^T: neighbours share a pin
        for i, j in zip(link[: last if closed else last - 1], next_link, strict=False):
            shared = free[j] * (chord[i, 0] * chord[j, 0] + chord[i, 1] * chord[j, 1])
            A[i, j], A[j, i] = A[i, j] - shared, A[j, i] - shared
        pull = solved(A, -residual)[:, None] * chord
        change = np.zeros_like(pins)
        change[link] -= pull * free[link, None]
        change[next_link] += pull * free[next_link, None]
        pins += change  # rounded once
    raise ValueError(f"its links of {pitch:g} m cannot be closed: {abs(residual).max() / pitch:.3g} m are left open")


def hanging_arc(first: Floats, last: Floats, pitch: float, links: int) -> Floats:
    """Pins (links + 1, 2) of an open chain from ``first`` to ``last`` (2), an arc of equal chords.

    Raises ValueError if the chain is too short.
    """
    span = np.asarray(last, float) - np.asarray(first, float)
    distance = hypot(*span.tolist())
    if distance >= links * pitch:
        raise ValueError(f"{links} links of {pitch} m cannot reach over {distance:.4f} m")
    fraction = (links - 1 - 2.0 * np.arange(links)) / links  # angles relative to the first link's
    steep = scipy.optimize.brentq(lambda a: pitch * of_each(cos, a * fraction).sum() - distance, 0.0, np.pi, xtol=1e-15)
    return chain_of_angles(np.asarray(first, float), -steep * fraction + atan2(float(span[1]), float(span[0])), pitch)


def catenary(first: Floats, last: Floats, pitch: float, links: int) -> Floats:
    """Pins (links + 1, 2) of rigid links that hang between two points (2) under their weight.

    In units of a link's weight, with the horizontal pull H and the vertical pull V at the middle of the chain,
    tan(angle) of link i is (V + i - (links - 1)/2) / H. Raises ValueError as ``hanging_arc`` does, whose arc is
    returned where no such pull exists.
    """
    arc, span = hanging_arc(first, last, pitch, links), np.asarray(last, float) - np.asarray(first, float)
    length, number = links * pitch, np.arange(links) - 0.5 * (links - 1)
    if abs(span[0]) < 1e-3 * length:
        return arc

    def missing(x: Floats) -> Floats:
        angles = of_each(atan, (x[1] + number) / exp(float(x[0])))
        return _directions(angles).sum(axis=0) - [abs(span[0]) / pitch, span[1] / pitch]

    # start from the continuum: (S^2 - dz^2)^1/2 = 2 a sinh(dx / 2 a), slope in the middle dz / (S^2 - dz^2)^1/2
    level = np.sqrt(length * length - span[1] * span[1])
    ratio = scipy.optimize.brentq(lambda u: sinh(u) / u - level / abs(span[0]), 1e-9, 20.0)
    pull = abs(span[0]) / (2.0 * ratio * pitch)
    solution = scipy.optimize.root(missing, [log(float(pull)), pull * span[1] / level], tol=1e-15)
    if np.abs(missing(solution.x)).max() > 1e-9 * links:
        return arc
    angles = of_each(atan, (solution.x[1] + number) / exp(float(solution.x[0])))
    return chain_of_angles(np.asarray(first, float), angles if span[0] > 0.0 else np.pi - angles, pitch)


def chain_of_angles(first: Floats, angles: Floats, pitch: float) -> Floats:
    """Pins (links + 1, 2) from ``first`` (2) of links at the given ``angles`` (links) to the x axis, rad."""
    steps = pitch * _directions(angles)
    return np.vstack([first, first + np.cumsum(steps, axis=0)])


def regular_polygon(pitch: float, links: int) -> Floats:
    """Pins (links, 2) of a regular loop round the origin, turning from x to -z; ``pitch`` in m."""
    angle = -2.0 * np.pi * np.arange(links) / links
    return pitch / (2.0 * sin(np.pi / links)) * _directions(angle)


def ovalling(pins: Floats, rate: float) -> tuple[Floats, Floats]:
    """Angular velocities (n) about y, rad/s, and pin velocities (n, 2), m/s, of an ovalling loop.

    ``pins`` (n, 2) are a regular polygon, n >= 4. A link at the angle phi turns at ``rate`` cos(2 phi), rad/s, which
    keeps the loop closed and without momentum; no link changes its length.
    """
    chord = np.roll(pins, -1, axis=0) - pins
    turning = rate * of_each(cos, 2.0 * of_each(atan2, chord[:, 1], chord[:, 0]))
    along = np.cumsum(turning[:, None] * np.stack([chord[:, 1], -chord[:, 0]], axis=1), axis=0)
    velocity = np.roll(along, 1, axis=0)
    return turning, velocity - velocity.mean(axis=0)


def folded(first: Floats, pitch: float, links: int) -> Floats:
    """Pins (links + 1, 2) of a chain down, one link across, and up to the height of ``first`` (2) again.

    Raises ValueError for an even number of links.
    """
    if links % 2 == 0:
        raise ValueError(f"a fold with one link across needs an odd number of links, not {links}")
    down = np.full(links // 2, -np.pi / 2.0)
    return chain_of_angles(np.asarray(first, float), np.concatenate([down, [0.0], -down]), pitch)


def scale_of_angles(excess: Callable[[float], float], low: float, high: float) -> float:
    """Factor of the links' angles, from ``low`` to ``high``, at which ``excess`` is zero; raises ValueError."""
    if not excess(low) * excess(high) <= 0.0:
        raise ValueError("the chain is too soft: stretched by its own weight, it does not span its ends as an arc")
    return float(scipy.optimize.brentq(excess, low, high, xtol=1e-15))


def rescaled(pins: Floats, last: Floats, pitch: float) -> Floats:
    """Open polygon ``pins`` (n, 2), its link angles scaled by one factor to end at ``last`` (2), at equal height."""
    chord = np.diff(pins, axis=0)
    angles = of_each(atan2, chord[:, 1], chord[:, 0])
    distance = hypot(*(np.asarray(last, float) - pins[0]).tolist())
    factor = scale_of_angles(lambda s: pitch * float(of_each(cos, s * angles).sum()) - distance, 1e-3, 1.5)
    return close_exactly(np.vstack([chain_of_angles(pins[0], factor * angles, pitch)[:-1], last]), pitch, closed=False)


def over_sprocket(centre: Floats, pitch: float, pins_a_turn: float, links: int, lugs: int) -> Floats:
    """Pins (links + 1, 2) of an open chain over half of a sprocket at ``centre`` (2).

    It enters along x above, is seated foremost, and leaves below. One of every ``lugs`` pins has a lug.
    """
    radius = pitch / (2.0 * sin(np.pi / pins_a_turn))
    foremost = (5 * links) // 8 // lugs * lugs
    step = 2.0 * np.pi / pins_a_turn
    inclination = np.zeros(links)  # angle of each link below the x axis
    for i in range(links):
        turn = (i - foremost + 0.5) * step + np.pi / 2.0
        inclination[i] = min(max(turn, 0.0), np.pi)
    angles = -inclination
    pins = chain_of_angles(np.zeros(2), angles, pitch)
    return pins - pins[foremost] + np.asarray(centre, float) + np.array([radius, 0.0])
