"""The FMU of a mass on a spring (`toy`), for processes that should not import pytest."""

from pathlib import Path

from fmus.fmi.build import build_shell

TOY = Path(__file__).resolve().parents[1] / "toy"


def build_toy(folder=None, name=None, **config):
    """Build the FMU of a mass on a spring; ``config`` sets the number of spare inputs and outputs."""
    return build_shell(TOY / "toy_fmu.py", {"spare": 3, "start": 0.1, **config}, folder, name, packages=[TOY])
