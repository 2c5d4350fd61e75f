"""Units by name: a fixed list with everyday spellings; products, quotients and powers of one digit.

``N m/rad``, ``N.m/rad``, ``kN/(m s)``, ``mm/s2``, ``s^-1``. A prefix stands only where the list has it, so that no name
is read as a prefix and another unit. Names of two meanings are refused, or read by the quantity that is asked for.
"""

from __future__ import annotations

import re
from difflib import get_close_matches
from functools import cache
from math import pi, prod
from typing import NamedTuple

PREFIXES = {"G": 1e9, "M": 1e6, "k": 1e3, "K": 1e3, "da": 1e1, "d": 1e-1, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9}
TABLE = (  # name, size, unit of the size, prefixes, other spellings
    ("%", 1e-2, "1", "", "percent"), ("g", 1e-3, "kg", "k K m u", "gram grams"), ("t", 1e3, "kg", "", "tonne tonnes"),
    ("lb", 0.45359237, "kg", "", "lbs pound pounds"), ("kgm2", 1.0, "kg m2", "", ""),
    ("m", 1.0, "m", "k K d c m u n", "metre metres meter meters"), ("in", 0.0254, "m", "", "inch inches"),
    ("thou", 2.54e-5, "m", "", ""), ("ft", 0.3048, "m", "", "foot feet"), ("mi", 1609.344, "m", "", "mile miles"),
    ("US survey foot", 1200.0 / 3937.0, "m", "", ""), ("l", 1e-3, "m3", "m", "L litre litres liter liters"),
    ("s", 1.0, "s", "m u n", "sec secs second seconds"), ("min", 60.0, "s", "", "mins minute minutes"),
    ("h", 3600.0, "s", "", "hr hrs hour hours"), ("d", 86400.0, "s", "", "day days"), ("msec", 1e-3, "s", "", ""),
    ("Hz", 1.0, "1/s", "G M k K m", "hertz"), ("rad", 1.0, "rad", "m u", "RAD radian radians"),
    ("deg", pi / 180.0, "rad", "", "\N{DEGREE SIGN} DEG Deg degree degrees"), ("gon", pi / 200.0, "rad", "", ""),
    ("rev", 2.0 * pi, "rad", "", "turn turns"), ("rps", 2.0 * pi, "rad/s", "", "r/s"),
    ("rpm", pi / 30.0, "rad/s", "", "RPM Rpm r/min U/min"), ("dps", pi / 180.0, "rad/s", "", ""),
    ("kmh", 1.0 / 3.6, "m/s", "", "kph kmph KPH KMH"), ("mph", 0.44704, "m/s", "", "MPH"),
    ("kn", 1852.0 / 3600.0, "m/s", "", "kt kts knot knots"), ("gn", 9.80665, "m/s2", "", ""),
    ("N", 1.0, "kg m/s2", "M k K da m", "newton newtons"), ("kgf", 9.80665, "N", "", "kp"),
    ("lbf", 4.4482216152605, "N", "", ""), ("Nm", 1.0, "N m", "M k K da m", ""), ("Nms", 1.0, "N m s", "k K", ""),
    ("Ns", 1.0, "N s", "k K m", ""), ("Pa", 1.0, "N/m2", "G M k K m", "pascal"), ("bar", 1e5, "Pa", "m", "Bar BAR"),
    ("psi", 6894.757293168361, "Pa", "", "PSI"), ("J", 1.0, "N m", "G M k K m", "joule joules"),
    ("Wh", 3600.0, "J", "M k K", ""), ("W", 1.0, "J/s", "G M k K m", "watt watts"), ("PS", 735.49875, "W", "", ""),
    ("hp", 745.6998715822702, "W", "", "HP"), ("A", 1.0, "A", "k m u", "ampere"), ("V", 1.0, "W/A", "k m u", "volt"),
)  # fmt: skip
TWO_MEANINGS = {
    "mil": "2 pi/6400 rad or a thousandth of an inch: say mrad or thou",
    "grad": "a degree or 1/400 of a turn: say deg or gon",
    "ton": "1000 kg, 2240 lb or 2000 lb: say t or lb",
}
MINUTE = ("1/min", "/min", "min-1", "min^-1", "min\u207b\u00b9")
EVERYDAY = {"m/s2": {"g": "gn", "G": "gn"}, "rad/s": dict.fromkeys(MINUTE, "rpm")}  # by the quantity asked for
SIGNS = str.maketrans(  # micro, degree, products, minus, powers
    "\u00b5\u03bc\u00ba*.\u00b7\u22c5\u2212\u207b\u00b9\u00b2\u00b3\u2074", "uu\N{DEGREE SIGN}    --1234"
)
BASES = ("kg", "m", "s", "A", "K", "rad")


