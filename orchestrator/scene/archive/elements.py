"""Elements of an archive: systems in systems, components, signal dictionaries, and their connectors.

They are read from files and documents of the archive, with values as XML Schema writes them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple
from urllib.parse import unquote
from xml.etree.ElementTree import Element as Node
from xml.etree.ElementTree import ParseError, fromstring

from fmus.vehicles.tables import BadInput, value_text
from orchestrator.cosim.base_units import QUANTITIES, UNCHANGED, BaseUnit, Conversion, base_unit, unit_of
from orchestrator.cosim.component import description_of
from orchestrator.files.budget import DOCUMENT, NESTING, OverBudget, UnpackedBudget, read_file
from orchestrator.fmi.fmu_files import unpack
from orchestrator.fmi.slave import ComponentFailed

VERSIONS = "1.0", "2.0"
REAL = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")
INTEGER = re.compile(r"[+-]?\d+")
TRUTH = {"true": True, "1": True, "false": False, "0": False}
FLOATS = "Real", "Float64", "Float32"
WHOLES = "Integer", *(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64))
OTHER_TRANSFORMATIONS = (
    "BooleanMappingTransformation",
    "IntegerMappingTransformation",
    "EnumerationMappingTransformation",
)


class Place(NamedTuple):
    """Where a document is, and what may still be read of the whole archive."""

    folder: Path  # against which its sources are resolved
    where: str  # beginning of messages
    archive: str  # that of messages on the whole archive
    budget: UnpackedBudget
    packages: dict[Path, Path]  # folders of packages that are unpacked already

    def at(self, name: str) -> Place:
        """The same folder, for messages about a part."""
        return self._replace(where=f"{self.where}: {name}")

    def take(self, elements: int, text: bytes | None = None) -> None:
        """Count elements or the text of a document, each time that it is used; raises BadInput."""
        try:
            self.budget.take_elements(elements)
            if text is not None:
                self.budget.take(len(text), DOCUMENT)
        except OverBudget as excess:
            raise BadInput(f"{self.archive} is not read, each use of a document counts: {excess}") from None


def local(element: Node) -> str:
    """Name of an element without its namespace."""
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def children(element: Node | None, *path: str) -> Iterator[Node]:
    """Elements by the names of a path, whatever the prefix of their namespace is."""
    if element is None:
        return
    if not path:
        yield element
        return
    for child in element:
        if local(child) == path[0]:
            yield from children(child, *path[1:])


def child(element: Node | None, *path: str) -> Node | None:
    """First element of a path, or None."""
    return next(children(element, *path), None)


def xml_root(file: Path, place: Place) -> Node:
    """Root of an XML document, which counts; raises BadInput."""
    try:
        text = read_file(file, DOCUMENT)
        root = fromstring(text)
    except (OSError, OverBudget, ParseError, LookupError, ValueError) as error:  # LookupError: an unknown encoding
        raise BadInput(f"{place.where} cannot be read: {error}") from None
    place.take(sum(1 for _ in root.iter()), text)
    return root


def archive_file(source: str, place: Place) -> Path:
    """File of a relative URI; raises BadInput for any other place."""
    path = PurePosixPath(unquote(source))
    if not source or ":" in source or path.is_absolute() or ".." in path.parts or "\0" in str(path):
        raise BadInput(f"{place.where}: source = {value_text(source)}: must be a file in the archive")
    if not (place.folder / path).is_file():
        raise BadInput(f"{place.where}: source = {value_text(source)}: there is no such file in the archive")
    return place.folder / path


def content(element: Node, kind: str, place: Place, component: Place | None = None) -> Node | None:
    """Content ``kind`` of an element: in itself, or in the document of its source; raises BadInput.

    ``component``: folder of the component for sources inside it.
    """
    source = element.get("source")
    if not source:
        return next((one for one in element.iter() if local(one) == kind and one is not element), None)
    base = place
    if element.get("sourceBase", "SSD") == "component":
        if component is None:
            raise BadInput(f"{place.where}: source = {value_text(source)}: only FMUs have files of their own")
        base = component
    root = xml_root(archive_file(source, base), place.at(source))
    if local(root) != kind:
        raise BadInput(f"{place.where}: {source} holds {local(root)}, not {kind}")
    return root


def double(text: str | None) -> float:
    """Double of XML Schema; raises ValueError, also for one that is not finite."""
    text = (text or "").strip()
    if not REAL.fullmatch(text) or not math.isfinite(float(text)):
        raise ValueError(text)
    return float(text)


def boolean(text: str | None) -> bool:
    """Boolean of XML Schema; raises ValueError."""
    try:
        return TRUTH[(text or "false").strip()]
    except KeyError:
        raise ValueError(text) from None


def linear(element: Node, where: str) -> Conversion:
    """Linear transformation in a connection or a mapping; raises BadInput, also for other transformations."""
    for one in element:
        if local(one) in OTHER_TRANSFORMATIONS:
            raise BadInput(f"{where}: a {local(one)} is not supported, only a LinearTransformation")
        if local(one) == "LinearTransformation":
            try:
                return Conversion(double(one.get("factor", "1")), double(one.get("offset", "0")))
            except ValueError:
                raise BadInput(f"{where}: its LinearTransformation must have finite numbers") from None
    return UNCHANGED


def converts_units(element: Node, where: str) -> bool:
    """Whether the units of a connection or a mapping are converted; raises BadInput."""
    try:
        return not boolean(element.get("suppressUnitConversion"))
    except ValueError:
        raise BadInput(f"{where}: suppressUnitConversion must be true or false") from None


def units_of(root: Node | None) -> dict[str, BaseUnit]:
    """Units that a document defines."""
    found = {}
    for unit in children(root, "Units", "Unit"):
        base = child(unit, "BaseUnit")
        if base is not None:
            try:
                exponents = tuple(double(base.get(quantity, "0")) for quantity in QUANTITIES)
                found[unit.get("name", "")] = BaseUnit(
                    exponents, double(base.get("factor", "1")), double(base.get("offset", "0"))
                )
            except ValueError:
                continue  # a unit that is not defined: refused where it is needed
    return found


DOCUMENT_NAME = "SystemStructure.ssd"
FMU, DEFINITION, PACKAGE = (f"application/x-{kind}" for kind in ("fmu-sharedlibrary", "ssp-definition", "ssp-package"))
SOURCES, SINKS = ("output", "calculatedParameter"), ("input", "parameter", "structuralParameter")


class Connector(NamedTuple):
    """Connector of an element."""

    kind: str  # input, output, parameter, calculatedParameter; empty: that of a dictionary, which is both
    unit: str  # empty: none


@dataclass(eq=False)
class Element:
    """Component, system or signal dictionary of the flat system."""

    path: str  # names from the outermost system on, with dots
    place: Place
    node: Node
    units: Mapping[str, BaseUnit]  # of its document
    connectors: dict[str, Connector] = field(default_factory=dict)
    elements: dict[str, Element] = field(default_factory=dict)  # of a system
    dictionaries: dict[str, Element] = field(default_factory=dict)  # of a system
    bindings: list[Node] = field(default_factory=list)
    fmu: Path | None = None  # of a component
    description: Any = None  # of its FMU
    variables: Mapping[str, Any] = field(default_factory=dict)

    def connector(self, name: str) -> Connector | None:
        """Connector by its name; a variable of an FMU that is none is one too."""
        known = self.connectors.get(name)
        variable = self.variables.get(name)
        if variable is None:
            return known if self.fmu is None else None
        unit = unit_of(variable)
        if known is None:
            return Connector(variable.causality, unit)
        if known.unit and unit and known.unit != unit:
            about = f"connector '{self.path}.{name}' has the unit '{known.unit}', and its variable '{unit}'"
            raise BadInput(f"{self.place.where}: {about}: both must have one unit")
        return Connector(
            variable.causality if variable.causality in (*SOURCES, *SINKS) else known.kind, known.unit or unit
        )

    def base(self, name: str, unit: str) -> BaseUnit | None:
        """Unit of a connector in base units, by its FMU or by the archive; None if neither defines it."""
        variable = self.variables.get(name)
        own = base_unit(self.description, variable) if variable is not None and unit_of(variable) == unit else None
        return own or self.units.get(unit)


def read_system(node: Node, path: str, place: Place, units: Mapping[str, BaseUnit], depth: int = 0) -> Element:
    """Read a system with all that is in it; raises BadInput."""
    if depth > NESTING:
        raise BadInput(f"{place.where}: systems are nested more than {NESTING} deep")
    system = Element(path, place, node, units, _connectors(node))
    system.bindings = [*children(node, "ParameterBindings", "ParameterBinding")]
    for one in children(node, "SignalDictionaries", "SignalDictionary"):
        system.dictionaries[one.get("name", "")] = _dictionary(one, system)
    for one in (inner for elements in children(node, "Elements") for inner in elements):
        kind = local(one)
        if kind not in ("System", "Component", "SignalDictionaryReference"):
            continue  # annotations
        name = _name(one, place)
        if name in system.elements:
            raise BadInput(f"{place.where}: two elements of '{path or 'the system'}' are called {value_text(name)}")
        inner_path = f"{path}.{name}" if path else name
        place.take((len(place.where) + len(inner_path)) // NESTING)  # texts that are kept
        if kind == "System":
            system.elements[name] = read_system(one, inner_path, place, units, depth + 1)
        elif kind == "Component":
            system.elements[name] = _component(one, inner_path, place, units, depth)
        else:
            system.elements[name] = Element(inner_path, place, one, units)  # joined to its dictionary later
    return system


def _name(node: Node, place: Place) -> str:
    name = node.get("name", "")
    if not name or set(name) & set("./\\") or not name.isprintable():
        raise BadInput(
            f"{place.where}: an element is called {value_text(name)}: its name must have no dot and no slash"
        )
    return name


def _connectors(node: Node) -> dict[str, Connector]:
    found = {}
    for one in children(node, "Connectors", "Connector"):
        kind = next((inner for inner in one if inner.get("unit")), None)
        found[one.get("name", "")] = Connector(one.get("kind", ""), "" if kind is None else kind.get("unit", ""))
    return found


def _dictionary(node: Node, system: Element) -> Element:
    name = node.get("name", "")
    entries = content(node, "SignalDictionary", system.place.at(name)) if node.get("source") else node
    made = Element(f"{system.path}.{name}" if system.path else name, system.place, node, system.units)
    for one in () if entries is None else entries.iter():
        if local(one) == "DictionaryEntry":
            kind = next((inner for inner in one if inner.get("unit")), None)
            made.connectors[one.get("name", "")] = Connector("", "" if kind is None else kind.get("unit", ""))
    return made


def _component(node: Node, path: str, place: Place, units: Mapping[str, BaseUnit], depth: int) -> Element:
    """An FMU, or the system of another document in its place."""
    here = place._replace(where=f"{place.archive}: {path}")
    kind, use = node.get("type") or FMU, node.get("implementation", "any")
    bindings = [*children(node, "ParameterBindings", "ParameterBinding")]
    if kind in (DEFINITION, PACKAGE):
        file = archive_file(node.get("source", ""), here)
        root, inner = unpacked_archive(file, here) if kind == PACKAGE else (xml_root(file, here), here)
        here.take(len(units))
        made = read_system(system_node(root, here.where), path, inner, units_of(root) | dict(units), depth + 1)
        made.bindings += bindings
        return made
    if kind != FMU or use not in ("any", "CoSimulation"):
        raise BadInput(
            f"{here.where}: a component of type {value_text(kind)}, {use}: only FMUs for co-simulation are run"
        )
    made = Element(path, here, node, units, _connectors(node), bindings=bindings)
    made.fmu = archive_file(node.get("source", ""), here)
    try:
        made.description = description_of(made.fmu)
    except ComponentFailed as failure:
        raise BadInput(f"{here.where}: {failure}") from None
    made.variables = {variable.name: variable for variable in made.description.modelVariables}
    return made


def unpacked_archive(file: Path, place: Place) -> tuple[Node, Place]:
    """Unpack an archive that is named at a place; return the root of its document, and its place. Raises BadInput."""
    try:
        folder = place.packages.get(file) or unpack(file, DOCUMENT_NAME, "SSP archive", place.budget)
    except ComponentFailed as failure:
        raise BadInput(f"{place.where}: {failure}" if f"'{file}'" not in place.where else str(failure)) from None
    place.packages[file] = folder
    return xml_root(folder / DOCUMENT_NAME, place.at(DOCUMENT_NAME)), place._replace(folder=folder)


def system_node(root: Node, where: str) -> Node:
    """System of a document; raises BadInput."""
    system = child(root, "System")
    if system is None:
        raise BadInput(f"{where}: {DOCUMENT_NAME} has no system")
    return system


def fmu_elements(system: Element) -> Iterator[Element]:
    """All components of a system and of those in it."""
    for element in system.elements.values():
        if element.fmu is not None:
            yield element
        else:
            yield from fmu_elements(element)
