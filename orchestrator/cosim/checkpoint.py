"""Checkpoints: all that a run needs to go on from a communication point, as bytes.

Of every component its serialised FMU state, inputs and outputs and what it has warned of; of the coupling what it
remembers of the past. A number is kept bit by bit, so that a run that goes on is the run that was not interrupted.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import NamedTuple
from zipfile import BadZipFile

import numpy as np

from orchestrator.cosim.component import Component, ComponentFailed
from orchestrator.cosim.coupling.scheme import Scheme
from orchestrator.cosim.warned import Warned


class Unusable(ValueError):
    """These bytes are no checkpoint of these components; the message is one sentence."""


class Point(NamedTuple):
    """Where a run was."""

    k: int  # steps done
    t: float  # s
    h: float  # s, length of the last one


def possible(scheme: Scheme) -> bool:
    """Whether every component can write its state."""
    return all(
        isinstance(member.component, Component) and member.component.description.coSimulation.canSerializeFMUstate
        for member in scheme.members
    )


def save(scheme: Scheme, at: Point) -> bytes:
    """The run as it is; raises ComponentFailed."""
    arrays = {"at": np.array(at, dtype=np.float64)}
    warned = {}
    for component in _components(scheme):
        state = component.save()
        try:
            arrays[f"state:{component.name}"] = np.frombuffer(component.dump(state), np.uint8)
            warned[component.name] = {key: asdict(one) for key, one in state.warned.items()}
        finally:
            component.free(state)
        arrays |= {f"u:{component.name}": component.u, f"y:{component.name}": component.y}
    arrays |= {f"past:{name}": values for name, values in scheme.memory().items()}
    arrays["warned"] = np.frombuffer(json.dumps(warned).encode(), np.uint8)
    content = io.BytesIO()
    np.savez(content, allow_pickle=False, **arrays)
    return content.getvalue()


def restore(content: bytes, scheme: Scheme, step: int) -> Point:
    """Bring initialised components and their coupling to the point after so many steps; raises Unusable."""
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            warned = json.loads(arrays["warned"].tobytes())
            for component in _components(scheme):
                component.free(component.load(arrays[f"state:{component.name}"].tobytes()))
                component.u[:] = arrays[f"u:{component.name}"]
                component.y[:] = arrays[f"y:{component.name}"]
                component.warned_of(_warned(warned[component.name]))
            prefix = "past:"
            scheme.remember({name.removeprefix(prefix): arrays[name] for name in arrays if name.startswith(prefix)})
            k, t, h = arrays["at"].tolist()
            if k != step or not 0.0 < h <= t < np.inf:
                raise ValueError(f"it is of step {k:g}, {t:g} s, not of step {step}")
            return Point(step, t, h)
    except (LookupError, ValueError, TypeError, AttributeError, OSError, EOFError, BadZipFile, ComponentFailed) as flaw:
        raise Unusable(f"the checkpoint does not fit these components: {flaw}") from None


def _components(scheme: Scheme) -> list[Component]:
    return [member.component for member in scheme.members if isinstance(member.component, Component)]


def _warned(found: Mapping[str, Mapping[str, object]]) -> dict[str, Warned]:
    return {key: Warned(**one) for key, one in found.items()}  # type: ignore[arg-type]
