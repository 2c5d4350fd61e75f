"""Evaluation of a run: results of the analyses that the sections of a page show."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

from orchestrator.results.analyses import curves, link_loads, phases, wheel_loads
from orchestrator.results.analyses.curves import Ripple, SignalCurve
from orchestrator.results.analyses.link_loads import LinkLoads
from orchestrator.results.analyses.phases import Phase
from orchestrator.results.approximations import Curve
from orchestrator.results.energy import Ledger, ledger
from orchestrator.results.run_data import RunData, reason

Made = TypeVar("Made")
ALIKE = 1e-6  # relative difference of values that count as equal
HULL = ("speed", "distance", "pitch", "roll", "yaw", "settlement", "chassis.angular_velocity.z")


class RunSummary(NamedTuple):
    """Checks and observables of a run."""

    checks: Mapping[str, Mapping[str, Any]]  # by name: value, expected, tolerance, ok, note
    observables: Mapping[str, float]
    windows: Mapping[str, Mapping[str, float]] = MappingProxyType({})  # averaging window by observable, s
    after_end: Mapping[str, Mapping[str, float]] = MappingProxyType({})  # windows, s, of checks that it does not cover
    left_out: Mapping[str, str] = MappingProxyType({})  # reasons by check that the record has too little for
    note: str = ""  # reason if there are none
    command: str | None = None  # command that makes the run again
    places: Mapping[str, str] = MappingProxyType({})  # where and when an observable is largest, in words


class Evaluation(NamedTuple):
    """Run, its checks, and the results of its analyses."""

    run: RunData
    summary: RunSummary
    signals: dict[str, SignalCurve]
    drives: list[str]  # prefixes of the variables of drives
    chains: dict[str, LinkLoads]  # by track
    ledger: Ledger | None
    energies: dict[str, Curve]
    ripple: Ripple  # averaging time of curves that are bands
    phases: tuple[Phase, ...]  # none without a hull
    missing: list[str]  # sentences on evaluations that failed

    def mean(self, signal: str, window: float) -> Curve | None:
        """Moving mean of a signal over a time, s; None unless its curve is a band."""
        signal_curve = self.signals[signal]
        return signal_curve.moving_mean.over(window) if signal_curve.curve.is_band(*self.run.span) else None

    @property
    def turns(self) -> tuple[Phase, ...]:
        """Phases in which the vehicle turns."""
        return tuple(phase for phase in self.phases if phase.turning)

    @property
    def most_loaded(self) -> LinkLoads | None:
        """Track with the largest tension, of equal ones the first; None without records of links."""
        return self.largest("tension")

    def largest(self, load: str) -> LinkLoads | None:
        """Track with the largest load of links, as ``LinkLoads.most`` has it; of equal ones the first."""
        values = {track: loads.most[load].value for track, loads in self.chains.items() if load in loads.most}
        most = max(values.values(), default=0.0)
        return next((self.chains[track] for track, value in values.items() if value >= most - ALIKE * abs(most)), None)

    @property
    def bearers(self) -> dict[tuple[str, int], list[str]]:
        """Tracks and links with a largest load of the whole run, and the names of these loads."""
        found: dict[tuple[str, int], list[str]] = {}
        for load in link_loads.SIGNALS:
            loads = self.largest(load)
            if loads and (load == "tension" or loads.most[load].value > 0.0):
                found.setdefault((loads.track, loads.most[load].member), []).append(load)
        return found

    @property
    def slackest(self) -> LinkLoads | None:
        """Track with the smallest tension, of equal ones the first; None without records of links."""
        least = min((loads.slackest.value for loads in self.chains.values()), default=0.0)
        return next((one for one in self.chains.values() if one.slackest.value <= least + ALIKE * abs(least)), None)

    def result(self, name: str) -> Any:
        """Result in the closing record; None without it."""
        try:
            return json.loads((self.run.log.closing or {})["results"][name])
        except (LookupError, ValueError, TypeError):
            return None


def evaluate(run: RunData, summary: RunSummary) -> Evaluation:
    """Evaluate a run; raises LogUnreadable if the log is damaged."""
    missing: list[str] = []
    drives = curves.drives(run)
    names = [f"chassis.{name}" for name in HULL]
    names += [f"chassis.chassis.position.{axis}" for axis in "xyz"]
    names.append("driver.path.lateral_error")
    names += [f"{drive}{name}" for drive in drives for name in ("torque", "speed", "power")]
    for track in run.tracks:
        names += [f"{track}.{name}" for name in ("speed", "slip", "stress.max", "ground.force.z", "penetration.max")]
        names += [f"{track}.tension.{which}" for which in ("max", "mean", "min")]
    signals = curves.of(run, names)
    if wheel_loads.names(run):
        signals |= attempt(lambda: curves.loads(run), missing) or {}
    chains = {}
    for track in run.tracks:
        if loads := attempt(lambda track=track: link_loads.of(run, track), missing):  # type: ignore[misc]
            chains[track] = loads
    run_phases = attempt(lambda: phases.of(run).phases, missing) if "chassis.speed" in signals else None
    if any(phase.turning for phase in run_phases or ()):
        signals |= attempt(lambda: curves.of_turns(run), missing) or {}
    return Evaluation(
        run, summary, signals, drives, chains, attempt(lambda: ledger(run), missing),
        attempt(lambda: curves.energies(run), missing) or {}, curves.ripple(run, drives, signals),
        run_phases or (), missing,
    )  # fmt: skip


def attempt(make: Callable[[], Made], missing: list[str]) -> Made | None:
    """Result of ``make``; None after an error, whose sentence goes to ``missing``. Raises as ``reason`` does."""
    try:
        return make()
    except Exception as error:
        missing.append(reason(error))
        return None
