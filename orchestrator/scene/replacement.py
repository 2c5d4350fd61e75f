"""FMUs of the user in a scene: in place of parts, and connected to parts.

In place of a part they fit its connections, or are refused before the first step. A replacement is stepped in the stage
of its part. It gets the parameters of the part that it declares by the same name and type (the place at the start, a
demanded speed), then those of its table ``[fmu.NAME]``. The connections of its part carry Reals.

Both ends of a connection that the user makes have one type, and Reals one dimension. Integers, Enumerations, Booleans
and Strings are held over a step. Others see the ports of an FMU in place of a part in the units of the part. An input
with a connection of the user is converted from the unit of its source; then follows the factor and offset of the
connection. Values of unknown units are not converted.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from difflib import get_close_matches
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from textwrap import shorten
from typing import Any, Literal, NamedTuple, get_args

from fmus.fmi.build import built_here
from fmus.fmi.terminals import MEMBER, Carried, carried, read_terminals, terminals
from fmus.interface.ports import UNITS
from fmus.precompile import component_ports
from fmus.vehicles.tables import BadInput, path_text
from orchestrator.cosim.base_units import (
    QUANTITIES,
    UNCHANGED,
    BaseUnit,
    Conversion,
    base_unit,
    conversion,
    difference,
    unit_of,
)
from orchestrator.cosim.component import description_of
from orchestrator.cosim.graph import Connection, ImportSettings, Instance, Quantity
from orchestrator.cosim.variables import LINK_FAMILIES
from orchestrator.fmi.model_description import ALLOWED, loadable
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.scene.fmu_table import FmuTable
from orchestrator.scene.parts import Assembly, Part
from orchestrator.scene.system_scene import SystemScene
from orchestrator.scene.values import SIDES, Parameters

DEMANDS = "speed.demand", "torque.demand"  # ends of names: inputs of drives, which have them as their table says
NAMED = 150  # characters of a list of variables
UNMARKED = (  # warning about connectors
    "no terminal marks its outputs to {}: they are taken as values at communication points, motions held and wrenches"
    " averaged over a step, as in a sequential exchange: of first order if these are means, as ours are"
)
TYPES = {float: "Real", int: "Integer", str: "String"}  # by the start value of a port


class End(NamedTuple):
    """Variable of an FMU or port of a part, as an end of connections."""

    type: str  # of FMI
    causality: str
    unit: str  # empty: none
    base: BaseUnit | None  # None: unknown
    items: Mapping[int, str] = {}  # of an Enumeration: names by values
    settable: bool = False  # a parameter, or a constant of a native FMU
    carries: Carried | Literal[""] = (
        ""  # over a step, as the terminals of its FMU mark it (``fmus.fmi.terminals``); empty: not marked
    )


Ends = Mapping[str, Mapping[str, End]]  # by component and variable


class Replacement(NamedTuple):
    """Part with what the FMU in its place declares."""

    part: Part
    where: str  # key and file, for messages
    variables: Mapping[str, End]  # of the FMU in its own units, by name
    ports: Mapping[str, End]  # of the part, by name; none in a free system
    equal_steps: bool  # it takes communication steps of one length only


def replacements(where: str, parts: Sequence[Part]) -> list[Replacement]:
    """Parts in whose place an FMU of the user runs; raises BadInput, beginning with ``where``, for a bad FMU."""
    return [_replacement(where, part, part.fmu) for part in parts if part.fmu is not None]


def interface_mismatches(scene: SystemScene, assembly: Assembly) -> list[tuple[str, str]]:
    """Warnings about FMUs of the user, as part and sentence; raises BadInput if one does not fit its connections."""
    where, variable_steps = scene.where, scene.run.variable is not None
    found = replacements(where, assembly.parts)
    warnings = [warning for each in found for warning in _require_fit(each, assembly.connections, variable_steps)]
    by_name = {each.part.name: each for each in found}
    warnings += _require_pairs(where, assembly.parts, by_name, assembly.user_connections)
    return [*warnings, *_unmet_demands(assembly)]


def _unmet_demands(assembly: Assembly) -> Iterator[tuple[str, str]]:
    """Warnings about demands of drives that no FMU brings, or that do not count, as part and sentence."""
    for part in assembly.parts:
        shafts = part.config.get("drive", {}).get("demanded")
        if shafts in (None, True):  # those of a driver
            continue
        brought = {
            into for each in assembly.user_connections if each.target == part.name for into in each.inputs
            if into.endswith(DEMANDS)
        }  # fmt: skip
        modes = {name: str(part.parameters[f"{name}mode"]) for name in (shafts if isinstance(shafts, list) else [""])}
        needed = {f"{name}torque.demand" for name, mode in modes.items() if mode == "torque"}
        if {*modes.values()} != {"torque"}:  # both shafts of a differential follow the speeds of both sides
            needed |= {"speed.demand"} if "" in modes else {f"{side}.speed.demand" for side in SIDES}
        for into in sorted(needed - brought):
            yield part.name, f"nothing brings its input {into}, which stays 0"
        for into in sorted(brought - needed):
            yield part.name, f"its input {into} does not count in mode {' and '.join(sorted({*modes.values()}))}"


def _replacement(where: str, part: Part, table: FmuTable) -> Replacement:
    key = f"{where}: fmu.{part.name}.file"
    try:
        description, found = description_of(Path(table.file)), read_terminals(loadable(Path(table.file)).folder)
    except ComponentFailed as failure:
        raise BadInput(f"{key}: {failure}") from None
    carries = carried(found)
    variables = {variable.name: _own_end(description, variable, carries) for variable in description.modelVariables}
    equal_steps = not description.coSimulation.canHandleVariableCommunicationStepSize
    return Replacement(part, f"{key} = {path_text(table.file)}", variables, _ports(part), equal_steps)


def _own_end(description: Any, variable: Any, marked: Mapping[str, Carried]) -> End:
    """Variable of an FMU, as fmpy describes it, in its own unit; elements of an array as the array."""
    declared = variable.declaredType.items if variable.type == "Enumeration" and variable.declaredType else ()
    items = {int(item.value): item.name for item in declared}
    settable = variable.causality == "parameter" or variable.variability == "constant"
    unit, base = unit_of(variable), base_unit(description, variable)
    carries = marked.get(variable.name) or marked.get(variable.name.rpartition("[")[0]) or ""
    return End(variable.type, variable.causality, unit, base, items, settable, carries)


def _ports(part: Part) -> dict[str, End]:
    """Ports of a part by their names; none of an FMU of a free system."""
    ports = component_ports(part.kind, part.config) if part.kind else ()
    inputs, outputs = ([port.name for port in ports if port.causality == way] for way in ("input", "output"))
    marked = carried(terminals(part.kind, inputs, outputs).values())
    return {
        port.name: End(
            TYPES[type(port.start)], port.causality, port.unit, _base_of(port.unit), carries=marked.get(port.name) or ""
        )
        for port in ports
    }


def _base_of(unit: str) -> BaseUnit:
    """Unit of a port in base units."""
    return BaseUnit(tuple(float(UNITS[unit].get(quantity, 0)) for quantity in QUANTITIES))


def _require_fit(
    each: Replacement, connections: Sequence[Connection], variable_steps: bool
) -> Iterator[tuple[str, str]]:
    """Warnings about an FMU of the user, as part and sentence; raises BadInput.

    It must have the connected variables of its part as Reals of the same dimension. What else its part outputs, and
    units that it does not declare, are warnings. ``variable_steps``: it must take communication steps of any length.
    """
    if variable_steps and each.equal_steps:
        raise BadInput(f"{each.where}: it takes equal communication steps only, and run.variable varies them")
    connected = {name: (causality, peer) for causality, name, peer in _connected(each.part.name, connections)}
    for name, ends in connected.items():
        if (variable := connected_variable(each.where, each.variables, name, *ends)).type != "Real":
            raise BadInput(f"{each.where}: {ends[0]} '{name}' is of type {variable.type}, and a Real is needed")
    shared = [name for name in shared_parameters(each) if each.ports[name].type == "Real"]
    unitless = [name for name in (*connected, *shared) if not _has_unit(each, name)]
    yield from ((each.part.name, sentence) for sentence in (_unitless(unitless), _missing(each)) if sentence)


def _connected(name: str, connections: Sequence[Connection]) -> Iterator[tuple[str, str, str]]:
    """Causality and name of every connected variable of a component, and the variable at the other end."""
    for source, outputs, target, inputs, _, rates, *_ in connections:
        if source == name:
            yield from (("output", *ends) for ends in zip(outputs, (f"{target}.{i}" for i in inputs), strict=True))
            yield from (("output", rate, target) for rate in rates)
        if target == name:
            yield from (("input", *ends) for ends in zip(inputs, (f"{source}.{o}" for o in outputs), strict=True))


def connected_variable(at: str, variables: Mapping[str, End], name: str, causality: str, peer: str) -> End:
    """Connected variable of a component; raises BadInput, beginning with ``at``, if it lacks it or its causality."""
    way = "goes to" if causality == "output" else "comes from"
    variable = variables.get(name)
    if variable is None:
        near = get_close_matches(name, [one for one, other in variables.items() if other.causality == causality], 1)
        hint = f": did you mean '{near[0]}'?" if near else ""
        raise BadInput(f"{at}: it has no {causality} '{name}', which {way} {peer}{hint}")
    if variable.causality != causality:
        raise BadInput(f"{at}: '{name}' is of causality {variable.causality}, but {way} {peer}: {causality}")
    return variable


def _has_unit(each: Replacement, name: str) -> bool:
    """Whether a Real declares a unit of the dimension of the part's port; raises BadInput for another one."""
    own, port = each.variables[name], each.ports[name]
    if not own.unit:
        return port.unit == "1"
    if differs := _difference(own, port):
        raise BadInput(f"{each.where}: '{name}' {differs}")
    return True


