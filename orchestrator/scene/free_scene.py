"""Free system: FMUs of the user and their connections, without a vehicle."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from orchestrator.scene.fmu_table import FmuTable, require_instance_name
from orchestrator.scene.pair import Pair, pair_of, require_free_inputs
from orchestrator.scene.system_scene import SystemScene


class FreeFmuTable(FmuTable):
    """FMU of the system."""

    stage: Annotated[int, Field(ge=0, le=1000)] = 0
    """lower stages step first; FMUs of one stage step at once, with inputs that are extrapolated"""


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
        require_free_inputs(self.pairs(), self.fmu, ())
        return self

    def pairs(self) -> list[Pair]:
        """Connections one by one; raises ValueError."""
        return [pair_of(text) for text in self.connections]
