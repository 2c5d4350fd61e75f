"""The one table: text, Markdown, CSV and records of the same rows; units; extremes of links; the picture of a sweep."""

import csv
import io
import math

import numpy as np
import pytest
from designs import shown

from orchestrator.results.analyses.record_blocks import Extreme, larger, smaller
from orchestrator.results.table import Column, Table
from orchestrator.results.units import scaled, size
from orchestrator.studies import sweep_picture
from orchestrator.studies.variations import Design

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


def picture(vary, sample=None):
    """Picture of the figure 10 a + b of a design over a, b and perhaps words, and its points."""
    design = Design.of(vary, sample)
    rows = [(*point, 10.0 * point[0] + point[1]) for point in shown(design)]
    rows[-1] = (*rows[-1][:-1], None)  # a case that failed
    columns = [Column(one.key, one.head) for one in design.variations]
    return sweep_picture.draw(design, Table("", (*columns, Column("y", "y, N")), rows), "Sweep"), rows


def test_curves_and_a_map_of_a_grid():
    figure, _ = picture(["a=1:3:3", "b=5,4"])
    over_a, over_b, cells = figure.axes[:3]
    np.testing.assert_array_equal(over_a.lines[1].get_xydata(), [[1.0, 14.0], [2.0, 24.0], [3.0, np.nan]])
    assert [line.get_label() for line in over_a.lines] == ["b = 5", "b = 4"]
    assert [*over_b.lines[0].get_xydata().ravel()] == [4.0, 14.0, 5.0, 15.0]
    mesh = cells.collections[0]
    np.testing.assert_array_equal(np.ma.filled(mesh.get_array(), np.nan), [[14.0, 24.0, np.nan], [15.0, 25.0, 35.0]])
    assert (over_a.get_xlabel(), over_a.get_ylabel(), cells.get_title()) == ("a", "y, N", "y, N")
    colours = [{line.get_color() for line in pane.lines} for pane in (over_a, over_b)]
    assert [len(each) for each in colours] == [2, 3]
    assert not colours[0] & colours[1], "a colour has two meanings"


@pytest.mark.parametrize(("values", "edges"), [
    ([6.0, 20.0], [3.0, 13.0, 27.0]), ([1.0, 10.0, 100.0], [0.5, 5.5, 55.0, 145.0]), ([4.0, 5.0], [3.5, 4.5, 5.5]),
    ([-2.0, 4.0], [-5.0, 1.0, 7.0]), ([0.0, 1.0], [-0.5, 0.5, 1.5]), ([3.0], [1.5, 4.5]),
])  # fmt: skip
def test_tiles_of_a_map_end_between_its_values(values, edges):
    """Halfway to the neighbour, at the ends as far; positive values have no tile that reaches zero."""
    assert sweep_picture.tile_edges(values) == edges
    figure, _ = picture([f"a={','.join(map(str, values))}", "b=5,4"])
    if len(values) > 1:
        np.testing.assert_array_equal(figure.axes[2].collections[0].get_coordinates()[0, :, 0], edges)


def test_dots_and_a_map_of_a_sample_for_each_word():
    figure, rows = picture(["a=1:3", "b=4:5 m", "m=x,y"], 4)
    over_a, _, over_m, map_x, map_y = figure.axes[:5]
    assert [line.get_linestyle() for line in over_a.lines] == ["None", "None"]
    assert len(over_m.lines) == 1
    np.testing.assert_array_equal(map_x.collections[0].get_offsets(), [row[:2] for row in rows[:4]])
    np.testing.assert_array_equal(map_x.collections[0].get_array(), [row[3] for row in rows[:4]])
    assert (map_y.get_title(), map_y.get_ylabel()) == ("y, N, y", "b, m")
    assert map_x.collections[0].get_clim() == map_y.collections[0].get_clim(), "two maps, two scales"


def test_no_map_of_three_numbers_and_no_figure_of_failures_constants_and_numbers_of_pins():
    """Damages span decades; the number of the pin that breaks is no figure."""
    assert len(picture(["a=1,2", "b=1,2", "c=1,2"])[0].axes) == 3
    design = Design.of(["a=1,2"])

    def panes(columns, rows):
        figure = sweep_picture.draw(design, Table("", (Column("a", "a"), *columns), rows), "Sweep")
        return [pane for pane in figure.axes if pane.lines]

    assert panes((Column("status", "status"), Column("y", "y")), [(1.0, "failed", None)] * 2) == []
    columns = (
        Column("c", "c"),
        Column("life pin", "life pin"),
        Column("f", "f, N", unit="N"),
        Column("m", "m, m", unit="m"),
    )
    drawn = panes(columns, [(1.0, 3.0, 7.0, 5e4, 2e3), (2.0, 3.0, 8.0, 6e4, 3e3)])
    assert [pane.get_ylabel() for pane in drawn] == ["f, kN", "m, m"]
    np.testing.assert_allclose(drawn[0].lines[0].get_ydata(), [50.0, 60.0])


@pytest.mark.parametrize(("least", "scale", "norm"), [(1e-3, "log", "LogNorm"), (2e-2, "linear", "Normalize")])
def test_figures_over_decades_have_a_logarithmic_scale(least, scale, norm):
    design = Design.of(["a=1:2:2", "b=3,4 m"])
    rows = [(*point, y) for point, y in zip(shown(design), (1.0, 0.5, least, 0.2), strict=True)]
    columns = (*(Column(one.key, one.head) for one in design.variations), Column("y", "y"))
    over_a, over_b, cells = sweep_picture.draw(design, Table("", columns, rows), "Sweep").axes[:3]
    assert [over_a.get_yscale(), over_b.get_yscale(), type(cells.collections[0].norm).__name__] == [scale, scale, norm]
    assert [line.get_label() for line in over_a.lines] == ["b = 3 m", "b = 4 m"]
