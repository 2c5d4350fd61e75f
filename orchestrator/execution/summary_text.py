"""Text of the summary of a run, as people read it: verdict, figures, phases, balances, cost, and what is wrong."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import accumulate
from textwrap import wrap
from typing import Any, NamedTuple

from orchestrator.execution import summary
from orchestrator.results.analyses.phases import ALIKE, CHANGING, Phase, rounded
from orchestrator.results.convergence_index import ORDERS, PARTS, SAFETY
from orchestrator.results.energy import STORED_ENERGIES
from orchestrator.results.measures import OBSERVABLES
from orchestrator.results.run_data import HASH_DIGITS
from orchestrator.results.table import without_rounding
from orchestrator.results.units import figure, scaled
from orchestrator.results.validity.exceedance import Exceedance, alike_as_one

WIDTH = 100  # columns
LABEL = 17  # columns of a label
MAX_PHASES = 8  # phases of a short summary, the longest


class Row(NamedTuple):
    """Figure in words."""

    quantity: str
    value: str
    unit: str
    where: str = ""  # and when


def _error(error: dict[str, Any]) -> str:
    """Return a sentence about the error estimate of a run."""
    if error["total"] is None:
        return f"not known, {error['message']}"
    decisive = max(
        (name for name, observable in error["observables"].items() if observable["decisive"]),
        key=lambda name: error["observables"][name]["total"],
    )
    how = "; ".join(_how(error, error["observables"][decisive]))
    worst = decisive.replace("_", " ")
    without = f", not known of {', '.join(error['without']).replace('_', ' ')}" if error["without"] else ""
    largest = f"{_percent(error['total'])} of the {worst}, less of all other observables{without}"
    return f"{largest} ({how})" if how else largest


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


def headline(r: Mapping[str, Any]) -> str:
    """Return the first line: scene, links, verdict, number of met checks."""
    links = f", {r['track']} links" if r["track"] else ""
    met, *late = summary.check_counts(r)
    checks = f"; {'; '.join((f'{met} checks are met', *late))}" if r["checks"] or late else ""
    verdict = summary.verdict(r)
    ended = f"; {r['message']}" if verdict == "ok" and r["message"] else ""  # by a component
    return f"{r['scene']}{links}: {verdict}{checks}{ended}"


def _pace(r: Mapping[str, Any]) -> str:
    """Return run time and real-time factor; empty for a run whose cost is not known."""
    if not r["wall_time"]:
        return ""
    factor, whole = r["real_time_factor"], r["simulated_time"]
    own = factor * r["wall_time"] or whole  # of a resumed run
    part = f"{own:.6g} of " * (own < whole * (1.0 - 1e-6))
    simulated = f"{part}{whole:.6g} s simulated in {r['wall_time']:.3g} s"
    if not factor:  # in a log of an earlier version
        return simulated
    pace = f"{factor:.3g} times as fast as" if factor >= 1.0 else f"{1.0 / factor:.3g} times slower than"
    return f"{simulated}, {pace} real time"


def _further_times(r: Mapping[str, Any]) -> str:
    """Return the times before and after a run's own; empty for a run whose cost is not known."""
    if not r["wall_time"] or not r["startup_time"]:
        return ""
    estimate = (r["error"] or {}).get("wall_time")
    return f"start-up {r['startup_time']:.3g} s" + (f", estimate of the error {estimate:.3g} s" if estimate else "")


def _observables(r: Mapping[str, Any]) -> dict[str, list[Row]]:
    """Return the finite observables by averaging window."""
    rows: dict[str, list[Row]] = {}
    for key, value in r["observables"].items():
        shown = OBSERVABLES[key].shown
        other = r["observables"].get(shown.unless, float("nan"))
        in_phases = r["phases"] and shown.by_phase and not _turns_throughout(r["phases"], r["windows"][key])
        if value == value and other != other and not in_phases:
            where = _track_of_largest_tension(r["phases"]) if key == "tension_max" else r["places"].get(key, "")
            number = figure(without_rounding(value / OBSERVABLES[key].size, shown.unit), shown.digits)
            window = _window(r["windows"][key], r["simulated_time"])
            rows.setdefault(window, []).append(Row(shown.label, number, shown.unit, where))
    return rows


