"""Connections of an archive from connector to connector, what flows through several of them, and start values.

Start and end of a connection say nothing about its direction: that is from the connector that gives to the one that
takes, seen from the system that they are in.

Parameter sets and their mappings give start values of FMU variables. Bindings of a system outweigh those of what is in
it, later ones earlier ones (SSP 1.0, ParameterBinding).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element as Node

from fmus.vehicles.tables import BadInput, value_text
from orchestrator.cosim.base_units import UNCHANGED, BaseUnit, Conversion, conversion
from orchestrator.files.messages import LOG
from orchestrator.fmi.fmu_files import unpack
from orchestrator.fmi.model_description import has_start_value, loadable
from orchestrator.scene.archive.elements import (
    FLOATS,
    INTEGER,
    SINKS,
    SOURCES,
    WHOLES,
    Connector,
    Element,
    Place,
    boolean,
    child,
    children,
    content,
    converts_units,
    double,
    linear,
    local,
    units_of,
)

ENDS = ("startElement", "startConnector"), ("endElement", "endConnector")


class ConnectorEnd(NamedTuple):
    """Connector of an element."""

    element: Element
    name: str

    def __str__(self) -> str:
        return f"{self.element.path}.{self.name}" if self.element.path else self.name

    @property
    def connector(self) -> Connector:
        """Its kind and unit; raises BadInput if there is no such connector."""
        found = self.element.connector(self.name)
        if found is None:
            raise BadInput(f"{self.element.place.where}: there is no connector '{self}'")
        return found

    def base(self, unit: str) -> BaseUnit | None:
        """A unit in base units."""
        return self.element.base(self.name, unit)


class Link(NamedTuple):
    """Connection from one end to another."""

    source: ConnectorEnd
    target: ConnectorEnd
    transformation: Conversion  # after the conversion of units
    converts: bool  # units are converted


class FlowingValue(NamedTuple):
    """Value on its way through links."""

    end: ConnectorEnd
    total: Conversion = UNCHANGED  # from the value where it began
    unit: str = ""  # that it has by now; empty: unknown
    unit_end: ConnectorEnd | None = None  # connector by which the unit is defined
    simple: Conversion | None = UNCHANGED  # transformation behind conversions of units alone; None: before some
    begin: ConnectorEnd | None = None  # where it began, if it has gone through links

    def through(self, link: Link) -> FlowingValue:
        """The value behind a link; raises BadInput for units that cannot be converted."""
        flowing = self.seen_at(link.source)
        target = link.target.connector
        converted, unit_end = UNCHANGED, flowing.unit_end
        if link.converts and flowing.unit and target.unit and flowing.unit != target.unit and unit_end is not None:
            converted = converted_units((unit_end, flowing.unit), (link.target, target.unit), link)
        simple = flowing.simple
        if converted != UNCHANGED and simple != UNCHANGED:
            simple = None
        if simple is not None:
            simple = simple.then(link.transformation) if link.converts else None
        total = flowing.total.then(converted).then(link.transformation)
        unit_end = link.target if target.unit else unit_end
        return FlowingValue(link.target, total, target.unit or flowing.unit, unit_end, simple, self.begin or self.end)

    @classmethod
    def begun_at(cls, end: ConnectorEnd) -> FlowingValue:
        """The value that begins at a connector, in its unit."""
        return cls(end).seen_at(end)

    def seen_at(self, end: ConnectorEnd) -> FlowingValue:
        """The value with the unit of a connector, if that has one."""
        unit = end.connector.unit
        return self._replace(unit=unit, unit_end=end) if unit else self


def converted_units(one: tuple[ConnectorEnd, str], other: tuple[ConnectorEnd, str], what: object) -> Conversion:
    """Conversion from the unit of one connector to that of another; raises BadInput if there is none."""
    bases = [end.base(unit) for end, unit in (one, other)]
    for (end, unit), base in zip((one, other), bases, strict=True):
        if base is None:
            raise BadInput(f"{end.element.place.where}: '{end}' has the unit '{unit}', which is not defined")
    assert bases[0] is not None
    assert bases[1] is not None
    if bases[0].exponents != bases[1].exponents:
        where = f"{other[0].element.place.where}: '{other[0]}'"
        raise BadInput(f"{where} has the unit '{other[1]}', and '{one[0]}' the unit '{one[1]}'")
    return conversion(*bases)


def links(system: Element, outer: Sequence[Element] = ()) -> Iterator[Link]:
    """Connections of a system and of those in it; raises BadInput."""
    systems = (*outer, system)
    for name, element in system.elements.items():
        if (wanted := element.node.get("dictionary")) is not None:
            found = next((one.dictionaries[wanted] for one in reversed(systems) if wanted in one.dictionaries), None)
            if found is None:
                raise BadInput(f"{system.place.where}: there is no signal dictionary {value_text(wanted)}")
            system.elements[name] = found
    for node in children(system.node, "Connections", "Connection"):
        yield _link(node, system)
    for element in system.elements.values():
        yield from links(element, systems) if local(element.node) == "System" else ()


def _link(node: Node, system: Element) -> Link:
    ends = []
    for of, at in ENDS:
        element, connector = node.get(of) or None, node.get(at, "")  # OMSimulator writes an empty name of the system
        if element is not None and element not in system.elements:
            raise BadInput(f"{system.place.where}: no component {value_text(element)}, which a connection names")
        ends.append(ConnectorEnd(system if element is None else system.elements[element], connector))
    words = f"{system.place.where}: connection of '{ends[0]}' and '{ends[1]}'"
    gives = [_gives(end, end.element is system) for end in ends]
    if gives[0] is None and gives[1] is not None:
        gives[0] = not gives[1]
    if gives[1] is None and gives[0] is not None:
        gives[1] = not gives[0]
    if gives[0] == gives[1]:
        kinds = " and ".join(end.connector.kind or "an entry of a signal dictionary" for end in ends)
        raise BadInput(f"{words}: they are {kinds}: one must give, and one take")
    source, target = ends if gives[0] else reversed(ends)
    converts = converts_units(node, words)
    return Link(source, target, linear(node, words), converts)


def _gives(end: ConnectorEnd, is_outer: bool) -> bool | None:
    """Whether a connector gives values, seen from inside the system; None: either."""
    kind = end.connector.kind
    if not kind:
        return None
    if kind not in (*SOURCES, *SINKS):
        raise BadInput(f"{end.element.place.where}: '{end}' is of causality {kind}: it can have no connection")
    return (kind in SOURCES) != is_outer


Scalar = bool | int | float | str  # value of a variable
Values = dict[str, dict[str, Scalar]]  # by the path of a component and variable


class Given(NamedTuple):
    """Value in a parameter set."""

    name: str
    value: Scalar
    kind: str  # Real, Integer, Boolean, String or Enumeration
    unit: str
    base: BaseUnit | None
    where: str


class Target(NamedTuple):
    """Name in an element for which a value is, and its way there."""

    name: str
    transformation: Conversion = UNCHANGED
    converts: bool = True


def start_values(system: Element, links: Sequence[Link]) -> tuple[Values, list[str]]:
    """Start values of the variables of all components, and sentences about values that nothing takes.

    Raises BadInput.
    """
    onward: dict[ConnectorEnd, list[Link]] = defaultdict(list)
    for link in links:
        onward[link.source].append(link)
    values: Values = defaultdict(dict)
    unknown: list[str] = []
    _apply(system, onward, values, unknown)
    return values, unknown


def _apply(element: Element, onward: Mapping[ConnectorEnd, list[Link]], values: Values, unknown: list[str]) -> None:
    for inner in element.elements.values():
        _apply(inner, onward, values, unknown)
    for binding in element.bindings:
        place = element.place if element.fmu is not None or not element.path else element.place.at(element.path)
        inside = place._replace(folder=unpack(element.fmu)) if element.fmu is not None else None
        mapping = child(binding, "ParameterMapping")
        targets = None if mapping is None else _targets(content(mapping, "ParameterMapping", place, inside), place)
        for given in _given(content(binding, "ParameterSet", place, inside), binding.get("prefix", ""), place):
            for target in [Target(given.name)] if targets is None else targets.get(given.name, ()):
                place.take(1)
                reached = [*_reached(element, target.name, onward)]
                if not reached:
                    unknown.append(f"{given.where} is ignored: there is no '{target.name}' to take it")
                for flowing in reached:
                    component, name = flowing.end
                    values[component.path][name] = _coerced(given, target, flowing)


def _targets(root: Node | None, place: Place) -> dict[str, list[Target]]:
    """Targets by the names of the parameter set."""
    found: dict[str, list[Target]] = defaultdict(list)
    for entry in children(root, "MappingEntry"):
        where = f"{place.where}: mapping of {value_text(entry.get('source'))}"
        converts = converts_units(entry, where)
        found[entry.get("source", "")].append(Target(entry.get("target", ""), linear(entry, where), converts))
    return found


def _given(root: Node | None, prefix: str, place: Place) -> Iterator[Given]:
    units, names = units_of(root), set[str]()
    for parameter in children(root, "Parameters", "Parameter"):
        name = prefix + parameter.get("name", "")
        where = f"{place.where}: parameter {value_text(name)}"
        if name in names:
            raise BadInput(f"{where}: it is given twice")
        names.add(name)
        node = next((one for one in parameter if local(one) != "Annotations"), None)
        kind, text = ("", "") if node is None else (local(node), node.get("value", ""))
        unit = "" if node is None else node.get("unit", "")
        try:
            value: Scalar
            if kind in FLOATS:
                kind, value = "Real", double(text)
            elif kind in WHOLES and INTEGER.fullmatch(text.strip()):
                kind, value = "Integer", int(text)
            elif kind == "Boolean":
                value = boolean(text or "?")
            elif kind in ("String", "Enumeration"):
                value = text
            else:
                raise ValueError
        except ValueError:
            allowed = "must be one finite Real, an Integer, a Boolean, a String or an Enumeration"
            raise BadInput(f"{where} = {value_text(text)} ({kind or 'no type'}): {allowed}") from None
        yield Given(name, value, kind, unit, units.get(unit), where)


def _reached(element: Element, name: str, onward: Mapping[ConnectorEnd, list[Link]]) -> Iterator[FlowingValue]:
    """Variables of components that a hierarchical name stands for."""
    if element.fmu is not None:
        variable = element.variables.get(name)
        if variable is not None and has_start_value(variable):
            yield FlowingValue.begun_at(ConnectorEnd(element, name))
        return
    head, dot, rest = name.partition(".")
    if dot and head in element.elements:
        yield from _reached(element.elements[head], rest, onward)
    elif name in element.connectors:
        ways, seen = [FlowingValue.begun_at(ConnectorEnd(element, name))], set()
        for way in ways:
            for link in onward.get(way.end, ()):
                element.place.take(1)
                if link.target in seen:
                    continue
                seen.add(link.target)
                after = way.through(link)
                if link.target.element.fmu is None:
                    ways.append(after)
                elif has_start_value(link.target.element.variables[link.target.name]):
                    yield after


def _coerced(given: Given, target: Target, flowing: FlowingValue) -> Scalar:
    """Value of a variable, in its unit and of its type."""
    component, name = flowing.end
    variable, value = component.variables[name], given.value
    what = f"{given.where} = {value_text(value)} ({given.kind})"
    if variable.type == "Real" and given.kind in ("Real", "Integer"):
        value = flowing.total.factor * _in_unit(given, target, flowing, what) + flowing.total.offset
    elif given.kind == "Real" and float(value).is_integer():
        value = int(value)
    try:
        return loadable(component.fmu or Path()).taken(variable, value)
    except ValueError as error:
        raise BadInput(f"{what}: '{component.path}.{name}' {error}") from None


def _in_unit(given: Given, target: Target, flowing: FlowingValue, what: str) -> float:
    """Value in the unit in which its way begins."""
    value = float(given.value)
    first = flowing.begin or flowing.end
    wanted, unit, base = first.connector.unit, given.unit, given.base or first.element.units.get(given.unit)
    if base is None and unit[:1] == "[":
        unit = unit[1:-1]
        base = first.element.units.get(unit)
        LOG.warning("%s: the unit '%s' is not defined: '%s' is taken", what, given.unit, unit)
    if unit and unit != wanted and (base is None or (wanted and target.converts)):
        bases = base, first.base(wanted)
        if bases[0] is None or bases[1] is None or bases[0].exponents != bases[1].exponents:
            undefined = next((unit for unit, base in zip((unit, wanted), bases, strict=True) if base is None), "")
            why = f"the unit '{undefined}' is not defined" if undefined else f"'{first}' has the unit '{wanted}'"
            raise BadInput(f"{what}, in '{given.unit}': {why}")
        factor, offset = conversion(*bases)
        value = factor * value + offset
    factor, offset = target.transformation
    return factor * value + offset
