"""The study of the mechanics, row by row, and twins: links that are stiffer by 3 % miss the tolerances."""

from itertools import pairwise
from math import log2

import pytest

from fmus.physics.ancf import beam
from tests.validation import element_cases, mechanics, meshes

# kernels, or seconds
OWN = "general", "engineering", "rotating", "sliding", "chain", "released", "swings", "drift", "beam"
MINUTES = "released steel", "drift"  # physics/test_chain_benchmarks has both by the kernels of tracks
CASES = {case.name: case for case in mechanics.cases(False)}
TIP = {1: 0.30172077, 5: 0.71379152, 10: 0.81060902}  # published w/L of the elastica at P L^2/EI


def marked(name):
    minutes, own = (any(word in name for word in words) for words in (MINUTES, OWN))
    return pytest.param(name, marks=[pytest.mark.study] if minutes else [pytest.mark.long] if own else [])


@pytest.mark.parametrize("name", [marked(name) for name in CASES])
def test_every_row_keeps_its_tolerance(name):
    rows = CASES[name].function(*CASES[name].arguments)
    assert rows
    assert not [(row.case, row.figures) for row in rows if row.ok is False]


def stiffer(kind, c, e, member=meshes.Member):
    """A member of links with 1.03 times the stiffness."""
    return member(kind, c._replace(E=1.03 * c.E) if kind is beam else c._replace(EA=1.03 * c.EA, EI=1.03 * c.EI), e)


ELASTIC = ("elastica", "frequencies", "rotating", "L-frame")


@pytest.mark.parametrize(
    "name", [marked(name) for name in CASES if name.startswith(ELASTIC) and name != "elastica without a cure"]
)
def test_links_that_are_stiffer_are_noticed(name, monkeypatch):
    monkeypatch.setattr(meshes, "Member", stiffer)
    rows = CASES[name].function(*CASES[name].arguments)
    assert not [(row.case, row.figures) for row in rows if row.ok]


def test_a_loop_of_stiffer_links_has_the_joint_force_but_not_the_hoop_strain(monkeypatch):
    monkeypatch.setattr(meshes, "Member", stiffer)
    case = CASES["spinning loop"]
    assert [row.ok for row in case.function(*case.arguments)] == [True, True, False, False]


def test_the_elastica_is_the_published_one():
    for alpha, w in TIP.items():
        assert meshes.elastica(alpha) == pytest.approx(w, abs=5e-9)


@pytest.mark.parametrize(("slender", "low", "high"), [(1000, 3.8, 4.4), (50, 3.8, 4.5)])
def test_the_cable_converges_with_order_4(slender, low, high):
    """Against the exact elastica, while errors stay above the cable's own stretch, and among three meshes."""
    ns, alpha = (4, 8, 16), 10 if slender == 1000 else 5
    w = [meshes.deflection(element_cases.cable, n, alpha, slender) for n in ns]
    exact = [value - TIP[alpha] for value in w]
    errors = exact if slender == 1000 else [w[0] - w[1], w[1] - w[2]]
    rates = [log2(abs(a / b)) for a, b in pairwise(errors)]
    assert low < min(rates) <= max(rates) < high
