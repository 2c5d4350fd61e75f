"""Process of FMUs that are not ours: ``python -m orchestrator.cosim.processes.server CONNECTION MEMORY``.

Both arguments are file descriptors.
It calls the methods of slaves that come over the connection, one after another, and replies with the status, the
function that failed, the result, and the messages of the FMU. Inputs and outputs of a step are in the shared memory.
It ends with the connection, also if the FMU never returns, and ends what it has started.

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
from contextlib import suppress
from json import JSONDecoder, JSONEncoder
from mmap import mmap
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from orchestrator.fmi import fmi2, fmi3
from orchestrator.fmi.slave import FATAL, OK, WARNING, Exchange, NotInstantiated, Opening, failed, worse

PACKET = 1 << 16  # bytes
MAX_MESSAGES, MAX_MESSAGE = (
    100,
    2000,
)  # messages of a call that are errors or not, and characters of each, that are passed on
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
        if self._counts[alike] <= MAX_MESSAGES:
            self._kept.append((status, text[:MAX_MESSAGE], category))

    def take(self) -> list[tuple[int, str, str]]:
        """Return the messages, after them the number of those left out."""
        kept, left_out = self._kept, sum(self._counts) - len(self._kept)
        self._kept, self._counts = [], [0, 0]
        return [*kept, (WARNING, f"{left_out} further messages left out", "")] if left_out else kept


SLAVES: dict[str, ModuleType] = {"2.0": fmi2, "3.0": fmi3}


class Served:
    """Slave of this process, whose methods the run calls by name; states and exchanges have numbers there."""

    def __init__(self, memory: int, opening: dict[str, Any], messages: Messages) -> None:
        made = Opening(**opening)
        module = SLAVES[made.version]
        self._slave = module.Slave(module.load(Path(made.folder), made.identifier), made, messages)
        self._memory, self._whole = memory, np.int32 if made.version == "2.0" else np.int64
        self._exchanges: list[tuple[Exchange, Any]] = []  # with their values
        self._with_steps: list[Exchange] = []
        self._states: dict[int, Any] = {}
        self._known = 0  # number of the last state

    @property
    def failed(self) -> str:
        """Function of FMI that failed last."""
        return str(self._slave.failed)

    def exchange(self, kind: Any, references: list[int], place: int | None, with_steps: bool) -> int:
        """Make an exchange; ``place``: of its values in the shared memory, in bytes."""
        values: Any = [b""] * len(references)
        if place is not None:
            values = np.frombuffer(mmap(self._memory, 0), np.float64, len(references), place)
        elif kind != "String":
            values = np.zeros(len(references), np.float64 if kind == "Real" else self._whole)
        made = self._slave.exchange(kind, references, values)
        self._exchanges.append((made, values))
        self._with_steps += [made] * with_steps
        return OK

    def set(self, number: int, content: Any = None) -> int:
        """Set the values of an exchange; None: those in the shared memory."""
        exchange, values = self._exchanges[number]
        if content is not None:
            values[:] = content if isinstance(content, list) else np.frombuffer(content, values.dtype)
        return exchange.set()

    def get(self, number: int, is_shared: bool) -> tuple[int, Any]:
        """Get the values of an exchange; the result is a list of them as bytes, or of texts."""
        exchange, values = self._exchanges[number]
        status = exchange.get()
        if is_shared:
            return status, None
        return status, values if isinstance(values, list) else [values.tobytes()]

    def step(self, t: float, h: float, no_rollback: bool) -> int:
        """Step, then get what goes with steps."""
        status = self._slave.step(t, h, no_rollback)
        for exchange in self._with_steps:
            if not failed(status):
                status = worse(status, exchange.get())
        return int(status)

    def save(self) -> tuple[int, int]:
        """Save the state; the result is its number."""
        return self._numbered(*self._slave.save())

    def load(self, content: bytes) -> tuple[int, int]:
        """Restore the state of these bytes; the result is that of ``save``."""
        return self._numbered(*self._slave.load(content))

    def _numbered(self, status: int, state: Any) -> tuple[int, int]:
        self._known += 1
        self._states[self._known] = state
        return status, self._known

    def restore(self, number: int) -> int:
        """Restore a saved state."""
        return int(self._slave.restore(self._states[number]))

    def discard(self, number: int) -> int:
        """Release a saved state."""
        return int(self._slave.discard(self._states.pop(number)))

    def dump(self, number: int) -> tuple[int, bytes]:
        """Serialise a saved state."""
        status, content = self._slave.dump(self._states[number])
        return int(status), content

    def discarded(self) -> tuple[int, list[Any]]:
        """See ``fmi.slave.Slave``."""
        return OK, [*self._slave.discarded()]

    def __getattr__(self, method: str) -> Any:
        """Method of the slave."""
        return getattr(self._slave, method)


def serve(connection: socket.socket, memory: int) -> None:
    """Make all calls until the connection ends."""
    slaves: dict[int, Served] = {}
    messages: dict[int, Messages] = {}
    while True:
        number, written, method, *arguments = receive(connection)
        log, status, function = messages.setdefault(number, Messages()), OK, ""
        result: Any = None
        try:
            if number not in slaves:
                with suppress(NotInstantiated):
                    slaves[number] = Served(memory, arguments[0], log)
                result = number in slaves
            else:
                served = slaves[number]
                for exchange in written:
                    status = worse(status, served.set(exchange))
                if not failed(status):
                    done = getattr(served, method)(*arguments)
                    found, result = done if isinstance(done, tuple) else (done, None)
                    status = worse(status, int(found))
                function = served.failed if failed(status) else ""
        except Exception as error:
            status, function, result = FATAL, method, f"{type(error).__name__}: {error}"
        send(connection, (number, status, function, result, log.take()))


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