def shared_parameters(each: Replacement) -> Parameters:
    """Parameters of the part that the FMU declares by the same name and type and its table does not set.

    Constants of native FMUs are among them: a wrong one is refused when it is set.
    """
    table = each.part.fmu
    return {
        name: value
        for name, value in each.part.parameters.items()
        if (variable := each.variables.get(name)) is not None
        and variable.settable
        and isinstance(value, ALLOWED[variable.type])
        and (table is None or name not in table.parameters)
    }


def _unitless(names: Sequence[str]) -> str:
    """Warning about variables without unit, or an empty text."""
    return f"the FMU declares no unit of {_listed(names)}: it is taken to be that of the part" if names else ""


def _listed(names: Sequence[str]) -> str:
    """Names of variables, shortened; those of links are one."""
    return shorten(", ".join(dict.fromkeys(name.partition("[")[0] for name in names)), NAMED, placeholder=" ...")


def _missing(each: Replacement) -> str:
    """Warning about outputs that the part has and the FMU has not, or an empty text."""
    there = {name for name, variable in each.variables.items() if variable.causality == "output"}
    names = [name for name, port in each.ports.items() if port.causality == "output" and name not in there]
    if not names:
        return ""
    sentence = f"the FMU has no outputs {_listed(names)}: results that need them are missing"
    part_has, fmu_has = (any(name.startswith("energy.") for name in each) for each in (names, there))
    outside = "; it outputs no energies: the energy balance takes what passes its ports as delivered to it"
    return sentence + outside * (part_has and not fmu_has)


