"""FMUs of the user in place of parts: they fit the connections of the part, or are refused before the first step.

A replacement is stepped in the stage of its part. It gets the parameters of the part that it declares by the same name
and type (the place at the start, a demanded speed), then those of its table ``[fmu.NAME]``. Only its Real variables are
connected; its units must be those of the part, because values are not converted.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from textwrap import shorten
from typing import Any, NamedTuple

from fmus.loaded import component_ports
from fmus.ports import UNITS, Port
from fmus.vehicle import BadInput, path_text
from orchestrator.cosim.base_units import QUANTITIES, BaseUnit, base_unit, difference
from orchestrator.cosim.component import SETTERS, ComponentFailed, description_of
from orchestrator.cosim.graph import Connection, Instance
from orchestrator.scene.fmu_table import FmuTable
from orchestrator.scene.parts import Parameters, Part

NAMED = 150  # characters of a list of variables


class Replacement(NamedTuple):
    """Part with the description of the FMU in its place."""

    part: Part
    where: str  # key and file, for messages
    description: Any
    variables: Mapping[str, Any]  # by name


def replacements(where: str, parts: Sequence[Part]) -> list[Replacement]:
    """Parts in whose place an FMU of the user runs; raises BadInput, beginning with ``where``, for a bad FMU."""
    return [_replacement(where, part, part.fmu) for part in parts if part.fmu is not None]


def _replacement(where: str, part: Part, table: FmuTable) -> Replacement:
    key = f"{where}: fmu.{part.name}.file"
    try:
        description = description_of(Path(table.file))
    except ComponentFailed as failure:
        raise BadInput(f"{key}: {failure}") from None
    variables = {variable.name: variable for variable in description.modelVariables}
    return Replacement(part, f"{key} = {path_text(table.file)}", description, variables)


def instance(part: Part, table: FmuTable) -> Instance:
    """Instance of the FMU of the user in place of a part; raises BadInput."""
    parameters = _shared_parameters(_replacement("scene", part, table))
    return Instance(part.name, Path(table.file), {**parameters, **table.parameters}, part.stage)


def require_fit(
    where: str, parts: Sequence[Part], connections: Sequence[Connection], variable_steps: bool
) -> list[tuple[str, str]]:
    """Warnings about FMUs of the user, as part and sentence; raises BadInput, beginning with ``where``.

    An FMU must have the connected variables of its part as Reals in the same units. What else its part outputs, and
    units that it does not declare, are warnings. ``variable_steps``: it must take communication steps of any length.
    """
    warnings: list[tuple[str, str]] = []
    found = replacements(where, parts)
    by_name = {each.part.name: each for each in found}
    for each in found:
        if variable_steps and not each.description.coSimulation.canHandleVariableCommunicationStepSize:
            raise BadInput(f"{each.where}: it takes equal communication steps only, and run.variable varies them")
        if not each.part.kind:  # of a free system: its connections decide
            warnings += _fit_connections(each, by_name, connections)
            continue
        ports = {port.name: port for port in component_ports(each.part.kind, each.part.config)}
        connected = {name: (causality, peer) for causality, name, peer in _connected(each.part.name, connections)}
        for name, ends in connected.items():
            _connected_real(each, name, *ends)
        shared = [name for name in _shared_parameters(each) if isinstance(ports[name].start, float)]
        unitless = [name for name in (*connected, *shared) if not _has_unit(each, ports[name])]
        sentences = _unitless(unitless), _missing(each, ports)
        warnings += [(each.part.name, sentence) for sentence in sentences if sentence]
    return warnings


def _connected(name: str, connections: Sequence[Connection]) -> Iterator[tuple[str, str, str]]:
    """Causality and name of every connected variable of a component, and the variable at the other end."""
    for source, outputs, target, inputs, _, rates, _ in connections:
        if source == name:
            yield from (("output", *ends) for ends in zip(outputs, (f"{target}.{i}" for i in inputs), strict=True))
            yield from (("output", rate, target) for rate in rates)
        if target == name:
            yield from (("input", *ends) for ends in zip(inputs, (f"{source}.{o}" for o in outputs), strict=True))


def _fit_connections(
    each: Replacement, others: Mapping[str, Replacement], connections: Sequence[Connection]
) -> Iterator[tuple[str, str]]:
    """Warnings about the variables of an FMU that a free system connects; raises BadInput if they do not fit."""
    for causality, name, peer in _connected(each.part.name, connections):
        unit = _connected_real(each, name, causality, peer).unit
        if causality == "input":
            source, _, output = peer.partition(".")
            other = others[source]
            given = getattr(other.variables.get(output), "unit", None)
            if unit and given:
                bases = base_unit(each.description, unit), base_unit(other.description, given)
                if differs := difference(unit, bases[0], given, bases[1]):
                    raise BadInput(f"{each.where}: '{name}' {differs} ({peer})")
            elif unit or given:
                yield each.part.name, f"'{name}' has the unit {unit or 'none'}, and {peer} {given or 'none'}"


def _connected_real(each: Replacement, name: str, causality: str, peer: str) -> Any:
    """Connected variable of an FMU; raises BadInput if it is missing, of another causality or no Real."""
    way = "goes to" if causality == "output" else "comes from"
    variable = each.variables.get(name)
    if variable is None:
        near = get_close_matches(
            name, [other.name for other in each.variables.values() if other.causality == causality], 1
        )
        hint = f": did you mean '{near[0]}'?" if near else ""
        raise BadInput(f"{each.where}: it has no {causality} '{name}', which {way} {peer}{hint}")
    if variable.causality != causality:
        raise BadInput(f"{each.where}: '{name}' is of causality {variable.causality}, but {way} {peer}: {causality}")
    if variable.type != "Real":
        raise BadInput(f"{each.where}: {causality} '{name}' is of type {variable.type}: only Reals are connected")
    return variable


def _has_unit(each: Replacement, port: Port) -> bool:
    """Whether a Real declares the unit of the part's port; raises BadInput if it declares another one."""
    unit = each.variables[port.name].unit
    if not unit:
        return port.unit == "1"
    needed = BaseUnit(tuple(float(UNITS[port.unit].get(quantity, 0)) for quantity in QUANTITIES))
    if differs := difference(unit, base_unit(each.description, unit), port.unit, needed):
        raise BadInput(f"{each.where}: '{port.name}' {differs}")
    return True


