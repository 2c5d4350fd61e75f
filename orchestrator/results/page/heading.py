"""Heading of a page: title, settings of the run, and its verdict."""

from __future__ import annotations

from typing import Any, NamedTuple

from fmus.ground_keys import SHAPES, SLOPES
from orchestrator.results.given_parts import GivenPart, given_parts
from orchestrator.results.ground_surface import on_terrain
from orchestrator.results.page.evaluation import Evaluation
from orchestrator.results.page.words import instance, text
from orchestrator.results.units import number, percent
from orchestrator.results.validity.ledger import validity

OPEN = 0.05  # of the largest sum of the energy ledger: a run that leaves more cannot be right


class Assessment(NamedTuple):
    """Verdict on a run, HTML."""

    grade: str  # good, fair, bad
    word: str
    sentence: str


def title(evaluation: Evaluation) -> str:
    """Title of the scene, or the log's name; HTML."""
    about = evaluation.run.log.metadata.get("run", {})
    return text(
        about.get("title") or evaluation.run.scene.get("title") or about.get("scene") or evaluation.run.log.path.name
    )


def setting(evaluation: Evaluation) -> list[tuple[str, str]]:
    """Scene, vehicle, steps and origin of the run as pairs of a name and a value, HTML; without empty values."""
    log = evaluation.run.log
    about, versions, origin = (log.metadata.get(name, {}) for name in ("run", "versions", "provenance"))
    start, end = evaluation.run.span
    pairs = [
        ("scene", text(about["scene"]) if "scene" in about else ""),
        *_of_vehicle(evaluation),
        ("links", f"{text(about['track'])} links" if about.get("track") else ""),
        ("ground", _ground(evaluation.run.scene)),
        ("coupling", text(about.get("coupling", ""))),
        ("step", _step(about)),
        ("step inside the tracks", _inner(evaluation)),
        ("duration", f"{number(end - start)} s"),
        ("components", "FMUs of machine code (native)" if about.get("fmus") == "native" else "Python FMUs"),
        *((f"{instance(name)}, an FMU of yours", _given(part)) for name, part in given_parts(evaluation.run).items()),
        ("recorded", text(origin.get("created", ""))),
        ("machine", text(", ".join(filter(None, (origin.get("processor"), origin.get("system")))))),
        ("cotrack", text(" ".join(filter(None, (versions.get("cotrack"), _commit(origin)))))),
    ]
    if evaluation.run.scene.get("symmetric"):
        pairs.append(("symmetry", "the left half ran for both; energies and weights are those of the whole"))
    return [(name, value) for name, value in pairs if value]


def _given(part: GivenPart) -> str:
    return f"{text(part.file)}, sha256 {text(part.sha256)}"


def _of_vehicle(evaluation: Evaluation) -> list[tuple[str, str]]:
    """Vehicle, links and friction by the tables of the scene, as far as they are there."""
    vehicle = evaluation.run.scene.get("vehicle")

    def value(*keys: str) -> Any:
        found: Any = vehicle
        for key in keys:
            found = found.get(key) if isinstance(found, dict) else None
        return found if isinstance(found, (int, float)) else None

    chain = [f"{number(links)} links" for links in [value("track", "links")] if links]
    chain += [f"of {number(1e3 * pitch)} mm" for pitch in [value("track", "pitch")] if pitch]
    chain += [f"and {number(mass)} kg each" for mass in [value("track", "mass")] if mass]
    weight = evaluation.summary.observables.get("weight")
    named = vehicle.get("name", "") if isinstance(vehicle, dict) else ""
    mass = weight / value("gravity") if weight and value("gravity") else None
    friction = value("contact", "ground", "friction")
    return [
        ("vehicle", ", ".join(filter(None, (text(named), f"{number(mass, 5)} kg" if mass else "")))),
        ("a track has", " ".join(chain)),
        (
            "friction on the ground",
            number(friction) if friction is not None and "ground" in evaluation.run.scene else "",
        ),
    ]


def _ground(scene: dict[str, Any]) -> str:
    """Slopes and names of the shapes of a terrain; HTML."""
    if not on_terrain(scene):
        return ""
    table = scene["ground"]
    slopes = [f"{key} {percent(table[key])}" for key in SLOPES if isinstance(table.get(key), float) and table[key]]
    return ", ".join([*slopes, *(key.replace("_", " ") for key in SHAPES if table.get(key))])


def _commit(origin: dict[str, str]) -> str:
    return f"(commit {origin['commit'][:10]})" if origin.get("commit") else ""


def _step(about: dict[str, str]) -> str:
    try:
        step = f"{number(1e3 * float(about['step']))} ms"
    except (LookupError, ValueError):
        return ""
    return step if about.get("step_control", "fixed") == "fixed" else f"variable, {step} at first"


def _inner(evaluation: Evaluation) -> str:
    """Internal step of the tracks, if the scene gives one."""
    try:
        return f"{number(1e3 * float(evaluation.run.scene['track']['step']))} ms"
    except (LookupError, TypeError, ValueError):
        return ""


def _finished(evaluation: Evaluation) -> bool:
    """True if the record reaches the requested end."""
    try:
        return evaluation.run.span[1] >= (1.0 - 1e-9) * float(evaluation.run.log.metadata["run"]["stop"])
    except (LookupError, ValueError):
        return False


def verdict(evaluation: Evaluation) -> Assessment:
    """Assessment of the run by its closing record, checks, limits of validity and energy ledger."""
    log, checks = evaluation.run.log, evaluation.summary.checks
    missed_checks = [name for name, check in checks.items() if not check["ok"]]
    skipped_count = len(evaluation.summary.after_end)
    check_count = len(checks) + skipped_count
    check_counts = f"{len(checks) - len(missed_checks)} of {check_count} checks met" if checks else "no check was made"
    check_counts += f"; {skipped_count} beyond its end" if skipped_count else ""
    open_share = abs(evaluation.ledger.residual_relative) if evaluation.ledger else 0.0
    if log.closing is None:
        return Assessment("bad", "Cut off", f"{text(log.cut_off or 'The run is still going on')}; {check_counts}.")
    if log.closing["status"] != "ok":
        message, end = text(log.closing["message"] or "no reason was recorded"), number(evaluation.run.span[1])
        if validity(evaluation.run).failures and _finished(evaluation):
            return Assessment("bad", "Not valid", f"The run went on to its end at {end} s: {message}")
        return Assessment("bad", "Failed", f"The run ended at {end} s: {message}")
    if limit_count := len(validity(evaluation.run).entries):
        check_counts += f"; {limit_count} limit{'s' if limit_count > 1 else ''} of validity passed (see events)"
    if missed_checks:
        names = text(", ".join(name.replace("_", " ") for name in missed_checks))
        return Assessment("bad", "Checks not met", f"The run finished; {check_counts}. Not met: {names}.")
    if open_share > OPEN:
        message = f"The energy ledger leaves {percent(open_share)} unaccounted for: steps are too long."
        return Assessment("bad", "Energy not in balance", message)
    if not log.complete:
        return Assessment(
            "fair", "Finished, record damaged", f"{text(' '.join(log.faults))} {check_counts.capitalize()}."
        )
    grade, word = ("good", "As expected") if checks and not skipped_count else ("fair", "Finished")
    return Assessment(grade, word, f"The run finished; {check_counts}.")
