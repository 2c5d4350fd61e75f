"""Build of native FMUs: library and description of a component, packed; steps as in README.md."""

from __future__ import annotations

import hashlib
import json
import tempfile
import uuid
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import tostring

from fmus.build import BuildFailed, archive, build_once
from fmus.components import KINDS, model_of
from fmus.defaults import KEY, check_names, configured_ports, experiment, parameter_values
from fmus.description import document
from fmus.documentation import documentation, key_parts, readme_beside
from fmus.native import fmi3_description, terminals
from fmus.native.arrays import arrays
from fmus.native.emit import LEVELS, emit
from fmus.native.entries import entries, free_names
from fmus.native.header import header, image
from fmus.native.link import NoCompiler, compiler, compiler_release, headers, link, sources
from fmus.native.platform import LINUX, WINDOWS, Platform
from fmus.ports import variables
from fmus.sources import ROOT, source_hash

NUMBA = ("0.6",)  # prefixes of the versions whose internals the runtime and the entries rely on
INCLUDED = ("numba",)  # distributions of which a library has compiled functions
CATEGORIES = {
    "logStatusWarning": "Messages of a step that was done but needs a look.",
    "logStatusError": "Messages of a call that failed.",
}


def build_native(
    kind: str,
    config: Mapping[str, Any],
    folder: Path | None = None,
    name: str | None = None,
    windows: bool = False,
    fmi: int = 2,
) -> Path:
    """Path of the native FMU of a kind of component, built unless the cache has it.

    The FMU needs libc alone. ``windows`` adds a library for Windows to that for Linux. ``fmi``: 2 or 3, for FMI 2.0
    or 3.0. Parameters in ``config`` are start values, and constants if they are not free. Raises BuildFailed.
    """
    if kind not in KINDS:
        raise BuildFailed(f"no kind of component is called '{kind}': there are {', '.join(KINDS)}")
    if not version("numba").startswith(NUMBA):
        known = ", ".join(f"{each}x" for each in NUMBA)
        raise BuildFailed(f"native FMUs are made with numba {known}, whose insides they know, not {version('numba')}")
    platforms = (LINUX, WINDOWS) if windows else (LINUX,)
    try:
        config_text = json.dumps(config, sort_keys=True, allow_nan=False)
        compiler_parts = [*(part for each in platforms for part in compiler(each)[1:]), compiler_release()]
    except (TypeError, ValueError) as error:
        raise BuildFailed(f"the configuration of {kind} is not JSON: {error}") from None
    except NoCompiler as error:
        raise BuildFailed(str(error)) from None
    parts = [
        *key_parts(readme_beside(ROOT / KINDS[kind]), INCLUDED),
        "native",
        version("numba"),
        version("llvmlite"),
        *compiler_parts,
        source_hash(),
        *(each.read_text(encoding="utf-8") for each in (*sources(fmi), *headers(fmi))),
        kind,
        config_text,
    ]
    digest = hashlib.sha256("\0".join(parts).encode())
    guid = str(uuid.UUID(bytes=digest.digest()[:16]))
    return build_once(
        digest.hexdigest()[:24], f"{name or kind}.fmu", lambda: _pack(kind, config, guid, platforms, fmi), folder
    )


def targets_windows() -> bool:
    """Whether the compiler at hand makes libraries for Windows."""
    try:
        compiler(WINDOWS)
    except NoCompiler:
        return False
    return True


def with_constants(kind: str, config: Mapping[str, Any], parameters: Mapping[str, float | int | str]) -> dict[str, Any]:
    """Config with the parameters that are not free, so that components alike in them share an FMU."""
    values = {**config.get(KEY, {}), **parameters}
    model = _model(kind, {**config, KEY: values})
    free = free_names(model.free_parameters(parameter_values(model.ports, values)))
    constants = {name: value for name, value in parameters.items() if name not in free}
    return {**config, KEY: {**config.get(KEY, {}), **constants}}


def _model(kind: str, config: Mapping[str, Any]) -> Any:
    return model_of(kind)(config)


def _pack(
    kind: str, config: Mapping[str, Any], guid: str, platforms: Sequence[Platform] = (LINUX,), fmi: int = 2
) -> bytes:
    model = _model(kind, config)
    check_names(model.ports, config)
    ports = configured_ports(model.ports, config)
    values = parameter_values(ports, {})
    free = model.free_parameters(values)
    model.initialise(values)
    row = variables(ports)
    outputs = sum(port.causality == "output" for port in row.reals)
    real_parameters = [port for port in row.reals if port.causality == "parameter"]
    compiled = entries(model, free.numbers, real_parameters, row.strings, outputs - model.link_ports)
    free_ones = free_names(free)
    ports = tuple(
        port._replace(causality="local") if port.causality == "parameter" and port.name not in free_ones else port
        for port in row.row
    )
    float64s = arrays([port for port in ports if isinstance(port.start, float)]) if fmi == 3 else None
    sizes = {
        "x": model.state.size,
        "n": model.counters.size,
        **{each: compiled.frozen.block(each).size for each in "fkz"},
    }
    with tempfile.TemporaryDirectory(prefix="cotrack-") as stage:
        place = Path(stage)
        (place / "model.h").write_text(
            header(
                guid,
                ports,
                model.link_ports,
                sizes,
                model.indices,
                {"FAILURE": model.failures, "WARNING": model.warning_sentences, "REFUSED": model.refusals},
                float64s,
            ),
            encoding="utf-8",
        )
        libraries = {}
        for platform in platforms:
            library = place / f"{kind}{platform.suffix}"
            parts = {"image": image(compiled.frozen, model.state, model.counters, platform)}
            parts |= {prefix: emit(compiled.entries, prefix, platform) for prefix in LEVELS}
            objects = [place / f"{platform.folder}.{part}.o" for part in parts]
            for path, content in zip(objects, parts.values(), strict=True):
                path.write_bytes(content)
            try:
                link(objects, place, library, platform, fmi)
            except NoCompiler as error:
                raise BuildFailed(str(error)) from None
            folder = platform.fmi3_folder if fmi == 3 else platform.folder
            libraries[f"binaries/{folder}/{library.name}"] = library.read_bytes()
    about: dict[str, Any] = {
        "guid": guid,
        "text": (type(model).__doc__ or kind).strip().splitlines()[0],
        "tool": f"cotrack, native by numba {version('numba')}",
        "categories": CATEGORIES,
        "experiment": experiment(config),
    }
    reals = [port for port in ports if isinstance(port.start, float)]
    if float64s is None:
        continuous = sum(port.causality in ("input", "output") for port in reals)
        root = document(kind, variables=ports, reals=len(reals), continuous=continuous, **about)
    else:
        root = fmi3_description.document(kind, arrays=float64s, others=ports[len(reals) :], **about)
    description = bytes(tostring(root, encoding="utf-8", xml_declaration=True))
    files = {"modelDescription.xml": description, **libraries}
    files |= documentation(description, readme_beside(ROOT / KINDS[kind]), INCLUDED)
    if float64s is not None:
        files |= terminals.files(float64s)
    return archive(files)
