"""Logs of robots and other recorders as measured data: ROS 2 bags (MCAP, .db3, their folder), ROS 1 bags, JSON in MCAP.

A column is a field of the messages of a topic by its path, ``/odom.twist.twist.linear.x``. Elements of arrays have
their number, or the name that a list beside them has: ``/joint_states.velocity[left]``, ``/tf.transforms[base_link]``.
DERIVED gives angles of quaternions and metres of latitude and longitude. Axes of ROS (REP 103: x ahead, y to the left,
z up; SI units) are those here, and so are the signs of its angles.

Only topics that are asked for are decoded, by the definitions in the file (rosbags 0.11.9). Times are those of
``header.stamp`` where messages have one, else of receipt, sorted. 0 is the first receipt of the bag. Stamps of another
clock, more than an hour from receipt, as of a simulation, have one zero for all topics: the first of them stands at its
receipt.
"""

from __future__ import annotations

import json
import re
from array import array
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, suppress
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import zstandard

from fmus.vehicles.tables import BadInput
from orchestrator.files.budget import AT_ONCE, MEASURED_SAMPLES, OverBudget, open_file
from orchestrator.files.messages import LOG
from orchestrator.log.angles import continuous
from orchestrator.log.container import Container
from orchestrator.log.extra import library
from orchestrator.log.measured_formats import BAGS, EXTRA, MAX_CHARACTERS, Choose, FileColumn, Read, Samples
from orchestrator.log.message_records import LOG_TIME, PREFIX
from orchestrator.log.time_series import Floats

NAMES = ("name", "names", "joint_names")  # lists that name the elements of the arrays beside them
UNROLLED = re.compile(r"\[\s*\d{5,}\s*\]")  # arrays of a fixed size, for which rosbags may write a line each
ZSTD = b"\x28\xb5\x2f\xfd"  # begins messages that are compressed one by one
NS, TIME = 1e-9, slice(LOG_TIME, LOG_TIME + 8)
HOUR, UNSET = 3_600_000_000_000, -(1 << 62)  # ns; in place of a stamp
LOOKED_AT = 100  # messages of a topic that are decoded until one has a number
_UNPACK = zstandard.ZstdDecompressor().decompress
COMMANDS = re.compile("Twist$|TwistStamped$|Ackermann")  # types of messages whose numbers command a motion
_IDL = re.compile(r"^=+\nIDL: .*\n", re.MULTILINE)


def _listed(folder: Path) -> list[Path]:
    """Files of a bag in a folder, those that its metadata.yaml lists where it is there; raises BadInput for none."""
    files = sorted(one for one in folder.glob("*") if one.suffix in (".mcap", *BAGS))
    if not files:
        raise BadInput(f"{folder} holds no file of a bag, .mcap or {' or '.join(BAGS)}: unpack .zstd first")
    if not (about := folder / "metadata.yaml").exists():
        return files
    yaml = library("ruamel.yaml", EXTRA).YAML(typ="safe")
    try:
        names = yaml.load(about)["rosbag2_bagfile_information"]["relative_file_paths"]
        listed = [Path(name.removesuffix(".zstd")).name for name in names]
    except Exception as error:  # of its own classes, of what is missing
        raise BadInput(f"{about} lists no files of a bag: {' '.join(f'{error}'.split()):.{MAX_CHARACTERS}}") from None
    if missing := sorted({*listed} - {one.name for one in files}):
        LOG.warning(f"{folder}: metadata.yaml lists {', '.join(missing)[:MAX_CHARACTERS]}, which is not there")
    wanted = [one for one in files if one.name in listed] or files
    if others := [one.name for one in files if one not in wanted]:
        LOG.warning(f"{folder}: not read is {', '.join(others)[:MAX_CHARACTERS]}, which metadata.yaml does not list")
    return wanted


class Channel(NamedTuple):
    """Channel of messages; a topic may have several."""

    topic: str
    kind: str  # type of the messages
    encoding: str  # of the messages
    language: str  # of the definition
    definition: str


