"""Checks of what the description of an FMU says: its form and files, units, dependencies of outputs on inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import fmpy
from fmpy.validation import validate_fmu
from lxml import etree

from orchestrator.cosim.base_units import inverse_factors
from orchestrator.fmi.model_description import library_file
from orchestrator.fmu_check.instance import (
    CallRefused,
    Floats,
    Instance,
    NotApplicable,
    Subject,
    Verdict,
    listed,
    names_of,
)

TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"


def check_description(subject: Subject) -> Verdict:
    """Validate modelDescription.xml, by FMPy with the XSD of its version, and the terminals; load the binary."""
    faults = [" ".join(problem.split()) for problem in validate_fmu(str(subject.fmu))]
    folder, description = subject.unpacked
    if subject.is_fmi3:
        faults += _faults_of_terminals(folder / TERMINALS, {v.name for v in description.modelVariables})
    binaries = sorted(path.name for path in (folder / "binaries").glob("*"))
    try:
        with Instance(subject):
            pass
    except NotApplicable as refusal:
        faults.append(str(refusal))
    documented = "documented" if (folder / "documentation" / "index.html").is_file() else "no documentation"
    here = library_file(folder, description).parent.name
    note = f"valid; {documented}; binaries for {', '.join(binaries)}, that for {here} loads"
    return Verdict(note, tuple(faults))


def _faults_of_terminals(file: Path, variables: set[str]) -> list[str]:
    """Check the terminals of FMI 3.0 against their XSD; each member has to be a variable."""
    if not file.is_file():
        return []
    schema = etree.XMLSchema(etree.parse(Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"))
    try:
        root = etree.parse(file, etree.XMLParser(resolve_entities=False))
    except etree.XMLSyntaxError as error:
        return [f"{file.name}: {error}"]
    if not schema.validate(root):
        return [f"{file.name}: {error.message}" for error in schema.error_log]
    members = [member.get("variableName") for member in root.iter("TerminalMemberVariable")]
    return [f"{file.name}: there is no variable '{name}'" for name in members if name not in variables]


def check_units(subject: Subject) -> Verdict:
    """Compare the units of Real inputs, outputs and parameters with the units that are defined.

    Other tools need them to compare the ends of a connection. A Real without a unit is right unless all are without.
    """
    reals = [
        v for causality in ("input", "output", "parameter") for v in subject.variables(causality, subject.fmi.real)
    ]
    if not reals:
        return Verdict(f"there are no {subject.fmi.real} inputs, outputs and parameters", outcome="not applicable")
    defined = {unit.name: unit for unit in subject.description.unitDefinitions}
    units = {v.name: v.unit or (v.declaredType.unit if v.declaredType is not None else None) for v in reals}
    bare = [name for name, unit in units.items() if unit is None]
    used = [*dict.fromkeys(unit for unit in units.values() if unit is not None)]
    faults = [] if used else [f"none of {len(reals)} {subject.fmi.real}s has a unit: connections cannot be checked"]
    faults += [f"unit '{unit}' is not defined" for unit in used if unit not in defined]
    faults += [
        f"unit '{unit}' has no base units: connections cannot be checked"
        for unit in used
        if unit in defined and defined[unit].baseUnit is None
    ]
    faults += inverse_factors(subject.description)
    without = f"; without a unit: {listed(bare)}" if bare else ""
    return Verdict(f"{len(reals)} {subject.fmi.real}s in {len(used)} units with base units{without}", tuple(faults))


CHANGE = 1e-3  # of an input, relative, absolute below 1
Pairs = list[tuple[str, str]]  # input, output


def check_dependencies(subject: Subject) -> Verdict:
    """Check that the lists are complete, and that no output depends on an input without saying so.

    Inputs are changed in initialisation mode, and after a step, where an output that changes without a step has direct
    feedthrough.
    """
    description, faults = subject.description, []
    outputs = [v for v in subject.all_variables if v.causality == "output"]
    initial = [v for v in outputs if v.initial in ("approx", "calculated")]
    initial += [v for v in subject.all_variables if v.causality == "calculatedParameter"]
    for title, unknowns, expected in (
        ("Outputs", description.outputs, outputs),
        ("InitialUnknowns", description.initialUnknowns, initial),
    ):
        names = {unknown.variable.name for unknown in unknowns}
        if lacking := [v.name for v in expected if v.name not in names]:
            faults.append(f"ModelStructure/{title} lacks {listed(lacking)}")
    note = ""
    try:
        with Instance(subject) as instance:
            instance.enter()
            pairs = _dependent(subject, instance)
            faults += _undeclared("in initialisation mode", pairs, description.initialUnknowns, subject.owner)
            instance.leave_initialisation()
            instance.run(0, 2)
            try:
                pairs = _dependent(subject, instance)
            except CallRefused as refusal:  # FMI allows that: a host must step between setting and getting
                note = f"direct feedthrough cannot be seen: {refusal}"
            else:
                faults += _undeclared("after a step", pairs, description.outputs, subject.owner)
                note = f"direct feedthrough: {listed([f'{u} to {y}' for u, y in pairs]) or 'none'}"
    except CallRefused as refusal:
        faults.append(str(refusal))
    return Verdict(note, tuple(faults))


def _dependent(subject: Subject, instance: Instance) -> Pairs:
    """Pairs of elements of an input and of an output that changes with it at once; raises CallRefused."""
    pairs: Pairs = []
    values = subject.input_values(1, subject.amplitude)

    def outputs(inputs: Floats) -> Floats:
        instance.set_inputs(inputs)
        return instance.outputs()

    before = outputs(values)
    for place, name in subject.each([*enumerate(names_of(subject.inputs))]):
        changed = values.copy()
        changed[place] += CHANGE * max(1.0, abs(values[place]))
        pairs += [(name, output) for output in subject.differing(before, outputs(changed))]
    instance.set_inputs(values)
    return pairs


def _undeclared(when: str, pairs: Pairs, unknowns: Sequence[Any], owner: Mapping[str, str]) -> list[str]:
    """Faults of pairs that the declared dependencies of unknowns do not contain."""
    declared = {
        unknown.variable.name: {variable.name for variable in unknown.dependencies}
        for unknown in unknowns
        if unknown.dependencies is not None
    }
    return [
        f"{when} {output} depends on {name}, which its dependencies do not declare"
        for name, output in pairs
        if owner[name] not in declared.get(owner[output], {owner[name]})
    ]
