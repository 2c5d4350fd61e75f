"""The toy in a process of its own, with a cache folder."""

import subprocess
import sys

import numpy as np

TOY_RUN = """
import logging, sys
from pathlib import Path
from built_toy import build_toy
from orchestrator.cosim.component import Component
from orchestrator.files.messages import RUN
RUN.setLevel(logging.DEBUG)
RUN.addHandler(handler := logging.StreamHandler(sys.stdout))
handler.setFormatter(logging.Formatter("%(levelname)s %(message)s"))
with Component(build_toy(), "toy") as component:
    component.initialise({})
    for i in range(3):
        component.step(i * 1e-3, 1e-3)
    component.read()
    import toy.kernels
    hits = sum(toy.kernels.advance.stats.cache_hits.values())
    print(component.y.tobytes().hex(), hits)
"""


def run_toy(environment, cache):
    """Run the toy in its own process: messages, outputs, number of kernels found, text of its log."""
    done = subprocess.run(
        [sys.executable, "-c", TOY_RUN], env={**environment, "COTRACK_CACHE": str(cache)},
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, (done.returncode, done.stderr[-2000:])
    *messages, last = done.stdout.splitlines()
    values, hits = last.split()
    return messages, np.frombuffer(bytes.fromhex(values)).tolist(), int(hits), done.stderr
