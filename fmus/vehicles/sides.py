"""Tables of the sides of a vehicle: the right side is the left one with the differences in ``right``; its wheels."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import pi, sin
from typing import Any

SIDES = ("left", "right")
SMOOTH_WHEELS = ("road_wheel", "idler", "return_roller")  # of smooth wheels, in the order of their ports


def of_side(vehicle: Mapping[str, Any], side: str) -> Mapping[str, Any]:
    """Vehicle table of a side."""
    table = dict(vehicle)
    for name, differences in ((vehicle.get("right") or {}) if side == "right" else {}).items():
        own = vehicle.get(name) or {}
        if given := {key: value for key, value in (differences or {}).items() if value is not None}:
            if name == "wheel":  # tables by names
                given = {key: of_side({"": own.get(key), "right": {"": new}}, side)[""] for key, new in given.items()}
            table[name] = {**own, **given}
    return table


def lopsided(vehicle: Mapping[str, Any], hull: bool = True) -> str:
    """First dotted key by which a vehicle differs from its mirror image in the plane y = 0; empty if it does not.

    All counts but what does not act: seats, and without ``hull`` the points of it that would touch the ground.
    """
    left, right = (_seen_from(vehicle, side) for side in SIDES)
    for name in (each for each in left if each not in ("right", "seat")):
        one, other = left[name] or {}, right[name] or {}
        for key in sorted({*one, *other}) if isinstance(one, Mapping) else ():
            if one.get(key) != other.get(key) and (hull or key != "hull"):
                return f"{name}.{key}"
    return ""


def _seen_from(vehicle: Mapping[str, Any], side: str) -> Mapping[str, Any]:
    """Table of a side in axes whose y is towards it, in which both sides of a symmetric vehicle are one."""
    sign, chassis = (1.0 if side == "left" else -1.0), vehicle["chassis"]
    centre, *points = ([x, sign * y, z] for x, y, z in (chassis["centre"], *(chassis.get("hull") or ())))
    return {**of_side(vehicle, side), "chassis": {**chassis, "centre": centre, "hull": sorted(points)}}


def of_wheels(value: Any, count: int) -> list[Any]:
    """Numbers of each of ``count`` wheels of a side, from that of all or from a list."""
    return list(value) if isinstance(value, list | tuple) else [value] * count


def places_of_wheels(value: Any, count: int) -> list[Any]:
    """Places (x, z) of each of ``count`` wheels of a side, from that of all or from a list; None without one."""
    return list(value) if value is not None and isinstance(value[0], list | tuple) else [value] * count


def wheel_places(vehicle: Mapping[str, Any]) -> list[float]:
    """Positions x of the road wheels, m, means of both sides."""
    left, right = (of_side(vehicle, side)["road_wheel"]["x"] for side in SIDES)
    return [0.5 * (float(a) + float(b)) for a, b in zip(left, right, strict=True)]


def smooth_wheels(table: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Smooth wheels of a side in the order of their ports, each with ``name``, ``kind``, ``tensioner``, own numbers."""
    found = []
    for kind in SMOOTH_WHEELS:
        given = table.get(kind) or {}
        count = max((len(value) for value in given.values() if isinstance(value, list | tuple)), default=bool(given))
        for k in range(count):  # a track has no x of road wheels whose places are its own
            own = {key: value[k] if isinstance(value, list | tuple) else value for key, value in given.items()}
            name, slide = (kind, table.get("tensioner")) if kind == "idler" else (f"{kind}[{k + 1}]", None)
            found.append({"name": name, "kind": kind, "tensioner": slide, **own})
        if kind == "idler":
            further = (table.get("wheel") or {}).items()
            found += [{"name": name, "kind": "wheel", "tensioner": None, **own} for name, own in further]
    return found


