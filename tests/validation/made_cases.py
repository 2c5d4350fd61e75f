"""Cases of `test_studies.py` for processes of their own; it imports little, because each of them imports it."""

from __future__ import annotations

import math
import os
import signal
import time
from pathlib import Path

import numpy as np

from orchestrator.files.messages import PROGRESS, RUN
from orchestrator.studies import Case, Row
from tests.validation.compared import checked


def adds() -> list[Row]:
    return [checked("0", "added", 0.1 + 0.2, 0.3, 1e-12)]


def raises() -> list[Row]:
    raise ValueError("no equilibrium | found")


def overflows() -> list[Row]:
    return [checked("0", "overflown", float(np.float64(1e308) * np.array(10.0)), math.inf, 0.1)]


def talks() -> list[Row]:
    PROGRESS.info("components are built")
    RUN.warning("a spring creaks")
    return []


def dies() -> list[Row]:
    os._exit(3)


def sleeps() -> list[Row]:
    time.sleep(60)
    return []


def counts(folder: Path) -> list[Row]:
    """Leaves a trace of every time it is measured."""
    (folder / str(len(list(folder.iterdir())))).touch()
    return [checked("0", "counted", 1.0, 1.0, 0.1, series=((1.0, 2.0),))]


def fails_once(folder: Path) -> list[Row]:
    """The first process that tries it ends."""
    trace = folder / "tried"
    if not trace.exists():
        trace.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return [checked("0", "survived", 1.0, 1.0, 0.1)]


SUM, BAD = Case("0", "sum", adds), Case("0", "bad", raises)
