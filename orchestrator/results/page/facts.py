"""The head of a page: what ran, how it ended, and its key figures."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from orchestrator.results.analyses.spells import drops
from orchestrator.results.page import chain as links
from orchestrator.results.page.balance import supply
from orchestrator.results.page.signals import Recorded
from orchestrator.results.page.study import ALIKE, NOTHING, Study
from orchestrator.results.page.words import instance, number, percent, quantity, text, wheel_name
from orchestrator.results.validity.ledger import validity

OPEN = 0.05  # of the largest sum of the energy ledger: a run that leaves more cannot be right
KMH = 3.6
COMING_TO_REST = 0.5  # s: a vehicle that starts as drawn does not rest on its tracks yet


class Tile(NamedTuple):
    """A key figure, HTML."""

    label: str
    value: str
    note: str
    kind: str = ""  # "words" for one that is no number


class Verdict(NamedTuple):
    """How a run stands, HTML."""

    mood: str  # good, fair, bad
    word: str
    sentence: str


def title(study: Study) -> str:
    """Of the scene, or the log's name; HTML."""
    about = study.run.log.metadata.get("run", {})
    return text(about.get("title") or study.run.scene.get("title") or about.get("scene") or study.run.log.path.name)


def setting(study: Study) -> list[tuple[str, str]]:
    """What ran, in pairs of a name and a value, HTML."""
    log = study.run.log
    about, versions, origin = (log.metadata.get(name, {}) for name in ("run", "versions", "provenance"))
    start, end = study.span
    pairs = [
        ("scene", text(about["scene"]) if "scene" in about else ""),
        *_of_vehicle(study),
        ("links", f"{text(about['track'])} links" if about.get("track") else ""),
        ("coupling", text(about.get("coupling", ""))),
        ("step", _step(about)),
        ("step inside the tracks", _inner(study)),
        ("duration", f"{number(end - start)} s"),
        ("components", "FMUs of machine code (native)" if about.get("fmus") == "native" else "Python FMUs"),
        ("recorded", text(origin.get("created", ""))),
        ("machine", text(", ".join(filter(None, (origin.get("processor"), origin.get("system")))))),
        ("cotrack", text(" ".join(filter(None, (versions.get("cotrack"), _commit(origin)))))),
    ]
    if study.run.scene.get("symmetric"):
        pairs.append(("symmetry", "the left half ran for both; energies and weights are those of the whole"))
    return [(name, value) for name, value in pairs if value]


def _of_vehicle(study: Study) -> list[tuple[str, str]]:
    """What ran, by the tables of its scene as far as they say it."""
    vehicle = study.run.scene.get("vehicle")

    def value(*keys: str) -> Any:
        found: Any = vehicle
        for key in keys:
            found = found.get(key) if isinstance(found, dict) else None
        return found if isinstance(found, (int, float)) else None

    chain = [f"{number(links)} links" for links in [value("track", "links")] if links]
    chain += [f"of {number(1e3 * pitch)} mm" for pitch in [value("track", "pitch")] if pitch]
    chain += [f"and {number(mass)} kg each" for mass in [value("track", "mass")] if mass]
    weight = study.judged.observables.get("weight")
    named = vehicle.get("name", "") if isinstance(vehicle, dict) else ""
    mass = weight / value("gravity") if weight and value("gravity") else None
    friction = value("contact", "ground", "friction")
    return [
        ("vehicle", ", ".join(filter(None, (text(named), f"{number(mass, 5)} kg" if mass else "")))),
        ("a track has", " ".join(chain)),
        ("friction on the ground", number(friction) if friction is not None and "ground" in study.run.scene else ""),
    ]


def _commit(origin: dict[str, str]) -> str:
    return f"(commit {origin['commit'][:10]})" if origin.get("commit") else ""


def _step(about: dict[str, str]) -> str:
    try:
        step = f"{number(1e3 * float(about['step']))} ms"
    except (LookupError, ValueError):
        return ""
    return step if about.get("step_control", "fixed") == "fixed" else f"variable, {step} at first"


def _inner(study: Study) -> str:
    """The step of the tracks' own integration, where the scene gives one."""
    try:
        return f"{number(1e3 * float(study.run.scene['track']['step']))} ms"
    except (LookupError, TypeError, ValueError):
        return ""


def result(study: Study, name: str) -> Any:
    """A result of the closing record; None where there is none."""
    try:
        return json.loads((study.run.log.closing or {})["results"][name])
    except (LookupError, ValueError, TypeError):
        return None


def unmade(study: Study) -> list[str]:
    """Checks of the scene, for such links as it ran with, that were not made."""
    expected, track = study.run.scene.get("expect"), study.run.scene.get("track")
    if not isinstance(expected, dict):
        return []
    model = track.get("model") if isinstance(track, dict) else None
    return [
        name
        for name, check in expected.items()
        if name not in study.judged.checks and isinstance(check, dict) and check.get("track") in (None, model)
    ]


