"""Parts that scenes of all kinds share: name, duration, steps, recording, checks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import Field, PrivateAttr, field_validator, model_validator

from fmus.ranges import range_violations
from fmus.vehicle import FrozenTable
from orchestrator.scene.ranges import SCENE
from orchestrator.scene.recording import aliasing_warning, links_every
from orchestrator.scene.run_tables import RunTable
from orchestrator.scene.settings import file_part
from orchestrator.scene.tables import Check


class SystemScene(FrozenTable):
    """Scene of FMUs; subclasses add what they assemble."""

    name: Annotated[str, Field(pattern=r"^[^/\\\x00]+$")]
    """name of the scene and of its log; without it that of the file"""
    title: str
    """one line about the scene"""
    assembly: str
    """kind of scene, on which the other tables depend"""
    run: RunTable
    """duration, steps, coupling and recording"""
    expect: dict[str, Check] = Field(default_factory=dict)
    """checks by their names: expected values of signals, or of measures"""

    _archive: str = PrivateAttr("")  # SSP archive that it comes from
    _shortened: str = PrivateAttr("")  # sentence about a step that its vehicle shortened
    _settings: Mapping[str, Any] = PrivateAttr(default_factory=dict)  # by which it differs from its file, by dotted key

    def __eq__(self, other: object) -> bool:
        """True for equal numbers, whatever settings made them."""
        return type(self) is type(other) and self.__dict__ == other.__dict__

    @property
    def shortened(self) -> str:
        """Sentence about a step that its vehicle shortened, or empty."""
        return self._shortened

    @property
    def where(self) -> str:
        """Beginning of messages about it: its archive, or the file of its name."""
        return self._archive or f"{self.name}.toml"

    def read_from(self, archive: str, settings: Mapping[str, Any]) -> Self:
        """The scene as one of an SSP archive (empty for none) with settings: for messages and the name of its log."""
        read = self.model_copy()
        read._archive, read._settings = archive, settings
        return read

    @model_validator(mode="after")
    def _check_ranges(self) -> Self:
        for complaint in range_violations(self.model_dump(exclude={"vehicle", "expect"}), SCENE, "possible"):
            raise ValueError(complaint)
        return self

    @field_validator("expect")
    @classmethod
    def _check_names(cls, value: dict[str, Check]) -> dict[str, Check]:
        for name in value:
            if not name.isidentifier():
                raise ValueError(f"'{name}' is no name for a check")
        return value

    @property
    def variant(self) -> str:
        """The track model; empty without a track."""
        return ""

    @property
    def resumable(self) -> bool:
        """True if a run can be resumed; not with FMUs of the user, because no file that a log names is run."""
        return False

    @property
    def teeth_rate(self) -> float:
        """Teeth per second at top speed as far as known; 0 without teeth."""
        return 0.0

    @property
    def links_every(self) -> int:
        """Communication steps between two records of links."""
        return self.run.links or links_every(self.run.step, self.teeth_rate)

    @property
    def records_statistics(self) -> bool:
        """True if the log has link statistics between two records."""
        return self.run.between or bool(self.aliasing_warning)

    @property
    def aliasing_warning(self) -> str:
        """Sentence if link records alias the frequency of the teeth, else empty."""
        return aliasing_warning(self.links_every, self.run.step, self.teeth_rate)

    @property
    def log_name(self) -> str:
        """File name of the log of a run, by default; it names the settings, so that variants have own logs."""
        settings = {key: value for key, value in self._settings.items() if key not in ("name", "track.model")}
        return f"{'-'.join(filter(None, (self.name, self.variant)))}{file_part(settings)}.mcap"

    def resolved(self) -> dict[str, Any]:
        """The scene as plain SI numbers; ``scene.any_from_table`` is the inverse."""
        return self.model_dump(mode="json", by_alias=True, exclude_none=True)
