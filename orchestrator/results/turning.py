"""Figures of turns: rates, path, forces and power by side, means over a window.

Left turns and vectors to the left are positive. The vehicle's position is the centre of mass of its hull; its axes
are ahead and left along the ground under it (``ground_under_vehicle.py``). ``of`` is a side ("left", "right"), or
empty.
"""

from __future__ import annotations

import numpy as np

from orchestrator.log.reader import Missing
from orchestrator.results.analyses.slip import mean_lag
from orchestrator.results.figures import BOTH_SIDES, Shown, figure
from orchestrator.results.ground_surface import on_terrain
from orchestrator.results.ground_under_vehicle import component, ground_axes, pose_signals
from orchestrator.results.run_data import Floats, RunData, Window, mean

SIGN = {"left": -1.0, "right": 1.0}  # of the yaw moment of a forward force
SLOWEST = 1e-4  # rad/s: a slower turn has no radius
STRAIGHT = 1e3  # half track distances: a larger radius is none


@figure("m", Shown("largest distance from the path", "m", 3, on="path", whole=True), none="without a path")
def path_error(run: RunData, of: str, window: Window) -> float:
    """Largest distance of the vehicle from the driver's path, m."""
    driver = run.scene.get("driver") or {}
    if not driver.get("arcs") and not driver.get("points"):
        raise Missing("there is no driver who follows a path")
    return float(np.abs(run.signal("driver.path.lateral_error", window)[1]).max())


@figure("rad/s", Shown("yaw rate", "rad/s", on="turning", by_phase=True))
def yaw_rate(run: RunData, of: str, window: Window) -> float:
    """Mean rate about the vertical, rad/s; its signal, chassis.chassis.angular_velocity.z, has every step."""
    return run.mean("chassis.chassis.angular_velocity.z", window)


@figure("m", Shown("turn radius", "m", on="turning", by_phase=True))
def turn_radius(run: RunData, of: str, window: Window) -> float:
    """Speed along the ground over the rate of turning about its normal, m."""
    t, ahead, left = _velocity(run, window)
    return mean(t, np.hypot(ahead, left)) / abs(_turning(run, window))


@figure("m/s")
def lateral_speed(run: RunData, of: str, window: Window) -> float:
    """Velocity to the left, m/s; in a turn the front slides outwards."""
    t, _, left = _velocity(run, window)
    return mean(t, left)


@figure("m")
def rotation_centre(run: RunData, of: str, window: Window) -> float:
    """Longitudinal position of the point without lateral velocity, m ahead of the centre of mass."""
    return -lateral_speed(run, of, window) / _turning(run, window)


@figure("N", of=BOTH_SIDES)
def propulsion(run: RunData, of: str, window: Window) -> float:
    """Force of the ground on a side's track, along the vehicle, N."""
    track = _track(run, of)
    t, forward, _ = _ahead(run, f"{track}.ground.force", window)
    return mean(t, forward)


@figure("N m", Shown("steering moment", "kN m", on="turning"))
def steering_moment(run: RunData, of: str, window: Window) -> float:
    """Half the track distance times the difference of propulsion, N m; lateral ground forces resist it."""
    arm = run.scene["vehicle"]["track"]["lateral"]
    return float(arm * sum(sign * propulsion(run, side, window) for side, sign in SIGN.items()))


@figure(
    "m/s",
    Shown("slip left", "m/s", 3, on="turning", of="left", name="slip_left", by_phase=True),
    Shown("slip right", "m/s", 3, on="turning", of="right", name="slip_right", by_phase=True),
    of=BOTH_SIDES,
)
def track_slip(run: RunData, of: str, window: Window) -> float:
    """Load-weighted velocity of a side's links over the ground, m/s; positive where the track drives, either way."""
    t, chain = run.signal(f"{_track(run, of)}.speed", window)
    return mean_lag(t, chain, run.signal(f"{_track(run, of)}.slip", window)[1])


@figure("m/s", Shown("pads slide at", "m/s", 3, on="straight", unless="pad_slip"))
def pad_velocity(run: RunData, of: str, window: Window) -> float:
    """Load-weighted velocity of the links over the ground, mean of both sides, m/s."""
    return float(np.mean([track_slip(run, side, window) for side in run.sides]))


@figure(
    "W",
    Shown("power left", "kW", on="turning", of="left", name="power_left"),
    Shown("power right", "kW", on="turning", of="right", name="power_right"),
    Shown("power of propulsion", "kW", on="steering", of="propulsion", name="power_propulsion"),
    Shown("power of steering", "kW", on="steering", of="steering", name="power_steering"),
    of=(*BOTH_SIDES, "propulsion", "steering"),
)
def drive_power(run: RunData, of: str, window: Window) -> float:
    """Power of a side's motor or half shaft, W; negative where the ground drives the sprocket.

    With a steering differential ``of`` may also be "propulsion" or "steering", for the power of its motors.
    """
    joined = "differential" in run.instances
    allowed = (*SIGN, "propulsion", "steering") if joined else tuple(SIGN)
    if of not in allowed:
        raise Missing(f"drive_power of '{of}': there is that of {', '.join(allowed)}")
    return run.rate(f"differential.{of}.work" if joined else f"{of}_drive.energy.work", window)


@figure("W", Shown("power from side to side", "kW", on="steering", name="power_regenerated"), none="without one")
def regenerated_power(run: RunData, of: str, window: Window) -> float:
    """Power that a steering differential transfers between the sides, W."""
    if "differential" not in run.instances:
        raise Missing("there is no steering differential")
    left, right = (drive_power(run, side, window) for side in SIGN)
    return 0.0 if left * right >= 0.0 else float(np.minimum(abs(left), abs(right)))  # np.minimum keeps a NaN


def _turning(run: RunData, window: Window) -> float:
    """Rate of turning about the normal of the ground; raises Missing if it is too small to divide by."""
    rate = yaw_rate(run, "", window)
    if on_terrain(run.scene):
        t, turning, pose = _vectors(run, "chassis.chassis.angular_velocity", window)
        rate = mean(t, component(turning, ground_axes(run, pose).up))
    t, ahead, left = _velocity(run, window)
    far = STRAIGHT * run.scene["vehicle"]["track"]["lateral"]
    if abs(rate) < SLOWEST or mean(t, np.hypot(ahead, left)) > far * abs(rate):
        raise Missing("the vehicle does not turn")
    return rate


def _velocity(run: RunData, window: Window) -> tuple[Floats, Floats, Floats]:
    """Times, and velocity ahead and to the left."""
    return _ahead(run, "chassis.chassis.velocity", window)


def _ahead(run: RunData, name: str, window: Window) -> tuple[Floats, Floats, Floats]:
    """Times, and components ahead and to the left, along the ground, of a vector in world axes."""
    t, vectors, pose = _vectors(run, name, window)
    axes = ground_axes(run, pose)
    return t, component(vectors, axes.ahead), component(vectors, axes.left)


def _vectors(run: RunData, name: str, window: Window) -> tuple[Floats, Floats, Floats]:
    """Times, a vector (m, 3) in world axes, and the values of ``pose_signals``."""
    names = [*(f"{name}.{axis}" for axis in "xyz"), *pose_signals(run)]
    t, _ = run.signal(names[0], window)
    values = np.stack([run.signal(each, window)[1] for each in names], axis=1)
    return t, values[:, :3], values[:, 3:]


def _track(run: RunData, of: str) -> str:
    if f"{of}_track" not in run.tracks:
        raise Missing(f"the vehicle has no track on the side '{of}'")
    return f"{of}_track"
