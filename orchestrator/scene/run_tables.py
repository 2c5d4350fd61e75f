"""Table ``[run]``: duration, steps, coupling, recording."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from fmus.vehicle import FrozenTable, In, ratio
from orchestrator.log.message_records import MOST_STEPS
from orchestrator.results.validity.limits import ALLOWED
from orchestrator.scene.values import OR_FALSE, Duration, Every, Time

if TYPE_CHECKING:
    Allowed = str
else:
    Allowed = Literal[tuple(ALLOWED)]

SchemeName = Literal["tracks_first", "jacobi", "gauss_seidel", "iterative", "energy_corrected"]
OPTIONS = {
    "hold": ("jacobi", "gauss_seidel"),
    "tolerance": ("iterative",),
    "iterations": ("iterative",),
}


class CouplingTable(FrozenTable):
    """Coupling scheme and its options; the scheme's defaults apply to the rest."""

    scheme: SchemeName = "tracks_first"
    """rule by which inputs over a communication step follow from outputs"""
    hold: Literal["linear", "constant"] | None = None
    """inputs are extrapolated to the middle of the step, or held"""
    tolerance: Annotated[float, ratio(gt=0, lt=1)] | None = None
    """relative change of inputs that ends the iteration"""
    iterations: Annotated[int, Field(ge=1)] | None = None
    """most iterations in a step"""

    @model_validator(mode="after")
    def _check_options(self) -> CouplingTable:
        for option in self.options():
            if self.scheme not in OPTIONS[option]:
                schemes = " or ".join(OPTIONS[option])
                raise ValueError(f"{option} is an option of {schemes}, not of {self.scheme}")
        return self

    def options(self) -> dict[str, Any]:
        """Given options, without the scheme."""
        return self.model_dump(exclude={"scheme"}, exclude_none=True)

    def __str__(self) -> str:
        options = ", ".join(f"{key} = {value}" for key, value in self.options().items())
        return f"{self.scheme} ({options})" if options else self.scheme


class VariableStepTable(FrozenTable):
    """Communication step controlled by an error estimate; ``run.step`` is the first one."""

    tolerance: Annotated[float, ratio(gt=0, lt=1)]
    """largest error of a step over the size of what a connection carries, or power residual over the bonds' power"""
    estimate: Literal["doubling", "power"] = "doubling"
    """error of a step by a comparison with two half steps, or by the power residual of the ports"""
    energy: Annotated[float, In("J", gt=0)] | None = None
    """least reference energy of a power residual"""
    shortest: Duration = 1e-5
    """shortest communication step"""
    longest: Duration = 0.1
    """longest communication step"""

    @model_validator(mode="after")
    def _check_order(self) -> VariableStepTable:
        if self.shortest > self.longest:
            raise ValueError(f"shortest = {self.shortest:g} s is longer than longest = {self.longest:g} s")
        if self.energy is not None and self.estimate != "power":
            raise ValueError(f"energy is an option of estimate = 'power', not of '{self.estimate}'")
        return self

    def __str__(self) -> str:
        lengths = f"{self.shortest * 1e3:g} to {self.longest * 1e3:g} ms"
        return f"{self.estimate}, tolerance {self.tolerance:g}, {lengths}"


def short_coupling(value: object) -> object:
    """Accept the name of a coupling in place of its table."""
    return {"scheme": value} if isinstance(value, str) else value


def _allowed_kinds(allowed: object) -> object:
    """Kinds of failures of the validity ledger; a single one may be given as a string."""
    names = [allowed] if isinstance(allowed, str) else allowed
    if isinstance(names, list | tuple) and all(isinstance(name, str) and name in ALLOWED for name in names):
        return tuple(name for name in ALLOWED if name in names)
    raise ValueError(f"must be a list of {', '.join(ALLOWED)}: failures that become warnings")


class WindowTable(FrozenTable):
    """Window of time of the figures that are means."""

    start: Time = Field(0.0, alias="from")
    """begin of the window"""
    end: Time | None = Field(None, alias="to")
    """end of the window; without it the end of the run"""

    @model_validator(mode="after")
    def _check_order(self) -> WindowTable:
        if self.end is not None and self.start >= self.end:
            raise ValueError(f"from = {self.start:g} s must be before to = {self.end:g} s")
        return self


class RunTable(FrozenTable):
    """Duration, steps and recording of a run."""

    stop: Duration
    """end of the run, a multiple of step; times in a scene, a log and results count from its start"""
    start: Annotated[float, In("s")] = 0.0
    """time of FMUs of users at the start of the run"""
    step: Duration
    """communication step H; with a variable step, the first one"""
    coupling: Annotated[CouplingTable, BeforeValidator(short_coupling, SchemeName | CouplingTable)] = CouplingTable()
    """coupling of the components, or the name of its scheme alone"""
    variable: Annotated[VariableStepTable | None, OR_FALSE] = None
    """control of the communication step by its error; false or no table: all steps have the length step"""
    inputs: bool = True
    """inputs and checkpoints are recorded; without them the log can be neither replayed nor resumed"""
    outputs: Every = 1
    """communication steps from one record of outputs to the next"""
    links: Every | None = None
    """communication steps from one record of link outputs to the next; without it ten records a tooth, 10 at most"""
    between: bool = False
    """mean, least and most of link outputs between two records are recorded too"""
    checkpoints: Annotated[Duration | None, OR_FALSE] = 0.5
    """time from one checkpoint in the log to the next; false: none"""
    window: Annotated[WindowTable | None, OR_FALSE] = None
    """window of the summary's figures that are means; false or no table: the last second"""
    allow: Annotated[tuple[str, ...], BeforeValidator(_allowed_kinds, Allowed | tuple[Allowed, ...])] = ()
    """kinds of failures of the validity ledger that become warnings"""

    @model_validator(mode="after")
    def _check_steps(self) -> RunTable:
        if self.stop / self.step > MOST_STEPS:
            raise ValueError(f"stop = {self.stop:g} s is more than {MOST_STEPS} steps of {self.step:g} s")
        if abs(self.stop / self.step - round(self.stop / self.step)) > 1e-6 or self.stop < self.step:
            raise ValueError(f"stop = {self.stop:g} s must be a multiple of step = {self.step:g} s")
        return self

    @property
    def times(self) -> tuple[float, float]:
        """Start and stop time of the FMUs, s; no step ends after the stop time, by no rounding."""
        end = self.start + (self.steps - 1) * self.step + self.step
        rounding = 0.0 if self.variable is None else 4.0 * math.ulp(end)
        return self.start, max(self.start + self.stop, end) + rounding

    @property
    def steps(self) -> int:
        """Number of communication steps."""
        return round(self.stop / self.step)