class Unit(NamedTuple):
    """Value in SI units = factor * value + offset."""

    factor: float
    exponents: tuple[int, ...]  # of BASES
    offset: float = 0.0

    def times(self, other: Unit, power: int) -> Unit:
        """Product with a power of another unit."""
        exponents = (a + power * b for a, b in zip(self.exponents, other.exponents, strict=True))
        size = prod([other.factor] * abs(power))  # products: powers of C depend on the processor
        return Unit(self.factor * size if power > 0 else self.factor / size, tuple(exponents))


ONE = Unit(1.0, (0,) * len(BASES))
NAMES = {name: Unit(1.0, tuple(int(name == base) for base in BASES)) for name in BASES}  # all spellings


def conversion(given: str, unit: str) -> tuple[float, float]:
    """Factor and offset that convert a value in ``given``, if it is not empty, to ``unit``.

    Raises ValueError with the reason. A radian may be left out of N m/rad and rad/m, not of rad and rad/s.
    """
    if given in ("", unit):
        return 1.0, 0.0
    asked = read(unit)
    meant = next((names for key, names in EVERYDAY.items() if read(key).exponents == asked.exponents), {})
    found = read(meant.get(given.replace(" ", ""), given))
    (*others, angle), (*asked_others, asked_angle) = found.exponents, asked.exponents
    if others != asked_others or (angle != asked_angle and (angle or not any(others[:2]))):
        lacks = "; an angle needs deg, rad or rev" * (others == asked_others and not angle)
        raise ValueError(f"'{given:.40}' does not convert to {unit}{lacks}")
    return found.factor / asked.factor, (found.offset - asked.offset) / asked.factor


@cache
def read(text: str) -> Unit:
    """Read a unit; raises ValueError with the reason."""
    plain = " ".join(re.sub(r"\*\*|\^", "", text).translate(SIGNS).split())
    if plain in NAMES:
        return NAMES[plain]
    found, power = ONE, 1
    for part in re.sub(r"/ ?\(([^()/]*)\)", lambda inner: f"/{'/'.join(inner[1].split())}", plain).split("/"):
        words = re.split(r" |-(?=[^\W\d])", part.strip())
        if power < 0 and len(words) > 1:
            raise ValueError(f"'{text:.40}' has a product behind '/': put it in brackets")
        for word in words if words != ["1"] else ():
            name = re.sub(r"(?<=.)-?[1-9]$", "", word)
            found = found.times(_named(name), power * int(word[len(name) :] or 1))
        power = -1
    return found


def _named(name: str) -> Unit:
    if name in NAMES:
        return NAMES[name]
    if (meanings := TWO_MEANINGS.get(name.lower().rstrip("s"))) is not None:
        raise ValueError(f"'{name}' is {meanings}")
    spelt = {each.lower(): f"'{each}'" for each in NAMES if each[0] != "K"}
    near = " or ".join(spelt[each] for each in get_close_matches(name.lower(), spelt, 3))
    raise ValueError(f"'{name:.40}' is no known unit{f': did you mean {near}?' if near else ''}")


for _name, _size, _of, _prefixes, _others in TABLE:
    for _prefix in ("", *_prefixes.split()):
        NAMES[_prefix + _name] = Unit(_size * PREFIXES.get(_prefix, 1.0), ONE.exponents).times(read(_of), 1)
    NAMES |= dict.fromkeys(_others.split(), NAMES[_name])
NAMES |= {"-": ONE} | dict.fromkeys(("degC", "\N{DEGREE SIGN}C"), NAMES["K"]._replace(offset=273.15))
