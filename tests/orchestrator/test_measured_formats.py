"""Measured records in Parquet, MDF 4, TDMS and logs: the figures of CSV, units and clocks of the files, refusals."""

import importlib
import io
import re
import tracemalloc

import numpy as np
import pytest
from made_logs import made
from mutated import Content

import orchestrator as package
from fmus.vehicles.tables import BadInput
from orchestrator.files import budget
from orchestrator.log import extra, measured_formats
from orchestrator.log.export import export
from orchestrator.log.extra import NotInstalled
from orchestrator.log.notices import LogNotice
from orchestrator.results.measured_record import read

STEP = 1e-3
T = STEP * np.arange(2001)
SPEED = 3.0 + np.sin(2.0 * np.pi * T) + 0.3 * np.sin(9.0 * T)
FORCE = 2e4 + 5e3 * np.cos(7.0 * T)
T_TEST = 5.0 * STEP * np.arange(301)  # of the test, which ends earlier
V_TEST = 3.6 * (np.interp(T_TEST, T, SPEED) + 0.1 * np.sin(20.0 * T_TEST))  # km/h
LIBRARIES = {"csv": "csv", "parquet": "pyarrow", "mf4": "asammdf", "tdms": "nptdms", "mcap": "mcap"}
BINARY = [name for name in LIBRARIES if name != "csv"]
UNITS = {"chassis.speed": "m/s", "chassis.force": "N"}
SPEED_V = {"chassis.speed": "v"}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    topics = {"/chassis/out": [("speed", "m/s"), ("force", "N")]}
    path = tmp_path_factory.mktemp("formats") / "a.mcap"
    made(path, topics, {"/chassis/out": (T, np.stack([SPEED, FORCE], axis=1))}, None, ("chassis",))
    return package.Run(path)


def write_csv(path, t, v, unit):
    rows = "".join(f"{a!r},{'' if b != b else repr(b)}\n" for a, b in zip(t.tolist(), v.tolist(), strict=True))
    path.write_text(f"t [s],v [{unit}]\n{rows}")


def write_parquet(path, t, v, unit):
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    nulls = arrow.array(v, mask=np.isnan(v))  # as other programs write gaps
    parquet.write_table(arrow.table({"t [s]": t, f"v [{unit}]": nulls}), path)


def signal(name, t, v, unit, **more):
    invalid = {"invalidation_bits": np.isnan(v)} if v.dtype.kind == "f" and np.isnan(v).any() else {}
    samples = np.nan_to_num(v) if v.dtype.kind == "f" else v
    return pytest.importorskip("asammdf").Signal(samples, t, name=name, unit=unit, **invalid, **more)


def write_mf4(path, groups):
    """Write groups, a name and signals each."""
    with pytest.importorskip("asammdf").MDF(version="4.10") as file:
        for name, signals in groups:
            file.append(signals, acq_name=name)
        file.save(path, overwrite=True)


def write_tdms(path, segments, mode="w"):
    """Write segments, each of channels: group, name, values, properties."""
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path, mode=mode) as file:
        for channels in segments:
            file.write_segment([nptdms.ChannelObject(*channel) for channel in channels])


def waveform(t, unit="km/h", **more):
    return {"wf_increment": float(t[1] - t[0]), "wf_start_offset": float(t[0]), "unit_string": unit} | more


