"""State machine of an FMU instance: phases, the FMI calls allowed in each, communication points.

Sources: FMI 2.0.4, section 4.2.4, and FMI 3.0.2, sections 2.3 and 4.2 (co-simulation). `slave.py`,
`model_instance.py` and the front ends `native/fmi2.c` and `native/fmi3.c` use these tables. Calls that are not in them
are allowed in every phase.

Deviations: a call that is refused (fmi2Error) and a step that cannot be done (fmi2Discard) leave the instance as it
was, so there are no phases for an error and a failed step: the next call, with good input or a shorter step, goes on.
Without fmi2SetupExperiment the first step may begin at any time.
"""

from __future__ import annotations

import math
from enum import IntEnum

from fmus.interface.sentences import Sentence, format_sentence


class Refused(RuntimeError):
    """Refusal of an FMI call; the message is one sentence."""


class InstancePhase(IntEnum):
    """Phase of an instance, as FMI's state machine has it."""

    INSTANTIATED = 0
    INITIALISING = 1
    RUNNING = 2
    TERMINATED = 3


def _before_running(*calls: str) -> dict[str, tuple[InstancePhase, ...]]:
    return dict.fromkeys(calls, (InstancePhase.INSTANTIATED, InstancePhase.INITIALISING, InstancePhase.RUNNING))


def _when_initialised(*calls: str) -> dict[str, tuple[InstancePhase, ...]]:
    return dict.fromkeys(calls, (InstancePhase.INITIALISING, InstancePhase.RUNNING, InstancePhase.TERMINATED))


ALLOWED = {
    "fmi2SetupExperiment": (InstancePhase.INSTANTIATED,),
    "fmi2EnterInitializationMode": (InstancePhase.INSTANTIATED,),
    "fmi2ExitInitializationMode": (InstancePhase.INITIALISING,),
    "fmi2DoStep": (InstancePhase.RUNNING,),
    "fmi2Terminate": (InstancePhase.RUNNING,),
    **_before_running("fmi2SetReal", "fmi2SetInteger", "fmi2SetBoolean", "fmi2SetString"),
    **_when_initialised("fmi2GetReal", "fmi2GetInteger", "fmi2GetBoolean", "fmi2GetString"),
}
ALLOWED_FMI3 = {
    "fmi3EnterInitializationMode": (InstancePhase.INSTANTIATED,),
    "fmi3ExitInitializationMode": (InstancePhase.INITIALISING,),
    "fmi3DoStep": (InstancePhase.RUNNING,),
    "fmi3Terminate": (InstancePhase.RUNNING,),
    **_before_running("fmi3SetFloat64", "fmi3SetInt64", "fmi3SetString"),
    **_when_initialised("fmi3GetFloat64", "fmi3GetInt64", "fmi3GetString"),
}


def not_allowed(call: str, phase: InstancePhase) -> str:
    """Sentence that refuses a call of ``ALLOWED`` or ``ALLOWED_FMI3`` in a phase; empty where it is allowed."""
    allowed = ALLOWED.get(call) or ALLOWED_FMI3[call]
    if phase in allowed:
        return ""
    phases = " or ".join(each.name.lower() for each in allowed)
    return f"{call} is not allowed in the phase {phase.name.lower()}, only when {phases}"


# Communication points

RESOLUTION = 1e-9  # s, shortest communication step, and tolerance of its beginning; after 1 s times the time run
LENGTHS = RESOLUTION, 1e6  # s, shortest and longest communication step
ROUNDING = 1e-15  # of a time, whose rounding adds to that
SHORT = Sentence(
    f"a step needs a finite time and a length of at least {RESOLUTION:g} s (after 1 s: of the time run) "
    f"and at most {LENGTHS[1]:g} s, " + "not t = {0:.9g}, h = {1:.9g}"
)
JUMP = Sentence("the step begins at t = {0:.9g}, but the last one ended at {1:.9g}: restore a saved state to go back")
LATE = Sentence("the step ends at t = {0:.9g}, after the stop time {1:.9g}")


def refused_step(t: float, h: float, now: float, stop: float, start: float) -> str:
    """Sentence that refuses a step from ``t`` of the length ``h``; empty where it may begin. All times in s.

    ``now``: end of the last step or start time, NaN before a first step without one; ``stop``: stop time or NaN;
    ``start``: start time, or NaN.
    """
    shortest = RESOLUTION * max(1.0, abs(t - start))  # max takes 1.0 beside NaN
    slack = shortest + ROUNDING * abs(t)
    if not (math.isfinite(t) and shortest <= h <= LENGTHS[1]):
        return format_sentence(SHORT, (t, h))
    if abs(t - now) > slack:
        return format_sentence(JUMP, (t, now))
    if t + h - stop > slack:
        return format_sentence(LATE, (t + h, stop))
    return ""
