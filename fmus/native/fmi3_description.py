"""modelDescription.xml of an FMI 3.0 co-simulation FMU, a sibling of ``fmus.fmi.description``.

Real variables are arrays there: positions, forces and the like, and the outputs of all links.

| Reals | Float64 variable | dimensions |
| --- | --- | --- |
| `S.position.x`, `.y`, `.z`; likewise `velocity`, `angular_velocity`, `force`, `torque` | `S.position` | 3 |
| `S.orientation.w`, `.x`, `.y`, `.z` | `S.orientation` | 4 |
| `link[1].tension` to `link[n].tension` | `link.tension` | n |
| `joint[1].position.x` to `joint[n].position.z` | `joint.position` | n, 3 |

Elements lie one behind the other in the row of Reals, so an array is a slice of it. Reals of such a group that differ
in causality, unit or range stay variables of their own.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, SubElement

from fmus.fmi.description import add_definitions, enumeration_type, initial, origin, quantity, variability_of
from fmus.interface.ports import Port, enumeration_value
from fmus.track.link_outputs import GROUPS

TIME = Port("time", "independent", "s", "time of the instance")
AXES = ("x", "y", "z"), ("w", "x", "y", "z")
OF_LINKS = {f"{group.owner}.{group.signal}" for group in GROUPS.values()}


class ArrayVariable(NamedTuple):
    """Float64 variable of FMI 3.0."""

    name: str
    text: str
    first: int  # place of the first element among the Reals
    elements: tuple[Port, ...]  # alike in causality, unit and range
    shape: tuple[int, ...] = ()  # empty for a scalar


def arrays(reals: Sequence[Port]) -> list[ArrayVariable]:
    """Float64 variables of the Reals, in their order; the index is the value reference."""
    found: list[ArrayVariable] = []
    place = 0
    for name, group in groupby(reals, key=lambda port: _split(port.name)[0]):
        elements = tuple(group)
        labels = [_split(port.name)[1] for port in elements]
        distinct = tuple(dict.fromkeys(labels))
        known = name in OF_LINKS or distinct in AXES
        alike = len({(port.causality, port.unit, port.allowed) for port in elements}) == 1
        if known and alike and labels == [*distinct] * (len(labels) // len(distinct)):
            shape = tuple(size for size in (len(labels) // len(distinct), len(distinct)) if size > 1)
            found.append(ArrayVariable(name, _text(elements[0].text, distinct), place, elements, shape))
        else:
            found += [ArrayVariable(port.name, port.text, place + i, (port,)) for i, port in enumerate(elements)]
        place += len(elements)
    return found


def _split(name: str) -> tuple[str, str]:
    """Name of the array of a Real, and the label of the element among those of a vector."""
    if match := re.fullmatch(r"(link|joint)\[\d+\]\.(.+)", name):
        whole = f"{match[1]}.{match[2]}"
        for array in OF_LINKS:
            if f"{whole}.".startswith(f"{array}."):
                return array, whole[len(array) + 1 :]
    head, _, last = name.rpartition(".")
    return (head, last) if last in AXES[1] else (name, "")


def _text(text: str, labels: Sequence[str]) -> str:
    """Description of an array from that of its first element."""
    if labels[0]:
        text = re.sub(rf"\b{re.escape(labels[0])}\b", ", ".join(labels), text, count=1)
    return re.sub(r"\b(link|pin) 1\b", r"each \1", text)


def document(
    name: str,
    *,
    guid: str,
    text: str,
    tool: str,
    arrays: Sequence[ArrayVariable],
    others: Sequence[Port],
    categories: Mapping[str, str],
    experiment: Mapping[str, Any],
) -> Element:
    """Root element of the document; value references go through arrays, ``others`` and the time.

    :param arrays: Float64 variables; those with the causality "local" are constants.
    :param others: Integers (outputs), then Strings (parameters).

    For the other parameters see ``fmus.fmi.description.document``.
    """
    identity = {"fmiVersion": "3.0", "modelName": name, "instantiationToken": guid}
    root = Element("fmiModelDescription", identity | origin(text, tool))
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=name,
        needsExecutionTool="false",
        canBeInstantiatedOnlyOncePerProcess="false",
        canGetAndSetFMUState="true",
        canSerializeFMUState="true",
        providesDirectionalDerivatives="false",
        providesAdjointDerivatives="false",
        providesPerElementDependencies="false",
        canHandleVariableCommunicationStepSize="true",
        maxOutputDerivativeOrder="1",
        providesIntermediateUpdate="false",
        mightReturnEarlyFromDoStep="false",
        canReturnEarlyAfterIntermediateUpdate="false",
        hasEventMode="false",
    )
    enumerations = [port for port in others if port.choices]
    add_definitions(root, [*(array.elements[0] for array in arrays), TIME], categories, experiment, enumerations)
    variables = SubElement(root, "ModelVariables")
    for reference, array in enumerate(arrays):
        _float(variables, reference, array)
    for reference, port in enumerate(others, len(arrays)):
        _other(variables, reference, port)
    SubElement(
        variables,
        "Float64",
        name=TIME.name,
        valueReference=str(len(arrays) + len(others)),
        description=TIME.text,
        causality=TIME.causality,
        variability="continuous",
        unit=TIME.unit,
    )
    _structure(SubElement(root, "ModelStructure"), [*(array.elements[0] for array in arrays), *others])
    return root


def _head(parent: Element, type_: str, reference: int, port: Port, variability: str) -> Element:
    """Element of a variable with the attributes that all types have."""
    attributes = {
        "name": port.name,
        "valueReference": str(reference),
        "description": port.text + (f" ({', '.join(port.choices)})" if port.choices else ""),
        "causality": port.causality,
        "variability": variability,
    }
    return SubElement(parent, type_, attributes | initial(port, variability))


def _float(parent: Element, reference: int, array: ArrayVariable) -> None:
    """Add a Float64 with its dimensions."""
    first = array.elements[0]._replace(name=array.name, text=array.text)
    continuous = first.causality in ("input", "output")
    variable = _head(parent, "Float64", reference, first, variability_of(first, continuous))
    variable.attrib |= quantity(first, continuous)
    if first.causality != "output":
        variable.set("start", " ".join(repr(float(port.start)) for port in array.elements))
    for size in array.shape:
        SubElement(variable, "Dimension", start=str(size))


def _other(parent: Element, reference: int, port: Port) -> None:
    """Add an Int64 output, an Enumeration with the choices of a port, or a String parameter."""
    is_text = isinstance(port.start, str)
    kind = "Enumeration" if port.choices else "String" if is_text else "Int64"
    variable = _head(parent, kind, reference, port, variability_of(port, False))
    if port.choices:
        variable.attrib |= {"declaredType": enumeration_type(port), "start": str(enumeration_value(port))}
    elif is_text:
        SubElement(variable, "Start", value=str(port.start))


def _structure(structure: Element, ports: Sequence[Port]) -> None:
    """Add outputs and initial unknowns, with the dependencies of ``fmus.fmi.description``."""
    outputs, known = (
        [str(reference) for reference, port in enumerate(ports) if port.causality == causality]
        for causality in ("output", "parameter")
    )
    for tag, dependencies in (("Output", ""), ("InitialUnknown", " ".join(known))):
        for reference in outputs:
            SubElement(structure, tag, valueReference=reference, dependencies=dependencies)
