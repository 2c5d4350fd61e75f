"""Units by name beside their definitions as exact fractions; words that are no units; spellings of quantities."""

import random
import string
from fractions import Fraction
from math import pi

import pytest

from fmus.interface.ports import TYPES, UNITS
from fmus.interface.units import NAMES, PREFIXES, conversion, read
from fmus.vehicles.tables import to_si

# Definitions of the SI brochure and of NIST SP 811: number, power of pi, quantity.
INCH, POUND, GRAVITY = Fraction("0.0254"), Fraction("0.45359237"), Fraction("9.80665")
QUANTITIES = {  # exponents of kg, m, s, A, K, rad
    "ratio": (0, 0, 0, 0, 0, 0), "mass": (1, 0, 0, 0, 0, 0), "length": (0, 1, 0, 0, 0, 0), "volume": (0, 3, 0, 0, 0, 0),
    "time": (0, 0, 1, 0, 0, 0), "frequency": (0, 0, -1, 0, 0, 0), "angle": (0, 0, 0, 0, 0, 1),
    "rotation": (0, 0, -1, 0, 0, 1), "speed": (0, 1, -1, 0, 0, 0), "acceleration": (0, 1, -2, 0, 0, 0),
    "force": (1, 1, -2, 0, 0, 0), "impulse": (1, 1, -1, 0, 0, 0), "energy": (1, 2, -2, 0, 0, 0),
    "action": (1, 2, -1, 0, 0, 0), "inertia": (1, 2, 0, 0, 0, 0), "pressure": (1, -1, -2, 0, 0, 0),
    "power": (1, 2, -3, 0, 0, 0), "current": (0, 0, 0, 1, 0, 0), "voltage": (1, 2, -3, -1, 0, 0),
    "temperature": (0, 0, 0, 0, 1, 0),
}  # fmt: skip
DEFINED = {
    "% percent": (Fraction(1, 100), 0, "ratio"), "g gram grams": (Fraction(1, 1000), 0, "mass"), "kg": (1, 0, "mass"),
    "t tonne tonnes": (1000, 0, "mass"), "lb lbs pound pounds": (POUND, 0, "mass"), "kgm2": (1, 0, "inertia"),
    "m metre metres meter meters": (1, 0, "length"), "in inch inches": (INCH, 0, "length"),
    "thou": (INCH / 1000, 0, "length"), "ft foot feet": (12 * INCH, 0, "length"),
    "mi mile miles": (63360 * INCH, 0, "length"), "l L litre litres liter liters": (Fraction(1, 1000), 0, "volume"),
    "s sec secs second seconds": (1, 0, "time"), "min mins minute minutes": (60, 0, "time"),
    "h hr hrs hour hours": (3600, 0, "time"), "d day days": (86400, 0, "time"), "Hz hertz": (1, 0, "frequency"),
    "msec": (Fraction(1, 1000), 0, "time"),
    "rad RAD radian radians": (1, 0, "angle"), "gon": (Fraction(1, 200), 1, "angle"),
    "deg \N{DEGREE SIGN} DEG Deg degree degrees": (Fraction(1, 180), 1, "angle"), "rev turn turns": (2, 1, "angle"),
    "rps r/s": (2, 1, "rotation"), "rpm RPM Rpm r/min U/min": (Fraction(2, 60), 1, "rotation"),
    "dps": (Fraction(1, 180), 1, "rotation"), "kmh kph kmph KPH KMH": (Fraction(1000, 3600), 0, "speed"),
    "mph MPH": (63360 * INCH / 3600, 0, "speed"), "kn kt kts knot knots": (Fraction(1852, 3600), 0, "speed"),
    "gn": (GRAVITY, 0, "acceleration"), "N newton newtons": (1, 0, "force"), "kgf kp": (GRAVITY, 0, "force"),
    "lbf": (POUND * GRAVITY, 0, "force"), "Nm": (1, 0, "energy"), "Nms": (1, 0, "action"), "Ns": (1, 0, "impulse"),
    "Pa pascal": (1, 0, "pressure"), "bar Bar BAR": (100000, 0, "pressure"),
    "psi PSI": (POUND * GRAVITY / INCH**2, 0, "pressure"), "J joule joules": (1, 0, "energy"),
    "Wh": (3600, 0, "energy"),
    "W watt watts": (1, 0, "power"), "PS": (75 * GRAVITY, 0, "power"),
    "hp HP": (550 * 12 * INCH * POUND * GRAVITY, 0, "power"), "A ampere": (1, 0, "current"),
    "V volt": (1, 0, "voltage"), "K degC \N{DEGREE SIGN}C": (1, 0, "temperature"),
}  # fmt: skip
PLAIN = {name: about for names, about in DEFINED.items() for name in names.split()}
PLAIN |= {"-": (1, 0, "ratio"), "US survey foot": (Fraction(1200, 3937), 0, "length")}
POWERS = {"G": 9, "M": 6, "k": 3, "K": 3, "da": 1, "d": -1, "c": -2, "m": -3, "u": -6, "n": -9}  # of ten, by prefix


