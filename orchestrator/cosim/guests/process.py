"""Process of a guest: ``python -m orchestrator.cosim.guests.process CONNECTION MEMORY``, two file descriptors.

It makes the calls of FMI 2.0 that come over the connection, one after another, and replies with the status, the
function that failed, its arguments as the FMU has left them, and the messages of the FMU. Inputs and outputs of a step
are in the shared memory. It ends with the connection, also if the FMU never returns, and ends what it has started.

Objects go over a socket that keeps the bounds of packets, which takes one system call each way. They are JSON, which
cannot hold code, with bytes in base64.
"""

from __future__ import annotations

import errno
import os
import select
import signal
import socket
import sys
import threading
from base64 import b64decode, b64encode
from collections.abc import Sequence
from ctypes import c_char, c_char_p, c_double, c_uint, cast
from json import JSONDecoder, JSONEncoder
from mmap import mmap
from pathlib import Path
from typing import Any

from orchestrator.cosim import fmi2_library
from orchestrator.cosim.guests.fmi3 import Fmi3
from orchestrator.cosim.messages import FATAL, WARNING

PACKET = 1 << 16  # bytes
MOST, LONGEST = 100, 2000  # messages of a call that are errors or not, and characters of each, that are passed on
LOST = os.EX_IOERR  # exit status where the FMU has closed the descriptors of the connection
_MORE, _LAST = b"+", b"."  # first byte of a packet