def write(path, t, v, unit="km/h"):
    """Write one signal ``v`` over ``t`` by the library of the format."""
    kind = path.suffix[1:]
    pytest.importorskip(LIBRARIES[kind])
    if kind == "mf4":
        write_mf4(path, [("test", [signal("v", t, v, unit)])])
    elif kind == "tdms":
        write_tdms(path, [[("test", "v", v, waveform(t, unit))]])
    elif kind == "mcap":
        made(path, {"/v/out": [("v", unit)]}, {"/v/out": (t, v[:, None])}, None, ("v",))
    else:
        {"csv": write_csv, "parquet": write_parquet}[kind](path, t, v, unit)
    return path


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
def test_a_wrong_dimension_and_a_missing_column_are_refused(tmp_path, kind):
    file = write(tmp_path / f"m.{kind}", T_TEST, V_TEST, "kN")
    with pytest.raises(BadInput, match=r"column '(v\.)?v' of chassis\.speed: 'kN' does not convert to m/s"):
        read(file, column(kind), UNITS.get)
    with pytest.raises(BadInput, match=rf"m\.{kind} has no column 'w': it has "):
        read(file, {"chassis.speed": "w"}, UNITS.get)
    if kind != "parquet":
        with pytest.raises(BadInput, match="its columns have times of their own, so that it takes no clock"):
            read(file, column(kind), UNITS.get, "t")


@pytest.mark.parametrize("kind", BINARY)
def test_a_damaged_file_is_one_sentence(run, cotrack, tmp_path, kind):
    file = write(tmp_path / f"m.{kind}", T_TEST, V_TEST)
    content = file.read_bytes()
    for damaged in (b"t,v\n0,1\n", content[:150], b"", content[:40] + bytes(len(content) - 40)):
        file.write_bytes(damaged)
        status, out, err = cotrack(
            "compare", run.log, file.name, "--map", f"chassis.speed={column(kind)['chassis.speed']}"
        )
        assert (status, out) == (2, ""), err
        lines = [line for line in err.splitlines() if "was cut off at" not in line]  # a notice on logs
        assert [line.startswith(f"cotrack: {file.name}") for line in lines] == [True], err


def test_a_record_of_tdms_that_was_cut_off_is_read_with_a_notice(run, cotrack, tmp_path):
    file = write(tmp_path / "m.tdms", T_TEST, V_TEST)
    file.write_bytes(file.read_bytes()[:-804])
    status, out, err = cotrack("compare", run.log, file.name, "--map", "chassis.speed=v")
    assert (status, err) == (0, "cotrack: m.tdms was cut off: its last segment is incomplete\n")
    assert out.splitlines()[-1].split()[-2] == "200"  # of 301
    with pytest.warns(LogNotice):
        (found,) = read(file, SPEED_V, UNITS.get)
    assert found.values * 3.6 == pytest.approx(V_TEST[:200], abs=1e-12)


def test_our_own_export_has_its_units_in_the_metadata(run, tmp_path):
    pytest.importorskip("pyarrow")
    (file,) = export(run.log, tmp_path / "own.parquet")
    found = run.compare_measured(file, {"chassis.speed": "chassis.speed", "chassis.force": "chassis.force"})
    assert [d.rms for d in found.differences] == [0.0, 0.0]
    assert found.notes == ()
    with pytest.raises(BadInput, match=r"column 'chassis.force' of chassis.speed: 'N' does not convert to m/s"):
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


def test_types_of_parquet(tmp_path):
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    ns = 1_700_000_000_000_000_000 + np.array([0, 1_000_001, 2_000_000])
    columns = {
        "time": arrow.array(ns, arrow.timestamp("ns", "UTC")), "a": arrow.array([1, None, 3], arrow.int16()),
        "a.b": arrow.array([7.0, 8.0, 9.0]), "s": ["x", "y", "z"], "late": arrow.array(ns[::-1], arrow.timestamp("ns")),
    }  # fmt: skip
    file = tmp_path / "m.parquet"
    parquet.write_table(arrow.table(columns), file)
    (found,) = read(file, {"chassis.speed": "a"}, UNITS.get)
    assert found.t == pytest.approx([0.0, 1.000001e-3, 2e-3], abs=1e-15)  # dates count from the first
    assert np.array_equal(found.values, [1.0, np.nan, 3.0], equal_nan=True)
    with pytest.raises(BadInput, match="column 's' holds no numbers, but string"):
        read(file, {"chassis.speed": "s"}, UNITS.get)
    with pytest.raises(BadInput, match=r"row 2: the clock 'late' must increase: -0\.000999999 s after 0 s"):
        read(file, {"chassis.speed": "a"}, UNITS.get, "late")


