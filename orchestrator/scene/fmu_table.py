"""Table ``[fmu.NAME]``: an FMU of the user in place of the part NAME of a scene, or a further one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from fmus.vehicle import BadInput, FrozenTable, In
from orchestrator.scene.toml_text import toml_text

Integer = Annotated[int, Field(ge=-(2**31), le=2**31 - 1)]  # of FMI
Value = Annotated[
    bool | Integer | Annotated[float, Field(allow_inf_nan=False)] | str,
    Field(json_schema_extra={"unit": "that of the parameter", "description": "value of the parameter NAME of the FMU"}),
]


def _absolute(file: str) -> str:
    return str(Path(file).absolute())


class FmuTable(FrozenTable):
    """FMU of the user in place of the part NAME, with its connections; else a further one, with those of the scene."""

    file: Annotated[str, Field(pattern=r"^[^\x00]+$"), AfterValidator(_absolute)]
    """FMU for co-simulation (FMI 2.0 or 3.0); its path is relative to the scene file"""
    parameters: dict[str, Value] = Field(default_factory=dict)
    """parameters of the FMU by their names, and start values of its inputs; it gets those of the part too"""
    in_process: bool = False
    """an FMU that cotrack has not built runs in the process of the run, where it can do harm, not in one of its own"""
    call_limit: Annotated[float, In("s", gt=0)] | None = None
    """longest time of a call of an FMU in a process of its own; without it a call may last as long as it likes"""
    non_finite: Literal["fail", "warn"] = "fail"
    """what an output that is not finite does: the run fails, or goes on with a warning"""


def require_instance_name(name: str) -> None:
    """Raise ValueError for a name that no connection or topic can have."""
    if not name or set(name) & set("./\\") or not name.isprintable():
        raise ValueError(f"fmu.'{name}': the name of an instance must have no dot and no slash")


def set_folder(table: Mapping[str, Any], folder: Path) -> None:
    """Make the paths of FMUs in a raw scene, which are relative to ``folder``, absolute."""
    entries = table.get("fmu")
    for entry in entries.values() if isinstance(entries, dict) else ():
        if isinstance(entry, dict) and isinstance(entry.get("file"), str):
            entry["file"] = str(folder.absolute() / entry["file"])


def replacing_fmu(text: str) -> str:
    """Setting that ``NAME=FMU`` stands for; raises BadInput."""
    name, equals, file = text.partition("=")
    if not (name.strip() and equals and file):
        raise BadInput(f"--replace {text}: must be NAME=FMU, the name of a part and a file")
    return f"fmu.{name.strip()}.file={toml_text(file)}"
