"""Measured records in Parquet, MDF 4, TDMS and logs: the figures of CSV, units and clocks of the files, refusals."""

import io
import tracemalloc

import numpy as np
import pytest
from logged import logged
from made_logs import made
from measured_files import (
    FORCE,
    LIBRARIES,
    SPEED,
    STEP,
    UNITS,
    T,
    measured_run,
    scaled,
    signal,
    waveform,
    write,
    write_mf4,
    write_tdms,
)
from mutated import Content

from fmus.vehicles.tables import BadInput
from orchestrator.log import measured_formats
from orchestrator.log.export import export
from orchestrator.results.measured_record import read

T_TEST = 5.0 * STEP * np.arange(301)  # of the test, which ends earlier
V_TEST = 3.6 * (np.interp(T_TEST, T, SPEED) + 0.1 * np.sin(20.0 * T_TEST))  # km/h
BINARY = [name for name in LIBRARIES if name != "csv"]
SPEED_V = {"chassis.speed": "v"}
run = pytest.fixture(scope="module")(measured_run)


def column(kind):
    return {"chassis.speed": "v.v" if kind == "mcap" else "v"}


def figures(comparison):
    return [x for d in comparison.differences for x in d if isinstance(x, int | float)]


@pytest.mark.parametrize("kind", BINARY)
def test_each_format_gives_the_figures_of_csv(run, tmp_path, kind):
    from_csv = run.compare_measured(write(tmp_path / "m.csv", T_TEST, V_TEST), SPEED_V)
    assert (from_csv.differences[0].instants, from_csv.notes) == (301, ())
    found = run.compare_measured(write(tmp_path / f"m.{kind}", T_TEST, V_TEST), column(kind))
    assert figures(found) == pytest.approx(figures(from_csv), abs=1e-12, rel=0.0)
    assert found.notes == ()
    wrong = run.compare_measured(write(tmp_path / f"w.{kind}", T_TEST, V_TEST, "m/s"), column(kind))  # the twin
    assert wrong.differences[0].rms > 50.0 * from_csv.differences[0].rms
    late = run.compare_measured(write(tmp_path / f"l.{kind}", T_TEST + 0.01, V_TEST), column(kind))
    assert figures(late) != pytest.approx(figures(from_csv), abs=1e-3, rel=0.0)


@pytest.mark.parametrize("kind", BINARY)
def test_gaps_marks_and_a_shift_are_those_of_csv(run, tmp_path, kind):
    v = V_TEST.copy()
    v[[7, 100, 101]] = np.nan
    v[50] = -9999.0
    t = T_TEST + 0.123
    from_csv = run.compare_measured(write(tmp_path / "m.csv", t, v), SPEED_V, shift="find")
    found = run.compare_measured(write(tmp_path / f"m.{kind}", t, v), column(kind), shift="find")
    assert figures(found) == pytest.approx(figures(from_csv), abs=1e-8)
    assert (found.differences[0].left_out, found.shift) == (4, pytest.approx(from_csv.shift, abs=1e-9))
    assert [note.split(":")[1] for note in found.notes] == [" 1 samples are -9999, a mark of no data, and left out"]


@pytest.mark.parametrize("kind", BINARY)
def test_a_wrong_dimension_a_missing_column_and_a_clock_for_columns_with_one_are_refused(tmp_path, kind):
    file = write(tmp_path / f"m.{kind}", T_TEST, V_TEST, "kN")
    for columns, clock in ((column(kind), None), ({"chassis.speed": "w"}, None), (column(kind), "t")):
        with pytest.raises(BadInput):
            read(file, columns, UNITS.get, clock)


@pytest.mark.long
@pytest.mark.parametrize("kind", BINARY)
def test_a_damaged_file_is_one_sentence(run, cotrack, tmp_path, kind):
    file = write(tmp_path / f"m.{kind}", T_TEST, V_TEST)
    content = file.read_bytes()
    for damaged in (b"t,v\n0,1\n", content[:150], b"", content[:40] + bytes(len(content) - 40)):
        file.write_bytes(damaged)
        mapped = f"chassis.speed={column(kind)['chassis.speed']}"
        status, out, err = cotrack("compare", run.log, file.name, "--map", mapped)
        assert (status, out) == (2, ""), err
        lines = [line for line in err.splitlines() if "was cut off at" not in line]  # a notice on logs
        assert [line.startswith(f"cotrack: {file.name}") for line in lines] == [True], err


