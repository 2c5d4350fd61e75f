"""The kernels that a background process compiles are those that the component needs."""

import json
import subprocess
import sys

import pytest

from fmus import ahead
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load

DRIVE = next((p.kind, p.config, p.parameters) for p in assemble(load("straight")).parts if p.kind == "SprocketDrive")
PROGRAM = """
import json, logging, sys
logging.basicConfig(level=logging.INFO)
from fmus.sprocket_drive.model import Model
kind, config, parameters = json.load(sys.stdin)
model = Model(config)
import numpy as np
model.initialise({p.name: p.start for p in model.ports if p.causality == "parameter"} | parameters)
model.step(0.0, 1e-3, np.array([p.start for p in model.ports if p.causality == "input"]))
"""


@pytest.mark.long
def test_what_was_compiled_beside_is_not_compiled_again(environment, monkeypatch, tmp_path):
    cache = tmp_path / "cache"
    monkeypatch.setenv("COTRACK_CACHE", str(cache))
    process = ahead.start_compilation(DRIVE)
    assert process is not None
    assert process.wait(timeout=120) == 0
    assert ahead.start_compilation(DRIVE) is None
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], input=json.dumps(DRIVE), capture_output=True, text=True, check=True,
        env={**environment, "COTRACK_CACHE": str(cache), "PYTHONPATH": str(ahead.ROOT.parent)},
    )  # fmt: skip
    assert "is compiled" not in done.stderr
    other = subprocess.run(
        [sys.executable, "-c", PROGRAM], input=json.dumps(DRIVE), capture_output=True, text=True, check=True,
        env={**environment, "COTRACK_CACHE": str(tmp_path / "other"), "PYTHONPATH": str(ahead.ROOT.parent)},
    )  # fmt: skip
    assert "is compiled" in other.stderr, "the twin: another cache"


def test_parts_that_cannot_start_are_left_to_the_fmus(monkeypatch, tmp_path):
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path / "cache"))
    process = ahead.start_compilation(("SprocketDrive", {"vehicle": {}, "drive": {}}, {}))
    assert process is not None
    assert process.wait(timeout=120) == 0
    assert ahead.start_compilation(DRIVE) is not None
