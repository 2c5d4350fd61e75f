"""Check of inputs that are NaN or infinite: refused by a status, or without effect on any output."""

from __future__ import annotations

import math

from orchestrator.fmu_check.instance import WARNING, Instance, Subject, elements, with_faults
from orchestrator.fmu_check.verdict import NotApplicable, Verdict

VALUES = math.nan, math.inf


def check(subject: Subject) -> Verdict:
    """Set each element of a Real input to NaN and to infinity for a step, in instances of their own."""
    if not subject.inputs:
        raise NotApplicable(f"there are no {subject.fmi.REAL} inputs")
    refused, faults = 0, []
    names = [name for variable in subject.inputs for name in elements(variable)]
    for place, name in enumerate(names):
        for value in VALUES:
            subject.begin(f"with {name} = {value:g}")
            with Instance(subject) as instance:
                instance.initialise()
                instance.step(0)
                values = subject.input_values(0, subject.amplitude)
                values[place] = value
                status = instance.try_inputs(values)
                is_taken, wrong = False, instance.fatal(status)
                if status <= WARNING:
                    is_taken, wrong = instance.attempt_step(subject.step, subject.step)
            refused += not is_taken
            faults += with_faults(f"{name} = {value:g}", wrong)
    taken = len(VALUES) * len(names) - refused
    others = f"; with {taken} others all outputs are finite" if taken else ""
    return Verdict(f"{refused} values are refused{others}", tuple(faults))