def grousers(track: Mapping[str, Any]) -> dict[str, Any]:
    """Table of the grousers of a link of a ``track``, complete; without any they are one all over its outer face."""
    given = {key: value for key, value in (track.get("grouser") or {}).items() if value is not None}
    return {"height": 0.0, "length": track.get("pitch"), "width": track.get("width"), "count": 1, **given}


def thickness(track: Mapping[str, Any]) -> float:
    """Distance of what stands on the ground, outer faces or grousers on them, from the inner faces, m."""
    return float(track["face"] + (track["face"] + grousers(track)["height"]))


def pins_a_turn(vehicle: Mapping[str, Any]) -> float:
    """Pins that the sprocket takes in a turn: 12.5 with 25 teeth and a pin in every second gap; pitches, if smooth."""
    if vehicle["sprocket"].get("radius"):
        return 2.0 * pi * pitch_radius(vehicle) / float(vehicle["track"]["pitch"])
    teeth, gaps, lugs = (vehicle["sprocket"].get(key) or 1 for key in ("teeth", "gaps_per_pin", "pins_per_gap"))
    return float(lugs * teeth / gaps)


def way_a_turn(vehicle: Mapping[str, Any]) -> float:
    """Way of the chain in a turn of the sprocket of a vehicle table, m: a pitch for each pin."""
    return pins_a_turn(vehicle) * float(vehicle["track"]["pitch"])


def pitch_radius(vehicle: Mapping[str, Any], sine: Callable[[float], float] = sin) -> float:
    """Distance from the axle, m, at which the sprocket of a vehicle table seats its pins, or its rim bears their line.

    Seated pins make a polygon. Components give the ``sine`` that has the same bits on every processor.
    """
    if radius := vehicle["sprocket"].get("radius"):
        return float(radius + vehicle["track"]["face"])
    made_for = vehicle["sprocket"].get("pitch") or vehicle["track"]["pitch"]
    return float(made_for / (2.0 * sine(pi / pins_a_turn(vehicle))))


def lowest_wheel(table: Mapping[str, Any]) -> Mapping[str, Any]:
    """The road wheel of a side, as drawn, whose rim is lowest: it stands on level ground."""
    wheels = (wheel for wheel in smooth_wheels(table) if wheel["kind"] == "road_wheel")
    return min(wheels, key=lambda wheel: wheel["z"] - wheel["radius"])


def ground_level(vehicle: Mapping[str, Any]) -> float:
    """Height of level ground in the frame of the drawn vehicle, m: its pads just touch it under the road wheels."""
    low = lowest_wheel(vehicle)
    return float(low["z"] - low["radius"] - thickness(vehicle["track"]))


def road_arms(table: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Numbers of the road arm of each road wheel of a side; none without arms."""
    given, count = table["road_arm"] or {}, len(table["road_wheel"]["x"])
    own = {key: of_wheels(given[key], count) for key in ("mass", "pin_inertia", "long_inertia") if key in given}
    own["pivot"] = places_of_wheels(given.get("pivot"), count)
    return [{key: values[k] for key, values in own.items()} for k in range(count)] if given else []


def beams(arm: Mapping[str, Any], wheels: int) -> Sequence[Sequence[int]]:
    """Wheels of a side, from 1, whose arms are one beam with one coordinate; ``arm``: its table ``road_arm``."""
    return [(k, k + 1) for k in range(1, wheels, 2)] if arm.get("pairs") else arm.get("beams") or ()


RAISED = 0.05  # of a pitch; chosen: a wheel whose rim is less than that above the lowest one stands on level ground


def ground_wheels(table: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Smooth wheels of a side that stand on level ground as drawn, the foremost one first; no raised end wheels."""
    wheels = sorted(smooth_wheels(table), key=lambda wheel: -wheel["x"])
    level = min(wheel["z"] - wheel["radius"] for wheel in wheels) + RAISED * table["track"]["pitch"]
    return [wheel for wheel in wheels if wheel["z"] - wheel["radius"] < level]