def pair() -> tuple[socket.socket, socket.socket]:
    """Two connected ends."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)


_encode = JSONEncoder(default=lambda content: {"base64": b64encode(content).decode()}).encode
_decode = JSONDecoder(object_hook=lambda table: b64decode(table["base64"]) if "base64" in table else table).decode


def send(end: socket.socket, content: Any) -> int:
    """Send an object; returns its size in bytes; raises OSError if the other end is closed."""
    data = _encode(content).encode()
    size = len(data)
    while len(data) > PACKET:
        end.sendall(_MORE + data[:PACKET])
        data = data[PACKET:]
    end.sendall(_LAST + data)
    return size


def receive(end: socket.socket, most: int = sys.maxsize) -> Any:
    """Receive an object of ``most`` bytes; raises EOFError if the other end is closed, OSError, ValueError."""
    parts, size = [], 0
    while True:
        packet = end.recv(PACKET + 1)
        if not packet:
            raise EOFError
        parts.append(packet[1:])
        size += len(packet)
        if size > most:
            raise ValueError("too large")
        if packet[:1] == _LAST:
            return _decode(b"".join(parts).decode())


class Messages:
    """Messages of an FMU since they were taken last: the first ones, and the number of those left out."""

    def __init__(self) -> None:
        self._kept: list[tuple[int, str, str]] = []
        self._counts = [0, 0]

    def __call__(self, status: int, text: str, category: str) -> None:
        """Keep a message if there is room for it."""
        alike = status > WARNING
        self._counts[alike] += 1
        if self._counts[alike] <= MOST:
            self._kept.append((status, text[:LONGEST], category))

    def take(self) -> list[tuple[int, str, str]]:
        """Return the messages, after them the number of those left out."""
        kept, left_out = self._kept, sum(self._counts) - len(self._kept)
        self._kept, self._counts = [], [0, 0]
        return [*kept, (WARNING, f"{left_out} further messages left out", "")] if left_out else kept


Failing = tuple[int, str]  # status, function that failed or ""
Buffers = list[Any]


class Guest:
    """Instance with its exchange through the shared memory."""

    def __init__(self, memory: int, opening: dict[str, Any]) -> None:
        self.messages = Messages()
        folder, identifier = Path(opening["folder"]), opening["identifier"]
        given = folder, opening["name"], opening["guid"], self.messages
        self.library: Any
        if opening["version"] == "2.0":
            self.library = fmi2_library.load(folder, identifier)
            self.handle, self.free = fmi2_library.instantiate(self.library, *given)
        else:
            self.library = Fmi3(folder, identifier, opening["elements"])
            self.handle, self.free = self.library.instantiate(*given)
        self._memory = mmap(memory, 0)
        self._u, self._y = (self._shared(*opening[name]) for name in ("inputs", "outputs"))

    def _shared(self, references: Sequence[int], place: int) -> tuple[Any, int, Any]:
        """References, number and values of Reals in the shared memory."""
        n = len(references)
        return (c_uint * n)(*references), n, (c_double * max(n, 1)).from_buffer(self._memory, place)

    def call(self, function: str, *arguments: Any) -> Failing:
        """Make a call with arguments of its C types."""
        status = int(getattr(self.library, function)(self.handle, *arguments))
        return status, "" if 0 <= status <= WARNING else function

    def write(self) -> Failing:
        """Set the inputs of the memory."""
        return self.call("fmi2SetReal", *self._u) if self._u[1] else (0, "")

    def read(self) -> Failing:
        """Get the outputs into the memory."""
        return self.call("fmi2GetReal", *self._y) if self._y[1] else (0, "")

    def step(self, *arguments: Any) -> Failing:
        """Step, then read."""
        stepped = self.call("fmi2DoStep", *arguments)
        if stepped[1]:
            return stepped
        read = self.read()
        return max(stepped, read) if not read[1] else read

    def close(self) -> Failing:
        """Free the instance."""
        self.free()
        return 0, ""

    def converted(self, function: str, arguments: Sequence[Any]) -> tuple[list[Any], Buffers]:
        """Arguments of C types, and the buffers in which the FMU finds and leaves values."""
        kinds = getattr(getattr(self.library, function), "argtypes", None) or [None] * (len(arguments) + 1)
        made, buffers = [], []
        for argument, kind in zip(arguments, kinds[1:], strict=True):
            if isinstance(argument, bytes | list):
                content = (c_char_p * len(argument)) if isinstance(argument, list) else (c_char * len(argument))
                buffer = content(*argument) if isinstance(argument, list) else content.from_buffer_copy(argument)
                buffers.append(buffer)
                argument = buffer if kind is None or isinstance(argument, list) else cast(buffer, kind)
            made.append(argument)
        return made, buffers


def _content(buffer: Any) -> bytes | list[bytes]:
    return [text or b"" for text in buffer] if buffer._type_ is c_char_p else bytes(buffer)


def serve(connection: socket.socket, memory: int) -> None:
    """Make all calls until the connection ends."""
    guests: dict[int, Guest] = {}
    while True:
        number, written, function, *arguments = receive(connection)
        guest = guests.get(number)
        result: Any = None
        try:
            if guest is None:
                guest = guests[number] = Guest(memory, *arguments)
                failing, result = (0, ""), bool(guest.handle)
            else:
                failing = guest.write() if written else (0, "")
                if not failing[1] and hasattr(Guest, function):
                    failing = getattr(guest, function)(*arguments)
                elif not failing[1]:
                    made, buffers = guest.converted(function, arguments)
                    failing = guest.call(function, *made)
                    result = [_content(buffer) for buffer in buffers]
        except Exception as error:
            failing, result = (FATAL, function), f"{type(error).__name__}: {error}"
        send(connection, (number, *failing, result, guest.messages.take() if guest else []))


def _end_with(descriptor: int) -> None:
    """End this process, whatever it does, and its group when the other end of the connection is closed."""
    poll = select.poll()
    poll.register(descriptor, select.POLLRDHUP)
    poll.poll()
    os.killpg(0, signal.SIGKILL)


def main(descriptor: str, memory: str) -> None:
    """Serve until the connection ends."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):  # the run decides when a guest ends
        signal.signal(number, lambda *_: None)  # programs that it starts do not inherit a handler
    for inherited in (descriptor, memory):
        os.set_inheritable(int(inherited), False)
    for stream in (sys.stdout, sys.stderr):  # the process may end without a flush
        stream.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    connection = socket.socket(fileno=int(descriptor))
    threading.Thread(target=_end_with, args=(int(descriptor),), daemon=True).start()
    try:
        serve(connection, int(memory))
    except (EOFError, OSError) as error:
        if getattr(error, "errno", None) in (errno.EBADF, errno.ENOTSOCK):
            os._exit(LOST)  # no clean-up of the interpreter: libraries of FMUs end badly in it
    os.killpg(0, signal.SIGKILL)


if __name__ == "__main__":
    main(*sys.argv[1:])
