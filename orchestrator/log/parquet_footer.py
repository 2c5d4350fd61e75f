"""The footer of a Parquet file that is written one row group at a time, without what pyarrow keeps of every group.

A footer describes each column of each row group (https://github.com/apache/parquet-format, ``parquet.thrift``), in
80 bytes of Thrift's compact protocol; pyarrow keeps 900 bytes of each until the end, and then as much again. Here
every row group is written as a file of its own, whose footer is taken apart: its row group, moved to where it lies in
the whole file, is kept as bytes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

MAGIC = b"PAR1"
ENDING = 4 + len(MAGIC)  # bytes of the footer's length and what follows it
TRUE, FALSE, BYTE, DOUBLE, BINARY, LIST, STRUCT = 1, 2, 3, 7, 8, 9, 12  # kinds of values
INTEGERS = (4, 5, 6)
ROWS, GROUPS = 3, 4  # fields of a footer
COLUMNS, GROUP_ROWS, GROUP_AT, ORDINAL = 1, 3, 5, 7  # of a row group
ABOUT = 3  # of a column
PLACES = (9, 10, 11, 14)  # of what is said about it: where its data, index, dictionary and bloom filter begin
Struct = dict[int, tuple[int, Any]]  # by number of a field its kind and value


class Many(NamedTuple):
    """A list."""

    kind: int
    values: list[Any]


class Footer:
    """What is known of a file as far as it is written."""

    def __init__(self) -> None:
        self._described: Struct = {}
        self._groups: list[bytes] = []
        self._rows = 0

    def add(self, file: memoryview, at: int) -> memoryview:
        """A Parquet file that becomes a part of the whole one, ``at`` bytes from its beginning: its data."""
        size = int.from_bytes(file[-ENDING : -len(MAGIC)], "little")
        described = _struct(_Reader(bytes(file[-ENDING - size : -ENDING])))
        for group in described[GROUPS][1].values:
            _move(group, at - len(MAGIC), len(self._groups))
            self._rows += group[GROUP_ROWS][1]
            self._groups.append(_of_struct(group))
        self._described = self._described or described
        return file[len(MAGIC) : -ENDING - size]

    def content(self) -> bytes:
        """The end of the whole file."""
        described = {**self._described, ROWS: (6, self._rows)}
        whole = _of_struct({**described, GROUPS: (LIST, Many(STRUCT, self._groups))})
        return whole + len(whole).to_bytes(4, "little") + MAGIC


def _move(group: Struct, by: int, number: int) -> None:
    """A row group to another place of another file."""

    def moved(struct: Struct, field: int) -> None:
        if field in struct:
            kind, place = struct[field]
            struct[field] = kind, place + by

    moved(group, GROUP_AT)
    if ORDINAL in group:
        group[ORDINAL] = group[ORDINAL][0], number
    for column in group[COLUMNS][1].values:
        for field in PLACES:
            moved(column[ABOUT][1], field)


class _Reader:
    """Bytes and how far they are read."""

    def __init__(self, content: bytes) -> None:
        self.content, self.at = content, 0

    def take(self, size: int) -> bytes:
        self.at += size
        return self.content[self.at - size : self.at]

    def unsigned(self) -> int:
        value = shift = 0
        while True:
            (byte,) = self.take(1)
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    def signed(self) -> int:
        value = self.unsigned()
        return (value >> 1) ^ -(value & 1)


def _struct(reader: _Reader) -> Struct:
    found: Struct = {}
    number = 0
    while head := reader.take(1)[0]:
        number = number + (head >> 4) if head >> 4 else reader.signed()
        kind = head & 0x0F
        found[number] = kind, None if kind in (TRUE, FALSE) else _value(reader, kind)
    return found


def _value(reader: _Reader, kind: int) -> Any:
    if kind in INTEGERS:
        return reader.signed()
    if kind == STRUCT:
        return _struct(reader)
    if kind == BINARY:
        return reader.take(reader.unsigned())
    if kind == LIST:
        (head,) = reader.take(1)
        of = head & 0x0F
        return Many(of, [_value(reader, of) for _ in range(head >> 4 if head < 0xF0 else reader.unsigned())])
    return reader.take(8 if kind == DOUBLE else 1)


def _of_struct(struct: Struct) -> bytes:
    made = bytearray()
    before = 0
    for number, (kind, value) in sorted(struct.items()):
        step = number - before
        made += bytes([step << 4 | kind]) if step < 16 else bytes([kind]) + _signed(number)
        made += b"" if value is None else _of_value(kind, value)
        before = number
    return bytes(made + b"\0")


def _of_value(kind: int, value: Any) -> bytes:
    if kind in INTEGERS:
        return _signed(value)
    if isinstance(value, bytes):  # as it was read
        return _unsigned(len(value)) + value if kind == BINARY else value
    if kind == STRUCT:
        return _of_struct(value)
    of, values = value
    head = bytes([len(values) << 4 | of]) if len(values) < 15 else bytes([0xF0 | of]) + _unsigned(len(values))
    return head + b"".join(_of_value(of, each) for each in values)


def _unsigned(value: int) -> bytes:
    made = bytearray()
    while value >= 0x80:
        made.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*made, value])


def _signed(value: int) -> bytes:
    return _unsigned(value << 1 if value >= 0 else (-value << 1) - 1)
