"""Files of measured signals: chosen columns with names, units and samples as they stand in the file, by format.

CSV: the first line holds names with units, "v [km/h]", "v (km/h)" or "v, km/h"; a cell may be empty. Parquet: names as
in CSV, or the unit in the metadata of a column, as ``log export`` writes it; dates count in s from the first, durations
from zero. MCAP: the log of another run, or a bag (``bags``). What a library raises at a file is that it cannot be read.

MDF 4, by asammdf 8.8.28: ``to_dataframe`` fills the time before a group begins with its first value, and exports begin
each group at zero; it drops invalid samples, over which a line would be drawn; a group without a clock has times by
number. So each channel is read with its own master, whose times count from the start of the file, invalid samples are
gaps, and other masters than time are refused. Ranges of integers lack their upper borders, and squares of integers
overflow: formulas get doubles, and ranges are looked up here.

TDMS, by npTDMS 1.13.0: properties of the last segment count for all samples, so that a record that was armed again gets
the start, scale and unit of its last part; it is refused if they change, as is an unknown scale, which gives counts.
An index file beside a file is used even if it is older; a stream has none. Times count from the first start of all.
"""

from __future__ import annotations

import gc
import logging
import re
import sys
from array import array
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from io import BufferedReader, StringIO
from itertools import islice
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.files.budget import MEASURED, MEASURED_BINARY, MEASURED_ROWS, MEASURED_SAMPLES, OverBudget, open_file
from orchestrator.files.columns import csv_lines, head, number
from orchestrator.files.messages import LOG
from orchestrator.log.extra import NotInstalled, library
from orchestrator.log.time_series import Floats

EXTRA = "measured"
PREAMBLE = 200  # lines in which a header is looked for, to name it
MARKS = ";\t,"  # between cells: the first of these that the first line has
UNITS_UNTIL = 3  # last line that may be one of units
MAX_CHARACTERS = 100  # characters of a line in a message
TIMING = ("wf_start_time", "wf_start_offset", "wf_increment")  # properties of a TDMS channel
LEAD_IN, LONGEST = 28, 1 << 16  # bytes; of a path or a value
SIZES = {1: 1, 2: 2, 3: 4, 4: 8, 5: 1, 6: 2, 7: 4, 8: 8, 9: 4, 10: 8, 25: 4, 26: 8, 33: 1, 68: 16}  # bytes by type
SCALES = r"Linear|Polynomial|Table|Add|Subtract|RTD|Strain|Thermistor|Thermocouple|AdvancedAPI"  # that npTDMS knows
RATIONAL, ALGEBRAIC, RANGES = 2, 3, 6  # types of MDF conversions
_TOLD = re.compile(rb"/'|wf_start_time|wf_start_offset|wf_increment|unit_string|NI_Scal[]\w[]+|NI_Number_Of_Scales")
_TIME = re.compile(r"(?:.*[T ])?(\d{1,2}):(\d\d):(\d\d(?:[.,]\d+)?)(?:Z|[+-]\d\d:?\d\d)?")


class FileColumn(NamedTuple):
    """Name and unit of a column of numbers in a file of others."""

    whole: str  # name that is unique in the file: "v [km/h]" in CSV, "GROUP/v" in MDF and TDMS
    name: str
    unit: str  # "" without one
    timed: bool = False  # it has times of its own
    commands: bool = False  # of messages that command a motion


class Samples(NamedTuple):
    """Samples of a column."""

    values: Floats  # (m,) in the unit of the file; NaN in gaps
    t: Floats | None = None  # (m,) s; None without times of its own
    lines: Floats | None = None  # (m,) numbers of the lines of a CSV file


Choose = Callable[[Sequence[FileColumn]], Sequence[int]]
Read = dict[int, Samples]
Properties = Mapping[tuple[str, str], set[bytes]]  # values of TDMS properties in all segments, by path and key


def read_samples(path: Path, choose: Choose, wanted: Collection[str] = ()) -> Read:
    """Read columns of a file, by its suffix; a suffix that no other format has is that of a CSV file.

    :param choose: gives the numbers of the wanted columns among those of the file; raises BadInput.
    :param wanted: names of these, with units behind or not: those that a bag is asked for.
    :raises BadInput: for a file that cannot be read; NotInstalled without its library, LogUnreadable for a log.
    """
    from orchestrator.log.bags import read_bag  # takes long, and a scene rarely names a file
    from orchestrator.log.container import ForeignLog, LogUnreadable

    reason, suffix = "", path.suffix.lower()
    with _silent_ends():
        try:
            if suffix not in BAGS and not path.is_dir():
                with suppress(ForeignLog):
                    return FORMATS.get(suffix, _csv)(path, choose)
            return read_bag(path, choose, wanted)
        except (BadInput, NotInstalled, LogUnreadable):
            raise
        except Exception as error:
            reason = f"{getattr(error, 'strerror', None) or error}" or type(error).__name__
            reason += other_suffix(path) if isinstance(error, ValueError) else ""
        gc.collect()  # drops what the failure still holds
    raise BadInput(f"{path} cannot be read: {' '.join(reason.split())}")


