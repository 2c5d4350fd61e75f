"""The protobuf message of a topic: generated from variable names, packed and unpacked as arrays of bytes.

A message is ``t`` and ``h``, then every single variable as a ``double``, then every family of variables that
differ in one index only (``link[1].tension``, ``link[2].tension``, ...) as one packed ``repeated double``
(``link_tension``). Every field is always written, so all messages of a topic have the same size and differ
in the eight bytes of each value only: packing fills the holes of a template (``page``), unpacking reads them back, for
thousands of messages at once and without touching a bit of any value.

Dots and other signs that protobuf does not allow become underscores. A place is ``speed`` or
``link_tension[3]`` (counted from 0): places are recorded beside the names, so the naming is reversible.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet
from google.protobuf.message import DecodeError
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]

FIRST_NUMBER = 16  # of the variables' fields: the tags of 16 to 2047 are two bytes, so holes are evenly spaced
MOST_FIELDS = 8000  # in a message: protobuf's decoder holds one in 65,535 bytes, 8 a field
FIXED64, LENGTH_DELIMITED = 1, 2  # wire types
TIME_AT, LENGTH_AT = 1, 10  # where t and h begin in every message

_INDEX = re.compile(r"\[(\d+)\]")
_PLACE = re.compile(r"(\w+)(?:\[(\d+)\])?", re.ASCII)


class Field(NamedTuple):
    """One field of a message."""

    name: str
    number: int
    length: int  # of a packed repeated double; 0 for a double


class Group(NamedTuple):
    """Consecutive fields of one kind: their values are evenly spaced in the message."""

    first: int  # of the values in field order
    shape: tuple[int, int]  # fields, values in each
    offset: int  # byte in the message of the first value
    stride: int  # bytes from one field's first value to the next field's


class Layout(NamedTuple):
    """Where each variable of a topic stands in its message."""

    fields: tuple[Field, ...]
    order: NDArray[np.intp]  # index of the variable that is value i in field order
    groups: tuple[Group, ...]
    starts: NDArray[np.intp]  # of each variable, the byte in the message where its value begins
    template: bytes  # a message whose values, t and h are all zero

    def unpack(self, rows: Bytes, offset: int, columns: Sequence[int] | None = None) -> tuple[Floats, Floats, Floats]:
        """Return t (m,), h (m,), values (m, variables) of the messages at byte ``offset`` of each row.

        ``columns``: of these variables only, which is quicker for few.
        """
        t = _holes(rows, offset + TIME_AT, (1,), (0,))[:, 0].copy()
        h = _holes(rows, offset + LENGTH_AT, (1,), (0,))[:, 0].copy()
        if columns is not None:
            values = np.empty((len(rows), len(columns)))
            for k, column in enumerate(columns):
                values[:, k] = _holes(rows, offset + self.starts[column], (1,), (0,))[:, 0]
            return t, h, values
        values = np.empty((len(rows), len(self.order)))
        for group in self.groups:
            members = self.order[group.first : group.first + group.shape[0] * group.shape[1]]
            holes = _holes(rows, offset + group.offset, group.shape, (group.stride, 8))
            values[:, members] = holes.reshape(len(rows), -1)
        return t, h, values


def _holes(rows: Bytes, offset: int, shape: tuple[int, ...], strides: tuple[int, ...]) -> NDArray:
    """The doubles in rows of bytes, as an (unaligned) array (rows, *shape) on the same memory."""
    return np.ndarray((len(rows), *shape), "<f8", rows, offset, (rows.strides[0], *strides))


def places(names: Sequence[str]) -> list[str]:
    """For each variable the place of its value: ``field``, or ``field[index]`` counted from 0."""
    families: dict[str, list[int]] = {}
    for name in names:
        key, index = family(name)
        if index is not None:
            families.setdefault(key, []).append(index)
    whole = {
        key: min(members)
        for key, members in families.items()
        if sorted(members) == list(range(min(members), min(members) + len(members)))
    }
    taken: set[str] = {"t", "h"}
    field_of: dict[str, str] = {}
    result = []
    for name in names:
        key, index = family(name)
        folded = index is not None and key in whole
        label = key if folded else name
        if label not in field_of:
            field_of[label] = _unique(_identifier(label.replace("[*]", "")), taken)
        elif not folded:
            raise ValueError(f"the variable '{name}' is listed twice")
        result.append(f"{field_of[label]}[{index - whole[key]}]" if folded else field_of[label])  # type: ignore[operator]
    return result


def family(name: str) -> tuple[str, int | None]:
    """``link[3].tension`` -> ("link[*].tension", 3); a name without exactly one index -> (name, None)."""
    found = _INDEX.findall(name)
    return (_INDEX.sub("[*]", name), int(found[0])) if len(found) == 1 else (name, None)


def _identifier(text: str) -> str:
    """A protobuf identifier that looks like ``text``."""
    word = re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_") or "x"
    return word if word[0].isalpha() else f"x{word}"


def _unique(word: str, taken: set[str]) -> str:
    """``word``, numbered where taken; compared as JSON spells names: without case and underscores."""
    candidate, number = word, 1
    while (key := candidate.replace("_", "").lower()) in taken:
        number += 1
        candidate = f"{word}_{number}"
    taken.add(key)
    return candidate


def layout(where: Sequence[str]) -> Layout:
    """The layout of a message whose variable i has its value at the place ``where[i]``; raises ValueError."""
    members: dict[str, dict[int | None, int]] = {}
    for variable, place in enumerate(where):
        match = _PLACE.fullmatch(place)
        if match is None:
            raise ValueError(f"'{place}' is not a place in a message")
        index = None if match[2] is None else int(match[2])
        if members.setdefault(match[1], {}).setdefault(index, variable) != variable:
            raise ValueError(f"two variables have the place '{place}'")
    for name, found in members.items():
        if set(found) not in ({None}, set(range(len(found)))):
            raise ValueError(f"the values of the field '{name}' are not counted from 0 to {len(found) - 1}")
    counts = {name: 0 if None in found else len(found) for name, found in members.items()}
    names = sorted(members, key=counts.__getitem__)  # stable: singles in their order, then families by length
    if len(names) > MOST_FIELDS:
        raise ValueError(f"a message holds {MOST_FIELDS} variables and families, not {len(names)}")
    fields = tuple(Field(name, number, counts[name]) for number, name in enumerate(names, FIRST_NUMBER))
    indices = ((f.name, i if f.length else None) for f in fields for i in range(f.length or 1))
    order = np.array([members[name][index] for name, index in indices], np.intp)
    groups, template = _lay_out(fields)
    starts = np.empty(len(order), np.intp)
    for group in groups:
        of_fields, of_values = group.stride * np.arange(group.shape[0]), 8 * np.arange(group.shape[1])
        places = order[group.first : group.first + group.shape[0] * group.shape[1]]
        starts[places] = (group.offset + of_fields[:, None] + of_values).ravel()
    return Layout(fields, order, groups, starts, template)


def _lay_out(fields: Sequence[Field]) -> tuple[tuple[Group, ...], bytes]:
    """Groups of evenly spaced fields, and the bytes of a message of zeros."""
    body = bytearray(_header(Field("t", 1, 0)) + bytes(8) + _header(Field("h", 2, 0)) + bytes(8))
    groups, first = [], 0
    for (size, count), run in groupby(fields, lambda field: (len(_header(field)), field.length)):
        members, width = list(run), count or 1
        groups.append(Group(first, (len(members), width), len(body) + size, size + 8 * width))
        for field in members:
            body += _header(field) + bytes(8 * width)
        first += len(members) * width
    return tuple(groups), bytes(body)


def _header(field: Field) -> bytes:
    """The bytes before a field's values: the tag, and the length of a packed family."""
    if field.length == 0:
        return _varint(field.number << 3 | FIXED64)
    return _varint(field.number << 3 | LENGTH_DELIMITED) + _varint(8 * field.length)


