"""Summary of a run as one JSON object: outcome, cost, energy, checks, observables."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, TypedDict

import numpy as np

from fmus.ground.tables import is_terrain
from orchestrator.log.angles import turn_of
from orchestrator.log.reader import Missing
from orchestrator.results import run_data
from orchestrator.results.analyses import phases
from orchestrator.results.analyses.validity import of as validity
from orchestrator.results.energy import ledger
from orchestrator.results.measures import DIRECTIONS, FIGURES, OBSERVABLES, reduce
from orchestrator.results.run_data import RunData, Unrecorded, Window, given_parts
from orchestrator.results.validity.chain_checks import half_steps
from orchestrator.results.validity.exceedance import FAILURE, Exceedance
from orchestrator.scene.kinds import ChainScene, VehicleScene
from orchestrator.scene.system_scene import SystemScene
from orchestrator.scene.tables import Check
from orchestrator.vocabulary import and_list
from orchestrator.vocabulary.limits import LARGEST_RESIDUAL

OTHER_TENSION = 0.05  # relative difference of a tension from the one asked
LAST = 1.0  # s: without run.window observables are means over the last second


class Summary(TypedDict):
    """Outcome of a run, as ``--json`` prints it; times in s."""

    scene: str
    track: str | None  # kind of links
    status: str  # ok or failed
    message: str
    simulated_time: float
    startup_time: float
    wall_time: float  # of stepping
    cpu_time: float
    real_time_factor: float
    communication_steps: int
    rejected_steps: int
    log: str | None
    log_bytes: int
    seal: str  # root of the log's seal
    components: dict[str, dict[str, float | int]]  # wall time and counters
    fmus: dict[str, dict[str, str]]  # FMUs of the user by component: file name and hash
    energy: dict[str, Any] | None  # ``results.energy.Ledger``
    energy_missing: str  # why there is no energy balance
    error: dict[str, Any] | None  # ``estimate.estimate``
    checks: dict[str, dict[str, Any]]
    checks_after_end: dict[str, dict[str, float]]
    checks_left_out: dict[str, str]  # reasons by name
    observables: dict[str, float]
    windows: dict[str, dict[str, float]]
    places: dict[str, str]
    phases: list[dict[str, Any]]
    track_tension: dict[str, Any]  # asked, and of the tracks at rest: see ``track_tension``
    warnings: list[dict[str, Any]]
    validity: list[dict[str, Any]]
    passed_over: list[str]


def empty(scene: str, track: str | None) -> Summary:
    """Return a summary as before the run."""
    return {
        "scene": scene,
        "track": track,
        "status": "failed",
        "message": "",
        "simulated_time": 0.0,
        "startup_time": 0.0,
        "wall_time": 0.0,
        "cpu_time": 0.0,
        "real_time_factor": 0.0,
        "communication_steps": 0,
        "rejected_steps": 0,
        "log": None,
        "log_bytes": 0,
        "seal": "",
        "components": {},
        "fmus": {},
        "energy": None,
        "energy_missing": "",
        "error": None,
        "checks": {},
        "checks_after_end": {},
        "checks_left_out": {},
        "observables": {},
        "windows": {},
        "places": {},
        "phases": [],
        "track_tension": {},
        "warnings": [],
        "validity": [],
        "passed_over": [],
    }


def evaluate(run: RunData, scene: SystemScene, simulated: float) -> dict[str, Any]:
    """Evaluate energy, checks, observables, phases and validity of a log that covers ``simulated`` s."""
    made, left_out = checks(run, scene, simulated)
    return balance(run) | {
        "fmus": fmu_entries(run),
        "checks": made,
        "checks_left_out": left_out,
        "checks_after_end": after_end(scene, simulated),
        "observables": (found := observables(run, scene, simulated)),
        "windows": windows(found, scene, simulated),
        "places": places(found, run, scene),
        "phases": phase_entries(run),
        "track_tension": track_tension(run.scene),
    }


def track_tension(scene: Mapping[str, Any]) -> dict[str, Any]:
    """Tension asked of a placed vehicle, as resolved, and what its tracks carry; empty without tracks or in older logs.

    ``standing``: on level, hard ground; ``start``: at the start on its ground; both N, of each track. ``sag`` of the
    longest free span, m, ``loads`` on the road wheels of each side and on its ``others`` by name, N, and ``settlement``
    of the hull, m, are those of the start, and of a vehicle that starts as ``drawn`` those of the standing one.
    """
    if not (standing := scene.get("standing")):
        return {}
    rest = scene["start"].get("equilibrium")
    tracks, drawn = (rest or standing)["tracks"], not rest
    return {
        "asked": scene["vehicle"]["track"]["tension"],
        "standing": [track["tension"] for track in standing["tracks"]],
        "start": [track["tension"] for track in tracks] if rest else list(standing["drawn"]),
        "drawn": drawn,
        "why": standing["why"],
        "sag": max((track["sag"] for track in tracks), default=None),
        "loads": [list(track["loads"]) for track in tracks],
        "others": [track.get("others") or {} for track in tracks],
        "settlement": 0.0 - (rest or standing)["height"] if tracks else None,
    }


def balance(run: RunData) -> dict[str, Any]:
    """Evaluate energy and validity of a log: they tell whether a run can be right."""
    try:
        energy: dict[str, Any] = {"energy": ledger(run)._asdict(), "energy_missing": ""}
    except Missing as missing:
        energy = {"energy": None, "energy_missing": str(missing)}
    found = validity(run)
    remarks = *found.passed_over, *_unreached_window(run), *other_vehicles(run), *other_tension(run.scene)
    return energy | {"validity": [entry._asdict() for entry in found.entries], "passed_over": [*remarks]}


def other_vehicles(run: RunData) -> list[str]:
    """Return a sentence about tracks that no figure counts, because they are those of another vehicle."""
    if not (others := [name for name in run.all_tracks if name not in run.tracks]):
        return []
    return [f"figures are those of the vehicle of {and_list([*run.tracks])}: {and_list(others)} are of another one"]


def other_tension(scene: Mapping[str, Any]) -> list[str]:
    """Return a sentence if tracks that start on level, hard ground carry another mean tension than is asked."""
    ground, found = scene.get("ground") or {}, track_tension(scene)
    level = not any(ground.get(key) for key in ("soil", "bump")) and not is_terrain(ground)
    if not (level and found and found["asked"]) or found["drawn"] or scene["vehicle"].get("right"):
        return []
    mean = float(np.mean(found["start"]))
    if abs(mean / found["asked"] - 1.0) <= OTHER_TENSION:
        return []
    asked = f"vehicle.track.tension = {1e-3 * found['asked']:.4g} kN is asked"
    return [
        f"tracks carry {1e-3 * mean:.4g} kN at the start, where {asked}: the links come to rest otherwise than cables"
        " there; another tension, or track.model = 'flexible', may help"
    ]


def _unreached_window(run: RunData) -> list[str]:
    """Return a sentence if the run does not reach the begin or the end of ``run.window``."""
    table = run.scene.get("run", {})
    if not (window := table.get("window")):
        return []
    last, start, end = run.span[1], *(window.get(key) or 0.0 for key in ("from", "to"))
    if start > last + 1e-9:
        return [f"run.window.from = {start:g} s is after the end of the run, {last:.6g} s: there are no means"]
    if end > last + table.get("outputs", 1) * table.get("step", 0.0):
        return [f"run.window.to = {end:g} s is after the end of the run, {last:.6g} s: means end there"]
    return []


def fmu_entries(run: RunData) -> dict[str, dict[str, str]]:
    """Return file name and hash of the FMUs of the user, by component."""
    return {name: {"file": part.file, "sha256": part.sha256} for name, part in given_parts(run).items()}


def judgement(message: str, entries: Mapping[str, Any], run: RunData) -> dict[str, str]:
    """Message of a run with the sentences on its energy and validity; an invalid run also has the status "failed"."""
    sentences = message, energy_warning(entries["energy"], run), invalidity(entries["validity"])
    return {"message": "; ".join(filter(None, sentences))} | ({"status": "failed"} if sentences[2] else {})


def phase_entries(run: RunData) -> list[dict[str, Any]]:
    """Return the phases of a vehicle's run with their figures (``analyses/phases``); empty without a hull."""
    try:
        return [phase._asdict() for phase in phases.of(run).phases]
    except Missing:
        return []


