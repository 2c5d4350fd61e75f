"""Checks of links: deep penetration, compression, steps too long for the contacts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import sqrt
from typing import Any

import numpy as np

from fmus.ground.refinement import refinement, sections
from fmus.vehicles.sides import ground_wheels, of_side, pins_a_turn, smooth_wheels, thickness
from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, record_blocks
from orchestrator.results.ground_surface import GroundSurface, gives_way, ground
from orchestrator.results.run_data import UNANSWERED, RunData, Window
from orchestrator.results.validity.exceedance import WARNING, Exceedance, exceedance, exceedances
from orchestrator.results.validity.piece import Piece
from orchestrator.vocabulary import limits

NEAR = 0.25  # s: longest interval between records of pins
EXPLAINS = 0.85  # of a depth: a rim or the ground this deep at the nearest record of pins is its cause


def penetration_signals(run: RunData) -> Iterator[str]:
    """Signals of the largest depth."""
    yield from (f"{track}.penetration.max" for track in run.tracks)


def penetration(piece: Piece) -> Iterator[Exceedance]:
    """Entries for contacts that are deep relative to the thickness of a link; raises Missing."""
    face = hull.vehicle_number(piece.run, "track", "face")
    for track in piece.run.tracks:
        t, depth = piece.signal(f"{track}.penetration.max")
        most = face * limits.LINK_WARNING, face * limits.LINK_FAILURE
        for entry, worst in exceedances("penetration", track, t, depth, *most):
            yield entry._replace(place=deepest(piece.run, track, worst, entry.value))


def deepest(run: RunData, track: str, t: float, depth: float) -> str:
    """Wheel or ground with penetration ``depth``, m, at a time, s; empty without records of pins.

    Depths that neither rims nor ground explain belong to the sprocket, whose teeth have their own outline; on uneven
    ground, which is looked at in some points of a link, perhaps to the ground.
    """
    try:
        depth_by_name = depths(run, track, t)
        floor = _hard_ground(run)
    except UNANSWERED:
        return ""
    name = max(depth_by_name, key=lambda key: depth_by_name[key], default="")
    if name and depth_by_name[name] > EXPLAINS * depth:
        return name
    return "sprocket, or ground between the points of a link" if floor and floor.terrain else "sprocket"


def _hard_ground(run: RunData) -> GroundSurface | None:
    """Ground that links may penetrate; None without one, and for soil."""
    return None if gives_way(run.scene) else run.compute_once("ground", lambda _: ground(run.scene))


def depths(run: RunData, track: str, t: float) -> dict[str, float]:
    """Depths, m, of rims and ground in the links at the record nearest to a time, s; raises Missing."""
    blocks = list(record_blocks.records(run, track, Window(t - NEAR, t + NEAR), "joint[*].position"))
    times = np.concatenate([block.t for block in blocks])
    nearest = int(np.abs(times - t).argmin())
    pins = np.concatenate([block.values[0] for block in blocks])[nearest]
    pose = hull.poses(run, track, times[nearest : nearest + 1])
    axes, face = pose.axes[0][:, [0, 2]], hull.vehicle_number(run, "track", "face")
    depth_by_name = {}
    moved = run.log.topics[f"/{track}/in"].names if f"/{track}/in" in run.log.topics else ()
    for wheel in smooth_wheels(of_side(run.scene["vehicle"], track.removesuffix("_track"))):
        if f"{wheel['name']}.position.x" in moved:
            centre = run.vector_at(track, "in", f"{wheel['name']}.position", float(times[nearest]))
            depth_by_name[wheel["name"]] = wheel["radius"] + face - _distance((pins - centre) @ axes)
    if floor := _hard_ground(run):
        places = pins
        if floor.terrain:  # it may rise between pins, and under a side of the track: at the contact points of links
            table = of_side(run.scene["vehicle"], track.removesuffix("_track"))["track"]
            points = sections(table, refinement(run.scene["ground"], table, None), hard=True)[:, :2]
            along, left = np.roll(pins, -1, axis=0) - pins, pose.axes[0][:, 1]
            places = np.concatenate([pins + a * along + side * b * left for a, b in points for side in (-1.0, 1.0)])
        under = floor.height_under(places) - places[:, 2]
        if floor.terrain:
            under = under * floor.normals(places)[:, 2]
        depth_by_name["ground"] = float(under.max()) + thickness(run.scene["vehicle"]["track"]) - face
    return depth_by_name


def _distance(pins: Floats) -> float:
    """Least distance of the sides of a closed polygon (n, 2) from the origin, m."""
    side = np.roll(pins, -1, axis=0) - pins
    share = np.clip(-np.sum(pins * side, axis=1) / np.sum(side * side, axis=1), 0.0, 1.0)
    return float(np.linalg.norm(pins + share[:, None] * side, axis=1).min())


def compression_signals(run: RunData) -> Iterator[str]:
    """Signals of the least tension."""
    yield from (f"{track}.tension.min" for track in run.tracks)


def compression(piece: Piece) -> Iterator[Exceedance]:
    """Entries for tracks whose links are under more thrust than their weight holds down; raises Missing.

    The thrust must last longer than HELD.
    """
    limit = thrust(piece.run)
    for track in piece.run.tracks:
        t, tension = piece.signal(f"{track}.tension.min")
        yield from exceedance("compression", track, "", *trailing_minimum(t, -tension, limits.HELD), limit)


def thrust(run: RunData) -> float:
    """Thrust that links between two wheels on the ground bear without lifting, N; raises Missing."""
    weight = (
        hull.vehicle_number(run, "track", "mass")
        * hull.vehicle_number(run, "gravity")
        / hull.vehicle_number(run, "track", "pitch")
    )
    vehicle = run.scene["vehicle"]
    if run.scene.get("assembly") != "vehicle" or len(x := vehicle["road_wheel"]["x"]) < 2:
        raise Missing("links that push lie between road wheels")
    span = float(np.diff(sorted([*x, *(wheel["x"] for wheel in ground_wheels(vehicle))])).max())
    return weight * span**2 / (8.0 * limits.RISE)


def trailing_minimum(t: Floats, values: Floats, time: float) -> tuple[Floats, Floats]:
    """Minimum over the ``time``, s, before each instant; the first instants have no value."""
    if len(t) < 2 or t[-1] - t[0] < time:
        return t[:0], values[:0]
    count = max(1, round(time / float(np.median(np.diff(t)))))
    windows = np.lib.stride_tricks.sliding_window_view(values, min(count, len(values)))
    return t[count - 1 :], windows.min(axis=1)


IMPLICIT = (None, "generalized_alpha", "hht")  # explicit integrators limit their steps themselves
INTERNAL = 1e-3  # s, default of a track


def half_steps(run: RunData) -> str:
    """Options for half of the steps of a run; empty if they follow an error estimate, or are not known."""
    step = run.entry("run", "step")
    internal = run.entry("track", "step") or INTERNAL
    if not (isinstance(step, float) and isinstance(internal, float)) or run.entry("run", "variable"):
        return ""
    options = f"; half of them: --step {limits.shorter_step(step, 0.5 * step)}"
    if internal < step and run.entry("track", "integrator") in IMPLICIT:
        options += f" --set track.step={limits.shorter_step(internal, 0.5 * internal)}"
    return options


def contact_step(piece: Piece) -> Iterator[Exceedance]:
    """Entries for the scene of the run."""
    yield from contact_steps_of_scene(piece.run.scene)


def contact_steps_of_scene(scene: Mapping[str, Any]) -> Iterator[Exceedance]:
    """Entries for links in the internal step and wheels in the communication step.

    Steps that follow an error estimate are left out.
    """
    run, track, vehicle = (scene.get(key) or {} for key in ("run", "track", "vehicle"))
    if run.get("variable") or scene.get("assembly") not in ("vehicle", "rig", "bench"):
        return
    stiffness = {pair: vehicle["contact"][pair]["stiffness"] for pair in ("wheel", "ground", "sprocket")}
    internal = min(track.get("step") or INTERNAL, run["step"])
    # link between a road wheel and the ground: both springs act on its mass
    link = sqrt((stiffness["wheel"] + stiffness["ground"]) / vehicle["track"]["mass"]) * internal
    # lightest body on the exchanged wrenches, in contact with the pins or links of its wrap
    wrap = 0.5 * pins_a_turn(vehicle)
    lightest = min((each for each in smooth_wheels(vehicle) if each["tensioner"]), key=lambda each: each["mass"])
    wheel = sqrt(wrap * stiffness["wheel"] / lightest["mass"]) * run["step"]
    for place, value in (("link", link if track.get("integrator") in IMPLICIT else 0.0), (lightest["name"], wheel)):
        if value > limits.STEP:
            yield Exceedance("contact_step", "tracks", 0.0, place, value, limits.STEP, WARNING)
