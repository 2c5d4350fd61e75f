"""Motion of the hull and of its mounts, and the sprocket of each track."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.vehicles.sides import pins_a_turn
from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.rotation import matrices
from orchestrator.results.run_data import LONGEST_STEP, RunData, Window, WrenchPort


class HullAxes(NamedTuple):
    """Position and axes of the hull."""

    origin: Floats  # (m, 3) m, world
    axes: Floats  # (m, 3, 3) columns ahead, left, up of the hull, in world


def sprocket(run: RunData, track: str) -> WrenchPort | None:
    """Port between a track and its sprocket; None without one."""
    return next((port for port in run.ports if port.giver == track and port.giver_connector == "sprocket"), None)


def sprocket_speed(run: RunData, of: str) -> str:
    """Signal of the sprocket's speed in the hull, rad/s, for a signal of a track or drive, else for the first one.

    A steering differential has two sprockets: "drive.right.torque" belongs to the right one. Raises Missing without a
    sprocket.
    """
    sprocket_ports = [port for port in run.ports if port.giver_connector == "sprocket"]
    if not sprocket_ports:
        raise Missing(f"{run.log.path} holds no sprocket that turns")
    sides = [f"{port.taker}.{port.taker_connector.removesuffix('sprocket')}" for port in sprocket_ports]
    instances = [(port.giver, port.taker) for port in sprocket_ports]
    own = [side for side in sides if of.startswith(side)]
    own += [side for side, both in zip(sides, instances, strict=True) if of.partition(".")[0] in both]
    return f"{(own or sides)[0]}speed"


def poses(run: RunData, track: str, t: Floats) -> HullAxes:
    """Sprocket axle of a track, with the axes of the hull, at times (m,), s.

    Without a hull the axes are those of the start; without a sprocket the origin is the start.
    """
    port = sprocket(run, track)
    around = Window(float(t[0]) - LONGEST_STEP, float(t[-1]) + LONGEST_STEP)
    if port is None:
        origin = np.tile(_of_start(run, "position", (0.0, 0.0, 0.0)), (len(t), 1))
    else:
        origin = _interpolated(t, *run.vectors(port.taker, "out", f"{port.taker_connector}.position", window=around))
    if run.has("chassis.chassis.orientation.w"):
        q = _interpolated(t, *run.vectors("chassis", "out", "chassis.orientation", "wxyz", around))
        return HullAxes(origin, matrices(q / np.linalg.norm(q, axis=1, keepdims=True)))
    heading = float(_of_start(run, "heading", 0.0))
    c, s = np.cos(heading), np.sin(heading)
    return HullAxes(origin, np.tile(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), (len(t), 1, 1)))


def _of_start(run: RunData, key: str, default: float | tuple[float, ...]) -> Floats:
    """Numbers of the scene's start; raises Missing where the log has no such numbers."""
    try:
        return np.array(run.entry("start", key, default=default), float).reshape(np.shape(default))
    except (TypeError, ValueError):
        raise Missing(f"{run.log.path}: start.{key} in its scene.json is not {np.size(default)} numbers") from None


def _interpolated(t: Floats, times: Floats, values: Floats) -> Floats:
    """Values at given times, linearly interpolated; raises Missing."""
    if not len(times):
        raise Missing(f"the log holds no pose of the hull near {t[0]:g} s")
    return np.stack([np.interp(t, times, column) for column in values.T], axis=1)


def tracks(run: RunData, name: str = "") -> tuple[str, ...]:
    """Names of the vehicle's tracks, or of the given one, of "left_track" also by "left"; raises Missing."""
    name = f"{name}_track" if f"{name}_track" in run.tracks else name
    if not run.tracks:
        raise Missing(f"{run.log.path} holds no track")
    if name and name not in run.all_tracks:
        raise Missing(f"{run.log.path} has no track '{name}': there is {', '.join(run.all_tracks)}")
    return (name,) if name else run.tracks


def pins_of_sprocket(run: RunData) -> float:
    """Pins, with lugs alone where not all have one, that the sprocket takes in a turn; raises Missing."""
    if is_smooth(run):
        return pins_a_turn(run.scene["vehicle"])
    teeth, gaps = vehicle_number(run, "sprocket", "teeth"), gaps_per_pin(run)
    return pins_a_turn({"sprocket": {"teeth": teeth, "gaps_per_pin": gaps}})


def is_smooth(run: RunData) -> bool:
    """Whether the sprocket has a smooth rim, with a radius, instead of teeth."""
    return run.entry("vehicle", "sprocket", "radius") is not None


def gaps_per_pin(run: RunData) -> float:
    """Gaps of the sprocket from pin to pin, 1 in a log of an earlier version; raises Missing."""
    return vehicle_number(run, "sprocket", "gaps_per_pin", default=1.0)


def pins_per_gap(run: RunData) -> int:
    """Pins of the chain from a lug to the next one, 1 in a log of an earlier version; raises Missing."""
    return round(vehicle_number(run, "sprocket", "pins_per_gap", default=1.0))


def vehicle_number(run: RunData, *keys: str, default: float | None = None) -> float:
    """Positive number of the run's vehicle table, SI units, or the ``default`` of a missing one; raises Missing."""
    value = run.entry("vehicle", *keys, default=default)
    if not isinstance(value, int | float) or not 0.0 < value < np.inf:
        raise Missing(f"{run.log.path}: scene.json has no number above 0 at vehicle.{'.'.join(keys)}")
    return float(value)
