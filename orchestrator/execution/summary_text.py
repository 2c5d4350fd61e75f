"""Text of the summary of a run, as people read it (``summary.empty``), by the table of observables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from orchestrator.execution import summary
from orchestrator.execution.estimate import PARTS
from orchestrator.results.convergence_index import ORDERS, SAFETY
from orchestrator.results.energy import STORED_ENERGIES
from orchestrator.results.measures import OBSERVABLES
from orchestrator.results.run_data import HASH_DIGITS
from orchestrator.results.table import without_rounding
from orchestrator.results.units import figure, scaled
from orchestrator.results.validity.exceedance import Exceedance, alike_as_one

MAX_LINES = 11  # lines of a short summary


def _error(error: dict[str, Any]) -> str:
    """Return a sentence about the error estimate of a run."""
    if error["total"] is None:
        return f"estimated error: not known, {error['message']}"
    decisive = max(
        (name for name, observable in error["observables"].items() if observable["decisive"]),
        key=lambda name: error["observables"][name]["total"],
    )
    took = "; ".join((*_how(error, error["observables"][decisive]), f"took {error['wall_time']:.3g} s more"))
    worst = decisive.replace("_", " ")
    without = f", not known of {', '.join(error['without']).replace('_', ' ')}" if error["without"] else ""
    return (
        f"estimated error: {_percent(error['total'])} of the {worst}, less of all other observables{without} ({took})"
    )


def _how(error: dict[str, Any], decisive: dict[str, Any]) -> Iterator[str]:
    """Yield parts of an error, as far as they are known, and how that of the decisive observable was found."""
    if any(error[part] is not None for part in PARTS):
        yield ", ".join(f"{part} {'not known' if error[part] is None else _percent(error[part])}" for part in PARTS)
    if decisive.get("safety") == SAFETY:
        yield f"observed order {figure(decisive['order'], 2)}"
    elif decisive.get("safety") is not None:  # not of a log of an earlier version
        converges = ORDERS[0] <= (decisive["order"] or 0.0) <= ORDERS[1]
        reason = error["no_order"] or ("an average" if converges else "its differences do not converge")
        yield f"factor of safety {figure(decisive['safety'])}: {reason}"


def _percent(share: float) -> str:
    return f"{figure(100.0 * share, 2)} %"


def _headline(r: Mapping[str, Any]) -> str:
    """Return the first line: scene, links, verdict, number of met checks."""
    links = f", {r['track']} links" if r["track"] else ""
    met, *late = summary.check_counts(r)
    checks = f"; {'; '.join((f'{met} checks are met', *late))}" if r["checks"] or late else ""
    verdict = summary.verdict(r)
    ended = f"; {r['message']}" if verdict == "ok" and r["message"] else ""  # by a component
    return f"{r['scene']}{links}: {verdict}{checks}{ended}"


def _pace(r: Mapping[str, Any]) -> str:
    """Return the line about run time and real-time factor; empty for a run whose cost is not known."""
    if not r["wall_time"]:
        return ""
    factor, whole = r["real_time_factor"], r["simulated_time"]
    own = factor * r["wall_time"] or whole  # of a resumed run
    part = f"{own:.6g} of " * (own < whole * (1.0 - 1e-6))
    simulated = f"{part}{whole:.6g} s simulated in {r['wall_time']:.3g} s"
    if not factor:  # in a log of an earlier version
        return simulated
    pace = f"{factor:.3g} times as fast as" if factor >= 1.0 else f"{1.0 / factor:.3g} times slower than"
    return f"{simulated}, {pace} real time, after {r['startup_time']:.3g} s of start-up"


def _observables(r: Mapping[str, Any]) -> list[str]:
    """Return a line per averaging window with its finite observables."""
    lines: dict[str, list[str]] = {}
    for key, value in r["observables"].items():
        shown = OBSERVABLES[key].shown
        other = r["observables"].get(shown.unless, float("nan"))
        if value == value and other != other and not (r["phases"] and shown.by_phase):
            place = r["places"].get(key, "")
            where = _track_of_largest_tension(r["phases"]) if key == "tension_max" else f" {place}" if place else ""
            window = _window(r["windows"][key], r["simulated_time"])
            number = figure(without_rounding(value / OBSERVABLES[key].size, shown.unit), shown.digits)
            lines.setdefault(window, []).append(f"{shown.label} {number} {shown.unit}{where}")
    return [f"{window}: {', '.join(texts)}" for window, texts in lines.items()]


def _window(window: dict[str, float], simulated: float) -> str:
    """Return the averaging window in words."""
    start, end = window["from"], window["to"]
    is_whole = start == 0.0 and end == simulated
    sparse = f", one step in {window['every']}" if "every" in window else ""
    return f"{'whole run,' if is_whole else 'mean of'} {start:.6g} to {end:.6g} s{sparse}"


def _phases(phases: list[dict[str, Any]], most: int) -> list[str]:
    """Return a line per phase; of more than ``most`` the longest in motion, and one line about all others, in short."""
    from orchestrator.results.analyses.phases import sentence

    longest = sorted(phases, key=lambda phase: (phase["kind"] == "rest", phase["start"] - phase["end"]))
    whole = longest if len(phases) <= most else longest[: max(0, most - 1)]
    others = "; ".join(sentence(phase, brief=True) for phase in phases if phase not in whole)
    return [*(sentence(phase) for phase in phases if phase in whole), *([f"in short: {others}"] if others else [])]


def track_tension(found: dict[str, Any]) -> str:
    """Return the line about the tension asked and had, and what else the vehicle at rest has; empty without tracks."""
    if not found:
        return ""
    standing = f"{_of_sides(found['standing'])} standing on level, hard ground, " if found["standing"] else ""
    start = f"{_of_sides(found['start'])} at the start{' as drawn' if found['drawn'] else ''}"
    if found["why"]:
        return f"track tension: {_of_sides([found['asked']])} asked, {start}: it does not stand ({found['why']})"
    factor, unit = scaled(max(map(max, found["loads"])), "N")
    pairs = zip(found["loads"], found["others"], strict=True)
    named = [[*(("", load) for load in side), *others.items()] for side, others in pairs]
    loads = [", ".join(f"{name} {figure(load / factor, 3)}".strip() for name, load in side) for side in named]
    each = loads[:1] if loads[:1] == loads[1:] else loads
    return (
        f"track tension: {_of_sides([found['asked']])} asked, {standing}{start};"
        f" {'standing, ' if found['drawn'] else ''}its longest free span sags by {figure(found['sag'] * 1e3, 3)} mm,"
        f" road wheels carry {' and '.join(each)} {unit}, and it has settled by"
        f" {figure(found['settlement'] * 1e3, 3)} mm"
    )


def _of_sides(tensions: Sequence[float]) -> str:
    """Return the tension of both tracks, or one of each if they differ in the printed digits."""
    factor, unit = scaled(tensions[0], "N")
    return f"{' and '.join(dict.fromkeys(figure(tension / factor, 4) for tension in tensions))} {unit}"


def _track_of_largest_tension(phases: list[dict[str, Any]]) -> str:
    """Return track and time of the largest tension in words; empty without phases."""
    largest = max(
        (phase for phase in phases if phase["tension_track"]), key=lambda phase: phase["tension"], default=None
    )
    return f" in {largest['tension_track'].replace('_', ' ')} at {largest['tension_t']:.4g} s" if largest else ""


def warnings(entries: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return the lines about warnings of components, one for a text: its components, first time and count."""
    alike: dict[str, list[Mapping[str, Any]]] = {}
    for entry in entries:
        alike.setdefault(entry["text"], []).append(entry)
    lines = []
    for text, same in alike.items():
        who = " and ".join(dict.fromkeys(entry["component"] for entry in same))
        time, count = min(entry["time"] for entry in same), sum(entry["count"] for entry in same)
        lines.append(f"warning: {who} at {time:.6g} s{f', {count} times' if count > 1 else ''}: {text}")
    return lines


