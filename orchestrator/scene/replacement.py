"""FMUs of the user in place of parts: they fit the connections of the part, or are refused before the first step.

A replacement is stepped in the stage of its part. It gets the parameters of the part that it declares by the same name
and type (the place at the start, a demanded speed), then those of its table ``[fmu.NAME]``. The connections of its part
carry Reals.
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
from orchestrator.cosim.base_units import QUANTITIES, BaseUnit, base_unit, difference, unit_of
from orchestrator.cosim.component import SETTERS, ComponentFailed, description_of
from orchestrator.cosim.graph import Connection
from orchestrator.scene.fmu_table import FmuTable
from orchestrator.scene.parts import Parameters, Part

NAMED = 150  # characters of a list of variables


class Replacement(NamedTuple):
    """Part with the description of the FMU in its place."""

    part: Part
    where: str  # key and file, for messages
    description: Any
    variables: Mapping[str, Any]  # by name
    ports: Mapping[str, Port]  # of the part, by name; none in a free system


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
    ports = {port.name: port for port in component_ports(part.kind, part.config)} if part.kind else {}
    return Replacement(part, f"{key} = {path_text(table.file)}", description, variables, ports)


def require_fit(
    each: Replacement, connections: Sequence[Connection], variable_steps: bool
) -> Iterator[tuple[str, str]]:
    """Warnings about an FMU of the user, as part and sentence; raises BadInput.

    It must have the connected variables of its part as Reals of the same dimension. What else its part outputs, and
    units that it does not declare, are warnings. ``variable_steps``: it must take communication steps of any length.
    """
    if variable_steps and not each.description.coSimulation.canHandleVariableCommunicationStepSize:
        raise BadInput(f"{each.where}: it takes equal communication steps only, and run.variable varies them")
    connected = {name: (causality, peer) for causality, name, peer in _connected(each.part.name, connections)}
    for name, ends in connected.items():
        if (variable := connected_variable(each.where, each.variables, name, *ends)).type != "Real":
            raise BadInput(f"{each.where}: {ends[0]} '{name}' is of type {variable.type}, and a Real is needed")
    shared = [name for name in shared_parameters(each) if isinstance(each.ports[name].start, float)]
    unitless = [name for name in (*connected, *shared) if not _has_unit(each, each.ports[name])]
    yield from ((each.part.name, sentence) for sentence in (_unitless(unitless), _missing(each)) if sentence)


def _connected(name: str, connections: Sequence[Connection]) -> Iterator[tuple[str, str, str]]:
    """Causality and name of every connected variable of a component, and the variable at the other end."""
    for source, outputs, target, inputs, _, rates, *_ in connections:
        if source == name:
            yield from (("output", *ends) for ends in zip(outputs, (f"{target}.{i}" for i in inputs), strict=True))
            yield from (("output", rate, target) for rate in rates)
        if target == name:
            yield from (("input", *ends) for ends in zip(inputs, (f"{source}.{o}" for o in outputs), strict=True))


def connected_variable(at: str, variables: Mapping[str, Any], name: str, causality: str, peer: str) -> Any:
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


def _has_unit(each: Replacement, port: Port) -> bool:
    """Whether a Real declares a unit of the dimension of the part's port; raises BadInput for another one."""
    variable = each.variables[port.name]
    unit = unit_of(variable)
    if not unit:
        return port.unit == "1"
    if differs := difference(unit, base_unit(each.description, variable), port.unit, port_unit(port)):
        raise BadInput(f"{each.where}: '{port.name}' {differs}")
    return True


def port_unit(port: Port) -> BaseUnit:
    """Unit of a port of a part."""
    return BaseUnit(tuple(float(UNITS[port.unit].get(quantity, 0)) for quantity in QUANTITIES))


def shared_parameters(each: Replacement) -> Parameters:
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


def _missing(each: Replacement) -> str:
    """Warning about outputs that the part has and the FMU has not, or an empty text."""
    there = {name for name, variable in each.variables.items() if variable.causality == "output"}
    names = [port.name for port in each.ports.values() if port.causality == "output" and port.name not in there]
    if not names:
        return ""
    sentence = f"the FMU has no outputs {_listed(names)}: results that need them are missing"
    part_has, fmu_has = (any(name.startswith("energy.") for name in each) for each in (names, there))
    outside = "; it outputs no energies: the energy balance takes what passes its ports as delivered to it"
    return sentence + outside * (part_has and not fmu_has)