class Bag(ExitStack):
    """Bag opened for reading: a file, or the folder of a ROS 2 bag; raises BadInput, LogUnreadable, NotInstalled."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        files = _listed(path) if path.is_dir() else [path]
        for file in files:
            open_file(file).close()  # no pipe, and an input of the command
        opened = [self._mcap(file) if file.suffix.lower() == ".mcap" else self._rosbag(file) for file in files]
        self._files = sorted(opened, key=lambda each: each[0])  # parts of a long record, in the order of time
        self.path, self.start = path, round(self._files[0][0] * 1e-3) // 1000 * 1_000_000  # ns
        self.channels = {channel.topic: channel for _, channels, _ in self._files for channel in channels.values()}

    def _mcap(self, file: Path) -> tuple[float, dict[int, Channel], Any]:
        """Time of the first message, ns, channels by number, and the opened file."""
        opened = Container(file, kept=0)
        self.callback(opened.close)
        if opened.faults:
            raise BadInput(f"{opened.faults[-1]}; 'mcap recover' of mcap.dev saves what it holds")
        channels = {
            number: Channel(a.topic, b.name, a.message_encoding, b.encoding, b.data.decode(errors="replace"))
            for number, (a, b) in opened.other_channels.items()
        }
        return min((a for a, b in opened.spans.values() if a <= b), default=0.0) / NS, channels, opened

    def _rosbag(self, file: Path) -> tuple[float, dict[int, Channel], Any]:
        if file.suffix == ".db3" and {*"%?#"} & {*f"{file}"}:  # rosbags 0.11.9 puts the path into a URI
            raise BadInput(f"{file} is not read, because of %, ? or # in its path: rename it")
        kind = library("rosbags.rosbag1" if file.suffix == ".bag" else "rosbags.rosbag2", EXTRA).Reader
        try:
            reader = self.enter_context(kind(file))
        except Exception as error:  # of its own classes, of apsw, of bytes
            raise BadInput(f"{file} cannot be read: {' '.join(f'{error}'.split())}") from None
        channels = {
            one.id: Channel(one.topic, one.msgtype, encoding, f"ros2{one.msgdef.format.name}".lower(), one.msgdef.data)
            for one in reader.connections
            for encoding in [getattr(one.ext, "serialization_format", "ros1")]
        }
        return reader.start_time, channels, reader

    def messages(self, topics: Collection[str]) -> Iterator[tuple[Channel, int, bytes]]:
        """Yield channel, time of receipt, ns from the start on, and data of the messages of topics."""
        for _, channels, opened in self._files:
            wanted = {number: channel for number, channel in channels.items() if channel.topic in topics}
            if isinstance(opened, Container):
                found = ((k, int.from_bytes(row[TIME], "little"), row[PREFIX:]) for k, row in opened.messages(wanted))
            else:
                connections = [one for one in opened.connections if one.id in wanted]
                found = ((one.id, time, bytes(data)) for one, time, data in opened.messages(connections))
            for number, time, data in found if wanted else ():
                yield wanted[number], time - self.start, _UNPACK(data, AT_ONCE) if data[:4] == ZSTD else data


@lru_cache
def _decoder(path: Path, channel: Channel) -> Callable[[bytes], Any]:
    """Decoder of the messages of a channel; raises BadInput if it is not known what they hold."""
    kind, text, where = channel.kind, channel.definition, f"{path}: {channel.topic} ({channel.kind}) is not read"
    if channel.encoding == "json":
        return json.loads
    if channel.encoding not in ("cdr", "ros1"):
        raise BadInput(f"{where}: its messages are '{channel.encoding}', and cdr, ros1 and json are read")
    types = library("rosbags.typesys", EXTRA)
    store = types.get_typestore(types.Stores.EMPTY)
    if UNROLLED.search(text):
        raise BadInput(f"{where}: its type has an array of a fixed size of 10000 or more")
    is_idl = channel.language == "ros2idl"
    parse = types.get_types_from_idl if is_idl else partial(types.get_types_from_msg, name=kind)
    if parsed := [parse(one) for one in (_IDL.split(text) if is_idl else [text]) if one.strip()]:
        store.register({name: fields for one in parsed for name, fields in one.items()})
        kind = kind if kind in store.types else next(iter(parsed[0]))  # as rosbags spells it
    elif channel.language == "ros2none":  # .db3, as ROS 2 wrote them until 2023
        store = types.get_typestore(types.Stores.ROS2_HUMBLE)
        LOG.warning(f"{path} has no definitions of its types: those of ROS 2 Humble are taken")
    try:
        store.get_msgdef(kind)
    except KeyError as missing:
        raise BadInput(f"{where}: the file has no definition of its type {missing}") from None
    return partial(store.deserialize_ros1 if channel.encoding == "ros1" else store.deserialize_cdr, typename=kind)


def _fields(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else getattr(value, "__dict__", {})


def numbers(value: Any, wanted: str | None = None, path: str = "", names: Any = (), stamp: int = 0) -> Iterator[Any]:
    """Yield path, value and ``header.stamp``, ns, of the number ``wanted``, or of all but in arrays without names."""
    if wanted is not None and not wanted.startswith(path):
        return
    if isinstance(value, (int, float, np.number, np.bool_)):
        yield path, float(value), stamp
    elif isinstance(value, (list, np.ndarray)):
        own = names if len(names) == len(value) else [_fields(one).get("child_frame_id") for one in value]
        for k, inner in enumerate(value[:1] if wanted is None and own[:1] == [None] else value):
            yield from numbers(inner, wanted, f"{path}[{k if own[k] is None else own[k]}]", (), stamp)
    elif fields := _fields(value):
        time = _fields(_fields(fields.get("header")).get("stamp"))
        stamp = 1_000_000_000 * int(time.get("sec", 0)) + int(time.get("nanosec", time.get("nsec", 0))) or stamp
        lists = [fields[key] for key in NAMES if isinstance(fields.get(key), list)]
        for name, inner in fields.items():
            yield from numbers(inner, wanted, f"{path}.{name}", lists[0] if lists else (), stamp)


def _angle(number: int, x: Floats, y: Floats, z: Floats, w: Floats, covariance: Floats) -> Floats:
    """Heading, pitch or roll (0, 1, 2) of quaternions, rad, without jumps; NaN without an orientation (Imu.msg)."""
    from scipy.spatial.transform import Rotation

    quaternions, found = np.stack([x, y, z, w], axis=1), np.full(len(x), np.nan)
    size = np.linalg.norm(quaternions, axis=1)
    known = np.isfinite(size) & (size > 0.0) & (covariance != -1.0)
    if known.any():
        found[known] = Rotation.from_quat(quaternions[known]).as_euler("ZYX")[:, number]
    return continuous(found, 2.0 * np.pi)


def _metres(part: Callable[[Floats], Floats], latitude: Floats, longitude: Floats, status: Floats) -> Floats:
    """Way from the first fix on the ellipsoid of GPS, m, along the geodesic from there; NaN without a fix."""
    fixes = np.flatnonzero(~np.isnan(latitude + longitude) & (status >= 0.0))
    here, way = np.repeat(fixes[:1], len(fixes)), np.full(len(status), np.nan)
    earth = library("pyproj", EXTRA).Geod(ellps="WGS84")
    azimuth, _, distance = earth.inv(longitude[here], latitude[here], longitude[fixes], latitude[fixes])
    way[fixes] = distance * part(np.radians(azimuth))
    return way


# needed numbers, one more that a message may have and what is taken without it, what a gap lacks, unit
QUATERNION = (".x", ".y", ".z", ".w"), "_covariance[0]", 0.0, "orientation", "rad"
FIX = (".latitude", ".longitude"), ".status.status", 0.0, "fix", "m"
DERIVED: dict[str, tuple[tuple[tuple[str, ...], str, float, str, str], Callable[..., Floats]]] = {
    ".heading": (QUATERNION, partial(_angle, 0)), ".pitch": (QUATERNION, partial(_angle, 1)),
    ".roll": (QUATERNION, partial(_angle, 2)), ".east": (FIX, partial(_metres, np.sin)),
    ".north": (FIX, partial(_metres, np.cos)),
}  # fmt: skip


def columns_in(message: Any) -> list[str]:
    """Paths of the numbers that follow from those of a message, and of these."""
    found = [path for path, *_ in numbers(message) if not path.startswith(".header.")]
    found = [path for path in found if not path.rpartition(".")[2].isupper()]  # constants of the type
    bases = dict.fromkeys(path.rpartition(".")[0] for path in found)
    derived = (
        (base, name, {base + need for need in needs}) for base in bases for name, ((needs, *_), _) in DERIVED.items()
    )
    return [*(base + name for base, name, needs in derived if needs <= {*found}), *found]


class _Column:
    """Column that is asked for, and what the messages of its topic have of it."""

    def __init__(self, bag: Bag, text: str) -> None:
        self.name, _, self.unit = text.partition(":")
        owners = [one for one in bag.channels if self.name == one or self.name.startswith((f"{one}.", f"{one}["))]
        if not owners:
            have = ", ".join(sorted(bag.channels)) or "none"
            raise BadInput(f"{bag.path} has no topic of '{self.name}': it has {have}")
        self.topic, self._start, self.shown = max(owners, key=len), bag.start, ""
        self._needs = [self.name[len(self.topic) :]]  # paths of the numbers that the column follows from
        self._of: Callable[..., Floats] = np.asarray
        self._found, self._lacks, self.first = False, "", -1  # ns, receipt of the first sample
        self._times, self._values = array("q"), array("d")  # ns, of receipt and stamps

    def _find(self, message: Any) -> None:
        """Find what the column follows from, in the first message of its topic that has it."""
        (path,), present = self._needs, columns_in(message)
        self.shown = ", ".join(present)[:300] or self.shown or "no numbers"
        stem, dot, last = path.rpartition(".")
        within = [one for one in present if one.startswith((f"{path}.", f"{path}["))]
        if any(one == path for one, *_ in numbers(message, path)):
            self._found = True
        elif len(within) == 1 and within[0][-1] != "]":  # a message with one number stands for it
            self._needs, self._found = within, True
        elif path in present:
            (parts, more, instead, self._lacks, unit), formula = DERIVED[dot + last]
            has_more = stem + more in present
            self._of = formula if has_more else lambda *values: formula(*values, np.full(len(values[0]), instead))
            self._needs = [stem + part for part in (*parts, *([more] if has_more else []))]
            self.unit, self._found = self.unit or unit, True

    def add(self, message: Any, received: int) -> None:
        """Add what a message has, ``received`` at, ns; one without it, as of another joint, is left out."""
        if not self._found:
            self._find(message)
        found = [[one for one in numbers(message, need) if one[0] == need] for need in self._needs]
        for sample in zip(*found, strict=False) if len({len(each) for each in found}) == 1 else ():
            if len(self._times) == 2 * MEASURED_SAMPLES:
                raise OverBudget(f"a column has more than {MEASURED_SAMPLES} samples, which are allowed")
            stamp, self.first = sample[0][2], received if self.first < 0 else self.first
            self._times.extend([received, stamp - self._start if stamp else UNSET])
            self._values.extend(value for _, value, _ in sample)

    def _stamped(self) -> tuple[Any, Any, Any]:
        """Receipt and stamp, ns, and lead of the stamp, masked where none is set, of the samples."""
        received, stamps = np.array(self._times).reshape(-1, 2).T
        return received, stamps, np.ma.masked_where(stamps == UNSET, stamps - received)

    @staticmethod
    def _odd(lead: Any, received: Any) -> Any:
        """Mask of stamps that are not set, or hours from the others, other than by the drift of a record's length."""
        return np.ma.filled(abs(lead - np.ma.median(lead)) > HOUR + np.ptp(received), True)

    def zero(self, zeros: list[int]) -> int:
        """Zero of the clock of the stamps, ns: one of those that are known, or a new one, which joins them."""
        received, _, lead = self._stamped()
        usual = np.ma.median(lead)
        if lead.mask.all() or abs(usual) <= HOUR:
            return 0
        if not any(abs(usual - zero) <= HOUR for zero in zeros):
            zeros.append(int(lead[~self._odd(lead, received)][0]))
        return next(zero for zero in reversed(zeros) if abs(usual - zero) <= HOUR)

    def samples(self, zero: int) -> tuple[Samples, str]:
        """Samples by increasing time, by a clock of the stamps with this zero, ns, and a sentence on their times."""
        received, stamps, lead = self._stamped()
        odd = self._odd(lead, received)
        times = np.where(odd, received, stamps - zero)
        t, first = np.unique(times, return_index=True)
        back = np.maximum.accumulate(times) - times
        sentence = f"times of {self.topic} are those of {'receipt' if odd.all() else 'header.stamp'}"
        if odd.any() and not odd.all():
            sentence += f"; {odd.sum()} of {len(times)}, without one or hours from the others, stand at their receipt"
        if late := np.count_nonzero(back):
            sentence += f"; {late} of {len(times)} came late, by up to {NS * back.max():.3g} s, and are sorted"
        if len(t) < len(times):
            sentence += f"; {len(times) - len(t)} with the time of an earlier one are left out"
        if zero:
            sentence += f"; they are of another clock, on which {NS * (zero + self._start):.10g} s is 0"
        gap = np.diff(t, prepend=0)
        if (most := gap.max()) > HOUR:
            k = int(gap.argmax())
            sentence += f"; {most / HOUR:.4g} hours without a message end at {NS * t[k]:.10g} s"
        values = self._of(*np.array(self._values).reshape(-1, len(self._needs))[first].T)
        if gaps := self._lacks and np.count_nonzero(np.isnan(values)):
            sentence += f"; {gaps} of {len(values)} have no {self._lacks} and are gaps"
        return Samples(values, NS * t), sentence


