"""Check of inputs that are NaN or infinite: refused by a status, or without effect on any output."""

from __future__ import annotations

import math

from orchestrator.fmu_check.instance import WARNING, Instance, Subject, fatal, with_faults
from orchestrator.fmu_check.verdict import NotApplicable, Verdict

VALUES = math.nan, math.inf


def check(subject: Subject) -> Verdict:
    """Set each Real input to NaN and to infinity for a step, in instances of their own."""
    if not subject.inputs:
        raise NotApplicable("there are no Real inputs")
    refused, faults = 0, []
    for variable in subject.inputs:
        for value in VALUES:
            subject.begin(f"with {variable.name} = {value:g}")
            with Instance(subject) as instance:
                instance.initialise()
                instance.step(0)
                status = instance.set_real(variable.valueReference, value)
                is_taken, wrong = False, fatal(status)
                if status <= WARNING:
                    is_taken, wrong = instance.attempt_step(subject.step, subject.step)
            refused += not is_taken
            faults += with_faults(f"{variable.name} = {value:g}", wrong)
    taken = len(VALUES) * len(subject.inputs) - refused
    others = f"; with {taken} others all outputs are finite" if taken else ""
    return Verdict(f"{refused} values are refused{others}", tuple(faults))