def test_durations_decimals_and_lists_of_parquet(tmp_path):
    """A duration counts from zero, a date from the first; a list is known by its type, and no value of it is read."""
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    ms = np.array([200, 300, 450])
    columns = {
        "t": arrow.array(ms, arrow.duration("ms")), "date": arrow.array(ms, arrow.timestamp("ms")),
        "v": arrow.array([25, -10, None]).cast(arrow.decimal128(21, 2)), "w": [[1.0], [2.0, 3.0], []],
    }  # fmt: skip
    file = tmp_path / "m.parquet"
    parquet.write_table(arrow.table(columns), file)
    (found,) = read(file, SPEED_V, UNITS.get)
    assert found.t.tolist() == [0.2, 0.3, 0.45]
    assert np.array_equal(found.values, [25.0, -10.0, np.nan], equal_nan=True)
    assert read(file, SPEED_V, UNITS.get, "date")[0].t == pytest.approx([0.0, 0.1, 0.25], abs=1e-15)
    with pytest.raises(BadInput, match=r"column 'w' holds no numbers, but list<element: double>"):
        read(file, {"chassis.speed": "w"}, UNITS.get)


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
    with pytest.raises(BadInput, match="has 2 columns 'n': name one as in the file, of 'fast/n', 'slow/n'"):
        read(tmp_path / "m.mf4", {"chassis.speed": "n"}, UNITS.get)


def test_raw_frames_of_a_bus_are_decoded_first(tmp_path):
    t = np.arange(3.0)
    write_mf4(tmp_path / "m.mf4", [("CAN1", [signal("CAN_DataFrame.ID", t, t, "")]), ("", [signal("x", t, t, "m/s")])])
    with pytest.raises(
        BadInput, match=r"no column 'v': it has .*; raw CAN frames are decoded first, .* with a DBC file"
    ):
        read(tmp_path / "m.mf4", SPEED_V, UNITS.get)
    assert len(read(tmp_path / "m.mf4", {"chassis.speed": "x"}, UNITS.get)) == 1
    write_mf4(tmp_path / "x.mf4", [("", [signal("x", t, t, "m/s")])])
    with pytest.raises(BadInput, match=r"no column 'v': it has [^;]*$"):
        read(tmp_path / "x.mf4", SPEED_V, UNITS.get)


