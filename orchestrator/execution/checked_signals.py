"""Signals that the checks of a scene name, compared with those of its components before anything is built."""

from __future__ import annotations

from fmus.loaded import component_ports
from fmus.vehicle import BadInput, value_text
from orchestrator.cosim import interval_statistics
from orchestrator.cosim.component import LINK_FAMILIES
from orchestrator.scene.assembly import assemble
from orchestrator.scene.gallery import hint
from orchestrator.scene.parts import Part
from orchestrator.scene.scene import Scene

STATISTICS = "stats."  # signals of the cost of a component


def require_signals(scene: Scene) -> None:
    """Raise BadInput if a check of a scene, of its track model, names a signal that a log of the scene lacks."""
    checks = {name: check for name, check in scene.expect.items() if check.track in (None, scene.variant)}
    signals = {name: check.signal for name, check in checks.items() if check.signal is not None}
    parts = {part.name: part for part in assemble(scene).parts} if signals else {}
    for name, signal in signals.items():
        instance, _, variable = signal.partition(".")
        where = f"{scene.name}.toml: expect.{name}.signal = {value_text(signal)}"
        if signal.startswith(STATISTICS):
            continue
        if instance not in parts:
            raise BadInput(f"{where}: no component '{instance}': {hint(instance, parts, 'there are')}")
        known = _recorded(scene, parts[instance])
        if variable not in known:
            near = hint(signal, [f"{instance}.{one}" for one in known], "there are")
            raise BadInput(f"{where}: no such signal: {near}")


def _recorded(scene: Scene, part: Part) -> list[str]:
    """Variables of a component that a log has."""
    causalities = ("input", "output") if scene.run.inputs else ("output",)
    ports = component_ports(part.kind, part.config)
    names = [port.name for port in ports if port.causality in causalities and isinstance(port.start, float)]
    links = tuple(name for name in names if name.startswith(LINK_FAMILIES))
    return [*names, *(interval_statistics.names(links) if scene.records_statistics else ())]
