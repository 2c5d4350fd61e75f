"""modelDescription.xml of an FMI 2.0 co-simulation FMU, with units, dependencies and initial unknowns."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from fmus.ports import NOMINAL, UNITS, Port

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
    units = SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(port.unit for port in variables[:reals]):
        base = {exponent: str(power) for exponent, power in UNITS[unit].items()}
        SubElement(SubElement(units, "Unit", name=unit), "BaseUnit", base)
    messages = SubElement(root, "LogCategories")
    for category, meaning in categories.items():
        SubElement(messages, "Category", name=category, description=meaning)
    times = {"stopTime": repr(float(experiment["stop"])), "stepSize": repr(float(experiment["step"]))}
    SubElement(root, "DefaultExperiment", {"startTime": "0", **times})
    element = SubElement(root, "ModelVariables")
    for reference, port in enumerate(variables):
        _variable(element, reference, port, reference < reals, reference < continuous)
    _structure(SubElement(root, "ModelStructure"), variables)
    return root


def _head(name: str, guid: str, text: str, tool: str) -> Element:
    """Root element with the element CoSimulation."""
    built = int(os.environ.get("SOURCE_DATE_EPOCH") or DATE)
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=name,
        guid=guid,
        description=text,
        author="the cotrack authors",
        version=version("cotrack"),
        copyright="Copyright (c) 2026 the cotrack authors",
        license="MIT, see documentation/licenses/license.txt",
        generationTool=tool,
        generationDateAndTime=time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(built)),
        variableNamingConvention="structured",
    )
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
    parameter = port.causality == "parameter"
    constant = port.causality == "local" and not isinstance(port.start, int)
    variability = "constant" if constant else "fixed" if parameter else "continuous" if continuous else "discrete"
    variable = SubElement(
        parent,
        "ScalarVariable",
        name=port.name,
        valueReference=str(reference),
        description=port.text + (f" ({', '.join(port.choices)})" if port.choices else ""),
        causality=port.causality,
        variability=variability,
    )
    if port.causality != "input":
        variable.set("initial", "exact" if parameter or constant else "calculated")
    attributes = {"unit": port.unit} if real else {}
    bounds = {"min": port.allowed.least, "max": port.allowed.most}
    attributes |= {name: repr(round(bound, 12)) for name, bound in bounds.items() if math.isfinite(bound)}
    if real and continuous and port.unit in NOMINAL:
        attributes["nominal"] = repr(NOMINAL[port.unit])
    if constant or port.causality in ("input", "parameter"):
        attributes["start"] = repr(float(port.start)) if real else str(port.start)
    SubElement(variable, "Real" if real else "String" if isinstance(port.start, str) else "Integer", attributes)


def _structure(structure: Element, variables: Sequence[Port]) -> None:
    """Add outputs and initial unknowns.

    Outputs depend on states alone (no feedthrough), the states at the start on parameters.
    """
    outputs, known = (
        [str(index) for index, port in enumerate(variables, 1) if port.causality == causality]
        for causality in ("output", "parameter")
    )
    for group, dependencies in (("Outputs", ""), ("InitialUnknowns", " ".join(known))):
        node = SubElement(structure, group)
        for index in outputs:
            SubElement(node, "Unknown", index=index, dependencies=dependencies)
