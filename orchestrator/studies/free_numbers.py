"""Free numbers of a scene: real numbers by dotted key, with the range in which they are searched."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from fmus.vehicles.tables import BadInput
from orchestrator.scene.kinds import Scene
from orchestrator.scene.scene import with_settings
from orchestrator.scene.settings import hint, parts_of

SMALL = 1e-4  # change, in units of a number's size, that every free number must allow


class FreeNumber(NamedTuple):
    """Number of a scene that is fitted, in SI units."""

    key: str
    start: float
    low: float
    high: float
    size: float  # unit of its variable
    file: str = ""  # of measured data, to whose times it is added; empty: a number of the scenes


def free_numbers(scenes: Sequence[Scene], texts: Sequence[str]) -> tuple[FreeNumber, ...]:
    """Numbers by ``KEY`` or ``KEY=FROM:TO``, whose ends may have a unit; they start from the first scene.

    Raises BadInput, also where another scene has no such number or refuses it.
    """
    if not texts:
        raise BadInput("free KEY: a fit needs a number to fit")
    numbers = tuple(_free_number(scenes[0], text) for text in texts)
    if len({one.key for one in numbers}) < len(numbers):
        raise BadInput(f"free {numbers[-1].key}: is given twice")
    for scene in scenes[1:]:
        for one in numbers:
            number_at(scene, one.key)
            with_settings(scene, {one.key: one.start})
    return numbers


def _free_number(scene: Scene, text: str) -> FreeNumber:
    key, _, ends = (part.strip() for part in text.partition("="))
    start, (low, high) = number_at(scene, key), (-math.inf, math.inf)
    if ends:
        parts = [part.strip() for part in ends.split(":")]
        if len(parts) != 2 or not all(parts):
            raise BadInput(f"free {text}: must be KEY or KEY=FROM:TO, for example vehicle.track.tension=10:20 kN")
        unit = parts[1].lstrip("+-.0123456789eE").strip()
        if unit and parts[0][-1:] in "0123456789.":
            parts[0] = f"{parts[0]} {unit}"
        low, high = (number_at(with_settings(scene, [f"{key}={part}"]), key) for part in parts)
        if not low < high:
            raise BadInput(f"free {text}: FROM must be below TO")
        if not low <= start <= high:
            raise BadInput(
                f"free {text}: the scene has {start:g}, outside of the range {low:g} to {high:g} (SI):"
                f" the setting {key}=... moves the start"
            )
    size = abs(start) or high - low
    if not 0.0 < size < math.inf:
        raise BadInput(f"free {text}: the scene has 0, so a range KEY=FROM:TO must say how large it may be")
    try:
        with_settings(scene, {key: start + SMALL * size * (1.0 if start + SMALL * size <= high else -1.0)})
    except BadInput as error:  # a stop, for example, is a multiple of the step
        raise BadInput(f"free {text}: cannot be changed a little: {error}") from None
    return FreeNumber(key, start, low, high, size)


def number_at(scene: Any, key: str, option: str = "free") -> float:
    """Number of a dotted key of a scene, SI; raises BadInput where there is none."""
    place: Any = scene.resolved()
    for part in parts_of(key):
        if isinstance(place, Mapping) and part in place:
            place = place[part]
        elif isinstance(place, list | tuple) and part.isdecimal() and int(part) < len(place):
            place = place[int(part)]
        else:
            inner = (
                range(len(place)) if isinstance(place, list | tuple) else place if isinstance(place, Mapping) else ()
            )
            near = hint(part, [*map(str, inner)], "there are") if inner else "it has no parts"
            raise BadInput(
                f"{option} {key}: {scene.where} has no such number ('{part}'): {near}; 'cotrack keys' lists all"
            )
    if not isinstance(place, float):
        raise BadInput(f"{option} {key}: is {json.dumps(place)[:60]} in {scene.where}, and a real number is needed")
    return place
