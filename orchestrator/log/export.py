"""Export of recorded values: block by block to CSV, Parquet or MATLAB, a file per topic or one; as tables.

Tables are those of pandas, pyarrow, polars and xarray (libraries of the extra ``analysis``).
"""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from fmus.cache.files import replacing
from orchestrator.files.columns import safe_cell
from orchestrator.log.extra import library
from orchestrator.log.log_file import LogFailed, error_text
from orchestrator.log.reader import Log, Missing
from orchestrator.log.schema import family
from orchestrator.log.signal_names import Names
from orchestrator.log.time_series import ALL_TIME, Floats, Series

BLOCK = 4000  # rows in memory at once
GROUP = 64 << 20  # bytes of a row group of a Parquet file before compression


class Columns(NamedTuple):
    """Names and units of the columns after the first one, which is the time in s."""

    names: tuple[str, ...]  # instance.variable
    units: tuple[str, ...]


class Writer(Protocol):
    """File of one table, written block by block; methods raise OSError."""

    def rows(self, table: Floats) -> None:
        """Append rows (m, 1 + columns)."""

    def close(self) -> None:
        """Finish and close the file."""


class Csv:
    """CSV file; numbers read back as the same double, only the payload of a NaN is lost."""

    def __init__(self, file: Path, columns: Columns) -> None:
        self._stream = file.open("w", newline="", encoding="utf-8")
        self._writer = csv.writer(self._stream, lineterminator="\n")
        titles = [f"{name} [{unit}]" for name, unit in zip(*columns, strict=True)]
        self._writer.writerow(["t [s]", *map(safe_cell, titles)])

    def rows(self, table: Floats) -> None:
        """Append rows (m, 1 + columns) as text."""
        self._writer.writerows(table.tolist())

    def close(self) -> None:
        """Close the file."""
        self._stream.close()


