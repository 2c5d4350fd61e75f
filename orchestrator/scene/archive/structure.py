"""Structure of an archive: one flat system of FMUs, their start values and connections."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element as Node

from fmus.vehicles.tables import BadInput, path_text
from orchestrator.cosim.base_units import UNCHANGED, Conversion, base_unit, conversion
from orchestrator.files.budget import UnpackedBudget
from orchestrator.scene.archive.elements import (
    VERSIONS,
    Element,
    Place,
    child,
    double,
    fmu_elements,
    read_system,
    system_node,
    units_of,
    unpacked_archive,
)
from orchestrator.scene.archive.flow import ConnectorEnd, FlowingValue, Link, Scalar, links, start_values
from orchestrator.scene.fmu_table import Pair


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
    budget = UnpackedBudget(file.stat().st_size if file.is_file() else 0)
    root, place = unpacked_archive(file, Place(file.parent, where, where, budget, {}))
    if root.get("version") not in VERSIONS:
        raise BadInput(f"{where}: SSP {root.get('version')}: only SSP {' and '.join(VERSIONS)} are run")
    node = system_node(root, where)
    system = read_system(node, "", place, units_of(root))
    members = [*fmu_elements(system)]
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
    taken = set(names)
    for one in members:
        name = one.path.replace(".", "_")
        while one.path not in names and name in taken:
            one.place.take(1)
            name += "_"
        taken.add(names.setdefault(one.path, name))
    return names


def _pairs(all_links: Sequence[Link], names: Mapping[str, str]) -> Iterator[Pair]:
    """Connections from outputs to inputs of FMUs, through connectors of systems and dictionaries."""
    giving: dict[ConnectorEnd, Link] = {}
    for link in all_links:
        if link.target.element.fmu is None and link.target in giving:
            raise BadInput(f"{link.target.element.place.where}: '{link.target}' has another connection")
        giving.setdefault(link.target, link)
    for last in all_links:
        target = last.target
        if target.element.fmu is None:
            continue
        way = [last]
        while way[-1].source.element.fmu is None and (before := giving.get(way[-1].source)) is not None:
            way.append(before)
            target.element.place.take(1)
            if len(way) > len(giving):
                raise BadInput(f"{target.element.place.where}: the connection to '{target}' goes round in a circle")
        source = way[-1].source
        if source.element.fmu is None or target.connector.kind == "parameter":
            if source.element.fmu is not None:
                raise BadInput(f"{target.element.place.where}: '{target}' is a parameter: '{source}' cannot change it")
            continue  # nothing gives: the start value stays
        flowing = FlowingValue(source)
        for link in reversed(way):
            flowing = flowing.through(link)
        transformation = _beyond_units(flowing, source, target)
        yield Pair(names[source.element.path], source.name, names[target.element.path], target.name, transformation)


def _beyond_units(flowing: FlowingValue, source: ConnectorEnd, target: ConnectorEnd) -> Conversion:
    """Transformation of a connection besides the conversion by the units of the variables of both FMUs."""
    given, taken = source.element.variables[source.name], target.element.variables[target.name]
    if given.type != "Real" or taken.type != "Real":
        return flowing.total
    own = conversion(base_unit(source.element.description, given), base_unit(target.element.description, taken))
    if own == UNCHANGED:
        return flowing.total
    if flowing.simple is not None and _alike(own.then(flowing.simple), flowing.total):
        return flowing.simple
    return Conversion(1.0 / own.factor, -own.offset / own.factor).then(flowing.total)


def _alike(one: Conversion, other: Conversion) -> bool:
    return all(abs(a - b) <= 1e-12 * max(abs(a), abs(b)) for a, b in zip(one, other, strict=True))


def _experiment(root: Node, where: str) -> tuple[float, float | None]:
    experiment = child(root, "DefaultExperiment")
    if experiment is None:
        return 0.0, None
    try:
        start, stop = double(experiment.get("startTime", "0")), experiment.get("stopTime")
        end = None if stop is None else double(stop)
    except ValueError:
        raise BadInput(f"{where}: its DefaultExperiment must have finite numbers") from None
    if end is not None and end <= start:
        raise BadInput(f"{where}: its DefaultExperiment ends at {end:g} s, not after its start at {start:g} s")
    return start, end
