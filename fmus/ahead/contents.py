"""Variables of components, and modules that they load: a child process starts their models in plain Python.

Nothing is compiled: a stub of ``jit.dispatch`` imports the same modules for Python as for the compiler, so the state
of the cache does not matter. A chain is laid out as a polygon, because its equilibrium loads no further module; a chain
that is released or spins is shortened.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any, NamedTuple

from fmus.cache.files import cached_result
from fmus.cache.sources import ROOT, search_path, source_hash, sources
from fmus.components import KINDS, model_of
from fmus.interface.ports import Port

SHORT = 5  # links of a shortened chain
Recipe = tuple[str, Mapping[str, Any], Mapping[str, Any]]  # kind of component, its config, its parameters


class Contents(NamedTuple):
    """Modules and sizes of a set of components."""

    modules: tuple[str, ...]  # modules of fmus that are loaded
    left_out: tuple[str, ...]  # modules of fmus that are not loaded
    outputs: tuple[int, ...]  # Real outputs of each component without link outputs
    link_outputs: tuple[int, ...]  # link outputs of each component
    state: tuple[int, ...]  # size of each component's state


def component_ports(kind: str, config: Mapping[str, Any]) -> tuple[Port, ...]:
    """Variables of a component, which is neither built nor started."""
    ports: tuple[Port, ...] = model_of(kind)(config).ports
    return ports


def loaded_contents(parts: Sequence[Recipe]) -> Contents:
    """Start the parts in a child process; raises BuildFailed with the last message of the child.

    The result is cached for this build.
    """
    return Contents(*map(tuple, cached_result("contents", "modules", [source_hash(), parts], lambda: _started(parts))))


def _started(parts: Sequence[Recipe]) -> Contents:
    from fmus.fmi.build import BuildFailed  # the child does not need it

    child = subprocess.run(
        [sys.executable, "-m", "fmus.ahead.contents"],
        input=json.dumps(parts),
        text=True,
        capture_output=True,
        env={**os.environ, "PYTHONPATH": search_path(ROOT.parent), "NUMBA_DISABLE_JIT": "1"},
    )
    if child.returncode:
        message = (child.stderr.strip() or "no message").splitlines()[-1]
        raise BuildFailed(message.removeprefix("fmus.interface.model.InvalidParameter: "))
    report = json.loads(child.stdout)
    loaded = tuple(sorted(report["modules"]))
    everything = {".".join(("fmus", *file.relative_to(ROOT).with_suffix("").parts)) for file in sources()}
    rest = (name for name in everything if not name.endswith(".__init__") and name not in loaded)
    return Contents(loaded, tuple(sorted(rest)), *(tuple(report[key]) for key in ("outputs", "link_outputs", "state")))


def _child() -> None:
    report: dict[str, list[Any]] = {"outputs": [], "link_outputs": [], "state": []}
    for kind, config, parameters in json.load(sys.stdin):
        model = _start_model(kind, config, parameters)
        reals = sum(port.causality == "output" and isinstance(port.start, float) for port in model.ports)
        report["outputs"].append(reals - model.link_ports)
        report["link_outputs"].append(model.link_ports)
        report["state"].append(model.state.size)
    loaded = {name for name, module in sys.modules.items() if not hasattr(module, "__path__")}  # without packages
    modules = [name for name in loaded - {"fmus.components"} if name.startswith("fmus.")]
    json.dump({**report, "modules": modules}, sys.stdout)


def _start_model(kind: str, config: dict[str, Any], parameters: dict[str, Any]) -> Any:
    import_module(f"fmus.{KINDS[kind].removesuffix('.py').replace('/', '.')}")
    model_class = model_of(kind)
    model = model_class(config)
    values = {port.name: port.start for port in model.ports if port.causality == "parameter"} | parameters
    start = values.get("start")
    if start in ("displaced", "straight", "folded") or values.get("start.spin"):
        track = config["track"]
        ends = dict(track["ends"] or {})
        if "last" in ends:
            ends["last"] = [x * SHORT / track["links"] for x in ends["last"]]
        model_class({**config, "track": {**track, "links": SHORT, "ends": ends or None}}).initialise(values)
        model.tighten = lambda: None
    if start in ("rest", "displaced"):
        values["start"] = "polygon"
    model.initialise(values)
    return model


if __name__ == "__main__":
    _child()
