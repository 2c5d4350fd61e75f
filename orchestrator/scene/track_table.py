"""Table ``[track]``: link model and numerical method."""

from __future__ import annotations

from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BeforeValidator, Field, model_validator

from fmus.link_outputs import GROUPS, STANDARD
from fmus.ports import TOLERANCES
from fmus.track_choices import TRACKS, TrackKind, models_with
from fmus.vehicle import FrozenTable, In
from orchestrator.scene.values import Duration, TrackName

Tolerance = Annotated[float, Field(ge=TOLERANCES.least, le=TOLERANCES.most)]


Elasticity = Literal["small_deformation", "general", "engineering"]


def _output_groups(value: object) -> object:
    """Groups of link outputs: all, the standard ones (true), none (false), or a list of names."""
    if value == "all":
        return tuple(GROUPS)
    if isinstance(value, bool):
        return STANDARD if value else ()
    if isinstance(value, list | tuple) and all(isinstance(name, str) and name in GROUPS for name in value):
        return tuple(name for name in GROUPS if name in value)
    raise ValueError(f"must be true, false, 'all' or a list of {', '.join(GROUPS)}")


LinkOutputs = Annotated[tuple[str, ...], BeforeValidator(_output_groups)]


class FmuParameter(NamedTuple):
    """Annotation of a key of ``[track]``: the FMU parameter that it sets."""

    name: str = ""  # parameter of the track's FMU; empty: the name of the key
    method: bool = False  # True for the method of computation, False for the mechanics


METHOD = FmuParameter(method=True)


class TrackModelTable(FrozenTable):
    """Track model and its parameters; the model's defaults apply to the rest.

    A key is allowed if the model's FMU has its parameter (``models_with``).
    """

    model: TrackName
    element: Annotated[Literal["cable", "beam"] | None, FmuParameter()] = None
    elasticity: Annotated[Elasticity | None, FmuParameter()] = None  # of cables
    # Of cables: fixed ones stay in their plane. Default: by the scene.
    axes: Annotated[Literal["fixed", "free"] | None, FmuParameter()] = None
    formulation: Annotated[Literal["augmented", "recursive"] | None, METHOD] = None
    # Of cables: pins by elimination, or as constraints with multipliers.
    joints: Annotated[Literal["eliminated", "constrained"] | None, METHOD] = None
    # Coordinates for an explicit integrator.
    coordinates: Annotated[Literal["nodal", "cholesky"] | None, METHOD] = None
    # Of a loop: how the last link joins the first.
    closure: Annotated[Literal["pin", "spring"] | None, FmuParameter()] = None
    closure_stiffness: Annotated[Annotated[float, In("N/m", gt=0)] | None, FmuParameter("closure.stiffness")] = None
    closure_damping: Annotated[Annotated[float, In("N s/m", ge=0)] | None, FmuParameter("closure.damping")] = None
    integrator: Annotated[Literal["generalized_alpha", "hht", "runge_kutta", "adams"] | None, METHOD] = None
    step: Annotated[Duration | None, METHOD] = None  # largest internal step
    # Of an implicit integrator; at least 0.5 for hht.
    spectral_radius: Annotated[Annotated[float, Field(ge=0, le=1)] | None, METHOD] = None
    rtol: Annotated[Tolerance | None, FmuParameter("adams.rtol", method=True)] = None  # of integrator = 'adams'
    # The same, in m, rad, m/s and rad/s.
    atol: Annotated[Tolerance | None, FmuParameter("adams.atol", method=True)] = None
    start: Annotated[Literal["rest", "displaced", "polygon", "straight", "folded"] | None, FmuParameter()] = None
    link_outputs: LinkOutputs = STANDARD  # groups of ``fmus.link_outputs``

    @classmethod
    def fmu_parameters(cls) -> dict[str, FmuParameter]:
        """Keys that set a parameter of the track's FMU."""
        found = ((key, one) for key, field in cls.model_fields.items() for one in field.metadata)
        return {key: one._replace(name=one.name or key) for key, one in found if isinstance(one, FmuParameter)}

    def parameters(self) -> dict[str, Any]:
        """Given parameters by their names in the track's FMU."""
        given = self.model_dump(exclude_none=True)
        return {one.name: given[key] for key, one in self.fmu_parameters().items() if key in given}

    @property
    def kind(self) -> TrackKind:
        """Kind of track."""
        return TRACKS[self.model]

    def choices(self) -> dict[str, Any]:
        """Given parameters, and the defaults of those that may exclude each other."""
        return {**self.kind.defaults, **self.parameters()}

    def of_model(self, model: str) -> TrackModelTable:
        """The same track of another model, with the defaults of all parameters that ``TRACKS`` lists defaults of."""
        listed = {parameter for kind in TRACKS.values() for parameter in kind.defaults}
        own = {key: None for key, one in self.fmu_parameters().items() if one.name in listed}
        return self.model_copy(update={**own, "model": model})

    @model_validator(mode="after")
    def _check_parameters(self) -> TrackModelTable:
        for key, one in self.fmu_parameters().items():
            value, models = getattr(self, key), models_with(one.name)
            if value is not None and self.model not in models:
                needed = " or ".join(map(repr, models))
                raise ValueError(f"{key} = '{value}' needs model = {needed}: {self.kind.links} have none")
        for key in ("rtol", "atol"):
            if getattr(self, key) is not None and self.integrator != "adams":
                raise ValueError(f"{key} = {getattr(self, key):g} needs integrator = 'adams': others take equal steps")
        if conflict := self.kind.conflict(self.choices()):
            raise ValueError(conflict)
        return self

    @model_validator(mode="after")
    def _check_closure(self) -> TrackModelTable:
        for key in ("closure_stiffness", "closure_damping"):
            value = getattr(self, key)
            if self.closure != "spring" and value is not None:
                raise ValueError(f"{key} = {value} needs closure = 'spring': a pin has none")
        return self


def short_track(value: object) -> object:
    """Accept the name of a model in place of its table."""
    return {"model": value} if isinstance(value, str) else value
