"""Protobuf message type of a topic, made from variable names; packed and unpacked as byte arrays.

A message is ``t`` and ``h``, then every single variable as a ``double``, then every family of variables that
differ in one index only (``link[1].tension``, ``link[2].tension``, ...) as one packed ``repeated double``
(``link_tension``). Every field is always written, so all messages of a topic have the same size and differ only
in the eight bytes of each value. Packing (``page``) writes these bytes into a template, unpacking reads them, for
thousands of messages at once and bit by bit.

Dots and other characters that protobuf does not allow become underscores. A place is ``speed`` or
``link_tension[3]`` (counted from 0). Places are recorded with the names, so the mapping is reversible.
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

from orchestrator.log.time_series import Floats

Bytes = NDArray[np.uint8]
FIRST_NUMBER = 16  # first field number of a variable: tags of 16 to 2047 take two bytes, so values are evenly spaced
MAX_FIELDS = 8000  # per message: protobuf's decoder keeps a message in 65,535 bytes, 8 per field
FIXED64, LENGTH_DELIMITED = 1, 2  # protobuf wire types
TIME_AT, LENGTH_AT = 1, 10  # byte offsets of t and h in every message
_INDEX = re.compile(r"\[(\d+)\]")
_PLACE = re.compile(r"(\w+)(?:\[(\d+)\])?", re.ASCII)


class Field(NamedTuple):
    """Field of a message."""

    name: str
    number: int
    length: int  # number of values of a packed repeated double; 0 for a double


class FieldGroup(NamedTuple):
    """Consecutive fields of one kind, whose values are evenly spaced in the message."""

    first: int  # index of the first value in field order
    shape: tuple[int, int]  # fields, values per field
    offset: int  # byte offset of the first value in the message
    stride: int  # bytes from the first value of a field to that of the next field


class MessageLayout(NamedTuple):
    """Byte layout of a topic's messages."""

    fields: tuple[Field, ...]
    order: NDArray[np.intp]  # (n,) index of the variable that is value i in field order
    groups: tuple[FieldGroup, ...]
    starts: NDArray[np.intp]  # (n,) byte offset of each variable's value in the message
    template: bytes  # message with all values, t and h zero

    def unpack(self, rows: Bytes, offset: int, columns: Sequence[int] | None = None) -> tuple[Floats, Floats, Floats]:
        """Return t (m,), s, h (m,), s, and values (m, variables) of messages at ``offset`` in each row.

        ``columns``: return these variables only, which is faster for a few.
        """
        t = _value_view(rows, offset + TIME_AT, (1,), (0,))[:, 0].copy()
        h = _value_view(rows, offset + LENGTH_AT, (1,), (0,))[:, 0].copy()
        if columns is not None:
            values = np.empty((len(rows), len(columns)))
            for k, column in enumerate(columns):
                values[:, k] = _value_view(rows, offset + self.starts[column], (1,), (0,))[:, 0]
            return t, h, values
        values = np.empty((len(rows), len(self.order)))
        for group in self.groups:
            members = self.order[group.first : group.first + group.shape[0] * group.shape[1]]
            holes = _value_view(rows, offset + group.offset, group.shape, (group.stride, 8))
            values[:, members] = holes.reshape(len(rows), -1)
        return t, h, values


def _value_view(rows: Bytes, offset: int, shape: tuple[int, ...], strides: tuple[int, ...]) -> NDArray:
    """Return the doubles in rows of bytes as an unaligned view (rows, *shape) on the same memory."""
    return np.ndarray((len(rows), *shape), "<f8", rows, offset, (rows.strides[0], *strides))


def places(names: Sequence[str]) -> list[str]:
    """Return the place of each variable, ``field`` or ``field[index]`` (from 0); raises ValueError."""
    families: dict[str, list[int]] = {}
    for name in names:
        key, index = family(name)
        if index is not None:
            families.setdefault(key, []).append(index)
    first_index = {
        key: min(members)
        for key, members in families.items()
        if sorted(members) == list(range(min(members), min(members) + len(members)))
    }
    taken: set[str] = {"t", "h"}
    field_of: dict[str, str] = {}
    result = []
    for name in names:
        key, index = family(name)
        is_member = index is not None and key in first_index
        label = key if is_member else name
        if label not in field_of:
            field_of[label] = _unique(_identifier(label.replace("[*]", "")), taken)
        elif not is_member:
            raise ValueError(f"the variable '{name}' is listed twice")
        result.append(f"{field_of[label]}[{index - first_index[key]}]" if is_member else field_of[label])  # type: ignore[operator]
    return result


def family(name: str) -> tuple[str, int | None]:
    """Split ``link[3].tension`` into ("link[*].tension", 3); without exactly one index (name, None)."""
    indices = _INDEX.findall(name)
    return (_INDEX.sub("[*]", name), int(indices[0])) if len(indices) == 1 else (name, None)


def _identifier(text: str) -> str:
    """Return ``text`` as a protobuf identifier."""
    word = re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_") or "x"
    return word if word[0].isalpha() else f"x{word}"


