"""Kinds of components, and where their models and shells are."""

from __future__ import annotations

import re
from importlib import import_module
from typing import Any

from fmus.track.choices import TRACKS


def folder(kind: str) -> str:
    """Folder of a kind of component in ``fmus``: ``track_rigid`` of TrackRigid."""
    return re.sub(r"(?<!^)([A-Z])", r"_\1", kind).lower()


OTHERS = "Chassis", "SprocketDrive", "SteeringDifferential", "Driver"
# kind of component -> its shell; the file names differ, because modules are global to a process
COMPONENT_KINDS = {
    kind_name: f"{folder(kind_name)}/{folder(kind_name)}_fmu.py"
    for kind_name in (*(kind.fmu for kind in TRACKS.values()), *OTHERS)
}


def model_of(kind: str) -> Any:
    """Class of the model of a kind of component."""
    return import_module(f"fmus.{folder(kind)}.model").Model