def test_a_record_of_tdms_that_was_cut_off_is_read_with_a_notice(run, cotrack, tmp_path):
    file = write(tmp_path / "m.tdms", T_TEST, V_TEST)
    file.write_bytes(file.read_bytes()[:-804])
    status, out, err = cotrack("compare", run.log, file.name, "--map", "chassis.speed=v")
    assert (status, err) == (0, "cotrack: m.tdms was cut off: its last segment is incomplete\n")
    assert out.splitlines()[-1].split()[-2] == "200"  # of 301
    with logged("."):
        (found,) = read(file, SPEED_V, UNITS.get)
    assert found.values * 3.6 == pytest.approx(V_TEST[:200], abs=1e-12)


def test_our_own_export_has_its_units_in_the_metadata(run, tmp_path):
    pytest.importorskip("pyarrow")
    (file,) = export(run.log, tmp_path / "own.parquet")
    found = run.compare_measured(file, {"chassis.speed": "chassis.speed", "chassis.force": "chassis.force"})
    assert [d.rms for d in found.differences] == [0.0, 0.0]
    assert found.notes == ()
    with pytest.raises(BadInput):
        run.compare_measured(file, {"chassis.speed": "chassis.force"})


def test_a_log_of_another_run_serves_as_measurement(run, cotrack, tmp_path):
    topics = {"/a/out": [("u", "km/h")], "/b/out": [("F", "kN")]}
    rows = {"/a/out": (T[::2], 3.6 * SPEED[::2, None]), "/b/out": (T[::5], 1.01 * FORCE[::5, None] / 1e3)}
    made(tmp_path / "b.mcap", topics, rows, None, ("a", "b"))
    found = run.compare_measured(tmp_path / "b.mcap", {"chassis.speed": "a.u", "chassis.force": "b.F"})
    assert [d.instants for d in found.differences] == [1001, 401]  # each on its own times
    assert found.differences[0].rms == pytest.approx(0.0, abs=1e-12)
    assert found.differences[1].relative == pytest.approx(0.01 / 1.01, abs=1e-12)
    out = cotrack.done("compare", run.log, "b.mcap", "--map", "chassis.speed=a.u")
    assert "run minus b.mcap, 0 s added to its times" in out


def test_a_log_that_was_changed_is_told(run, cotrack, tmp_path):
    file = write(tmp_path / "m.mcap", T_TEST, V_TEST)
    content = Content(Content(file).write(file))
    command = "compare", run.log, "m.mcap", "--map", "chassis.speed=v.v"
    content.write(file)
    assert "sealed" not in cotrack(*command)[2]
    content.metadata["run"] = {"scene": "another"}
    content.write(file, old_seal=True)
    status, _, err = cotrack(*command)
    assert (status, err.count("\n")) == (0, 1)
    assert "m.mcap is not as it was sealed" in err


@pytest.mark.parametrize(("clock", "expected"), [
    (None, [0.0, 1.000001e-3, 2e-3]),  # dates count from the first
    ("span", [0.2, 0.3, 0.45]), ("date", [0.0, 0.1, 0.25]),  # a duration counts from zero
])  # fmt: skip
def test_types_of_parquet(tmp_path, clock, expected):
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    ns, ms = 1_700_000_000_000_000_000 + np.array([0, 1_000_001, 2_000_000]), np.array([200, 300, 450])
    columns = {
        "time": arrow.array(ns, arrow.timestamp("ns", "UTC")), "a": arrow.array([1, None, 3], arrow.int16()),
        "a.b": arrow.array([7.0, 8.0, 9.0]), "span": arrow.array(ms, arrow.duration("ms")),
        "date": arrow.array(ms, arrow.timestamp("ms")), "v": arrow.array([25, -10, None]).cast(arrow.decimal128(21, 2)),
    }  # fmt: skip
    parquet.write_table(arrow.table(columns), tmp_path / "m.parquet")
    a, v = read(tmp_path / "m.parquet", {"chassis.speed": "a", "chassis.force": "v"}, UNITS.get, clock)
    assert a.t == pytest.approx(expected, abs=1e-15)
    assert np.array_equal(a.values, [1.0, np.nan, 3.0], equal_nan=True)
    assert np.array_equal(v.values, [25.0, -10.0, np.nan], equal_nan=True)