def ends_of(parts: Sequence[Part], fmus: Mapping[str, Replacement]) -> Ends:
    """Variables that can be connected, of parts and of the FMUs in place of some of them."""
    return {part.name: _of_part(part, fmus.get(part.name)) for part in parts}


def _of_part(part: Part, fmu: Replacement | None) -> dict[str, End]:
    """Variables of a part, or of the FMU in its place, whose ports have the units of the part."""
    if fmu is None:
        ends = _ports(part)
    else:
        ends = {name: _seen(own, fmu.ports.get(name)) for name, own in fmu.variables.items()}
    return {name: end for name, end in ends.items() if not name.startswith(LINK_FAMILIES)}


def _seen(own: End, port: End | None) -> End:
    """Variable of an FMU, in the unit of its part's port if its values are converted to that."""
    if port is None or not _alike(own, port):
        return own
    return own._replace(unit=port.unit, base=port.base)


def _alike(own: End, port: End) -> bool:
    """Whether both have units of one dimension, so that values of one are converted to the other."""
    return own.base is not None and port.base is not None and own.base.exponents == port.base.exponents


def _require_pairs(
    where: str, parts: Sequence[Part], fmus: Mapping[str, Replacement], connections: Sequence[Connection]
) -> Iterator[tuple[str, str]]:
    """Warnings about connections of the user, as part and sentence; raises BadInput if the ends do not fit."""
    if not connections:
        return
    ends, unmarked = ends_of(parts, fmus), dict[str, list[str]]()
    places = {part.name: f"{where}: {part.name}" for part in parts} | {name: fmu.where for name, fmu in fmus.items()}
    for connection in connections:
        source, target = connection.source, connection.target
        transformed = dict(connection.transformations)
        for output, into in zip(connection.outputs, connection.inputs, strict=True):
            peers = f"{source}.{output}", f"{target}.{into}"
            given = connected_variable(places[source], ends[source], output, "output", peers[1])
            connected_variable(places[target], ends[target], into, "input", peers[0])
            own = fmus[target].variables[into] if target in fmus else ends[target][into]
            if own.carries and not given.carries and not into.endswith(DEMANDS):
                port = MEMBER.match(into)
                unmarked.setdefault(source, []).append(f"{target}.{port[1] if port else into}")
            if sentence := _misfit(own, given, into in transformed, into, peers[0]):
                raise BadInput(f"{places[target]}: {sentence}")
            units = [end.unit.replace("1", "") if end.unit == "1" else end.unit for end in (own, given)]
            if any(units) and not all(units):
                yield target, f"'{into}' has the unit {units[0] or 'none'}, and {peers[0]} {units[1] or 'none'}"
    for source, names in unmarked.items():
        yield source, UNMARKED.format(", ".join(dict.fromkeys(names)))