def read_bag(path: Path, choose: Choose, wanted: Collection[str]) -> Read:
    """Read columns ``wanted``, "TOPIC.PATH" or "TOPIC.PATH:UNIT", as ``measured_formats.read_samples`` does."""
    if not wanted:
        raise BadInput(f"{path}: name a column, {path.name}:TOPIC.FIELD; 'cotrack log info {path}' lists them")
    with Bag(path) as bag:
        columns = [_Column(bag, text) for text in wanted]
        for channel, time, data in bag.messages({one.topic for one in columns}):
            message = _decoder(path, channel)(data)
            for one in columns:
                if one.topic == channel.topic:
                    one.add(message, time)
    for one in columns:
        if one.first < 0:
            raise BadInput(f"{path} has no number '{one.name}': {one.topic} has {one.shown or 'no messages'}")
    zeros: list[int] = []
    zero = {one.name: one.zero(zeros) for one in sorted(columns, key=lambda one: one.first)}
    samples = [one.samples(zero[one.name]) for one in columns]
    kinds = {one.topic: bag.channels[one.topic].kind.rpartition("/")[2] for one in columns}
    commanding = {topic for topic, kind in kinds.items() if COMMANDS.match(kind)}
    chosen = choose([FileColumn(one.name, one.name, one.unit, True, one.topic in commanding) for one in columns])
    for sentence in dict.fromkeys(samples[k][1] for k in chosen):
        LOG.warning(f"{path}: {sentence}")
    return {k: samples[k][0] for k in chosen}