def averaging_window(scene: SystemScene, simulated: float) -> Window:
    """Return the window of the observables that are means: ``run.window``, else the last second."""
    given = scene.run.window
    if given is None:
        return Window(max(0.0, simulated - LAST), simulated)
    return Window(given.start, simulated if given.end is None else min(given.end, simulated))


def windows(names: Iterable[str], scene: SystemScene, simulated: float) -> dict[str, dict[str, float]]:
    """Return the averaging window of each observable, s."""
    averaged, whole = averaging_window(scene, simulated), Window(0.0, simulated)
    found = {name: whole if OBSERVABLES[name].shown.whole else averaged for name in names}
    sparse = {"every": scene.run.outputs} if scene.run.outputs > 1 else {}
    return {name: {"from": window.start, "to": window.end, **sparse} for name, window in found.items()}


def places(found: Mapping[str, float], run: RunData, scene: SystemScene) -> dict[str, str]:
    """Return where and when the largest values among the observables are, in words, with a doubt about one of them.

    Round a closed loop of rigid links the force across is known up to a constant (``orchestrator/analyses.md``).
    """
    words = {}
    for name, value in found.items():
        where = OBSERVABLES[name].shown.place
        if where is not None and value == value:
            words[name] = where(run)
    if "pin_force" in words and isinstance(scene, VehicleScene) and scene.turns and scene.track.model == "rigid":
        words["pin_force"] += ", its part across up to a constant"
    return words


