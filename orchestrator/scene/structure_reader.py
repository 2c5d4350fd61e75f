"""SSP archive of anyone: its FMUs, their parameter values, connections, end of the experiment.

Source: System Structure and Parameterization 1.0 (Modelica Association, 2019), sections 4 and 5. What is not supported
is refused by name, because it would change the results.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import NamedTuple
from xml.etree.ElementTree import Element, ParseError, fromstring

from fmus.vehicle import BadInput, path_text, value_text
from orchestrator.cosim.base_units import Conversion
from orchestrator.cosim.fmu_files import unpack
from orchestrator.cosim.graph import ComponentFailed
from orchestrator.files.budget import DOCUMENT, OverBudget, read_file
from orchestrator.scene.pair import Pair
from orchestrator.scene.structure_document import DOCUMENT_NAME, ENDS, NAMESPACES, VERSION

Scalar = bool | int | float | str  # value of a parameter
FMU_TYPES = ("application/x-fmu-sharedlibrary", None)
UNSUPPORTED = {
    "System": "systems in systems",
    "SignalDictionaryReference": "signal dictionaries",
    "SignalDictionary": "signal dictionaries",
    "ParameterMapping": "mappings of parameters",
    "BooleanMappingTransformation": "conversions on connections",
    "IntegerMappingTransformation": "conversions on connections",
    "EnumerationMappingTransformation": "conversions on connections",
}


class Structure(NamedTuple):
    """Contents of an archive."""

    name: str
    title: str
    folder: Path  # in which it is unpacked
    fmus: Mapping[str, Path]  # by component
    values: Mapping[str, dict[str, Scalar]]  # of parameters, by component
    units: Mapping[tuple[str, str], str]  # of connectors, by component and connector
    connections: tuple[Pair, ...]
    unconverted: tuple[Pair, ...]  # connections with suppressUnitConversion
    stop: float | None  # s, end of the DefaultExperiment


def read_structure(file: Path) -> Structure:
    """Unpack an SSP archive into the cache and read its structure; raises BadInput with one sentence."""
    try:
        folder = unpack(file, DOCUMENT_NAME, "SSP archive")
    except ComponentFailed as failure:
        raise BadInput(str(failure)) from None
    where = path_text(file)
    root = _document(folder / DOCUMENT_NAME, f"{where}: {DOCUMENT_NAME}")
    if root.get("version") != VERSION:
        raise BadInput(f"{where}: SSP {root.get('version')}: only SSP {VERSION} is run")
    system = root.find("ssd:System", NAMESPACES)
    if system is None:
        raise BadInput(f"{where}: {DOCUMENT_NAME} has no system")
    for element in system.iter():
        if element is not system and (what := UNSUPPORTED.get(_local(element))):
            raise BadInput(f"{where}: {what} are not supported ({_local(element)})")
    if system.find("ssd:ParameterBindings", NAMESPACES) is not None:
        raise BadInput(f"{where}: parameter values of the whole system are not supported, only those of components")
    elements = system.findall("ssd:Elements/ssd:Component", NAMESPACES)
    components = {_name(one, where): one for one in elements}
    if not components or len(components) < len(elements):
        raise BadInput(f"{where}: its system must have components, each with a name of its own")
    connections = system.findall("ssd:Connections/ssd:Connection", NAMESPACES)
    return Structure(
        root.get("name") or file.stem,
        " ".join((system.get("description") or root.get("name") or file.stem).split()),
        folder,
        {name: _fmu(component, folder, f"{where}: {name}") for name, component in components.items()},
        {name: dict(_values(component, folder, f"{where}: {name}")) for name, component in components.items()},
        {(name, at): unit for name, component in components.items() for at, unit in _units(component)},
        tuple(_pair(one, where) for one in connections),
        tuple(_pair(one, where) for one in connections if one.get("suppressUnitConversion") in ("true", "1")),
        _stop(root, where),
    )


def _document(file: Path, where: str) -> Element:
    try:
        return fromstring(read_file(file, DOCUMENT))
    except (OSError, OverBudget, ParseError, LookupError, ValueError) as error:  # LookupError: an unknown encoding
        raise BadInput(f"{where} cannot be read: {error}") from None


def _local(element: Element) -> str:
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def _name(component: Element, where: str) -> str:
    name = component.get("name", "")
    if not name or set(name) & set("./\\") or not name.isprintable():
        raise BadInput(f"{where}: a component is called {value_text(name)}: its name must have no dot and no slash")
    return name


def _inside(source: str, folder: Path, where: str) -> Path:
    """File in the archive, relative to its root; raises BadInput for any other place."""
    path = PurePosixPath(source)
    if not source or ":" in source or path.is_absolute() or ".." in path.parts:
        raise BadInput(f"{where}: source = {value_text(source)}: must be a file in the archive")
    if not (folder / path).is_file():
        raise BadInput(f"{where}: source = {value_text(source)}: there is no such file in the archive")
    return folder / path


def _fmu(component: Element, folder: Path, where: str) -> Path:
    kind, use = component.get("type"), component.get("implementation", "any")
    if kind not in FMU_TYPES or use not in ("any", "CoSimulation"):
        raise BadInput(f"{where}: a component of type {value_text(kind)}, {use}: only FMUs for co-simulation are run")
    return _inside(component.get("source", ""), folder, where)


def _values(component: Element, folder: Path, where: str) -> Iterator[tuple[str, Scalar]]:
    """Parameter values of a component, of the document itself or of .ssv files in the archive; later ones count."""
    for binding in component.iterfind("ssd:ParameterBindings/ssd:ParameterBinding", NAMESPACES):
        if binding.get("prefix") or binding.get("sourceBase", "SSD") != "SSD":
            raise BadInput(f"{where}: a prefix or a sourceBase of parameter values is not supported")
        if source := binding.get("source"):
            root: Element | None = _document(_inside(source, folder, where), f"{where}: {source}")
        else:
            root = binding.find("ssd:ParameterValues/ssv:ParameterSet", NAMESPACES)
        for parameter in () if root is None else root.iterfind("ssv:Parameters/ssv:Parameter", NAMESPACES):
            yield parameter.get("name", ""), _value(parameter, where)


def _value(parameter: Element, where: str) -> Scalar:
    kind, value = (_local(parameter[0]), parameter[0].get("value", "")) if len(parameter) else ("", "")
    try:
        match kind:
            case "Real" if parameter[0].get("unit") is None:
                return float(value)
            case "Integer":
                return int(value)
            case "Boolean":
                return {"true": True, "1": True, "false": False, "0": False}[value]
            case "String":
                return value
    except (ValueError, LookupError):
        pass
    about = f"{where}: parameter {value_text(parameter.get('name'))}"
    raise BadInput(f"{about}: must be a Real without a unit of its own, an Integer, a Boolean or a String")


def _units(component: Element) -> Iterator[tuple[str, str]]:
    for connector in component.iterfind("ssd:Connectors/ssd:Connector", NAMESPACES):
        if len(connector) and (unit := connector[0].get("unit")):
            yield connector.get("name", ""), unit


def _pair(connection: Element, where: str) -> Pair:
    """Connection of two components, with its LinearTransformation; raises BadInput."""
    source, output, target, into = (connection.get(end) for end in ENDS)
    if source is None or output is None or target is None or into is None:
        ends = ", ".join(f"{end} = {value_text(connection.get(end))}" for end in ENDS)
        raise BadInput(f"{where}: connection {ends}: only connections between components are supported")
    linear = connection.find("ssc:LinearTransformation", NAMESPACES)
    try:
        numbers = {key: float(value) for key, value in ({} if linear is None else linear.attrib).items()}
        transformation = Conversion(numbers.get("factor", 1.0), numbers.get("offset", 0.0))
    except ValueError:
        raise BadInput(f"{where}: connection to {target}.{into}: its LinearTransformation must have numbers") from None
    return Pair(source, output, target, into, transformation)


def _stop(root: Element, where: str) -> float | None:
    experiment = root.find("ssd:DefaultExperiment", NAMESPACES)
    if experiment is None:
        return None
    try:
        start, stop = float(experiment.get("startTime", "0")), experiment.get("stopTime")
        if start != 0.0:
            raise ValueError
        return None if stop is None else float(stop)
    except ValueError:
        raise BadInput(f"{where}: its DefaultExperiment must begin at 0 and have numbers") from None
