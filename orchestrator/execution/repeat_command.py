"""Command line that repeats a recorded run."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Mapping
from typing import Any

from fmus.vehicle import BadInput
from orchestrator.log.log_metadata import BRANCHED
from orchestrator.results.run_data import RunData
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load


def command(run: RunData) -> str | None:
    """Return ``cotrack run`` with the settings that differ from the gallery; None if they do not suffice."""
    wanted = run.scene
    if BRANCHED in run.log.metadata:
        return None
    try:
        name, model = str(wanted["name"]), wanted.get("track", {}).get("model")
        settings = [
            f"{key}={json.dumps(value)}" for key, value in _changed_settings(_resolved(name, model, []), wanted)
        ]
        if _resolved(name, model, settings) != wanted:
            return None
    except BadInput:
        return None
    native = ["--native"] if run.log.metadata.get("run", {}).get("fmus") == "native" else []
    links = ["--track", model] if model else []
    return shlex.join(
        ["cotrack", "run", name, *links, *native, *(part for setting in settings for part in ("--set", setting))]
    )


def _resolved(name: str, model: str | None, settings: list[str]) -> Any:
    return json.loads(json.dumps(placed(load(name, model, settings)).resolved()))


def _changed_settings(base: Mapping[str, Any], wanted: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted keys and values of ``wanted`` that ``base`` lacks or that differ."""
    for key, value in wanted.items():
        if isinstance(value, Mapping) and isinstance(base.get(key), Mapping):
            yield from _changed_settings(base[key], value, f"{above}{key}.")
        elif base.get(key) != value:
            yield f"{above}{key}", value
