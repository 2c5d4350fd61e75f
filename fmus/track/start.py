"""Start of a chain: it is laid out round the wheels as drawn, and brought to rest on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.interface.model import InvalidParameter, StepFailed
from fmus.physics.arrays import Floats
from fmus.physics.chain.integration import PINNED, PULLED, Environment
from fmus.physics.chain.layout import (
    catenary,
    chain_of_angles,
    closed_polygon,
    folded,
    hanging_arc,
    over_sprocket,
    regular_polygon,
    rescaled,
)
from fmus.physics.elementary import hypot, sin
from fmus.start import StartPose
from fmus.vehicles.sides import SMOOTH_WHEELS, ground_level, pins_a_turn, pitch_radius, smooth_wheels, thickness


def drawn(vehicle: Mapping[str, Any], wheels: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Wheels of a track's config with their ``position``, (x, z) in m, and the ``radius``, m, of rims.

    The sprocket is at the origin. What a wheel of the config gives itself comes before the vehicle table.
    """
    known: dict[str, Any] = {"sprocket": {"position": [0.0, 0.0], "radius": vehicle["sprocket"].get("radius")}}
    for wheel in (wheel for wheel in smooth_wheels(vehicle) if "x" in wheel):
        known[wheel["name"]] = {"position": [wheel["x"], wheel["z"]], "radius": wheel["radius"]}
    return [{**known.get(wheel["name"], {}), **wheel} for wheel in wheels]


def drawn_keys(wheels: Sequence[Mapping[str, Any]]) -> list[str]:
    """Keys of the vehicle table that ``drawn`` reads."""
    tables = {wheel["name"].partition("[")[0] for wheel in wheels if "position" not in wheel}
    tables = {table if table in SMOOTH_WHEELS else f"wheel.{table}" for table in tables - {"sprocket"}}
    return [f"{table}.{key}" for table in sorted(tables) for key in ("radius", "x", "z")]


# Rotary inertia of links that sink, over their own: deep soil holds a link up far below its centre, so that its level
# place is an equilibrium on an edge, and a search in which links may turn at once tips them over.
SINKING = 1e6
LOWERED = 0.05  # m, by which wheels go into soil at a time as a chain comes to rest
FINER = 3  # times that the stages are halved where a chain finds no rest


def not_at_rest(link: int, residual: float) -> StepFailed:
    """Failure of the search for static equilibrium; the ``residual``, N, is that of a ``link``, an index."""
    return StepFailed(
        f"static equilibrium of the track was not found: {residual:.3g} N are left on link {link + 1};"
        " start = 'polygon' needs none"
    )