def validity(entries: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return the lines about entries of the validity ledger, one for those that differ only in their place."""
    return [
        f"validity, {entry.severity}: {entry.component} from {entry.time:.6g} s on: {entry.sentence}"
        for entry in alike_as_one(Exceedance(**fields) for fields in entries)
    ]


def _balance(energy: dict[str, Any]) -> str:
    """Return the line about energies, largest first: what came in equals what became of it, in the printed digits."""
    flows = {"put in by the drives": energy["work"], "unaccounted for": -energy["residual"]}  # positive: it came in
    flows |= {f"from {STORED_ENERGIES[kind]}": -change for kind, change in energy["stored"].items()}
    flows |= {f"delivered by {name.replace('_', ' ')}": -value for name, value in energy["delivered"].items()}
    flows |= {"dissipated": -energy["dissipated"], "done on the towed load": -energy.get("towed", 0.0)}
    flows["lost where contacts move along links"] = -energy["covered"]
    top = max(map(abs, flows.values()))
    unit, size_of_unit = ("kJ", 1e3) if top >= 1e3 else ("J", 1.0)
    digits = max(0, 4 - len(f"{top / size_of_unit:.0f}"))
    step = size_of_unit / 10.0**digits
    counts = {what: round(value / step) for what, value in flows.items()}
    while left := sum(counts.values()):  # the one that was rounded most is rounded the other way
        sign = 1 if left > 0 else -1
        counts[max(counts, key=lambda what: sign * (counts[what] - flows[what] / step))] -= sign
    ordered = sorted(counts.items(), key=lambda item: -abs(item[1]))
    sides = [
        " + ".join(
            f"{abs(n) / 10**digits:.{digits}f} {unit} {_flow(what, sign)}" for what, n in ordered if sign * n > 0
        )
        for sign in (1, -1)
    ]
    terms = f": {' = '.join(sides)}" if all(sides) else ": less than 1 mJ flowed"
    return f"energy balance{terms} ({_percent(abs(energy['residual_relative']))} unaccounted for)"


def _no_balance(r: Mapping[str, Any]) -> str:
    """Return the line on why there is no energy balance; empty for a run that was not evaluated."""
    return f"no energy balance: {r['energy_missing']}" if r["energy_missing"] else ""


def _flow(what: str, sign: int) -> str:
    """Return the words of an energy that came in (1) or went out (-1)."""
    if sign > 0:
        return what.replace("dissipated", "made by friction").replace("lost where", "gained where")
    out = {"put in": "taken back", "from ": "into ", "delivered by": "delivered to"}
    return next((what.replace(a, b, 1) for a, b in out.items() if what.startswith(a)), what)


def _ledger(energy: dict[str, Any]) -> str:
    lost = {"change of stored energy": energy["change"], "dissipated": energy["dissipated"]}
    lost |= {
        "lost where contacts move along links": energy["covered"],
        "done on the towed load": energy.get("towed") or None,
    }
    lost |= {f"delivered to {name}": value for name, value in energy["delivered"].items()}
    parts = [f"{figure(value, 6)} J {what}" for what, value in lost.items() if value is not None]
    left = (
        f"{_percent(energy['residual_relative'])}; {figure(energy['port'])} J of it by the exchange of the components"
    )
    return (
        f"energy ledger: {figure(energy['work'], 6)} J put in = {' + '.join(parts)}"
        f" + {figure(energy['residual'])} J unaccounted for ({left})"
    ).replace("+ -", "- ")


def _causes(causes: dict[str, float]) -> str:
    """Return the line about dissipated energy by cause, largest first."""
    parts = sorted(causes.items(), key=lambda item: -abs(item[1]))
    return "dissipated: " + ", ".join(f"{cause.replace('_', ' ')} {_joules(energy)}" for cause, energy in parts)


def _joules(energy: float) -> str:
    factor, unit = scaled(energy, "J")
    return f"{figure(energy / factor)} {unit}"


def _check(name: str, check: dict[str, Any]) -> str:
    value = 0.0 if abs(check["value"]) < 1e-5 * check["tolerance"] else check["value"]  # rounding
    expected = f"{figure(check['expected'], 7)} +- {figure(check['tolerance'], 3)}"
    about = "; ".join(filter(None, (check.get("what"), check["note"])))
    note = f" ({about})" if about else ""
    return f"{'ok ' if check['ok'] else 'NOT'} {name} = {figure(value, 7)}, expected {expected}{note}"


def _fmus(fmus: dict[str, dict[str, str]]) -> str:
    """Return the line about FMUs of the user."""
    parts = [f"{name} = {fmu['file']} (sha256 {fmu['sha256'][:HASH_DIGITS]})" for name, fmu in fmus.items()]
    return f"FMUs of yours: {', '.join(parts)}"


def _cost(name: str, cost: dict[str, Any]) -> str:
    counts = ", ".join(f"{count} {what}" for what, count in cost.items() if what != "wall_time" and count)
    solver = f"; its solver: {counts}" if counts else ""
    return f"{name} computed for {cost['wall_time']:.3g} s{solver}"


def lines(r: Mapping[str, Any], most: int | None = None) -> list[str]:
    """Return the lines of a summary: verdict, figures, energy, what is wrong, cost; the last one names the log.

    ``most``: leave out met checks and details, and put phases into one line, for so many lines without those on what
    is wrong; the last line says how many are left out.
    """
    energy = r["energy"]
    wrong = [
        *warnings(r["warnings"]),
        *validity(r["validity"]),
        *(f"warning: {sentence}" for sentence in r["passed_over"]),
        *(f"check {name} is left out: {why}" for name, why in r["checks_left_out"].items()),
        *(_check(*item) for item in r["checks"].items() if not item[1]["ok"]),
    ]
    observables = [*filter(None, [track_tension(r["track_tension"])]), *_observables(r)]
    balances = [_error(r["error"]) if r["error"] else "", _balance(energy) if energy else _no_balance(r)]
    cost = [_pace(r), _fmus(r["fmus"]) if r["fmus"] else ""]
    details = [
        f"{r['communication_steps']} steps kept, {r['rejected_steps']} pairs of steps taken back"
        if r["rejected_steps"]
        else "",
        *(_check(*item) for item in r["checks"].items() if item[1]["ok"]),
        _ledger(energy) if energy else "",
        _causes(energy["causes"]) if energy and energy["causes"] else "",
        *(_cost(*item) for item in sorted(r["components"].items(), key=lambda item: -item[1]["wall_time"])),
        f"checksum (seal) of the log {r['seal']}" if r["seal"] else "",
    ]
    log = f"log {r['log']} ({r['log_bytes'] / 1e6:.1f} MB)" if r["log"] else ""
    balances, cost, details = ([line for line in part if line] for part in (balances, cost, details))
    phases, left = _phases(r["phases"], len(r["phases"])), 0
    if most is not None:  # the result stays, phases give way
        short = _phases(r["phases"], most - 2 - len(observables) - len(balances) - len(cost))
        left = len(phases) - len(short) + len(details)
        phases, details = short, []
    last = "; ".join(filter(None, (log, f"{left} lines more with --verbose" if left else "")))
    result = *observables, *phases, *balances
    return [_headline(r), *(f"  {line}" for line in (*result, *wrong, *cost, *details, last) if line)]
