"""What people and programs read of a run: its summary as lines, and values that JSON knows."""

from __future__ import annotations

from typing import Any


def finite(value: Any) -> Any:
    """JSON knows no NaN."""
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, float) and (value != value or abs(value) == float("inf")):
        return None
    return value


def _error(found: dict[str, Any]) -> str:
    """What a run says of its own error."""
    if found["total"] is None:
        return f"error: not known, {found['message']}"
    most = max(
        (name for name, one in found["observables"].items() if one["decisive"]),
        key=lambda name: found["observables"][name]["total"],
    )
    integration = "not known" if found["integration"] is None else f"{found['integration']:.2g}"
    return (
        f"error: about {found['total']:.2g} of the {most.replace('_', ' ')}, other observables less"
        f" (coupling {found['coupling']:.2g}, integration {integration}; {found['wall_time']:.3g} s more)"
    )


def warning(told: dict[str, Any]) -> str:
    """A component's warning as a line."""
    times = f", {told['count']} times" if told["count"] > 1 else ""
    return f"warning: {told['component']} at {told['time']:.6g} s{times}: {told['text']}"


def summary(result: dict[str, Any]) -> None:
    """A run's summary, on stdout."""
    r = result
    track = f" ({r['track']})" if r["track"] else ""
    print(
        f"{r['scene']}{track}: {r['status']}, {r['simulated_time']:.6g} s in {r['wall_time']:.3g} s"
        f" ({r['real_time_factor']:.3g} x real time), start-up {r['startup_time']:.3g} s"
    )
    for told in r["warnings"]:
        print(f"  {warning(told)}")
    if r["rejected_steps"]:
        print(f"  {r['communication_steps']} steps kept, {r['rejected_steps']} pairs of steps taken back")
    for name, check in r["checks"].items():
        mark = "ok " if check["ok"] else "NOT"
        expected = f"{check['expected']:.7g} +- {check['tolerance']:.3g}"
        note = f" ({check['note']})" if check["note"] else ""
        print(f"  {mark} {name} = {check['value']:.7g}, expected {expected}{note}")
    for name, value in r["observables"].items():
        print(f"      {name} = {value:.7g}")
    if r["energy"]:
        e = r["energy"]
        print(
            f"  energy: work {e['work']:.6g} J = change {e['change']:.6g} + dissipated {e['dissipated']:.6g}"
            f" + covered {e['covered']:.4g} + residual {e['residual']:.4g}"
            f" ({e['residual_relative'] * 100:.3g} %; ports {e['port']:.4g} J)"
        )
    if r["error"]:
        print(f"  {_error(r['error'])}")
    for name, cost in r["components"].items():
        counts = ", ".join(f"{count} {what}" for what, count in cost.items() if what != "wall_time" and count)
        print(f"  {name:12} {cost['wall_time']:8.3f} s  {counts}")
    print(f"  log {r['log']} ({r['log_bytes'] / 1e6:.1f} MB)")