def other_suffix(path: Path) -> str:
    """Return the sentence part on a file whose suffix no format has; empty for another one."""
    known = [*FORMATS, *BAGS]
    return "" if path.suffix.lower() in known else f"; of other files these are read, by suffix: {', '.join(known)}"


@contextmanager
def _silent_ends() -> Iterator[None]:
    """Silence asammdf, which prints groups of damaged files and raises when it drops a file that it could not open."""
    before, sys.unraisablehook = sys.unraisablehook, lambda fault: None
    try:
        with redirect_stdout(StringIO()):
            yield
    finally:
        sys.unraisablehook = before


def _csv(path: Path, choose: Choose) -> Read:
    lines = csv_lines(path, MEASURED, MEASURED_ROWS, MARKS)
    _, header = next(lines, (0, []))
    try:
        chosen = sorted(choose(_heads(header)))
    except BadInput as error:
        raise BadInput(f"{error}{_later_header(path, choose)}") from None
    numbers = array("d")
    for line, cells in lines:
        if any(cell.strip() for cell in cells[len(header) :]):
            pairs = ",".join(map(".".join, zip(cells[::2], cells[1::2], strict=False)))
            whole = (
                f": {pairs:.{MAX_CHARACTERS}}"
                if len(cells) == 2 * len(header)
                else ", and a cell that holds a comma quotes"
            )
            hint = f"; decimals have a point{whole}" if len(cells) > len(header) else ""
            raise BadInput(f"{path}, line {line}: there are {len(cells)} cells, and {len(header)} columns{hint}")
        numbers.append(line)
        numbers.extend(_number(path, line, cells, header, k) for k in chosen)
    line_of, *values = np.array(numbers).reshape(-1, 1 + len(chosen)).T
    return {k: Samples(each, lines=line_of) for k, each in zip(chosen, values, strict=True)}


def _heads(header: Sequence[str]) -> list[FileColumn]:
    return [FileColumn(cell.strip(), *head(cell)) for cell in header]


def _later_header(path: Path, choose: Choose) -> str:
    """Sentence part on a line below the first that names all wanted columns; "" without one."""
    for mark in MARKS:
        for line, cells in islice(csv_lines(path, MEASURED, MEASURED_ROWS, mark), 1, PREAMBLE):
            with suppress(BadInput):
                choose(_heads(cells))
                return f"; line {line} names all that is asked for: delete the lines above it"
    return ""


def _number(path: Path, line: int, cells: Sequence[str], header: Sequence[str], k: int) -> float:
    name = head(header[k])[0]
    try:
        return number(cells[k].strip() or "nan")
    except IndexError:
        raise BadInput(f"{path}, line {line}: there are {len(cells)} cells, and none for '{name}'") from None
    except ValueError:
        sentence = f"'{name}' must be a number or empty, not '{cells[k].strip()}'{_hint(path, line, cells, header, k)}"
        raise BadInput(f"{path}, line {line}: {sentence}") from None


