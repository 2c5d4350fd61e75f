"""Coupling algorithms, one per module: a class ``Coupling`` with ``ORDER`` and ``rule``."""

from __future__ import annotations

from importlib import import_module
from typing import Any

COUPLINGS: dict[str, tuple[str, ...]] = {  # with their options
    "tracks_first": (),
    "jacobi": ("hold",),
    "gauss_seidel": ("hold",),
    "iterative": ("tolerance", "iterations"),
}


def having(option: str) -> tuple[str, ...]:
    """Couplings that have an option."""
    return tuple(name for name, options in COUPLINGS.items() if option in options)


def coupling(name: str) -> Any:
    """Class of a coupling, imported now: a scene that is read needs none."""
    return import_module(f"{__name__}.{name}").Coupling
