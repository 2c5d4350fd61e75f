"""How often links are recorded: teeth strike them, and a record that is too seldom shows motions that are none."""

from __future__ import annotations

import math

SAMPLES = 10  # of a link while one tooth passes
FEWEST = 2  # with fewer than these a tooth's frequency is folded to another one
SELDOM = 10  # steps between records where no teeth pass
UNKNOWN = 20.0  # rad/s: taken as the top speed of a sprocket that a torque turns


def links_every(step: float, teeth: float) -> int:
    """Steps of length ``step``, s, from one record to the next, where so many teeth pass a second."""
    return SELDOM if teeth <= 0.0 else min(max(math.floor(1.0 / (SAMPLES * teeth * step) + 1e-9), 1), SELDOM)


def folded(every: int, step: float, teeth: float) -> str:
    """A sentence where records of links every so many steps show teeth at a wrong frequency; else nothing."""
    interval = every * step
    if FEWEST * teeth * interval <= 1.0:
        return ""
    shown = abs(teeth - round(teeth * interval) / interval)
    return (
        f"links are recorded every {1e3 * interval:.4g} ms, but up to {teeth:.4g} teeth pass a second: what they do to "
        f"links shows at {shown:.4g} Hz; run.links = {links_every(step, teeth)} resolves it"
    )
