"""Check of the model structure, compared with the outputs' dependence on inputs that is found by changing them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.fmu_check.instance import Floats, Instance, Subject, elements
from orchestrator.fmu_check.verdict import Refused, Verdict, listed

CHANGE = 1e-3  # of an input, relative, absolute below 1
Pairs = list[tuple[str, str]]  # input, output


def check(subject: Subject) -> Verdict:
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
            instance.must("ExitInitializationMode")
            instance.run(0, 2)
            try:
                pairs = _dependent(subject, instance)
            except Refused as refusal:  # FMI allows that: a host must step between setting and getting
                note = f"direct feedthrough cannot be seen: {refusal}"
            else:
                faults += _undeclared("after a step", pairs, description.outputs, subject.owner)
                note = f"direct feedthrough: {listed([f'{u} to {y}' for u, y in pairs]) or 'none'}"
    except Refused as refusal:
        faults.append(str(refusal))
    return Verdict(note, tuple(faults))


def _dependent(subject: Subject, instance: Instance) -> Pairs:
    """Pairs of elements of an input and of an output that changes with it at once; raises Refused."""
    pairs: Pairs = []
    values = subject.input_values(1, subject.amplitude)

    def outputs(inputs: Floats) -> Floats:
        instance.set_inputs(inputs)
        return instance.outputs()

    before = outputs(values)
    names = [name for variable in subject.inputs for name in elements(variable)]
    for place, name in enumerate(names):
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
