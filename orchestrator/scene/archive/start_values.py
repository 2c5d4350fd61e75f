"""Parameter sets of an archive and their mappings, as start values of FMU variables.

Bindings of a system outweigh those of what is in it, later ones earlier ones (SSP 1.0, ParameterBinding).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple
from xml.etree.ElementTree import Element as Node

from fmus.vehicle import BadInput, value_text
from orchestrator.cosim.fmu_files import unpack
from orchestrator.cosim.model_description import UNCHANGED, BaseUnit, Conversion, conversion
from orchestrator.scene.archive.elements import (
    FLOATS,
    INTEGER,
    WHOLES,
    Element,
    Place,
    child,
    children,
    content,
    linear,
    local,
    number,
    truth,
    units_of,
)
from orchestrator.scene.archive.structure import End, Link, Stream

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
    onward: dict[End, list[Link]] = defaultdict(list)
    for link in links:
        onward[link.source].append(link)
    values: Values = defaultdict(dict)
    unknown: list[str] = []
    _apply(system, onward, values, unknown)
    return values, unknown


def _apply(element: Element, onward: Mapping[End, list[Link]], values: Values, unknown: list[str]) -> None:
    for inner in element.elements.values():
        _apply(inner, onward, values, unknown)
    for binding in element.bindings:
        place = element.place if element.fmu is not None or not element.path else element.place.at(element.path)
        inside = Place(unpack(element.fmu), place.where) if element.fmu is not None else None
        mapping = child(binding, "ParameterMapping")
        targets = None if mapping is None else _targets(content(mapping, "ParameterMapping", place, inside), place)
        for given in _given(content(binding, "ParameterSet", place, inside), binding.get("prefix", ""), place):
            for target in [Target(given.name)] if targets is None else targets.get(given.name, ()):
                streams = [*_reached(element, target.name, onward)]
                if not streams:
                    unknown.append(f"{given.where} is ignored: there is no '{target.name}' to take it")
                for stream in streams:
                    component, name = stream.end
                    values[component.path][name] = _coerced(given, target, stream)


def _targets(root: Node | None, place: Place) -> dict[str, list[Target]]:
    """Targets by the names of the parameter set."""
    found: dict[str, list[Target]] = defaultdict(list)
    for entry in children(root, "MappingEntry"):
        where = f"{place.where}: mapping of {value_text(entry.get('source'))}"
        try:
            converts = not truth(entry.get("suppressUnitConversion"))
        except ValueError:
            raise BadInput(f"{where}: suppressUnitConversion must be true or false") from None
        found[entry.get("source", "")].append(Target(entry.get("target", ""), linear(entry, where), converts))
    return found


def _given(root: Node | None, prefix: str, place: Place) -> Iterator[Given]:
    units = units_of(root)
    for parameter in children(root, "Parameters", "Parameter"):
        name = prefix + parameter.get("name", "")
        where = f"{place.where}: parameter {value_text(name)}"
        node = next((one for one in parameter if local(one) != "Annotations"), None)
        kind, text = ("", "") if node is None else (local(node), node.get("value", ""))
        unit = "" if node is None else node.get("unit", "")
        try:
            value: Scalar
            if kind in FLOATS:
                kind, value = "Real", number(text)
            elif kind in WHOLES and INTEGER.fullmatch(text.strip()):
                kind, value = "Integer", int(text)
            elif kind == "Boolean":
                value = truth(text or "?")
            elif kind in ("String", "Enumeration"):
                value = text
            else:
                raise ValueError
        except ValueError:
            allowed = "must be one finite Real, an Integer, a Boolean, a String or an Enumeration"
            raise BadInput(f"{where} = {value_text(text)} ({kind or 'no type'}): {allowed}") from None
        yield Given(name, value, kind, unit, units.get(unit), where)


def _reached(element: Element, name: str, onward: Mapping[End, list[Link]]) -> Iterator[Stream]:
    """Variables of components that a hierarchical name stands for."""
    if element.fmu is not None:
        variable = element.variables.get(name)
        if variable is not None and _has_start(variable):
            yield Stream(End(element, name)).seen_at(End(element, name))
        return
    head, dot, rest = name.partition(".")
    if dot and head in element.elements:
        yield from _reached(element.elements[head], rest, onward)
    elif name in element.connectors:
        yield from _onward(Stream(End(element, name)).seen_at(End(element, name)), onward, set())


def _onward(stream: Stream, onward: Mapping[End, list[Link]], seen: set[End]) -> Iterator[Stream]:
    for link in onward.get(stream.end, ()):
        if link.target in seen:
            continue
        seen.add(link.target)
        after = stream.through(link)
        if link.target.element.fmu is not None:
            if _has_start(link.target.element.variables[link.target.name]):
                yield after
        else:
            yield from _onward(after, onward, seen)


def _has_start(variable: object) -> bool:
    """Whether a start value of a variable may be set before the initialisation (FMI 2.0.4, section 2.2.7)."""
    causality, variability = getattr(variable, "causality", ""), getattr(variable, "variability", "")
    initial, start = getattr(variable, "initial", None), getattr(variable, "start", None)
    settable = causality in ("input", "parameter") or initial in ("exact", "approx") or (initial is None and start)
    return bool(settable) and variability != "constant" and causality != "independent"


def _coerced(given: Given, target: Target, stream: Stream) -> Scalar:
    """Value of a variable, in its unit and of its type."""
    component, name = stream.end
    variable = component.variables[name]
    what = f"{given.where} = {value_text(given.value)} ({given.kind})"
    match variable.type, given.kind:
        case "Real", "Real" | "Integer":
            value = _in_unit(given, target, stream, what)
            return stream.total.factor * value + stream.total.offset
        case "Integer" | "Enumeration", "Integer":
            return given.value
        case "Integer" | "Enumeration", "Real" if float(given.value).is_integer():
            return int(given.value)
        case "Boolean", "Boolean":
            return given.value
        case "String", "String":
            return given.value
        case "Enumeration", "Enumeration" | "String":
            items = variable.declaredType.items if variable.declaredType else ()
            for item in items:
                if item.name == given.value:
                    return int(item.value)
            names = ", ".join(item.name for item in items)
            raise BadInput(f"{what}: '{component.path}.{name}' has the items {names}")
    raise BadInput(f"{what}: '{component.path}.{name}' is of type {variable.type}")


def _in_unit(given: Given, target: Target, stream: Stream, what: str) -> float:
    """Value in the unit in which its way begins."""
    value = float(given.value)
    first = stream.begin or stream.end
    wanted = first.connector.unit
    if given.unit and wanted and given.unit != wanted and target.converts:
        bases = given.base or first.element.units.get(given.unit), first.base(wanted)
        if bases[0] is None or bases[1] is None or bases[0].exponents != bases[1].exponents:
            undefined = next((unit for unit, base in zip((given.unit, wanted), bases, strict=True) if base is None), "")
            why = f"the unit '{undefined}' is not defined" if undefined else f"'{first}' has the unit '{wanted}'"
            raise BadInput(f"{what}, in '{given.unit}': {why}")
        factor, offset = conversion(*bases)
        value = factor * value + offset
    factor, offset = target.transformation
    return factor * value + offset
