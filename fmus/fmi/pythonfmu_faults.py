"""Faults of pythonfmu 0.7.0, and remedies of a slave.

It releases references that it does not own: one of the shell's globals at every instantiation, and one each of class,
instance and log queue whenever an exception leaves a call. `add_references` adds as many, so that a refusal is an
ordinary FMI status, and neither a second refusal nor freeing the instance crashes the process. It also passes queued
messages to the host while an exception is set, and a host in Python may clear it. Python 3.13 prints a SystemError
then: there messages queued before a refusal wait for the next call, and the exception carries the sentence. Messages
are printf formats, and a helper thread outlives the libraries that it needs.
"""

from __future__ import annotations

import ctypes
import sys
from contextlib import suppress
from pathlib import Path

MAX_BYTES = 1500  # bytes of a message: importers have buffers of 2 kB
MESSAGES_WAIT = sys.version_info >= (3, 13)  # where a call is refused
_FINALISED: set[Path] = set()


def printf_format(text: str) -> str:
    """Printf format of a text, as FMI reads messages; the wrapper crashes on invalid UTF-8 and on other formats."""
    cut = text.encode("utf-8", "replace")[:MAX_BYTES].decode("utf-8", "ignore")  # not cut inside a character
    return cut.replace("\0", "").replace("%", "%%")


class RefusedCall(RuntimeError):
    """A call's end for pythonfmu, which logs the repr as a printf format: the repr is the sentence as one line."""

    def __repr__(self) -> str:
        return printf_format(" ".join(str(self).split()))


def add_references(*objects: object) -> None:
    """Add a reference to each object, for pythonfmu to release; a container would keep dangling entries."""
    for item in objects:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(item))


def finalise_at_exit(library: Path) -> None:
    """Register an exit handler that ends the wrapper's helper thread before libraries are unloaded.

    Otherwise an exit may abort: std::thread is destroyed while joinable, or, where that thread started the interpreter
    and has to end it, LLVM is already unloaded. Exit handlers run last in, first out: this one is registered after that
    of LLVM and before any step. The library stays loaded, so that the handler stays valid.
    """
    if library in _FINALISED or not sys.platform.startswith("linux") or not library.exists():
        return
    _FINALISED.add(library)
    with suppress(OSError, AttributeError):  # another libc or wrapper: there is no such thread
        finalise = ctypes.CDLL(str(library)).finalizePythonInterpreter
        ctypes.CDLL(None).__cxa_atexit(finalise, None, None)
