"""Model description of an FMU, as FMPy reads it; variables of FMI 3.0 become those of FMI 2.0, as far as they can.

| FMI 3.0 | FMI 2.0 |
| --- | --- |
| Float64, Float32 | Real |
| Int8 to Int64, UInt8 to UInt64 | Integer, with the range of the type |
| Boolean, String, Enumeration | the same |
| Binary, Clock | left out |
| an array | its elements, called x[1], x[2], or x[1,2], of an array of fixed size |
"""

from __future__ import annotations

import copy
import io
import math
import re
from collections import ChainMap
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from ctypes import c_int, c_int64
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple
from zipfile import ZipFile

import numpy as np
from fmpy import read_model_description
from fmpy.model_description import ModelVariable
from lxml import etree

from orchestrator.fmi import fmi2, fmi3
from orchestrator.fmi.fmu_files import DESCRIPTION, unpack
from orchestrator.fmi.slave import ComponentFailed, Opening

Elements = Sequence[tuple[int, str, int, int]]  # value reference, type, size and place in its array
LIBRARIES: dict[str, ModuleType] = {"2.0": fmi2, "3.0": fmi3}  # by the version of FMI
RANGES: dict[str, tuple[float, float]] = {f"Int{n}": (-(2 ** (n - 1)), 2 ** (n - 1) - 1) for n in (8, 16, 32, 64)}
RANGES |= {f"U{kind}": (0, 2 * most + 1) for kind, (_, most) in RANGES.items()} | {"Integer": RANGES["Int32"]}
FMI3_TYPES = {"Float64": "Real", "Float32": "Real"} | dict.fromkeys(RANGES, "Integer")
FMI3_TYPES |= {kind: kind for kind in ("Boolean", "String", "Enumeration")}
ALLOWED: dict[str, Any] = {"Real": int | float, "Integer": int, "Enumeration": int, "Boolean": bool, "String": str}
LARGEST = 2**53 - 1  # whole numbers up to it are exact in arrays and logs, which hold doubles
MAX_ELEMENTS = 100_000  # scalars of an FMU of FMI 3.0


class BadDescription(ComponentFailed):
    """The modelDescription.xml of an FMU cannot be read."""


def describe(fmu: Path, versions: Collection[str] = ("2.0",)) -> tuple[Path, Any]:
    """Unpack a co-simulation FMU of these versions of FMI; return its folder and its description.

    Raises ComponentFailed.
    """
    folder = unpack(Path(fmu))
    return folder, _description(folder, fmu, versions)


class Loadable(NamedTuple):
    """FMU that can be loaded here."""

    folder: Path
    description: Any  # with the variables of FMI 2.0
    elements: Elements = ()  # of FMI 3.0: what each value reference of the description stands for
    whole: Any = c_int  # C type in which Integers, Enumerations and Booleans are exchanged
    unused: str = ""  # sentence on what of it is not used

    def own_type(self, variable: Any) -> str:
        """Type of a variable in its version of FMI."""
        return self.elements[variable.valueReference][1] if self.elements else str(variable.type)

    def exact_ranges(self, variables: Iterable[Any]) -> list[tuple[str, float, float]]:
        """Name, least and largest number of variables that are exchanged as ``whole``, as far as doubles hold them."""
        ranges = ((v.name, *RANGES.get(self.own_type(v), RANGES["Int64"])) for v in variables)
        return [(name, max(least, -LARGEST), min(most, LARGEST)) for name, least, most in ranges]

    def taken(self, variable: Any, value: float | int | str, bounded: bool = True) -> float | int | str:
        """Start value as a variable takes it; raises ValueError, if it is ``bounded`` by min and max too."""
        kind, declared = variable.type, variable.declaredType
        if kind == "Enumeration" and declared is not None and declared.items:
            items = {item.name: int(item.value) for item in declared.items}
            number = items.get(value, value) if isinstance(value, str) else value
            if type(number) is not int or number not in items.values():
                raise ValueError(f"must be one of {', '.join(f'{n} {name}' for name, n in items.items())}")
            return number
        if not isinstance(value, ALLOWED[kind]) or isinstance(value, bool) != (kind == "Boolean"):
            raise ValueError(f"must be of type {self.own_type(variable)}")
        if isinstance(value, int | float):
            least, most = RANGES.get(self.own_type(variable), (-math.inf, math.inf))
            low, high = (bounded and (getattr(variable, end) or getattr(declared, end, 0)) for end in ("min", "max"))
            least, most = max(least, float(low or -math.inf)), min(most, float(high or math.inf))
            slack = 1e-9 * abs(value) if kind == "Real" else 0  # bounds are rounded
            if value < least - slack or value > most + slack:
                raise ValueError(f"must be {least} to {most}".replace("-inf ", "up ").replace("to inf", "or more"))
        return value


