"""Exchange with an FMU whose connections carry more than Reals in its own units.

The arrays of a component hold doubles, the Reals first:

| variable | value in ``u`` and ``y`` |
| --- | --- |
| Real | its value; a converted input as the FMU gets it, a converted output as others get it |
| Integer, Enumeration | its value |
| Boolean | 0 or 1 |
| String | number of the text in the ``Texts`` of its source; START: the start value |
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from orchestrator.cosim.base_units import Conversion
from orchestrator.cosim.graph import Floats
from orchestrator.cosim.texts import START
from orchestrator.cosim.variables import DiscreteGroup, Variables, out_of_range
from orchestrator.fmi.slave import ERROR, WARNING, Exchange, LogCallback, Slave, failed, worse


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


class MixedExchange:
    """Exchange of all inputs and outputs of a slave; each call returns an FMI status.

    :param reals: exchanges of the Real inputs, the Real outputs, and the link outputs.
    :param say: where messages go.
    :param non_finite: of ``graph.ImportSettings``: what an output that is no number means; None: nobody looks.
    """

    def __init__(
        self,
        slave: Slave,
        variables: Variables,
        reals: tuple[Exchange, Exchange, Exchange],
        say: LogCallback,
        non_finite: str | None = None,
    ) -> None:
        self._slave, self._variables, self._say, self._non_finite = slave, variables, say, non_finite
        self._inputs, self._outputs, self._links = reals
        self._groups_in, self._groups_out = (
            [(group, slave.exchange(group.kind, group.references, group.values)) for group in groups]
            for groups in (variables.input_groups, variables.output_groups)
        )
        self._converted_in = ConvertedReals(variables.inputs, variables.conversions)
        self._converted_out = ConvertedReals(variables.outputs, variables.conversions)
        self._starts = {name: (variables.by_name[name].start or "").encode() for name in variables.strings}

    def write(self) -> int:
        """Convert what is received, and set it."""
        self._converted_in.convert(self._variables.received, self._variables.u)
        return self.set_inputs()

    def set_inputs(self) -> int:
        """Set the inputs of ``u``."""
        status = self._inputs.set()
        for group, exchange in self._groups_in:
            if failed(status):
                break
            numbers = self._variables.u[group.place]
            if group.kind == "Integer" and (sentence := out_of_range(group.ranges, numbers, self._variables.links_in)):
                self._slave.failed = self._slave.functions["step"]
                self._say(ERROR, sentence, "")
                return ERROR
            group.values[:] = self._texts(group, numbers) if group.kind == "String" else numbers
            status = worse(status, exchange.set())
        return status

    def _texts(self, group: DiscreteGroup, numbers: Floats) -> list[bytes]:
        known = self._variables.input_texts
        pairs = zip(group.names, numbers, strict=True)
        return [self._starts[name] if number == START else known[name].text(number) for name, number in pairs]

    def read(self) -> int:
        """Get Reals, then ``y`` from ``raw`` and the other outputs."""
        variables = self._variables
        status = self._checked(self._outputs, variables.outputs, variables.raw)
        self._converted_out.convert(variables.raw, variables.y[: len(variables.raw)])
        for group, exchange in self._groups_out:
            if failed(status):
                break
            status = worse(status, exchange.get())
            if group.kind == "String":
                variables.y[group.place] = [variables.texts.number(text) for text in group.values]
            elif group.kind == "Boolean":
                variables.y[group.place] = group.values != 0
            else:
                variables.y[group.place] = group.values + 2.0**64 * (group.is_uint64 & (group.values < 0))
        return status

    def read_links(self) -> int:
        """Get link outputs."""
        return self._checked(self._links, self._variables.links, self._variables.y_links)

    def _checked(self, exchange: Exchange, names: Sequence[str], values: Floats) -> int:
        status = exchange.get()
        if self._non_finite is None or failed(status) or np.isfinite(values).all():
            return status
        where = int(np.flatnonzero(~np.isfinite(values))[0])
        sentence = f"output '{names[where]}' is {values[where]}"
        if self._non_finite == "warn":
            self._say(WARNING, sentence, "")
            return worse(status, WARNING)
        self._say(ERROR, f'{sentence} (fmu.{self._variables.name}.non_finite = "warn" lets the run go on)', "")
        self._slave.failed = exchange.function("Get")
        return ERROR
