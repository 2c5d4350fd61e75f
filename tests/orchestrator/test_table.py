"""The one table: text, Markdown, CSV and records of the same rows; units; extremes of links."""

import csv
import io
import math

import numpy as np
import pytest

from orchestrator.results.analyses.record_blocks import Extreme, larger, smaller
from orchestrator.results.table import Column, Table
from orchestrator.results.units import scaled, size

ROWS = [("a | b", 1.23456789, 3), ("c", math.nan, 123456)]


def test_an_analysis_gives_columns_by_name_and_unit():
    table = Table.of("title", (("what", ""), ("force", "kN"), ("count", "")), ROWS, ("a note",))
    assert str(table).splitlines() == [
        "title", "what   force, kN   count", "a | b     1.2346       3", "c              -  123456", "a note"
    ]  # fmt: skip
    assert table.markdown("#").splitlines() == [
        "# title", "", "| what | force, kN | count |", "| --- | --- | --- |", "| a \\| b | 1.2346 | 3 |",
        "| c |  | 123456 |", "", "a note",
    ]  # fmt: skip
    read = list(csv.DictReader(io.StringIO(table.csv())))
    assert (float(read[0]["force, kN"]), read[1]["force, kN"]) == (1.23456789, "")
    assert table.records()[0] == {"what": "a | b", "force": 1.23456789, "count": 3}


def test_rounding_of_a_run_is_shown_as_zero():
    """In the text alone, by the unit; a share of 1e-15 may be a finding."""
    columns = (("force", "kN"), ("turning", "rad/s"), ("damage", ""))
    table = Table.of("title", columns, [(-5.4e-13, 4e-16, 8e-14), (-5.4e-9, 4e-12, 8e-14)])
    assert str(table).splitlines()[2:] == [
        "        0               0   8e-14", " -5.4e-09           4e-12   8e-14"
    ]  # fmt: skip
    assert table.csv().splitlines()[1] == "-5.4e-13,4e-16,8e-14"


def test_a_study_gives_columns_by_key_and_format():
    columns = (Column("cost", "cost, s", ".2f"), Column("count", "count", ",d"), Column("ok", "ok"))
    table = Table.of_records("", columns, [{"cost": 1.0, "count": 1000, "ok": False, "more": 1}, {"ok": True}])
    assert table.markdown().splitlines()[2:] == ["| 1.00 | 1,000 | NOT |", "|  |  | ok |"]
    assert table.csv().splitlines() == ['"cost, s",count,ok', "1.0,1000,NOT", ",,ok"]


@pytest.mark.parametrize(("value", "unit", "factor", "shown"), [
    (-27777.0, "N", 1e3, "kN"), (999.0, "N.m", 1.0, "N m"), (3e9, "Pa", 1e9, "GPa"), (3e9, "m/s", 1.0, "m/s"),
    (math.inf, "N", 1.0, "N"),
])  # fmt: skip
def test_large_values_get_a_prefix(value, unit, factor, shown):
    assert scaled(value, unit) == (factor, shown)


def test_units_have_a_size():
    sizes = {"kN": 1e3, "kN m": 1e3, "MPa": 1e6, "mm/s": 1e-3, "%": 1e-2, "m": 1.0, "m/s": 1.0, "rad": 1.0}
    assert {unit: size(unit) for unit in sizes} == sizes


def test_of_equal_extremes_the_first_counts():
    t = np.array([0.1, 0.2])
    values = np.array([[1.0, 5.0], [5.0 * (1 + 1e-12), np.nan]])
    first = larger(None, t, values)
    assert first == Extreme(5.0, 0.1, 2)
    assert larger(first, t, values) is first
    assert larger(first, t + 1.0, 1.001 * values) == Extreme(pytest.approx(5.005), 1.1, 2)
    assert larger(None, t, np.full((2, 2), np.inf)) is None
    assert smaller(None, t, values) == Extreme(1.0, 0.1, 1)
    assert smaller(Extreme(0.5, 0.0, 7), t, values) == Extreme(0.5, 0.0, 7)
