"""Branch of a run: continuation from a checkpoint with changed parameters.

The new FMUs are initialised with the new parameters. Their saved states keep these parameters and take variables,
counters and model states from the checkpoint. The start is not computed again: a link that becomes stiffer keeps its
stretch.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fmus.ground_keys import SLOPES, is_plane
from fmus.saved import SlaveState, from_bytes, to_bytes
from fmus.vehicle import BadInput
from orchestrator.cosim.component import Component
from orchestrator.scene.kinds import Scene
from orchestrator.scene.scene import changed_scene, with_track

MAY_CHANGE = ("run.stop", "run.checkpoints", "run.allow")  # keys of ``run`` that a branch may change


def branched_scene(scene: Scene, settings: Sequence[str], where: str) -> Scene:
    """Return the scene with changed numbers; raises BadInput for a change of anything else."""
    options = "; ".join(settings)
    before = scene.resolved()
    branch = with_track(changed_scene(scene.resolved(), settings, where))
    for key in _start_changes(scene, branch):
        raise BadInput(
            f"--set {options}: where a run branches off, {key} stays as it is: the states of the parts count from the"
            " place and the slope of the start"
        )
    for key in _structural_changes(before, branch.resolved()):
        if not key.startswith("expect") and key not in MAY_CHANGE:
            raise BadInput(
                f"--set {options}: where a run branches off, {key} stays as it is: only numbers of parts change"
            )
    return branch


def _start_changes(scene: Scene, branch: Scene) -> Iterator[str]:
    """Yield keys that would move the axes in which the states of parts are: the start, a slope everywhere."""
    old, new = scene.resolved(), branch.resolved()
    tables = {"start": [*old["start"]]}
    if "ground" in old and is_plane(old["ground"]):
        tables["ground"] = [*SLOPES]
    for table, keys in tables.items():
        yield from (f"{table}.{key}" for key in keys if old[table].get(key) != new[table].get(key))


def _structural_changes(old: Mapping[str, Any], new: Mapping[str, Any], above: str = "") -> Iterator[str]:
    """Yield dotted keys that differ in more than a number, and keys of ``run`` that differ at all."""
    for name in sorted({*old, *new}):
        key, a, b = f"{above}{name}", old.get(name), new.get(name)
        if isinstance(a, Mapping) and isinstance(b, Mapping):
            yield from _structural_changes(a, b, f"{key}.")
        elif a != b and not (_is_numeric(a) and _is_numeric(b) and not key.startswith("run.")):
            yield key


def _is_numeric(value: object) -> bool:
    if isinstance(value, list):
        return all(_is_numeric(item) for item in value)
    return isinstance(value, int | float) and not isinstance(value, bool)


def transferred_state(component: Component, content: bytes, settings: Sequence[str]) -> bytes:
    """Return the state of an initialised component with variables and model state of a saved state.

    ``content``: saved state of a component with other parameters, of which only the parameters are not taken over.
    Raises ValueError if the saved state does not fit.
    """
    state = component.save()
    try:
        new = from_bytes(component.dump(state))
    finally:
        component.free(state)
    old = from_bytes(content)
    if old.flaw:
        return content
    if _sizes(new) != _sizes(old):
        raise ValueError(f"with --set {'; '.join(settings)} the state of '{component.name}' has another size")
    parameters = [
        variable.valueReference
        for variable in component.description.modelVariables
        if variable.type == "Real" and variable.causality == "parameter"
    ]
    values, integers = old.values.copy(), new.integers.copy()
    values[parameters] = new.values[parameters]
    integers[0] = old.integers[0]  # the status; the integers after it are parameters
    return to_bytes(old._replace(guid=new.guid, strings=new.strings, values=values, integers=integers))


def _sizes(state: SlaveState) -> list[int]:
    return [len(part) for part in (state.strings, state.values, state.integers, state.state, state.counters)]
