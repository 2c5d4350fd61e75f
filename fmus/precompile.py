"""Before a run, in child processes: what a scene loads, and kernels compiled.

A child starts models in plain Python for variables of components and the modules that they load: nothing is compiled,
and a stub of ``jit.dispatch`` imports the same modules for Python as for the compiler, so the state of the cache does
not matter. A chain is laid out as a polygon, because its equilibrium loads no further module; a chain that is released
or spins is shortened.

Another child compiles kernels to the cache, where the component's FMU finds them. An error of the child is ignored: the
FMU meets the same error and reports it.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from fmus.cache import pack
from fmus.cache.files import cache_folder, cached_result, private_folder, read_checked, write_checked
from fmus.cache.sources import ROOT, search_path, source_hash, sources
from fmus.components import COMPONENT_KINDS, model_of
from fmus.interface.ports import Port
from fmus.kernels.numba_internals.compilation import COMPILED

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
        [sys.executable, "-m", "fmus.precompile", "contents"],
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


def _contents_child() -> None:
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
    import_module(f"fmus.{COMPONENT_KINDS[kind].removesuffix('.py').replace('/', '.')}")
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


def start_compilation(parts: Sequence[Recipe], patience: int = 0, native: bool = False) -> subprocess.Popen[str] | None:
    """Start a process that compiles the kernels of parts in turn; None where all are compiled already.

    ``patience`` is the niceness of the process: 0, or a larger number to give way to others. ``native``: see
    ``ComponentModel.compile``.
    """
    left = [part for part in parts if not _is_done(part, native)]
    if not left:
        return None
    COMPILED.info("kernels of %s are compiled beside", ", ".join(kind for kind, _, _ in left))
    child = subprocess.Popen(
        [sys.executable, "-m", "fmus.precompile", "kernels", str(patience), *["native"] * native],
        stdin=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": search_path(ROOT.parent)},
        text=True,
    )
    assert child.stdin is not None
    with child.stdin as stream:
        json.dump(left, stream)
    return child


def _mark(part: Recipe, native: bool) -> Path:
    """File that marks the kernels of a part as compiled from the present sources.

    Tracks have kernels for each kind of ground, pins and links; those of other parts differ little within a kind.
    """
    kind, config, parameters = part
    track, table = config.get("track") or {}, (config.get("vehicle") or {}).get("track") or {}
    on = [key for key in ("ground", "soil", "terrain") if track.get(key)] + ["bushing"] * bool(table.get("bushing"))
    laws = sorted({law["law"] for law in config["vehicle"]["contact"].values()}) if track else []
    words = sorted((k, word) for k, word in parameters.items() if isinstance(word, str) and k != "start")
    shape = hashlib.sha256(repr((on, laws, words, native)).encode()).hexdigest()[:8]
    return cache_folder() / "kernels" / "ahead" / f"{kind}-{shape}-{source_hash()[:20]}"


def _is_done(part: Recipe, native: bool) -> bool:
    try:
        marks = {_mark(part, native), _mark(part, False)}
        return any(read_checked(mark) is not None or pack.read("/".join(mark.parts[-3:])) is not None for mark in marks)
    except OSError:  # the cache cannot be used: compiled kernels would not be kept
        return True


def _kernels_child() -> None:
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # an exception: no half-written file stays in the cache
    if hasattr(os, "nice"):
        os.nice(int(sys.argv[2]))
    native = "native" in sys.argv[3:]
    for part in json.load(sys.stdin):
        kind, config, parameters = part
        with suppress(Exception):
            model = model_of(kind)(config)
            values = {port.name: port.start for port in model.ports if port.causality == "parameter"}
            model.compile(values | parameters, native)
            private_folder(_mark(part, native).parent)
            write_checked(_mark(part, native), b"")


if __name__ == "__main__":
    {"contents": _contents_child, "kernels": _kernels_child}[sys.argv[1]]()
