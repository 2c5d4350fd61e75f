"""Head of a page: title, settings of the run, verdict, and key figures as numbers and as tiles."""

from __future__ import annotations

from typing import Any, NamedTuple

from fmus.ground.tables import SHAPES, SLOPES
from orchestrator.results.analyses import link_loads
from orchestrator.results.analyses.curves import SignalCurve
from orchestrator.results.analyses.link_loads import SIGNALS
from orchestrator.results.analyses.record_blocks import has
from orchestrator.results.analyses.validity import of as validity
from orchestrator.results.analyses.wheel_loads import starts_as_drawn
from orchestrator.results.energy import Ledger
from orchestrator.results.ground_surface import on_terrain
from orchestrator.results.measures import OBSERVABLES
from orchestrator.results.page.balance import supply
from orchestrator.results.page.embedded import instance, quantity, text, wheel
from orchestrator.results.page.evaluation import ALIKE, Evaluation
from orchestrator.results.run_data import given_parts
from orchestrator.results.units import number, percent
from orchestrator.results.validity.chain_checks import half_steps
from orchestrator.vocabulary.limits import LARGEST_RESIDUAL


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
        ("step inside the tracks", _milliseconds(evaluation.run.scene.get("track"))),
        ("duration", f"{number(end - start)} s"),
        ("components", "FMUs of machine code (native)" if about.get("fmus") == "native" else "Python FMUs"),
        *(
            (f"{instance(name)}, an FMU of yours", f"{text(part.file)}, sha256 {text(part.sha256)}")
            for name, part in given_parts(evaluation.run).items()
        ),
        ("recorded", text(origin.get("created", ""))),
        ("machine", text(", ".join(filter(None, (origin.get("processor"), origin.get("system")))))),
        ("cotrack", text(" ".join(filter(None, (versions.get("cotrack"), _commit(origin)))))),
    ]
    if evaluation.run.scene.get("symmetric"):
        pairs.append(("symmetry", "the left half ran for both; energies and weights are those of the whole"))
    return [(name, value) for name, value in pairs if value]


