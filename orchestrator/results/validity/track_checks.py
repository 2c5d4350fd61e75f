"""Checks of tracks on the ground: creep, spin, slide, lift, the other track's rut."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, wheel_loads
from orchestrator.results.analyses.slip import towards
from orchestrator.results.analyses.wheel_loads import is_settling, off_ground
from orchestrator.results.ground_surface import gives_way
from orchestrator.results.ground_under_vehicle import component, ground_axes, pose_signals, pressed_by
from orchestrator.results.run_data import RunData, record_durations
from orchestrator.results.validity.exceedance import WARNING, Exceedance, excess
from orchestrator.results.validity.piece import Piece
from orchestrator.results.validity.sprocket_checks import shaft, tracks_on_sprockets
from orchestrator.vocabulary import limits

STANDS = 0.1  # rad/s of a sprocket: brakes fade below, unless drive.brake_speed is given
TURNS = 0.02  # rad/s of the hull: a turning vehicle slides sideways, and its tracks slip by nature
YAW, VELOCITY = "chassis.chassis.angular_velocity.z", "chassis.chassis.velocity"


def creep_signals(run: RunData) -> Iterator[str]:
    """Signals: speed, slip and ground force of tracks, sprocket speeds, motion and place of the hull."""
    yield from (YAW, *(f"{VELOCITY}.{axis}" for axis in "xyz"), *pose_signals(run))
    for track in tracks_on_sprockets(run):
        yield f"{shaft(run, track)}speed"
        yield from (f"{track}.{name}" for name in ("speed", "slip", *(f"ground.force.{axis}" for axis in "xyz")))


def creep(piece: Piece) -> Iterator[Exceedance]:
    """One entry a track, of what lasts for STANDING seconds, by means over them; raises Missing.

    A track creeps if it stands and slides though friction could hold what pulls at it: the ground's force less what
    accelerates the hull. One that really slides is faster than regularised friction lets it creep.
    """
    run, friction = piece.run, least_friction(piece.run)
    t, yaw = piece.signal(YAW)
    fades = hull.vehicle_number(run, "contact", "ground", "friction_velocity")
    wheels, gravity = run.scene["vehicle"]["road_wheel"]["x"], hull.vehicle_number(run, "gravity")
    pace = 0.4 * np.sqrt(gravity * (max(wheels) - min(wheels)))
    slow = limits.SLOW * pace
    circle = hull.pins_of_sprocket(run) * hull.vehicle_number(run, "track", "pitch")
    axes = ground_axes(run, piece.columns([*pose_signals(run)])[1])
    hull_ahead, hull_left, _ = (component(piece.vector(VELOCITY)[1], axis) for axis in axes)
    end = np.flatnonzero(t - t[:1] > limits.STANDING - 1e-9)
    begin = np.searchsorted(t, t[end] - limits.STANDING - 1e-9)
    for track in tracks_on_sprockets(run):
        chain, pads, turned = (
            piece.signal(name)[1] for name in (f"{track}.speed", f"{track}.slip", f"{shaft(run, track)}speed")
        )
        _, force = piece.vector(f"{track}.ground.force")
        if not len(t) == len(chain) == len(turned) == len(force):
            raise Missing("the log holds different steps of its components")
        way, forces = towards(chain, pads), (component(force, axis) for axis in axes)
        turns = np.abs(yaw) >= TURNS
        moves, grips = turns | (np.abs(turned) >= STANDS), -pads * way <= np.maximum(chain * way, slow)
        free = ~_brakes(run, track, t, turned)
        columns = chain * way, pads * way, pads, hull_left, turns, moves, grips, free, turned, *forces
        sums = np.cumsum(np.stack(columns) * record_durations(t), axis=1)
        means = (sums[:, end] - sums[:, begin]) / (t[end] - t[begin])
        speed, lag, back, left, turning, moving, gripping, loose, rate, *thrust, load = means
        gained = ((v[end] - v[begin]) / (gravity * (t[end] - t[begin])) for v in (hull_ahead, hull_left))
        pulled = (f / np.maximum(load, 1.0) - a for f, a in zip(thrust, gained, strict=True))
        share, creep = np.hypot(*pulled) / friction, np.hypot(back, left)
        creeps = (moving == 0.0) & (creep**2 * np.maximum(1.0 - share**2, 0.0) < (limits.CREEPS * fades * share) ** 2)
        braked = np.where((moving == 0.0) & (loose == 0.0), np.abs(rate) * circle / (2.0 * np.pi), 0.0)
        for what, values, limit in (
            ("brake", braked, limits.BRAKE),
            ("creep", np.where(creeps & (share < 1.0), creep, 0.0), limits.CREEP),
            ("spin", np.where(turning == 0.0, lag / np.maximum(speed, slow), 0.0), limits.SPIN),
            ("slide", np.where(gripping == 0.0, -lag, 0.0), slow),
            ("fast", np.maximum(speed, speed - lag), limits.FAST * pace),
        ):
            if first_and_worst := excess(t[begin], values, float(limit)):
                yield Exceedance(what, track, first_and_worst[0], "", first_and_worst[1], float(limit), WARNING)
                if what != "brake":
                    break


def _brakes(run: RunData, track: str, t: Floats, turned: Floats) -> NDArray[np.bool_]:
    """At which times t, s, the brake of a track's sprocket is on and fades at its speed ``turned``, rad/s."""
    drive = run.scene.get("drive") or {}
    drive = drive.get(track.removesuffix("_track")) or drive
    torque = np.interp(t, *np.transpose(drive.get("brake_points") or [(0.0, drive.get("brake") or 0.0)]))
    fading = np.abs(turned) < (drive.get("brake_speed") or STANDS)
    return fading & (torque > 0.0) & (not drive.get("steering"))


