"""Exchange with an FMU whose connections carry more than Reals in its own units.

The arrays of a component hold doubles, the Reals first:

| variable | value in ``u`` and ``y`` |
| --- | --- |
| Real | its value; a converted input as the FMU gets it, a converted output as others get it |
| Integer, Enumeration | its value |
| Boolean | 0 or 1 |
| String | number of the text in the ``Texts`` of its source; START: the start value |

``write`` and ``read`` have the signatures of fmi2SetReal and fmi2GetReal, so that kernels call them in their place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from ctypes import CFUNCTYPE, POINTER, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.cosim.base_units import Conversion
from orchestrator.cosim.graph import NO_CONVERSIONS, ComponentFailed, Floats
from orchestrator.cosim.messages import ERROR, FATAL, WARNING, Hear
from orchestrator.cosim.model_description import Loadable

START = -1.0  # number of the start value of a String
KINDS = {"Integer": ("Integer", "Enumeration"), "Boolean": ("Boolean",), "String": ("String",)}
FUNCTION = CFUNCTYPE(c_int, c_void_p, POINTER(c_uint), c_size_t, POINTER(c_double))


class Texts:
    """Texts of the String outputs of a component, numbered in the order of their first appearance."""

    def __init__(self, known: Iterable[bytes] = ()) -> None:
        self._numbers = {text: number for number, text in enumerate(known)}
        self._texts = list(self._numbers)

    def number(self, text: bytes) -> int:
        """Return the number of a text, which is added if it is new."""
        if text not in self._numbers:
            self._numbers[text] = len(self._texts)
            self._texts.append(text)
        return self._numbers[text]

    def text(self, number: float) -> bytes:
        """Return a text by its number; raises ComponentFailed."""
        if not 0 <= number < len(self._texts):
            raise ComponentFailed(f"there is no text of the number {number:g}")
        return self._texts[int(number)]

    def words(self) -> list[str]:
        """Return all texts by their numbers."""
        return [text.decode("utf-8", "replace") for text in self._texts]


class DiscreteGroup(NamedTuple):
    """Connected variables of one FMI function behind the Reals of ``u`` or ``y``."""

    kind: str  # of KINDS
    names: tuple[str, ...]
    place: slice
    references: Any
    values: Any  # array of the C type of the function
    ranges: Sequence[Any]  # of Loadable.exact_ranges


def misfit(ranges: Sequence[Any], numbers: NDArray[Any], links: Mapping[str, str] = NO_CONVERSIONS) -> str:
    """Words on the first number that is out of its range, by its link if there is one; empty if all are in it."""
    for (name, least, most), number in zip(ranges, numbers.tolist(), strict=True):
        if not least <= number <= most:
            return f"{links.get(name, name)} is {int(number)}: it can be {least} to {most}"
    return ""


def discrete_groups(loaded: Loadable, variables: Sequence[Any], first: int) -> tuple[DiscreteGroup, ...]:
    """Return the variables that are no Reals, by the functions that exchange them, from place ``first`` on."""
    groups = []
    for kind, types in KINDS.items():
        members = [variable for variable in variables if variable.type in types]
        if members:
            references = (c_uint * len(members))(*(variable.valueReference for variable in members))
            values = ((c_char_p if kind == "String" else loaded.whole) * len(members))()
            place, ranges = slice(first, first + len(members)), loaded.exact_ranges(members)
            groups.append(DiscreteGroup(kind, tuple(v.name for v in members), place, references, values, ranges))
            first += len(members)
    return tuple(groups)


class ConvertedReals:
    """Conversions of some values of an array."""

    def __init__(self, names: Sequence[str], conversions: Mapping[str, Conversion]) -> None:
        found = {k: conversions[name] for k, name in enumerate(names) if name in conversions}
        self._at = np.array([*found], dtype=np.intp)
        self._factors, self._offsets = (np.array([each[part] for each in found.values()]) for part in (0, 1))

    def convert(self, values: Floats, into: Floats) -> None:
        """Copy values, of which some are converted; none of them changes by a bit otherwise."""
        into[:] = values
        if not self._at.size:
            return
        into[self._at] = self._factors * values[self._at] + self._offsets


class MixedInputs(NamedTuple):
    """Inputs of a component."""

    received: Floats  # as the sources output them
    u: Floats  # as the FMU gets them
    reals: tuple[Any, int, Any]  # value references, their number, values
    conversions: ConvertedReals
    groups: tuple[DiscreteGroup, ...]
    starts: Mapping[str, bytes]  # of Strings
    texts: Mapping[str, Texts]  # of the sources of Strings
    links: Mapping[str, str]  # by input, in words


class MixedOutputs(NamedTuple):
    """Outputs of a component."""

    raw: Floats  # Reals as the FMU outputs them
    y: Floats
    conversions: ConvertedReals
    groups: tuple[DiscreteGroup, ...]
    texts: Texts


class MixedExchange:
    """Exchange of all inputs and outputs of an instance; each call returns an FMI status.

    ``failed``: name of the FMI function that failed in the last call, empty if none did. ``check`` looks at Reals that
    have been got, and returns an FMI status. ``say``: where messages go.
    """

    def __init__(
        self,
        library: Any,
        inputs: MixedInputs,
        outputs: MixedOutputs,
        say: Hear,
        check: Callable[[Floats], int] | None = None,
    ) -> None:
        self._library, self._inputs, self._outputs, self._say, self._check = library, inputs, outputs, say, check
        self.failed = ""
        self.raised: BaseException | None = None  # in a call by kernels
        self._functions = FUNCTION(guarded(self.write, self)), FUNCTION(guarded(self.read, self))

    @property
    def addresses(self) -> tuple[Any, Any]:
        """``write`` and ``read`` as C functions."""
        return self._functions

    def write(self, instance: int, *_: Any) -> int:
        """Convert what is received, and set it."""
        self._inputs.conversions.convert(self._inputs.received, self._inputs.u)
        return self.set_inputs(instance)

    def set_inputs(self, instance: int) -> int:
        """Set the inputs of ``u``."""
        self.failed = ""
        status = self._call("fmi2SetReal", instance, *self._inputs.reals)
        for kind, names, place, references, values, ranges in self._inputs.groups:
            if not 0 <= status <= WARNING:
                break
            numbers = self._inputs.u[place]
            if kind == "Integer" and (sentence := misfit(ranges, numbers, self._inputs.links)):
                self.failed = "fmi2DoStep"
                self._say(ERROR, sentence, "")
                return ERROR
            if kind == "String":
                values[:] = [self._text(name, number) for name, number in zip(names, numbers, strict=True)]
            else:
                _integers(values)[:] = numbers
            status = _worse(status, self._call(f"fmi2Set{kind}", instance, references, len(names), values))
        return status

    def _text(self, name: str, number: float) -> bytes:
        return self._inputs.starts[name] if number == START else self._inputs.texts[name].text(number)

    def read(self, instance: int, references: Any, n: int, values: Any) -> int:
        """Get Reals as fmi2GetReal does, then ``y`` from ``raw`` and the other outputs."""
        self.failed = ""
        raw, y, conversions, groups, texts = self._outputs
        status = self._call("fmi2GetReal", instance, references, n, values)
        if self._check is not None and n and 0 <= status <= WARNING:
            status = _worse(status, self._check(raw if n == len(raw) else np.ctypeslib.as_array(values, (n,))))
        if not 0 <= status <= WARNING:
            self.failed = "fmi2GetReal"
        conversions.convert(raw, y[: len(raw)])
        for kind, names, place, numbers, found, _ in groups:
            if not 0 <= status <= WARNING:
                break
            status = _worse(status, self._call(f"fmi2Get{kind}", instance, numbers, len(names), found))
            if kind == "String":
                y[place] = [texts.number(text or b"") for text in found]
            else:
                y[place] = _integers(found) != 0 if kind == "Boolean" else _integers(found)
        return status

    def _call(self, name: str, instance: int, references: Any, n: int, values: Any) -> int:
        function: Callable[..., int] = getattr(self._library, name)
        status = function(instance, references, n, values) if n else 0
        if not 0 <= status <= WARNING:
            self.failed = name
        return status


def guarded(function: Callable[..., int], exchange: MixedExchange | None) -> Callable[..., int]:
    """Function for kernels, in which nothing may be raised: ``exchange`` keeps the error, and the status is Fatal."""

    def call(*arguments: Any) -> int:
        try:
            return function(*arguments)
        except BaseException as error:
            if exchange is not None:
                exchange.raised = error
            return FATAL

    return call


def _worse(one: int, other: int) -> int:
    """The worse of two FMI statuses, of which negative ones are none."""
    return min(one, other) if min(one, other) < 0 else max(one, other)


def _integers(values: Any) -> NDArray[np.signedinteger[Any]]:
    return np.ctypeslib.as_array(values)
