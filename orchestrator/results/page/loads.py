"""Section with the loads of road wheels and the pressure of the ground."""

from __future__ import annotations

from functools import partial

import numpy as np

from orchestrator.results.analyses import ground_pressure, wheel_loads
from orchestrator.results.analyses.profile import Profile
from orchestrator.results.analyses.wheel_loads import SETTLING, is_settling, lifted, starts_as_drawn
from orchestrator.results.approximations import Curve
from orchestrator.results.page.chain import profiles
from orchestrator.results.page.embedded import instance, plain, quantity, text, wheel, wheel_name
from orchestrator.results.page.evaluation import ALIKE, Evaluation, attempt
from orchestrator.results.page.heading import COMING_TO_REST
from orchestrator.results.page.section import Content, PageSection, Pair, Trace, heat, lines, table
from orchestrator.results.run_data import Window
from orchestrator.results.units import number
from orchestrator.vocabulary import and_list

TOUCHED = 1e-3  # of the largest pressure
WHEELS = (
    "Force of the chain on each wheel, along the hull's own upward axis, mean over each step. Wheel 1 is the first of"
    " road_wheel.x. The chain's tension pulls the hull down: the loads add up to more than it weighs."
)


def loads(pair: Pair) -> PageSection | None:
    """Section of the loads; None without wheels and ground."""
    evaluation, content = pair.run, Content()
    names = [name for name in evaluation.signals if name.endswith(".load")]
    for side, track in enumerate(evaluation.run.tracks):
        of_track = [name for name in names if name.partition(".")[0] == track]
        named = [(name, wheel_name(name.removesuffix(".load").partition(".")[2])) for name in of_track]
        if drawn := pair.lines(named):
            chart, title = pair.over_time("force", "N", drawn), f"Road wheels, {instance(track)}"
            content.add_figure(f"wheels-{side}", chart, title, _lifted(evaluation, track))
    forces = {track: evaluation.signals.get(f"{track}.ground.force.z") for track in evaluation.run.tracks}
    grounded = [track for track, force in forces.items() if force and force.most.value > force.least.value]
    if grounded:
        drawn = pair.lines([(f"{track}.ground.force.z", plain(track)) for track in grounded])
        chart = pair.over_time("force", "N", drawn)
        content.add_figure("ground", chart, "Vertical force of the ground", "On each track.")
    if content.html:
        content.as_grid()
        content.html += _table(evaluation)
    _pressure(evaluation, content)
    title = "What do wheels and ground carry?"
    return PageSection("loads", "Loads", title, content.html, content.charts) if content.charts else None


def _lifted(evaluation: Evaluation, track: str) -> str:
    """Sentences on the wheels of a track that were lifted off, HTML."""
    lifted_wheels = {
        name: intervals
        for name, intervals in lifted(evaluation.run).by_member.items()
        if name.partition(".")[0] == track and intervals
    }
    late = [
        name
        for name, intervals in lifted_wheels.items()
        if any(not is_settling(evaluation.run, interval.end) for interval in intervals)
    ]
    if late:
        names = and_list([text(wheel_name(name.partition(".")[2])) for name in late])
        return f"{WHEELS} <b>Lifted off for a time: {names}.</b>"
    return f"{WHEELS} {f'After the first {number(SETTLING)} s none' if lifted_wheels else 'None'} is ever lifted off."


def _table(evaluation: Evaluation) -> str:
    """Table of the load of each wheel, of a vehicle that was dropped after it has come to rest; HTML."""
    begin = COMING_TO_REST if starts_as_drawn(evaluation.run) else evaluation.run.span[0]
    window = Window(begin, evaluation.run.span[1])
    wheels = attempt(lambda: wheel_loads.of(evaluation.run, window), [])
    if wheels is None:
        return ""
    rows = [
        (wheel(name), *(quantity(value, "N") for value in values))
        for name, *values in zip(wheels.wheels, wheels.least, wheels.mean, wheels.most, strict=True)
    ]
    title = f"Load of each wheel, {number(begin)} to {number(window.end)} s"
    return f"<h3>{title}</h3>{table(('Wheel', 'Least', 'Mean', 'Largest'), rows)}"


def _pressure(evaluation: Evaluation, content: Content) -> None:
    """Figures of the pressure under links of the track with the largest: along the vehicle, and over time."""
    found = [
        (chain, pressures)
        for chain in evaluation.chains.values()
        if (pressures := attempt(partial(ground_pressure.over_time, evaluation.run, chain), evaluation.missing))
    ]
    if not found:
        return
    largest = max(pressures.peak.value for _, pressures in found)
    chain, pressures = next(one for one in found if one[1].peak.value >= largest - ALIKE * abs(largest))
    track = instance(chain.track)
    if drawn_profiles := [profile for profile in profiles(evaluation, chain) if profile.pressure is not None]:
        drawn = [_under(profile, k) for k, profile in enumerate(drawn_profiles)]
        chart = lines("pressure", "Pa", drawn, x="ahead of the sprocket's axle, m", timed=False)
        note = "Force of the ground into a link over its area, pitch times width,"
        note += f" {number(1e4 * pressures.area, 3)} cm\N{SUPERSCRIPT TWO}."
        note += " The front is on the right; peaks stand under the road wheels."
        content.add_figure("pressure", chart, f"Pressure under the links, {track}", note, "wide")
    peak = pressures.peak
    note = f"Largest in each slice of time; {quantity(peak.value, 'Pa')} at most, under link {peak.member} at"
    note += f" {number(peak.t)} s"
    if peak.t < COMING_TO_REST and starts_as_drawn(evaluation.run):
        later = pressures.most[pressures.middle > COMING_TO_REST]
        note += ", as the drawn vehicle comes to rest on its tracks"
        if later.size:
            note += f"; {quantity(float(np.nanmax(later)), 'Pa')} at most after {number(COMING_TO_REST)} s"
    mark = peak.t, peak.member, f"link {peak.member}, {number(peak.t, 3)} s"
    chart = heat("pressure", "Pa", pressures.middle, np.maximum(pressures.most, 0.0), mark)
    for other, lower in found:
        if other is not chain:
            note += f". Of {instance(other.track)}: {quantity(lower.peak.value, 'Pa')} at most"
    content.add_figure("pressure-map", chart, f"Pressure under every link over time, {track}", f"{note}.", "tall")


def _under(profile: Profile, colour: int) -> Trace:
    """Trace of the pressures of links that touch the ground, and of their neighbours, along the vehicle."""
    assert profile.pressure is not None
    order = np.argsort(profile.ahead)
    touched = profile.pressure > TOUCHED * max(profile.pressure.max(), 0.0)
    chosen = [k for k in order if touched[max(k - 1, 0) : k + 2].any()]
    return Trace(f"{number(profile.t)} s", Curve(profile.ahead[chosen], profile.pressure[chosen]), colour, points=True)