def test_every_spelling_has_its_value():
    for name, unit in NAMES.items():
        prefix = "" if name in PLAIN else next(one for one in ("da", *POWERS) if name.startswith(one))
        number, power, quantity = PLAIN[name.removeprefix(prefix)]
        exact = number * Fraction(10) ** POWERS.get(prefix, 0) * Fraction(pi) ** power
        assert abs(Fraction(unit.factor) / exact - 1) < Fraction(4, 10**16), name
        assert unit.exponents == QUANTITIES[quantity], name
    assert {*PLAIN} <= {*NAMES}
    assert {*PREFIXES} == {*POWERS}


def test_a_prefix_makes_no_unit_of_another_word():
    """Kilo-mph and giga-radian are no units; nor is any prefix before a name that does not have it."""
    made = {prefix + name for prefix in PREFIXES for name in PLAIN} - {*NAMES}
    assert "kmph" in NAMES
    assert {"Grad", "kkmh", "kmin", "Mm", "Ms", "Mrad", "krpm"} <= made
    for word in made:
        with pytest.raises(ValueError, match=r"no known unit|say deg or gon"):
            read(word)


def test_random_words_are_refused_in_a_sentence():
    draw = random.Random(7)
    signs = string.ascii_letters + string.digits + " /^*.-()\N{DEGREE SIGN}\u00b2_%"
    words = ["".join(draw.choices(string.ascii_letters, k=draw.randint(3, 7))) for _ in range(1500)]
    for word in {*words} - {*NAMES}:
        with pytest.raises(ValueError, match=r"no known unit|: say "):
            read(word)
    refused = 0
    for _ in range(1500):
        try:
            assert read("".join(draw.choices(signs, k=draw.randint(1, 30)))).factor > 0.0
        except ValueError:
            refused += 1
    assert refused > 1450


@pytest.mark.parametrize(
    ("given", "unit", "size"),
    [
        ("kmph", "m/s", 1 / 3.6), ("m/s2", "m/s^2", 1.0), ("mm/s\u00b2", "m/s^2", 1e-3), ("N/mm2", "Pa", 1e6),
        ("g", "m/s^2", 9.80665), ("g", "kg", 1e-3), ("RPM", "rad/s", pi / 30), ("1/min", "rad/s", pi / 30),
        ("min\u207b\u00b9", "rad/s", pi / 30), ("1/min", "1/s", 1 / 60), ("KN", "N", 1e3),
        ("\N{DEGREE SIGN}/s", "rad/s", pi / 180), ("kNm", "N.m", 1e3), ("N.m/deg", "N m/rad", 180 / pi),
        ("kN m", "N m/rad", 1e3), ("1/km", "rad/m", 1e-3), ("kN/(mm s)", "N/(m s)", 1e6), ("m**2*s/m^2", "s", 1.0),
        ("\u00b5m", "m", 1e-6), ("N-m", "J", 1.0), ("%", "1", 1e-2), ("m", "km", 1e-3),
    ],
)  # fmt: skip
def test_everyday_spellings(given, unit, size):
    assert to_si(unit)(f"3 {given}") == pytest.approx(3.0 * size, rel=1e-15)


def test_degrees_celsius_have_an_offset_alone():
    assert conversion("degC", "K") == (1.0, 273.15)
    assert conversion("K", "\N{DEGREE SIGN}C") == (1.0, -273.15)
    assert conversion("degC/s", "K/s") == (1.0, 0.0)


def test_base_units_of_ports_follow_from_their_names():
    assert UNITS["N.m.s/rad"] == {"kg": 1, "m": 2, "s": -1, "rad": -1}
    assert UNITS["1"] == {}
    assert all(read(name).factor == 1.0 for name in UNITS)
    for unit, shown, factor in TYPES.values():
        assert conversion(unit, shown or unit)[0] == pytest.approx(factor, rel=1e-15)
