"""Checkpoint: all that a run needs to continue from a communication point, as bytes.

It holds for each component the serialised FMU state, inputs, outputs and warnings; for the coupling its past; for
variable steps the state of the step control. Numbers are stored bit by bit, so a resumed run equals the uninterrupted
one.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.cosim.component import Component
from orchestrator.cosim.coupling.scheme import Scheme
from orchestrator.cosim.graph import Floats
from orchestrator.cosim.messages import ComponentWarning
from orchestrator.fmi.slave import ComponentFailed

_LENGTH = struct.Struct("<Q")
_KINDS = ("<f8", "|u1")
NO_MEMORY: Mapping[str, Floats] = MappingProxyType({})


class UnusableCheckpoint(ValueError):
    """The bytes are no checkpoint of these components; the message is one sentence."""


class CommunicationPoint(NamedTuple):
    """Communication point of a run."""

    k: int  # number of steps done
    t: float  # s
    h: float  # s, length of the last step


def can_save(scheme: Scheme) -> bool:
    """True if every component can serialise its state."""
    return all(
        isinstance(member.component, Component) and member.component.description.coSimulation.canSerializeFMUstate
        for member in scheme.members
    )


def save(scheme: Scheme, point: CommunicationPoint, memory: Mapping[str, Floats] = NO_MEMORY) -> bytes:
    """Serialise the run with the ``memory`` of its step control; raises ComponentFailed."""
    arrays = {"at": np.array(point, dtype=np.float64)} | {f"pace:{name}": values for name, values in memory.items()}
    warnings = {}
    for component in _components(scheme):
        state = component.save()
        try:
            arrays[f"state:{component.name}"] = np.frombuffer(component.dump(state), np.uint8)
            warnings[component.name] = {key: asdict(warning) for key, warning in state.warnings.items()}
        finally:
            component.free(state)
        arrays |= {f"u:{component.name}": component.u, f"y:{component.name}": component.y}
    arrays |= {f"past:{name}": values for name, values in scheme.memory().items()}
    arrays["warned"] = np.frombuffer(json.dumps(warnings).encode(), np.uint8)
    return _bytes(arrays)


def time_of(content: bytes) -> float:
    """Time of a checkpoint, s; raises UnusableCheckpoint."""
    with _decoded(content) as arrays:
        return float(arrays["at"][1])


def states(content: bytes) -> tuple[float, dict[str, bytes]]:
    """Time of a checkpoint, s, and the serialised state of each component; raises UnusableCheckpoint."""
    with _decoded(content) as arrays:
        parts = {name: array.tobytes() for name, array in _named(arrays, "state:").items()}
        return float(arrays["at"][1]), parts


def restore(
    content: bytes,
    scheme: Scheme,
    step: int,
    restore_memory: Callable[[Scheme, Mapping[str, Floats]], None] | None = None,
    adapt_state: Callable[[Component, bytes], bytes] = lambda _, state: state,
) -> CommunicationPoint:
    """Restore initialised components and their coupling from a checkpoint at ``step``; raises UnusableCheckpoint.

    ``restore_memory`` restores the memory of the step control; ``adapt_state`` maps a saved state to what its component
    gets.
    """
    with _decoded(content) as arrays:
        warnings = json.loads(arrays["warned"].tobytes())
        for component in _components(scheme):
            component.free(component.load(adapt_state(component, arrays[f"state:{component.name}"].tobytes())))
            component.u[:] = arrays[f"u:{component.name}"]
            component.y[:] = arrays[f"y:{component.name}"]
            component.set_warnings(_warnings(warnings[component.name]))
        scheme.restore_memory(_named(arrays, "past:"))
        if restore_memory is not None:
            restore_memory(scheme, _named(arrays, "pace:"))
        k, t, h = arrays["at"].tolist()
        if k != step or not 0.0 < h <= t < np.inf:
            raise ValueError(f"it is of step {k:g}, {t:g} s, not of step {step}")
        return CommunicationPoint(step, t, h)


@contextmanager
def _decoded(content: bytes) -> Iterator[Mapping[str, NDArray[Any]]]:
    """Arrays of a checkpoint; every error about them becomes UnusableCheckpoint."""
    try:
        yield _arrays(content)
    except (LookupError, ValueError, TypeError, AttributeError, OverflowError, ComponentFailed) as flaw:
        raise UnusableCheckpoint(f"the checkpoint does not fit these components: {flaw}") from None


def _bytes(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Encode arrays: length of the header, JSON header, data (a zip archive would take 1.5 ms)."""
    head = json.dumps([(name, array.dtype.str, array.shape) for name, array in arrays.items()]).encode()
    return b"".join((_LENGTH.pack(len(head)), head, *(array.tobytes() for array in arrays.values())))


def _arrays(content: bytes) -> dict[str, NDArray[Any]]:
    """Decode arrays; raises ValueError, TypeError, OverflowError."""
    if len(content) < _LENGTH.size:
        raise ValueError("it is cut off")
    offset = _LENGTH.size + _LENGTH.unpack_from(content)[0]
    arrays = {}
    for name, kind, shape in json.loads(content[_LENGTH.size : offset]):
        if kind not in _KINDS:
            raise ValueError(f"an array of {kind!r}")
        count = math.prod(shape)
        arrays[name] = np.frombuffer(content, kind, count, offset).reshape(shape)
        offset += arrays[name].nbytes
    return arrays


def _named(arrays: Mapping[str, Floats], prefix: str) -> dict[str, Floats]:
    return {name.removeprefix(prefix): arrays[name] for name in arrays if name.startswith(prefix)}


def _components(scheme: Scheme) -> list[Component]:
    return [member.component for member in scheme.members if isinstance(member.component, Component)]


def _warnings(entries: Mapping[str, Mapping[str, object]]) -> dict[str, ComponentWarning]:
    return {key: ComponentWarning(**entry) for key, entry in entries.items()}  # type: ignore[arg-type]
