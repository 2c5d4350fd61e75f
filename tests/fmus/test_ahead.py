"""The kernels that a background process compiles are those that the component needs."""

import json
import subprocess
import sys

import pytest

from fmus import ahead
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load


def recipe(scene, kind):
    """Kind, config and parameters of the first part of a kind in a scene."""
    return next((p.kind, p.config, p.parameters) for p in assemble(load(scene)).parts if p.kind == kind)


DRIVE, CABLES = recipe("straight", "SprocketDrive"), recipe("hanging_chain", "TrackFlexible")
PROGRAM = """
import json, logging, sys
import numpy as np
from fmus.components import model_of
kind, config, parameters = json.load(sys.stdin)
model = model_of(kind)(config)
model.initialise({p.name: p.start for p in model.ports if p.causality == "parameter"} | parameters)
logging.basicConfig(level=logging.INFO)
reals = [p for p in model.ports if isinstance(p.start, float)]
model.step(0.0, 1e-3, np.array([p.start for p in reals if p.causality == "input"]))
model.outputs(np.zeros(sum(p.causality == "output" for p in reals) - model.link_ports))
model.link_outputs(np.zeros(model.link_ports))
"""


def compiled_by_a_step(part, cache, environment):
    """Whether a step in a new process compiles any kernel."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], input=json.dumps(part), capture_output=True, text=True, check=True,
        env={**environment, "COTRACK_CACHE": str(cache), "PYTHONPATH": str(ahead.ROOT.parent)},
    )  # fmt: skip
    return "is compiled" in done.stderr


@pytest.mark.long
@pytest.mark.parametrize("part", [DRIVE, pytest.param(CABLES, marks=pytest.mark.study)], ids=["drive", "cables"])
def test_what_was_compiled_beside_is_not_compiled_again(environment, monkeypatch, tmp_path, part):
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path))
    process = ahead.start_compilation([part])
    assert process is not None
    assert process.wait(timeout=120) == 0
    assert ahead.start_compilation([part]) is None
    assert not compiled_by_a_step(part, tmp_path, environment)


@pytest.mark.long
def test_a_step_with_an_empty_cache_compiles(environment, tmp_path):
    assert compiled_by_a_step(DRIVE, tmp_path, environment)


def test_parts_that_cannot_start_are_left_to_the_fmus(monkeypatch, tmp_path):
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path / "cache"))
    process = ahead.start_compilation([("SprocketDrive", {"vehicle": {}, "drive": {}}, {})])
    assert process is not None
    assert process.wait(timeout=120) == 0
    assert ahead.start_compilation([DRIVE]) is not None
