"""Optional libraries (extras of the distribution), imported when they are first used; packages that are missing."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

BROUGHT = {  # module: package of pyproject.toml that brings it, where their names differ
    "PIL": "matplotlib",
    "annotated_types": "pydantic",
    "google": "protobuf",
    "llvmlite": "numba",
    "lz4": "mcap",
    "lxml": "fmpy",
    "markdown_it": "markdown-it-py",
    "pydantic_core": "pydantic",
}


class NotInstalled(RuntimeError):
    """A library of an extra is missing; the message is one sentence."""


def library(name: str, extra: str = "analysis") -> ModuleType:
    """Import a module of an optional library by its name; raises NotInstalled."""
    try:
        return import_module(name)
    except ImportError:
        package = name.partition(".")[0]
        raise NotInstalled(f"{package} is not installed: {installation(extra)}") from None


def installation(extra: str = "") -> str:
    """Words that say how cotrack is installed, with an extra; it is on no package index."""
    what = f"'.[{extra}]'" if extra else "."
    return f"pip install -c constraints.txt -e {what} in the clone of cotrack brings it"


def lacking(error: ImportError) -> str:
    """Sentence about a package that cotrack needs and that is missing or broken."""
    module = (error.name or "").partition(".")[0]
    package = BROUGHT.get(module, module)
    if isinstance(error, ModuleNotFoundError) and "." not in (error.name or ""):
        by = f" (module {module})" if package != module else ""
        return f"{package}{by} is not installed: {installation()}"
    cure = installation().replace("brings", "mends")
    return f"{package or 'a package'} is installed but cannot be imported ({error}): {cure}"
