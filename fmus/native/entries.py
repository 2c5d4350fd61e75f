"""Entries of a component's library: its kernels as functions on pointers, called by the shell.

    start(x, n, f, k, z, p, c, messages)    step(x, n, f, k, z, p, c, messages, t, h, u)
    show(x, n, f, k, z, p, c, y)            show_links(x, n, f, k, z, p, c, y)

x and n are state and counters, f, k and z the blocks of ``freeze``, p the Real parameters, c the indices of String
parameters among their choices, messages their numbers, u the inputs, y the outputs. All return an integer:
0, or the index of the sentence of a failure.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from numba import carray, types

from fmus.interface.model import ComponentModel
from fmus.interface.ports import Port
from fmus.kernels.numba_internals import intermediate_code
from fmus.kernels.numba_internals.references import after, refer
from fmus.native.freeze import NUMBERED, DerivedNumber, Frozen

FLOATS, WHOLE, TRUTHS = (types.CPointer(each) for each in (types.float64, types.int64, types.boolean))
BLOCKS = FLOATS, WHOLE, FLOATS, WHOLE, TRUTHS, FLOATS, WHOLE
START = types.int64(*BLOCKS, FLOATS)
STEP = types.int64(*BLOCKS, FLOATS, types.float64, types.float64, FLOATS)
SHOW = types.int64(*BLOCKS, FLOATS)

SOURCE = """
def start(X, N, F, K, Z, P, C, T):
    {blocks}
    return start_kernel({parts}, carray(T, {rows}), {start_parameters})

def step(X, N, F, K, Z, P, C, T, t, h, U):
    {blocks}
    return step_kernel({parts}, carray(T, {rows}), t, h, carray(U, {inputs}))

def show(X, N, F, K, Z, P, C, Y):
    {blocks}
    output_kernel({output_parts}, carray(Y, {outputs}))
    return 0

def show_links(X, N, F, K, Z, P, C, Y):
    {blocks}
    link_output_kernel({link_output_parts}, carray(Y, {links}))
    return 0
"""


class EntryPoint(NamedTuple):
    """Function of the library, compiled to numba's intermediate code."""

    name: str  # "start", "step", "show" or "show_links"
    text: str  # of LLVM
    symbol: str  # its name there


class Entries(NamedTuple):
    """Functions of a component's library, not yet compiled, and its memory blocks."""

    source: str  # of the functions; equal for all components of a shape
    space: dict[str, Any]  # names in it
    frozen: Frozen  # parts of the component as memory blocks

    def compiled(self) -> tuple[EntryPoint, ...]:
        """Compile the functions."""
        exec(self.source, self.space)
        signatures = {"start": START, "step": STEP, "show": SHOW, "show_links": SHOW}
        known = {name: types_ for name, types_ in signatures.items() if name != "show_links" or self.has_links}
        return tuple(EntryPoint(name, *intermediate_code(self.space[name], types_)) for name, types_ in known.items())

    @property
    def has_links(self) -> bool:
        """Whether there are outputs of links."""
        return self.space["link_output_kernel"] is not None


def free_names(free: Any) -> set[str]:
    """Names of the free parameters, see ``interface.model.FreeParameters``."""
    return {name for how in free.numbers.values() for name in re.findall(r"{([^}]+)}", how)} | set(free.start_only)


def entries(
    model: ComponentModel, numbers: Mapping[str, str], reals: Sequence[Port], choices: Sequence[Port], outputs: int
) -> Entries:
    """Entries of an initialised model with ``outputs`` Real outputs besides those of links.

    ``numbers``: see ``interface.model.FreeParameters``; ``reals``, ``choices``: the Real and String parameters in
    order, with the values of the model. Raises TypeError if the parts lack a number or cannot be written down.
    """
    p = [float(port.start) for port in reals]
    c = [port.choices.index(str(port.start)) if port.choices else 0 for port in choices]
    known = {
        port.name: f"{letter}[{i}]" for letter, row in (("p", reals), ("c", choices)) for i, port in enumerate(row)
    }
    texts = {place: re.sub(r"{([^}]+)}", lambda name: known[name[1]], how) for place, how in numbers.items()}
    values = {place: eval(text.translate(NUMBERED), {"p": p, "c": c}) for place, text in texts.items()}
    derived = {place: DerivedNumber(text, values[place]) for place, text in texts.items()}

    frozen = Frozen(model.state, model.counters, derived)
    parts, output_parts, link_output_parts = map(
        frozen.text, (model.parts, model.output_parts, model.link_output_parts)
    )
    if frozen.unmatched():
        raise TypeError(f"the parts have no {', '.join(sorted(frozen.unmatched()))}")
    messages = model._messages
    sizes = {"X": model.state.size, "N": model.counters.size, **{b.upper(): frozen.block(b).size for b in "fkz"}}
    sizes |= {"P": max(len(p), 1), "C": max(len(c), 1)}
    source = SOURCE.format(
        blocks=", ".join("xnfkzpc") + " = " + ", ".join(f"carray({block}, {size})" for block, size in sizes.items()),
        parts=parts,
        output_parts=output_parts,
        link_output_parts=link_output_parts,
        rows=messages.shape,
        start_parameters=f"({', '.join(known[name] for name in model.start_parameters)},)",
        inputs=model.inputs,
        outputs=outputs,
        links=model.link_ports,
    )
    space: dict[str, Any] = {**frozen.classes, "after": after, "carray": carray, "refer": refer}
    for name in ("start_kernel", "step_kernel", "output_kernel", "link_output_kernel"):
        space[name] = getattr(model, name) if model.link_ports or name != "link_output_kernel" else None
    return Entries(source, space, frozen)
