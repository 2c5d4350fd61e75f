"""Variables of an FMU as arrays, by causality and type, with their units, conversions and texts."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.cosim.base_units import UNCHANGED, Conversion, base_unit, unit_of
from orchestrator.cosim.graph import NO_CONVERSIONS, Floats
from orchestrator.cosim.texts import START, Texts
from orchestrator.fmi.model_description import Loadable, has_start_value
from orchestrator.fmi.slave import ComponentFailed, Kind

LINK_FAMILIES = ("link[", "joint[")  # prefixes of per-link outputs, which are read and recorded at their own rate
FMI_TYPES: dict[Kind, tuple[str, ...]] = {
    "Integer": ("Integer", "Enumeration"), "Boolean": ("Boolean",), "String": ("String",),
}  # fmt: skip


class DiscreteGroup(NamedTuple):
    """Connected variables that are exchanged together, behind the Reals of ``u`` or ``y``."""

    kind: Kind
    names: tuple[str, ...]
    place: slice
    references: list[int]
    values: Any  # whole numbers, or a list of bytes
    ranges: Sequence[Any]  # of Loadable.exact_ranges
    is_uint64: NDArray[np.bool_]  # whose values above 2^63 - 1 are less 2^64


def out_of_range(ranges: Sequence[Any], numbers: NDArray[Any], links: Mapping[str, str] = NO_CONVERSIONS) -> str:
    """Words on the first number that is out of its range, by its link if there is one; empty if all are in it."""
    for (name, least, most), number in zip(ranges, numbers.tolist(), strict=True):
        if not least <= number <= most:
            return f"{links.get(name, name)} is {int(number)}: it can be {least} to {most}"
    return ""


def discrete_groups(loaded: Loadable, variables: Sequence[Any], first: int) -> tuple[DiscreteGroup, ...]:
    """Return the variables that are no Reals, by the functions that exchange them, from place ``first`` on."""
    groups = []
    for kind, types in FMI_TYPES.items():
        members = [variable for variable in variables if variable.type in types]
        if members:
            n = len(members)
            values = [b""] * n if kind == "String" else np.zeros(n, loaded.whole)
            names, references = tuple(v.name for v in members), [v.valueReference for v in members]
            place, ranges = slice(first, first + n), loaded.exact_ranges(members)
            groups.append(DiscreteGroup(kind, names, place, references, values, ranges, _are_uint64(loaded, members)))
            first += n
    return tuple(groups)


class Variables:
    """Arrays of an instance: inputs ``u``, outputs ``y``, link outputs ``y_links``, other outputs ``counters``.

    ``received`` are the inputs as their sources output them, ``raw`` the Real outputs as the FMU has them: ``u`` and
    ``y`` where nothing is converted.

    :param loaded: the FMU.
    :param discrete: connected variables that are no Reals, which follow them in ``u`` and ``y``.
    :param conversions: as of ``graph.Instance``, as are the ``units``.
    :param memory: gives an array of n zeros that the FMU's process shares; None: it has none.
    :param is_watched: what the FMU outputs is looked at, as where it exchanges more than Reals in its units.
    :param starts: as of ``graph.Instance``.
    """

    def __init__(
        self,
        name: str,
        loaded: Loadable,
        discrete: Collection[str],
        conversions: Mapping[str, Conversion],
        units: Mapping[str, str],
        memory: Callable[[int], Floats] | None,
        is_watched: bool,
        starts: Sequence[float] = (),
    ) -> None:
        self.name, self.description, self._loaded = name, loaded.description, loaded
        self.conversions, self.converted_units = conversions, units
        self.texts = Texts()  # of its String outputs
        self.input_texts: dict[str, Texts] = {}  # of the sources of String inputs
        self.links_in: dict[str, str] = {}  # connections of discrete inputs, in words
        memory = memory or np.zeros
        variables = self.description.modelVariables
        self.by_name = {v.name: v for v in variables}

        def names(causality: str, kind: str) -> tuple[str, ...]:
            return tuple(v.name for v in variables if v.causality == causality and v.type == kind)

        outputs, self.reals_in = names("output", "Real"), names("input", "Real")
        self.reals_out = tuple(n for n in outputs if not n.startswith(LINK_FAMILIES))
        connected = {
            causality: [v for v in variables if v.causality == causality and v.name in discrete]
            for causality in ("input", "output")
        }
        self.input_groups = discrete_groups(loaded, connected["input"], len(self.reals_in))
        self.output_groups = discrete_groups(loaded, connected["output"], len(self.reals_out))
        self.inputs = (*self.reals_in, *(name for group in self.input_groups for name in group.names))
        self.outputs = (*self.reals_out, *(name for group in self.output_groups for name in group.names))
        self.links = tuple(n for n in outputs if n.startswith(LINK_FAMILIES))
        self.whole = (*names("output", "Integer"), *names("output", "Enumeration"))
        self.truths = names("output", "Boolean")
        self.integers = (*self.whole, *self.truths)
        self.parameters = tuple(v.name for v in variables if v.causality == "parameter")
        constants = {v.name: v.start for v in variables if v.variability == "constant"}
        self._own_texts: set[str] = set()  # constant Strings of an FMU with other starts, which compares them itself
        if len(starts):  # value references of Reals are places among them
            self._own_texts = {name for name in constants if self.by_name[name].type == "String"}
            reals = {name: self.by_name[name] for name in constants if self.by_name[name].type == "Real"}
            constants |= {name: starts[variable.valueReference] for name, variable in reals.items()}
        self.constants = {name: start for name, start in constants.items() if name not in self._own_texts}
        self.u = memory(len(self.inputs))
        self.u[:] = [_start(self.by_name[n]) for n in self.inputs]
        if len(starts):
            self.u[: len(self.reals_in)] = starts[: len(self.reals_in)]
        self.received = self.u.copy() if set(self.inputs) & set(self.conversions) else self.u
        self.y = np.zeros(len(self.outputs))
        self.is_mixed = bool(self.conversions or self.input_groups or self.output_groups or is_watched)
        self.raw = memory(len(self.reals_out)) if self.is_mixed else self.y
        self.y_links = np.zeros(len(self.links))
        self.counters = np.zeros(len(self.integers), dtype=loaded.whole)
        self._ranges = loaded.exact_ranges(self.by_name[name] for name in self.integers)
        self._is_uint64 = _are_uint64(loaded, [self.by_name[name] for name in self.integers])

    def references(self, names: Sequence[str]) -> list[int]:
        """Value references of variables."""
        return [self.by_name[name].valueReference for name in names]

    def require_constant(self, name: str, value: float | int | str) -> None:
        """Raise ComponentFailed for another ``value`` than that of a constant."""
        constant = self.constants[name]
        if value != (constant if isinstance(value, str) else float(constant)):
            raise ComponentFailed(f"{self.name}: '{name}' = {value}: it is a constant of this FMU, {constant}")

    def taken(self, name: str, value: float | int | str, bounded: bool) -> float | int | str:
        """Value of a parameter or start value as the FMU takes it; raises ComponentFailed, as ``Loadable.taken``."""
        is_known = name in self._own_texts or (name in self.by_name and has_start_value(self.by_name[name]))
        if name not in self.parameters and not is_known:
            near = difflib.get_close_matches(name, self.parameters, 1)
            hint = f" (did you mean '{near[0]}'?)" if near else ""
            raise ComponentFailed(f"{self.name}: there is no parameter '{name}'{hint}")
        variable = self.by_name[name]
        if variable.causality == "structuralParameter":
            raise ComponentFailed(f"{self.name}: '{name}' is a structural parameter: arrays keep their sizes")
        try:
            return self._loaded.taken(variable, value, bounded)
        except ValueError as error:
            raise ComponentFailed(f"{self.name}: parameter '{name}' = {value!r}: {error}") from None

    def inexact_counters(self) -> list[str]:
        """Sentences on ``counters`` that logs, which hold doubles, cannot hold; UInt64 become at most 2^63 - 1."""
        if not out_of_range(self._ranges, self.counters):
            return []
        wrapped = self._is_uint64 & (self.counters < 0)
        exact = [number + 2**64 * bool(high) for number, high in zip(self.counters.tolist(), wrapped, strict=True)]
        self.counters[wrapped] = 2**63 - 1
        pairs = zip(self._ranges, exact, self.counters.tolist(), strict=True)
        return [
            f"output '{name}' is {number}, which the log cannot hold: it has {float(held):.0f}"
            for (name, least, most), number, held in pairs
            if not least <= number <= most
        ]

    def unit(self, name: str) -> str:
        """Return the unit of a variable in the arrays, '1' if it has none."""
        return self.converted_units.get(name) or unit_of(self.by_name[name]) or "1"

    def dimension(self, name: str) -> tuple[float, ...] | None:
        """Return the exponents of kg, m, s, A, K, mol, cd and 10 in an output's unit; None if unknown."""
        base, conversion = base_unit(self.description, self.by_name[name]), self.conversions.get(name, UNCHANGED)
        return None if base is None else (*base.exponents, math.log10(base.factor / conversion.factor))

    def recorded_texts(self) -> dict[str, list[str]]:
        """Texts by their numbers in the arrays, for each connected String as "instance.variable"."""
        tables = {name: self.input_texts.get(name, self.texts) for name in self.strings}
        return {f"{self.name}.{name}": texts.words() for name, texts in tables.items()}

    def know_texts(self, texts: Mapping[str, Sequence[str]]) -> None:
        """Number texts as an earlier run did, whose ``recorded_texts`` they are."""
        for name in self.strings:
            known = [text.encode() for text in texts.get(f"{self.name}.{name}", ())]
            if name in self.inputs:
                self.input_texts[name] = Texts(known)
            else:
                for text in known:
                    self.texts.number(text)

    @property
    def strings(self) -> list[str]:
        """Connected Strings."""
        groups = (*self.input_groups, *self.output_groups)
        return [name for group in groups if group.kind == "String" for name in group.names]


def _are_uint64(loaded: Loadable, variables: Sequence[Any]) -> NDArray[np.bool_]:
    return np.array([loaded.own_type(variable) == "UInt64" for variable in variables], bool)


def _start(variable: Any) -> float:
    """Start value of an input in ``u``."""
    if variable.type == "String":
        return START
    return float(variable.start in ("true", "1") if variable.type == "Boolean" else variable.start or 0.0)
