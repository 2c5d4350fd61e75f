"""A command in a child process of its own, with limits, and what is wrong about the way it ended.

The process that plays cases has loaded everything that commands need, kernels included, and forks for each case. A case
then costs some milliseconds, and a signal, a hang or all memory cost one case only. Needs Linux.
"""

from __future__ import annotations

import faulthandler
import gc
import io
import json
import logging
import os
import re
import resource
import runpy
import select
import shutil
import signal
import subprocess
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from orchestrator.cli import main

CPU, WALL, STARTING = 4, 5, 60  # s of processor time, and of sleep, until a case counts as hanging; to fill a cache
PERIOD = 0.25  # s between two looks at a case
MEMORY = 700 << 20  # bytes of address space beyond what this process has
FILES = 100 << 20  # bytes of a file
MAX_SENTENCE = 400  # characters of a sentence
STATUSES = (0, 1, 2, 3)
FAILED = 99  # exit status of a case whose own check has failed
PARTIAL = re.compile(r"\.[0-9a-f]{8,32}$|\.tmp$|\.part$")  # names of files that are being written
# lines of a command that goes on
PROGRESS = re.compile(r"\.\.\. |\d+/\d+ |\d+ rows, \d+ not as they should be(, \d+ miss checks of the scene)?$")
USAGE = re.compile(r"Usage: |Try |\s*$")  # lines of click about the command line


class Ended(NamedTuple):
    """End of a case."""

    status: int  # negative: number of a signal
    out: str
    err: str
    cpu: float  # s
    made: tuple[str, ...]  # files that were not there before


def command(arguments: list[str]) -> Callable[[], None]:
    """Action of a case: a command line of ``cotrack``."""

    def act() -> None:
        sys.argv = ["cotrack", *arguments]
        main()

    return act


def play(action: Callable[[], None], folder: Path, cpu: int = CPU, wall: int = WALL) -> Ended:
    """Do something in a child process, in a folder, under limits of time, memory and file size."""
    before = set(_files(folder))
    out, err = folder.with_suffix(".out"), folder.with_suffix(".err")
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        _live(action, folder, (out, err), cpu)
    _end_if_asleep(child, wall)
    _, status, used = os.wait4(child, 0)
    with suppress(ProcessLookupError, PermissionError):  # children of the child
        os.killpg(child, signal.SIGKILL)
    said, told = (file.read_text(encoding="utf-8", errors="replace")[:200_000] for file in (out, err))
    made = tuple(sorted(set(_files(folder)) - before))
    return Ended(os.waitstatus_to_exitcode(status), said, told, used.ru_utime + used.ru_stime, made)


def _live(action: Callable[[], None], folder: Path, streams: tuple[Path, Path], cpu: int) -> None:
    """Life of the child process: it never returns."""
    code = 70
    try:
        gc.disable()
        faulthandler.disable()
        logging.getLogger().handlers.clear()  # they write to this process's streams of before
        os.setsid()
        os.chdir(folder)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        for number, file in enumerate(streams, 1):
            os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
        sys.stdout, sys.stderr = (io.TextIOWrapper(io.FileIO(number, "w"), "utf-8") for number in (1, 2))
        size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        for limit, value in (
            (resource.RLIMIT_CPU, cpu), (resource.RLIMIT_AS, size + MEMORY), (resource.RLIMIT_FSIZE, FILES),
            (resource.RLIMIT_CORE, 0),
        ):  # fmt: skip
            resource.setrlimit(limit, (value, value))
        action()
        code = 0
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except AssertionError as wrong:
        print(f"wrong: {wrong}", file=sys.stderr)
        code = FAILED
    except BaseException:
        traceback.print_exc()
    finally:
        with suppress(Exception):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def _end_if_asleep(child: int, wall: int) -> None:
    """Wait for the end of a process; end it if it and its children sleep for ``wall`` s: a busy machine is no sleep."""
    descriptor, asleep = os.pidfd_open(child), 0
    while not select.select([descriptor], [], [], PERIOD)[0]:
        asleep = asleep + 1 if _sleeps(child) else 0
        if asleep * PERIOD > wall:
            os.killpg(child, signal.SIGALRM)
    os.close(descriptor)


def _sleeps(group: int) -> bool:
    """Whether all processes of a group sleep."""
    states = []
    for file in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, _, leader = file.read_text(errors="replace").rpartition(")")[2].split()[:3]
            states += [state] * (int(leader) == group)
    return set(states) <= {"S"}


def _files(folder: Path) -> Iterator[str]:
    for place, _, names in os.walk(folder):
        yield from (os.path.relpath(os.path.join(place, name), folder) for name in names)


