"""Colours of links by a recorded signal, and constant colours of the other bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats

if TYPE_CHECKING:
    from matplotlib.cm import ScalarMappable

Scale = tuple[float, float]  # least and largest value
Colour = tuple[int, int, int]  # red, green, blue, 0 to 255
MAP = "viridis"
STEEL = (150, 155, 160)
WHEEL = {"sprocket": (120, 120, 125), **dict.fromkeys(("road_wheel", "idler", "return_roller"), (90, 95, 100))}
PART = {"pad": (58, 58, 60), "horn": STEEL}  # of links; bodies show a signal
SPOKE = (225, 225, 225)
HULL, HULL_EDGE = (70, 95, 70), (40, 56, 40)
EARTH = (176, 160, 136)
RUT = (128, 112, 90)  # earth that is pressed
METRE = (120, 105, 85)  # lines on the ground
FORCE = (200, 40, 40)
# Line of the ground before a track came; faces and edges of wheels in pictures of a track.
UNTOUCHED: dict[str, Any] = {"color": "0.5", "linewidth": 0.8, "linestyle": (0, (6, 4))}
WHEEL_SHADES = {"sprocket": ("0.85", "0.5"), **dict.fromkeys(("road_wheel", "idler", "return_roller"), ("0.92", "0.6"))}


class LinkColour(NamedTuple):
    """Link signal that colours can show; a vector by its norm."""

    signal: str
    name: str
    unit: str

    @property
    def label(self) -> str:
        """Name with the unit."""
        return f"{self.name}, {self.unit}"


LINK_COLOURS = {
    "tension": LinkColour("link[*].tension", "link tension", "kN"),
    "stress": LinkColour("link[*].stress", "largest axial stress of a link", "MPa"),
    "ground": LinkColour("link[*].ground.force", "normal force of the ground on a link", "kN"),
    "wheels": LinkColour("link[*].wheels.force", "force of the wheels on a link", "kN"),
    "sliding": LinkColour("link[*].ground.sliding", "sliding speed of a link over the ground", "m/s"),
}


def to_unit_range(colour: Colour) -> tuple[float, float, float]:
    """Convert a colour from 0..255 to 0..1."""
    red, green, blue = colour
    return red / 255.0, green / 255.0, blue / 255.0


def map_colours(values: Floats | None, shape: tuple[int, ...], scale: Scale) -> NDArray[np.uint8]:
    """Red, green and blue (*shape, 3) of values (*shape); the colour of steel without values."""
    from matplotlib import colormaps

    if values is None:
        return np.broadcast_to(np.array(STEEL, np.uint8), (*shape, 3))
    low, high = scale
    share = np.clip((values - low) / (high - low), 0.0, 1.0)
    return np.asarray(colormaps[MAP](share, bytes=True))[..., :3]


def colour_bar(scale: Scale) -> ScalarMappable:
    """Scale of colours for a bar beside a picture."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    return ScalarMappable(Normalize(*scale), MAP)


def of_part(kind: str, values: Floats | None, shape: tuple[int, ...], scale: Scale) -> NDArray[np.uint8]:
    """Colours (*shape, 3) of a part of links: bodies show values (*shape), as ``map_colours``."""
    if kind in PART:
        return np.broadcast_to(np.array(PART[kind], np.uint8), (*shape, 3))
    return map_colours(values, shape, scale)
