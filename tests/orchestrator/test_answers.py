"""Bad input gets a sentence of at most 400 characters that is no text of a library."""

import warnings

import pytest

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
    ],
)
def test_sentences(cotrack, command, said):
    status, _, err = cotrack(*command)
    assert status in (1, 2)
    assert said in err.lower()
    assert len(err) <= 400
    assert "internal error" not in err


def test_checkpoints_never(cotrack):
    status, out, err = cotrack("show", "hanging_chain", "--set", "run.checkpoints=1e308")
    assert (status, err) == (0, "")
    assert out


def test_warnings_of_numbers_do_not_reach_stderr(cotrack, monkeypatch):
    def warn(*_):
        warnings.warn("overflow encountered in multiply", RuntimeWarning, stacklevel=1)
        raise links.Missing("said")

    monkeypatch.setattr("orchestrator.scene.scene.load", warn)
    status, _, err = cotrack("show", "rig")
    assert (status, err) == (2, "cotrack: said\n")
