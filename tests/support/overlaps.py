"""Find kernels that are declared ``noalias`` and write an array that overlaps another argument.

Run with NUMBA_DISABLE_JIT=1. Prints one JSON object: for each kind of track the number of calls that were checked and a
sentence for each violation.
"""

from __future__ import annotations

import json
import sys
from functools import wraps

import numpy as np

from fmus.kernels import jit

violations: list[str] = []
calls = 0


def without_flat_state(value):
    """Replace the flat state beside its views by None, so that a kernel that uses it fails."""
    if not isinstance(value, tuple):
        return value
    parts = [without_flat_state(part) for part in value]
    if not hasattr(value, "_fields"):
        return tuple(parts)
    copy = type(value)(*parts)
    return copy._replace(flat=None) if {"flat", "mean"} <= set(value._fields) else copy


def arrays(value, name):
    if isinstance(value, np.ndarray):
        yield name, value
    elif isinstance(value, tuple):
        for field, part in zip(getattr(value, "_fields", range(len(value))), value, strict=True):
            yield from arrays(part, f"{name}.{field}")


def check_overlaps(function):
    @wraps(function)
    def wrapped(*args):
        global calls
        calls += 1
        args = [without_flat_state(arg) for arg in args]
        arg_arrays = [pair for k, arg in enumerate(args) for pair in arrays(arg, str(k)) if pair[1].size]
        overlapping = [
            (a, b)
            for k, a in enumerate(arg_arrays)
            for b in arg_arrays[:k]
            if np.shares_memory(a[1], b[1], max_work=10_000)
        ]
        copies = [(a[1].copy(), b[1].copy()) for a, b in overlapping]
        result = function(*args)
        for (a, b), copy in zip(overlapping, copies, strict=True):
            if not all(np.array_equal(x, y[1], equal_nan=True) for x, y in zip(copy, (a, b), strict=True)):
                violations.append(f"{function.__name__} writes {a[0]} over {b[0]}")
        return result

    return wrapped


jit.noalias = check_overlaps

from flexible_track import TABLE, at_rest, make, wheels  # noqa: E402
from named_ports import parameters  # noqa: E402

from fmus.physics.block_cyclic import solve, workspace  # noqa: E402
from fmus.track_rigid.model import Model as Rigid  # noqa: E402

TRACK = {"links": 64, "closed": True, "wheels": wheels(), "ground": True, "gravity": 9.81, "ends": None}
FLEXIBLE = {
    **{element: {"element": element} for element in ("cable", "planar", "beam")},
    "free": {"axes": "free"},
    "constrained": {"joints": "constrained"},
    "spring": {"closure": "spring"},
}
EXPLICIT = {"integrator": "runge_kutta", "start": "polygon"}
RIGID = {"rigid": {"start": "polygon"}, "explicit": EXPLICIT, "recursive": EXPLICIT | {"formulation": "recursive"}}


def steps(kind):
    """Make a step of a track that starts on its wheels, so short that Newton iterates once."""
    if kind in RIGID:
        model = Rigid({"vehicle": TABLE, "track": TRACK})
        model.initialise(parameters(model, **RIGID[kind]))
    else:
        model = make(TRACK, start="polygon", **FLEXIBLE[kind])
    model.step(0.0, 1e-6, at_rest(model))


def overlaps_of(function, *args):
    global calls
    calls = 0
    violations.clear()
    function(*args)
    return {"calls": calls, "found": sorted(set(violations))}


side, blocks = np.ones((4, 3)), np.tile(np.eye(3), (4, 1, 1))
results = {kind: overlaps_of(steps, kind) for kind in sys.argv[1:]}
results["twin"] = overlaps_of(solve, blocks, blocks, workspace(4, 3), False, side, side[::-1])
print(json.dumps(results))
