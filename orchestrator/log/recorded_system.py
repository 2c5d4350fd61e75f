"""System graph (``system.json``) and model descriptions in a log, which may come from anyone."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator

from fmus.vehicles.tables import first_error
from orchestrator.log.log_metadata import TEXTS
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.log.signal_names import recorded_texts

Integer = Annotated[int, Field(ge=-(2**31), lt=2**31)]  # of FMI


class _StrictModel(BaseModel):
    model_config = ConfigDict(strict=True)


class _Instance(_StrictModel):
    name: str
    fmu: str | None = None  # file name; without it and the hash of its content: a component without an FMU
    sha256: str | None = None
    parameters: dict[str, bool | Integer | float | str] = Field(default_factory=dict)
    stage: Integer = 0
    inputs: dict[str, float] = Field(default_factory=dict)  # given before the start
    conversions: dict[str, list[float]] = Field(default_factory=dict)  # factor and offset
    units: dict[str, str] = Field(default_factory=dict)


class _Connection(_StrictModel):
    source: str
    outputs: list[str]
    target: str
    inputs: list[str]


_TEXTS = TypeAdapter(dict[str, list[str]], config=ConfigDict(strict=True))


class _System(_StrictModel):
    instances: list[_Instance]
    connections: list[_Connection]

    @model_validator(mode="after")
    def _fits(self) -> _System:
        names = [instance.name for instance in self.instances]
        if len(set(names)) < len(names):
            raise ValueError("two instances have one name")
        for connection in self.connections:
            if not {connection.source, connection.target} <= set(names):
                raise ValueError(f"no instances '{connection.source}' and '{connection.target}' to connect")
            if len(connection.outputs) != len(connection.inputs):
                raise ValueError("a connection does not have as many outputs as inputs")
        if any(len(numbers) != 2 for instance in self.instances for numbers in instance.conversions.values()):
            raise ValueError("a conversion must be a factor and an offset")
        return self


def system_of(log: Log) -> dict[str, Any]:
    """Return instances and connections as written by ``execution.manifest``, validated.

    Raises LogUnreadable, Missing.
    """
    table = log.table("system.json")
    try:
        _System.model_validate(table)
    except ValidationError as error:
        raise LogUnreadable(first_error(error, f"{log.path}: system.json", _System.model_json_schema())) from None
    return table


def texts_of(log: Log) -> dict[str, list[str]]:
    """Return the texts of Strings by their numbers in the log, by signal; raises LogUnreadable."""
    table = log.table(TEXTS) if TEXTS in log.attachments else {}
    try:
        return _TEXTS.validate_python(table)
    except ValidationError as error:
        raise LogUnreadable(first_error(error, f"{log.path}: {TEXTS}", _TEXTS.json_schema())) from None


def signal_description(log: Log, signal: str) -> str:
    """Return the model description's text on "instance.variable"; "" if it is missing or damaged."""
    instance, _, variable = signal.partition(".")
    return recorded_texts(log.attachment, instance).get(variable, "")