@pytest.mark.parametrize("form", ["u1", "i4", "f8"])
def test_ranges_of_mdf_hold_their_borders(tmp_path, form):
    """The upper border belongs to a range of integers, and not to one of floats."""
    conversion = pytest.importorskip("asammdf.blocks.conversion_utils").from_dict(
        {"lower_0": 0, "upper_0": 9, "phys_0": 1.0, "lower_1": 10, "upper_1": 19, "phys_1": 2.0, "default": -1.0}
    )
    raw = np.array([0, 5, 9, 10, 15, 19, 40]).astype(form)
    v = signal("v", np.arange(7.0), raw, "m/s", conversion=conversion)
    write_mf4(tmp_path / "m.mf4", [("test", [v, signal("w", np.arange(7.0), raw, "m/s")])])
    found = read(tmp_path / "m.mf4", {"chassis.speed": "v", "a.b": "w"}, lambda name: "m/s")
    assert found[0].values.tolist() == ([1, 1, -1, 2, 2, -1, -1] if form == "f8" else [1, 1, 1, 2, 2, 2, -1])
    assert found[1].values.tolist() == raw.tolist()


@pytest.mark.parametrize(
    "formula", [{"formula": "X*X"}, dict.fromkeys(["P2", "P3", "P4", "P5"], 0.0) | {"P1": 1.0, "P6": 1.0}]
)
def test_formulas_of_mdf_square_integers(tmp_path, formula):
    """60001 squared is no number of 32 bits."""
    conversion = pytest.importorskip("asammdf.blocks.conversion_utils").from_dict(formula)
    v = signal("v", np.arange(2.0), np.array([3, 60001], "u2"), "m/s", conversion=conversion)
    write_mf4(tmp_path / "m.mf4", [("test", [v])])
    assert read(tmp_path / "m.mf4", SPEED_V, UNITS.get)[0].values.tolist() == [9.0, 60001.0**2]


def test_groups_of_mdf_have_their_own_clocks(run, tmp_path):
    """One group begins 0.3 s into the file, one with other steps at 1.2 s: neither begins at zero, none is filled."""
    fast, slow = T[T >= 0.3], T[T >= 1.2][::7]
    force = np.interp(slow, T, FORCE) / 1e3
    noise = (0.0 * fast).astype("i2")
    groups = [
        ("fast", [signal("v", fast, 3.6 * SPEED[T >= 0.3], "km/h"), signal("n", fast, noise, "rpm")]),
        ("slow", [signal("F", slow, force, "kN"), signal("n", slow, force, "rpm")]),
    ]
    write_mf4(tmp_path / "m.mf4", groups)
    columns = {"chassis.speed": "v", "chassis.force": "slow/F"}
    found = run.compare_measured(tmp_path / "m.mf4", columns)
    assert [d.rms for d in found.differences] == pytest.approx([0.0, 0.0], abs=1e-10)
    assert [d.start for d in found.differences] == pytest.approx([0.3, 1.2], abs=1e-9)
    assert [d.instants for d in found.differences] == [len(fast), len(slow)]
    zero = run.compare_measured(tmp_path / "m.mf4", columns, shift=-0.3)  # the twin: as from its own zero
    assert zero.differences[0].rms > 0.1
    moved = run.compare_measured(tmp_path / "m.mf4", columns, shift="find")  # both clocks count from the same instant
    assert moved.shift == pytest.approx(0.0, abs=1e-8)
    alone = run.compare_measured(tmp_path / "m.mf4", {"chassis.force": "F"}, shift="find")
    assert alone.shift == pytest.approx(0.0, abs=1e-6)