def _hint(path: Path, line: int, cells: Sequence[str], header: Sequence[str], k: int) -> str:
    """Sentence part that says how a line would read with numbers; "" without a guess."""
    texts = [cell.strip() for cell in cells]
    with path.open(encoding="utf-8-sig") as lines:
        first = next(lines, "")
    mark = next((mark for mark in MARKS if mark in first), ",")
    if re.fullmatch(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?", texts[k]):
        return f"; decimals have a point: {mark.join(text.replace(',', '.') for text in texts):.{MAX_CHARACTERS}}"
    if time := _TIME.fullmatch(texts[k]):
        hours, minutes, seconds = (float(part.replace(",", ".")) for part in time.groups())
        texts[k] = f"{3600.0 * hours + 60.0 * minutes + seconds:.12g}"
        return f"; a clock counts seconds, for example of the day: {mark.join(texts):.{MAX_CHARACTERS}}"
    if line <= UNITS_UNTIL and not any(re.fullmatch(r"[-+\d.,:eE]+", text) for text in texts):
        units = zip(map(head, header), (text.strip("[]()") for text in texts), strict=False)
        heads = mark.join(f"{name} [{unit}]" if unit else name for (name, _), unit in units)
        return f"; units belong into the first line, without a line of their own: {heads:.{MAX_CHARACTERS}}"
    return ""


def _check_samples(count: int) -> None:
    if count > MEASURED_SAMPLES:
        raise OverBudget(f"a column has {count} samples, and {MEASURED_SAMPLES} are allowed")


def _values(path: Path, name: str, values: Any) -> Floats:
    """Values as doubles, dates in s from the first one, durations in s; raises BadInput for texts and arrays."""
    found = np.asarray(values)
    if found.ndim != 1 or found.dtype.kind not in "iufMm":
        raise BadInput(f"{path}: column '{name}' holds no numbers, but {found.dtype} of {found.ndim} dimensions")
    found = found - found[:1] if found.dtype.kind == "M" else found
    return np.asarray(found / np.timedelta64(1, "s") if found.dtype.kind == "m" else found, np.float64)


def _parquet(path: Path, choose: Choose) -> Read:
    arrow, parquet = library("pyarrow", EXTRA), library("pyarrow.parquet", EXTRA)
    with open_file(path, MEASURED_BINARY) as stream, parquet.ParquetFile(stream) as file:
        _check_samples(file.metadata.num_rows)
        present = []
        for field in file.schema_arrow:
            dates, unit = arrow.types.is_temporal(field.type), (field.metadata or {}).get(b"unit", b"").decode()
            named = (field.name, "s" if dates else unit) if dates or unit else head(field.name)
            present.append(FileColumn(field.name, *named))
        found = {}
        for k in choose(present):
            name = present[k].whole
            kind, is_decimal = file.schema_arrow.field(k).type, arrow.types.is_decimal(file.schema_arrow.field(k).type)
            if not is_decimal and not arrow.types.is_primitive(kind):
                raise BadInput(f"{path}: column '{name}' holds no numbers, but {kind}")
            column = file.read([name]).column(name)  # pyarrow reads "a.b" along with "a": picked once more
            found[k] = Samples(_values(path, name, (column.cast("float64") if is_decimal else column).to_numpy()))
    return found


def _mdf(path: Path, choose: Choose) -> Read:
    asammdf = library("asammdf", EXTRA)
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)  # it prints what it raises, too
    with open_file(path, MEASURED_BINARY) as stream, asammdf.MDF(stream) as file:
        if not file.version.startswith("4"):
            raise BadInput(f"{path} is MDF {file.version}: save it as MDF 4")
        labels = [group.channel_group.acq_name for group in file.groups]
        twice = Counter(labels)
        labels = [label if label and twice[label] == 1 else f"{k}" for k, label in enumerate(labels)]
        places = [(i, j) for i, group in enumerate(file.groups) for j in range(len(group.channels))]
        channels = [file.groups[i].channels[j] for i, j in places]
        present = [
            FileColumn(f"{labels[i]}/{c.name}", c.name, (c.conversion and c.conversion.unit) or c.unit, timed=True)
            for (i, _), c in zip(places, channels, strict=True)
        ]
        found = {}
        for k in choose(present):
            i, j = places[k]
            _check_samples(file.groups[i].channel_group.cycles_nr)
            master = file.masters_db.get(i)
            if master is None or file.groups[i].channels[master].sync_type != 1:  # time; others: angle, number
                raise BadInput(f"{path}: the group '{labels[i]}' of '{channels[k].name}' has no clock")
            conversion = channels[k].conversion
            raw = bool(conversion) and conversion.conversion_type in (RATIONAL, ALGEBRAIC, RANGES)
            signal = file.get(group=i, index=j, ignore_invalidation_bits=True, raw=raw)
            samples = _converted(conversion, signal.samples) if raw else signal.samples
            values, invalid = _values(path, present[k].whole, samples), signal.invalidation_bits
            kept = values if invalid is None else np.where(np.asarray(invalid, bool), np.nan, values)
            found[k] = Samples(kept, np.asarray(signal.timestamps, float))
    return found


def _converted(by: Any, raw: Any) -> Any:
    """Values of raw ones; the upper border belongs to a range of integers alone (ASAM MDF 4.1, CCBLOCK)."""
    if by.conversion_type != RANGES:
        return by.convert(raw.astype(float))
    count = (by.val_param_nr - 1) // 3
    lower, upper, values = (np.array([by[f"{k}_{n}"] for n in range(count)]) for k in ("lower", "upper", "phys"))
    n = np.searchsorted(lower, raw, side="right") - 1
    inside = (raw <= upper[n]) if raw.dtype.kind in "iu" else (raw < upper[n])
    return np.where((n >= 0) & inside, values[n], by["default"])