def describe_by_fork() -> None:
    """Let FMUs be described in forks of this process: a new interpreter would take two seconds for each."""
    import pythonfmu.builder  # noqa: F401

    import fmus.fmi.build
    from orchestrator.cli import inventory

    class Forked:
        @staticmethod
        def run(arguments: list[str], **how: Any) -> subprocess.CompletedProcess[str]:
            reading, writing = os.pipe()
            child = os.fork()
            if child == 0:
                os.dup2(writing, 2)
                _describe(how)
            os.close(writing)
            with open(reading, encoding="utf-8") as stream:
                text = stream.read()
            return subprocess.CompletedProcess(arguments, os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), "", text)

    fmus.fmi.build.subprocess = Forked  # type: ignore[assignment]
    inventory.evaluated = lambda scene, assembly: iter(())  # the kernels that a scene uses, from a new interpreter


def _describe(how: Mapping[str, Any]) -> None:
    code = 1
    try:
        os.chdir(how["cwd"])
        os.environ.update(how["env"])
        sys.stdin, sys.stdout = io.StringIO(how["input"]), io.StringIO()
        sys.stderr = io.TextIOWrapper(io.FileIO(2, "w"), "utf-8", errors="backslashreplace")
        for name in [name for name in sys.modules if name.split(".")[0] == "fmus"]:
            del sys.modules[name]
        sys.path.insert(0, str(how["cwd"]))
        runpy.run_module("fmus.fmi.build", run_name="__main__")
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(code)


def wrongs(ended: Ended, refusal_is_alone: bool = True) -> list[str]:
    """Sentences about what a command must not do.

    ``refusal_is_alone``: bad input has one sentence, without notices beside it, and leaves no file.
    """
    if ended.status < 0:
        name = signal.Signals(-ended.status).name
        late = dict.fromkeys(("SIGKILL", "SIGXCPU"), f"more than {CPU} s of a processor: {ended.cpu:.2g} s")
        late["SIGALRM"] = f"waits for more than {WALL} s"
        return [f"hang: {late[name]}" if name in late else f"signal: {name}"]
    if ended.status == FAILED:
        return [ended.err.splitlines()[-1]]
    said = ended.err.splitlines()
    beginnings = ("cotrack: ", "Error: ") if ended.status == 2 else ("cotrack: ",)  # typer's about the command line
    sentences = [line.partition(": ")[2] for line in said if line.startswith(beginnings)]
    found = []
    if ended.status not in STATUSES:
        found.append(f"exit status {ended.status}: {said[-1] if said else ''}")
    found += [f"traceback: {said[-1]}" for line in said[:1000] if line.startswith("Traceback")]
    found += [f"internal error: {text}" for text in sentences if "internal error" in text]
    found += [f"a sentence of {len(text)} characters: {text}" for text in sentences if len(text) > MAX_SENTENCE]
    others = [line for line in said if not line.startswith(beginnings) and not PROGRESS.match(line)]
    if ended.status == 2:
        others = [line for line in others if not USAGE.match(line)]
    found += [f"stderr has: {line}" for line in others[:1] if not any(text.startswith("traceback") for text in found)]
    if ended.status and not (said or ended.out):
        found.append(f"status {ended.status} without a word")
    if ended.status == 2 and refusal_is_alone:
        if len(sentences) > 1:
            found.append(f"{len(sentences)} sentences: {sentences[0]} {sentences[1]}")
        found += [f"bad input leaves the file {name}" for name in ended.made[:1]]
    found += [f"a partial file is left: {name}" for name in ended.made if PARTIAL.search(name)][:1]
    return found + _not_numbers(ended)


def _not_numbers(ended: Ended) -> list[str]:
    """Numbers that are not finite in the object of a run that is ok."""
    lines = ended.out.splitlines()
    if ended.status != 0 or not lines or not lines[-1].startswith("{"):
        return []
    odd: list[str] = []

    def hooked(text: str) -> float:
        odd.append(text)
        return 0.0

    with suppress(ValueError):
        answer = json.loads(lines[-1], parse_constant=hooked)
        if odd and answer.get("status") == "ok":
            return [f"{odd[0]} in the answer of a run that is ok"]
    return []


def signature(wrong: str) -> str:
    """A wrong without its names and numbers, so that equal ones are counted as one find."""
    if call := re.search(r": ([a-z ]+) .* in Machine\(phase='(\w+)'.*?\) (has status \d|\w+)", wrong):
        return " ".join(call.groups())
    text = re.sub(r"'[^']*'|\"[^\"]*\"|[\w.-]*/[^\s:,]*|[\w]*\d[\w.+-]*|[^\x20-\x7e]+", "#", wrong[:2000])
    return re.sub(r"(#[\s,;:.]*)+", "# ", text)[:110].strip()


def emptied(folder: Path) -> Path:
    """A folder without content."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder
