"""Output of ``cotrack compare``: one JSON object, and lines of text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fmus.vehicles.tables import BadInput
from orchestrator.log.bitwise import BitDifference as Bits
from orchestrator.results.difference import ObservableDifference, part_differences
from orchestrator.results.divergence import Divergence
from orchestrator.results.measured_difference import WHOLE, MeasuredComparison
from orchestrator.results.run_data import RunData, Window

MAX_SIGNALS = 12  # largest number of printed signals that only one log has


def allowed_differences(allowed: Sequence[str], decisive: Mapping[str, bool]) -> dict[str, float]:
    """Parse allowed differences, "NAME=RELATIVE" or "RELATIVE" (all decisive ones), by observable; raises BadInput."""
    limit_of: dict[str, float] = {}
    for text in allowed:
        name, _, number = text.rpartition("=")
        try:
            limit = float(number)
        except ValueError:
            limit = -1.0
        if not limit >= 0.0:
            raise BadInput(f"--allow {text}: must be [NAME=]RELATIVE, a number from 0 on")
        if name and name not in decisive:
            raise BadInput(f"--allow {text}: no observable '{name}': one of {', '.join(decisive)}")
        limit_of |= {name: limit} if name else {each: limit for each, counts in decisive.items() if counts}
    return limit_of


def logs_result(
    run: RunData,
    reference: RunData,
    window: Window,
    differences: Mapping[str, ObservableDifference],
    limit_of: Mapping[str, float],
    divergence: Divergence | None,
) -> dict[str, Any]:
    """Return the result of a comparison as one JSON object."""
    observables = {
        name: {
            "unit": difference.unit,
            "rms": difference.absolute,
            "relative": difference.relative,
            "decisive": difference.decisive,
        }
        | ({"allowed": limit_of[name], "ok": difference.relative <= limit_of[name]} if name in limit_of else {})
        for name, difference in differences.items()
    }
    result: dict[str, Any] = {
        "run": about(run),
        "reference": about(reference),
        "parts": part_differences(run, reference),
        "window": {"from": window.start, "to": window.end},
        "observables": observables,
        "bits": None if divergence is None else _bits(divergence),
    }
    exceeded = any(not difference.get("ok", True) for difference in observables.values())
    return result | {"ok": not exceeded and (divergence is None or divergence.first is None)}


def measured_result(
    run: RunData, compared: MeasuredComparison, window: Window, allowed: Sequence[str]
) -> dict[str, Any]:
    """Return the result of a comparison with a measured record as one JSON object; raises BadInput for ``allowed``."""
    rows = [each._asdict() for each in compared.differences]
    signals = {row["signal"]: row for row in rows if row["window"] == WHOLE}
    for name, limit in allowed_differences(allowed, dict.fromkeys(signals, True)).items():
        signals[name] |= {"allowed": limit, "ok": signals[name]["relative"] <= limit}
    return {
        "run": about(run),
        "reference": {"file": str(compared.file), "shift": compared.shift, "notes": compared.notes},
        "window": {"from": window.start, "to": window.end},
        "observables": signals,
        "phases": [row for row in rows if row["window"] != WHOLE],
        "ok": all(signal.get("ok", True) for signal in signals.values()),
    }


def about(run: RunData) -> dict[str, Any]:
    """Return the path of a log, and scene, track, coupling, step and stop of its run."""
    recorded = run.log.metadata.get("run", {})
    return {
        "log": str(run.log.path),
        **{key: recorded.get(key) for key in ("scene", "track", "coupling", "step", "stop")},
    }


def _bits(divergence: Divergence) -> dict[str, Any]:
    return {
        "compared": divergence.value_count,
        "until": divergence.end,
        "first": None if divergence.first is None else _place(divergence.first),
        "spread": [_place(difference) for difference in divergence.spread],
        "growth": {
            topic: {"t": growth.t.tolist(), "apart": growth.difference.tolist()}
            for topic, growth in divergence.growth.items()
        },
        "only": list(divergence.unmatched),
    }


def _place(difference: Bits) -> dict[str, Any]:
    names = {"recorded": "run", "replayed": "reference"}
    return {names.get(key, key): value for key, value in difference._asdict().items()}


def lines(result: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of text for the result of a comparison."""
    yield from (run_line(role, result[role]) for role in ("run", "reference"))
    yield from (f"other part: {sentence}" for sentence in result["parts"])
    start, end = result["window"]["from"], result["window"]["to"]
    if (start, end) != (float("-inf"), float("inf")):
        yield f"from {start:g} to {end:g} s"
    yield f"{'observable':18} {'RMS':>10}       {'relative':>9}"
    for name, observable in result["observables"].items():
        note = "" if observable["decisive"] else "  instant by instant: sensitive"
        if "ok" in observable:
            note += f"  {'ok' if observable['ok'] else 'NOT'}, allowed {observable['allowed']:g}"
        yield f"{name:18} {observable['rms']:10.3g} {observable['unit']:5} {observable['relative']:9.2g}{note}"
    if result["bits"] is not None:
        yield from _bit_lines(result["bits"])


def measured_lines(result: Mapping[str, Any], compared: MeasuredComparison) -> Iterator[str]:
    """Yield the lines of text for a comparison with a measured record and its ``measured_result``."""
    yield run_line("run", result["run"])
    yield from str(compared.table()).splitlines()
    for name, signal in result["observables"].items():
        if "ok" in signal:
            verdict = "ok " if signal["ok"] else "NOT"
            yield f"{verdict} {name}: relative {signal['relative']:.3g}, allowed {signal['allowed']:g}"


def run_line(role: str, of_run: Mapping[str, Any]) -> str:
    """Line about a run, from the object of ``about``."""
    what = ", ".join(str(of_run[name]) for name in ("scene", "track", "coupling") if of_run[name])
    step = f", step {of_run['step']} s" if of_run["step"] else ""
    return f"{role:10} {of_run['log']}: {what}{step}"


def _bit_lines(bits: Mapping[str, Any]) -> Iterator[str]:
    only = bits["only"]
    yield from (f"not in both: {name}" for name in only[:MAX_SIGNALS])
    if len(only) > MAX_SIGNALS:
        yield f"not in both: {len(only) - MAX_SIGNALS} more"
    if bits["first"] is None:
        yield f"bit by bit equal: {bits['compared']} numbers, to t = {bits['until']:.6g} s"
        return
    first = bits["first"]
    yield f"first difference: {_sentence(first)}: {first['run']!r}, reference {first['reference']!r}"
    yield from (f"  then {_sentence(difference)}" for difference in bits["spread"][1:])
    yield "largest difference, over the largest value of that unit:"
    for topic, growth in bits["growth"].items():
        points = list(zip(growth["t"], growth["apart"], strict=True))
        chosen = points[:: max(1, len(points) // 6)]
        yield f"  {topic:20} " + ", ".join(f"{apart:.2g} at {t:.4g} s" for t, apart in chosen)


def _sentence(entry: Mapping[str, Any]) -> str:
    distance = "" if entry["ulps"] is None else f", {entry['ulps']} ULP"
    return f"{entry['instance']}.{entry['variable']} at step {entry['step']}, t = {entry['t']:.6g} s{distance}"
