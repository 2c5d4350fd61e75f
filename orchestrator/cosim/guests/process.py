"""Process of a guest: ``python -m orchestrator.cosim.guests.process CONNECTION MEMORY``, two file descriptors.

It makes the calls that come over the connection, one after another, and replies with the FMI status, the function that
failed, a value, and the messages of the FMU. Inputs and outputs of a step are in the shared memory. It ends with the
connection, also if the FMU never returns.
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
from ctypes import c_char_p
from mmap import mmap
from pathlib import Path
from types import ModuleType
from typing import Any

from orchestrator.cosim.guests import fmi2, fmi3, packets

VERSIONS: dict[str, ModuleType] = {"2.0": fmi2, "3.0": fmi3}
_WARNING, _FATAL = 1, 4  # FMI status
Reply = tuple[int, str, Any]  # status, function that failed, value


class Guest:
    """Instance with its exchange through the shared memory."""

    def __init__(self, memory: int, opening: dict[str, Any]) -> None:
        self.messages: list[tuple[int, str, str]] = []
        self._fmi = VERSIONS[opening["version"]]
        self._instance = self._fmi.Instance(
            Path(opening["folder"]), opening["identifier"], opening["name"], opening["guid"], opening["elements"],
            lambda *message: self.messages.append(message),
        )  # fmt: skip
        (inputs, at), (outputs, to) = opening["inputs"], opening["outputs"]
        self._memory = mmap(memory, 0)
        self._inputs = self._instance.group("Real", inputs, self._memory, at) if inputs else None
        self._outputs = self._instance.group("Real", outputs, self._memory, to) if outputs else None
        self.handle = self._instance.handle

    def _status(self, status: int, function: str, value: Any = None) -> Reply:
        return status, "" if 0 <= status <= _WARNING else f"{self._fmi.PREFIX}{function}", value

    def write(self) -> Reply:
        """Set the inputs of the memory."""
        return self._set("Real", self._inputs) if self._inputs else (0, "", None)

    def read(self) -> Reply:
        """Get the outputs into the memory."""
        return self._get("Real", self._outputs) if self._outputs else (0, "", None)

    def _set(self, kind: str, group: tuple[Any, ...]) -> Reply:
        return self._status(self._instance.set(kind, group), f"Set{self._fmi.WORDS[kind]}")

    def _get(self, kind: str, group: tuple[Any, ...], value: Any = None) -> Reply:
        return self._status(self._instance.get(kind, group), f"Get{self._fmi.WORDS[kind]}", value)

    def step(self, t: float, h: float, no_rollback: bool) -> Reply:
        """Step, then read."""
        status = self._instance.step(t, h, no_rollback)
        reply = self._status(status, "DoStep")
        if reply[1]:
            return reply
        read = self.read()
        return read if read[1] else (max(status, read[0]), "", None)

    def get(self, kind: str, references: Sequence[int]) -> Reply:
        """Get variables."""
        group = self._instance.group(kind, references)
        status, function, _ = self._get(kind, group)
        values = group[-1]
        return status, function, [text or b"" for text in values] if kind == "String" else bytes(values)

    def set(self, kind: str, references: Sequence[int], values: Any) -> Reply:
        """Set variables."""
        group = self._instance.group(kind, references)
        if kind == "String":
            group[-1][:] = [c_char_p(value) for value in values]
        else:
            memoryview(group[-1]).cast("B")[:] = values
        return self._set(kind, group)

    def call(self, function: str) -> Reply:
        """Make a call without arguments."""
        return self._status(self._instance.call(function), function)

    def setup(self, start: float, stop: float | None) -> Reply:
        """Set times, s."""
        return self._status(self._instance.setup(start, stop), "SetupExperiment")

    def enter(self) -> Reply:
        """Enter initialisation mode."""
        return self._status(self._instance.enter(), "EnterInitializationMode")

    def outcome(self) -> Reply:
        """Outcome of a discarded step."""
        return 0, "", self._instance.outcome()

    def state(self, work: str, *arguments: Any) -> Reply:
        """Save, restore, release, dump or undump a state."""
        names = {"save": "GetFMUstate", "restore": "SetFMUstate", "release": "FreeFMUstate"}
        names |= {"dump": "SerializeFMUstate", "undump": "DeSerializeFMUstate"}
        found = getattr(self._instance, work)(*arguments)
        status, value = found if isinstance(found, tuple) else (found, None)
        return self._status(status, names[work], value)

    def free(self) -> Reply:
        """Free the instance."""
        self._instance.free()
        return 0, "", None


def serve(connection: socket.socket, memory: int) -> None:
    """Make all calls until the connection ends."""
    guests: dict[int, Guest] = {}
    while True:
        number, written, call, *arguments = packets.receive(connection)
        guest = guests.get(number)
        try:
            if guest is None:
                guest = guests[number] = Guest(memory, *arguments)
                reply: Reply = 0, "", bool(guest.handle)
            else:
                reply = guest.write() if written else (0, "", None)
                if not reply[1]:
                    reply = getattr(guest, call)(*arguments)
        except Exception as error:
            reply = _FATAL, call, f"{type(error).__name__}: {error}"
        messages = guest.messages if guest else []
        packets.send(connection, (number, *reply, messages))
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
