"""Library of an FMU of FMI 3.0 in this process, and its instances; sibling of ``fmi2_library``."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from ctypes import c_bool, c_char_p, c_double, c_float
from functools import lru_cache
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi3 import FMU3Slave, fmi3IntermediateUpdateCallback, fmi3LogMessageCallback

from orchestrator.cosim.messages import Hear

TYPES: dict[str, Any] = {"Float64": c_double, "Float32": c_float, "Boolean": c_bool, "String": c_char_p}
TYPES |= {f"Int{n}": getattr(ctypes, f"c_int{n}") for n in (8, 16, 32, 64)}
TYPES |= {f"UInt{n}": getattr(ctypes, f"c_uint{n}") for n in (8, 16, 32, 64)}


def binary(folder: Path, identifier: str) -> Path:
    """File of the library in the folder of an FMU; it need not exist."""
    return folder / "binaries" / fmpy.platform_tuple / f"{identifier}{fmpy.sharedLibraryExtension}"


@lru_cache(maxsize=4)
def load(folder: Path, identifier: str) -> Any:
    """Return the library of an unpacked FMU with all functions of the standard; raises OSError, RuntimeError."""
    return FMU3Slave(guid="", modelIdentifier=identifier, unzipDirectory=str(folder), instanceName="").dll


def instantiate(library: Any, folder: Path, name: str, guid: str, hear: Hear) -> tuple[int | None, Callable[[], None]]:
    """Return the handle of a new instance, None if it refuses, and the function that frees it; ``hear``: its logger.

    There is no event mode, no early return and no intermediate update.
    """

    def receive(environment: object, status: int, category: bytes, message: bytes) -> None:
        hear(status, (message or b"").decode("utf-8", "replace"), (category or b"").decode("utf-8", "replace"))

    log, update = fmi3LogMessageCallback(receive), fmi3IntermediateUpdateCallback()
    resources = f"{folder / 'resources'}{os.sep}".encode() if (folder / "resources").is_dir() else None
    handle = library.fmi3InstantiateCoSimulation(
        name.encode(), guid.encode(), resources, False, True, False, False, None, 0, None, log, update
    )

    def close(callbacks: object = (log, update)) -> None:  # which live as long as this function
        if handle:
            library.fmi3FreeInstance(handle)

    return handle, close
