"""Checkpoints: all that a run needs to go on from a communication point, as bytes.

Of every component its serialised FMU state, inputs and outputs and what it has warned of; of the coupling what it
remembers of the past; of variable steps what chooses their length. A number is kept bit by bit, so that a run that goes
on is the run that was not interrupted.
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

from orchestrator.cosim.component import Component, ComponentFailed
from orchestrator.cosim.coupling.scheme import Scheme
from orchestrator.cosim.graph import Floats
from orchestrator.cosim.warned import Warned

_LENGTH = struct.Struct("<Q")
_KINDS = ("<f8", "|u1")
NOTHING: Mapping[str, Floats] = MappingProxyType({})


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


def save(scheme: Scheme, at: Point, pace: Mapping[str, Floats] = NOTHING) -> bytes:
    """The run as it is, with what its ``pace`` remembers; raises ComponentFailed."""
    arrays = {"at": np.array(at, dtype=np.float64)} | {f"pace:{name}": values for name, values in pace.items()}
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
    return _bytes(arrays)


def time_of(content: bytes) -> float:
    """When a checkpoint was made, s; raises Unusable."""
    with _readable(content) as arrays:
        return float(arrays["at"][1])


def states(content: bytes) -> tuple[float, dict[str, bytes]]:
    """When a checkpoint was made, s, and by component the state that it serialised; raises Unusable."""
    with _readable(content) as arrays:
        found = {name: array.tobytes() for name, array in _named(arrays, "state:").items()}
        return float(arrays["at"][1]), found


def restore(
    content: bytes,
    scheme: Scheme,
    step: int,
    pace: Callable[[Scheme, Mapping[str, Floats]], None] | None = None,
    made: Callable[[Component, bytes], bytes] = lambda _, state: state,
) -> Point:
    """Bring initialised components and their coupling to the point after so many steps; raises Unusable.

    ``pace`` is told what the pace of the run remembered; ``made``: what a component is given of its saved state.
    """
    with _readable(content) as arrays:
        warned = json.loads(arrays["warned"].tobytes())
        for component in _components(scheme):
            component.free(component.load(made(component, arrays[f"state:{component.name}"].tobytes())))
            component.u[:] = arrays[f"u:{component.name}"]
            component.y[:] = arrays[f"y:{component.name}"]
            component.warned_of(_warned(warned[component.name]))
        scheme.remember(_named(arrays, "past:"))
        if pace is not None:
            pace(scheme, _named(arrays, "pace:"))
        k, t, h = arrays["at"].tolist()
        if k != step or not 0.0 < h <= t < np.inf:
            raise ValueError(f"it is of step {k:g}, {t:g} s, not of step {step}")
        return Point(step, t, h)


@contextmanager
def _readable(content: bytes) -> Iterator[Mapping[str, NDArray[Any]]]:
    """The arrays of a checkpoint; whatever is wrong with them becomes Unusable."""
    try:
        yield _arrays(content)
    except (LookupError, ValueError, TypeError, AttributeError, OverflowError, ComponentFailed) as flaw:
        raise Unusable(f"the checkpoint does not fit these components: {flaw}") from None


def _bytes(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """A length, as JSON what arrays there are, then these. A zip archive takes 1.5 ms, which every checkpoint costs."""
    head = json.dumps([(name, array.dtype.str, array.shape) for name, array in arrays.items()]).encode()
    return b"".join((_LENGTH.pack(len(head)), head, *(array.tobytes() for array in arrays.values())))


def _arrays(content: bytes) -> dict[str, NDArray[Any]]:
    """The reverse; raises ValueError, TypeError, OverflowError."""
    if len(content) < _LENGTH.size:
        raise ValueError("it is cut off")
    at = _LENGTH.size + _LENGTH.unpack_from(content)[0]
    arrays = {}
    for name, kind, shape in json.loads(content[_LENGTH.size : at]):
        if kind not in _KINDS:
            raise ValueError(f"an array of {kind!r}")
        count = math.prod(shape)
        arrays[name] = np.frombuffer(content, kind, count, at).reshape(shape)
        at += arrays[name].nbytes
    return arrays


def _named(arrays: Mapping[str, Floats], prefix: str) -> dict[str, Floats]:
    return {name.removeprefix(prefix): arrays[name] for name in arrays if name.startswith(prefix)}


def _components(scheme: Scheme) -> list[Component]:
    return [member.component for member in scheme.members if isinstance(member.component, Component)]


def _warned(found: Mapping[str, Mapping[str, object]]) -> dict[str, Warned]:
    return {key: Warned(**one) for key, one in found.items()}  # type: ignore[arg-type]
