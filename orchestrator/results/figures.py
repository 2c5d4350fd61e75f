"""Declaration of the figures of a run, from which checks, summary, report, sweep and the page of keys are made.

A figure is a function ``(run, of, window) -> float`` under ``@figure``, in SI units, that raises Missing where a run
has none; ``of`` is a side ("left", "right"), a span, a component, or empty. The first paragraph of its docstring is
its meaning, further ones are the reasons of the bounds that checks have. ``measures.MODULES`` lists the modules.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import ModuleType
from typing import NamedTuple

from fmus.interface.units import conversion
from orchestrator.results.run_data import EVER, RunData, Unrecorded, Window

Value = Callable[[RunData, str, Window], float]
Parts = tuple[str, ...]

ANY: Parts = ()
SIDE, BOTH_SIDES, SPAN = ("", "left", "right"), ("left", "right"), ("upper", "lower")


class Shown(NamedTuple):
    """How summary, report and sweep show a figure, or that of a part of the run."""

    label: str  # in a sentence
    unit: str  # in which it is shown
    digits: int = 4  # that are shown
    on: str = "tracks"  # trait of the scenes that show it: ``execution/summary.traits``; empty: none does
    of: str = ""
    name: str = ""  # empty: that of the figure
    whole: bool = False  # of the whole run: largest value, or difference from start to end; others are means
    by_phase: bool = False  # the text of a summary has it by phase, where a run has phases
    unless: str = ""  # observable that the text of a summary has instead, where it is known
    place: Callable[[RunData], str] | None = None  # words for where and when, after the value; raises Missing

    @property
    def title(self) -> str:
        """Label at the beginning of a line."""
        return f"{self.label[0].upper()}{self.label[1:]}"


@dataclass(frozen=True)
class Figure:
    """Figure that checks and sweeps may name."""

    name: str
    unit: str  # SI; "1" for a ratio or a count
    meaning: str  # a sentence without a full stop
    value: Value
    shown: tuple[Shown, ...] = ()
    of: Parts = ("",)  # parts of which it can be, "" of all or none; ANY for any component
    every_step: bool = False  # it needs outputs and inputs of every step
    whole: bool = False  # it is of the whole run: a check's from is not read, and to is where the run must have been
    group: str = ""  # of link outputs from which it is read, beside the standard ones
    none: str = ""  # words for where a run has none, as "on hard ground"
    reasons: tuple[str, ...] = ()  # paragraphs

    def __call__(self, run: RunData, of: str, window: Window) -> float:
        """Value of a part of a run; raises Unrecorded where it needs more than the log holds, and Missing."""
        if self.every_step:
            every = [run.log.topics[topic].every if topic in run.log.topics else 0
                     for instance in run.instances for topic in (f"/{instance}/in", f"/{instance}/out")]  # fmt: skip
            if not min(every):
                raise Unrecorded(f"{self.name} needs the inputs of every step: run.inputs = true")
            if max(every) > 1:
                raise Unrecorded(f"{self.name} needs the outputs of every step: run.outputs = 1, not {max(every)}")
        return float(self.value(run, of, window))

    def wrong_part(self, of: str) -> str:
        """Sentence if it cannot be of a part, a check's ``of``; empty if it can."""
        if not self.of or of in self.of:
            return ""
        known = " or ".join(f"'{part}'" for part in self.of if part)
        return f"{self.name} {'is' if '' in self.of else 'must be'} of {known or 'no side or part'}"


class RunObservable(NamedTuple):
    """Figure as it is shown."""

    figure: Figure
    shown: Shown

    @property
    def size(self) -> float:
        """Size, in SI units, of the unit in which it is shown; raises ValueError for one of another quantity."""
        return conversion(self.shown.unit, self.figure.unit)[0]

    def value(self, run: RunData, window: Window) -> float:
        """Value over a window, which those of the whole run do not need; raises as the figure."""
        return self.figure(run, self.shown.of, EVER if self.shown.whole else window)


def figure(
    unit: str, *shown: Shown, of: Parts = ("",), every_step: bool = False, whole: bool = False, none: str = ""
) -> Callable[[Value], Figure]:
    """Declare a function as a figure, with the fields of ``Figure``."""

    def declare(value: Value) -> Figure:
        meaning, *reasons = (" ".join(part.replace("``", "").split()) for part in str(value.__doc__).split("\n\n"))
        meaning, name = meaning.rstrip("."), value.__name__
        return Figure(name, unit, meaning, value, shown, of, every_step, whole, none=none, reasons=tuple(reasons))

    return declare


def declared(module: ModuleType) -> Iterator[Figure]:
    """Figures of a module, also those in its tuples, in the order of their declaration."""
    for one in vars(module).values():
        yield from (each for each in (one if isinstance(one, tuple) else (one,)) if isinstance(each, Figure))
