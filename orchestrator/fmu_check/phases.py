"""Check of the order of calls (FMI 2.0.4, section 4.2.4): outside its phase a call is refused by its status.

A refusal by fmi2Fatal is a fault, because it ends all instances of the FMU.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import NamedTuple

from orchestrator.fmu_check.instance import WARNING, Instance, Subject, fatal
from orchestrator.fmu_check.verdict import NotApplicable, Refused, Verdict, listed

UNKNOWN = 2**31 - 1  # a value reference that no variable has
GUID = "{00000000-0000-0000-0000-000000000000}"


class Misuse(NamedTuple):
    """Call that has to be refused."""

    name: str
    phase: str  # entered before: instantiated, initialising, running or terminated
    call: Callable[[Instance, Subject], int]  # returns the status


def _set(causality: str, instance: Instance, subject: Subject) -> int:
    """Set the first Real of a causality to its value plus 1."""
    variables = [v for v in subject.variables(causality, "Real") if v.variability in ("fixed", "continuous")]
    if not variables:
        raise NotApplicable(f"there is no Real {causality}")
    reference = variables[0].valueReference
    return instance.set_real(reference, instance.get_real(reference)[1] + 1.0)


def _call(function: str, instance: Instance, subject: Subject) -> int:
    arguments = {"DoStep": (subject.start, subject.step, 0), "SetupExperiment": (0, 0.0, subject.start, 0, 0.0)}
    return instance.call(function, *arguments.get(function, ()))


MISUSES = (
    Misuse("fmi2DoStep before initialisation", "instantiated", partial(_call, "DoStep")),
    Misuse("fmi2ExitInitializationMode without entry", "instantiated", partial(_call, "ExitInitializationMode")),
    Misuse("fmi2Terminate before initialisation", "instantiated", partial(_call, "Terminate")),
    Misuse("fmi2DoStep in initialisation mode", "initialising", partial(_call, "DoStep")),
    Misuse("fmi2EnterInitializationMode twice", "initialising", partial(_call, "EnterInitializationMode")),
    Misuse("fmi2SetupExperiment after initialisation", "running", partial(_call, "SetupExperiment")),
    Misuse("fmi2SetReal of an output", "running", partial(_set, "output")),
    Misuse("fmi2SetReal of a fixed parameter while running", "running", partial(_set, "parameter")),
    Misuse("fmi2GetReal of an unknown value reference", "running", lambda i, s: i.get_real(UNKNOWN)[0]),
    Misuse("fmi2SetReal of an unknown value reference", "running", lambda i, s: i.set_real(UNKNOWN, 0.0)),
    Misuse("fmi2DoStep after fmi2Terminate", "terminated", partial(_call, "DoStep")),
    Misuse("fmi2Terminate twice", "terminated", partial(_call, "Terminate")),
)


def check(subject: Subject) -> Verdict:
    """Make each call outside its phase in an instance of its own, then calls that are allowed."""
    refused = 0
    wrong: dict[str, list[str]] = {}  # calls by fault
    for misuse in MISUSES:
        subject.begin(f"in {misuse.name}")
        with suppress(NotApplicable), Instance(subject) as instance:
            _enter(instance, misuse.phase)
            status = misuse.call(instance, subject)
            refused += status > WARNING
            for fault in fatal(status) if status > WARNING else ["accepted"]:
                wrong.setdefault(fault, []).append(misuse.name)
    if _takes_foreign_guid(subject):
        wrong.setdefault("accepted", []).append("fmi2Instantiate with another guid")
    faults = [f"{fault}: {', '.join(calls)}" for fault, calls in wrong.items()]
    for part in (_terminated, _reset):
        try:
            faults += part(subject)
        except Refused as refusal:
            faults.append(str(refusal))
    note = f"{refused} calls outside their phase and another guid are refused; fmi2Reset makes a new start"
    return Verdict(note, tuple(faults))


def _enter(instance: Instance, phase: str) -> None:
    if phase == "initialising":
        instance.enter()
    elif phase != "instantiated":
        instance.initialise()
        instance.run(0, 2)
        if phase == "terminated":
            instance.must("Terminate")


def _takes_foreign_guid(subject: Subject) -> bool:
    subject.begin("in fmi2Instantiate with another guid")
    try:
        with Instance(subject, GUID):
            return True
    except Refused:
        return False


def _terminated(subject: Subject) -> list[str]:
    """Outputs can be read after fmi2Terminate."""
    subject.begin("when outputs were read after fmi2Terminate")
    with Instance(subject) as instance:
        instance.initialise()
        instance.must("Terminate")
        instance.outputs()
    return []


def _reset(subject: Subject) -> list[str]:
    """A run after fmi2Reset has the bits of a new instance, and an instance can be freed after fmi2Reset."""
    subject.begin("in a second run after fmi2Reset")
    with Instance(subject) as instance:
        instance.initialise()
        first = instance.run()
        instance.must("Reset")
        instance.initialise()
        names = subject.differing(first, instance.run())
        subject.begin("in fmi2FreeInstance after fmi2Reset")
        instance.must("Reset")
    return [f"after fmi2Reset a run differs from that of a new instance in {listed(names)}"] if names else []
