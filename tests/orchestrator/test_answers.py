"""Bad input gets a sentence of at most 400 characters that is no text of a library."""

import warnings

import numpy as np
import pytest
from made_logs import made

from fmus.physics.chain.layout import scale_of_angles
from orchestrator.results.analyses import links

LONG = "x" * 300


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (("log", "recover", "."), "the log . cannot be read: it is a directory"),
        (("resume", "."), "the log . cannot be read: it is a directory"),
        (("run", "rig", "--log", f"{LONG}.mcap"), "file name too long"),
        (("show", f"{LONG * 9}"), "no scene"),
        (("show", "straight", "--set", f"{LONG * 9}=1"), "unknown key"),
        (("show", "straight", "--set", f"vehicle={LONG * 9}"), "no vehicle"),
        (("show", "straight", "--set", f"run.{LONG * 9}.a=1"), "unknown key"),
        (("show", "straight", "--set", "vehicle.road_wheel.x=[1e19, 0, 0, 0, 0]"), "no belt lies round the wheels"),
        (("run", "straight", "--set", "vehicle.idler.x=-1e19"), "no belt lies round the wheels"),
    ],
)
def test_sentences(cotrack, command, said):
    status, _, err = cotrack(*command)
    assert status in (1, 2)
    assert said in err.lower()
    assert len(err) <= 400
    assert "internal error" not in err


def test_a_soft_chain_hangs(cotrack):
    soft = "--set", "vehicle.material.youngs_modulus=1 Pa", "--set", "chain.links=8", "--set", "expect={}"
    assert "flexible links: ok" in cotrack.done("run", "hanging_chain", *soft, "--stop", "0.002", "--no-estimate")


def test_checkpoints_never(cotrack, tmp_path):
    settings = "--set", "run.checkpoints=1e308", "--set", "chain.links=8", "--set", "expect={}", "--stop", "0.002"
    assert "ok" in cotrack.done("run", "hanging_chain", *settings, "--no-estimate", "--log", tmp_path / "a.mcap")


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


def test_a_chain_that_is_too_soft():
    assert scale_of_angles(lambda s: s - 0.5, 1e-3, 1.5) == pytest.approx(0.5, abs=1e-15)
    with pytest.raises(ValueError, match="the chain is too soft"):
        scale_of_angles(lambda s: s + 0.5, 1e-3, 1.5)


def test_warnings_of_numbers_do_not_reach_stderr(cotrack, monkeypatch):
    def warn(*_):
        warnings.warn("overflow encountered in multiply", RuntimeWarning, stacklevel=1)
        raise links.Missing("said")

    monkeypatch.setattr("orchestrator.scene.ssp_scene.load_runnable", warn)
    status, _, err = cotrack("show", "rig")
    assert (status, err) == (2, "cotrack: said\n")
