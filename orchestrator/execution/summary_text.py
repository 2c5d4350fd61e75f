"""Text of the summary of a run, as people read it (``summary.empty``)."""

from __future__ import annotations

from typing import Any

from orchestrator.execution import summary
from orchestrator.execution.labels import LABELS
from orchestrator.results.given_parts import SHOWN
from orchestrator.results.table import without_rounding
from orchestrator.results.units import size
from orchestrator.results.validity.exceedance import Exceedance

OF_PHASES = ("yaw_rate", "turn_radius", "slip_left", "slip_right")  # printed by phase instead of by the last second

INSTEAD = {"pad_velocity": "pad_slip"}  # printed where the other one is not known


def _error(error: dict[str, Any]) -> str:
    """Return a sentence about the error estimate of a run."""
    if error["total"] is None:
        return f"estimated error: not known, {error['message']}"
    decisive = max(
        (name for name, observable in error["observables"].items() if observable["decisive"]),
        key=lambda name: error["observables"][name]["total"],
    )
    integration = "not known" if error["integration"] is None else f"{error['integration']:.2g}"
    without = f"; not known for {', '.join(error['without']).replace('_', ' ')}" if error["without"] else ""
    return (
        f"estimated error: {100.0 * error['total']:.2g} % ({decisive.replace('_', ' ')}; all other observables are"
        f" smaller{without}; coupling {error['coupling']:.2g}, integration {integration}; took"
        f" {error['wall_time']:.3g} s more)"
    )


def _headline(r: dict[str, Any]) -> str:
    """Return the first line: scene, links, verdict, number of met checks."""
    links = f", {r['track']} links" if r["track"] else ""
    met, *late = summary.check_counts(r)
    checks = f"; {'; '.join((f'{met} checks are met', *late))}" if r["checks"] or late else ""
    return f"{r['scene']}{links}: {summary.verdict(r)}{checks}"


def _pace(r: dict[str, Any]) -> str:
    """Return the line about run time and real-time factor; empty for a run whose cost is not known."""
    if not r["wall_time"]:
        return ""
    simulated = f"{r['simulated_time']:.6g} s simulated in {r['wall_time']:.3g} s"
    factor = r["real_time_factor"]
    if not factor:  # in a log of an earlier version
        return simulated
    pace = f"{factor:.3g} times as fast as" if factor >= 1.0 else f"{1.0 / factor:.3g} times slower than"
    return f"{simulated}, {pace} real time, after {r['startup_time']:.3g} s of start-up"


def _observables(r: dict[str, Any]) -> list[str]:
    """Return a line per averaging window with its finite observables; OF_PHASES only without phases."""
    lines: dict[str, list[str]] = {}
    for key, value in r["observables"].items():
        name, unit, digits = LABELS[key]
        other = r["observables"].get(INSTEAD.get(key, ""), float("nan"))
        if value == value and other != other and not (r["phases"] and key in OF_PHASES):
            where = _track_of_largest_tension(r["phases"]) if key == "tension_max" else ""
            window = _window(r["windows"].get(key, {"from": 0.0, "to": r["simulated_time"]}), r["simulated_time"])
            shown = without_rounding(value / size(unit), unit)
            lines.setdefault(window, []).append(f"{name} {shown:.{digits}g} {unit}{where}")
    return [f"{window}: {', '.join(texts)}" for window, texts in lines.items()]


def _window(window: dict[str, float], simulated: float) -> str:
    """Return the averaging window in words."""
    start, end = window["from"], window["to"]
    is_whole = start == 0.0 and end == simulated
    return f"{'whole run,' if is_whole else 'mean of'} {start:.6g} to {end:.6g} s"


def _phases(phases: list[dict[str, Any]]) -> list[str]:
    from orchestrator.results.analyses.phases import sentence

    return [sentence(phase) for phase in phases]


def _track_of_largest_tension(phases: list[dict[str, Any]]) -> str:
    """Return track and time of the largest tension in words; empty without phases."""
    largest = max(
        (phase for phase in phases if phase["tension_track"]), key=lambda phase: phase["tension"], default=None
    )
    return f" in {largest['tension_track'].replace('_', ' ')} at {largest['tension_t']:.4g} s" if largest else ""