def test_mdf_without_clock_numbers_or_version_4(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    t, v = np.arange(3.0), np.arange(3.0)
    text = signal("s", t, np.array([b"a", b"b", b"c"]), "", encoding="utf-8")
    write_mf4(tmp_path / "m.mf4", [("", [text]), ("", [signal("x", t, v, "m/s")])])
    with pytest.raises(BadInput, match=r"column '0/s' holds no numbers, but \|S1 of 1 dimensions"):
        read(tmp_path / "m.mf4", {"chassis.speed": "s"}, UNITS.get)
    assert len(read(tmp_path / "m.mf4", {"chassis.speed": "1/x"}, UNITS.get)[0].t) == 3
    over = asammdf.Signal(v, t, name="v", unit="m/s", master_metadata=("angle", 2))
    write_mf4(tmp_path / "a.mf4", [("bench", [over])])
    with pytest.raises(BadInput, match=r"a\.mf4: the group 'bench' of 'v' has no clock"):
        read(tmp_path / "a.mf4", SPEED_V, UNITS.get)
    with asammdf.MDF(version="3.30") as file:
        file.append([signal("v", t, v, "m/s")])
        file.save(tmp_path / "old.mdf", overwrite=True)
    with pytest.raises(BadInput, match=r"old\.mdf is MDF 3\.30: save it as MDF 4"):
        read(tmp_path / "old.mdf", SPEED_V, UNITS.get)


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
    with pytest.raises(BadInput, match="columns with times of their own and others do not share a clock"):
        read(file, {"chassis.speed": "v", "chassis.force": "w"}, UNITS.get)
    for name, sentence in (("x", "column 'x' has 8 samples, and its clock 9"), ("s", "column 'c/s' holds no numbers")):
        with pytest.raises(BadInput, match=sentence):
            read(file, {"chassis.speed": name}, UNITS.get)
    (tmp_path / "m.tdms_index").write_bytes(b"old")  # is not looked at
    assert len(read(file, SPEED_V, UNITS.get)) == 1


@pytest.mark.parametrize("key", measured_formats.TIMING)
def test_a_record_of_tdms_that_was_armed_again_is_refused(tmp_path, monkeypatch, key):
    file, t = tmp_path / "m.tdms", 0.01 * np.arange(50)
    about = waveform(t, "m/s", wf_start_time=np.datetime64("2026-11-28T10:00:00"))
    write_tdms(file, [[("g", "v", t, about)], [("g", "v", t, about)]])  # one record in two segments
    assert read(file, SPEED_V, UNITS.get)[0].t[-1] == pytest.approx(0.99)
    again = about | {key: about[key] + (np.timedelta64(5, "s") if key == "wf_start_time" else 0.5)}
    write_tdms(file, [[("g", "v", t, again)]], mode="a")
    with pytest.raises(BadInput, match=rf"'g/v' was armed again, {key} changes: save each record as a file of its own"):
        read(file, SPEED_V, UNITS.get)


def test_tdms_whose_segments_cannot_be_told_is_refused(tmp_path, monkeypatch):
    """A segment whose metadata are not as National Instruments describes them is not guessed."""
    t = 0.01 * np.arange(50)
    file = tmp_path / "m.tdms"
    write_tdms(file, [[("g", "v", t, waveform(t, "m/s"))]])
    monkeypatch.setattr(measured_formats, "_told", lambda _: {})
    with pytest.raises(BadInput, match="is not read, because wf_start_offset of its segments cannot be known"):
        read(file, SPEED_V, UNITS.get)
    monkeypatch.undo()
    begins = waveform(t, "m/s", wf_start_time=np.datetime64("2026-11-28T10:00:00"))
    write_tdms(file, [[("g", "v", t, waveform(t, "m/s")), ("g", "w", t, begins)]])
    with pytest.raises(BadInput, match="'g/v' has no wf_start_time, and other channels have one"):
        read(file, SPEED_V, UNITS.get)
    write_tdms(file, [[("g", "v", t, waveform(t, "m/s", wf_xunit_string="Hz"))]])
    with pytest.raises(BadInput, match="'g/v' is over Hz, not over time in s"):
        read(file, SPEED_V, UNITS.get)


def scaled(kind="Linear", slope=0.5, **more):
    return {
        "NI_Scaling_Status": "unscaled", "NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": kind,
        "NI_Scale[0]_Linear_Slope": slope, "NI_Scale[0]_Linear_Y_Intercept": 0.0, **more,
    }  # fmt: skip


def test_a_scale_of_tdms_is_one_and_known(tmp_path):
    file, t, counts = tmp_path / "m.tdms", 0.01 * np.arange(3), np.array([0, 10, 20], np.int16)
    about = waveform(t, "m/s")
    write_tdms(file, [[("g", "v", counts, about | scaled())], [("g", "v", counts, about | scaled())]])
    assert read(file, SPEED_V, UNITS.get)[0].values.tolist() == [0.0, 5.0, 10.0] * 2
    for again, key in ((scaled(slope=2.0), "NI_Scale[0]_Linear_Slope"), ({"unit_string": "km/h"}, "unit_string")):
        write_tdms(file, [[("g", "v", counts, about | scaled())], [("g", "v", counts, about | again)]])
        with pytest.raises(BadInput, match=re.escape(f"'g/v' was armed again, {key} changes")):
            read(file, SPEED_V, UNITS.get)
    for kind, status in (("Reciprocal", "unscaled"), ("Reciprocal", "scaled"), ("Add", "scaled")):
        write_tdms(file, [[("g", "v", counts, about | scaled(kind, NI_Scaling_Status=status))]])
        if status == "scaled":
            assert read(file, SPEED_V, UNITS.get)[0].values.tolist() == [0.0, 10.0, 20.0]
        else:
            with pytest.raises(BadInput, match="'g/v' has a scale of type 'Reciprocal', which is not known"):
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
    found = measured_formats._told(io.BytesIO(b"TDSm" + bytes(16) + len(text).to_bytes(8, "little") + text))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found.keys() == wanted
    assert peak < 5 * len(text)


@pytest.mark.parametrize("kind", ["parquet", "mf4", "tdms"])
def test_a_missing_library_is_one_sentence(run, cotrack, tmp_path, monkeypatch, kind):
    file = write(tmp_path / f"m.{kind}", T_TEST, V_TEST)

    def lacks(name):
        if name.partition(".")[0] == LIBRARIES[kind]:
            raise ImportError(name)
        return importlib.import_module(name)

    monkeypatch.setattr(extra, "import_module", lacks)
    sentence = f"{LIBRARIES[kind]} is not installed: pip install -c constraints.txt -e '.[measured]' in the clone"
    with pytest.raises(NotInstalled, match=re.escape(sentence)):
        read(file, SPEED_V, UNITS.get)
    status, out, err = cotrack("compare", run.log, file.name, "--map", "chassis.speed=v")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert sentence in err
    assert "needs --map SIGNAL=COLUMN" in cotrack("compare", run.log, file.name)[2]


@pytest.mark.parametrize("kind", ["parquet", "mf4", "tdms"])
def test_files_have_limits(tmp_path, monkeypatch, kind):
    file = write(tmp_path / f"m.{kind}", T_TEST, V_TEST)
    monkeypatch.setattr(measured_formats, "MEASURED_SAMPLES", 300)
    with pytest.raises(BadInput, match="cannot be read: a column has 301 samples, and 300 are allowed"):
        read(file, SPEED_V, UNITS.get)
    monkeypatch.setattr(measured_formats, "MEASURED_BINARY", 100)
    with pytest.raises(BadInput, match="cannot be read: it has more than 100 bytes"):
        read(file, SPEED_V, UNITS.get)
    assert budget.MEASURED_SAMPLES > budget.MEASURED_ROWS


@pytest.mark.parametrize(
    ("text", "sentence", "mended"),
    [
        (
            "t;v [km/h]\n0,0;3,6\n1,0;7,2\n",
            "line 2: 't' must be a number or empty, not '0,0'; decimals have a point: 0.0;3.6",
            "t [s];v [km/h]\n0.0;3.6\n1.0;7.2\n",
        ),
        (
            "t,v [km/h]\n0,0,3,6\n1,0,7,2\n",
            "line 2: there are 4 cells, and 2 columns; decimals have a point: 0.0,3.6",
            "t [s],v [km/h]\n0.0,3.6,\n1.0,7.2,\n",  # an empty cell at the end is none
        ),
        (
            "t,v [km/h]\n0,3,6\n1,7,2\n",
            "line 2: there are 3 cells, and 2 columns; decimals have a point, and a cell that holds a comma quotes",
            '"t, s","v, km/h"\n0,3.6\n1,7.2\n',
        ),
        (
            "Logger 7, of the bench\nrate;100\n\nt [s];v [km/h]\n0;3.6\n1;7.2\n",
            "has no column 'v': it has Logger 7, of the bench; line 4 names all that is asked for: delete the"
            " lines above it",
            "t [s];v [km/h]\n0;3.6\n1;7.2\n",
        ),
        (
            "t,v,n\n[s],[km/h],1/min\n0,3.6,0\n1,7.2,0\n",
            "line 2: 't' must be a number or empty, not '[s]'; units belong into the first line, without a line of"
            " their own: t [s],v [km/h],n [1/min]",
            "t [s],v [km/h],n [1/min]\n0,3.6,0\n1,7.2,0\n",
        ),
        (
            "t,v [km/h]\n2026-11-28T00:00:00.000Z,3.6\n2026-11-28T00:00:01Z,7.2\n",
            "line 2: 't' must be a number or empty, not '2026-11-28T00:00:00.000Z'; a clock counts seconds, for"
            " example of the day: 0,3.6",
            "t [s],v [km/h]\n0,3.6\n1,7.2\n",
        ),
        ("t [s],v [km/h],\xb0\n0,3.6,1\n", "cannot be read: it is no text in UTF-8 (byte 0xb0 at 15): save", None),
    ],
)  # fmt: skip
def test_csv_files_of_loggers_are_refused_with_what_mends_them(tmp_path, text, sentence, mended):
    file = tmp_path / "m.csv"
    file.write_bytes(text.encode("latin-1"))
    with pytest.raises(BadInput, match=re.escape(sentence)):
        read(file, SPEED_V, UNITS.get)
    file.write_bytes(mended.encode() if mended else text.encode() + b"1,7.2,1\n")
    (found,) = read(file, SPEED_V, UNITS.get)
    assert (found.t.tolist(), found.values.tolist()) == ([0.0, 1.0], pytest.approx([1.0, 2.0]))


def test_a_text_far_below_is_no_line_of_units(tmp_path):
    (tmp_path / "m.csv").write_text("t,v\n0,1\n1,1\n2,1\nend\n")
    with pytest.raises(BadInput, match=r"m\.csv, line 5: 't' must be a number or empty, not 'end'$"):
        read(tmp_path / "m.csv", SPEED_V, UNITS.get)


def test_an_hour_of_a_german_date_counts_in_the_seconds_of_the_day(tmp_path):
    (tmp_path / "m.csv").write_text("t;v\n28.11.2026 10:01:02,5;1\n")
    with pytest.raises(BadInput, match=r"of the day: 36062\.5;1$"):
        read(tmp_path / "m.csv", SPEED_V, UNITS.get)


@pytest.mark.parametrize(("cell", "sentence"), [
    ("1_000", "'v' must be a number or empty, not '1_000'"),
    ("\u0661\u0662", "'v' must be a number or empty, not '\u0661\u0662'"),
    ('"1.5', "a quote does not end with its cell"),
    ('"1"5', "a quote does not end with its cell"),
])  # fmt: skip
def test_what_looks_like_a_number_is_none(tmp_path, cell, sentence):
    (tmp_path / "m.csv").write_text(f"t [s],v\n0,{cell}\n1,2\n")
    with pytest.raises(BadInput, match=rf"line 2: {sentence}"):
        read(tmp_path / "m.csv", SPEED_V, UNITS.get)
    (tmp_path / "m.csv").write_text('t [s],v\n0," 1.5 "\n1, 1e3\n')
    assert read(tmp_path / "m.csv", SPEED_V, UNITS.get)[0].values.tolist() == [1.5, 1e3]


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
    with pytest.raises(BadInput, match="the clock 't' counts whole numbers, of s or ms: clock = COLUMN:s or COLUMN:ms"):
        read(file, SPEED_V, UNITS.get)
    assert read(file, SPEED_V, UNITS.get, "t:ms")[0].t.tolist() == [0.0, 0.01, 0.02]
    for head, t, right in (("t [s]", [0, 10], [0, 10]), ("t [ms]", [0, 10], [0.0, 0.01]), ("t", [0, 0.5], [0, 0.5])):
        save(head, t)
        assert read(file, SPEED_V, UNITS.get)[0].t.tolist() == right