def has_start_value(variable: Any) -> bool:
    """Whether a start value of a variable may be set before the initialisation (FMI 2.0.4, section 2.2.7)."""
    initial, start = variable.initial, variable.start
    settable = variable.causality in ("input", "parameter") or initial in ("exact", "approx")
    settable = settable or (initial is None and bool(start))
    return settable and variable.variability != "constant" and variable.causality != "independent"


def loadable(fmu: Path) -> Loadable:
    """Unpack an FMU that can be loaded here, once for all its instances; raises ComponentFailed."""
    fmu = Path(fmu)
    try:
        status = fmu.stat()
    except OSError:
        return _loadable(fmu)
    return _known(fmu, status.st_ino, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=16)
def _known(fmu: Path, *content: int) -> Loadable:
    return _loadable(fmu)


def _loadable(fmu: Path) -> Loadable:
    folder, description = describe(fmu, LIBRARIES)
    require_binary(folder, description, fmu)
    try:
        return _of_scalars(folder, _content(folder)) if is_fmi3(description) else Loadable(folder, description)
    except ValueError as error:
        raise ComponentFailed(f"'{fmu}' has {error}") from None


def library_file(folder: Path, description: Any) -> Path:
    """File of the library of an unpacked FMU for this platform; it need not exist."""
    module = LIBRARIES[description.fmiVersion[:3]]
    return Path(module.binary(folder, description.coSimulation.modelIdentifier))


def require_binary(folder: Path, description: Any, fmu: Path) -> None:
    """Raise ComponentFailed for an FMU without a library for this platform."""
    library = library_file(folder, description)
    if not library.is_file():
        raise ComponentFailed(f"'{fmu}' has no binary for {library.parent.name}")


def load_library(folder: Path, description: Any, fmu: Path) -> Any:
    """Return the library of an unpacked FMU in this process; raises ComponentFailed."""
    try:
        return LIBRARIES[description.fmiVersion[:3]].load(folder, description.coSimulation.modelIdentifier)
    except Exception as error:
        raise ComponentFailed(f"cannot load the binary of '{fmu}': {error}") from None


def opening(
    folder: Path, description: Any, name: str, token: str = "", elements: Elements = (), resources: str | None = None
) -> Opening:
    """Data that make an instance of an unpacked FMU; ``token``: another one than that of its description."""
    identifier, token = description.coSimulation.modelIdentifier, token or description.guid or ""
    return Opening(description.fmiVersion[:3], str(folder), identifier, name, token, elements, resources)


def is_fmi3(description: Any) -> bool:
    """Whether a description is one of FMI 3.0."""
    return str(description.fmiVersion).startswith("3.")


def _description(folder: Path, fmu: Path, versions: Collection[str]) -> Any:
    content = _content(folder)
    head = content[:2000].decode("utf-8", "replace")
    version = re.search(r"""fmiVersion\s*=\s*["']([^"']*)""", head)
    supported = f"only FMI {' and '.join(LIBRARIES)} for co-simulation are supported"
    if version and version[1] not in versions:
        raise ComponentFailed(f"'{fmu}' is an FMU of FMI {version[1]}: {supported}")
    try:
        description = _parsed(folder, content)
    except Exception as error:
        raise BadDescription(f"'{fmu}' is not an FMU: bad modelDescription.xml: {error}") from None
    if description.coSimulation is None:
        other = "scheduled execution" if description.modelExchange is None else "model exchange"
        raise ComponentFailed(f"'{fmu}' is an FMU for {other}: {supported}")
    return description


