"""Recording interval of links: teeth excite links periodically, and slow sampling aliases that motion."""

from __future__ import annotations

import math

SAMPLES = 10  # records while one tooth passes
NYQUIST = 2  # below, the frequency of the teeth is aliased
LONGEST_INTERVAL = 10  # steps between records in scenes without teeth
ASSUMED_SPEED = 20.0  # rad/s: assumed top speed of a sprocket driven by torque


def links_every(step: float, teeth: float) -> int:
    """Number of steps of length ``step``, s, between records of links at ``teeth`` per second."""
    return (
        LONGEST_INTERVAL
        if teeth <= 0.0
        else min(max(math.floor(1.0 / (SAMPLES * teeth * step) + 1e-9), 1), LONGEST_INTERVAL)
    )


def aliasing_warning(every: int, step: float, teeth: float) -> str:
    """Sentence if recording every so many steps aliases the frequency of the teeth, else empty."""
    interval = every * step
    if NYQUIST * teeth * interval <= 1.0:
        return ""
    alias = abs(teeth - round(teeth * interval) / interval)
    enough = links_every(step, teeth)
    finer = f"run.links = {enough}" if NYQUIST * teeth * enough * step <= 1.0 else "a shorter run.step"
    return (
        f"links are recorded every {1e3 * interval:.4g} ms, but up to {teeth:.4g} teeth pass a second: what they do to "
        f"links shows at {alias:.4g} Hz; {finer} resolves it"
    )