class Parquet:
    """Parquet file with the exact bits and the units in the metadata of the columns.

    Byte streams are split, which compresses better. Memory: one row group, and for each group 2 kB per column that
    pyarrow keeps until the file is closed.
    """

    def __init__(self, file: Path, columns: Columns) -> None:
        arrow = library("pyarrow")
        names, units = ("t", *columns.names), ("s", *columns.units)
        fields = [
            arrow.field(name, arrow.float64(), metadata={"unit": unit}) for name, unit in zip(names, units, strict=True)
        ]
        self._schema, self._table = arrow.schema(fields), arrow.table
        self._columns = np.empty((len(names), max(GROUP // (8 * len(names)), 1)))
        self._filled = 0  # rows
        self._writer = library("pyarrow.parquet").ParquetWriter(
            file,
            self._schema,
            compression="zstd",
            use_dictionary=False,
            use_byte_stream_split=True,
            write_statistics=["t"],  # lets readers skip row groups; for all columns they take a third of the time
        )

    def rows(self, table: Floats) -> None:
        """Collect rows (m, 1 + columns) and write each full row group."""
        while len(table):
            part, begin = table[: self._columns.shape[1] - self._filled], self._filled
            self._filled += len(part)
            self._columns[:, begin : self._filled] = part.T
            if self._filled == self._columns.shape[1]:
                self._write()
            table = table[len(part) :]

    def _write(self) -> None:
        columns = [column[: self._filled] for column in self._columns]
        self._writer.write_table(self._table(columns, schema=self._schema), row_group_size=self._filled)
        self._filled = 0

    def close(self) -> None:
        """Write the last rows and the footer, close the file."""
        with self._writer:
            if self._filled:
                self._write()


class Matlab:
    """MATLAB file (version 5) with ``t``, ``values`` (m, n), ``names``, ``units``; all rows in memory."""

    def __init__(self, file: Path, columns: Columns) -> None:
        self._file, self._columns = file, columns
        self._tables: list[Floats] = [np.empty((0, 1 + len(columns.names)))]

    def rows(self, table: Floats) -> None:
        """Keep a copy of rows (m, 1 + columns)."""
        self._tables.append(table.copy())

    def close(self) -> None:
        """Write the whole file."""
        from scipy.io import savemat

        whole = np.concatenate(self._tables)
        texts = {key: np.array(getattr(self._columns, key), dtype=object)[:, None] for key in ("names", "units")}
        savemat(self._file, {"t": whole[:, :1], "values": whole[:, 1:], **texts}, appendmat=False, do_compression=True)


WRITERS: dict[str, Any] = {"csv": Csv, "parquet": Parquet, "mat": Matlab}


def export(
    path: str | os.PathLike[str],
    out: str | os.PathLike[str],
    signals: str | Sequence[str] = (),
    topics: Sequence[str] = (),
    window: tuple[float, float] = ALL_TIME,
    kind: str | None = None,
) -> list[Path]:
    """Write recorded values of a closed time interval ``window``, s, and return the files.

    ``signals`` and ``topics`` select, with ``*`` for any text; without either everything is written. ``out`` is one
    file (``.csv``, ``.parquet`` or ``.mat``; its signals must have the same times) or a folder, which gets one file per
    topic (``left_track.out.csv``) of this ``kind``, csv by default.

    :raises Missing: if the log lacks a signal, or signals of one file have different times.
    :raises LogUnreadable: if the log, or a part of it, cannot be read.
    :raises LogFailed: if a file cannot be written; no incomplete file remains.
    :raises NotInstalled: if the library of the format is missing.
    """
    target = Path(out)
    suffix = target.suffix.lower().removeprefix(".")
    with Log(path) as log:
        log.notice_seal()
        log.require_window(*window)
        chosen = log.choose(signals, topics)
        if not chosen:
            raise Missing(f"{path} holds nothing to export")
        if suffix in WRITERS:
            names = tuple(name for topic in chosen for name in _columns(log, topic, chosen[topic]).names)
            units = tuple(unit for topic in chosen for unit in _columns(log, topic, chosen[topic]).units)
            with open_table(target, suffix, Columns(names, units)) as writer:
                for block in side_by_side(log, chosen, window):
                    writer.rows(block)
            return [target]
        file_kind = kind or "csv"
        files = _files(target, list(chosen), file_kind)
        with ExitStack() as stack:
            writers = {
                topic: stack.enter_context(open_table(file, file_kind, _columns(log, topic, chosen[topic])))
                for topic, file in zip(chosen, files, strict=True)
            }
            for piece in log.stream(chosen, window):
                for topic, series in piece.items():
                    writers[topic].rows(timed_rows(series))
    return files


def side_by_side(log: Log, chosen: dict[str, list[int]], window: tuple[float, float]) -> Iterator[Floats]:
    """Yield tables (m, 1 + columns) of topics with equal times; raises Missing if they differ."""
    first, *others = chosen
    for block in log.blocks(chosen, BLOCK, window=window):
        for topic in others:
            if not np.array_equal(block[topic].t, block[first].t):
                raise Missing(
                    f"{first} and {topic} were recorded at different times: ask for signals of one of them; an export"
                    " into a folder writes a table for each"
                )
        yield np.concatenate([block[first].t[:, None], *(block[topic].values for topic in chosen)], axis=1)


def timed_rows(series: Series) -> Floats:
    """Return time and values of a series as one table (m, 1 + columns)."""
    return np.concatenate([series.t[:, None], series.values], axis=1)


@contextmanager
def open_table(file: Path, kind: str, columns: Columns) -> Iterator[Writer]:
    """Write to a temporary file and rename it when it is complete; raises LogFailed, NotInstalled."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        is_device = file.exists() and not file.is_file()  # a device is written directly
        with nullcontext(file) if is_device else replacing(file) as fresh:
            writer = WRITERS[kind](fresh, columns)
            try:
                yield writer
            finally:
                writer.close()
    except OSError as error:
        raise LogFailed(f"{file} cannot be written: {error_text(error)}") from None


def _columns(log: Log, topic: str, columns: Sequence[int]) -> Columns:
    about = log.topics[topic]
    return Columns(tuple(log.name(topic, k) for k in columns), tuple(about.units[k] for k in columns))


def file_name(name: str) -> str:
    """Return a name from a log as a safe part of a file name, at most 100 characters long."""
    return re.sub(r"[^\w.()\[\]-]", "_", name.strip("/").replace("/", ".")).strip(".")[:100] or "_"


def _files(folder: Path, topics: Sequence[str], suffix: str) -> list[Path]:
    """Return one path per topic in a folder, distinct also where letter case is ignored."""
    names: set[str] = set()
    files = []
    for topic in topics:
        name, number = file_name(topic), 1
        while (candidate := name if number == 1 else f"{name}-{number}").lower() in names:
            number += 1
        names.add(candidate.lower())
        files.append(folder / f"{candidate}.{suffix}")
    return files


Named = dict[str, tuple[str, Floats]]  # signal -> unit and values (m,)


def columns_of(log: Log, signals: Sequence[Names], window: tuple[float, float] = ALL_TIME) -> tuple[Floats, Named]:
    """Return times (m,), s, and the signals; raises Missing if signals have different times."""
    log.require_window(*window)
    chosen = log.choose(signals)
    whole = np.concatenate([*side_by_side(log, chosen, window)])
    places = [(topic, column) for topic, columns in chosen.items() for column in columns]
    return whole[:, 0], {
        log.name(topic, column): (log.topics[topic].units[column], np.ascontiguousarray(whole[:, k]))
        for k, (topic, column) in enumerate(places, 1)
    }


def to_pandas(log: Log, *signals: Names, window: tuple[float, float] = ALL_TIME) -> Any:
    """Return signals as a DataFrame indexed by ``t``, s, with units in ``attrs["units"]``.

    ``*`` in ``signals`` stands for any text; ``window``: closed time interval, s. Raises Missing, also for signals
    with different times, LogUnreadable, NotInstalled.
    """
    pandas = library("pandas")
    t, columns = columns_of(log, signals, window)
    frame = pandas.DataFrame({name: values for name, (_, values) in columns.items()}, index=pandas.Index(t, name="t"))
    frame.attrs["units"] = {name: unit for name, (unit, _) in columns.items()}
    return frame


def to_arrow(log: Log, *signals: Names, window: tuple[float, float] = ALL_TIME) -> Any:
    """Return a table of ``t`` and the signals, units in the metadata; raises like ``to_pandas``."""
    arrow = library("pyarrow")
    t, columns = columns_of(log, signals, window)
    fields = [
        arrow.field(name, arrow.float64(), metadata={"unit": unit})
        for name, unit in (("t", "s"), *((name, unit) for name, (unit, _) in columns.items()))
    ]
    return arrow.table([t, *(values for _, values in columns.values())], schema=arrow.schema(fields))


def to_polars(log: Log, *signals: Names, window: tuple[float, float] = ALL_TIME) -> Any:
    """Return a DataFrame with columns ``t`` and the signals; raises like ``to_pandas``."""
    t, columns = columns_of(log, signals, window)
    return library("polars").DataFrame({"t": t} | {name: values for name, (_, values) in columns.items()})


def to_xarray(log: Log, *signals: Names, window: tuple[float, float] = ALL_TIME) -> Any:
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
