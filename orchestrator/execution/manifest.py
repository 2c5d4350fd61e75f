"""Contents of a log that a run writes besides its messages, at the head and at the end.

Before step 0: topics, scene, system with the hash of every FMU, metadata. In the closing record: cost, error estimate
and validity as JSON texts by name; ``encode_results`` makes them of a summary, ``decode_results`` returns the entries
of a summary that cannot be computed again.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import subprocess
import zipfile
from collections.abc import Mapping
from contextlib import suppress
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from llvmlite.binding import llvm_version_info
from pydantic import BaseModel, ValidationError, model_validator

from fmus.fmi.build import identity
from orchestrator import __version__
from orchestrator.cosim.component import Component
from orchestrator.cosim.coupling.scheme import Scheme
from orchestrator.cosim.graph import Connection, Instance, Recordable, System
from orchestrator.cosim.observers import STATISTICS_PARTS, STATS, statistics_names, wires
from orchestrator.log import schema
from orchestrator.log.log_metadata import INPUTS, TEXTS, UNRECORDED, path_text_of
from orchestrator.log.recorder import Recorder
from orchestrator.scene.system_scene import SystemScene

PACKAGES = ("numpy", "scipy", "numba", "pythonfmu", "fmpy", "mcap", "protobuf")
NATIVE = "native"  # kind of FMUs, in the metadata of a log
STATS_PERIOD = 0.1  # s of simulated time between records of solver cost


def open_log(
    path: Path,
    scene: SystemScene,
    graph: System,
    components: Mapping[str, Recordable],
    scheme: Scheme,
    about: Mapping[str, str] | None = None,
    further_metadata: Mapping[str, Mapping[str, str]] | None = None,
) -> Recorder:
    """Open the log of a run; raises LogFailed.

    ``about`` adds entries to the metadata ``run``; ``further_metadata``: metadata besides, by name.
    """
    topics, attachments, metadata = manifest(scene, graph, components)
    metadata["run"] |= about or {}
    metadata |= {name: dict(entries) for name, entries in (further_metadata or {}).items()}
    wired = wires(scheme) if scene.run.outputs == 1 else {}
    every = _strides(scene, components)
    if scene.records_statistics:
        for name, component in components.items():
            if component.links:
                topic = f"/{name}/links/between"
                units = [component.unit(variable) for variable in component.links]
                names = statistics_names(component.links)
                topics[topic] = list(zip(names, units * len(STATISTICS_PARTS), strict=True))
                every[topic] = every[f"/{name}/links"]
    unrecorded = () if scene.run.inputs else [f"/{name}/in" for name in components]
    if unrecorded:
        wired = {}
        metadata["run"][INPUTS] = UNRECORDED
    return Recorder(
        path, topics, attachments, metadata, every=every, wires=wired, types=_types(components), unrecorded=unrecorded
    )


def manifest(
    scene: SystemScene, graph: System, components: Mapping[str, Recordable]
) -> tuple[dict[str, list[tuple[str, str]]], dict[str, bytes], dict[str, dict[str, str]]]:
    """Return topics -> (variable, unit), attachments and metadata of a log before step 0."""
    topics: dict[str, list[tuple[str, str]]] = {}
    attachments = {
        "scene.json": as_json(scene.resolved()),
        "system.json": as_json(system_table(graph, components)),
    }
    for name, component in components.items():
        families = {"in": component.inputs, "out": component.outputs, "links": component.links}
        for topic, names in families.items():
            if names or topic != "links":
                topics[f"/{name}/{topic}"] = [(variable, component.unit(variable)) for variable in names]
        counters = [(counter, "1") for counter in component.integers]
        topics[f"/stats/{name}"] = counters + [(figure, "s") for figure in STATS]
    for instance in graph.instances:
        if instance.fmu is not None:
            attachments[f"{instance.name}.modelDescription.xml"] = model_description(instance.fmu)
    metadata = {
        "run": {
            "scene": scene.name,
            "title": scene.title,
            "track": scene.variant,
            "coupling": str(scene.run.coupling),
            "step": repr(scene.run.step),
            "step_control": "fixed" if scene.run.variable is None else str(scene.run.variable),
            "stop": repr(scene.run.stop),
        },
        "versions": {
            "python": platform.python_version(),
            "cotrack": __version__,
            **{package: _version(package) for package in PACKAGES},
        },
        "provenance": provenance(),
    }
    return topics, attachments, metadata


def system_table(graph: System, components: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the system graph as plain data, with the hash of every FMU, and inputs given before the start."""
    return {
        "instances": [
            {
                "name": instance.name,
                **({} if instance.fmu is None else _file(instance.fmu)),
                **({} if instance.fmu is None or instance.imported else {"numbers": numbers_digest(instance)}),
                "parameters": dict(instance.parameters),
                "stage": instance.stage,
                **({"conversions": dict(instance.conversions)} if instance.conversions else {}),
                **({"units": dict(instance.units)} if instance.units else {}),
                **_start_inputs((components or {}).get(instance.name)),
            }
            for instance in graph.instances
        ],
        "connections": [_connection(connection) for connection in graph.connections],
    }


def _connection(connection: Connection) -> dict[str, Any]:
    """Table of a connection; its transformations are among the conversions of its target."""
    return {name: value for name, value in connection._asdict().items() if name != "transformations"}


