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
        raise NotInstalled(f"{package} is not installed: pip install 'cotrack[{extra}]'") from None
