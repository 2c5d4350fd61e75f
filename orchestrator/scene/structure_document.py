"""SystemStructure.ssd of a system of FMUs: components, their connectors and parameters, connections.

Source: System Structure and Parameterization 1.0 (Modelica Association, 2019), sections 4.4 and 5.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, register_namespace, tostring

from orchestrator.cosim.component import LINK_FAMILIES
from orchestrator.cosim.graph import Connection

DOCUMENT_NAME, VERSION = "SystemStructure.ssd", "1.0"
NAMESPACES = {
    letters: f"http://ssp-standard.org/SSP1/SystemStructure{name}"
    for letters, name in (("ssc", "Common"), ("ssd", "Description"), ("ssv", "ParameterValues"))
}
ENDS = ("startElement", "startConnector", "endElement", "endConnector")  # attributes of a connection


class StructuredComponent(NamedTuple):
    """An FMU of the archive, under the name of its instance."""

    name: str
    source: str  # path in the archive
    description: Element  # root of its modelDescription.xml


def structure_document(
    name: str,
    text: str,
    tool: str,
    components: Sequence[StructuredComponent],
    connections: Iterable[Connection],
    stop: float,
) -> bytes:
    """SystemStructure.ssd: outputs, parameters and connected inputs are connectors, with units.

    The start values of all parameters are a parameter set of each component, so that a system of FMUs of the same
    shapes becomes this one by its document alone. All sets have the name of the system: some tools choose by name.
    Outputs of links are left out: there are 700 to a track. Inputs without a connection are left out too, because some
    tools set every input connector to zero.

    :param text: description of the system, one line.
    :param stop: end of the DefaultExperiment, s; it begins at 0.
    """
    for letters, namespace in NAMESPACES.items():
        register_namespace(letters, namespace)
    root = Element(_tag("ssd:SystemStructureDescription"), version=VERSION, name=name, generationTool=tool)
    system = SubElement(root, _tag("ssd:System"), name=name, description=text)
    elements = SubElement(system, _tag("ssd:Elements"))
    pairs = [
        (connection.source, output, connection.target, into)
        for connection in connections
        for output, into in zip(connection.outputs, connection.inputs, strict=True)
    ]
    for component in components:
        _add_component(elements, component, {into for _, _, target, into in pairs if target == component.name}, name)
    if pairs:
        wiring = SubElement(system, _tag("ssd:Connections"))
        for pair in pairs:
            SubElement(wiring, _tag("ssd:Connection"), dict(zip(ENDS, pair, strict=True)))
    _add_units(root, components)
    SubElement(root, _tag("ssd:DefaultExperiment"), startTime="0.0", stopTime=repr(float(stop)))
    indent(root)
    return bytes(tostring(root, encoding="utf-8", xml_declaration=True))


def _tag(name: str) -> str:
    letters, local = name.split(":")
    return f"{{{NAMESPACES[letters]}}}{local}"


def _add_component(parent: Element, component: StructuredComponent, connected: Collection[str], system: str) -> None:
    element = SubElement(
        parent,
        _tag("ssd:Component"),
        name=component.name,
        type="application/x-fmu-sharedlibrary",
        source=component.source,
        implementation="CoSimulation",
    )
    connectors = SubElement(element, _tag("ssd:Connectors"))
    for variable in component.description.iter("ScalarVariable"):
        name, causality, kind = variable.get("name", ""), variable.get("causality", ""), variable[0]
        shown = causality in ("output", "parameter") or name in connected
        if shown and not name.startswith(LINK_FAMILIES):
            connector = SubElement(connectors, _tag("ssd:Connector"), name=name, kind=causality)
            unit = kind.get("unit")
            SubElement(connector, _tag(f"ssc:{kind.tag}"), {"unit": unit} if unit else {})
    bindings = SubElement(element, _tag("ssd:ParameterBindings"))
    values = SubElement(SubElement(bindings, _tag("ssd:ParameterBinding")), _tag("ssd:ParameterValues"))
    chosen = SubElement(values, _tag("ssv:ParameterSet"), version=VERSION, name=system)
    parameters = SubElement(chosen, _tag("ssv:Parameters"))
    for variable in component.description.iter("ScalarVariable"):
        if variable.get("causality") == "parameter":
            parameter = SubElement(parameters, _tag("ssv:Parameter"), name=variable.get("name", ""))
            SubElement(parameter, _tag(f"ssv:{variable[0].tag}"), value=variable[0].get("start", ""))


def _add_units(root: Element, components: Sequence[StructuredComponent]) -> None:
    """Add the units of all components, each once; equal names have equal definitions in our FMUs."""
    units = {
        unit.get("name", ""): unit.find("BaseUnit")
        for component in components
        for unit in component.description.iter("Unit")
    }
    if units:
        parent = SubElement(root, _tag("ssd:Units"))
        for name, base in units.items():
            unit = SubElement(parent, _tag("ssc:Unit"), name=name)
            SubElement(unit, _tag("ssc:BaseUnit"), {} if base is None else base.attrib)
