"""Tables ``[start]``, ``[run]`` and ``[expect]`` of a scene, and those of its assemblies: chain, bench, rig."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import (
    BeforeValidator,
    Field,
    SerializerFunctionWrapHandler,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    field_validator,
    model_serializer,
    model_validator,
)

from fmus.vehicles.tables import Distance, Force, FrozenTable, In, When, is_logged, ratio, value_text
from orchestrator.cosim.coupling import COUPLINGS, having
from orchestrator.log.message_records import MAX_STEPS
from orchestrator.scene.settings import hint
from orchestrator.scene.values import OR_FALSE, Duration, Every, Time, TrackName
from orchestrator.vocabulary.limits import ALLOWED

if TYPE_CHECKING:
    from orchestrator.results.figures import Figure

    Allowed = str
    SchemeName = str
else:
    Allowed = Literal[tuple(ALLOWED)]
    SchemeName = Literal[tuple(COUPLINGS)]
from math import pi, remainder
from typing import Literal

from fmus.vehicles.tables import Angle, Length, Place
from orchestrator.scene.values import SOLVED

Joint = Annotated[float, Field(allow_inf_nan=False, json_schema_extra={"unit": "rad, m"})]


class StartTable(FrozenTable):
    """Place of the vehicle at the start, world frame."""

    position: tuple[Place, Place, Place] = (0.0, 0.0, 0.0)
    """place of the middle of the sprocket axle line, as drawn"""
    heading: Angle = 0.0
    """heading about the vertical, to the left"""

    def parameters(self) -> dict[str, float]:
        """Start parameters that all parts share, on level ground: places in m, angles in rad."""
        x, y, z = self.position
        return {"start.position.x": x, "start.position.y": y, "start.position.z": z, "start.heading": self.heading}


class TrackAtRestTable(FrozenTable):
    """Track of a vehicle at rest."""

    tension: Force
    """mean tension of its links"""
    sag: Length
    """sag of its longest free span"""
    loads: tuple[Force, ...]
    """loads on the road wheels from the front"""
    others: dict[str, Force] = {}  # noqa: RUF012 - pydantic copies it
    """loads on other wheels that stand on level ground as drawn, by name"""


class EquilibriumTable(FrozenTable):
    """Equilibrium position of hull, arms and idlers, from the drawn position (``fmus.rest.equilibrium``)."""

    height: Length
    """rise of the hull's centre of mass"""
    roll: Angle
    """roll of the hull"""
    pitch: Angle
    """pitch of the hull"""
    left: tuple[Joint, ...]
    """on the left side: angles of the arms, front to rear, rad, and slides of idler and further wheels, m"""
    right: tuple[Joint, ...]
    """the same on the right side"""
    lateral: Length = 0.0
    """shift of the hull, to the left: its road wheels stand over their tracks, on a side slope at the guides"""
    sprockets: tuple[tuple[Annotated[float, ratio()], ...], ...] = ()
    """force, N, and torque, N m, of each track on its sprocket, left and right"""
    tracks: tuple[TrackAtRestTable, ...] = ()
    """tracks, left and right"""


class StandingTable(FrozenTable):
    """Vehicle standing on level, hard ground (``fmus.rest.standing``)."""

    drawn: tuple[Force, ...]
    """mean tension of the tracks as drawn: one of both sides, or left and right"""
    height: Length = 0.0
    """rise of the hull's centre of mass from its drawn place"""
    tracks: tuple[TrackAtRestTable, ...] = ()
    """tracks, left and right; none of a vehicle that does not stand"""
    why: str = ""
    """why it does not stand"""


