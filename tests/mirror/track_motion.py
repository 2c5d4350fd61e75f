"""Expected motion along the chain: speed, travel, slip."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fmus.track.start import drawn
from mirror.check import View, forward
from mirror.motion import rotation_of
from mirror.record import Floats
from mirror.track_series import integrated

SPLIT = 0.1  # rad, angle between the neighbours of a link above which the run is not straight


def attitude(view: View):
    """Rotation and angular velocity (K + 1, 3) of the wheels' support: the chassis, where there is one."""
    if "chassis" in view.record.parts:
        chassis = view.record["chassis"]
        return rotation_of(chassis.vector("chassis.orientation", "wxyz")), chassis.vector("chassis.angular_velocity")
    turn = view.chain.turn
    return type(turn).concatenate([turn] * len(view.part.t)), np.zeros((len(view.part.t), 3))


def over_carrier(view: View) -> Floats:
    """Mean velocity of the straight runs along the chain, relative to the sprocket's mount (K + 1)."""
    c = view.chain
    a, b, va, vb = c.ends
    _, spin = attitude(view)
    if view.on_wheels():
        centre, v = view.wheels.centre[:, :1], view.wheels.velocity[:, :1]
        va, vb = (u - v - np.cross(spin[:, None], x - centre) for x, u in ((a, va), (b, vb)))
    along = (b - a) / np.linalg.norm(b - a, axis=-1, keepdims=True)
    if c.closed:
        before, after = np.roll(along, 1, axis=1), np.roll(along, -1, axis=1)
    else:
        before, after = (along[:, np.clip(np.arange(c.n) + k, 0, c.n - 1)] for k in (-1, 1))
    bend = 2.0 * (1.0 - (before * after).sum(-1)) / SPLIT**2
    weight = 1.0 / (1.0 + bend**2)
    return (weight * (0.5 * (va + vb) * along).sum(-1)).sum(1) / weight.sum(1)


def speed(view: View, names: Sequence[str]) -> Floats:
    return over_carrier(view)[:, None]


def travel(view: View, names: Sequence[str]) -> Floats:
    return integrated(view, over_carrier(view))[:, None]


def pin_travel(view: View) -> tuple[Floats, Floats]:
    """Distance of pins past lines fixed on the vehicle, on the upper and the lower run (K + 1), m."""
    c, (turn, _) = view.chain, attitude(view)
    matrix = turn.as_matrix()
    local = np.einsum("tji,tnj->tni", matrix, c.pins - view.wheels.centre[:, :1])
    places = np.array([wheel["position"] for wheel in drawn(view.part.config["vehicle"], view.track["wheels"])])
    x, z, far, height = local[..., 0], local[..., 2], places[:, 0].min(), places[:, 1].mean()
    runs = []
    for upper in (True, False):
        travel_bounds = []
        for line in np.linspace(0.8 * far, 0.2 * far, 12):
            d, e = x - line, np.roll(x - line, -1, axis=1)
            crosses = (d * e <= 0.0) & ((z > height) == upper) & (abs(d - e) < 2.0 * c.pitch)
            i, t = np.argmax(crosses, axis=1), np.arange(len(x))
            phase = np.unwrap(i + d[t, i] / (d[t, i] - e[t, i]), period=c.n)
            travel_bounds.append(c.pitch * (phase[0] - phase))
        runs.append(np.median(travel_bounds, axis=0))
    return runs[0], runs[1]


def travel_bounds(view: View, names: Sequence[str]) -> tuple[Floats, Floats]:
    """Bounds of the travel: the distances on the upper and on the lower run."""
    above, below = pin_travel(view)
    return np.minimum(above, below)[:, None], np.maximum(above, below)[:, None]


def growth_of_travel(view: View, names: Sequence[str]) -> Floats:
    """Speed at the end of a step from the travel: twice the mean speed less the speed at the other end."""
    mean = np.diff(view.part["travel"]) / view.part.h
    speed_now = over_carrier(view)
    return np.concatenate([[np.nan], 2.0 * mean - speed_now[:-1]])[:, None]


def slip(view: View, names: Sequence[str]) -> Floats:
    """Rearward velocity of the ground's contact points, averaged by their load."""
    t = view.touch
    back = -(t.slide * forward(view)).sum(1)
    return (back / np.where(t.load > 0.0, t.load, np.inf))[:, None]