def least_friction(run: RunData) -> float:
    """Least coefficient of friction of the ground: that of the vehicle's contacts, or of a region; raises Missing."""
    friction = hull.vehicle_number(run, "contact", "ground", "friction")
    regions = (run.scene.get("ground") or {}).get("friction") or ()
    return min(
        [friction]
        + [region["coefficient"] if region["factor"] is None else friction * region["factor"] for region in regions]
    )


def crossed_rut_signals(run: RunData) -> Iterator[str]:
    """Travel of the tracks, for the times of the pieces; positions of pins are read on demand."""
    if gives_way(run.scene):
        yield from (f"{track}.travel" for track in run.tracks)


def crossed_rut(piece: Piece) -> Iterator[Exceedance]:
    """Entry for the first place that two tracks have pressed; raises Missing."""
    run = piece.run
    if gives_way(run.scene) and len(run.tracks) == 2:
        entry = run.compute_once("crossed rut", _crossing)
        if entry is not None and piece.window.start <= entry.time <= piece.window.end:
            yield entry


def _crossing(run: RunData) -> Exceedance | None:
    """Entry for the track that comes second, with the depth of the other's rut; None where the ways are apart."""
    one, other = (pressed_by(run, track) for track in run.tracks)
    _, i, j = np.intersect1d(one.cell, other.cell, assume_unique=True, return_indices=True)
    if not i.size:
        return None
    after = one.first[i] > other.first[j]
    times, depth = np.maximum(one.first[i], other.first[j]), np.where(after, other.depth[j], one.depth[i])
    k = int(times.argmin())
    return Exceedance(
        "crossed_rut", run.tracks[0 if after[k] else 1], float(times[k]), "", float(depth.max()), limits.RUT, WARNING
    )


def lift(piece: Piece) -> Iterator[Exceedance]:
    """Entries for members that lose their load at rest for longer than LIFT, within the piece."""
    run = piece.run
    intervals_by_member = dict(off_ground(run).by_member)
    with suppress(Missing):
        wheels, hanging = wheel_loads.lifted(run).by_member, wheel_loads.hang_at_rest(run)
        intervals_by_member |= {name: each for name, each in wheels.items() if name not in hanging}
    for name, intervals in intervals_by_member.items():
        component, _, place = name.partition(".")
        for interval in intervals:
            inside = interval.start <= piece.window.end and interval.end >= piece.window.start
            if inside and interval.time > limits.LIFT and not is_settling(run, interval.end):
                yield Exceedance("lift", component, interval.start, place, interval.time, limits.LIFT, WARNING)
