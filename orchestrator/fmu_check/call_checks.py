"""Checks of unusual calls: outside their phase, with unusual steps, with inputs that are NaN or infinite.

A call that is not allowed is refused by its status. The rules of phases are those of FMI 2.0.4, section 4.2.4, and FMI
3.0.2, sections 2.3 and 4.2. A refusal by the status Fatal is a fault, because it ends all instances of the FMU.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import NamedTuple

from orchestrator.fmi.model_description import number_of_elements
from orchestrator.fmi.slave import WARNING
from orchestrator.fmu_check.instance import (
    CallRefused,
    Instance,
    NotApplicable,
    Subject,
    Verdict,
    listed,
    names_of,
    with_faults,
)

UNKNOWN = 2**31 - 1  # a value reference that no variable has
GUID = "{00000000-0000-0000-0000-000000000000}"


class Misuse(NamedTuple):
    """Call that has to be refused."""

    function: str  # a format of ``fmi``, without prefix
    when: str
    phase: str  # entered before: instantiated, initialising, running or terminated
    call: Callable[[Instance, Subject], int]  # returns the status

    def name(self, subject: Subject) -> str:
        """Return the words for it."""
        return f"{subject.name(self.function.format(fmi=subject.fmi))} {self.when}"


def _set(causality: str, instance: Instance, subject: Subject) -> int:
    """Set the first Real of a causality to its value plus 1."""
    variables = [v for v in subject.variables(causality, subject.fmi.real) if v.variability in ("fixed", "continuous")]
    if not variables:
        raise NotApplicable(f"there is no {subject.fmi.real} {causality}")
    references = [variables[0].valueReference]
    return instance.set_reals(references, instance.get_reals(references, number_of_elements(variables[0]))[1] + 1.0)


def _step(instance: Instance, subject: Subject) -> int:
    return int(instance.attempt(instance.slave.step, subject.start, subject.step, False))


def _enter(instance: Instance, subject: Subject) -> int:
    return int(instance.attempt(instance.slave.enter_initialisation))


def _late(instance: Instance, subject: Subject) -> int:
    if subject.is_fmi3:
        return _enter(instance, subject)
    return int(instance.attempt(instance.slave.setup, subject.start, None))


def _exit(instance: Instance, subject: Subject) -> int:
    return int(instance.attempt(instance.slave.exit_initialisation))


def _terminate(instance: Instance, subject: Subject) -> int:
    return int(instance.attempt(instance.slave.terminate))


MISUSES = (
    Misuse("DoStep", "before initialisation", "instantiated", _step),
    Misuse("ExitInitializationMode", "without entry", "instantiated", _exit),
    Misuse("Terminate", "before initialisation", "instantiated", _terminate),
    Misuse("DoStep", "in initialisation mode", "initialising", _step),
    Misuse("EnterInitializationMode", "twice", "initialising", _enter),
    Misuse("{fmi.late}", "after initialisation", "running", _late),
    Misuse("Set{fmi.real}", "of an output", "running", partial(_set, "output")),
    Misuse("Set{fmi.real}", "of a fixed parameter while running", "running", partial(_set, "parameter")),
    Misuse("Get{fmi.real}", "of an unknown value reference", "running", lambda i, s: i.get_reals([UNKNOWN], 1)[0]),
    Misuse("Set{fmi.real}", "of an unknown value reference", "running", lambda i, s: i.set_reals([UNKNOWN], [0.0])),
    Misuse("DoStep", "after termination", "terminated", _step),
    Misuse("Terminate", "twice", "terminated", _terminate),
)


def check_phases(subject: Subject) -> Verdict:
    """Make each call outside its phase in an instance of its own, then calls that are allowed."""
    refused = 0
    wrong = {"accepted": [_with_another_token(subject)]} if _takes_foreign_token(subject) else {}  # calls by fault
    for misuse in subject.each(MISUSES):
        subject.doing = f"in {misuse.name(subject)}"
        with suppress(NotApplicable), Instance(subject) as instance:
            _bring(instance, misuse.phase)
            status = misuse.call(instance, subject)
            refused += status > WARNING
            for fault in instance.fatal(status) if status > WARNING else ["accepted"]:
                wrong.setdefault(fault, []).append(misuse.name(subject))
    faults = [f"{fault}: {', '.join(calls)}" for fault, calls in wrong.items()]
    for part in (_terminated, _reset):
        try:
            faults += part(subject)
        except CallRefused as refusal:
            faults.append(str(refusal))
    words = f"{refused} calls outside their phase and another {subject.fmi.token} are refused"
    note = f"{words}; {subject.name('Reset')} makes a new start"
    return Verdict(note, tuple(faults))


def _bring(instance: Instance, phase: str) -> None:
    if phase == "initialising":
        instance.enter()
    elif phase != "instantiated":
        instance.initialise()
        instance.run(0, 2)
        if phase == "terminated":
            instance.terminate()


def _with_another_token(subject: Subject) -> str:
    return f"{subject.name(subject.fmi.instantiate)} with another {subject.fmi.token}"


def _takes_foreign_token(subject: Subject) -> bool:
    subject.doing = f"in {_with_another_token(subject)}"
    try:
        with Instance(subject, GUID):
            return True
    except CallRefused:
        return False


def _terminated(subject: Subject) -> list[str]:
    """Outputs can be read after termination."""
    subject.doing = f"when outputs were read after {subject.name('Terminate')}"
    with Instance(subject) as instance:
        instance.initialise()
        instance.terminate()
        instance.outputs()
    return []


def _reset(subject: Subject) -> list[str]:
    """A run after a reset has the bits of a new instance, and an instance can be freed after one."""
    reset = subject.name("Reset")
    subject.doing = f"in a second run after {reset}"
    with Instance(subject) as instance:
        instance.initialise()
        first = instance.run()
        instance.reset()
        instance.initialise()
        names = subject.differing(first, instance.run())
        instance.reset()
    return [f"after {reset} a run differs from that of a new instance in {listed(names)}"] if names else []


SHORT = "1e-6 s"
# Steps that follow two ordinary ones: gap before the step, its length, both in communication steps.
ODD_STEPS: dict[str, tuple[tuple[float, float], ...]] = {
    SHORT: (),
    "10 times the length": ((0.0, 10.0), (0.0, 1.0)),
    "unequal lengths": ((0.0, 0.3), (0.0, 1.7), (0.0, 0.01), (0.0, 1.0)),
    "length 0": ((0.0, 0.0), (0.0, 1.0)),
    "negative length": ((0.0, -1.0), (0.0, 1.0)),
    "a gap before it": ((0.5, 1.0), (0.0, 1.0)),
    "a begin before the last end": ((-0.5, 1.0), (0.0, 1.0)),
}


def check_odd_steps(subject: Subject) -> Verdict:
    """Make unusual steps, each kind in an instance of its own."""
    kinds: dict[str, list[str]] = {"taken": [], "refused": []}
    faults = []
    for name, steps in subject.each([*ODD_STEPS.items()]):
        subject.doing = f"in a step of {name}"
        with Instance(subject) as instance:
            instance.initialise()
            instance.run(0, 2)
            t, taken = 2 * subject.step, True
            for gap, length in steps or ((0.0, 1e-6 / subject.step),) * 2:
                if taken:
                    t += gap * subject.step
                    taken, wrong = instance.attempt_step(t, length * subject.step)
                    t += length * subject.step
                    faults += with_faults(f"step of {name}", wrong)
        kinds["taken" if taken else "refused"].append(name)
    note = "; ".join(f"{kind}: {', '.join(names) or 'none'}" for kind, names in kinds.items())
    return Verdict(note, tuple(faults))


VALUES = math.nan, math.inf


def check_non_finite_inputs(subject: Subject) -> Verdict:
    """Set each element of a Real input to NaN and to infinity for a step, in instances of their own."""
    if not subject.inputs:
        raise NotApplicable(f"there are no {subject.fmi.real} inputs")
    refused, faults = 0, []
    names = names_of(subject.inputs)
    for place, name in subject.each([*enumerate(names)]):
        for value in VALUES:
            subject.doing = f"with {name} = {value:g}"
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
