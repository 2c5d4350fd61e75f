"""Figures of a chain: between pins, free, or over a sprocket."""

from __future__ import annotations

import numpy as np

from fmus.vehicles.sides import pins_a_turn, pitch_radius, way_a_turn
from orchestrator.log.reader import Missing
from orchestrator.results.figures import ANY, SIDE, SPAN, Shown, figure
from orchestrator.results.run_data import (
    EVER,
    Floats,
    RunData,
    Unrecorded,
    Window,
    drive_of,
    mean,
    sprocket_end,
    track_of,
)

SPAN_MARGIN = 0.25  # of the axle distance: links of a span keep this distance from both axles


# --- chain between pins ----------------------------------------------------------------------------


@figure("m", Shown("sag", "m", 6, on="pinned"), of=ANY)
def sag(run: RunData, of: str, window: Window) -> float:
    """Depth of the lowest pin below the highest, m."""
    links = run.links(of or run.tracks[0], window)
    return mean(links.t, links.up.max(axis=1) - links.up.min(axis=1))


@figure("N", Shown("tension at the ends", "kN", 5, on="pinned"), of=ANY)
def end_tension(run: RunData, of: str, window: Window) -> float:
    """Force in the pin at the end of a hanging chain (the largest of all), N, mean over the interval of records."""
    t, forces = _joint_forces(run, of, window)
    return mean(t, forces.max(axis=1))


# --- free chains -----------------------------------------------------------------------------------


@figure("N", of=ANY)
def joint_force(run: RunData, of: str, window: Window) -> float:
    """Mean force in the pins, N; each is the size of its mean over the interval of records."""
    return mean(*_joint_forces(run, of, window))


@figure("1", of=ANY)
def joint_force_spread(run: RunData, of: str, window: Window) -> float:
    """Largest difference of the force in a pin, mean over the interval of records, from the mean, over the mean."""
    t, forces = _joint_forces(run, of, window)
    return float(np.abs(forces / mean(t, forces) - 1.0).max())


@figure("1", of=ANY)
def hoop_strain(run: RunData, of: str, window: Window) -> float:
    """Mean strain of the chords between the pins of a loop."""
    links = run.links(of or run.tracks[0], window)
    chords = np.hypot(*(np.roll(x, -1, axis=1) - x for x in (links.forward, links.up)))
    return mean(links.t, chords / run.scene["vehicle"]["track"]["pitch"] - 1.0)


@figure("1", of=ANY)
def fall_time(run: RunData, of: str, window: Window) -> float:
    """Time of the largest drop of a free end over sqrt(2 L/g), L chain length; NaN if it falls on."""
    t, drop, length, gravity = _fall(run, of, window)
    k = int(drop.argmax())
    if not 0 < k < len(t) - 1:
        return float("nan")
    top = np.polynomial.Polynomial.fit(t[k - 1 : k + 2], drop[k - 1 : k + 2], 2).deriv().roots()[0]
    return float(top / np.sqrt(2.0 * length / gravity))


@figure("1", of=ANY)
def half_fall_time(run: RunData, of: str, window: Window) -> float:
    """Time at which a free end has dropped by L/2, over sqrt(L/g), L chain length."""
    t, drop, length, gravity = _fall(run, of, window)
    k = int(drop.argmax()) + 1
    half = np.interp(0.5 * length, drop[:k], t[:k], right=np.nan)
    return float(half / np.sqrt(length / gravity))


@figure("m", of=ANY)
def behind_free_fall(run: RunData, of: str, window: Window) -> float:
    """Largest height of the free end above a free fall, until its largest drop, m; 0 if always below."""
    t, drop, _, gravity = _fall(run, of, window)
    k = int(drop.argmax()) + 1
    return float(max(0.0, (0.5 * gravity * t[1:k] ** 2 - drop[1:k]).max()))


# --- chain over a sprocket -------------------------------------------------------------------------


@figure("1", of=SIDE)
def pins_passed(run: RunData, of: str, window: Window) -> float:
    """Pins that pass the outer end of the sprocket, or its top, forward positive, with the fraction of a pitch."""
    links, end = run.links(track_of(run, of), window), sprocket_end(run.scene)
    outwards, across, end = (end * links.forward, links.up, end) if end else (links.up, -links.forward, 1.0)
    way = abs(run.mean(f"{track_of(run, of)}.speed", window)) * np.diff(links.t).max(initial=0.0)
    if way >= 0.5 * links.forward.shape[1] * run.scene["vehicle"]["track"]["pitch"]:
        raise Unrecorded("more than half a circuit passes between two records of links: a smaller run.links")
    angle = np.arctan2(across, outwards)
    radius = np.hypot(across, outwards)
    near = (outwards > 0) & (radius < 1.5 * pitch_radius(run.scene["vehicle"]))
    above = np.where(near & (angle >= 0), angle, np.inf).argmin(axis=1)  # next pin
    below = np.where(near & (angle < 0), angle, -np.inf).argmax(axis=1)  # last pin
    rows = np.arange(len(above))
    a, b = angle[rows, above], angle[rows, below]
    pins = angle.shape[1]
    towards = np.where((below - above) % pins == 1, 1.0, -1.0)  # links numbered along or against forward motion
    place = above + towards * a / (a - b)
    path = np.unwrap(place, period=pins)
    return float(-end * towards[0] * (path[-1] - path[0]))


