"""Build of native FMUs: a library for a shape of a component, and its numbers beside it; steps as in README.md."""

from __future__ import annotations

import hashlib
import json
import tempfile
import uuid
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import tostring

from fmus.cache.files import CHECKSUM, cached_result
from fmus.cache.sources import ROOT, source_hash
from fmus.components import COMPONENT_KINDS, model_of
from fmus.fmi.build import DESCRIPTION, DIGITS, SHAPE, BuildFailed, archive, build_once, json_text, packed_config
from fmus.fmi.description import document
from fmus.fmi.documentation import documentation, icon_beside, icon_files, key_parts, readme_beside
from fmus.fmi.terminals import terminal_files
from fmus.ground.tables import number_meanings
from fmus.interface.defaults import EXPERIMENT, KEY, all_ports, experiment, parameter_values
from fmus.interface.model import InvalidParameter
from fmus.interface.ports import Port, variables
from fmus.kernels.numba_internals import other_version
from fmus.native import fmi3_description, numbers_file
from fmus.native.entries import Entries, entries, free_names
from fmus.native.fmi3_description import ArrayVariable, arrays
from fmus.native.header import header
from fmus.native.machine_code import (
    FLAGS,
    LEVELS,
    LINUX,
    WINDOWS,
    NoCompiler,
    Platform,
    Prefixes,
    compiler,
    compiler_release,
    definitions,
    emit,
    headers,
    link,
    of_this_processor,
    sources,
)

INCLUDED = ("numba",)  # distributions of which a library has compiled functions
DERIVATIVES = {"canInterpolateInputs": "true", "maxOutputDerivativeOrder": "1"}  # of CoSimulation
CATEGORIES = {
    "logStatusWarning": "Messages of a step that was done but needs a look.",
    "logStatusDiscard": "Messages of a step that could not be done: the instance is as before it.",
    "logStatusError": "Messages of a call that failed.",
}


class NativeFmu(NamedTuple):
    """FMU of a shape, the folder that is its resources for the numbers of a config, and its start values."""

    fmu: Path
    resources: Path
    starts: Sequence[float]  # of its Reals, in their order


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
    platforms = (LINUX, WINDOWS) if windows else (LINUX,)
    config = packed_config(kind, config)
    tools = _tools(fmi, platforms)
    script = ROOT / COMPONENT_KINDS[kind]
    texts = [
        *key_parts(readme_beside(script), INCLUDED),
        icon_beside(script).hex(),
        *tools,
        kind,
        json_text(config, kind),
    ]

    def packed() -> bytes:
        component = _Component(kind, config, fmi, tools)
        return component.fmu(platforms, component.own_guid)

    return build_once(_digest(texts)[:DIGITS], f"{name or kind}.fmu", packed, folder)


def build_native_shape(kind: str, config: Mapping[str, Any]) -> NativeFmu:
    """FMU of the shape of a component, with any numbers, and the numbers of a config; see ``build_native``.

    An instance with these resources is one of the FMU of ``build_native``, but the library is for this processor alone.
    Raises BuildFailed.
    """
    tools, config = _tools(2, (LINUX,)), packed_config(kind, config)
    own = {key: value for key, value in config.items() if key != EXPERIMENT}

    @cache
    def component() -> _Component:
        return _Component(kind, own, 2, tools)

    key = _digest([*tools, kind, json_text(own, kind)])[:DIGITS]
    file = build_once(key, numbers_file.FILE, lambda: component().numbers(), None, "numbers")
    shape = numbers_file.shape_of(file)
    levels = of_this_processor()
    name = _digest([shape, *levels])[:DIGITS]
    fmu = build_once(name, f"{kind}.fmu", lambda: component().fmu((LINUX,), levels=levels), None)
    return NativeFmu(fmu, file.parent, numbers_file.starts(file))


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
    packed = packed_config(kind, {**config, KEY: values})

    def free() -> list[str]:
        model = model_of(kind)(packed)
        return sorted(free_names(model.free_parameters(parameter_values(model.ports, values))))

    known = set(cached_result("numbers", "free", [source_hash(), kind, packed], free))
    constants = {name: value for name, value in parameters.items() if name not in known}
    return {**config, KEY: {**config.get(KEY, {}), **constants}}


def _digest(texts: Sequence[str]) -> str:
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()


@lru_cache(maxsize=8)
def _tools(fmi: int, platforms: tuple[Platform, ...]) -> tuple[str, ...]:
    """Versions and sources that a library is made of, besides a component; raises BuildFailed."""
    if unknown := other_version("native FMUs cannot be built"):
        raise BuildFailed(unknown)
    try:
        compilers = [*(part for each in platforms for part in compiler(each)[1:]), compiler_release()]
    except NoCompiler as error:
        raise BuildFailed(str(error)) from None
    files = (each.read_text(encoding="utf-8") for each in (*sources(fmi), *headers(fmi)))
    return "native", version("numba"), version("llvmlite"), *compilers, *FLAGS, source_hash(), *files


