"""File that a log is written to: its place beside an older log, who is writing it, and why it cannot be written."""

from __future__ import annotations

import os
from glob import escape
from itertools import chain, count
from pathlib import Path
from typing import IO

from mcap.writer import MCAP0_MAGIC

from orchestrator.files.budget import open_file
from orchestrator.files.command import is_input
from orchestrator.files.folders import flaw
from orchestrator.files.messages import LOG
from orchestrator.log import notices

try:
    import fcntl
except ImportError:  # Windows locks open files itself
    fcntl = None  # type: ignore[assignment]

RUNNING = ".running"  # in the name of a log whose run has not ended, while there is an older one


class LogFailed(RuntimeError):
    """The log cannot be written; the message is one sentence."""


def prepared_file(path: Path) -> tuple[Path, Path]:
    """Make the folder of a log; return the file it ends as and the one to write: beside an older log, if there is one.

    Logs a warning for each file that a killed run has left. Raises LogFailed, OSError.
    """
    check_writable(path)
    target = target_of(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    for file in left_behind(target):
        LOG.warning(notices.left_behind(file))
    return target, beside(target) if target.is_file() else target


def check_writable(path: Path) -> None:
    """Raise LogFailed if a log cannot be written to ``path``, as far as can be known in advance."""
    problem = ""
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:  # a name that is too long, a folder that cannot be searched
        raise log_failed(path, error) from None
    written = target_of(path)
    if path.is_dir():
        problem = "it is a directory"
    elif written.is_symlink():
        problem = "it is a link that leads to itself"
    elif path.exists() and not path.is_file():
        problem = "it is a device or a pipe, which cannot be read again"
    elif is_input(path):
        problem = "it is a file that is read"
    elif any(_held(file) for file in _running_files(path)):
        problem = "another run is writing it"
    elif path.is_file():
        try:
            with path.open("rb") as stream:
                if not MCAP0_MAGIC.startswith(stream.read(len(MCAP0_MAGIC))):
                    problem = "there is a file that is no log"
                elif being_written(stream):
                    problem = "another run is writing it"
        except OSError as error:
            raise log_failed(path, error) from None
    if problem := problem or flaw(written.parent):
        raise LogFailed(f"the log {path} cannot be written: {problem}")


def target_of(path: Path) -> Path:
    """Return the file that is written for the log ``path``: the target of a link, which need not exist."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def growing_log(path: Path) -> Path:
    """Return the file that a run is writing now for the log ``path``: beside it while there is an older log."""
    return next((file for file in _running_files(path) if _held(file)), path)


def left_behind(path: Path) -> list[Path]:
    """Return the files beside the log ``path`` that killed runs have left."""
    return [file for file in _running_files(path) if not _held(file)]


def beside(path: Path) -> Path:
    """Return a new name beside the log ``path``, for a run that will replace it."""
    ends = chain([""], (f"-{number}" for number in count(2)))
    names = (path.with_name(f"{path.stem}{RUNNING}{end}{path.suffix}") for end in ends)
    return next(name for name in names if not name.exists())


def _running_files(path: Path) -> list[Path]:
    path = target_of(path)
    files = path.parent.glob(f"{escape(path.stem + RUNNING)}*{escape(path.suffix)}")
    return sorted(file for file in files if file.is_file())


def _held(path: Path) -> bool:
    """Whether a recorder has the file open."""
    try:
        with open_file(path) as stream:
            return being_written(stream)
    except OSError:
        return False


def lock(stream: IO[bytes]) -> bool:
    """Lock the file until it is closed; return False if another process holds the lock."""
    if fcntl is not None:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:  # a file system without locks
            pass
    return True


def being_written(stream: IO[bytes]) -> bool:
    """Whether a recorder holds the lock of the file."""
    if fcntl is not None:
        try:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
            fcntl.flock(stream, fcntl.LOCK_UN)
        except BlockingIOError:
            return True
        except OSError:  # a file system without locks
            pass
    return False


def log_failed(path: Path, error: BaseException) -> LogFailed:
    """Return the LogFailed for a log that cannot be written."""
    return LogFailed(f"the log {path} cannot be written: {error_text(error)}")


def error_text(error: BaseException) -> str:
    """Return the reason of a file error as the end of a sentence."""
    text = (error.strerror or str(error)) if isinstance(error, OSError) else f"{type(error).__name__}: {error}"
    return text[:1].lower() + text[1:]