def _turns_throughout(phases: Sequence[Mapping[str, Any]], window: Mapping[str, float]) -> bool:
    """Whether a window lies in one phase that turns, whose own figures have the entry into the turn too."""
    return any(p["turning"] and p["start"] <= window["from"] and window["to"] <= p["end"] for p in phases)


def _window(window: dict[str, float], simulated: float) -> str:
    """Return the averaging window in words."""
    start, end = window["from"], window["to"]
    is_whole = start == 0.0 and end == simulated
    sparse = f", one step in {window['every']}" if "every" in window else ""
    return f"{'whole run,' if is_whole else 'mean of'} {start:.6g} to {end:.6g} s{sparse}"


HEADS = (("phase", ""), ("from", "s"), ("to", "s"), ("speed", "m/s"), ("way", "m"), ("power", "kW"), ("slip", "m/s"),
         ("tension", "kN"), ("at", "s"), ("in", ""))  # fmt: skip
TURN_HEADS = (("turn", ""), ("from", "s"), ("to", "s"), ("yaw rate", "rad/s"), ("largest", "rad/s"), ("radius", "m"),
              ("slip left", "m/s"), ("slip right", "m/s"))  # fmt: skip


def _phases(phases: Sequence[Mapping[str, Any]], verbose: bool, width: int) -> list[str]:
    """Return the table of phases, and that of those that turn; of many the longest, unless ``verbose``."""
    known = [Phase(**{key: _known(value) for key, value in each.items()}) for each in phases]
    longest = sorted(known, key=lambda phase: (phase.kind == "rest", phase.start - phase.end))[:MAX_PHASES]
    shown = [phase for phase in known if verbose or phase in longest]
    turning = [phase for phase in shown if phase.turning]
    rows = [*zip(*HEADS, strict=True), *map(_motion, shown)]
    lines = _aligned([row if verbose else row[:-2] for row in rows], width) if shown else []
    return [*lines, *(_aligned([*zip(*TURN_HEADS, strict=True), *map(_turn, turning)], width) if turning else ())]


def _known(value: Any) -> Any:
    """Return NaN for null, which stands for it in JSON."""
    return float("nan") if value is None else value


def _motion(p: Phase) -> tuple[str, ...]:
    """Return the cells of a phase; the columns are HEADS."""
    times = f"{p.start:.4g}", f"{p.end:.4g}"
    if p.kind == "rest":
        return (p.kind, *times, *[""] * (len(HEADS) - 3))
    speed = f"{rounded(p.speed_start)} to {rounded(p.speed_end)}" if p.kind in CHANGING else figure(p.speed)
    power = figure(without_rounding(p.power / 1e3, "kW"), 3) if p.power == p.power else ""
    slips = [f"{each:.3f}" for each in (p.slip_left, p.slip_right) if each == each and not p.turning]
    alike = abs(p.slip_left - p.slip_right) < ALIKE
    largest = figure(p.tension / 1e3), f"{p.tension_t:.4g}", p.tension_track.replace("_", " ")
    return (
        p.kind, *times, speed, figure(p.way), power, " and ".join(slips[:1] if alike else slips),
        *(largest if p.tension_track else ("", "", "")),
    )  # fmt: skip


def _turn(p: Phase) -> tuple[str, ...]:
    """Return the cells of a phase that turns; the columns are TURN_HEADS."""
    figures = (figure(value, 3) for value in (p.yaw_rate, p.yaw_rate_most, p.radius))
    slips = (f"{each:.3f}" if each == each else "" for each in (p.slip_left, p.slip_right))
    return (p.turning, f"{p.start:.4g}", f"{p.end:.4g}", *figures, *slips)


