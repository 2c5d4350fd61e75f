"""Instances of FMUs of the user: parameters, and conversions of their inputs and outputs.

Others see the ports of an FMU in place of a part in the units of the part. An input with a connection of the user is
converted from the unit of its source; then follows the factor and offset of the connection. Values of unknown units are
not converted.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from orchestrator.cosim.base_units import UNCHANGED, Conversion, base_unit, conversion
from orchestrator.cosim.graph import Connection, Instance
from orchestrator.scene.replacement import Replacement, port_unit, shared_parameters
from orchestrator.scene.user_connections import End, Ends, own_end


def user_instance(each: Replacement, ends: Ends, connections: Sequence[Connection]) -> Instance:
    """Instance of an FMU of the user; ``connections``: those that the user makes."""
    part, table = each.part, each.part.fmu
    assert table is not None
    parameters = {
        name: _parameter(each, name, value) if each.variables[name].type == "Real" else value
        for name, value in shared_parameters(each).items()
    }
    own = {name: own_end(each, name) for name in each.variables}
    conversions = dict(_of_ports(each)) | dict(_of_inputs(part.name, own, ends, connections))
    conversions = {name: one for name, one in conversions.items() if one != UNCHANGED}
    units = {name: each.ports[name].unit for name in conversions if each.variables[name].causality == "output"}
    return Instance(part.name, Path(table.file), {**parameters, **table.parameters}, part.stage, conversions, units)


def input_conversions(part: str, ends: Ends, connections: Sequence[Connection]) -> dict[str, Conversion]:
    """Conversions of the inputs that a part of ours gets by connections of the user."""
    found = _of_inputs(part, ends.get(part, {}), ends, connections)
    return {name: one for name, one in found if one != UNCHANGED}


def _parameter(each: Replacement, name: str, value: float | int | str) -> float | int | str:
    """Value of a Real parameter of the part in the unit of the FMU."""
    one = conversion(port_unit(each.ports[name]), base_unit(each.description, each.variables[name]))
    return value if one == UNCHANGED else one.factor * float(value) + one.offset


def _of_ports(each: Replacement) -> Iterator[tuple[str, Conversion]]:
    """Conversions of the inputs and outputs that an FMU has in common with its part."""
    for name, port in each.ports.items():
        variable = each.variables.get(name)
        if variable is not None and variable.type == "Real" and variable.causality == port.causality:
            own, needed = base_unit(each.description, variable), port_unit(port)
            if own is not None and own.exponents == needed.exponents:
                if port.causality == "output":
                    yield name, conversion(own, needed)
                elif port.causality == "input":
                    yield name, conversion(needed, own)


def _of_inputs(
    target: str, own: Mapping[str, End], ends: Ends, connections: Sequence[Connection]
) -> Iterator[tuple[str, Conversion]]:
    """Conversions of the inputs that a component gets by connections of the user; ``own``: in its own units."""
    for connection in connections:
        if connection.target == target:
            transformations = dict(connection.transformations)
            for output, name in zip(connection.outputs, connection.inputs, strict=True):
                if own[name].type == "Real":
                    unit = conversion(ends[connection.source][output].base, own[name].base)
                    yield name, unit.then(transformations.get(name, UNCHANGED))
