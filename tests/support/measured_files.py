"""A run of given signals, and files of measured signals in each format."""

import numpy as np
import pytest
from made_logs import made

import orchestrator as package

STEP = 1e-3
T = STEP * np.arange(2001)
SPEED = 3.0 + np.sin(2.0 * np.pi * T) + 0.3 * np.sin(9.0 * T)
FORCE = 2e4 + 5e3 * np.cos(7.0 * T)
UNITS = {"chassis.speed": "m/s", "chassis.force": "N", "chassis.slip": "1"}


def measured_run(tmp_path_factory):
    """A run of 2 s with a speed, a force and a constant slip."""
    topics = {"/chassis/out": [("speed", "m/s"), ("force", "N"), ("slip", "1")]}
    values = np.stack([SPEED, FORCE, np.full(len(T), 0.25)], axis=1)
    path = made(
        tmp_path_factory.mktemp("measured") / "a.mcap", topics, {"/chassis/out": (T, values)}, None, ("chassis",)
    )
    return package.Run(path)


LIBRARIES = {"csv": "csv", "parquet": "pyarrow", "mf4": "asammdf", "tdms": "nptdms", "mcap": "mcap"}


def write_csv(path, t, v, unit):
    """Write a CSV file; gaps are empty cells."""
    rows = "".join(f"{a!r},{'' if b != b else repr(b)}\n" for a, b in zip(t.tolist(), v.tolist(), strict=True))
    path.write_text(f"t [s],v [{unit}]\n{rows}")


def write_parquet(path, t, v, unit):
    """Write a Parquet file; gaps are nulls."""
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    nulls = arrow.array(v, mask=np.isnan(v))  # as other programs write gaps
    parquet.write_table(arrow.table({"t [s]": t, f"v [{unit}]": nulls}), path)


def signal(name, t, v, unit, **more):
    """A signal of MDF 4; gaps are marked invalid."""
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
    """Properties of a channel of TDMS that has times."""
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


def over_angle():
    """A signal over an angle."""
    return signal("v", np.arange(3.0), np.arange(3.0), "m/s", master_metadata=("angle", 2))


def scaled(kind="Linear", slope=0.5, **more):
    """Properties of a channel of TDMS whose counts have a scale."""
    return {
        "NI_Scaling_Status": "unscaled", "NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": kind,
        "NI_Scale[0]_Linear_Slope": slope, "NI_Scale[0]_Linear_Y_Intercept": 0.0, **more,
    }  # fmt: skip
