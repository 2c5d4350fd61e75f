"""Output of ``cotrack compare``: one JSON object, and lines of text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fmus.vehicle import BadInput
from orchestrator.log.bitwise import BitDifference as Bits
from orchestrator.results.difference import Difference
from orchestrator.results.divergence import Divergence
from orchestrator.results.run_data import RunData, Window

SHOWN = 12  # largest number of printed signals that only one log has


def limits(allowed: Sequence[str], apart: Mapping[str, Difference]) -> dict[str, float]:
    """Parse allowed differences, "NAME=RELATIVE" or "RELATIVE", by observable; raises BadInput."""
    found: dict[str, float] = {}
    for text in allowed:
        name, _, number = text.rpartition("=")
        try:
            most = float(number)
        except ValueError:
            most = -1.0
        if not most >= 0.0:
            raise BadInput(f"--allow {text}: must be [NAME=]RELATIVE, a number from 0 on")
        if name and name not in apart:
            raise BadInput(f"--allow {text}: no observable '{name}': one of {', '.join(apart)}")
        found |= {name: most} if name else {each: most for each, one in apart.items() if one.decisive}
    return found


def table(
    run: RunData,
    reference: RunData,
    window: Window,
    apart: Mapping[str, Difference],
    most: Mapping[str, float],
    parted: Divergence | None,
) -> dict[str, Any]:
    """Return the result of a comparison as one JSON object."""
    observables = {
        name: {"unit": one.unit, "rms": one.absolute, "relative": one.relative, "decisive": one.decisive}
        | ({"allowed": most[name], "ok": one.relative <= most[name]} if name in most else {})
        for name, one in apart.items()
    }
    result: dict[str, Any] = {
        "run": _about(run),
        "reference": _about(reference),
        "window": {"from": window.start, "to": window.end},
        "observables": observables,
        "bits": None if parted is None else _bits(parted),
    }
    exceeded = any(not one.get("ok", True) for one in observables.values())
    return result | {"ok": not exceeded and (parted is None or parted.first is None)}


def _about(run: RunData) -> dict[str, Any]:
    about = run.log.metadata.get("run", {})
    return {"log": str(run.log.path), **{key: about.get(key) for key in ("scene", "track", "coupling", "step", "stop")}}


def _bits(parted: Divergence) -> dict[str, Any]:
    return {
        "compared": parted.compared,
        "until": parted.until,
        "first": None if parted.first is None else _place(parted.first),
        "spread": [_place(found) for found in parted.spread],
        "growth": {
            topic: {"t": growth.t.tolist(), "apart": growth.apart.tolist()} for topic, growth in parted.growth.items()
        },
        "only": list(parted.only),
    }


def _place(found: Bits) -> dict[str, Any]:
    names = {"recorded": "run", "replayed": "reference"}
    return {names.get(key, key): value for key, value in found._asdict().items()}


def lines(result: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of text for the result of a comparison."""
    for role, key in (("run", "run"), ("reference", "reference")):
        about = result[key]
        what = ", ".join(str(about[name]) for name in ("scene", "track", "coupling") if about[name])
        step = f", step {about['step']} s" if about["step"] else ""
        yield f"{role:10} {about['log']}: {what}{step}"
    start, end = result["window"]["from"], result["window"]["to"]
    if (start, end) != (float("-inf"), float("inf")):
        yield f"from {start:g} to {end:g} s"
    yield f"{'observable':18} {'RMS':>10}       {'relative':>9}"
    for name, one in result["observables"].items():
        note = "" if one["decisive"] else "  instant by instant: sensitive"
        if "ok" in one:
            note += f"  {'ok' if one['ok'] else 'NOT'}, allowed {one['allowed']:g}"
        yield f"{name:18} {one['rms']:10.3g} {one['unit']:5} {one['relative']:9.2g}{note}"
    if result["bits"] is not None:
        yield from _bit_lines(result["bits"])


def _bit_lines(bits: Mapping[str, Any]) -> Iterator[str]:
    alone = bits["only"]
    yield from (f"not in both: {name}" for name in alone[:SHOWN])
    if len(alone) > SHOWN:
        yield f"not in both: {len(alone) - SHOWN} more"
    if bits["first"] is None:
        yield f"bit by bit equal: {bits['compared']} numbers, to t = {bits['until']:.6g} s"
        return
    first = bits["first"]
    yield f"first difference: {_sentence(first)}: {first['run']!r}, reference {first['reference']!r}"
    yield from (f"  then {_sentence(found)}" for found in bits["spread"][1:])
    yield "largest difference, over the largest value of that unit:"
    for topic, growth in bits["growth"].items():
        points = list(zip(growth["t"], growth["apart"], strict=True))
        chosen = points[:: max(1, len(points) // 6)]
        yield f"  {topic:20} " + ", ".join(f"{apart:.2g} at {t:.4g} s" for t, apart in chosen)


def _sentence(found: Mapping[str, Any]) -> str:
    far = "" if found["ulps"] is None else f", {found['ulps']} ULP"
    return f"{found['instance']}.{found['variable']} at step {found['step']}, t = {found['t']:.6g} s{far}"