def test_channels_of_tdms_begin_when_they_began(tmp_path):
    """Channels whose starts differ lie so beside each other; a channel without times takes a clock of the file."""
    date = np.datetime64("2026-11-28T10:00:00.25")
    t = 0.01 * np.arange(50)
    channels = [
        ("a", "v", t, waveform(t, "m/s", wf_start_time=date)),
        ("b", "F", t, waveform(t, "N", wf_start_time=date + np.timedelta64(1250, "ms"))),
        ("c", "time", t[:9] + 3.0, {"unit_string": "s"}), ("c", "w", t[:9], {}), ("c", "x", t[:8], {}),
        ("c", "date", date + (1000 * np.arange(9)).astype("m8[us]"), {}), ("c", "s", ["p", "q"], {}),
        ("c", "second", date + np.arange(9).astype("m8[s]"), {}),
    ]  # fmt: skip
    file = tmp_path / "m.tdms"
    write_tdms(file, [channels])
    v, force = read(file, {"chassis.speed": "v", "chassis.force": "b/F"}, UNITS.get)
    assert (v.t[0], force.t[0], force.t[-1]) == pytest.approx((0.0, 1.25, 1.74), abs=1e-9)
    (w,) = read(file, {"chassis.speed": "w"}, UNITS.get)
    assert (w.t[0], w.assumed) == (3.0, True)
    (w,) = read(file, {"chassis.speed": "w"}, UNITS.get, "date")
    assert w.t == pytest.approx(1e-3 * np.arange(9), abs=1e-12)
    assert read(file, {"chassis.speed": "w"}, UNITS.get, "second")[0].t == pytest.approx(np.arange(9.0), abs=1e-12)
    (tmp_path / "m.tdms_index").write_bytes(b"old")  # is not looked at
    assert len(read(file, SPEED_V, UNITS.get)) == 1


def test_scales_and_segments_of_tdms(tmp_path):
    """One record in two segments, and counts with a scale; those that are scaled already are read as they are."""
    file, t, counts = tmp_path / "m.tdms", 0.01 * np.arange(3), np.array([0, 10, 20], np.int16)
    about = waveform(t, "m/s", wf_start_time=np.datetime64("2026-11-28T10:00:00"))
    write_tdms(file, [[("g", "v", counts, about | scaled())], [("g", "v", counts, about | scaled())]])
    (found,) = read(file, SPEED_V, UNITS.get)
    assert found.values.tolist() == [0.0, 5.0, 10.0] * 2
    assert found.t == pytest.approx(0.01 * np.arange(6))
    for kind in ("Reciprocal", "Add"):
        write_tdms(file, [[("g", "v", counts, about | scaled(kind, NI_Scaling_Status="scaled"))]])
        assert read(file, SPEED_V, UNITS.get)[0].values.tolist() == [0.0, 10.0, 20.0]
    write_tdms(file, [[("g", "v", counts, about | scaled())], [("g", "v", counts, about | scaled(slope=2.0))]])
    with pytest.raises(BadInput, match="NI_Scale"):
        read(file, SPEED_V, UNITS.get)


def test_paths_of_tdms_without_an_end_need_no_more_memory_than_they_have(tmp_path):
    """A path without an end is none: a channel's own properties are found behind it."""
    t = 0.01 * np.arange(3)
    write_tdms(tmp_path / "m.tdms", [[("g", "v", t, waveform(t, "m/s"))]])
    content = (tmp_path / "m.tdms").read_bytes()
    described = content[28 : 28 + int.from_bytes(content[20:28], "little")]
    wanted = {("/'g'/'v'", "wf_increment"), ("/'g'/'v'", "wf_start_offset"), ("/'g'/'v'", "unit_string")}
    tracemalloc.start()
    text = b"/'" + b"a" * (1 << 22) + described
    head = b"TDSm" + bytes(16) + len(text).to_bytes(8, "little")
    found = measured_formats.segment_properties(io.BytesIO(head + text))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found.keys() == wanted
    assert peak < 5 * len(text)


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_clock_of_whole_numbers_says_of_what(tmp_path, kind):
    """Steps of 1 may be of s or ms, and both look alike; one step of half a second tells."""
    file = tmp_path / f"m.{kind}"

    def save(head, t):
        if kind == "csv":
            file.write_text("\n".join([f"{head},v", *(f"{each},1" for each in t)]))
        else:
            arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
            parquet.write_table(arrow.table({head: t, "v": [1.0] * len(t)}), file)

    save("t", [0, 10, 20])
    with pytest.raises(BadInput):
        read(file, SPEED_V, UNITS.get)
    assert read(file, SPEED_V, UNITS.get, "t:ms")[0].t.tolist() == [0.0, 0.01, 0.02]
    for head, t, right in (("t [s]", [0, 10], [0, 10]), ("t [ms]", [0, 10], [0.0, 0.01]), ("t", [0, 0.5], [0, 0.5])):
        save(head, t)
        assert read(file, SPEED_V, UNITS.get)[0].t.tolist() == right
