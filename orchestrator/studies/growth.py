"""What becomes of one ulp: runs with one number of the scene changed by its last bit, as the measure of other trees.

Contacts make a track sensitive: a difference grows, at speed some 15-fold a second. How far two trees that differ by
rounding may come apart is therefore measured: by how far a run comes apart from itself when one parameter is changed by
one unit in its last place. A tree with other roundings rounds otherwise in every step, which is more than one change at
the start, and Newton's iteration may take one correction more somewhere: what is allowed is a multiple of the growth
and of LEAST.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from fmus.physics.arrays import Floats
from orchestrator.log.reader import Log
from orchestrator.scene.scene import load
from orchestrator.studies.baseline_file import Grown
from orchestrator.studies.runs import logged

EVERY = 0.02  # s
BEYOND = 0.1  # s
LEAST = 1e-12  # of the largest value of a signal, beside the growth
SIGNALS = (
    "chassis.chassis.position.x", "chassis.chassis.position.z", "chassis.pitch", "chassis.chassis.velocity.x",
    "left_drive.torque", "left_track.travel", "left_track.tension.mean", "left_track.tension.max",
    "left_track.energy.contact", "left_track.energy.dissipated", "left_track.ground.force.z",
)  # fmt: skip
THEN = ("run.step=1 ms", "track.step=1 ms")  # steps of `straight` and `settle` when the baseline was made
# Numbers of the vehicle, each changed by one ulp in a run of its own.
CHANGED = ("gravity", "contact.ground.stiffness", "contact.wheel.stiffness", "suspension.stiffness")


class Pair(NamedTuple):
    """A scene and how far it is run."""

    scene: str
    track: str
    stop: float  # s
    brief: float  # s, of the quick form
    settings: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """In words."""
        return f"{self.scene}, {self.track}"


RUNS = (
    Pair("straight", "flexible", 4.0, 0.5, THEN),
    Pair("straight", "rigid", 4.0, 0.5, THEN),
    Pair("hard_stop", "flexible", 8.0, 1.0),
    Pair("hard_stop", "rigid", 8.0, 1.0),
    Pair("turn", "flexible", 4.0, 0.5),
)


def trajectory(pair: Pair, stop: float, settings: Sequence[str] = ()) -> tuple[Floats, Floats]:
    """Instants (T,) and signals (T, N) of a run; raises RuntimeError when it fails.

    A run that is cut short goes on a little: variable steps would end elsewhere where it stops.
    """
    longer = stop if stop == pair.stop else stop + BEYOND
    asked = [f"run.stop={longer}", "expect={}", "track.link_outputs=false", *pair.settings, *settings]
    scene = load(pair.scene, pair.track, asked)
    t = EVERY * np.arange(round(stop / EVERY) + 1.0)
    with logged(scene, pair.name) as path, Log(path) as log:
        return t, np.stack([np.interp(t, *log.signal(name)) for name in SIGNALS], axis=1)


def changed(pair: Pair, key: str) -> tuple[str, ...]:
    """The setting that changes a number of the vehicle by one ulp."""
    value = attrgetter(f"vehicle.{key}")(load(pair.scene, pair.track))
    return (f"vehicle.{key}={math.nextafter(value, math.inf)!r}",)


def grown(pair: Pair, values: Sequence[Floats]) -> Grown:
    """A run and its growth from the signals of the run as it is, then of those with a change."""
    t = EVERY * np.arange(float(len(values[0])))
    apart = np.max([abs(other - values[0]) for other in values[1:]], axis=0)
    return Grown(pair.name, SIGNALS, t, values[0], np.maximum.accumulate(apart, axis=0))


def ratios(known: Grown, values: Floats) -> Floats:
    """How far signals (T', N) are from the known ones, over the growth of one ulp; of the first T' instants."""
    rows = len(values)
    least = LEAST * abs(known.values).max(axis=0)
    return np.asarray(abs(values - known.values[:rows]) / (known.growth[:rows] + least))
