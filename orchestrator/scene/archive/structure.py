"""Structure of an archive: one flat system of FMUs, their start values and connections.

Start and end of a connection say nothing about its direction: that is from the connector that gives to the one that
takes, seen from the system that they are in.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element as Node

from fmus.vehicle import BadInput, path_text, value_text
from orchestrator.cosim.model_description import UNCHANGED, BaseUnit, Conversion, base_unit, conversion
from orchestrator.scene.archive.elements import (
    SINKS,
    SOURCES,
    VERSIONS,
    Connector,
    Element,
    child,
    children,
    components,
    linear,
    number,
    opened,
    read_system,
    system_of,
    truth,
    units_of,
)
from orchestrator.scene.archive.start_values import Scalar, start_values
from orchestrator.scene.fmu_table import Pair

ENDS = ("startElement", "startConnector"), ("endElement", "endConnector")


class End(NamedTuple):
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

    source: End
    target: End
    transformation: Conversion  # after the conversion of units
    converts: bool  # units are converted


class Stream(NamedTuple):
    """Value on its way through links."""

    end: End
    total: Conversion = UNCHANGED  # from the value where it began
    unit: str = ""  # that it has by now; empty: unknown
    unit_end: End | None = None  # connector by which the unit is defined
    simple: Conversion | None = UNCHANGED  # transformation behind conversions of units alone; None: before some
    begin: End | None = None  # where it began, if it has gone through links

    def through(self, link: Link) -> Stream:
        """The value behind a link; raises BadInput for units that cannot be converted."""
        stream = self.seen_at(link.source)
        target = link.target.connector
        converted, unit_end = UNCHANGED, stream.unit_end
        if link.converts and stream.unit and target.unit and stream.unit != target.unit and unit_end is not None:
            converted = converted_units((unit_end, stream.unit), (link.target, target.unit), link)
        simple = stream.simple
        if converted != UNCHANGED and simple != UNCHANGED:
            simple = None
        if simple is not None:
            simple = simple.then(link.transformation) if link.converts else None
        total = stream.total.then(converted).then(link.transformation)
        unit_end = link.target if target.unit else unit_end
        return Stream(link.target, total, target.unit or stream.unit, unit_end, simple, self.begin or self.end)

    def seen_at(self, end: End) -> Stream:
        """The value with the unit of a connector, if that has one."""
        unit = end.connector.unit
        return self._replace(unit=unit, unit_end=end) if unit else self


def converted_units(one: tuple[End, str], other: tuple[End, str], what: object) -> Conversion:
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
        yield from links(element, systems) if element.fmu is None else ()


def _link(node: Node, system: Element) -> Link:
    ends = []
    for of, at in ENDS:
        element, connector = node.get(of) or None, node.get(at, "")  # OMSimulator writes an empty name of the system
        if element is not None and element not in system.elements:
            raise BadInput(f"{system.place.where}: no component {value_text(element)}, which a connection names")
        ends.append(End(system if element is None else system.elements[element], connector))
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
    try:
        converts = not truth(node.get("suppressUnitConversion"))
    except ValueError:
        raise BadInput(f"{words}: suppressUnitConversion must be true or false") from None
    return Link(source, target, linear(node, words), converts)


def _gives(end: End, is_outer: bool) -> bool | None:
    """Whether a connector gives values, seen from inside the system; None: either."""
    kind = end.connector.kind
    if not kind:
        return None
    if kind not in (*SOURCES, *SINKS):
        raise BadInput(f"{end.element.place.where}: '{end}' is of causality {kind}: it can have no connection")
    return (kind in SOURCES) != is_outer


LONGEST_WAY = 100  # connections from an output to an input


class Structure(NamedTuple):
    """Contents of an archive."""

    name: str
    title: str
    folder: Path  # in which it is unpacked
    fmus: Mapping[str, Path]  # by component
    values: Mapping[str, dict[str, Scalar]]  # of parameters and inputs, by component, in the units of the FMU
    connections: tuple[Pair, ...]
    ignored: tuple[str, ...]  # sentences about values that nothing takes
    start: float  # s, of the DefaultExperiment
    stop: float | None  # s, its end


def read_structure(file: Path) -> Structure:
    """Unpack an SSP archive into the cache and read its structure; raises BadInput with one sentence."""
    where = path_text(file)
    root, place = opened(file, where)
    if root.get("version") not in VERSIONS:
        raise BadInput(f"{where}: SSP {root.get('version')}: only SSP {' and '.join(VERSIONS)} are run")
    node = system_of(root, where)
    system = read_system(node, "", place, units_of(root))
    members = [*components(system)]
    if not members:
        raise BadInput(f"{where}: its system has no components")
    names = _names(members)
    all_links = [*links(system)]
    values, ignored = start_values(system, all_links)
    start, stop = _experiment(root, where)
    return Structure(
        root.get("name") or file.stem,
        " ".join((node.get("description") or root.get("name") or file.stem).split()),
        place.folder,
        {names[one.path]: one.fmu for one in members if one.fmu is not None},
        {names[one.path]: values.get(one.path, {}) for one in members},
        tuple(_pairs(all_links, names)),
        tuple(dict.fromkeys(ignored)),
        start,
        stop,
    )


def _names(members: Sequence[Element]) -> dict[str, str]:
    """Names of components in the flat system by their paths: a.b.c is a_b_c, unless that is taken."""
    names: dict[str, str] = {one.path: one.path for one in members if "." not in one.path}
    for one in members:
        name = one.path.replace(".", "_")
        while one.path not in names and name in names.values():
            name += "_"
        names.setdefault(one.path, name)
    return names


def _pairs(all_links: Sequence[Link], names: Mapping[str, str]) -> Iterator[Pair]:
    """Connections from outputs to inputs of FMUs, through connectors of systems and dictionaries."""
    giving: dict[End, Link] = {}
    for link in all_links:
        if link.target.element.fmu is None and link.target in giving:
            raise BadInput(f"{link.target.element.place.where}: '{link.target}' has another connection")
        giving.setdefault(link.target, link)
    for last in all_links:
        target = last.target
        if target.element.fmu is None:
            continue
        way = [last]
        while way[0].source.element.fmu is None and (before := giving.get(way[0].source)) is not None:
            way.insert(0, before)
            if len(way) > LONGEST_WAY:
                raise BadInput(f"{target.element.place.where}: the connection to '{target}' goes round in a circle")
        source = way[0].source
        if source.element.fmu is None or target.connector.kind == "parameter":
            if source.element.fmu is not None:
                raise BadInput(f"{target.element.place.where}: '{target}' is a parameter: '{source}' cannot change it")
            continue  # nothing gives: the start value stays
        stream = Stream(source)
        for link in way:
            stream = stream.through(link)
        transformation = _beyond_units(stream, source, target)
        yield Pair(names[source.element.path], source.name, names[target.element.path], target.name, transformation)


def _beyond_units(stream: Stream, source: End, target: End) -> Conversion:
    """Transformation of a connection besides the conversion by the units of the variables of both FMUs."""
    given, taken = source.element.variables[source.name], target.element.variables[target.name]
    if given.type != "Real" or taken.type != "Real":
        return stream.total
    own = conversion(base_unit(source.element.description, given), base_unit(target.element.description, taken))
    if own == UNCHANGED:
        return stream.total
    if stream.simple is not None and _alike(own.then(stream.simple), stream.total):
        return stream.simple
    return Conversion(1.0 / own.factor, -own.offset / own.factor).then(stream.total)


def _alike(one: Conversion, other: Conversion) -> bool:
    return all(abs(a - b) <= 1e-12 * max(abs(a), abs(b)) for a, b in zip(one, other, strict=True))


def _experiment(root: Node, where: str) -> tuple[float, float | None]:
    experiment = child(root, "DefaultExperiment")
    if experiment is None:
        return 0.0, None
    try:
        start, stop = number(experiment.get("startTime", "0")), experiment.get("stopTime")
        end = None if stop is None else number(stop)
    except ValueError:
        raise BadInput(f"{where}: its DefaultExperiment must have finite numbers") from None
    if end is not None and end <= start:
        raise BadInput(f"{where}: its DefaultExperiment ends at {end:g} s, not after its start at {start:g} s")
    return start, end