class _Component:
    """Initialised component with a packed config: its numbers, and its FMU; raises BuildFailed."""

    def __init__(self, kind: str, config: Mapping[str, Any], fmi: int, tools: Sequence[str]) -> None:
        self.kind, self.config, self.fmi = kind, config, fmi
        self.model = model = model_of(kind)(config)
        try:
            ports = all_ports(model.ports, config, number_meanings())
        except InvalidParameter as error:
            raise BuildFailed(f"cannot build {kind}: {error}") from None
        values = parameter_values(ports, {})
        free = model.free_parameters(values)
        model.initialise(values)
        row = variables(ports)
        outputs = sum(port.causality == "output" for port in row.reals)
        reals = [port for port in row.reals if port.causality == "parameter"]
        self.entries: Entries = entries(model, free.numbers, reals, row.strings, outputs - model.link_ports)
        names = free_names(free)
        self.ports: tuple[Port, ...] = tuple(
            port._replace(causality="local") if port.causality == "parameter" and port.name not in names else port
            for port in row.row
        )
        self.reals = len(row.reals)
        self.arrays: list[ArrayVariable] | None = arrays(list(self.ports[: self.reals])) if fmi == 3 else None
        blocks = {letter: self.entries.frozen.block(letter).size for letter in "fkz"}
        self.header = header(
            self.ports,
            model.link_ports,
            {"x": model.state.size, "n": model.counters.size, **blocks},
            model.indices,
            {"FAILURE": model.failures, "WARNING": model.warning_sentences, "REFUSED": model.refusals},
            self.arrays,
        )
        self.shape = _digest([*tools, kind, self.header, self.entries.source])

    @property
    def guid(self) -> str:
        """Identifier of the shape, which is that of an FMU for any numbers."""
        return str(uuid.UUID(self.shape[:32]))

    @property
    def own_guid(self) -> str:
        """Identifier of the FMU with these numbers: some hosts unpack one FMU for each."""
        return f"{self.guid[:-8]}{numbers_file.checksum(self.numbers()):08x}"

    def numbers(self) -> bytes:
        """Content of the file of numbers."""
        blocks = {"x": self.model.state, "n": self.model.counters}
        return numbers_file.encode(self.shape, self.ports, self.entries.frozen, blocks)

    def fmu(self, platforms: Sequence[Platform], guid: str = "", levels: Prefixes = tuple(LEVELS)) -> bytes:
        """Archive of the FMU with its own numbers; ``guid``: by default that of the shape."""
        fmi3 = self.arrays is not None
        libraries = {}
        for platform in platforms:
            library = f"{self.kind}{platform.suffix}"
            key = _digest([self.shape, platform.target, *levels])[:DIGITS]
            file = build_once(key, library, partial(self._library, platform, levels), None, "libraries")
            content = file.read_bytes()[:-CHECKSUM]
            libraries[f"binaries/{platform.fmi3_folder if fmi3 else platform.folder}/{library}"] = content
        description = self._description(guid or self.guid)
        files = {DESCRIPTION: description, **libraries}
        script = ROOT / COMPONENT_KINDS[self.kind]
        files |= documentation(description, readme_beside(script), INCLUDED) | icon_files(script, self.fmi)
        files |= {f"resources/{numbers_file.FILE}": self.numbers(), f"resources/{SHAPE}": self.shape.encode()}
        return archive(files | terminal_files(description))

    def _library(self, platform: Platform, levels: Prefixes) -> bytes:
        with tempfile.TemporaryDirectory(prefix="cotrack-") as stage:
            place = Path(stage)
            head = f"#define GUID {json.dumps(self.guid)}\n#define SHAPE {json.dumps(self.shape)}\n"
            (place / "model.h").write_text(head + definitions(levels) + self.header, encoding="utf-8")
            library, objects = place / f"{self.kind}{platform.suffix}", []
            compiled = self.entries.compiled()
            for prefix in levels:
                objects.append(place / f"{platform.folder}.{prefix}.o")
                objects[-1].write_bytes(emit(compiled, prefix, platform))
            try:
                link(objects, place, library, platform, self.fmi)
            except NoCompiler as error:
                raise BuildFailed(str(error)) from None
            return library.read_bytes()

    def _description(self, guid: str) -> bytes:
        about: dict[str, Any] = {
            "guid": guid,
            "text": (type(self.model).__doc__ or self.kind).strip().splitlines()[0],
            "tool": f"cotrack, native by numba {version('numba')}",
            "categories": CATEGORIES,
            "experiment": experiment(self.config),
        }
        if self.arrays is None:
            continuous = sum(port.causality in ("input", "output") for port in self.ports[: self.reals])
            root = document(self.kind, variables=self.ports, reals=self.reals, continuous=continuous, **about)
            root[0].attrib |= DERIVATIVES
        else:
            others = self.ports[self.reals :]
            root = fmi3_description.document(self.kind, arrays=self.arrays, others=others, **about)
        return bytes(tostring(root, encoding="utf-8", xml_declaration=True))
