"""Odd settings run, damaged records of links are refused, and no text of a library reaches stderr."""

import warnings

import numpy as np
import pytest
from made_logs import made

from fmus.physics.chain.layout import scale_of_angles
from fmus.vehicles.tables import BadInput

SHORT = ("run", "hanging_chain", "--set", "chain.links=8", "--set", "expect={}", "--stop", "0.002", "--no-estimate")


@pytest.mark.parametrize("setting", ["vehicle.material.youngs_modulus=1 Pa", "run.checkpoints=1e308"])
def test_odd_settings_run(cotrack, setting):
    assert "hanging_chain, flexible links: ok" in cotrack.done(*SHORT, "--set", setting)


WHOLE = {"joint[{}].position": 4, "joint[{}].force": 4, "joint[{}].axis": 4, "link[{}].ground.force": 4}
FIBRES = {"link[{}].fibre.outer": 4, "link[{}].fibre.inner": 4}


def log_of_links(path, lengths):
    """Write a log of one record whose families of signals have these lengths."""
    names = [
        f"{family.format(k + 1)}{axis}"
        for family, length in lengths.items()
        for k in range(length)
        for axis in ((".x", ".y", ".z") if family in WHOLE else ("",))
    ]
    scene = {"run": {"step": 1e-3}, "vehicle": {"section": {"area": 1.0, "bending": 1.0, "outer_fibre": 1.0}}}
    topics = {"/chain/out": [("travel", "m")], "/chain/links": [(name, "N") for name in names]}
    values = {"/chain/out": np.zeros((1, 1)), "/chain/links": np.random.default_rng(1).random((1, len(names)))}
    return made(path, topics, {topic: ([0.0], row) for topic, row in values.items()}, scene, ("chain",))


def test_joints_of_families_of_other_lengths(cotrack, tmp_path):
    path, lengths = tmp_path / "a.mcap", WHOLE | FIBRES
    status, _, err = cotrack("analyse", log_of_links(path, lengths), "joints")
    assert (status, err) == (0, "")
    for family in lengths:
        err = cotrack.refused("analyse", log_of_links(path, lengths | {family: 2}), "joints")
        assert "internal error" not in err
        assert "holds other numbers" in err


def test_the_scale_of_the_angles_of_a_soft_chain_is_found():
    assert scale_of_angles(lambda s: s - 0.5, 1e-3, 1.5) == pytest.approx(0.5, abs=1e-15)


def test_warnings_of_numbers_do_not_reach_stderr(cotrack, monkeypatch):
    def warn(*_):
        warnings.warn("overflow encountered in multiply", RuntimeWarning, stacklevel=1)
        raise BadInput("said")

    monkeypatch.setattr("orchestrator.scene.ssp_scene.load_runnable", warn)
    status, _, err = cotrack("show", "rig")
    assert (status, err) == (2, "cotrack: said\n")