def _misfit(own: End, given: End, transformed: bool, name: str, peer: str) -> str:
    """Words on why an input cannot get the values of an output; empty if it can."""
    if given.type != own.type:
        return f"input '{name}' is of type {own.type}, and {peer} of type {given.type}: only equal types are connected"
    if own.type == "Real":
        differs = _difference(given, own) if own.unit and given.unit else ""
        return f"{peer} {differs} by '{name}'" if differs else ""
    if transformed:
        return f"input '{name}' is of type {own.type}: only Reals have a factor or an offset ({peer})"
    if not given.items.items() <= own.items.items():
        return f"input '{name}' has the items {_words(own)}, and {peer} {_words(given)}: it needs those of its source"
    return ""


def _words(end: End) -> str:
    return ", ".join(f"{value} {name}" for value, name in end.items.items())


def _difference(one: End, other: End) -> str:
    return difference(one.unit, one.base, other.unit, other.base)


def quantity(given: End, taken: End, into: str) -> Quantity:
    """Quantity of a connection of the user: who gives knows that it is a mean, who takes that it extrapolates.

    A demand of a drive that is no mean is held.
    """
    if given.type != "Real" or (into.endswith(DEMANDS) and given.carries != "mean"):
        return "discrete"
    if given.carries == "mean":
        return "mean"
    return taken.carries if taken.carries == "state" or taken.carries == "rate" else "value"


def typed(connections: Sequence[Connection], ends: Ends) -> tuple[Connection, ...]:
    """Connections of the user, one for each pair of components and what is carried."""
    return tuple(part for each in connections for part in _by_quantity(each, ends[each.source], ends[each.target]))


def _by_quantity(connection: Connection, given: Mapping[str, End], taken: Mapping[str, End]) -> Iterator[Connection]:
    pairs = [*zip(connection.outputs, connection.inputs, strict=True)]
    for carries in get_args(Quantity):
        if group := [pair for pair in pairs if quantity(given[pair[0]], taken[pair[1]], pair[1]) == carries]:
            outputs, inputs = zip(*group, strict=True)
            yield connection._replace(outputs=outputs, inputs=inputs, carries=carries)


