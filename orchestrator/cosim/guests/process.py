"""Process of a guest: ``python -m orchestrator.cosim.guests.process CONNECTION MEMORY``, two file descriptors.

It makes the calls of FMI 2.0 that come over the connection, one after another, and replies with the status, the
function that failed, its arguments as the FMU has left them, and the messages of the FMU. Inputs and outputs of a step
are in the shared memory. It ends with the connection, also if the FMU never returns.

Objects go over a socket that keeps the bounds of packets, which takes one system call each way.
"""

from __future__ import annotations

import os
import select
import signal
import socket
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from ctypes import c_char, c_char_p, c_double, c_uint, cast
from mmap import mmap
from pathlib import Path
from pickle import dumps, loads
from typing import Any

from orchestrator.cosim import fmi2_library
from orchestrator.cosim.guests.fmi3 import Fmi3
from orchestrator.cosim.messages import FATAL, WARNING

PACKET = 1 << 16  # bytes
_MORE, _LAST = b"+", b"."  # first byte of a packet


def pair() -> tuple[socket.socket, socket.socket]:
    """Two connected ends."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)


def send(end: socket.socket, content: Any) -> None:
    """Send an object; raises OSError if the other end is closed."""
    data = dumps(content)
    while len(data) > PACKET:
        end.sendall(_MORE + data[:PACKET])
        data = data[PACKET:]
    end.sendall(_LAST + data)


def receive(end: socket.socket) -> Any:
    """Receive an object; raises EOFError if the other end is closed, OSError."""
    parts = []
    while True:
        packet = end.recv(PACKET + 1)
        if not packet:
            raise EOFError
        parts.append(packet[1:])
        if packet[:1] == _LAST:
            return loads(b"".join(parts) if len(parts) > 1 else parts[0])


Failing = tuple[int, str]  # status, function that failed or ""
Buffers = list[Any]


class Guest:
    """Instance with its exchange through the shared memory."""

    def __init__(self, memory: int, opening: dict[str, Any]) -> None:
        self.messages: list[tuple[int, str, str]] = []
        folder, identifier = Path(opening["folder"]), opening["identifier"]
        given = folder, opening["name"], opening["guid"], lambda *message: self.messages.append(message)
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
        messages = guest.messages if guest else []
        send(connection, (number, *failing, result, messages))
        messages.clear()


def _end_with(descriptor: int) -> None:
    """End this process, whatever it does, when the other end of the connection is closed."""
    poll = select.poll()
    poll.register(descriptor, select.POLLRDHUP)
    poll.poll()
    os._exit(0)


def main(descriptor: str, memory: str) -> None:
    """Serve until the connection ends."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):  # the run decides when a guest ends
        signal.signal(number, signal.SIG_IGN)
    for stream in (sys.stdout, sys.stderr):  # the process may end without a flush
        stream.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    connection = socket.socket(fileno=int(descriptor))
    threading.Thread(target=_end_with, args=(int(descriptor),), daemon=True).start()
    with suppress(EOFError, OSError):
        serve(connection, int(memory))
    os._exit(0)  # no clean-up of the interpreter: libraries of FMUs end badly in it


if __name__ == "__main__":
    main(*sys.argv[1:])
