"""modelDescription.xml of an FMI 2.0 co-simulation FMU, with units, dependencies and initial unknowns."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from fmus.interface.ports import NOMINAL, TYPES, UNITS, Port, type_of

UNCONNECTED = ("link[", "joint[", "energy.", "solver.")  # beginnings of names of outputs
DATE = 315_532_800  # s: 1980-01-01 as for the files in the archive, so that equal sources give equal bytes


def document(
    name: str,
    *,
    guid: str,
    text: str,
    tool: str,
    variables: Sequence[Port],
    reals: int,
    continuous: int,
    categories: Mapping[str, str],
    experiment: Mapping[str, Any],
) -> Element:
    """Root element of the document.

    :param name: name of the model and identifier of its binary.
    :param text: description of the model, one line.
    :param tool: name of the generating tool.
    :param variables: the index is the value reference; Reals come first. A variable with the causality "local" is a
        constant, unless it is an Integer.
    :param reals: number of Reals.
    :param continuous: number of Reals that are not parameters.
    :param categories: categories of log messages, and their meanings.
    :param experiment: ``stop`` and ``step``, s, of the DefaultExperiment (see ``defaults.EXPERIMENT``).
    """
    root = _head(name, guid, text, tool)
    add_definitions(root, variables[:reals], categories, experiment)
    element = SubElement(root, "ModelVariables")
    for reference, port in enumerate(variables):
        _variable(element, reference, port, reference < reals, reference < continuous)
    _structure(SubElement(root, "ModelStructure"), variables)
    return root


def add_definitions(
    root: Element,
    reals: Iterable[Port],
    categories: Mapping[str, str],
    experiment: Mapping[str, Any],
    enumerations: Iterable[Port] | None = None,
) -> None:
    """Add UnitDefinitions, TypeDefinitions, LogCategories and DefaultExperiment, see ``document``.

    ``enumerations``: in FMI 3.0, Strings with choices, which are Enumerations there.
    """
    used = {(port.unit, type_of(port)): None for port in reals}
    parent = SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(unit for unit, _ in used):
        base = {exponent: str(power) for exponent, power in UNITS[unit].items()}
        element = SubElement(parent, "Unit", name=unit)
        SubElement(element, "BaseUnit", base)
        for _, shown, factor in (TYPES[kind] for of, kind in used if kind and of == unit):
            if shown:
                SubElement(element, "DisplayUnit", name=shown, factor=repr(factor))
    parent = SubElement(root, "TypeDefinitions")
    for kind in filter(None, (kind for _, kind in used)):
        attributes = {"quantity": kind, **_units(kind)}
        if enumerations is None:
            SubElement(SubElement(parent, "SimpleType", name=kind), "Real", attributes)
        else:
            SubElement(parent, "Float64Type", {"name": kind, **attributes})
    for port in enumerations or ():
        choices = SubElement(parent, "EnumerationType", name=enumeration_type(port), description=port.text)
        for value, choice in enumerate(port.choices, 1):
            SubElement(choices, "Item", name=choice, value=str(value))
    messages = SubElement(root, "LogCategories")
    for category, meaning in categories.items():
        SubElement(messages, "Category", name=category, description=meaning)
    SubElement(root, "DefaultExperiment", {"startTime": "0", **experiment_attributes(experiment)})


def enumeration_type(port: Port) -> str:
    """Name of the type of a String with choices; no variable may have it."""
    return f"choice of {port.name}"


def _units(kind: str) -> dict[str, str]:
    """Attributes of a type of ``ports.TYPES``: its unit and the one to show."""
    unit, shown, _ = TYPES[kind]
    return {"unit": unit, **({"displayUnit": shown} if shown else {})}


def experiment_attributes(experiment: Mapping[str, Any]) -> dict[str, str]:
    """Attributes of the DefaultExperiment with ``stop`` and ``step``, s."""
    return {"stopTime": repr(float(experiment["stop"])), "stepSize": repr(float(experiment["step"]))}


def origin(text: str, tool: str) -> dict[str, str]:
    """Attributes of the root element that tell what the FMU is and who made it, see ``document``."""
    built = int(os.environ.get("SOURCE_DATE_EPOCH") or DATE)
    return {
        "description": text,
        "author": "the cotrack authors",
        "version": version("cotrack"),
        "copyright": "Copyright (c) 2026 the cotrack authors",
        "license": "MIT, see documentation/licenses/license.txt",
        "generationTool": tool,
        "generationDateAndTime": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(built)),
        "variableNamingConvention": "structured",
    }


def _head(name: str, guid: str, text: str, tool: str) -> Element:
    """Root element with the element CoSimulation."""
    identity = {"fmiVersion": "2.0", "modelName": name, "guid": guid}
    root = Element("fmiModelDescription", identity | origin(text, tool))
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=name,
        needsExecutionTool="false",
        canHandleVariableCommunicationStepSize="true",
        canInterpolateInputs="false",
        maxOutputDerivativeOrder="0",
        canRunAsynchronuously="false",
        canBeInstantiatedOnlyOncePerProcess="false",
        canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
        providesDirectionalDerivative="false",
    )
    return root


def _variable(parent: Element, reference: int, port: Port, real: bool, continuous: bool) -> None:
    """Add the ScalarVariable of a port, a Real if ``real``, else of the type of its start value."""
    variability = variability_of(port, continuous)
    variable = SubElement(
        parent,
        "ScalarVariable",
        name=port.name,
        valueReference=str(reference),
        description=port.text + (f" ({', '.join(port.choices)})" if port.choices else ""),
        causality=port.causality,
        variability=variability,
    )
    variable.attrib |= initial(port, variability)
    attributes = quantity(port, continuous) if real else bounds(port)
    if variability == "constant" or port.causality in ("input", "parameter"):
        attributes["start"] = repr(float(port.start)) if real else str(port.start)
    SubElement(variable, "Real" if real else "String" if isinstance(port.start, str) else "Integer", attributes)


def variability_of(port: Port, continuous: bool) -> str:
    """FMI variability of a port, ``continuous`` as in ``document``."""
    if port.causality == "local" and not isinstance(port.start, int):
        return "constant"
    return "fixed" if port.causality == "parameter" else "continuous" if continuous else "discrete"


def initial(port: Port, variability: str) -> dict[str, str]:
    """Attribute ``initial`` of a port, which an input does not have."""
    if port.causality == "input":
        return {}
    return {"initial": "exact" if variability in ("fixed", "constant") else "calculated"}


def bounds(port: Port) -> dict[str, str]:
    """Attributes of the allowed values."""
    both = {"min": port.allowed.least, "max": port.allowed.most}
    return {name: repr(round(bound, 12)) for name, bound in both.items() if math.isfinite(bound)}


def quantity(port: Port, continuous: bool) -> dict[str, str]:
    """Attributes of a Real: type, unit and the one to show, bounds, nominal value."""
    nominal = {"nominal": repr(NOMINAL[port.unit])} if continuous and port.unit in NOMINAL else {}
    kind = type_of(port)
    units = {"declaredType": kind, **_units(kind)} if kind else {"unit": port.unit}
    return {**units, **bounds(port), **nominal}


def _structure(structure: Element, variables: Sequence[Port]) -> None:
    """Add outputs and initial unknowns.

    Outputs depend on states alone (no feedthrough), the states at the start on parameters. Where no host connects an
    output (UNCONNECTED), the standard's default, which says that it depends on everything, stands for a long list.
    """
    outputs = [(str(index), port) for index, port in enumerate(variables, 1) if port.causality == "output"]
    known = " ".join(str(index) for index, port in enumerate(variables, 1) if port.causality == "parameter")
    group = SubElement(structure, "Outputs")
    for index, _ in outputs:
        SubElement(group, "Unknown", index=index, dependencies="")
    group = SubElement(structure, "InitialUnknowns")
    for index, port in outputs:
        of_all = port.name.startswith(UNCONNECTED)
        SubElement(group, "Unknown", {"index": index, **({} if of_all else {"dependencies": known})})
