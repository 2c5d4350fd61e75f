"""Value types that several tables of a scene file share."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, Literal

from annotated_types import GroupedMetadata
from pydantic import BeforeValidator, Field

from fmus.track_choices import TRACKS
from fmus.vehicle import In
from orchestrator.log.message_records import MOST_STEPS

Duration = Annotated[float, In("s", gt=0)]


Time = Annotated[float, In("s", ge=0)]


Angle = Annotated[float, In("rad")]


Place = Annotated[float, In("m", ge=-1e6, le=1e6)]  # beyond, a double cannot resolve contact penetrations


Every = Annotated[int, Field(ge=1, le=MOST_STEPS)]


if TYPE_CHECKING:
    TrackName = str
else:
    TrackName = Literal[tuple(TRACKS)]  # the track model


SOLVED: dict[str, Any] = {"readOnly": True}  # in the JSON schema of a key that a run solves for


Side = Literal["left", "right"]


SIDES: tuple[Side, Side] = ("left", "right")


def false_as_none(value: object) -> object:
    """Read ``false`` as None, which TOML lacks."""
    return None if value is False else value


def _add_false(schema: dict[str, Any]) -> None:
    schema["anyOf"].append({"const": False})


class OrFalse(GroupedMetadata):
    """Annotation of an optional value that a file may set to ``false``, because TOML has no null."""

    def __iter__(self) -> Iterator[object]:
        yield BeforeValidator(false_as_none)
        yield Field(json_schema_extra=_add_false)


OR_FALSE = OrFalse()
