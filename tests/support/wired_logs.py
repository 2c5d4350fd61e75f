"""A log of two instances whose inputs are outputs of each other."""

import numpy as np
import pytest

from orchestrator.log import recorder as module
from orchestrator.log.recorder import Recorder
from orchestrator.log.time_series import Wire

STEP, STEPS = 1e-3, 300
TOPICS = {
    "/a/in": [("f", "N"), ("own", "1"), ("g", "N"), ("w", "1")],
    "/a/out": [("x", "m"), ("y", "m"), ("z", "m")],
    "/b/in": [("x", "m"), ("y", "m")],
    "/b/out": [("f", "N"), ("g", "N")],
}
WIRES = {
    "/a/in": [Wire("/b/out", "end", ("f",), ("f",)), Wire("/b/out", "middle", ("g",), ("g",)),
              Wire("/a/out", "start", ("z",), ("w",))],
    "/b/in": [Wire("/a/out", "start", ("y", "x"), ("y", "x"))],
}  # fmt: skip


def rows(k):
    """Inputs of the step that leads to k, and outputs at k, of both instances."""

    def out(j):
        return np.sin(j + np.arange(3.0)), np.cos(0.1 * j) * np.array([1.0, -2.5])

    (x, y, z), (_, g) = out(k - 1)[0], out(k - 1)[1]
    f, later = out(k)[1]
    return np.array([f, float(k), 0.5 * (g + later), z]), np.array([x, y]), *out(k)


def write(path, wires=WIRES, change=lambda k, row: None, chunk=3000):
    """Write the log; ``change`` may alter the rows of a step."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "CHUNK", chunk)
        with Recorder(path, TOPICS, {}, {}, wires=wires, flush=60) as recorder:
            page = recorder.join_topics(["/a/in", "/b/in"], ["/a/out", "/b/out"])
            for k in range(STEPS + 1):
                row = rows(k)
                change(k, row)
                recorder.write(page, k, k * STEP, STEP, *row)
            recorder.close("ok", "", STEPS)
    return path
