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
                taken, wrong = False, fatal(status)
                if status <= WARNING:
                    taken, wrong = instance.attempt_step(subject.step, subject.step)
            refused += not taken
            faults += with_faults(f"{variable.name} = {value:g}", wrong)
    note = f"{refused} of {len(VALUES) * len(subject.inputs)} values are refused, with the others outputs are finite"
    return Verdict(note, tuple(faults))