def _aligned(rows: Sequence[Sequence[str]], width: int) -> list[str]:
    """Return the lines of a table without empty columns; below two heads, the first is text and the others numbers.

    Of a table that is wider than ``width`` the last columns follow in one of their own, beside the first three.
    """
    columns = [column for column in zip(*rows, strict=True) if any(column[2:])]
    widths = [max(map(len, column)) for column in columns]
    ends = [*accumulate(2 + each for each in widths)]
    if fit := sum(end <= width for end in ends) * (ends[-1] > width > ends[2]):
        first, last = ([*zip(*part, strict=True)] for part in (columns[:fit], [*columns[:3], *columns[fit:]]))
        return [*_aligned(first, width), *_aligned(last, width)]
    padded = [
        [cell.rjust(width) if k else cell.ljust(width) for cell in column]
        for k, (column, width) in enumerate(zip(columns, widths, strict=True))
    ]
    return [f"  {'  '.join(row)}".rstrip() for row in zip(*padded, strict=True)]


def track_tension(found: dict[str, Any]) -> list[str]:
    """Return the lines about the tension asked and had, and what else the vehicle at rest has; none without tracks."""
    return [*_figures({"at the start": _at_start(found, True)}, WIDTH)]


def _wheel_loads(found: dict[str, Any]) -> str:
    """Return the loads on the wheels of both sides, or of one if they are alike."""
    factor, unit = scaled(max(map(max, found["loads"])), "N")
    pairs = zip(found["loads"], found["others"], strict=True)
    named = [[*(("", load) for load in side), *others.items()] for side, others in pairs]
    loads = [", ".join(f"{name} {figure(load / factor, 3)}".strip() for name, load in side) for side in named]
    return f"{' and '.join(loads[:1] if loads[:1] == loads[1:] else loads)} {unit}"


def _at_start(found: dict[str, Any], verbose: bool) -> list[Row]:
    """Return the rows of the tracks at the start, ``track_tension``; without ``verbose`` the tension alone."""
    if not found:
        return []
    where = f"{_of_sides([found['asked']])} asked{', as drawn' * found['drawn']}"
    why = f"; it does not stand: {found['why']}" if found["why"] else ""
    value, unit = _of_sides(found["start"]).rsplit(" ", 1)
    tension = Row("track tension", value, unit, f"{where}{why}")
    if why or not verbose:
        return [tension]
    standing, (value, unit) = "standing" * found["drawn"], _of_sides(found["standing"]).rsplit(" ", 1)
    return [
        tension,
        Row("standing on level, hard ground", value, unit),
        Row("sag of the longest free span", figure(found["sag"] * 1e3, 3), "mm", standing),
        Row("settlement", figure(found["settlement"] * 1e3, 3), "mm", standing),
        Row("road wheels carry", "", "", _wheel_loads(found)),
    ]


def _of_sides(tensions: Sequence[float]) -> str:
    """Return the tension of both tracks, or one of each if they differ in the printed digits."""
    factor, unit = scaled(tensions[0], "N")
    return f"{' and '.join(dict.fromkeys(figure(tension / factor, 4) for tension in tensions))} {unit}"


def _track_of_largest_tension(phases: list[dict[str, Any]]) -> str:
    """Return track and time of the largest tension in words; empty without phases."""
    largest = max(
        (phase for phase in phases if phase["tension_track"]), key=lambda phase: phase["tension"], default=None
    )
    return f"in {largest['tension_track'].replace('_', ' ')} at {largest['tension_t']:.4g} s" if largest else ""


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
    """Return the energies, largest first: what came in equals what became of it, in the printed digits."""
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
    terms = " = ".join(sides) if all(sides) else "less than 1 mJ flowed"
    return f"{terms} ({_percent(abs(energy['residual_relative']))} unaccounted for)"


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
        f"{figure(energy['work'], 6)} J put in = {' + '.join(parts)}"
        f" + {figure(energy['residual'])} J unaccounted for ({left})"
    ).replace("+ -", "- ")


def _causes(causes: dict[str, float]) -> str:
    """Return the dissipated energy by cause, largest first."""
    parts = sorted(causes.items(), key=lambda item: -abs(item[1]))
    return ", ".join(f"{cause.replace('_', ' ')} {_joules(energy)}" for cause, energy in parts)


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
    """Return the FMUs of the user."""
    return ", ".join(f"{name} = {fmu['file']} (sha256 {fmu['sha256'][:HASH_DIGITS]})" for name, fmu in fmus.items())


def _cost(cost: dict[str, Any]) -> str:
    counts = ", ".join(f"{count} {what}" for what, count in cost.items() if what != "wall_time" and count)
    solver = f"; its solver: {counts}" if counts else ""
    return f"computed for {cost['wall_time']:.3g} s{solver}"


