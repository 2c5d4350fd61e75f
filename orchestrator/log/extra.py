"""Optional libraries (extras of the distribution), imported when they are first used."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType


class NotInstalled(RuntimeError):
    """A library of an extra is missing; the message is one sentence."""


def library(name: str, extra: str = "analysis") -> ModuleType:
    """Import a module of an optional library by its name; raises NotInstalled."""
    try:
        return import_module(name)
    except ImportError:
        package = name.partition(".")[0]
        raise NotInstalled(f"{package} is not installed: {installation(extra)}") from None


def installation(extra: str) -> str:
    """Words that say how an extra is installed; cotrack is on no package index."""
    return f"pip install -c constraints.txt -e '.[{extra}]' in the clone of cotrack brings it"
