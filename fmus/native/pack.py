"""A component as a native FMU: its library and its description, packed; the way is in the README of this folder."""

from __future__ import annotations

import hashlib
import json
import tempfile
import uuid
from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import tostring

from fmus.build import KINDS, BuildFailed, archive, built
from fmus.defaults import check_names, checked, configured
from fmus.description import document
from fmus.jit import source_hash
from fmus.native.emit import emit
from fmus.native.entries import entries
from fmus.native.header import header, image
from fmus.native.link import HERE, NoCompiler, compiler, link
from fmus.ports import Port, variables

NUMBA = ("0.6",)  # begins the versions whose insides the runtime and the entries are made for
CATEGORIES = {
    "logStatusWarning": "Messages of a step that was done but needs a look.",
    "logStatusError": "Messages of a call that failed.",
}


def build_native(
    kind: str,
    config: Mapping[str, Any],
    parameters: Mapping[str, float | int | str],
    folder: Path | None = None,
    name: str | None = None,
) -> Path:
    """The native FMU of a kind of component with these parameters for good, built unless the cache has it.

    It needs libc and libm alone. Raises BuildFailed.
    """
    if kind not in KINDS:
        raise BuildFailed(f"no kind of component is called '{kind}': there are {', '.join(KINDS)}")
    if not version("numba").startswith(NUMBA):
        known = ", ".join(f"{each}x" for each in NUMBA)
        raise BuildFailed(f"native FMUs are made with numba {known}, whose insides they know, not {version('numba')}")
    try:
        made = json.dumps([config, parameters], sort_keys=True, allow_nan=False)
        command = compiler()
    except (TypeError, ValueError) as error:
        raise BuildFailed(f"the configuration of {kind} is not JSON: {error}") from None
    except NoCompiler as error:
        raise BuildFailed(str(error)) from None
    sources = [(HERE / each).read_text(encoding="utf-8") for each in ("shell.c", "runtime.c", "fmi2.h")]
    parts = ["native", version("numba"), version("llvmlite"), *command[1:], source_hash(), *sources, kind, made]
    digest = hashlib.sha256("\0".join(parts).encode())
    guid = str(uuid.UUID(bytes=digest.digest()[:16]))
    return built(digest.hexdigest()[:24], f"{name or kind}.fmu", lambda: _pack(kind, config, parameters, guid), folder)


def _pack(kind: str, config: Mapping[str, Any], parameters: Mapping[str, float | int | str], guid: str) -> bytes:
    made_from = {**config, "parameters": {**config.get("parameters", {}), **parameters}}
    model: Any = import_module(f"fmus.{KINDS[kind].partition('/')[0]}.model").Model(made_from)
    check_names(model.ports, made_from)
    ports = tuple(
        port._replace(causality="local") if port.causality == "parameter" else port
        for port in variables(configured(model.ports, made_from)).row
    )
    model.initialise({port.name: checked(port, port.start) for port in ports if port.causality == "local"})
    reals = [port for port in ports if isinstance(port.start, float)]
    outputs = sum(port.causality == "output" for port in reals)
    made = entries(model, outputs - model.link_ports)
    sizes = {"x": model.state.size, "n": model.counters.size, **{each: made.frozen.block(each).size for each in "fkz"}}
    with tempfile.TemporaryDirectory(prefix="cotrack-") as stage:
        place = Path(stage)
        (place / "model.h").write_text(
            header(guid, ports, model.link_ports, sizes, model.failures, model.warned), encoding="utf-8"
        )
        objects = place / "component.o", place / "image.o"
        objects[0].write_bytes(emit(made.entries))
        objects[1].write_bytes(image(made.frozen, model.state, model.counters))
        try:
            link(objects, place, place / f"{kind}.so")
        except NoCompiler as error:
            raise BuildFailed(str(error)) from None
        library = (place / f"{kind}.so").read_bytes()
    return archive(
        {"modelDescription.xml": _described(kind, model, guid, ports), f"binaries/linux64/{kind}.so": library}
    )


def _described(kind: str, model: Any, guid: str, ports: tuple[Port, ...]) -> bytes:
    reals = [port for port in ports if isinstance(port.start, float)]
    root = document(
        kind,
        guid=guid,
        text=(type(model).__doc__ or kind).strip().splitlines()[0],
        tool=f"cotrack, native by numba {version('numba')}",
        variables=ports,
        reals=len(reals),
        continuous=sum(port.causality != "local" for port in reals),
        categories=CATEGORIES,
    )
    return bytes(tostring(root, encoding="utf-8", xml_declaration=True))