@figure("1", of=SIDE, none="if it turns by less than a pin")
def pins_per_revolution(run: RunData, of: str, window: Window) -> float:
    """Pins passed per revolution of the sprocket against its mount."""
    t = run.links(track_of(run, of), window).t
    times, angle = run.signal(f"{drive_of(run, of)}.angle", EVER)
    turned = np.interp(t[[0, -1]], times, angle)
    revolutions = float((turned[1] - turned[0]) / (2 * np.pi))
    if abs(revolutions) * pins_a_turn(run.scene["vehicle"]) < 1.0:
        raise Missing("the sprocket turns by less than a pin")
    return pins_passed(run, of, window) / revolutions


@figure("1", of=SIDE, none="if less than a pin passes")
def chain_speed_ratio(run: RunData, of: str, window: Window) -> float:
    """Mean chain speed over pins passed times pitch over time."""
    track = track_of(run, of)
    t = run.links(track, window).t
    if abs(pins := pins_passed(run, of, window)) < 1.0:
        raise Missing("less than a pin passes the sprocket")
    by_pins = pins * run.scene["vehicle"]["track"]["pitch"] / (t[-1] - t[0])
    return run.mean(f"{track}.speed", window) / float(by_pins)


@figure("1", of=("", *SPAN))
def polygon_ripple(run: RunData, of: str, window: Window) -> float:
    """First tooth harmonic of the speed of a chain end over its mean, by least squares.

    The fit covers whole tooth periods. ``of`` is the end: "upper" (default) or "lower". Fitted to the position of the
    end pin, x(t) = a + v t + sum of c_k cos(k w t) + s_k sin(k w t), k = 1..3; the amplitude of the speed is w |(c_1,
    s_1)|.
    """
    track = run.tracks[0]
    w = pins_a_turn(run.scene["vehicle"]) * run.mean(f"{drive_of(run, '')}.speed", window)
    period = 2 * np.pi / abs(w)
    whole = np.floor((window.end - window.start) / period + 1e-9)
    links = run.links(track, window)
    inside = links.t < links.t[0] + whole * period - 1e-9
    t, ends = links.t[inside], links.up[0, [0, -1]]
    if 3.0 * abs(w) * np.diff(t).max(initial=0.0) >= np.pi:
        raise Unrecorded("three harmonics of a tooth need more records of links: a smaller run.links")
    end = [0, -1][int(ends.argmin() if of == "lower" else ends.argmax())]
    x = links.forward[inside, end]
    waves = [f(k * w * t) for k in (1, 2, 3) for f in (np.cos, np.sin)]
    basis = np.stack([np.ones_like(t), t - t.mean(), *waves], axis=1)
    fit = np.linalg.lstsq(basis, x, rcond=None)[0]
    return float(abs(w) * np.hypot(fit[2], fit[3]) / abs(fit[1]))


@figure("N", of=SPAN)
def span_tension(run: RunData, of: str, window: Window) -> float:
    """Mean tension of the "upper" or "lower" span between sprocket and idler of a rig, N."""
    links = run.links(run.tracks[0], window)
    distance = run.scene["rig"]["axle_distance"]
    forward, up = links.middles()
    free = (forward < -SPAN_MARGIN * distance) & (forward > -(1 - SPAN_MARGIN) * distance)
    return mean(links.t, links.tension, free & ((up > 0) if of == "upper" else (up < 0)))


@figure("1")
def span_moment_ratio(run: RunData, of: str, window: Window) -> float:
    """(T_upper - T_lower) x pins a turn x pitch / 2 pi over the mean torque of the drive on the sprocket."""
    arm = way_a_turn(run.scene["vehicle"]) / (2 * np.pi)
    difference = span_tension(run, "upper", window) - span_tension(run, "lower", window)
    return difference * arm / run.mean(f"{drive_of(run, of)}.torque", window)


@figure("1")
def tight_span_enters(run: RunData, of: str, window: Window) -> float:
    """1 if the tighter span runs into the sprocket, -1 if it leaves it."""
    difference = span_tension(run, "upper", window) - span_tension(run, "lower", window)
    speed = run.mean(f"{drive_of(run, of)}.speed", window)  # the upper span enters if forward
    return float(np.sign(difference * speed))


# --- helpers ---------------------------------------------------------------------------------------


def _joint_forces(run: RunData, of: str, window: Window) -> tuple[Floats, Floats]:
    """Times (m,), and the force in every pin (m, pins), N."""
    topic = run.log.known_topic(f"/{of or run.tracks[0]}/links")
    names = run.log.topics[topic].names
    columns = [[i for i, name in enumerate(names) if name.endswith(f"].force.{axis}")] for axis in "xyz"]
    series = run.log.select({topic: [*columns[0], *columns[1], *columns[2]]}, window)[topic]
    forces = np.split(series.values, 3, axis=1)
    return series.t, np.asarray(np.sqrt(sum(force**2 for force in forces)))


def _fall(run: RunData, of: str, window: Window) -> tuple[Floats, Floats, float, float]:
    """Times, s, drop of the last pin, m, length of the chain, m, and gravity, m/s2."""
    links = run.links(of or run.tracks[0], window)
    vehicle = run.scene["vehicle"]
    length = links.tension.shape[1] * vehicle["track"]["pitch"]
    return links.t, links.up[0, -1] - links.up[:, -1], length, vehicle["gravity"]
