"""Signals that the checks of a scene name, compared with those of its components before anything is built."""

from __future__ import annotations

from collections.abc import Sequence

from fmus.precompile import component_ports
from fmus.vehicles.tables import BadInput, value_text
from orchestrator.cosim.observers import statistics_names
from orchestrator.cosim.variables import LINK_FAMILIES
from orchestrator.log.signal_names import did_you_mean, worded
from orchestrator.results.measures import FIGURES
from orchestrator.scene.parts import Part
from orchestrator.scene.settings import hint
from orchestrator.scene.system_scene import SystemScene

STATISTICS = "stats."  # signals of the cost of a component


def require_signals(scene: SystemScene, assembled: Sequence[Part]) -> None:
    """Raise BadInput if a check of a scene, of its track model, names a signal that a log of its parts lacks."""
    signals = {name: check.signal for name, check in scene.checks.items() if check.signal is not None}
    parts = {part.name: part for part in assembled}
    for name, signal in signals.items():
        instance = signal.partition(".")[0]
        if signal.startswith(STATISTICS):
            continue
        if instance in parts and parts[instance].fmu is not None:  # a check of what it lacks is not met
            continue
        searched = [parts[instance]] if instance in parts else parts.values()
        known = {one: text for part in searched for one, text in _recorded(scene, part).items()}
        if signal in known:
            continue
        where = f"{scene.where}: expect.{name}.signal = {value_text(signal)}"
        problem = "no such signal" if instance in parts else f"no component '{instance}'"
        if found := worded(signal, known, known):
            near = did_you_mean(found)
        else:
            near = hint(signal, known, "there are") if instance in parts else hint(instance, parts, "there are")
        measure = signal.rpartition(".")[2]
        raise BadInput(f"{where}: {problem}: {near}{f' Or measure = {measure!r}?' * (measure in FIGURES)}")


def _recorded(scene: SystemScene, part: Part) -> dict[str, str]:
    """Signals of a component that a log has, and their descriptions."""
    if not part.kind:  # an FMU of a free system
        return {}
    causalities = ("input", "output") if scene.run.inputs else ("output",)
    ports = component_ports(part.kind, part.config)
    texts = {port.name: port.text for port in ports if port.causality in causalities and isinstance(port.start, float)}
    if scene.records_statistics:
        links = tuple(name for name in texts if name.startswith(LINK_FAMILIES))
        texts |= dict.fromkeys(statistics_names(links), "")
    return {f"{part.name}.{name}": text for name, text in texts.items()}
