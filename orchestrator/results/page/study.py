"""All that a page needs to know of a run, worked out once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeVar

from orchestrator.log.container_reader import LogUnreadable
from orchestrator.results.analyses import phases, wheel_loads
from orchestrator.results.analyses.phases import Phase
from orchestrator.results.energy import ledger
from orchestrator.results.page import chain as links
from orchestrator.results.page import signals
from orchestrator.results.page.balance import Balance, balance
from orchestrator.results.page.chain import Chain
from orchestrator.results.page.ripple import Ripple, ripple
from orchestrator.results.page.signals import Recorded
from orchestrator.results.run_data import RunData
from orchestrator.results.thinned import Curve

Made = TypeVar("Made")
ALIKE = 1e-6  # of two values that differ by rounding
HULL = ("speed", "distance", "pitch", "roll", "yaw", "settlement")
# what a log that lacks something, or says something odd, makes of an evaluation
NOTHING = (LookupError, ValueError, TypeError, ArithmeticError, AttributeError)


class Judged(NamedTuple):
    """What a run's summary says of it."""

    checks: Mapping[str, Mapping[str, Any]]  # by name: value, expected, tolerance, ok, note
    observables: Mapping[str, float]
    note: str = ""  # why there are none
    again: str | None = None  # the command that makes the run again


class Study(NamedTuple):
    """A run, evaluated."""

    run: RunData
    judged: Judged
    span: tuple[float, float]  # s
    signals: dict[str, Recorded]
    drives: list[str]
    chains: dict[str, Chain]  # by track
    balance: Balance | None
    energies: dict[str, Curve]
    ripple: Ripple  # of curves that are bands
    phases: tuple[Phase, ...]  # none of what has no hull
    missing: list[str]  # sentences about what could not be had

    def mean(self, signal: str, window: float) -> Curve | None:
        """The moving mean of a signal over a time, s; None where its curve is no band."""
        found = self.signals[signal]
        return found.moving.over(window) if found.curve.banded(*self.span) else None

    @property
    def hardest(self) -> Chain | None:
        """The track that bears the most; of equal ones the first."""
        most = max((each.worst.value for each in self.chains.values()), default=0.0)
        return next((each for each in self.chains.values() if each.worst.value >= most - ALIKE * abs(most)), None)


def study(run: RunData, judged: Judged) -> Study:
    """Evaluate a run; raises LogUnreadable where the log is damaged."""
    missing: list[str] = []
    drives = signals.drives(run)
    wanted = [f"chassis.{name}" for name in HULL]
    wanted += [f"chassis.chassis.position.{axis}" for axis in "xyz"]
    wanted += [f"{drive}{name}" for drive in drives for name in ("torque", "speed", "power")]
    for track in run.tracks:
        wanted += [f"{track}.{name}" for name in ("speed", "slip", "stress.max", "ground.force.z", "penetration.max")]
        wanted += [f"{track}.tension.{which}" for which in ("max", "mean", "min")]
    known = signals.recorded(run, wanted)
    if wheel_loads.names(run):
        known |= attempt(lambda: signals.loads(run), missing) or {}
    chains = {}
    for track in run.tracks:
        if found := attempt(lambda track=track: links.chain(run, track), missing):  # type: ignore[misc]
            chains[track] = found
    span = signals.span(run)
    happened = attempt(lambda: phases.of(run).phases, missing) if "chassis.speed" in known else None
    return Study(
        run, judged, span, known, drives, chains,
        attempt(lambda: balance(run, ledger(run)), missing), attempt(lambda: signals.energies(run), missing) or {},
        ripple(run, drives, known, span), happened or (), missing,
    )  # fmt: skip


def attempt(make: Callable[[], Made], missing: list[str]) -> Made | None:
    """What is made, or None and a sentence about why; raises LogUnreadable."""
    try:
        return make()
    except LogUnreadable:
        raise
    except NOTHING as reason:
        missing.append(str(reason) or type(reason).__name__)
        return None