def energy_warning(energy: dict[str, Any] | None, run: RunData | None = None) -> str:
    """Return a sentence if the energy balance is open by more than LARGEST_RESIDUAL, else an empty text.

    With its run it says which steps to take.
    """
    if energy is None:
        return ""
    parts = {"the energy ledger": energy["residual_relative"]}
    parts |= {f"the energy ledger of {name}": part for name, part in energy["integration_relative"].items()}
    worst = max(parts, key=lambda each: abs(parts[each]))
    if all(abs(part) <= LARGEST_RESIDUAL for part in parts.values()):  # false for a NaN
        return ""
    return (
        f"{worst} leaves {abs(parts[worst]):.0%} open: the internal or the communication step is too long for what this"
        f" run does{half_steps(run) if run else ''}"
    )


def invalidity(entries: Sequence[Mapping[str, Any]]) -> str:
    """Return a sentence if the validity ledger has a failure, else an empty text."""
    failures = [Exceedance(**entry) for entry in entries if entry["severity"] == FAILURE]
    if not failures:
        return ""
    first, more = failures[0], f" (and {len(failures) - 1} more)" if len(failures) > 1 else ""
    return (
        f"not valid from {first.time:.6g} s on{more}: {first.component}: {first.sentence}; run.allow ="
        f' ["{first.what}"] makes it a warning'
    )


def missed_checks(result: Mapping[str, Any]) -> list[str]:
    """Return the names of the checks that are not met."""
    return [name for name, check in result["checks"].items() if not check["ok"]]


def verdict(result: Mapping[str, Any]) -> str:
    """Return "ok" if a run ended well, met its checks and closed its energy balance; else what is wrong."""
    if result["status"] != "ok":
        return str(result["status"])
    wrong = [f"checks NOT met: {', '.join(missed)}"] if (missed := missed_checks(result)) else []
    wrong += ["energy balance open"] if energy_warning(result["energy"]) else []
    return "; ".join(wrong) or "ok"


def is_passed(result: Mapping[str, Any]) -> bool:
    """True if a run ended well, met its checks and closed its energy balance."""
    return verdict(result) == "ok"


def checks(run: RunData, scene: SystemScene, simulated: float) -> tuple[dict[str, dict[str, Any]], dict[str, str]]:
    """Evaluate the checks whose window the run covers; and why others are left out: their log holds too few records.

    Tolerances in the result are absolute; a note gives the reason for a missing value.
    """
    results, left_out = {}, {}
    for name, window in _windows_of_checks(scene, simulated, covered=True).items():
        check = scene.expect[name]
        try:
            value, note = _value(run, check, window)
        except Unrecorded as reason:
            left_out[name] = str(reason)
            continue
        tolerance = check.tolerance * (abs(check.expected) if check.relative else 1.0)
        results[name] = {
            "value": value,
            "expected": check.expected,
            "tolerance": tolerance,
            "ok": bool(abs(value - check.expected) <= tolerance),  # false for a NaN
            "note": note,
            "what": f"{(check.measure or check.reduce).replace('_', ' ')} {check.of or check.signal or ''}".rstrip(),
        }
    return results, left_out