def _finished(study: Study) -> bool:
    """Whether the record reaches the end that was asked for."""
    try:
        return study.span[1] >= (1.0 - 1e-9) * float(study.run.log.metadata["run"]["stop"])
    except (LookupError, ValueError):
        return False


def verdict(study: Study) -> Verdict:
    """How it ended and whether it is as expected."""
    log, checks = study.run.log, study.judged.checks
    missed = [name for name, check in checks.items() if not check["ok"]]
    left = len(unmade(study))
    judged = f"{len(checks) - len(missed)} of {len(checks)} checks met" if checks else "no check was made"
    judged += f"; {left} more could not be made" if left else ""
    open_share = abs(study.balance.ledger.residual_relative) if study.balance else 0.0
    if log.closing is None:
        return Verdict("bad", "Cut off", f"{text(log.cut_off or 'The run is still going on')}; {judged}.")
    if log.closing["status"] != "ok":
        message = text(log.closing["message"] or "no reason was recorded")
        if validity(study.run).failures and _finished(study):
            return Verdict("bad", "Not valid", f"The run went on to its end at {number(study.span[1])} s: {message}")
        return Verdict("bad", "Failed", f"The run ended at {number(study.span[1])} s: {message}")
    if passed := len(validity(study.run).entries):
        judged += f"; {passed} limit{'s' if passed > 1 else ''} of validity passed (see events)"
    if missed:
        names = text(", ".join(name.replace("_", " ") for name in missed))
        return Verdict("bad", "Checks not met", f"The run finished; {judged}. Not met: {names}.")
    if open_share > OPEN:
        told = f"The energy ledger leaves {percent(open_share)} unaccounted for: steps are too long."
        return Verdict("bad", "Energy not in balance", told)
    if not log.complete:
        return Verdict("fair", "Finished, record damaged", f"{text(' '.join(log.faults))} {judged.capitalize()}.")
    whole = bool(checks) and not left
    return Verdict("good" if whole else "fair", "As expected" if whole else "Finished", f"The run finished; {judged}.")


def figures(study: Study) -> dict[str, Any]:
    """Key figures as numbers, SI, for the page and for programs; without those that the log does not hold."""
    found: dict[str, Any] = {}
    speeds = [name for name in ("chassis.speed",) if name in study.signals] or [
        f"{track}.speed" for track in study.run.tracks if f"{track}.speed" in study.signals
    ]
    if speeds:
        found["top_speed"] = _largest(study, speeds)
    if "chassis.distance" in study.signals:
        found["distance"] = {"value": study.run.ends("chassis.distance")[1], "unit": "m"}
    tracks = study.run.tracks
    for key, signal in (("tension", "tension.max"), ("stress", "stress.max"), ("ground_force", "ground.force.z")):
        names = [f"{track}.{signal}" for track in tracks if f"{track}.{signal}" in study.signals]
        if names:
            found[key] = _most(study, names)
    if "tension" in found:
        found["tension"] |= _bearer(study, found["tension"], "tension")
    if found.get("stress", {}).get("value"):
        found["stress"] |= _bearer(study, found["stress"], "stress")
    else:
        found.pop("stress", None)  # rigid links
    loads = [name for name in study.signals if name.endswith(".load")]
    if loads:
        found["wheel_load"] = _most(study, loads)
    if study.balance:
        found["energy"] = study.balance.ledger._asdict() | {"unit": "J"}
    wall, duration = result(study, "wall_time"), study.span[1] - study.span[0]
    if isinstance(wall, (int, float)) and wall > 0.0:
        found["real_time_factor"] = {"value": duration / wall, "wall_time": wall}
    error = result(study, "error")
    if isinstance(error, dict):
        found["error"] = {"value": error.get("total"), "message": error.get("message", "")}
    for key in ("weight", "ground_force"):
        if (value := study.judged.observables.get(key)) is not None and value == value:
            found.setdefault("carried", {})[key] = value
    return found


def _largest(study: Study, names: list[str]) -> dict[str, Any]:
    name = max(names, key=lambda each: abs(study.signals[each].largest.value))
    return _told(name, study.signals[name], study.signals[name].largest.value, study.signals[name].largest.t)


def _most(study: Study, names: list[str]) -> dict[str, Any]:
    most = max(study.signals[each].most.value for each in names)
    # of two sides that are equal but for rounding, the first one
    name = next(each for each in names if study.signals[each].most.value >= most - ALIKE * abs(most))
    return _told(name, study.signals[name], *study.signals[name].most)


def _told(name: str, signal: Recorded, value: float, t: float) -> dict[str, Any]:
    return {"value": value, "t": t, "signal": name, "unit": signal.unit}