def lines(r: Mapping[str, Any], verbose: bool = True, width: int = WIDTH) -> list[str]:
    """Return the lines of a summary, of ``width`` columns: verdict, figures, phases, balances, cost, what is wrong.

    Without ``verbose`` met checks and details are left out, and the shortest of many phases.
    """
    wrong = [
        *warnings(r["warnings"]),
        *validity(r["validity"]),
        *(f"warning: {sentence}" for sentence in r["passed_over"]),
        *(f"check {name} is left out: {why}" for name, why in r["checks_left_out"].items()),
        *(_check(*item) for item in r["checks"].items() if not item[1]["ok"]),
        *([f"{r['status']}: {r['message']}"] if r["status"] == "failed" and r["message"] else []),
    ]
    log = f"{r['log']} ({r['log_bytes'] / 1e6:.1f} MB)" if r["log"] else ""
    result, whole = (_result(r, each, width) for each in (verbose, True))
    more = "more with --verbose" if len(whole) > len(result) else ""
    return [
        *_wrapped("", headline(r), width),
        *result,
        *_labelled("log", "; ".join(filter(None, (log, more))), width),
        *(line for text in wrong for line in _wrapped("! ", text, width)),
    ]


def _result(r: Mapping[str, Any], verbose: bool, width: int) -> list[str]:
    """Return the lines of figures, phases, balances and cost."""
    energy, error = r["energy"], r["error"]
    missing = f"none: {r['energy_missing']}" if r["energy_missing"] else ""
    details = _details(r) if verbose else ()
    labelled = {
        "estimated error": _error(error) if error else "",
        "energy balance": _balance(energy) if energy else missing,
        "run time": _pace(r),
        "further times": _further_times(r),
        "FMUs of yours": _fmus(r["fmus"]),
    }
    return [
        *_figures({"at the start": _at_start(r["track_tension"], verbose)} | _observables(r), width),
        *_phases(r["phases"], verbose, width),
        *(line for label, text in (*labelled.items(), *details) for line in _labelled(label, text, width)),
    ]


def _details(r: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield what only a whole summary has: labels and texts."""
    energy = r["energy"]
    if r["rejected_steps"]:
        yield "steps", f"{r['communication_steps']} kept, {r['rejected_steps']} pairs taken back"
    yield from (("check", _check(*item)) for item in r["checks"].items() if item[1]["ok"])
    if energy:
        yield "energy ledger", _ledger(energy)
        yield "dissipated", _causes(energy["causes"])
    by_cost = sorted(r["components"].items(), key=lambda item: -item[1]["wall_time"])
    yield from ((name, _cost(cost)) for name, cost in by_cost)
    yield "seal of the log", r["seal"]


def _figures(groups: Mapping[str, Sequence[Row]], width: int) -> Iterator[str]:
    """Yield the lines of figures, aligned, those of each group under its title."""
    rows = [row for group in groups.values() for row in group]
    widths = [max((len(row[k]) for row in rows), default=0) for k in range(3)]
    for title, group in groups.items():
        if group:
            yield f"  {title}"
        for row in group:
            head = f"    {row.quantity:{widths[0]}}  {row.value:>{widths[1]}} {row.unit:{widths[2]}}  "
            yield from _wrapped(head, row.where, width)


def _labelled(label: str, text: str, width: int) -> list[str]:
    """Return the lines of a text behind its label; none without a text."""
    return _wrapped(f"  {label:{LABEL}}  ", text, width) if text else []


def _wrapped(head: str, text: str, width: int) -> list[str]:
    """Return the lines of a text behind a head; words stay whole, and numbers with their units."""
    joined = re.sub(r"(?<=\d) (?=%|k?[JN]\b|m?m\b|s\b)", "\N{NO-BREAK SPACE}", text)
    pieces = wrap(joined, max(width - len(head), 20), break_long_words=False, break_on_hyphens=False) or [""]
    first, *others = (piece.replace("\N{NO-BREAK SPACE}", " ") for piece in pieces)
    return [f"{head}{first}".rstrip(), *(f"{'':{len(head)}}{other}" for other in others)]
