"""Recorded values as pandas, pyarrow, polars or xarray tables (libraries of the extra ``analysis``)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from orchestrator.log.export import side_by_side
from orchestrator.log.extra import library
from orchestrator.log.reader import Log
from orchestrator.log.schema import family
from orchestrator.log.time_series import EVER, Floats

Named = dict[str, tuple[str, Floats]]  # signal -> unit and values (m,)


def columns_of(log: Log, signals: Sequence[str], window: tuple[float, float] = EVER) -> tuple[Floats, Named]:
    """Return times (m,), s, and the signals; raises NoSuchSignal if signals have different times."""
    chosen = log.choose(signals)
    whole = np.concatenate([*side_by_side(log, chosen, window)])
    places = [(topic, column) for topic, columns in chosen.items() for column in columns]
    return whole[:, 0], {
        log.name(topic, column): (log.topics[topic].units[column], np.ascontiguousarray(whole[:, k]))
        for k, (topic, column) in enumerate(places, 1)
    }


def to_pandas(log: Log, *signals: str, window: tuple[float, float] = EVER) -> Any:
    """Return signals as a DataFrame indexed by ``t``, s, with units in ``attrs["units"]``.

    ``*`` in ``signals`` stands for any text; ``window``: closed time interval, s. Raises NoSuchSignal, also for signals
    with different times, LogUnreadable, NotInstalled.
    """
    pandas = library("pandas")
    t, columns = columns_of(log, signals, window)
    frame = pandas.DataFrame({name: values for name, (_, values) in columns.items()}, index=pandas.Index(t, name="t"))
    frame.attrs["units"] = {name: unit for name, (unit, _) in columns.items()}
    return frame


def to_arrow(log: Log, *signals: str, window: tuple[float, float] = EVER) -> Any:
    """Return a table of ``t`` and the signals, units in the metadata; raises like ``to_pandas``."""
    arrow = library("pyarrow")
    t, columns = columns_of(log, signals, window)
    fields = [
        arrow.field(name, arrow.float64(), metadata={"unit": unit})
        for name, unit in (("t", "s"), *((name, unit) for name, (unit, _) in columns.items()))
    ]
    return arrow.table([t, *(values for _, values in columns.values())], schema=arrow.schema(fields))


def to_polars(log: Log, *signals: str, window: tuple[float, float] = EVER) -> Any:
    """Return a DataFrame with columns ``t`` and the signals; raises like ``to_pandas``."""
    t, columns = columns_of(log, signals, window)
    return library("polars").DataFrame({"t": t} | {name: values for name, (_, values) in columns.items()})


def to_xarray(log: Log, *signals: str, window: tuple[float, float] = EVER) -> Any:
    """Return a Dataset over ``t``, families of signals as 2-D arrays; raises like ``to_pandas``.

    ``left_track.link[3].tension`` is ``left_track.link.tension`` at ``link`` = 3.
    """
    xarray = library("xarray")
    t, columns = columns_of(log, signals, window)
    families: dict[str, dict[int, str]] = {}
    for name in columns:
        key, index = family(name)
        families.setdefault(key.replace("[*]", ""), {})[index or 0] = name
    arrays = {}
    for key, members in families.items():
        unit = {"units": columns[next(iter(members.values()))][0]}
        if 0 in members:
            arrays[key] = xarray.DataArray(columns[members[0]][1], {"t": t}, ["t"], attrs=unit)
            continue
        dimension = next(iter(members.values())).partition("[")[0].rpartition(".")[2]
        values = np.stack([columns[name][1] for name in members.values()], axis=1)
        arrays[key] = xarray.DataArray(values, {"t": t, dimension: [*members]}, ["t", dimension], attrs=unit)
    return xarray.Dataset(arrays)
