"""Tables ``[ground]``: slopes, obstacles, roughness, maps and friction of the ground, in the frame of the world.

Obstacles lie across the world's x axis, whatever the heading of the vehicle; with heading 0 and position 0 that is
ahead of the sprocket axle. Only a bump alone lies in the frame of the start. Heights of all parts add; those with a
start leave the ground level behind it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from fmus.ground.soils import SoilTable
from fmus.interface.numbers import Meaning
from fmus.vehicles.tables import GIVEN, Angle, Distance, FrozenTable, In, Length, Place, When, meanings, ratio
from fmus.vehicles.vehicle import VehicleTable

Slope = Annotated[float, In("1", ge=-2.0, le=2.0)]
Radius = Annotated[float, In("m", ge=1e-3)]  # below, a link's penetration is larger than its edge
Places = Annotated[tuple[Place, ...], Field(min_length=1, max_length=100)]
Height = Annotated[float, In("m", plain=True, ge=-1e4, le=1e4)]
MAX_HEIGHTS = 200_000  # of a map: a log holds them as text
STEEPEST = 10.0  # 84 degrees, between neighbours of a map: beyond is no ground, but a gap in the data or another unit
MAX_WAVES = 6000  # of a rough profile: the time to add them grows with the square
EVERYWHERE = (-1e6, 1e6)  # from and to, m
SLOPES = ("grade", "bank")  # keys that, with those of SHAPES, make a ground a terrain, whose kernels are then loaded
SHAPES = ("step", "half_round", "trench", "kerb", "washboard", "rough", "heightmap", "friction")
EVEN = 1e-9  # largest distance of the ground from a plane that counts as one, m


def is_terrain(ground: Mapping[str, Any]) -> bool:
    """Whether the ground is neither level nor level with a bump."""
    return any(ground.get(key) for key in (*SLOPES, *SHAPES))


def is_plane(ground: Mapping[str, Any]) -> bool:
    """Whether the ground is a slope everywhere, and nothing else."""
    return ground.get("incline_start") is None and not any(ground.get(key) for key in (*SHAPES, "bump"))


def check_points(rows: float, columns: float, remedy: str = "") -> None:
    """Raise ValueError, with ``remedy`` at its end, for a map that is empty or too large."""
    if not 0 < rows * columns <= MAX_HEIGHTS:
        raise ValueError(f"has {columns:.0f} x {rows:.0f} points, must have 1 to {MAX_HEIGHTS}{remedy}")


class BumpTable(FrozenTable):
    """Trapezoidal obstacle across the path, with rounded edges, in the frame of the start."""

    start: Place
    """beginning of the obstacle, ahead of the sprocket axle"""
    rise: Distance
    """height of the obstacle"""
    slope: Annotated[float, In("rad", gt=0, lt=1.5)]
    """slope of both ramps"""
    length: Annotated[float, In("m", ge=0)]
    """length of the flat top"""
    radius: Distance
    """radius of all four edges"""


class StepTable(FrozenTable):
    """Steps across x, with vertical walls."""

    x: Places
    """places of the walls along x; several equal steps are stairs"""
    rise: Length
    """height of a step; down if negative"""
    radius: Radius = 0.02
    """radius of both edges of a step; one that is lower than two radii has no wall"""

    @model_validator(mode="after")
    def _check_rise(self) -> StepTable:
        if self.rise == 0.0:
            raise ValueError("rise = 0 m: a step needs a height, up or down")
        return self


class HalfRoundTable(FrozenTable):
    """Half cylinders across x."""

    x: Places
    """places of their axes along x"""
    radius: Radius
    """radius, which is their height"""
    fillet: Radius = 0.02
    """radius of the concave arcs at their feet; wheels of a larger radius do not touch them"""


class TrenchTable(FrozenTable):
    """Trench across x, with vertical walls."""

    start: Place
    """place of the near wall along x"""
    width: Distance
    """distance of the walls"""
    depth: Distance
    """depth of its floor"""
    radius: Radius = 0.02
    """radius of all four edges"""


class KerbTable(FrozenTable):
    """Higher ground beyond a vertical wall along x."""

    y: Place
    """place of the wall along y; the ground beyond it, seen from y = 0, is higher"""
    rise: Length
    """height of the kerb; lower ground if negative"""
    radius: Radius = 0.02
    """radius of both edges"""
    start: Place | None = None
    """x where it begins to rise; without it, it is everywhere"""
    length: Annotated[Distance, When(start=GIVEN)] = 1.0
    """length over which it rises"""

    @model_validator(mode="after")
    def _check_rise(self) -> KerbTable:
        if self.rise == 0.0:
            raise ValueError("rise = 0 m: a kerb needs a height, up or down")
        return self


class WashboardTable(FrozenTable):
    """Sine waves across x, which fade in and out over one wave."""

    amplitude: Distance
    """amplitude: crests are twice as much above troughs"""
    wavelength: Distance
    """length of a wave"""
    phase: Angle = 0.0
    """phase by which the side y < 0 is behind the other; half a turn: crests beside troughs"""
    start: Place
    """x where they begin"""
    end: Place | None = None
    """x where they end; without it, nowhere"""

    @model_validator(mode="after")
    def _check_end(self) -> WashboardTable:
        if self.end is not None and self.end < self.start + 2.0 * self.wavelength:
            raise ValueError(f"end = {self.end:g} m must be two waves or more beyond start = {self.start:g} m")
        return self


class RoughTable(FrozenTable):
    """Rough ground of ISO 8608: two lanes along x, one profile for y > 0 and one for y < 0, or a surface."""

    iso_class: Literal["A", "B", "C", "D", "E", "F", "G", "H"]
    """class of ISO 8608: A is a good road, D a bad one, E to H is off-road"""
    seed: Annotated[int, Field(ge=0, le=2**53)] = 1
    """number of the profile; a seed gives the same ground on every machine"""
    period: Distance = 200.0
    """length after which the profiles repeat"""
    band: tuple[Annotated[float, In("1/m", gt=0)], Annotated[float, In("1/m", gt=0)]] = (0.011, 2.83)
    """least and largest spatial frequency, cycles per length"""
    correlated: bool = False
    """both lanes have one profile"""
    isotropic: bool = False
    """a surface with that spectrum along every line instead of lanes, for vehicles that turn or do not drive along x"""
    start: Place | None = None
    """x where the roughness begins; an isotropic one may be everywhere"""
    length: Annotated[Distance, When(start=GIVEN)] = 2.0
    """length over which it fades in"""

    @model_validator(mode="after")
    def _check_band(self) -> RoughTable:
        low, high = self.band
        if self.isotropic and self.correlated:
            raise ValueError("isotropic and correlated exclude each other: a surface has no lanes")
        if self.start is None and not self.isotropic:
            raise ValueError("start is missing: lanes begin at an x; only an isotropic surface is everywhere")
        if not int(high * self.period) >= low * self.period:
            raise ValueError(
                f"band = [{low:g}, {high:g}] 1/m has no multiple of 1/period, period = {self.period:g} m: longer period"
            )
        if high * self.period > MAX_WAVES:
            raise ValueError(f"period = {self.period:g} m has more than {MAX_WAVES} waves up to {high:g} 1/m: shorter")
        return self


class HeightMapTable(FrozenTable):
    """Heights on a grid, with bicubic interpolation (Catmull-Rom); beyond the grid, those of its edges."""

    heights: Annotated[tuple[Annotated[tuple[Height, ...], Field(min_length=2)], ...], Field(min_length=2)]
    """heights, m, or a file of them: lines follow x, columns y (.csv, .npy of numbers); a grey image of 16 bits
    (.png), seen from above with x up and y to the left; a survey (.tif, .asc), whose rows run from north to south, with
    x to the east and y to the north; or a road (.crg)"""
    range: tuple[Place, Place] | None = None
    """heights of black and white of an image"""
    corner: tuple[Place, Place]
    """least x and y of the grid (middles of cells); required except for a survey or a road, which it moves"""
    spacing: tuple[Distance, Distance]
    """distance of the grid's lines along x and y; required except for a survey, which has its own, and a road, whose
    increments are the default"""
    start: Place | None = None
    """x where the map begins; without it, the map is everywhere"""
    length: Annotated[Distance, When(start=GIVEN)] = 1.0
    """length over which it fades in"""

    @model_validator(mode="after")
    def _check_grid(self) -> HeightMapTable:
        columns = {len(line) for line in self.heights}
        if len(columns) > 1:
            raise ValueError(f"heights: all lines must have as many columns, not {min(columns)} and {max(columns)}")
        if len(self.heights) * max(columns) > MAX_HEIGHTS:
            raise ValueError(f"heights: {len(self.heights)} x {max(columns)} are more than {MAX_HEIGHTS}: take fewer")
        for axis, spacing in enumerate(self.spacing):
            steps = np.abs(np.diff(self.heights, axis=axis))
            i, j = np.unravel_index(steps.argmax(), steps.shape)
            if steps[i, j] > STEEPEST * spacing:
                raise ValueError(
                    f"heights: from line {i + 1}, column {j + 1} to the next {'column' if axis else 'line'} they change"
                    f" by {steps[i, j]:g} m over {spacing:g} m, no ground is steeper than {STEEPEST:g} (84 degrees):"
                    " fill gaps in the data, check units and spacing, make walls by step or kerb"
                )
        if self.range is not None:
            raise ValueError("range: the heights are numbers already, only an image needs those of black and white")
        return self


class FrictionTable(FrozenTable):
    """Region with a friction of its own; where regions overlap, the last one holds."""

    x: tuple[Place, Place]
    """from and to along x"""
    y: tuple[Place, Place] = EVERYWHERE
    """from and to along y"""
    factor: Annotated[float, ratio(ge=0, le=10)] | None = None
    """coefficient of friction over that of vehicle.contact.ground"""
    coefficient: Annotated[float, ratio(ge=0, le=10)] | None = None
    """coefficient of friction, instead"""

    @model_validator(mode="after")
    def _check_region(self) -> FrictionTable:
        for key, (low, high) in (("x", self.x), ("y", self.y)):
            if not low < high:
                raise ValueError(f"{key} = [{low:g}, {high:g}] m must be in order")
        if (self.factor is None) == (self.coefficient is None):
            raise ValueError("needs one of factor and coefficient")
        return self


class LevelGroundTable(FrozenTable):
    """Level ground under a chain."""

    soil: SoilTable | None = None
    """soil under the tracks that gives way; without it the ground is hard"""


class GroundTable(FrozenTable):
    """Ground beyond its level, and contacts beyond those of the tracks."""

    hull: bool = False
    """the points vehicle.chassis.hull touch the ground"""
    grade: Slope | None = None
    """slope along x, uphill positive: 0.2 or '20 %'"""
    bank: Slope | None = None
    """slope along y, uphill positive"""
    incline_start: Place | None = None
    """x where grade and bank begin; without it, they are everywhere"""
    incline_length: Annotated[Distance | None, When(incline_start=GIVEN)] = None
    """length over which level ground turns into grade and bank, 1 m by default"""
    bump: BumpTable | None = None
    """obstacle across the path"""
    step: StepTable | None = None
    """steps across x"""
    half_round: HalfRoundTable | None = None
    """half rounds across x"""
    trench: TrenchTable | None = None
    """trench across x"""
    kerb: KerbTable | None = None
    """kerb along x"""
    washboard: WashboardTable | None = None
    """waves across x"""
    rough: RoughTable | None = None
    """rough ground"""
    heightmap: HeightMapTable | None = None
    """map of heights"""
    friction: Annotated[tuple[FrictionTable, ...], Field(min_length=1, max_length=100)] | None = None
    """regions with a friction of their own: x and y, each from and to, and factor or coefficient"""
    soil: SoilTable | None = None
    """soil under the tracks that gives way; without it the ground is hard"""
    refinement: tuple[Annotated[int, Field(ge=1, le=32)], Annotated[int, Field(ge=1, le=16)]] | None = None
    """times as many contact points along and across a link as on level ground, which has 2 and 2; without this key as
    its narrowest feature asks, 8 and 4 at most"""

    @model_validator(mode="after")
    def _check_together(self) -> GroundTable:
        if self.grade is None and self.bank is None and self.incline_start is not None:
            raise ValueError("incline_start needs grade or bank")
        if self.soil is not None:
            if self.friction is not None:
                raise ValueError("friction needs hard ground: soil has its own shear strength")
            if self.incline_start is None and (self.grade or self.bank):
                raise ValueError("soil needs a level start: begin the slope ahead, by incline_start")
        obstacles: dict[str, Any] = {key: getattr(self, key) for key in ("bump", "step", "half_round", "trench")}
        given = {key: table.model_dump() for key, table in obstacles.items() if table is not None}
        if given.keys() - {"bump"}:
            from fmus.ground.terrain import obstacles_profile

            obstacles_profile(given)  # refuses those that overlap
        return self

    def shaped_by(self) -> list[str]:
        """Keys that make the ground uneven, inclined, or of different friction by place."""
        keys = [
            key
            for key in GroundTable.model_fields
            if key not in ("hull", "soil", "refinement", "incline_start", "incline_length")
        ]
        return [key for key in keys if getattr(self, key) not in (None, 0.0)]

    def one_sided(self, position: Sequence[float], heading: float) -> str | None:
        """A key by which the ground differs from its mirror image in the plane of a vehicle, or None.

        ``position``, m, and ``heading``, rad: of the vehicle. What is not known to be its own image differs.
        """
        regions = [region.y for region in self.friction or ()]
        is_own = {  # under a vehicle along x
            **dict.fromkeys(("grade", "step", "half_round", "trench"), True),
            "washboard": not (self.washboard and self.washboard.phase),
            "rough": not self.rough or self.rough.correlated,
            "friction": all(y == EVERYWHERE or abs(sum(y) - 2.0 * position[1]) < EVEN for y in regions),
        }
        return next((key for key in self.shaped_by() if key != "bump" and (heading or not is_own.get(key))), None)


@cache
def number_meanings() -> dict[str, Meaning]:
    """Meanings of the numbers of vehicles and grounds, by their keys without indices, see ``interface.numbers``.

    A key of a seat or wheel has no name: ``seat.position``, ``wheel.tensioner.stiffness``.
    """
    return dict(meanings(VehicleTable)) | dict(meanings(GroundTable, "ground."))
