"""Branch of a run: continuation from a checkpoint with changed parameters.

The new FMUs are initialised with the new parameters. Their saved states keep these parameters and take variables,
counters and model states from the checkpoint. The start is not computed again: a link that becomes stiffer keeps its
stretch.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fmus.saved import SlaveState, from_bytes, to_bytes
from fmus.vehicle import BadInput
from orchestrator.cosim.component import Component
from orchestrator.scene.scene import Scene, changed

MAY_CHANGE = ("run.stop", "run.checkpoints", "run.allow")  # keys of ``run`` that a branch may change


def branched(scene: Scene, settings: Sequence[str], where: str) -> Scene:
    """Return the scene with changed numbers; raises BadInput for a change of anything else."""
    said = "; ".join(settings)
    before = scene.resolved()
    found = changed(scene.resolved(), settings, where)
    for key in _more_than_numbers(before, found.resolved()):
        if not key.startswith("expect") and key not in MAY_CHANGE:
            raise BadInput(
                f"--set {said}: where a run branches off, {key} stays as it is: only numbers of parts change"
            )
    return found


def _more_than_numbers(one: Mapping[str, Any], other: Mapping[str, Any], above: str = "") -> Iterator[str]:
    """Yield dotted keys that differ in more than a number, and keys of ``run`` that differ at all."""
    for name in sorted({*one, *other}):
        key, a, b = f"{above}{name}", one.get(name), other.get(name)
        if isinstance(a, Mapping) and isinstance(b, Mapping):
            yield from _more_than_numbers(a, b, f"{key}.")
        elif a != b and not (_numbers(a) and _numbers(b) and not key.startswith("run.")):
            yield key


def _numbers(value: object) -> bool:
    if isinstance(value, list):
        return all(_numbers(each) for each in value)
    return isinstance(value, int | float) and not isinstance(value, bool)


def taken_over(component: Component, content: bytes, settings: Sequence[str]) -> bytes:
    """Return the state of an initialised component with variables and model state of a saved state.

    ``content``: saved state of a component with other parameters, of which only the parameters are not taken over.
    Raises ValueError if the saved state does not fit.
    """
    own = component.save()
    try:
        now = from_bytes(component.dump(own))
    finally:
        component.free(own)
    before = from_bytes(content)
    if before.flaw:
        return content
    if _sizes(now) != _sizes(before):
        raise ValueError(f"with --set {'; '.join(settings)} the state of '{component.name}' has another size")
    parameters = [
        variable.valueReference
        for variable in component.description.modelVariables
        if variable.type == "Real" and variable.causality == "parameter"
    ]
    values, integers = before.values.copy(), now.integers.copy()
    values[parameters] = now.values[parameters]
    integers[0] = before.integers[0]  # the status; the integers after it are parameters
    return to_bytes(before._replace(guid=now.guid, strings=now.strings, values=values, integers=integers))


def _sizes(state: SlaveState) -> list[int]:
    return [len(part) for part in (state.strings, state.values, state.integers, state.state, state.counters)]