class LaidChain:
    """Chain of links that can be laid out; a subclass brings it to rest.

    The subclass sets the fields and implements ``pins``, ``settle``, ``find_equilibrium``, ``tighten`` and
    ``evaluate_start``.
    """

    vehicle: Mapping[str, Any]  # tables of the vehicle, of the track's config and of its wheels as drawn
    config: Mapping[str, Any]
    wheel_list: Sequence[Mapping[str, Any]]
    links_count: int
    nodes: int  # number of pins
    closed: bool
    ends_kind: int  # see ``chain.integration``
    pitch: float  # m
    pose: StartPose
    environment: Environment
    start_rows: Floats  # (wheels, WIDTH) rows of the wheels at the start
    rotary_factor: float  # rotary inertia of links in the search for equilibrium, over their own

    @property
    def is_free_loop(self) -> bool:
        """Whether the chain is a loop without wheels."""
        return self.closed and not self.wheel_list

    def polygon(self, rest: bool = True) -> Floats:
        """Pins (nodes, 2) of the start layout, m; with ``rest`` near equilibrium. Raises InvalidParameter."""
        lugs = self.vehicle["sprocket"].get("pins_per_gap") or 1
        try:
            if self.is_free_loop:
                return regular_polygon(self.pitch, self.links_count)
            if self.closed:
                teeth = self.vehicle["sprocket"]["teeth"]
                return closed_polygon(*self.circles(), self.pitch, self.links_count, teeth, lugs)
            if self.ends_kind == PINNED:
                first, last = (np.array(self.config["ends"][end], dtype=float) for end in ("first", "last"))
                return (catenary if rest else hanging_arc)(first, last, self.pitch, self.links_count)
            if not self.wheel_list:
                level = ground_level(self.vehicle) + thickness(self.vehicle["track"]) - self.vehicle["track"]["face"]
                return np.stack([-self.pitch * np.arange(self.nodes), np.full(self.nodes, level)], axis=1)
            centre = np.array(self.wheel_list[0]["position"], dtype=float)
            return over_sprocket(centre, self.pitch, pins_a_turn(self.vehicle), self.links_count, lugs)
        except ValueError as error:
            raise InvalidParameter(f"the track cannot be laid out: {error}") from None

    def circles(self) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Centres (wheels, 2) and radii (wheels) of the line of pins round the wheels, m; which wheels are rims."""
        wheels, face = self.wheel_list, self.vehicle["track"]["face"]
        seated = pitch_radius(self.vehicle, sin)
        rims = np.array([w["kind"] != "teeth" for w in wheels])
        radii = np.array([w["radius"] + face if rim else seated for w, rim in zip(wheels, rims, strict=True)])
        return np.array([w["position"] for w in wheels], dtype=float), radii, rims

    def lay_out(self, layout: str, spin: float) -> None:
        """Lay the chain out, and with some layouts bring it to rest on the wheels of the start; raises StepFailed."""
        if layout in ("straight", "folded"):
            self.settle(self._released(layout), rest=False)
            self.tighten()
        elif layout == "displaced":
            first, last = (np.array(self.config["ends"][end], dtype=float) for end in ("first", "last"))
            near = first + (last - first) * 0.7 * self.links_count * self.pitch / hypot(*(last - first))
            self.settle(catenary(first, near, self.pitch, self.links_count), rest=True)
            pins = rescaled(self.pins()[:, [0, 2]], last, self.pitch)
            self.settle(pins, rest=False)
            self.tighten()
        else:
            rest = layout == "rest"
            pins = np.stack(self.pose.pitch_point(*self.polygon(rest).T), axis=1)
            if rest and self.wheel_list and self.config.get("soil"):
                self._sink(pins)
            elif self.ends_kind == PULLED and not self.wheel_list:
                self._lie(pins, rest)
            elif rest and self.wheel_list and self.start_rows[0, 11]:
                self._lean(pins)
            else:
                try:
                    self.settle(pins, rest, spin)
                except StepFailed:  # a slack chain on wheels may be on its way still: search on from there
                    if not (rest and self.wheel_list):
                        raise
                    with suppress(StepFailed):
                        return self.find_equilibrium(self.start_rows)
                    self.find_equilibrium(self.start_rows)

    def _lean(self, pins: Floats) -> None:
        """Bring the chain to rest on upright wheels first, then on the wheels as they lean, see ``settle``."""
        leaning = self.start_rows.copy()
        self.start_rows[:, 9:12] = 0.0, 1.0, 0.0
        self.start_rows[:, 13] = 0.0
        self.settle(pins, rest=True)
        for _ in range(2):  # rounding decides where the first search ends across the chain
            self.find_equilibrium(leaning)

    def _lie(self, pins: Floats, rest: bool) -> None:
        """Lay the chain on the ground; its ends are pulled from then on, because friction holds nothing at rest."""
        pull = self.environment.pull.copy()
        self.environment.pull[:] = 0.0
        if rest and self.config.get("soil") and not (self.config.get("terrain") or self.config.get("bump")):
            self.rotary_factor = SINKING
            self.settle(pins, rest)
            self.rotary_factor = 1.0
            self.find_equilibrium(self.start_rows)
        else:
            self.settle(pins, rest)
        self.environment.pull[:] = pull
        self.evaluate_start()

    def _sink(self, pins: Floats) -> None:
        """Bring the chain that was laid round the wheels as drawn to rest in soil, in stages, see ``settle``.

        Soil would hold up a chain over wheels that are far below, and they would come to rest past its links. Where a
        stage finds no rest, the way is done again in shorter ones.
        """
        wheels, drawn = self.start_rows.copy(), self.start_rows.copy()
        drawn[:, [0, 2]] = [self.pose.pitch_point(*wheel["position"]) for wheel in self.wheel_list]
        stages = max(ceil(abs(wheels - drawn).max() / LOWERED), 1)
        for finer in range(FINER + 1):
            count = stages << finer
            try:
                self.start_rows[:] = drawn + 1 / count * (wheels - drawn) if count > 1 else wheels
                self.settle(pins, rest=True)
                for k in range(2, count + 1):
                    self.find_equilibrium(drawn + k / count * (wheels - drawn) if k < count else wheels)
                return
            except StepFailed:
                if finer == FINER:
                    raise

    def _released(self, layout: str) -> Floats:
        """Pins (nodes, 2), m, of a chain that is released and held at its first pin."""
        first = np.array(self.config["ends"]["first"], dtype=float)
        if layout == "straight":
            return chain_of_angles(first, np.zeros(self.links_count), self.pitch)
        try:
            return folded(first, self.pitch, self.links_count)
        except ValueError as error:
            raise InvalidParameter(f"start = 'folded': {error}") from None

    # Implemented by subclasses ---------------------------------------------------------------------------------

    def pins(self) -> Floats:
        """Positions of the pins (nodes, 3) in the track's frame, m."""
        raise NotImplementedError

    def evaluate_start(self) -> None:
        """Evaluate accelerations and outputs of the start; raises StepFailed."""
        raise NotImplementedError

    def settle(self, pins: Floats, rest: bool, spin: float = 0.0) -> None:
        """Set the chain at rest to the polygon ``pins`` (nodes, 2), m; with ``rest``, to static equilibrium.

        A free loop may turn about the origin at ``spin`` rad/s; its equilibrium is then relative to that rotation.
        Raises StepFailed.
        """
        raise NotImplementedError

    def find_equilibrium(self, rows: Floats) -> None:
        """Find static equilibrium on wheels at rest at ``rows`` (wheels, 15), from the present state.

        Raises StepFailed.
        """
        raise NotImplementedError

    def tighten(self) -> None:
        """Give the links of a released chain the tension of that instant; rigid links need nothing."""
