"""Failures of a step of a track and its warnings: by name, with the sentence of each.

A kernel returns the index of a failure and writes the numbers of its sentence.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fmus.interface.model import NO_ROTATION, TOO_MANY_STEPS
from fmus.interface.sentences import Sentence
from fmus.interface.wrenches import LONG_EXCHANGE
from fmus.physics.chain.integration import CAUSES, CROWDED, PINS_OPEN, SINGULAR, STEP_TOO_SHORT

NO_WHEEL, TOO_LONG, ELSEWHERE, APART, ASKEW, TURNED = range(1, 7)
NOT_CONVERGED, NO_SOLUTION, IN_A_HEAP = 7, 8, 9  # of an implicit step
NO_ACCELERATION, BLEW_UP, PINS_OPENED, TOO_SHORT = range(10, 14)  # of explicit integration

HALVED, TILTED, CREATED, TAUT = WARNINGS = range(4)  # warnings, each given once: flags at the end of the state
# Warnings without such a flag: of the first step alone; of a track on soil alone, whose flag is in the rut
OFF_ITS_PLACE, FORGOTTEN_RUT = 4, 5

OFF_PLACE = (  # warning or failure of the first step
    "at t = {0:.6g} s the {1:name} is {2:.3g} m too far from where the track was laid round it ({3:.3g} m ahead,"
    " {4:.3g} m to the left, {5:.3g} m up): start.position.*, start.lateral and all other start.* must be the vehicle's"
)
WHERE = "at t = {0:.6g} s, link {1:no}"
IMPLICITLY, EXPLICITLY = f"{WHERE}: residual {{2:.3g}} N", f"{WHERE}: take half of the step of {{2:.3g}} s"
FAILURES = {
    NO_WHEEL: NO_ROTATION,
    TOO_LONG: TOO_MANY_STEPS.text,
    ELSEWHERE: OFF_PLACE,
    APART: (
        "at t = {0:.6g} s the {1:name} is {2:.3g} m from the {4:name}, at the start it was {3:.3g} m from it: the"
        " motion of each wheel must be connected"
    ),
    ASKEW: (
        "at t = {0:.6g} s a wheel's axis is {1:.1f} degrees off the pin axis: cables with axes = 'fixed' stay in"
        " their plane, a vehicle that turns or rolls needs axes = 'free'"
    ),
    TURNED: (
        "at t = {0:.6g} s the wheels are turned by {1:.2g} degrees from where the track was laid round them:"
        " start.heading, start.pitch, start.slope.pitch and start.slope.roll of all parts must be the vehicle's"
    ),
    NOT_CONVERGED: f"Newton's iteration of the chain did not converge {IMPLICITLY}",
    NO_SOLUTION: f"the chain's matrix is singular {IMPLICITLY}",
    IN_A_HEAP: (
        f"the chain touches wheels and ground at {{2:.0f}} points {WHERE}: there is room for links side by side round"
        " each wheel, these lie in a heap"
    ),
    NO_ACCELERATION: f"the chain's matrix is singular in explicit integration {EXPLICITLY}",
    BLEW_UP: f"the explicit integration of the chain blew up {EXPLICITLY}",
    PINS_OPENED: f"the explicit integration of the chain opened its pins {EXPLICITLY}",
    TOO_SHORT: f"the explicit integration of the chain finds no step that keeps its tolerances {EXPLICITLY}",
}
# failures of a track by those of an integrator, of which an implicit and an explicit one have some
OF_IMPLICIT = np.full(len(CAUSES), NOT_CONVERGED)
OF_IMPLICIT[[SINGULAR, CROWDED]] = NO_SOLUTION, IN_A_HEAP
OF_EXPLICIT = np.full(len(CAUSES), BLEW_UP)
OF_EXPLICIT[[SINGULAR, PINS_OPEN, STEP_TOO_SHORT]] = NO_ACCELERATION, PINS_OPENED, TOO_SHORT

WARNING_TEXTS = (
    "the internal step was halved {0:d} times from t = {1:.4g} s on: contacts or friction are too sharp for it, and"
    " the run becomes slow",
    "a wheel's axis is {0:.2f} degrees off the pin axis at t = {1:.4g} s: cables with axes = 'fixed' drive in their"
    " own plane only, turns and side slopes need axes = 'free'",
    "at t = {0:.6g} s the wheels, most of all {1:name}, are not where the step of {2:.3g} s before assumed them, which"
    f" makes {{3:.3g}} J of nothing: {LONG_EXCHANGE}",
    f"at t = {{0:.6g}} s the chain pulls {{1:.3g}} N, {{2:.3g}} times what it rests on: a blow, or {LONG_EXCHANGE}",
    OFF_PLACE,
    "at t = {0:.6g} s the rut of the track is too long to be remembered: its oldest part counts as untouched ground, if"
    " the track comes back to it",
)


def warning_sentences(wheels: Sequence[str], soil: bool) -> tuple[Sentence, ...]:
    """Sentences of the warnings of a track on these wheels, by index; that of a rut on ``soil`` alone."""
    named = CREATED, OFF_ITS_PLACE  # sentences with a name of a wheel
    texts = WARNING_TEXTS if soil else WARNING_TEXTS[:FORGOTTEN_RUT]
    return tuple(Sentence(text, tuple(wheels) if index in named else ()) for index, text in enumerate(texts))


def failure_sentences(wheels: Sequence[str]) -> tuple[Sentence, ...]:
    """Sentences of the failures of a step of a track on these wheels, by index."""
    named = NO_WHEEL, ELSEWHERE, APART  # sentences with a name of a wheel
    return (
        Sentence(""),
        *(Sentence(text, tuple(wheels) if index in named else ()) for index, text in sorted(FAILURES.items())),
    )