def _content(folder: Path) -> bytes:
    with suppress(OSError):
        return (folder / DESCRIPTION).read_bytes()
    return b""


@lru_cache(maxsize=16)
def _parsed(folder: Path, content: bytes) -> Any:
    """Description in the ``folder`` of an FMU, once for all its instances; ``content``: its bytes, the cache's key.

    FMPy 0.3.32 takes a comment for the type in a SimpleType, and reads neither relativeQuantity of variables nor the
    bounds of unsigned ones (``findings/fmpy_relative_quantity.sh``, ``fmpy_unsigned_bounds.sh``).
    """
    root = etree.fromstring(content, etree.XMLParser(remove_comments=True, remove_pis=True))
    packed = io.BytesIO()
    with ZipFile(packed, "w") as archive:
        archive.writestr(DESCRIPTION, etree.tostring(root))
    description = read_model_description(packed, validate=False)
    nodes = [*root.find("ModelVariables")]
    said = {node.get("name"): ChainMap(*(one.attrib for one in node.iter())) for node in nodes}  # its own or its type's
    for variable in description.modelVariables:
        own = said[(variable.alias or variable).name]
        variable.min, variable.max, relative = (own.get(name) for name in ("min", "max", "relativeQuantity"))
        variable.relativeQuantity = None if relative is None else relative.strip() in ("true", "1")
    return description


@lru_cache(maxsize=16)
def _of_scalars(folder: Path, content: bytes) -> Loadable:
    """FMU of FMI 3.0 with the variables of FMI 2.0; raises ValueError if they are too many."""
    description, elements = _parsed(folder, content), list[tuple[int, str, int, int]]()
    scalars = [
        scalar
        for variable in description.modelVariables
        if variable.type in FMI3_TYPES and variable.causality != "independent"
        for scalar in _scalars(variable, elements)
    ]
    return Loadable(
        folder, _changed(description, modelVariables=scalars), tuple(elements), c_int64, _on_clocks(description)
    )


def _on_clocks(description: Any) -> str:
    variables = description.modelVariables
    clocks = ", ".join(variable.name for variable in variables if variable.type == "Clock")
    clocked = ", ".join(variable.name for variable in variables if variable.clocks)
    held = f": {clocked} may keep their start values" if clocked else ""
    return f"its clocks ({clocks}) need event mode, which is not used{held}" if clocks else ""


def _scalars(variable: Any, elements: list[tuple[int, str, int, int]]) -> Iterator[ModelVariable]:
    size = number_of_elements(variable)
    if len(elements) + size > MAX_ELEMENTS:
        raise ValueError(f"more than {MAX_ELEMENTS} variables and elements of arrays")
    for place, (name, start) in enumerate(zip(element_names(variable), start_values(variable), strict=True)):
        reference = len(elements)
        elements.append((variable.valueReference, variable.type, size, place))
        yield _changed(
            variable, name=name, valueReference=reference, type=FMI3_TYPES[variable.type], shape=None, start=start
        )


def number_of_elements(variable: Any) -> int:
    """Return the number of elements of a variable; a scalar has one."""
    return math.prod(variable.shape or ())


def element_names(variable: Any) -> list[str]:
    """Return the names of the elements of a variable; a scalar is its own."""
    if not variable.shape:
        return [variable.name]
    return [f"{variable.name}[{','.join(str(k + 1) for k in at)}]" for at in np.ndindex(*variable.shape)]


def start_values(variable: Any) -> list[str | None]:
    """Return the start values of the elements of a variable as texts; a single one is that of all."""
    is_list = variable.shape and variable.type != "String" and variable.start is not None
    given = [*variable.start.split()] if is_list else [variable.start]
    return given if len(given) == number_of_elements(variable) else given[:1] * number_of_elements(variable)


def _changed(original: Any, **values: object) -> Any:
    made = copy.copy(original)
    for name, value in values.items():
        setattr(made, name, value)
    return made
