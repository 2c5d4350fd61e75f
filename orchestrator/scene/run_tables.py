"""``[run]``: how long, in which steps, how components are coupled, what is recorded."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from fmus.vehicle import In, Table
from orchestrator.log.message_records import MOST_STEPS
from orchestrator.results.validity.limits import ALLOWED
from orchestrator.scene.values import Duration, Every, off

OPTIONS = {
    "hold": ("jacobi", "gauss_seidel"),
    "tolerance": ("iterative",),
    "iterations": ("iterative",),
}


class Coupling(Table):
    """How components are coupled; what is not given is the coupling's own default."""

    scheme: Literal["tracks_first", "jacobi", "gauss_seidel", "iterative", "energy_corrected"] = "tracks_first"
    hold: Literal["linear", "constant"] | None = None  # of inputs: extrapolated to the middle of the step, or not
    tolerance: Annotated[float, Field(gt=0, lt=1)] | None = None  # change of inputs that ends the iteration
    iterations: Annotated[int, Field(ge=1)] | None = None  # allowed in a step

    @model_validator(mode="after")
    def _options_fit(self) -> Coupling:
        for option in self.options():
            if self.scheme not in OPTIONS[option]:
                wanted = " or ".join(OPTIONS[option])
                raise ValueError(f"{option} is an option of {wanted}, not of {self.scheme}")
        return self

    def options(self) -> dict[str, Any]:
        """What is given besides the scheme."""
        return self.model_dump(exclude={"scheme"}, exclude_none=True)

    def __str__(self) -> str:
        given = ", ".join(f"{key} = {value}" for key, value in self.options().items())
        return f"{self.scheme} ({given})" if given else self.scheme


class Variable(Table):
    """A communication step that follows an error estimate; ``run.step`` is the first."""

    # of a step: its error over what its connection has carried, or its power residual over what a bond has carried
    tolerance: Annotated[float, Field(gt=0, lt=1)]
    estimate: Literal["doubling", "power"] = "doubling"
    energy: Annotated[float, In("J", gt=0)] | None = None  # the least that a power residual is relative to
    shortest: Duration = 1e-5
    longest: Duration = 0.1

    @model_validator(mode="after")
    def _in_order(self) -> Variable:
        if self.shortest > self.longest:
            raise ValueError(f"shortest = {self.shortest:g} s is longer than longest = {self.longest:g} s")
        if self.energy is not None and self.estimate != "power":
            raise ValueError(f"energy is an option of estimate = 'power', not of '{self.estimate}'")
        return self

    def __str__(self) -> str:
        lengths = f"{self.shortest * 1e3:g} to {self.longest * 1e3:g} ms"
        return f"{self.estimate}, tolerance {self.tolerance:g}, {lengths}"


def short_coupling(value: object) -> object:
    """A coupling's name may stand for its table."""
    return {"scheme": value} if isinstance(value, str) else value


def _kinds(allowed: object) -> object:
    """Kinds of failures of the validity ledger; one may stand alone."""
    names = [allowed] if isinstance(allowed, str) else allowed
    if isinstance(names, list | tuple) and all(isinstance(name, str) and name in ALLOWED for name in names):
        return tuple(name for name in ALLOWED if name in names)
    raise ValueError(f"must be a list of {', '.join(ALLOWED)}: failures that become warnings")


class Run(Table):
    """How long, in which steps, and how often results are recorded."""

    stop: Duration
    step: Duration  # communication step H
    coupling: Annotated[Coupling, BeforeValidator(short_coupling)] = Coupling()
    variable: Annotated[Variable | None, BeforeValidator(off)] = None  # without it, or false: all of length H
    outputs: Every = 1  # outputs are recorded every n communication steps
    links: Every | None = None  # per-link outputs are recorded every n communication steps; default: ``recording``
    between: bool = False  # mean, least and most of per-link outputs between two of these records, too
    # the log gets what the run needs to go on from there so often; false: never
    checkpoints: Annotated[Duration | None, BeforeValidator(off)] = 0.5
    allow: Annotated[tuple[str, ...], BeforeValidator(_kinds)] = ()  # what of ``results/validity`` does not fail a run

    @model_validator(mode="after")
    def _whole_steps(self) -> Run:
        if self.stop / self.step > MOST_STEPS:
            raise ValueError(f"stop = {self.stop:g} s is more than {MOST_STEPS} steps of {self.step:g} s")
        if abs(self.stop / self.step - round(self.stop / self.step)) > 1e-6 or self.stop < self.step:
            raise ValueError(f"stop = {self.stop:g} s must be a multiple of step = {self.step:g} s")
        return self

    @property
    def steps(self) -> int:
        """Number of communication steps."""
        return round(self.stop / self.step)
