"""Costs in the study of the paper: ratios, timed evaluations, the cheapest run, counts."""

import math

import pytest

from orchestrator.studies import Row
from tests.validation.made_up import cost
from tests.validation.paper import modulus, page, pieces, ratios, through_fmus
from tests.validation.paper.models import CLOSED, RIGID, RIGID_SPRING


def test_ratios_over_tolerance_interval_and_inside_fmus():
    results = [
        cost(CLOSED, 11000, cpu=0.4, least=0.3, most=0.5, counted=11100.0, each=2e-5, error=1e-8),
        cost(RIGID, 75, cpu=0.01, least=0.008, most=0.02, counted=90.0, each=4e-5, error=1e-5),
        cost(CLOSED, 11000, setting=1e-6),
        cost(RIGID, 300, setting=1e-6),
        cost(RIGID, 0, setting=1e-7),  # a tolerance that it could not keep
        cost(CLOSED, 11000, setting=1e-7),
        cost(CLOSED, 11000, interval=0.02, item="interval"),
        cost(RIGID_SPRING, 550, interval=0.02, item="interval", floor=2),
        Row("fmus", "", {"model": CLOSED.name, "tolerance": 1e-6, "evaluations": 1.2e6}, True),
        Row("fmus", "", {"model": RIGID.name, "tolerance": 1e-6, "evaluations": 5e4}, True),
        Row("fmus", "", {"model": RIGID.name, "tolerance": 1e-4, "evaluations": 5e4}, True),
    ]
    first, second, over_interval, inside = ratios.rows(results)
    assert first["evaluations"] == 11000 / 75
    assert first["counted"] == pytest.approx(11100 / 90)
    assert first["cpu"] == pytest.approx(40.0)
    assert (first["least"], first["most"]) == pytest.approx((0.3 / 0.02, 0.5 / 0.008)), "fastest over slowest"
    assert first["each"] == pytest.approx(0.5)
    assert second["evaluations"] == 11000 / 300
    assert second["tolerance"] == 1e-6
    assert over_interval["evaluations"] == 20.0
    assert (over_interval["interval"], over_interval["floor"]) == (0.02, 2)
    assert inside["evaluations"] == 24.0
    assert [row.figures["over"] for row in (first, second, over_interval, inside)] == [
        ratios.TOLERANCE, ratios.TOLERANCE, ratios.INTERVAL, ratios.FMUS
    ]  # fmt: skip
    assert len(page.table("ratio", results).rows) == 4


def test_evaluations_are_timed_in_turn(monkeypatch):
    timed = []

    class Drive:
        def __init__(self, wanted, piece):
            self.track = wanted.track.model

        def vehicle(self, method, setting):
            return self.track

        def evaluation_time(self, vehicle):
            timed.append(vehicle)
            return {"flexible": 1.0, "rigid": 2.0 if len(timed) > 2 else 4.0}[vehicle]  # the first run is slow

    monkeypatch.setattr(pieces, "Drive", Drive)
    adams, runge_kutta = pieces.in_turn(RIGID_SPRING.name, 0.02)
    assert timed == ["flexible", "rigid"] * 2 * pieces.TURNS
    assert (adams["method"], adams["least"], adams["each"], adams["most"]) == (pieces.ADAMS, 0.25, 0.5, 0.5)
    assert (runge_kutta["rigid"], runge_kutta["least"]) == (RIGID_SPRING.name, 0.5)


def test_projections_count_as_evaluations():
    run = pieces.Cost(pieces.ADAMS, 1e-3, 0.0095, 75, 1e-5, 3.0, steps=36, projections=36)
    assert pieces.figures(run)["counted"] == 111
    assert pieces.figures(run._replace(projections=0))["counted"] == 75, "joints that are eliminated"


def test_crossing_on_lines_of_logarithms():
    points = [(1e8, 1.0), (1e10, 100.0)]
    assert modulus.crossing(points, 10.0) == pytest.approx(1e9)
    assert modulus.crossing(points, 0.5) == 0.0
    assert modulus.crossing(points, 500.0) == math.inf
    assert math.isnan(modulus.crossing([], 1.0))


def test_the_cheapest_run_within_the_error():
    costs = [
        pieces.Cost(pieces.ADAMS, 1e-3, 0.1, 10, 1e-2, 3.0),
        pieces.Cost(pieces.ADAMS, 1e-5, 0.3, 30, 5e-5, 3.0),
        pieces.Cost(pieces.ADAMS, 1e-7, 0.5, 50, 1e-7, 3.0),
        pieces.Cost(pieces.RUNGE_KUTTA, 1.0, 0.2, 20, 1e-9, 4.0),
    ]
    assert pieces.cheapest(costs, pieces.ADAMS).setting == 1e-5
    assert pieces.cheapest(costs[:1], pieces.ADAMS) is None


@pytest.mark.study
def test_fmus_begin_anew_at_each_communication_step():
    coarse, fine = through_fmus.rows(RIGID.name, 0.0125)
    assert [row["tolerance"] for row in (coarse, fine)] == [*through_fmus.TOLERANCES]
    for row in (coarse, fine):
        assert row.ok
        assert row["restarts"] == pytest.approx(2 * 800)
        assert row["evaluations"] > 2.0 * row["steps"] > 2.0 * row["restarts"]
    assert fine["evaluations"] > 1.2 * coarse["evaluations"]


@pytest.mark.study
def test_counts_of_a_piece():
    """Evaluations, not times: what the ratios are made of. Counted on 2026-11-23."""
    runs = {}
    for model in (RIGID, CLOSED):
        for row in pieces.rows(model.name, pieces.QUICK, (), pieces.INTERVALS):
            runs[row.item, model.name, row["method"], row["setting"], row["interval"]] = row
    assert all(row["least"] <= row["cpu"] <= row["most"] for row in runs.values())

    def adams(model, tolerance=pieces.AT, interval=pieces.OUTPUT, item="piece"):
        return runs[item, model.name, pieces.ADAMS, tolerance, interval]

    assert adams(RIGID)["evaluations"] == pytest.approx(75, abs=4)
    assert adams(RIGID)["projections"] == adams(RIGID)["steps"] == pytest.approx(36, abs=2)
    assert adams(RIGID, 1e-6)["evaluations"] == pytest.approx(294, rel=0.05)
    assert adams(CLOSED)["evaluations"] == pytest.approx(10801, rel=0.03)
    assert adams(CLOSED, 1e-6)["evaluations"] == pytest.approx(10901, rel=0.03), "bound by stability"
    assert adams(CLOSED)["projections"] == 0
    floors = [adams(RIGID, interval=part * pieces.OUTPUT, item="interval") for part in pieces.INTERVALS]
    assert [row["floor"] for row in floors] == [128, 32, 8, 2]
    assert [row["evaluations"] for row in floors] == pytest.approx([129, 75, 65, 72], abs=4)
    assert floors[0]["evaluations"] < 1.05 * floors[0]["floor"], "outputs every 0.3 ms take the steps"
    assert floors[1]["evaluations"] > 2.0 * floors[1]["floor"], "those every 1.25 ms do not"