def _shared_parameters(each: Replacement) -> Parameters:
    """Parameters of the part that the FMU declares by the same name and type and its table does not set.

    Constants of native FMUs are among them: a wrong one is refused when it is set.
    """
    table = each.part.fmu
    return {
        name: value
        for name, value in each.part.parameters.items()
        if (variable := each.variables.get(name)) is not None
        and (variable.causality == "parameter" or variable.variability == "constant")
        and isinstance(value, SETTERS[variable.type][2])
        and (table is None or name not in table.parameters)
    }


def _unitless(names: Sequence[str]) -> str:
    """Warning about variables without unit, or an empty text."""
    return f"the FMU declares no unit of {_listed(names)}: it is taken to be that of the part" if names else ""


def _listed(names: Sequence[str]) -> str:
    """Names of variables, shortened; those of links are one."""
    return shorten(", ".join(dict.fromkeys(name.partition("[")[0] for name in names)), NAMED, placeholder=" ...")


def _missing(each: Replacement, ports: Mapping[str, Port]) -> str:
    """Warning about outputs that the part has and the FMU has not, or an empty text."""
    there = {name for name, variable in each.variables.items() if variable.causality == "output"}
    names = [port.name for port in ports.values() if port.causality == "output" and port.name not in there]
    if not names:
        return ""
    sentence = f"the FMU has no outputs {_listed(names)}: results that need them are missing"
    part_has, fmu_has = (any(name.startswith("energy.") for name in each) for each in (names, there))
    outside = "; it outputs no energies: the energy balance takes what passes its ports as delivered to it"
    return sentence + outside * (part_has and not fmu_has)
