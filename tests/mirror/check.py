"""Check: the outputs that it covers, their expected values and tolerance, and faults to notice."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from mirror.driver_plan import PlanningDriverView
from mirror.driver_view import DriverView
from mirror.hull import Hull
from mirror.kinds import chain, kind_of
from mirror.links import UP, Chain
from mirror.motion import Recursion, Wheels, wheels
from mirror.record import Floats, Part, Record
from mirror.spin import Spin
from mirror.touch import Touch, touch

FEW = 0.06  # a few per cent
FAULTS: dict[str, Callable[[Floats], Floats]] = {
    "a few per cent larger": lambda y: (1.0 + FEW) * y,
    "of the other sign": lambda y: -y,
}


class View:
    """One component of a run as checks see it; quantities from states and inputs are computed once.

    Meanwhile all outputs of the component are NaN, so that no expected value can depend on the checked outputs.
    """

    def __init__(self, record: Record, name: str) -> None:
        self.record, self.part = record, record[name]

    @property
    def kind(self) -> str:
        """Kind of the component; of a track, the kind of its links too."""
        return kind_of(self.part)

    @property
    def side(self) -> str:
        return "right" if self.part.name.startswith("right") else "left"

    # --- of a track

    @property
    def track(self) -> dict:
        return self.part.config["track"]

    @cached_property
    def chain(self) -> Chain:
        return chain(self.part)

    @cached_property
    def wheels(self) -> Wheels:
        return wheels(self.part)

    @cached_property
    def touch(self) -> Touch:
        return touch(self.chain, self.wheels)

    @cached_property
    def recursion(self) -> Recursion:
        p = self.part.parameters
        return Recursion.of(float(p["spectral_radius"]), p["integrator"] == "hht")

    @cached_property
    def accelerations(self) -> Floats:
        return self.recursion.rates(self.chain.state_rates, self.part.h)

    @cached_property
    def joints(self) -> Floats:
        from mirror.forces import joints

        return joints(self)

    # --- of a chassis, of a drive

    @cached_property
    def hull(self) -> Hull:
        return Hull(self.part)

    @cached_property
    def spin(self) -> Spin:
        return Spin(self.part)

    # --- of a driver

    @cached_property
    def driver(self) -> DriverView:
        return PlanningDriverView(self.part) if self.part.parameters["friction"] else DriverView(self.part)

    def on_wheels(self) -> bool:
        """True if a track runs on wheels."""
        return bool(self.track["wheels"])

    def always(self) -> bool:
        return True


Expected = Floats | tuple[Floats, Floats]


class Check(NamedTuple):
    """Expected outputs: ``expected(view, names)`` gives ``names`` at all instants, shape (K + 1, names).

    NaN means no statement; a pair of such arrays are bounds. The tolerance is ``relative`` times the output's largest
    value in the run plus ``floor`` (in the output's unit), the convergence of the component's own iteration. A
    ``balance`` uses other outputs: it is computed separately for each of its outputs, while that one is NaN.
    """

    outputs: str  # regular expression of whole names
    basis: str
    expected: Callable[[View, Sequence[str]], Expected]
    relative: float
    floor: float = 0.0
    balance: bool = False
    applies: Callable[[View], bool] = View.always

    def names(self, part: Part) -> list[str]:
        """Names of the component's outputs that it checks."""
        return [name for name in part.outputs if re.fullmatch(self.outputs, name)]

    def bounds(self, view: View) -> dict[str, tuple[Floats, Floats]]:
        """Bounds of every output at all instants, computed without the output itself."""
        names = self.names(view.part)
        bounds = {}
        for group in ([name] for name in names) if self.balance else filter(None, [names]):
            hidden = group if self.balance else list(view.part.outputs)
            with view.part.replaced_outputs(hidden, lambda y: np.full_like(y, np.nan)):
                expected = self.expected(view, group)
            low, high = expected if isinstance(expected, tuple) else (expected, expected)
            for j, name in enumerate(group):
                bounds[name] = tuple(np.asarray(a).reshape(len(view.part.t), -1)[:, j] for a in (low, high))
        return bounds

    def relative_error(self, y: Floats, low: Floats, high: Floats) -> float:
        """Largest error over the tolerance; raises AssertionError where nothing is expected."""
        known = ~np.isnan(low)
        if not known.any():
            raise AssertionError(f"'{self.basis}' says nothing: it leans on the output itself")
        y, low, high = y[known], low[known], high[known]
        allowed = self.relative * max(abs(low).max(), abs(high).max()) + self.floor
        miss = np.maximum(np.maximum(low - y, y - high), 0.0)
        if not np.isfinite(miss).all():
            return np.inf
        return float(miss.max() / allowed) if allowed > 0.0 else float(np.where(miss.max() > 0.0, np.inf, 0.0))


def forward(view: View) -> Floats:
    """Heading of the vehicle, in the plane of the start and perpendicular to the first axle, shape (K + 1, 3)."""
    ahead = np.cross(view.wheels.axle[:, 0], view.chain.turn.apply(UP))
    return ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