def _bearer(study: Study, largest: dict[str, Any], what: str) -> dict[str, Any]:
    """The link that bore it, in the record of links nearest in time; nothing where links were not recorded."""
    track = largest["signal"].partition(".")[0]
    found = study.chains.get(track)
    columns = getattr(found.columns, what) if found else []
    if not found or not columns:
        return {}
    series = links.at(study.run, found, largest["t"], columns)
    best = int(series.values[0].argmax())
    return {"link": best + 1, "link_t": float(series.t[0]), "link_value": float(series.values[0, best])}


def tiles(study: Study, found: dict[str, Any]) -> list[Tile]:
    """The key figures that there are."""
    made = []
    if (speed := found.get("top_speed")) and abs(speed["value"]) > 1e-6:
        hull = speed["signal"].startswith("chassis")
        fast = f"{number(abs(speed['value']) * KMH, 3)} km/h, " if hull else ""
        back = ", backwards" if hull and speed["value"] < 0.0 else ""
        made.append(
            Tile("Top speed" if hull else "Top chain speed", quantity(abs(speed["value"]), "m/s"),
                 f"{fast}at {number(speed['t'])} s{back}")
        )  # fmt: skip
    if distance := found.get("distance"):
        made.append(Tile("Distance", quantity(distance["value"], "m"), "along the heading at the start"))
    if tension := found.get("tension"):
        made.append(Tile("Largest link tension", quantity(tension["value"], "N"), _borne(tension)))
    if stress := found.get("stress"):
        made.append(
            Tile("Largest link stress", quantity(stress["value"], "Pa"), f"tension and bending, {_borne(stress)}")
        )
    if load := found.get("wheel_load"):
        track, _, wheel = load["signal"].removesuffix(".load").partition(".")
        place = f"{text(wheel_name(wheel))}, {instance(track)}, at {number(load['t'])} s"
        if load["t"] < COMING_TO_REST and drops(study.run):
            place += f", as the vehicle comes to rest{_later(study)}"
        made.append(Tile("Largest wheel load", quantity(load["value"], "N"), place))
    if carried := found.get("carried"):
        shown = [name for name in ("weight", "ground_force") if name in carried]
        ground = (
            f"ground carries {quantity(carried['ground_force'], 'N')}, mean of the last second"
            if len(shown) > 1
            else ""
        )
        name = "Weight" if shown[0] == "weight" else "Ground carries"
        made.append(Tile(name, quantity(carried[shown[0]], "N"), ground))
    if (energy := found.get("energy")) and max(abs(energy[each]) for each in ("work", "change", "dissipated")) > 1e-3:
        share = f"of {supply(study.balance)}" if study.balance else ""
        made.append(Tile("Energy dissipated", quantity(energy["dissipated"], "J"), share))
        open_share, left = percent(energy["residual_relative"], 2), quantity(energy["residual"], "J", 3)
        made.append(Tile("Energy unaccounted for", open_share, f"{left}, an error of the steps"))
    made.append(_error(study, found))
    if pace := found.get("real_time_factor"):
        factor = pace["value"]
        times = f"{number(factor, 3)} \N{MULTIPLICATION SIGN}"
        made.append(Tile("Faster than real time" if factor >= 1.0 else "Share of real time", times,
                         f"{number(pace['wall_time'], 3)} s of computing"))  # fmt: skip
    return made


def _later(study: Study) -> str:
    """The largest wheel load of the rest of the run; thinned curves keep every peak."""
    found = [
        (float(curve.y[after].max()), name)
        for name, (curve, *_) in study.signals.items()
        if name.endswith(".load") and (after := curve.t >= COMING_TO_REST).any()
    ]
    return f"; {quantity(max(found)[0], 'N')} at most after {number(COMING_TO_REST)} s" if found else ""


def _borne(largest: dict[str, Any]) -> str:
    """Which link, where and when."""
    when = f"{instance(largest['signal'].partition('.')[0])}, at {number(largest['t'])} s"
    if "link" not in largest:
        return when
    return f"link {largest['link']}, {when}"


def _error(study: Study, found: dict[str, Any]) -> Tile:
    error = found.get("error")
    if error is None:
        return Tile("Estimated error", "not estimated", "no coarser run was made beside it", "words")
    if not isinstance(error["value"], (int, float)):
        return Tile("Estimated error", "not known", text(error["message"]), "words")
    try:
        parts = {name: one["total"] for name, one in result(study, "error")["observables"].items() if one["decisive"]}
        worst = max(parts, key=lambda name: parts[name])
    except NOTHING:
        return Tile("Estimated error", percent(error["value"], 2), "")
    note = f"of {text(worst.replace('_', ' '))}, the worst observable (RMS), by runs with steps twice as long"
    return Tile("Estimated error", percent(error["value"], 2), note)