def after_end(scene: SystemScene, simulated: float) -> dict[str, dict[str, float]]:
    """Return the windows, s, of the checks that look beyond the end of the run."""
    windows = _windows_of_checks(scene, simulated, covered=False)
    return {name: {"from": window.start, "to": window.end} for name, window in windows.items()}


def check_counts(result: Mapping[str, Any]) -> list[str]:
    """Return how many checks are met, "1 of 8", and how many look beyond the end of the run."""
    late, left_out = result["checks_after_end"].values(), len(result.get("checks_left_out", ()))
    total = len(result["checks"]) + len(late) + left_out
    begin = sum(window["from"] >= result["simulated_time"] for window in late)
    counts = " and ".join(
        f"{n} {verb}{'s' * (n == 1)}" for n, verb in ((begin, "begin"), (len(late) - begin, "end")) if n
    )
    met = len(result["checks"]) - len(missed_checks(result))
    parts = f"{counts} after the end" if counts else "", f"{left_out} left out" if left_out else ""
    return [f"{met} of {total}", *filter(None, parts)]


def _windows_of_checks(scene: SystemScene, simulated: float, *, covered: bool) -> dict[str, Window]:
    """Windows of the checks of the scene's kind of links: those that the run covers, or the others."""
    ends = {name: scene.run.stop if check.end is None else check.end for name, check in scene.checks.items()}
    windows = {name: Window(scene.checks[name].start, end) for name, end in ends.items()}
    return {n: each for n, each in windows.items() if (each.start <= each.end <= simulated + 1e-9) == covered}


def _value(run: RunData, check: Check, window: Window) -> tuple[float, str]:
    """Return the value of a check and an empty note, or NaN (never ok) and the reason."""
    return _number_or_reason(
        lambda: (
            _reduced(run, check, window) if check.measure is None else FIGURES[check.measure](run, check.of, window)
        ),
        check.measure,
    )


def _reduced(run: RunData, check: Check, window: Window) -> float:
    """Value of a check of a signal; of an angle that the log has within a turn on the turn of the expected one."""
    name = str(check.signal)
    value, turn = reduce(*run.signal(name, window), check.reduce), turn_of(run.log.unit(name))
    whole = turn and check.reduce in DIRECTIONS and run.jumps(name, window)
    return value - turn * np.round((value - check.expected) / turn) if whole else value


def _number_or_reason(evaluate: Callable[[], float], measure: str | None = None) -> tuple[float, str]:
    """Return a number computed from a log and an empty note, or NaN and the reason."""
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore", RuntimeWarning)  # the mean of an empty set is NaN, which is reported
            value = float(evaluate())
    except Exception as error:
        if isinstance(error, Unrecorded) and measure is not None:
            raise
        return float("nan"), run_data.reason(error, of_figure=True)
    return value, "" if np.isfinite(value) else "no finite number comes out of what was recorded"


def observables(run: RunData, scene: SystemScene, simulated: float) -> dict[str, float]:
    """Evaluate the observables of this kind of scene; for their averaging windows see ``windows``."""
    averaged, found = averaging_window(scene, simulated), {*traits(scene)} if run.tracks else ()
    shown = {name: one for name, one in OBSERVABLES.items() if one.shown.on in found}
    return {name: _number_or_reason(partial(one.value, run, averaged))[0] for name, one in shown.items()}


def traits(scene: SystemScene) -> Iterator[str]:
    """Traits of a scene with tracks by which its observables are chosen, its groups of link outputs among them."""
    track = getattr(scene, "track", None)  # not of systems of FMUs
    groups = track.link_outputs if track is not None else ()
    yield from ("tracks", *groups)
    if isinstance(scene, VehicleScene):
        yield from ("vehicle", "moving", "turning" if scene.turns else "straight")
        own = [table.suspension for table in (scene.vehicle, scene.vehicle.right) if table and table.suspension]
        slides = scene.vehicle.tensioner, *(wheel.tensioner for wheel in scene.vehicle.wheel.values())
        found = {
            "stops": any(suspension.bump_stop or suspension.rebound_stop for suspension in own),
            "recoil": any(slide and slide.recoil for slide in slides),
            "path": scene.driver is not None and (scene.driver.arcs or scene.driver.points),
            "steering": scene.turns and scene.drive.steering is not None,
        }
        yield from (trait for trait, has in found.items() if has)
    else:
        yield "pinned" if isinstance(scene, ChainScene) and scene.chain.ends == "pinned" and groups else "moving"