def _unique(word: str, taken: set[str]) -> str:
    """Return ``word``, with a number if it is taken; case and underscores are ignored, as in JSON names."""
    candidate, number = word, 1
    while (key := candidate.replace("_", "").lower()) in taken:
        number += 1
        candidate = f"{word}_{number}"
    taken.add(key)
    return candidate


def layout(where: Sequence[str]) -> MessageLayout:
    """Return the layout of a message whose variable i has the place ``where[i]``; raises ValueError."""
    members: dict[str, dict[int | None, int]] = {}
    for variable, place in enumerate(where):
        match = _PLACE.fullmatch(place)
        if match is None:
            raise ValueError(f"'{place}' is not a place in a message")
        index = None if match[2] is None else int(match[2])
        if members.setdefault(match[1], {}).setdefault(index, variable) != variable:
            raise ValueError(f"two variables have the place '{place}'")
    for name, field_members in members.items():
        if set(field_members) not in ({None}, set(range(len(field_members)))):
            raise ValueError(f"the values of the field '{name}' are not counted from 0 to {len(field_members) - 1}")
    counts = {name: 0 if None in field_members else len(field_members) for name, field_members in members.items()}
    names = sorted(members, key=counts.__getitem__)  # stable sort: singles in given order, then families by length
    if len(names) > MAX_FIELDS:
        raise ValueError(f"a message holds {MAX_FIELDS} variables and families, not {len(names)}")
    fields = tuple(Field(name, number, counts[name]) for number, name in enumerate(names, FIRST_NUMBER))
    indices = ((f.name, i if f.length else None) for f in fields for i in range(f.length or 1))
    order = np.array([members[name][index] for name, index in indices], np.intp)
    groups, template = _lay_out(fields)
    starts = np.empty(len(order), np.intp)
    for group in groups:
        of_fields, of_values = group.stride * np.arange(group.shape[0]), 8 * np.arange(group.shape[1])
        places = order[group.first : group.first + group.shape[0] * group.shape[1]]
        starts[places] = (group.offset + of_fields[:, None] + of_values).ravel()
    return MessageLayout(fields, order, groups, starts, template)


def _lay_out(fields: Sequence[Field]) -> tuple[tuple[FieldGroup, ...], bytes]:
    """Return groups of evenly spaced fields, and the bytes of a message of zeros."""
    body = bytearray(_header(Field("t", 1, 0)) + bytes(8) + _header(Field("h", 2, 0)) + bytes(8))
    groups, first = [], 0
    for (size, count), run in groupby(fields, lambda field: (len(_header(field)), field.length)):
        members, width = list(run), count or 1
        groups.append(FieldGroup(first, (len(members), width), len(body) + size, size + 8 * width))
        for field in members:
            body += _header(field) + bytes(8 * width)
        first += len(members) * width
    return tuple(groups), bytes(body)


def _header(field: Field) -> bytes:
    """Return the bytes before a field's values: the tag, and for a family its length in bytes."""
    if field.length == 0:
        return _varint(field.number << 3 | FIXED64)
    return _varint(field.number << 3 | LENGTH_DELIMITED) + _varint(8 * field.length)


def _varint(number: int) -> bytes:
    """Encode an integer as a protobuf varint: base 128, least significant group first."""
    groups = bytearray()
    while number > 0x7F:
        groups.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*groups, number])


def type_name(topic: str) -> str:
    """Return the name of a topic's message type: "/left_track/out" -> "cotrack.left_track.Out"."""
    *package, message = [_identifier(word) for word in topic.strip("/").split("/")]
    return ".".join(["cotrack", *package, message[0].upper() + message[1:]])


def descriptor(name: str, fields: Iterable[Field]) -> bytes:
    """Return a serialised FileDescriptorSet with the message type ``name``, the schema data of MCAP."""
    package, _, message = name.rpartition(".")
    file = FileDescriptorProto(name=f"{name.replace('.', '/')}.proto", package=package, syntax="proto3")
    kind = file.message_type.add(name=message)
    for field in (Field("t", 1, 0), Field("h", 2, 0), *fields):
        label = FieldDescriptorProto.LABEL_REPEATED if field.length else FieldDescriptorProto.LABEL_OPTIONAL
        kind.field.add(name=field.name, number=field.number, type=FieldDescriptorProto.TYPE_DOUBLE, label=label)
    return FileDescriptorSet(file=[file]).SerializeToString(deterministic=True)


def is_descriptor_of(data: bytes, fields: Iterable[Field]) -> bool:
    """Whether a recorded FileDescriptorSet describes exactly these fields."""
    try:
        kind = FileDescriptorSet.FromString(data).file[0].message_type[0]
    except (DecodeError, IndexError):
        return False
    recorded = [(f.name, f.number, f.label == FieldDescriptorProto.LABEL_REPEATED) for f in kind.field]
    return recorded == [("t", 1, False), ("h", 2, False), *((f.name, f.number, f.length > 0) for f in fields)]
