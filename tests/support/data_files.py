"""Files of numbers that a scene reads, in Parquet and TDMS, and the ground in settings of scenes."""

from __future__ import annotations

import pytest

from orchestrator.scene.height_files import read_heights


def write_parquet(path, columns):
    """Write columns (name, unit, values)."""
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    parquet.write_table(arrow.table({f"{name} [{unit}]": values for name, unit, values in columns}), path)


def write_tdms(path, channels):
    """Write channels (name, unit, values, start, step)."""
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as file:
        found = [
            nptdms.ChannelObject("g", name, values, {"unit_string": unit, "wf_increment": h, "wf_start_offset": start})
            for name, unit, values, start, h in channels
        ]
        file.write_segment(found or [nptdms.RootObject({})])


STEP = "ground.step={x=[3, 4], rise='20 cm'}"
ROUGH = "ground.rough={iso_class='D', start=1}"
WAVES = "ground.washboard={amplitude=0.05, wavelength=1.5, start=1, phase='90 deg'}"
MAP = "ground.heightmap={heights=[[0, 0.1], [0, 0.1], [0.2, 0]], corner=[1, -2], spacing=[1, 4], start=1}"


def read_file(path, **keys):
    """Table of a height map of cells of 1 m that names this file."""
    table = {"ground": {"heightmap": {"heights": path.name, "corner": [0, 0], "spacing": [1, 1], **keys}}}
    read_heights(table, path.parent, "mine.toml")
    return table["ground"]["heightmap"]
