"""A component's kernels as functions on pointers: what its library's shell calls.

    step(x, n, f, k, z, told, t, h, u)    show(x, n, f, k, z, y)    show_links(x, n, f, k, z, y)

x and n are state and counters, f, k and z the blocks of ``freeze``; all return an integer.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numba
from numba import carray, types

from fmus.model import Component
from fmus.native.freeze import Frozen

FLOATS, WHOLE, TRUTHS = (types.CPointer(each) for each in (types.float64, types.int64, types.boolean))
BLOCKS = FLOATS, WHOLE, FLOATS, WHOLE, TRUTHS
STEP = types.int64(*BLOCKS, FLOATS, types.float64, types.float64, FLOATS)
SHOW = types.int64(*BLOCKS, FLOATS)

SOURCE = """
def step(X, N, F, K, Z, T, t, h, U):
    {blocks}
    return stepping({parts}, carray(T, {told}).reshape({rows}), t, h, carray(U, {inputs}))

def show(X, N, F, K, Z, Y):
    {blocks}
    showing({shown}, carray(Y, {outputs}))
    return 0

def show_links(X, N, F, K, Z, Y):
    {blocks}
    showing_links({shown_links}, carray(Y, {links}))
    return 0
"""


class Entry(NamedTuple):
    """A function of the library, compiled as far as numba's intermediate code."""

    name: str
    compiled: Any  # numba's CompileResult


class Entries(NamedTuple):
    """What the library of a component is made of."""

    entries: tuple[Entry, ...]
    frozen: Frozen


def entries(model: Component, outputs: int) -> Entries:
    """Of an initialised model with so many Real outputs that are not those of links."""
    frozen = Frozen(model.state, model.counters)
    parts, shown, shown_links = map(frozen.text, (model.parts, model.shown, model.shown_links))
    told = model._told
    sizes = {"X": model.state.size, "N": model.counters.size, **{b.upper(): frozen.block(b).size for b in "fkz"}}
    source = SOURCE.format(
        blocks=", ".join("xnfkz") + " = " + ", ".join(f"carray({block}, {size})" for block, size in sizes.items()),
        parts=parts,
        shown=shown,
        shown_links=shown_links,
        told=told.size,
        rows=told.shape,
        inputs=model.inputs,
        outputs=outputs,
        links=model.link_ports,
    )
    space: dict[str, Any] = {**frozen.classes, "carray": carray}
    for name in ("stepping", "showing", "showing_links"):
        space[name] = getattr(model, name)
    exec(source, space)
    wanted = {"step": STEP, "show": SHOW, **({"show_links": SHOW} if model.link_ports else {})}
    return Entries(tuple(Entry(name, _compiled(space[name], types_)) for name, types_ in wanted.items()), frozen)


def _compiled(function: Callable[..., int], signature: Any) -> Any:
    options: dict[str, Any] = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    dispatcher: Any = numba.njit(nogil=True, **options)(function)
    dispatcher.compile(signature)
    (compiled,) = dispatcher.overloads.values()
    return compiled