def _of_vehicle(evaluation: Evaluation) -> list[tuple[str, str]]:
    """Vehicle, links and friction by the tables of the scene, as far as they are there."""

    def value(*keys: str) -> Any:
        found = evaluation.run.entry("vehicle", *keys)
        return found if isinstance(found, (int, float)) else None

    chain = [f"{number(links)} links" for links in [value("track", "links")] if links]
    chain += [f"of {number(1e3 * pitch)} mm" for pitch in [value("track", "pitch")] if pitch]
    chain += [f"and {number(mass)} kg each" for mass in [value("track", "mass")] if mass]
    weight = evaluation.summary.observables.get("weight")
    named = evaluation.run.entry("vehicle", "name", default="")
    mass = weight / value("gravity") if weight and value("gravity") else None
    friction = value("contact", "ground", "friction")
    rubs = friction is not None and "ground" in evaluation.run.scene
    return [
        ("vehicle", ", ".join(filter(None, (text(named), f"{number(mass, 5)} kg" if mass else "")))),
        ("a track has", " ".join(chain)),
        ("friction on the ground", number(friction) if rubs else ""),
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
    step = _milliseconds(about)
    return f"variable, {step} at first" if step and about.get("step_control", "fixed") != "fixed" else step


def _milliseconds(table: Any) -> str:
    """Step in a table; empty without one."""
    try:
        return f"{number(1e3 * float(table['step']))} ms"
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
    skipped_count, left_out_count = len(evaluation.summary.after_end), len(evaluation.summary.left_out)
    check_count = len(checks) + skipped_count + left_out_count
    check_counts = f"{len(checks) - len(missed_checks)} of {check_count} checks met" if checks else "no check was made"
    check_counts += f"; {skipped_count} beyond its end" if skipped_count else ""
    check_counts += f"; {left_out_count} left out" if left_out_count else ""
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
    if open_share > LARGEST_RESIDUAL:
        message = f"The energy ledger leaves {percent(open_share)} unaccounted for: steps are too long"
        return Assessment("bad", "Energy not in balance", f"{message}{half_steps(evaluation.run)}.")
    if not log.complete:
        return Assessment(
            "fair", "Finished, record damaged", f"{text(' '.join(log.faults))} {check_counts.capitalize()}."
        )
    grade, word = ("good", "As expected") if checks and check_count == len(checks) else ("fair", "Finished")
    return Assessment(grade, word, f"The run finished; {check_counts}.")


KMH = 3.6
PEAKS = {  # largest values of a run, in the order of tiles: label, and end of the names of signals
    "top_speed": ("Top speed", ".speed"),
    "tension": (OBSERVABLES["tension_max"].shown.title, ".tension.max"),
    "stress": ("Largest link stress", ".stress.max"),
    "wheel_load": ("Largest wheel load", ".load"),
    "ground_force": ("Largest force of the ground on a track", ".ground.force.z"),
}
OBSERVED = {"distance": "along the heading at the start"}  # observables with a tile under their name, and its note
COMING_TO_REST = 0.5  # s: a vehicle that starts as drawn does not rest on its tracks yet


class Tile(NamedTuple):
    """Key figure, HTML."""

    label: str
    value: str
    note: str
    kind: str = ""  # "words" for a value that is no number


def figures(evaluation: Evaluation) -> dict[str, Any]:
    """Key figures in SI units, without those that the log does not hold."""
    figures: dict[str, Any] = {}
    hull = ["chassis.speed"] if "chassis.speed" in evaluation.signals else []
    moving = hull or [f"{track}.speed" for track in evaluation.run.tracks]
    for key, (_, end) in PEAKS.items():
        names = moving if key == "top_speed" else evaluation.signals
        if known := {name: one for name, one in evaluation.signals.items() if name in names and name.endswith(end)}:
            figures[key] = _peak(known, "largest" if key == "top_speed" else "most")
    observables = evaluation.summary.observables
    for name in (name for name in OBSERVED if name in observables):
        figures[name] = {"value": observables[name], "unit": OBSERVABLES[name].figure.unit}
    if figures.get("stress", {}).get("value") == 0.0:
        del figures["stress"]  # rigid links
    for key in ("tension", "stress"):
        if key in figures:
            figures[key] |= _bearer(evaluation, figures[key], key)
    if evaluation.ledger:
        figures["energy"] = evaluation.ledger._asdict() | {"unit": "J"}
    wall, duration = evaluation.result("wall_time"), evaluation.run.span[1] - evaluation.run.span[0]
    if isinstance(wall, (int, float)) and wall > 0.0:
        figures["real_time_factor"] = {"value": duration / wall, "wall_time": wall}
    error = evaluation.result("error")
    if isinstance(error, dict):
        figures["error"] = {"value": error.get("total"), "message": error.get("message", "")}
    for key in ("weight", "ground_force"):
        if (value := observables.get(key)) is not None and value == value:
            figures.setdefault("carried", {})[key] = value
    return figures


def _peak(known: dict[str, SignalCurve], extreme: str) -> dict[str, Any]:
    """Largest of the peaks of signals; of signals that are equal but for rounding, that of the first."""
    peaks = {name: getattr(signal, extreme) for name, signal in known.items()}
    sizes = {name: abs(peak.value) if extreme == "largest" else peak.value for name, peak in peaks.items()}
    most = max(sizes.values())
    name = next(name for name, size in sizes.items() if size >= most - ALIKE * abs(most))
    return {"value": peaks[name].value, "t": peaks[name].t, "signal": name, "unit": known[name].unit}


def _bearer(evaluation: Evaluation, peak: dict[str, Any], load: str) -> dict[str, Any]:
    """Link with the largest load in the record of links nearest to the peak; empty without such records."""
    loads = evaluation.chains.get(peak["signal"].partition(".")[0])
    if not loads or not has(evaluation.run, loads.track, SIGNALS[load]):
        return {}
    t, values = link_loads.loads_at(evaluation.run, loads, load, peak["t"])
    best = int(values.argmax())
    return {"link": best + 1, "link_t": t, "link_value": float(values[best])}


def tiles(evaluation: Evaluation, figures: dict[str, Any]) -> list[Tile]:
    """Tiles of the key figures."""
    tiles = [*_motion(figures), *_loads(evaluation, figures), *_energy(figures), _error(evaluation, figures)]
    if pace := figures.get("real_time_factor"):
        factor = pace["value"]
        label = "Faster than real time" if factor >= 1.0 else "Share of real time"
        note = f"{number(pace['wall_time'], 3)} s of computing"
        tiles.append(Tile(label, f"{number(factor, 3)} \N{MULTIPLICATION SIGN}", note))
    return tiles


def _motion(figures: dict[str, Any]) -> list[Tile]:
    tiles = []
    if (speed := figures.get("top_speed")) and abs(speed["value"]) > 1e-6:
        hull = speed["signal"].startswith("chassis")
        fast = f"{number(abs(speed['value']) * KMH, 3)} km/h, " if hull else ""
        back = ", backwards" if hull and speed["value"] < 0.0 else ""
        note = f"{fast}at {number(speed['t'])} s{back}"
        tiles.append(
            Tile(PEAKS["top_speed"][0] if hull else "Top chain speed", quantity(abs(speed["value"]), "m/s"), note)
        )
    for name, note in OBSERVED.items():
        if one := figures.get(name):
            tiles.append(Tile(name.replace("_", " ").capitalize(), quantity(one["value"], one["unit"]), note))
    return tiles


def _loads(evaluation: Evaluation, figures: dict[str, Any]) -> list[Tile]:
    tiles = []
    if tension := figures.get("tension"):
        tiles.append(Tile(PEAKS["tension"][0], quantity(tension["value"], "N"), _place(tension)))
    if stress := figures.get("stress"):
        note = f"tension and bending, {_place(stress)}"
        tiles.append(Tile(PEAKS["stress"][0], quantity(stress["value"], "Pa"), note))
    if load := figures.get("wheel_load"):
        note = f"{wheel(load['signal'].removesuffix('.load'))}, at {number(load['t'])} s"
        if load["t"] < COMING_TO_REST and starts_as_drawn(evaluation.run):
            note += f", as the vehicle comes to rest{_later(evaluation)}"
        tiles.append(Tile(PEAKS["wheel_load"][0], quantity(load["value"], "N"), note))
    if carried := figures.get("carried"):
        force = quantity(carried["ground_force"], "N") if "ground_force" in carried else ""
        if "weight" not in carried:
            tiles.append(Tile("Ground carries", force, ""))
        else:
            note = f"ground carries {force}, {_averaged(evaluation)}" if force else ""
            tiles.append(Tile("Weight", quantity(carried["weight"], "N"), note))
    return tiles


def _averaged(evaluation: Evaluation) -> str:
    """Averaging window of the ground's force in words."""
    window = evaluation.summary.windows["ground_force"]
    return f"mean of {number(window['from'])} to {number(window['to'])} s"


def _energy(figures: dict[str, Any]) -> list[Tile]:
    energy = figures.get("energy")
    if not energy or not max(abs(energy[name]) for name in ("work", "change", "dissipated")) > 1e-3:
        return []
    ledger = Ledger(**{name: energy[name] for name in Ledger._fields})
    share, left = percent(ledger.residual_relative, 2), quantity(ledger.residual, "J", 3)
    return [
        Tile("Energy dissipated", quantity(ledger.dissipated, "J"), f"of {supply(ledger)}"),
        Tile("Energy unaccounted for", share, f"{left}, an error of the steps"),
    ]


def _later(evaluation: Evaluation) -> str:
    """Largest wheel load of the rest of the run; thinned curves keep every peak."""
    later_peaks = [
        float(signal.curve.y[after].max())
        for name, signal in evaluation.signals.items()
        if name.endswith(".load") and (after := signal.curve.t >= COMING_TO_REST).any()
    ]
    return f"; {quantity(max(later_peaks), 'N')} at most after {number(COMING_TO_REST)} s" if later_peaks else ""


def _place(peak: dict[str, Any]) -> str:
    """Link, track and time of a peak."""
    when = f"{instance(peak['signal'].partition('.')[0])}, at {number(peak['t'])} s"
    return f"link {peak['link']}, {when}" if "link" in peak else when


def _error(evaluation: Evaluation, figures: dict[str, Any]) -> Tile:
    error = figures.get("error")
    if error is None:
        return Tile("Estimated error", "not estimated", "no coarser run was made beside it", "words")
    if not isinstance(error["value"], (int, float)):
        return Tile("Estimated error", "not known", text(error["message"]), "words")
    try:
        parts = {
            name: observable["total"]
            for name, observable in evaluation.result("error")["observables"].items()
            if observable["decisive"]
        }
        worst = max(parts, key=lambda name: parts[name])
    except (LookupError, TypeError, ValueError, AttributeError):  # a closing record of another version
        return Tile("Estimated error", percent(error["value"], 2), "")
    note = f"of {text(worst.replace('_', ' '))}, the worst observable (RMS), by runs with longer steps"
    return Tile("Estimated error", percent(error["value"], 2), note)
