"""Variables of an FMU as arrays, by causality and type, with their units, conversions and texts."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from ctypes import POINTER, c_double, c_uint
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.cosim.base_units import UNCHANGED, Conversion, base_unit, unit_of
from orchestrator.cosim.graph import Floats
from orchestrator.cosim.mixed_exchange import START, Texts, discrete_groups

LINK_FAMILIES = ("link[", "joint[")  # prefixes of per-link outputs, which are read and recorded at their own rate


class VariableArrays:
    """Arrays of an instance: inputs ``u``, outputs ``y``, link outputs ``y_links``, other outputs ``counters``.

    ``loaded``: its FMU. ``discrete``: connected variables that are no Reals, which follow them in ``u`` and ``y``.
    ``conversions`` and ``units``: as of ``graph.Instance``. ``memory``: gives an array of n zeros that the FMU's
    process shares, and its place there; None: it has none. ``is_watched``: what the FMU outputs is looked at, as
    where it exchanges more than Reals in its units.
    """

    def __init__(
        self,
        name: str,
        loaded: Any,
        discrete: Collection[str],
        conversions: Mapping[str, Conversion],
        units: Mapping[str, str],
        memory: Callable[[int], tuple[Floats, int]] | None,
        is_watched: bool,
    ) -> None:
        self.name, self.description = name, loaded.description
        self.conversions, self.converted_units = conversions, units
        self.texts = Texts()  # of its String outputs
        self.input_texts: dict[str, Texts] = {}  # of the sources of String inputs
        self.links_in: dict[str, str] = {}  # connections of discrete inputs, in words
        memory = memory or (lambda n: (np.zeros(n), 0))
        variables = self.description.modelVariables
        self._variables = {v.name: v for v in variables}

        def names(causality: str, kind: str) -> tuple[str, ...]:
            return tuple(v.name for v in variables if v.causality == causality and v.type == kind)

        outputs, reals_in = names("output", "Real"), names("input", "Real")
        reals_out = tuple(n for n in outputs if not n.startswith(LINK_FAMILIES))
        connected = {
            causality: [v for v in variables if v.causality == causality and v.name in discrete]
            for causality in ("input", "output")
        }
        self._input_groups = discrete_groups(loaded, connected["input"], len(reals_in))
        self._output_groups = discrete_groups(loaded, connected["output"], len(reals_out))
        self.inputs = (*reals_in, *(name for group in self._input_groups for name in group.names))
        self.outputs = (*reals_out, *(name for group in self._output_groups for name in group.names))
        self.links = tuple(n for n in outputs if n.startswith(LINK_FAMILIES))
        whole, truths = (*names("output", "Integer"), *names("output", "Enumeration")), names("output", "Boolean")
        self.integers = (*whole, *truths)
        self.parameters = tuple(v.name for v in variables if v.causality == "parameter")
        self.constants = {v.name: v.start for v in variables if v.variability == "constant"}
        self.u, self._u_place = memory(len(self.inputs))
        self.u[:] = [_start(self._variables[n]) for n in self.inputs]
        self.received = self.u.copy() if set(self.inputs) & set(self.conversions) else self.u
        self.y = np.zeros(len(self.outputs))
        self._is_mixed = bool(self.conversions or self._input_groups or self._output_groups or is_watched)
        raw, self._raw_place = memory(len(reals_out))
        raw = raw if self._is_mixed else self.y
        self.y_links = np.zeros(len(self.links))
        self.counters = np.zeros(len(self.integers), dtype=loaded.whole)
        self._ranges = loaded.exact_ranges(self._variables[name] for name in self.integers)
        self._arrays: tuple[NDArray[Any], ...] = (self.u, self.y, self.y_links, self.counters)
        self._u = self._group(reals_in, self.u, c_double)
        self._y = self._group(reals_out, raw, c_double)
        self._raw = raw
        self._y_links = self._group(self.links, self.y_links, c_double)
        self._counters = self._group(whole, self.counters, loaded.whole)
        self._truth_values = self._group(truths, self.counters[len(whole) :], loaded.whole)

    def _group(self, names: tuple[str, ...], values: NDArray[Any], kind: type) -> tuple[Any, int, Any]:
        return self._references(names), len(names), values.ctypes.data_as(POINTER(kind))

    def _references(self, names: tuple[str, ...]) -> Any:
        return (c_uint * len(names))(*(self._variables[name].valueReference for name in names))

    def unit(self, name: str) -> str:
        """Return the unit of a variable in the arrays, '1' if it has none."""
        return self.converted_units.get(name) or unit_of(self._variables[name]) or "1"

    def dimension(self, name: str) -> tuple[float, ...] | None:
        """Return the exponents of kg, m, s, A, K, mol, cd and 10 in an output's unit; None if unknown."""
        base, conversion = base_unit(self.description, self._variables[name]), self.conversions.get(name, UNCHANGED)
        return None if base is None else (*base.exponents, math.log10(base.factor / conversion.factor))

    def recorded_texts(self) -> dict[str, list[str]]:
        """Texts by their numbers in the arrays, for each connected String as "instance.variable"."""
        tables = {name: self.input_texts.get(name, self.texts) for name in self._strings}
        return {f"{self.name}.{name}": texts.words() for name, texts in tables.items()}

    def know_texts(self, texts: Mapping[str, Sequence[str]]) -> None:
        """Number texts as an earlier run did, whose ``recorded_texts`` they are."""
        for name in self._strings:
            known = [text.encode() for text in texts.get(f"{self.name}.{name}", ())]
            if name in self.inputs:
                self.input_texts[name] = Texts(known)
            else:
                for text in known:
                    self.texts.number(text)

    @property
    def _strings(self) -> list[str]:
        groups = (*self._input_groups, *self._output_groups)
        return [name for group in groups if group.kind == "String" for name in group.names]


def _start(variable: Any) -> float:
    """Start value of an input in ``u``."""
    if variable.type == "String":
        return START
    return float(variable.start in ("true", "1") if variable.type == "Boolean" else variable.start or 0.0)