def warning(entry: dict[str, Any]) -> str:
    """Return the line about a component's warning."""
    times = f", {entry['count']} times" if entry["count"] > 1 else ""
    return f"warning: {entry['component']} at {entry['time']:.6g} s{times}: {entry['text']}"


def validity(fields: dict[str, Any]) -> str:
    """Return the line about an entry of the validity ledger."""
    entry = Exceedance(**fields)
    return f"validity, {entry.severity}: {entry.component} from {entry.time:.6g} s on: {entry.sentence}"


def _balance(energy: dict[str, Any]) -> str:
    released = -sum(min(change, 0.0) for change in energy["stored"].values())
    parts = (("put in by the drives", energy["work"]), ("released from store", released))
    delivered = [
        (f"delivered {'by' if value < 0.0 else 'to'} {name.replace('_', ' ')}", abs(value))
        for name, value in energy["delivered"].items()
    ]
    lost = ("dissipated", energy["dissipated"]), ("done on the towed load", energy.get("towed", 0.0))
    sums = [f"{value / 1e3:.4g} kJ {what}" for what, value in (*parts, *lost, *delivered) if value]
    terms = f" ({', '.join(sums)})" if sums else ""
    return f"energy balance: {abs(energy['residual_relative']) * 100:.2g} % unaccounted for{terms}"


def _ledger(energy: dict[str, Any]) -> str:
    delivered = "".join(f" + delivered to {name} {value:.6g}" for name, value in energy["delivered"].items())
    towed = f" + towed {energy['towed']:.6g}" if energy.get("towed") else ""
    return (
        f"ledger: work {energy['work']:.6g} J = change {energy['change']:.6g} + dissipated {energy['dissipated']:.6g}"
        f" + covered {energy['covered']:.4g}{towed}{delivered} + residual {energy['residual']:.4g}"
        f" ({energy['residual_relative'] * 100:.3g} %; ports {energy['port']:.4g} J)"
    )


def _causes(causes: dict[str, float]) -> str:
    """Return the line about dissipated energy by cause, largest first."""
    parts = sorted(causes.items(), key=lambda item: -abs(item[1]))
    return "dissipated: " + ", ".join(f"{cause.replace('_', ' ')} {energy:.4g} J" for cause, energy in parts)


def _check(name: str, check: dict[str, Any]) -> str:
    expected = f"{check['expected']:.7g} +- {check['tolerance']:.3g}"
    note = f" ({check['note']})" if check["note"] else ""
    return f"{'ok ' if check['ok'] else 'NOT'} {name} = {check['value']:.7g}, expected {expected}{note}"


def _fmus(fmus: dict[str, dict[str, str]]) -> str:
    """Return the line about FMUs of the user."""
    parts = [f"{name} = {fmu['file']} (sha256 {fmu['sha256'][:SHOWN]})" for name, fmu in fmus.items()]
    return f"FMUs of yours: {', '.join(parts)}"


def _cost(name: str, cost: dict[str, Any]) -> str:
    counts = ", ".join(f"{count} {what}" for what, count in cost.items() if what != "wall_time" and count)
    return f"{name:12} {cost['wall_time']:8.3f} s  {counts}"


def lines(r: dict[str, Any]) -> list[str]:
    """Return the lines of a summary: text, checks, energy balance, cost of each component."""
    below = [
        _pace(r),
        _fmus(r["fmus"]) if r["fmus"] else "",
        *_observables(r),
        *_phases(r["phases"]),
        _error(r["error"]) if r["error"] else "",
        _balance(r["energy"]) if r["energy"] else "",
        *(warning(entry) for entry in r["warnings"]),
        *(validity(entry) for entry in r["validity"]),
        *(f"warning: {sentence}" for sentence in r["passed_over"]),
        f"{r['communication_steps']} steps kept, {r['rejected_steps']} pairs of steps taken back"
        if r["rejected_steps"]
        else "",
        *(_check(*item) for item in r["checks"].items()),
        _ledger(r["energy"]) if r["energy"] else "",
        _causes(r["energy"]["causes"]) if r["energy"] and r["energy"]["causes"] else "",
        *(_cost(*item) for item in r["components"].items()),
        f"log {r['log']} ({r['log_bytes'] / 1e6:.1f} MB)" if r["log"] else "",
        f"seal {r['seal']}" if r["seal"] else "",
    ]
    return [_headline(r), *(f"  {line}" for line in below if line)]
