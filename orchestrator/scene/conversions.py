"""Instances of FMUs of the user: parameters, and conversions of their inputs and outputs.

Others see the ports of an FMU in place of a part in the units of the part. An input with a connection of the user is
converted from the unit of its source; then follows the factor and offset of the connection. Values of unknown units are
not converted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from orchestrator.cosim.base_units import UNCHANGED, Conversion, base_unit, conversion
from orchestrator.cosim.graph import Connection, Instance
from orchestrator.scene.replacement import Replacement, port_unit, shared_parameters
from orchestrator.scene.user_connections import Ends, own_end


def user_instance(each: Replacement, ends: Ends, connections: Sequence[Connection]) -> Instance:
    """Instance of an FMU of the user; ``connections``: those that the user makes."""
    part, table = each.part, each.part.fmu
    assert table is not None
    parameters = {
        name: _parameter(each, name, value) if each.variables[name].type == "Real" else value
        for name, value in shared_parameters(each).items()
    }
    conversions = dict(_of_ports(each)) | dict(_of_inputs(each, ends, connections))
    conversions = {name: one for name, one in conversions.items() if one != UNCHANGED}
    units = {name: each.ports[name].unit for name in conversions if each.variables[name].causality == "output"}
    return Instance(part.name, Path(table.file), {**parameters, **table.parameters}, part.stage, conversions, units)


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


def _of_inputs(each: Replacement, ends: Ends, connections: Sequence[Connection]) -> Iterator[tuple[str, Conversion]]:
    """Conversions of the inputs that an FMU gets by connections of the user."""
    for connection in connections:
        if connection.target == each.part.name:
            transformations = dict(connection.transformations)
            for output, name in zip(connection.outputs, connection.inputs, strict=True):
                given, own = ends[connection.source][output], own_end(each, name)
                if own.type == "Real":
                    yield name, conversion(given.base, own.base).then(transformations.get(name, UNCHANGED))