def staged(
    parts: Sequence[Part], connections: Sequence[Connection], ends: Ends, given: Mapping[str, int | None]
) -> tuple[Part, ...]:
    """Parts of a free system in their stages, the ``given`` ones or else: who gives a mean steps before who takes it.

    FMUs that give each other means step at once.
    """
    after: dict[str, set[str]] = {part.name: set() for part in parts}
    for source, outputs, target, inputs, *_ in connections:
        known = (
            (ends[source].get(output), ends[target].get(into)) for output, into in zip(outputs, inputs, strict=True)
        )
        if any(one and other and "mean" in (one.carries, other.carries) for one, other in known):
            after[target].add(source)
    stages: dict[str, int] = {}
    with suppress(CycleError):
        for name in TopologicalSorter(after).static_order():
            earliest = max((stages[source] + 1 for source in after[name]), default=0)
            stages[name] = earliest if (stage := given[name]) is None else stage
    return tuple(part._replace(stage=stages.get(part.name, given[part.name] or 0)) for part in parts)


def user_instance(each: Replacement, ends: Ends, connections: Sequence[Connection]) -> Instance:
    """Instance of an FMU of the user; ``connections``: those that the user makes."""
    part, table = each.part, each.part.fmu
    assert table is not None
    shared = shared_parameters(each)
    reals = [name for name in shared if each.variables[name].type == "Real"]
    changed = _changing({name: _Way(each.ports[name].base, each.variables[name].base) for name in reals})
    parameters = shared | {name: one.factor * float(shared[name]) + one.offset for name, one in changed.items()}
    converted = conversions(part.name, each.variables, each.ports, ends, connections)
    units = {name: each.ports[name].unit for name in converted if each.variables[name].causality == "output"}
    file = Path(table.file)
    imported = ImportSettings(table.in_process, table.call_limit or math.inf, table.non_finite)
    terms = converted, units, None if built_here(file) else imported
    return Instance(part.name, file, {**parameters, **table.parameters}, part.stage, *terms)


class _Way(NamedTuple):
    """How values reach a variable: from the unit in which they are given to the one needed, then transformed."""

    given: BaseUnit | None
    needed: BaseUnit | None
    transformation: Conversion = UNCHANGED


def conversions(
    name: str, own: Mapping[str, End], ports: Mapping[str, End], ends: Ends, connections: Sequence[Connection]
) -> dict[str, Conversion]:
    """Conversions of a component's variables, ``own`` in its own units, that change values.

    ``ports``: of the part in whose place it is; ``connections``: those of the user, between ``ends``.
    """
    return _changing(dict(_of_ports(own, ports)) | dict(_of_inputs(name, own, ends, connections)))


def _changing(ways: Mapping[str, _Way]) -> dict[str, Conversion]:
    """Conversions of variables, without those that change no value."""
    found = {name: conversion(way.given, way.needed).then(way.transformation) for name, way in ways.items()}
    return {name: one for name, one in found.items() if one != UNCHANGED}


def _of_ports(variables: Mapping[str, End], ports: Mapping[str, End]) -> Iterator[tuple[str, _Way]]:
    """Ways of the inputs and outputs that an FMU has in common with its part."""
    for name, port in ports.items():
        own = variables.get(name)
        if own is not None and own.type == "Real" and own.causality == port.causality and _alike(own, port):
            if port.causality == "output":
                yield name, _Way(own.base, port.base)
            elif port.causality == "input":
                yield name, _Way(port.base, own.base)


def _of_inputs(
    target: str, own: Mapping[str, End], ends: Ends, connections: Sequence[Connection]
) -> Iterator[tuple[str, _Way]]:
    """Ways of the inputs that a component gets by connections of the user."""
    for connection in connections:
        if connection.target == target:
            transformations = dict(connection.transformations)
            for output, name in zip(connection.outputs, connection.inputs, strict=True):
                if own[name].type == "Real":
                    source = ends[connection.source][output]
                    yield name, _Way(source.base, own[name].base, transformations.get(name, UNCHANGED))
