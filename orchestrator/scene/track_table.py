"""Table ``[track]``: link model and numerical method."""

from __future__ import annotations

from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BeforeValidator, Field, model_validator

from fmus.link_outputs import GROUPS, STANDARD
from fmus.ports import TOLERANCES
from fmus.track_choices import TRACKS, TrackKind
from fmus.vehicle import FrozenTable, In
from orchestrator.scene.values import Duration, TrackName

Tolerance = Annotated[float, Field(ge=TOLERANCES.least, le=TOLERANCES.most)]


Elasticity = Literal["small_deformation", "general", "engineering"]


def _groups(asked: object) -> object:
    """Groups of link outputs: all, the standard ones (true), none (false), or a list of names."""
    if asked == "all":
        return tuple(GROUPS)
    if isinstance(asked, bool):
        return STANDARD if asked else ()
    if isinstance(asked, list | tuple) and all(isinstance(name, str) and name in GROUPS for name in asked):
        return tuple(name for name in GROUPS if name in asked)
    raise ValueError(f"must be true, false, 'all' or a list of {', '.join(GROUPS)}")


LinkOutputs = Annotated[tuple[str, ...], BeforeValidator(_groups)]


class Sets(NamedTuple):
    """Annotation of a key of ``[track]``: the FMU parameter that it sets."""

    parameter: str = ""  # parameter of the track's FMU; empty: the name of the key
    model: str = ""  # the only model that has it; empty: all
    method: bool = False  # True for the method of computation, False for the mechanics


FLEXIBLE, FLEXIBLE_METHOD, METHOD = Sets(model="flexible"), Sets(model="flexible", method=True), Sets(method=True)


class Track(FrozenTable):
    """Track model and its parameters; the model's defaults apply to the rest."""

    model: TrackName
    element: Annotated[Literal["cable", "beam"] | None, FLEXIBLE] = None
    elasticity: Annotated[Elasticity | None, FLEXIBLE] = None  # of cables
    # Of cables: fixed ones stay in their plane. Default: by the scene.
    axes: Annotated[Literal["fixed", "free"] | None, FLEXIBLE] = None
    formulation: Annotated[Literal["augmented", "recursive"] | None, Sets(model="rigid", method=True)] = None
    # Of cables: pins by elimination, or as constraints with multipliers.
    joints: Annotated[Literal["eliminated", "constrained"] | None, FLEXIBLE_METHOD] = None
    # Coordinates for an explicit integrator.
    coordinates: Annotated[Literal["nodal", "cholesky"] | None, FLEXIBLE_METHOD] = None
    closure: Annotated[Literal["pin", "spring"] | None, Sets()] = None  # of a loop: how the last link joins the first
    closure_stiffness: Annotated[Annotated[float, In("N/m", gt=0)] | None, Sets("closure.stiffness")] = None
    closure_damping: Annotated[Annotated[float, In("N s/m", ge=0)] | None, Sets("closure.damping")] = None
    integrator: Annotated[Literal["generalized_alpha", "hht", "runge_kutta", "adams"] | None, METHOD] = None
    step: Annotated[Duration | None, METHOD] = None  # largest internal step
    # Of an implicit integrator; at least 0.5 for hht.
    spectral_radius: Annotated[Annotated[float, Field(ge=0, le=1)] | None, METHOD] = None
    rtol: Annotated[Tolerance | None, Sets("adams.rtol", method=True)] = None  # of integrator = 'adams'
    atol: Annotated[Tolerance | None, Sets("adams.atol", method=True)] = None  # the same, in m, rad, m/s and rad/s
    start: Annotated[Literal["rest", "displaced", "polygon", "straight", "folded"] | None, Sets()] = None
    link_outputs: LinkOutputs = STANDARD  # groups of ``fmus.link_outputs``

    @classmethod
    def sets(cls) -> dict[str, Sets]:
        """Keys that set a parameter of the track's FMU."""
        found = ((key, one) for key, field in cls.model_fields.items() for one in field.metadata)
        return {key: one for key, one in found if isinstance(one, Sets)}

    def parameters(self) -> dict[str, Any]:
        """Given parameters by their names in the track's FMU."""
        given = self.model_dump(exclude_none=True)
        return {one.parameter or key: given[key] for key, one in self.sets().items() if key in given}

    @property
    def kind(self) -> TrackKind:
        """Kind of track."""
        return TRACKS[self.model]

    def choices(self) -> dict[str, Any]:
        """Given parameters, and the defaults of those that may exclude each other."""
        return {**self.kind.defaults, **self.parameters()}

    def of_model(self, model: str) -> Track:
        """The same track of another model, without settings of one model only and with the default integrator."""
        own = {key: None for key, one in self.sets().items() if one.model or key == "integrator"}
        return self.model_copy(update={**own, "model": model})

    @model_validator(mode="after")
    def _fits(self) -> Track:
        for key, one in self.sets().items():
            value = getattr(self, key)
            if one.model not in ("", self.model) and value is not None:
                raise ValueError(f"{key} = '{value}' needs model = '{one.model}': {self.kind.links} have none")
        for key in ("rtol", "atol"):
            if getattr(self, key) is not None and self.integrator != "adams":
                raise ValueError(f"{key} = {getattr(self, key):g} needs integrator = 'adams': others take equal steps")
        if conflict := self.kind.conflict(self.choices()):
            raise ValueError(conflict)
        return self

    @model_validator(mode="after")
    def _springs_close(self) -> Track:
        for key in ("closure_stiffness", "closure_damping"):
            value = getattr(self, key)
            if self.closure != "spring" and value is not None:
                raise ValueError(f"{key} = {value} needs closure = 'spring': a pin has none")
        return self


def short_track(value: object) -> object:
    """Accept the name of a model in place of its table."""
    return {"model": value} if isinstance(value, str) else value