def _varint(number: int) -> bytes:
    """Base 128, least significant group first."""
    groups = bytearray()
    while number > 0x7F:
        groups.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*groups, number])


def type_name(topic: str) -> str:
    """The message type of a topic: "/left_track/out" -> "cotrack.left_track.Out"."""
    *package, message = [_identifier(word) for word in topic.strip("/").split("/")]
    return ".".join(["cotrack", *package, message[0].upper() + message[1:]])


def descriptor(name: str, fields: Iterable[Field]) -> bytes:
    """A serialised FileDescriptorSet with the one message type ``name``: what MCAP keeps as schema."""
    package, _, message = name.rpartition(".")
    file = FileDescriptorProto(name=f"{name.replace('.', '/')}.proto", package=package, syntax="proto3")
    kind = file.message_type.add(name=message)
    for field in (Field("t", 1, 0), Field("h", 2, 0), *fields):
        label = FieldDescriptorProto.LABEL_REPEATED if field.length else FieldDescriptorProto.LABEL_OPTIONAL
        kind.field.add(name=field.name, number=field.number, type=FieldDescriptorProto.TYPE_DOUBLE, label=label)
    return FileDescriptorSet(file=[file]).SerializeToString(deterministic=True)


def describes(data: bytes, fields: Iterable[Field]) -> bool:
    """Whether a recorded FileDescriptorSet describes exactly these fields."""
    try:
        kind = FileDescriptorSet.FromString(data).file[0].message_type[0]
    except (DecodeError, IndexError):
        return False
    recorded = [(f.name, f.number, f.label == FieldDescriptorProto.LABEL_REPEATED) for f in kind.field]
    return recorded == [("t", 1, False), ("h", 2, False), *((f.name, f.number, f.length > 0) for f in fields)]