def _tdms(path: Path, choose: Choose) -> Read:
    nptdms = library("nptdms", EXTRA)
    nptdms.log.log_manager.set_level(logging.ERROR)  # for what is cut off there is a notice
    with open_file(path, MEASURED_BINARY) as stream:
        properties = segment_properties(stream)
        stream.seek(0)
        with nptdms.TdmsFile.open(stream) as file:
            if file.file_status.incomplete_final_segment or file.file_status.channel_statuses:
                LOG.warning(f"{path} was cut off: its last segment is incomplete")
            channels = [channel for group in file.groups() for channel in group.channels()]
            present = []
            for c in channels:
                unit = str(c.properties.get("unit_string", "s" if c.data_type is nptdms.types.TimeStamp else ""))
                timed = "wf_increment" in c.properties
                present.append(FileColumn(f"{c.group_name}/{c.name}", c.name, unit, timed))
            begins = [c.properties["wf_start_time"] for c in channels if "wf_start_time" in c.properties]
            found = {}
            for k in choose(present):
                _check_samples(len(channels[k]))
                _check_scale(path, file, channels[k], properties)
                t = _track(path, channels[k], properties, min(begins, default=None)) if present[k].timed else None
                found[k] = Samples(_values(path, present[k].whole, channels[k][:]), t)
    return found


def _check_scale(path: Path, file: Any, channel: Any, properties: Properties) -> None:
    """Raise BadInput if properties of a channel, its group or its file change, or npTDMS does not know a scale."""
    name = f"{channel.group_name}/{channel.name}"
    for (where, key), values in properties.items():
        if len(values) > 1 and channel.path.startswith(where):
            raise BadInput(f"{path}: '{name}' was armed again, {key} changes: save each record as a file of its own")
    about = {**file.properties, **file[channel.group_name].properties, **channel.properties}
    for key, kind in about.items() if about.get("NI_Scaling_Status") != "scaled" else ():
        if key.endswith("]_Scale_Type") and not re.fullmatch(SCALES, str(kind)):
            raise BadInput(f"{path}: '{name}' has a scale of type '{kind}', which is not known: save it scaled")


def _track(path: Path, channel: Any, properties: Properties, first: Any) -> Floats:
    """Times of a TDMS channel, s, from the first start among all; raises BadInput if they are not known."""
    about, name = channel.properties, f"{channel.group_name}/{channel.name}"
    for key in TIMING:
        if key in about and (channel.path, key) not in properties:
            raise BadInput(f"{path}: '{name}' is not read, because {key} of its segments cannot be known")
    if str(about.get("wf_xunit_string") or "s") != "s":
        raise BadInput(f"{path}: '{name}' is over {about['wf_xunit_string']}, not over time in s")
    if first is not None and "wf_start_time" not in about:
        raise BadInput(f"{path}: '{name}' has no wf_start_time, and other channels have one")
    late = 0.0 if first is None else (about["wf_start_time"] - first) / np.timedelta64(1, "s")
    start = late + float(about.get("wf_start_offset", 0.0))
    return np.asarray(start + float(about["wf_increment"]) * np.arange(len(channel)), float)


def segment_properties(stream: BufferedReader) -> Properties:
    """Values of each property of times, scales and units, as bytes, in the metadata of all segments of a TDMS file.

    A segment begins with a tag, flags (64: big-endian), a version, its length and that of its metadata (National
    Instruments, TDMS File Format Internal Structure); a property is name, type and value; texts follow their lengths.
    """
    found: dict[tuple[str, str], set[bytes]] = {}
    at = 0
    while (lead := stream.read(LEAD_IN)).startswith(b"TDSm"):
        order: Literal["big", "little"] = "big" if lead[4] & 64 else "little"
        whole, described = (int.from_bytes(lead[k : k + 8], order) for k in (12, 20))
        text, path, end = stream.read(described), "", 0
        while each := _TOLD.search(text, end):
            begin, end = each.span()
            length = int.from_bytes(text[max(begin - 4, 0) : begin], order)
            if each[0] == b"/'" and 2 < length < LONGEST:
                end = begin + length
                path = text[begin:end].decode(errors="replace")
            elif length == end - begin:
                kind, more = (int.from_bytes(text[k : k + 4], order) for k in (end, end + 4))
                value = text[end : end + 4 + min(SIZES.get(kind, 4 + more), LONGEST)]
                found.setdefault((path, each[0].decode()), set()).add(value)
        at += LEAD_IN + whole
        stream.seek(min(at, MEASURED_BINARY))  # a segment that was not finished has no end
    return found


def _mcap(path: Path, choose: Choose) -> Read:
    from orchestrator.log.reader import Log

    with Log(path) as log:
        if log.closing:
            log.notice_seal()
        names = log.signals
        chosen = choose([FileColumn(name, name, log.unit(name), timed=True) for name in names])
        return {k: Samples(values, t) for k in chosen for t, values in [log.signal(names[k])]}


FORMATS: dict[str, Callable[[Path, Choose], Read]] = {
    ".csv": _csv, ".parquet": _parquet, ".mf4": _mdf, ".mdf": _mdf, ".tdms": _tdms, ".mcap": _mcap,
}  # fmt: skip
BAGS = (".db3", ".bag")  # of robots, as are MCAP files of other software
SUFFIXES = {*FORMATS, *BAGS} - {".mcap"}  # of files that are no run