def numbers_digest(instance: Instance) -> str:
    """SHA-256 of the numbers of an instance of ours: its parameters, and those of its resources."""
    digest = hashlib.sha256(json.dumps(dict(instance.parameters), sort_keys=True).encode())
    for file in () if instance.resources is None else sorted(instance.resources.iterdir()):
        digest.update(file.read_bytes())
    return digest.hexdigest()


def _start_inputs(component: Any) -> dict[str, Any]:
    return {"inputs": component.start_inputs} if isinstance(component, Component) and component.start_inputs else {}


def provenance() -> dict[str, str]:
    """Return time, system, processor, LLVM version and commit of a run, without unknown entries."""
    entries = {
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "system": platform.platform(),
        "processor": _processor(),
        "llvm": ".".join(map(str, llvm_version_info)),
        "commit": _commit(),
    }
    return {name: text for name, text in entries.items() if text}


@cache
def _processor() -> str:
    """Return number and name of the processors."""
    name = platform.processor()
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
        name = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), name)
    return f"{os.cpu_count()} x {name}" if name else ""


@cache
def _commit() -> str:
    """Return the git commit of the sources, with "+" if they are changed; empty for an installed package."""
    root = Path(__file__).parents[2]
    if not (root / ".git").exists():
        return ""

    def git(*words: str) -> str:
        command = ["git", "--no-optional-locks", "-C", str(root), *words]  # no file is written there
        return subprocess.run(command, capture_output=True, text=True, timeout=10, check=True).stdout.strip()

    with suppress(OSError, subprocess.SubprocessError):
        changed = git("status", "--porcelain", "--untracked-files=no", "--", "fmus", "orchestrator")
        return git("rev-parse", "HEAD") + ("+" if changed else "")
    return ""


def attach_texts(recorder: Recorder, components: Mapping[str, Component]) -> None:
    """Attach the texts of connected Strings, which the log holds as numbers."""
    texts = {signal: words for each in components.values() for signal, words in each.variables.recorded_texts().items()}
    if texts:
        recorder.attach(TEXTS, as_json(texts))


def _types(components: Mapping[str, Recordable]) -> dict[str, str]:
    """Return topic -> message type; instances of one kind of FMU share their types."""
    return {
        f"/{name}/{topic}": schema.type_name(f"/{component.description.modelName}/{topic}")
        for name, component in components.items()
        if isinstance(component, Component)
        for topic in ("in", "out", "links")
    }


def _strides(scene: SystemScene, components: Mapping[str, Recordable]) -> dict[str, int]:
    """Return topic -> recording interval in communication steps."""
    every = {"out": scene.run.outputs, "links": scene.links_every}
    return {f"/{name}/{kind}": steps for name in components for kind, steps in every.items()}


def model_description(fmu: Path) -> bytes:
    """Read modelDescription.xml in an FMU."""
    with zipfile.ZipFile(fmu) as archive:
        return archive.read("modelDescription.xml")


def as_json(data: Any) -> bytes:
    """Encode data as the JSON bytes of an attachment."""
    return json.dumps(data, indent=1, sort_keys=True).encode()


def _file(fmu: Path) -> dict[str, str]:
    return {"fmu": path_text_of(fmu.name), "sha256": identity(fmu)}


@cache
def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:  # run from its sources
        return "not installed"


COST = ("startup_time", "wall_time", "cpu_time", "real_time_factor", "rejected_steps", "components")


class ObservableError(BaseModel):
    """Estimated error of an observable; relative except ``absolute``, which is in ``unit``."""

    unit: str
    absolute: float
    coupling: float | None
    integration: float | None
    total: float
    order: float | None = None  # observed
    safety: float | None = None  # factor; None in a log of an earlier version
    decisive: bool


class ErrorEstimate(BaseModel):
    """Error estimate of a run (``estimate.estimate``); without a total, ``message`` is the reason."""

    coupling: float | None
    integration: float | None
    total: float | None
    observables: dict[str, ObservableError]
    without: list[str] = []
    no_order: str = ""
    wall_time: float
    message: str

    @model_validator(mode="after")
    def _check_total(self) -> ErrorEstimate:
        if self.total is not None and not any(one.decisive for one in self.observables.values()):
            raise ValueError("a total needs a decisive observable")
        return self


class Results(BaseModel):
    """Results that ``decode_results`` returns; times in s. A log of an earlier version lacks some."""

    startup_time: float = 0.0
    wall_time: float = 0.0
    cpu_time: float = 0.0
    real_time_factor: float = 0.0
    rejected_steps: int = 0
    components: dict[str, dict[str, int | float]] = {}
    error: ErrorEstimate | None = None


def encode_results(summary: Mapping[str, Any]) -> dict[str, str]:
    """Return the results of a summary as JSON texts, without those that are None."""
    chosen = {
        **{name: summary[name] for name in COST},
        "energy_residual": (summary["energy"] or {}).get("residual_relative"),
        "error": summary["error"],
        "validity": summary["validity"] or None,
    }
    return {name: json.dumps(value) for name, value in chosen.items() if value is not None}


def decode_results(results: Mapping[str, str]) -> dict[str, Any]:
    """Return cost and error estimate as entries of a summary; those of an empty run if the texts are damaged."""
    try:
        known = {name: json.loads(text) for name, text in results.items() if name in Results.model_fields}
        return Results.model_validate(known).model_dump()
    except (ValidationError, ValueError, RecursionError):
        return Results().model_dump()
