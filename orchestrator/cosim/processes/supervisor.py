"""Processes of FMUs that are not ours, and the thread that watches their calls.

A call goes over a socket; inputs and outputs of a step are in shared memory. Such an FMU may end, hang, print, change
its folder or its rounding mode: the run gets a status Fatal with a sentence, and its own process stays as it is.
Instances of one FMU share a process only when there are more than ``MAX_PROCESSES`` of them. Programs that an FMU has
started end with it, unless they have left the group of the process.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, suppress
from functools import partial
from mmap import ALLOCATIONGRANULARITY, mmap
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.cosim.messages import PRINTED
from orchestrator.cosim.processes.server import LOST, MAX_MESSAGE, pair, receive, send
from orchestrator.files.messages import PROGRESS
from orchestrator.fmi.slave import FATAL, ComponentFailed, LogCallback

try:
    import fcntl
    import resource
except ImportError:  # no POSIX: ``ProcessPool.open`` says what is missing
    fcntl = resource = None  # type: ignore[assignment]

MAX_PROCESSES = 64  # processes of one run
PERIOD = 0.1  # s between two looks at calls that take long
GRACE = 1.0  # s that a call may still take after an interruption
PATIENCE = 4.0  # s of a call until it is reported, then twice as long each time
STARTING = 30.0  # s that a process may take to start, which is no call of the FMU
CLOSING = 2.0  # s that a process may take to end
MAX_SHOWN_LINES = 3  # printed lines of a process that are shown
LAST_LINES = 5  # printed lines that a sentence about the end of a process may quote
MAX_REPLY = 1 << 23  # bytes of a reply beyond those of its request: messages and their form
DESCRIPTORS, SPARE = 5, 32  # open files of an FMU, and of the rest of a run
ROOT = Path(__file__).resolve().parents[3]


class ProcessRequest(NamedTuple):
    """Instance that is to have a process."""

    name: str
    fmu: Path
    alone: bool  # its FMU can be instantiated once per process
    limit: float  # s, longest call


Doing = tuple[str, float | None]  # function, time of the FMU, s
Reply = tuple[int, str, Any, list[tuple[int, str, str]]]  # status, function that failed, value, messages


def words(doing: Doing) -> str:
    """Name of a call, with its time."""
    function, t = doing
    return function if t is None else f"{function} at t = {t:.6g} s"


class SlaveProcess:
    """Process with instances of one FMU. Calls come from one thread at a time."""

    def __init__(self, name: str, limit: float) -> None:
        self.name, self.limit = name, limit
        self.began = 0.0  # s, monotonic time at which the present call began; 0: none
        self.doing: Doing = "", None  # call that is waited for
        self.is_ready = False  # it has made a call
        self.ended = ""  # words on the end of the process
        self.printed: deque[str] = deque(maxlen=LAST_LINES)
        self.log: LogCallback = lambda status, text, category: None
        self._instances = self._open = 0
        self._doing: dict[int, Doing] = {}  # by instance
        self._replies: dict[int, Reply] = {}  # that nobody has waited for yet
        self._sent = 0  # bytes of the largest request
        descriptor = os.memfd_create("fmu", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        fcntl.fcntl(descriptor, fcntl.F_ADD_SEALS, fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_SEAL)  # reading it never fails
        self._memory, self._size = os.fdopen(descriptor, "r+b", 0), 0
        ours, theirs = pair()
        inherited = theirs.fileno(), self._memory.fileno()
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "orchestrator.cosim.processes.server", *map(str, inherited)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            pass_fds=inherited,
            env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, sys.path)])},
            start_new_session=True,  # signals of the terminal come to the run alone
        )
        theirs.close()
        self._connection = ours
        self._listener = threading.Thread(target=self._listen, name="fmu", daemon=True)
        self._listener.start()

    def _listen(self) -> None:
        """Pass on what the process prints."""
        assert self._process.stdout is not None
        heard = 0
        for line in iter(partial(self._process.stdout.readline, MAX_MESSAGE), b""):
            text = line.decode("utf-8", "replace").rstrip()
            if text:
                self.printed.append(text)
                heard += 1
                if heard <= MAX_SHOWN_LINES:
                    self.log(0, text if heard < MAX_SHOWN_LINES else f"{text}; more is not shown", PRINTED)

    def enter(self) -> int:
        """Return the number of a new instance."""
        self._instances += 1
        self._open += 1
        return self._instances

    def memory(self, n: int) -> tuple[NDArray[np.float64], int]:
        """Return n shared doubles, 0, and their place."""
        place = self._size
        self._size += max(-(-8 * n // ALLOCATIONGRANULARITY), 1) * ALLOCATIONGRANULARITY
        self._memory.truncate(self._size)
        shared = mmap(self._memory.fileno(), self._size - place, offset=place)
        return np.frombuffer(shared, np.float64, n), place

    def post(self, number: int, doing: Doing, *request: Any) -> None:
        """Send a call of an instance; ``doing``: for sentences."""
        self._doing[number] = self.doing = doing
        self.began = time.monotonic()
        try:
            if not self.ended:
                self._sent = max(self._sent, send(self._connection, (number, *request)))
        except OSError:
            self._end(doing)
        finally:
            self.began = 0.0

    def take(self, number: int, fits: Callable[[Any], bool]) -> Reply:
        """Wait for the reply to an instance; ``fits``: whether a value is one, where no function has failed."""
        self.doing = self._doing[number]
        self.began = time.monotonic()
        try:
            while number not in self._replies and not self.ended:
                match receive(self._connection, MAX_REPLY + 2 * self._sent):
                    case [int(whose), int(status), str(failed), value, [*messages]] if (
                        whose in self._doing.keys() - self._replies.keys()
                        and abs(status) < 1 << 31
                        and all(isinstance(each, list) and [*map(type, each)] == [int, str, str] for each in messages)
                    ):
                        self._replies[whose], self.is_ready = (status, failed, value, messages), True
                    case _:
                        raise ValueError
            if number in self._replies:
                _, failed, value, _ = self._replies[number]
                if not failed and not fits(value):
                    raise ValueError
        except (OSError, EOFError):
            self._end(self.doing)
        except (ValueError, TypeError, RecursionError):
            self.stop("was answered with what is no reply")
            self._replies.clear()
        except BaseException:  # the reply of this call would be taken for that of the next one
            self.stop("was interrupted")
            raise
        finally:
            self.began = 0.0
        return self._replies.pop(number, None) or (FATAL, self.doing[0], None, [(FATAL, self.ended, "")])

    def has_ended(self) -> bool:
        """Whether the process has ended; until it is waited for, its number is that of no other."""
        with suppress(ChildProcessError):
            return os.waitid(os.P_PID, self._process.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None
        return True

    def kill(self) -> None:
        """End the process and its group, and hang up, because others may hold the other end of the connection."""
        with suppress(OSError):
            if self._process.returncode is None:
                os.killpg(self._process.pid, signal.SIGKILL)
            self._connection.shutdown(socket.SHUT_RDWR)

    def _wait(self) -> int | None:
        """Wait for the end of the process, end its group; return the exit status, None if it did not end by itself."""
        latest = time.monotonic() + CLOSING
        while not (ended := self.has_ended()) and time.monotonic() < latest:
            time.sleep(0.001)
        self.kill()
        code = self._process.wait()
        self._listener.join(CLOSING)
        return code if ended and code != LOST else None

    def _end(self, doing: Doing) -> None:
        """Say how the process has ended, in the call ``doing``."""
        code = self._wait()
        if not self.ended:
            how = "has closed its connection to the run" if code is None else f"has ended with exit status {code}"
            how = f"has ended by {signal.Signals(-code).name}" if code and code < 0 else how
            said = f": {self.printed[-1]}" if self.printed else ""
            self.ended = f"its process {how} in {words(doing)}{said}"

    def stop(self, why: str) -> None:
        """End the process in the middle of a call; ``why``: words behind the name of the call."""
        if not self.ended:
            self.ended = f"{words(self.doing)} {why}"
        self.kill()

    def leave(self) -> None:
        """Note that an instance is freed; the process ends with its last one."""
        self._open -= 1
        if not self._open:
            self.close()

    def close(self) -> None:
        """End the process."""
        if not self._memory.closed:
            self._connection.close()
            self._wait()
            self._memory.close()


class ProcessPool(AbstractContextManager["ProcessPool"]):
    """Processes of a run, and the thread that watches their calls.

    :param signals: returns the number of interrupting signals so far.
    """

    def __init__(self, signals: Callable[[], int] = lambda: 0) -> None:
        self._signals = signals
        self._processes: list[SlaveProcess] = []
        self._closed = threading.Event()
        self._thread: threading.Thread | None = None

    def open(self, wanted: Sequence[ProcessRequest]) -> dict[str, SlaveProcess]:
        """Start the processes of instances, all at once; raises ComponentFailed for too many, and without Linux."""
        if not wanted:
            return {}
        if fcntl is None or not hasattr(os, "memfd_create"):
            name = wanted[0].name
            raise ComponentFailed(f"{name}: processes of FMUs of yours need Linux: set in_process = true")
        sharing = {each.fmu for each in wanted if not each.alone}
        needed = sum(each.alone for each in wanted) + len(sharing)
        if needed > MAX_PROCESSES:
            raise ComponentFailed(
                f"{needed} FMUs need processes of their own, and a run has at most {MAX_PROCESSES}: set"
                " in_process = true"
            )
        files = len(os.listdir("/dev/fd")) + DESCRIPTORS * len(wanted) + SPARE
        if files > (limit := resource.getrlimit(resource.RLIMIT_NOFILE)[0]) >= 0:
            raise ComponentFailed(f"{len(wanted)} FMUs need {files} open files, {limit} are allowed: ulimit -n {files}")
        free = MAX_PROCESSES - needed
        processes: dict[str, SlaveProcess] = {}
        by_fmu: dict[Path, list[SlaveProcess]] = {}
        for each in wanted:
            shared = by_fmu.setdefault(each.fmu, [])
            if each.alone or not shared or free:
                free -= bool(shared) and not each.alone
                processes[each.name] = process = SlaveProcess(each.name, each.limit)
                self._processes.append(process)
                if not each.alone:
                    shared.append(process)
            else:
                processes[each.name] = process = shared.pop(0)
                shared.append(process)
        if self._thread is None:
            self._thread = threading.Thread(target=self._watch, name="fmus", daemon=True)
            self._thread.start()
        return processes

    def __exit__(self, *ended: object) -> None:
        self._closed.set()
        if self._thread is not None:
            self._thread.join()
        for process in self._processes:
            process.close()

    def _watch(self) -> None:
        signals, since = self._signals(), 0.0
        reported: dict[SlaveProcess, float] = {}
        while not self._closed.wait(PERIOD):
            now = time.monotonic()
            count = self._signals()
            if count > signals and not since:
                since = now
            for process in self._processes:
                began = process.began
                if not began:
                    reported.pop(process, None)
                    continue
                if process.has_ended():
                    process.kill()
                waited = now - began
                if since and (now - since > GRACE or count > signals + 1):
                    process.stop("was interrupted")
                elif waited > process.limit + (0.0 if process.is_ready else STARTING):
                    process.stop(f"has not returned within {process.limit:g} s")
                elif waited > reported.get(process, PATIENCE):
                    reported[process] = 2.0 * waited
                    PROGRESS.info("%s: %s has not returned for %.0f s", process.name, words(process.doing), waited)