def _stamp(decode: Callable[[bytes], Any], data: bytes) -> float | None:
    """``header.stamp`` of a message, s; None where none is set."""
    with suppress(Exception):  # whatever code by rosbags raises at damaged bytes
        return next((NS * stamp for *_, stamp in numbers(decode(data)) if stamp), None)
    return None


def contents(path: Path) -> dict[str, dict[str, Any]]:
    """Type, messages, rate, Hz, times of receipt and stamps, s, numbers and fault of each topic; raises as ``Bag``."""
    with Bag(path) as bag:
        found: dict[str, dict[str, Any]] = {
            topic: {"type": one.kind, "encoding": one.encoding, "messages": 0, "numbers": [], "fault": ""}
            for topic, one in bag.channels.items()
        }
        ends: dict[str, list[tuple[Channel, bytes]]] = {}
        for channel, time, data in bag.messages(found):
            about, t = found[channel.topic], NS * time
            first, last = min(about.get("first", t), t), max(about.get("last", t), t)
            rate = about["messages"] / (last - first) if last > first else 0.0
            about |= {"messages": about["messages"] + 1, "first": first, "last": last, "rate": rate}
            ends[channel.topic] = [*ends.get(channel.topic, [])[:1], (channel, data)]
            if not about["numbers"] and not about["fault"] and about["messages"] <= LOOKED_AT:
                try:
                    about["numbers"] = [f"{channel.topic}{one}" for one in columns_in(_decoder(path, channel)(data))]
                except Exception as error:  # whatever code by rosbags raises at damaged bytes
                    about["fault"] = " ".join(f"{error}".split()) or type(error).__name__
        for topic, messages in ends.items():
            if found[topic]["numbers"]:
                found[topic]["stamps"] = [_stamp(_decoder(path, channel), data) for channel, data in messages]
    return found
