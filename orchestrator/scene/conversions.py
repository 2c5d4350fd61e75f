"""Types and units at the ends of connections of FMUs of the user: what is converted, what is held.

Others see the ports of a replacement in the units of its part. In a free system an input is converted from the unit of
its source; then follows the factor and offset of the connection. Values of unknown units are not converted.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from orchestrator.cosim.base_units import UNCHANGED, Conversion, base_unit, conversion
from orchestrator.cosim.graph import Connection, Instance
from orchestrator.scene.parts import Part
from orchestrator.scene.replacement import Replacement, port_unit, replacements, shared_parameters


def user_instances(parts: Sequence[Part], connections: Sequence[Connection]) -> dict[str, Instance]:
    """Instances of the FMUs of the user, by name; raises BadInput."""
    found = {each.part.name: each for each in replacements("scene", parts)}
    return {name: _instance(each, found, connections) for name, each in found.items()}


def _instance(each: Replacement, others: Mapping[str, Replacement], connections: Sequence[Connection]) -> Instance:
    part, table = each.part, each.part.fmu
    assert table is not None
    parameters = {
        name: _parameter(each, name, value) if each.variables[name].type == "Real" else value
        for name, value in shared_parameters(each).items()
    }
    conversions = {
        name: one for name, one in (*_of_ports(each), *_of_inputs(each, others, connections)) if one != UNCHANGED
    }
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


def _of_inputs(
    each: Replacement, others: Mapping[str, Replacement], connections: Sequence[Connection]
) -> Iterator[tuple[str, Conversion]]:
    """Conversions of the inputs that an FMU of a free system gets from others."""
    for connection in connections:
        source = others.get(connection.source)
        if connection.target != each.part.name or each.part.kind or source is None:
            continue
        transformations = dict(connection.transformations)
        for output, name in zip(connection.outputs, connection.inputs, strict=True):
            given, variable = source.variables.get(output), each.variables.get(name)
            if given is not None and variable is not None and variable.type == "Real":
                units = base_unit(source.description, given), base_unit(each.description, variable)
                yield name, conversion(*units).then(transformations.get(name, UNCHANGED))


def typed(connections: Sequence[Connection], parts: Sequence[Part]) -> tuple[Connection, ...]:
    """Connections of a free system, those of Reals apart from those of other types; raises BadInput."""
    types = {
        each.part.name: {name: variable.type for name, variable in each.variables.items()}
        for each in replacements("scene", parts)
        if not each.part.kind
    }
    return tuple(part for connection in connections for part in _by_type(connection, types))


def _by_type(connection: Connection, types: Mapping[str, Mapping[str, str]]) -> Iterator[Connection]:
    if connection.source not in types:
        yield connection
        return
    for is_real in (True, False):
        pairs = [
            pair
            for pair in zip(connection.outputs, connection.inputs, strict=True)
            if (types[connection.source].get(pair[0]) == "Real") == is_real
        ]
        if pairs:
            outputs, inputs = zip(*pairs, strict=True)
            carries = connection.carries if is_real else "discrete"
            yield connection._replace(outputs=outputs, inputs=inputs, carries=carries)