class VehicleStartTable(StartTable):
    """Start of a vehicle, which may be raised, pitched, or rolled by half a turn."""

    height: Place = 0.0
    """sprocket axle above its drawn place"""
    pitch: Angle = 0.0
    """rotation about the sprocket axle, nose down positive"""
    roll: Angle = 0.0
    """rotation about the long axis, before the pitch: half a turn or none"""
    state: Literal["equilibrium", "drawn"] | None = None
    """'equilibrium': at rest on springs and tracks, the default; 'drawn': springs without load, so the vehicle drops,
    the default of a raised or turned vehicle"""
    equilibrium: EquilibriumTable | None = Field(default=None, json_schema_extra=SOLVED)
    """equilibrium of hull, arms and idlers, from the drawn position"""

    @model_validator(mode="after")
    def _check_rest(self) -> VehicleStartTable:
        if self.state == "equilibrium" and self.is_displaced:
            raise ValueError(
                "state = 'equilibrium' needs height = 0, pitch = 0 and roll = 0: what is raised or turned starts as"
                " 'drawn'"
            )
        return self

    def parameters(self) -> dict[str, float]:
        """Start parameters that all parts share, on level ground: places in m, angles in rad."""
        heading, pitch = self.heading_and_pitch()
        return super().parameters() | {"start.heading": heading, "start.height": self.height, "start.pitch": pitch}

    @property
    def is_displaced(self) -> bool:
        """True if the vehicle is raised, pitched or rolled."""
        return (self.height, self.pitch, self.roll) != (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _check_roll(self) -> VehicleStartTable:
        if abs(remainder(self.roll, pi)) > 1e-9:
            raise ValueError(
                f"roll = {self.roll:g} rad must be 0 or half a turn (180 deg): a track is laid out in an upright plane"
            )
        return self

    def heading_and_pitch(self) -> tuple[float, float]:
        """Heading and pitch, rad, with the roll in them: R_z(h) R_y(p) R_x(pi) = R_z(h + pi) R_y(pi - p)."""
        over = abs(remainder(self.roll, 2.0 * pi)) > 1.0
        return (self.heading + pi, pi - self.pitch) if over else (self.heading, self.pitch)


RETIRED = ("energy_corrected",)  # schemes of earlier versions, which logs may name


class CouplingTable(FrozenTable):
    """Coupling scheme and its options; the scheme's defaults apply to the rest."""

    scheme: SchemeName = "tracks_first"
    """rule by which inputs over a communication step follow from outputs"""
    hold: Annotated[Literal["linear", "constant"] | None, When(scheme=having("hold"))] = None
    """inputs are extrapolated to the middle of the step, or held"""
    tolerance: Annotated[Annotated[float, ratio(gt=0, lt=1)] | None, When(scheme=having("tolerance"))] = None
    """relative change of inputs that ends the iteration"""
    iterations: Annotated[Annotated[int, Field(ge=1)] | None, When(scheme=having("iterations"))] = None
    """most iterations in a step"""

    @field_validator("scheme", mode="wrap")
    @classmethod
    def _check_scheme(cls, value: Any, check: ValidatorFunctionWrapHandler, info: ValidationInfo) -> Any:
        return value if is_logged(info) and value in RETIRED else check(value)

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
    energy: Annotated[Annotated[float, In("J", gt=0)] | None, When(estimate=("power",))] = None
    """least reference energy of a power residual"""
    shortest: Duration = 1e-5
    """shortest communication step"""
    longest: Duration = 0.1
    """longest communication step"""

    @model_validator(mode="after")
    def _check_order(self) -> VariableStepTable:
        if self.shortest > self.longest:
            raise ValueError(f"shortest = {self.shortest:g} s is longer than longest = {self.longest:g} s")
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
        if self.stop / self.step > MAX_STEPS:
            raise ValueError(f"stop = {self.stop:g} s is more than {MAX_STEPS} steps of {self.step:g} s")
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


def _figures() -> dict[str, Figure]:
    from orchestrator.results.measures import FIGURES  # late: they read logs, which no scene without such checks needs

    return FIGURES


MeasureName = Annotated[str, Field(json_schema_extra=lambda schema: schema.update(enum=sorted(_figures())))]
Checked = Field(allow_inf_nan=False, json_schema_extra={"unit": "that of the signal or measure"})


class Check(FrozenTable):
    """Expected value of a signal reduced over a window, or of a named measure."""

    signal: str | None = None
    """signal, instance.variable, that is checked"""
    reduce: Literal["mean", "min", "max", "last", "drop", "ripple", "rms"] = "mean"
    """number that is made of the signal's records in the window, not smoothed, of angles without jumps; drop: first
    less last, ripple: range over mean; not beside measure"""
    measure: MeasureName | None = None
    """measure that is checked, instead of a signal"""
    of: str = ""
    """side ('left', 'right'), span ('upper', 'lower') or component of a measure that has such parts"""
    start: Time = Field(0.0, alias="from")
    """begin of the window"""
    end: Time | None = Field(None, alias="to")
    """end of the window, without it the end of the run; a measure of the whole run is made if the run comes so far"""
    expected: Annotated[float, Checked]
    """expected value"""
    tolerance: Annotated[float, Field(ge=0), Checked]
    """largest difference from the expected value"""
    relative: bool = False
    """the tolerance is a fraction of the expected value"""
    track: TrackName | None = None
    """the check is for this track model only"""

    @model_serializer(mode="wrap")
    def _serialise(self, serialise: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {key: value for key, value in serialise(self).items() if key != "reduce" or self.measure is None}

    @model_validator(mode="after")
    def _check_source(self) -> Check:
        if (self.signal is None) == (self.measure is None):
            raise ValueError("needs either signal or measure")
        if self.measure is not None and self.measure not in _figures():
            raise ValueError(f"no measure '{self.measure}': {hint(self.measure, sorted(_figures()), 'one of')}")
        return self

    @property
    def fault(self) -> str:
        """Key and sentence about what its signal or measure does not read, or a window without time; empty for none."""
        if self.end is not None and self.start > self.end:
            return f"from = {self.start:g} s: is after to = {self.end:g} s, so the window ends before it begins"
        if self.measure is None:
            return f"of = {value_text(self.of)}: is for a measure; a signal names its component" if self.of else ""
        if "reduce" in self.model_fields_set:
            return f"reduce = '{self.reduce}': is for a signal; measure = '{self.measure}' is a number already"
        figure = _figures()[self.measure]
        if self.start and figure.whole:
            return f"from = {self.start:g} s: {self.measure} is of the whole run"
        wrong = figure.wrong_part(self.of)
        return wrong and f"of = {value_text(self.of)}: {wrong}"


class ChainTable(FrozenTable):
    """Open chain between two pins at equal height, fixed at the first pin only, or lying; or a free loop."""

    links: Annotated[int, Field(ge=2, le=4096)]
    """number of links"""
    ends: Literal["pinned", "held", "lying", "loop"] = "pinned"
    """chain between two pins, held at its first pin only, free on the ground, or closed and free without gravity"""
    span: Annotated[Annotated[float, ratio(gt=0, lt=1)] | None, When(ends=("pinned",))] = None
    """distance of the pins over the length of the chain"""
    pull: Annotated[Force, When(ends=("lying",))] = 0.0
    """force ahead, half on each of its ends"""
    spin: Annotated[float, In("rad/s"), When(ends=("loop",))] = 0.0
    """initial speed about y"""
    ovalling: Annotated[float, In("rad/s"), When(ends=("loop",))] = 0.0
    """additional speed of its links, times cos(2 angle)"""

    @model_validator(mode="after")
    def _check_ends(self) -> ChainTable:
        if self.span is None and self.ends == "pinned":
            raise ValueError("ends = 'pinned' needs span")
        if self.ends == "loop" and self.links < 3:
            raise ValueError(f"a loop needs 3 links, not {self.links}")
        return self


class BenchTable(FrozenTable):
    """Open chain over one sprocket, its ends pulled by constant forces."""

    links: Annotated[int, Field(ge=8, le=4096)]
    """number of links"""
    upper: Force
    """pull at the end of the upper (incoming) span, towards -x"""
    lower: Force
    """pull at the end of the lower (outgoing) span, towards -x"""
    transverse_damping: Annotated[float, In("N s/m", ge=0)] = 0.0
    """damping of each pin's motion across the chain"""


class RigTable(FrozenTable):
    """Closed chain round a sprocket and a smooth idler with fixed axles."""

    links: Annotated[int, Field(ge=8, le=4096)]
    """number of links"""
    axle_distance: Distance
    """distance of the axles as drawn; the idler is moved until the chain carries the tension"""
    tension: Force
    """mean static tension of the chain, on its fixed axles"""
