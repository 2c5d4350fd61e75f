"""Points of a sweep: a grid of lists and ranges, and a Latin hypercube over ranges without a number of points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import Decimal
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from fmus.vehicles.tables import QUANTITY, BadInput

MAX_CASES = 10_000  # cases of a sweep


class Value(NamedTuple):
    """Value of a varied key."""

    text: str  # as in KEY=VALUE
    shown: float | str  # in tables and pictures: a number in the unit of its variation, or the text


class Variation(NamedTuple):
    """Key of a scene that a sweep varies."""

    text: str  # as given, KEY=...
    key: str
    unit: str  # as given; empty for SI units and words
    values: tuple[Value, ...]  # of a list or a range a:b:n; empty for a range a:b
    ends: tuple[float, float] | None = None  # of a range a:b, which is sampled

    @property
    def head(self) -> str:
        """Key with its unit."""
        return f"{self.key}, {self.unit}" if self.unit else self.key

    @property
    def is_number(self) -> bool:
        """True if its values are numbers."""
        return not any(isinstance(value.shown, str) for value in self.values)


class Design(NamedTuple):
    """Varied keys, and the values of all of them for each case."""

    variations: tuple[Variation, ...]
    points: tuple[tuple[Value, ...], ...]
    sample: int | None
    seed: int

    @classmethod
    def of(cls, vary: Sequence[str], sample: int | None = None, seed: int = 0) -> Design:
        """Every combination of the values of ``KEY=x,y,z`` and ``KEY=a:b:n``, the first key slowest.

        With ranges ``KEY=a:b`` each combination meets the ``sample`` points of a Latin hypercube over these ranges,
        ``numpy.random.default_rng(seed)``. Raises BadInput.
        """
        variations = tuple(_variation(text) for text in vary)
        sampled = [variation for variation in variations if variation.ends]
        _check(variations, sampled, sample, seed)
        factors = [[{one.key: value} for value in one.values] for one in variations if not one.ends]
        if sample is not None:
            factors.append(_latin_hypercube(sampled, sample, seed))
        points = []
        for combination in product(*factors):
            values = {key: value for factor in combination for key, value in factor.items()}
            points.append(tuple(values[variation.key] for variation in variations))
        return cls(variations, tuple(points), sample, seed)

    def stated(self) -> dict[str, Any]:
        """Definition of the design as plain data, for a file."""
        return {"vary": [one.text for one in self.variations], "sample": self.sample, "seed": self.seed}

    def settings(self, point: Sequence[Value]) -> tuple[str, ...]:
        """``KEY=VALUE`` of a point."""
        return tuple(f"{one.key}={value.text}" for one, value in zip(self.variations, point, strict=True))


def _check(variations: Sequence[Variation], sampled: Sequence[Variation], sample: int | None, seed: int) -> None:
    keys = [variation.key for variation in variations]
    if not keys:
        raise BadInput("vary KEY=a:b:n: a sweep needs a key to vary")
    if twice := [key for key in keys if keys.count(key) > 1]:
        raise BadInput(f"vary {twice[0]}: is given twice")
    if sampled and sample is None:
        raise BadInput(f"vary {sampled[0].key}: a range a:b needs a number of points, a:b:n, or sample = N")
    if sample is not None and not sampled:
        raise BadInput(f"sample {sample}: needs a range, vary KEY=a:b")
    if sample is not None and sample < 1:
        raise BadInput(f"sample {sample}: must be at least 1")
    if seed < 0:
        raise BadInput(f"seed {seed}: must be at least 0")
    count = math.prod(len(variation.values) for variation in variations if not variation.ends) * (sample or 1)
    if count > MAX_CASES:
        raise BadInput(f"vary: these are {count} cases, and {MAX_CASES} are allowed")


def _variation(text: str) -> Variation:
    key, _, values = (part.strip() for part in text.partition("="))
    if not key or not values:
        raise BadInput(f"vary {text}: must be KEY=a:b:n or KEY=x,y,z")
    return _range(text, key, values.split(":")) if ":" in values else _list(text, key, values.split(","))


def _list(text: str, key: str, parts: Sequence[str]) -> Variation:
    texts = [part.strip() for part in parts]
    if "" in texts or len(set(texts)) < len(texts):
        raise BadInput(f"vary {text}: {'a value is empty' if '' in texts else 'a value is given twice'}")
    quantities = [QUANTITY.fullmatch(part) for part in texts]
    if None in quantities:
        return Variation(text, key, "", tuple(Value(part, part) for part in texts))
    units = [found[2] for found in quantities if found]
    if units[-1] and not any(units[:-1]):  # "10,20,30 kN"
        whole = [*(f"{part} {units[-1]}" for part in texts[:-1]), texts[-1]]
        quantities = [QUANTITY.fullmatch(part) for part in whole]
    unit = _unit(text, [found[2] or "" for found in quantities if found])
    return Variation(text, key, unit, tuple(Value(found[0], float(found[1])) for found in quantities if found))


def _range(text: str, key: str, parts: Sequence[str]) -> Variation:
    """Range with both ends; its points are the nearest doubles to the decimal numbers."""
    quantities = [found for part in parts if (found := QUANTITY.fullmatch(part))]
    if len(quantities) < len(parts) or len(parts) > 3:
        raise BadInput(f"vary {text}: must be a:b:n, two numbers and a number of points, for example 20:40:3 kN")
    unit = _unit(text, [found[2] for found in quantities if found[2]])
    low, high, *count = (Decimal(found[1]) for found in quantities)
    if not math.isfinite(float(low)) or not math.isfinite(float(high)):
        raise BadInput(f"vary {text}: must have finite ends")
    if low == high and count != [1]:
        raise BadInput(f"vary {text}: the range is empty")
    if not count:
        return Variation(text, key, unit, (), (float(low), float(high)))
    if not (1 <= count[0] <= MAX_CASES and count[0] == int(count[0])):
        raise BadInput(f"vary {text}: the number of points must be a whole number from 1 to {MAX_CASES}")
    steps = int(count[0]) - 1
    numbers = [float(low + (high - low) * k / steps) for k in range(1, steps + 1)]
    return Variation(text, key, unit, tuple(_value(number, unit) for number in [float(low), *numbers]))


def _unit(text: str, units: Sequence[str]) -> str:
    if len(set(units)) > 1:
        raise BadInput(f"vary {text}: all numbers must have one unit")
    return units[0] if units else ""


def _value(number: float, unit: str) -> Value:
    return Value(f"{number!r}".removesuffix(".0") + (f" {unit}" if unit else ""), number)


def _latin_hypercube(sampled: Sequence[Variation], count: int, seed: int) -> list[dict[str, Value]]:
    """Points of a Latin hypercube: a range has one of them in each of ``count`` equal parts."""
    from scipy.stats import qmc

    lows, highs = zip(*(sorted(one.ends) for one in sampled if one.ends), strict=True)
    unit_points = qmc.LatinHypercube(len(sampled), seed=np.random.default_rng(seed)).random(count)
    points = qmc.scale(unit_points, lows, highs).tolist()
    return [{one.key: _value(number, one.unit) for one, number in zip(sampled, point, strict=True)} for point in points]
