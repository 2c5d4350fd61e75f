"""Scenes of FMUs: what all share (name, duration, steps, recording, checks), and the free system of FMUs of the user.

Links are recorded often enough for their teeth: these excite them periodically, and slow sampling aliases that motion.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Field, PrivateAttr, field_validator, model_validator

from fmus.vehicles.ranges import range_violations, too_large
from fmus.vehicles.tables import FrozenTable
from orchestrator.scene.fmu_table import FmuTable, pair_of, require_free_inputs, require_instance_name
from orchestrator.scene.settings import file_part
from orchestrator.scene.tables import Check, RunTable
from orchestrator.scene.values import SCENE_RANGES
from orchestrator.vocabulary.limits import shorter_step

SAMPLES = 10  # records while one tooth passes
NYQUIST = 2  # below, the frequency of the teeth is aliased
LONGEST_INTERVAL = 10  # steps between records in scenes without teeth
ASSUMED_SPEED = 20.0  # rad/s: assumed top speed of a sprocket driven by torque


def links_every(step: float, teeth: float) -> int:
    """Number of steps of length ``step``, s, between records of links at ``teeth`` per second."""
    return (
        LONGEST_INTERVAL
        if teeth <= 0.0
        else min(max(math.floor(1.0 / (SAMPLES * teeth * step) + 1e-9), 1), LONGEST_INTERVAL)
    )


def aliasing_warning(every: int, step: float, teeth: float) -> str:
    """Sentence if recording every so many steps aliases the frequency of the teeth, else empty."""
    interval = every * step
    if NYQUIST * teeth * interval <= 1.0:
        return ""
    alias = abs(teeth - round(teeth * interval) / interval)
    enough = links_every(step, teeth)
    finer, longest = f"run.links = {enough}", 1.0 / (NYQUIST * teeth)
    if enough * step > longest:
        finer = f"--step {shorter_step(step, longest)}{' with run.links = 1' if every > 1 else ''}"
    return (
        f"links are recorded every {1e3 * interval:.4g} ms, but up to {teeth:.4g} teeth pass a second: what they do to "
        f"links shows at {alias:.4g} Hz; {finer} resolves it"
    )


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
    _unused: tuple[str, ...] = PrivateAttr(())  # sentences about points of files behind its end
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

    @property
    def unfelt(self) -> list[str]:
        """Sentences about points of files behind its end, and obstacles that may pass between contact points."""
        return [f"{self.where}: {sentence}" for sentence in self._unused]

    def read_from(self, archive: str, settings: Mapping[str, Any]) -> Self:
        """The scene as one of an SSP archive (empty for none) with settings: for messages and the name of its log."""
        read = self.model_copy()
        read._archive, read._settings = archive, settings
        return read

    @model_validator(mode="after")
    def _check_ranges(self) -> Self:
        numbers = self.model_dump(exclude={"vehicle", "expect"})
        mechanics = {key: table for key, table in numbers.items() if key not in ("run", "fmu", "connections")}
        for complaint in (
            *range_violations(numbers, SCENE_RANGES, "possible"), *too_large(mechanics, SCENE_RANGES),
        ):  # fmt: skip
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
    def checks(self) -> dict[str, Check]:
        """Checks of its track model, by their names."""
        return {name: check for name, check in self.expect.items() if check.track in (None, self.variant)}

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


class FreeFmuTable(FmuTable):
    """FMU of the system."""

    stage: Annotated[int, Field(ge=0, le=1000)] | None = None
    """lower stages step first, those of one stage at once; without it 0, or after the FMUs whose means it takes"""


class FreeScene(SystemScene):
    """FMUs of the user and their connections."""

    assembly: Literal["fmus"]
    fmu: Annotated[dict[str, FreeFmuTable], Field(min_length=1)]
    """FMUs by the names of their instances"""
    connections: tuple[str, ...] = ()
    """connections of FMUs: "instance.output -> instance.input", or "2 * instance.output + 1 -> instance.input" """

    @model_validator(mode="after")
    def _check_connections(self) -> FreeScene:
        for name in self.fmu:
            require_instance_name(name)
        require_free_inputs([pair_of(text) for text in self.connections], self.fmu, ())
        return self
