"""Facts about the machine and the versions of a measurement."""

from __future__ import annotations

import os
import platform
import subprocess
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from tests.benchmarks.process import ROOT

PACKAGES = ("numpy", "scipy", "numba", "llvmlite", "pythonfmu", "fmpy", "mcap", "exudyn", "mujoco")


def facts() -> dict[str, Any]:
    """CPU, cores, load, versions, commit; None for unknown ones."""
    return {
        "cpu": _cpu(),
        "cores": os.cpu_count(),
        "cores_allowed": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "load_average": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        "platform": platform.platform(),
        "python": platform.python_version(),
        "packages": {package: _version(package) for package in PACKAGES},
        "commit": _git("rev-parse", "HEAD"),
        "changed": bool(_git("status", "--porcelain", "--untracked-files=no")),
    }


def busy(machine: dict[str, Any]) -> str:
    """Sentence if other work ran at the start, else empty."""
    load, cores = machine["load_average"], machine["cores_allowed"]
    if load is None or load <= 0.5 * cores:
        return ""
    return f"The machine was busy at the start (load average {load:.2g} on {cores} cores): do not quote these figures."


def sentence(machine: dict[str, Any]) -> str:
    """One line with the facts."""
    shown = ("numpy", "numba", "exudyn", "mujoco")
    packages = ", ".join(f"{name} {machine['packages'][name]}" for name in shown if machine["packages"][name])
    commit = f", commit {machine['commit'][:10]}{' with changes' * machine['changed']}" if machine["commit"] else ""
    load = "" if machine["load_average"] is None else f", load average {machine['load_average']:.2g}"
    return f"{machine['cpu']}, {machine['cores_allowed']} cores{load}, Python {machine['python']}, {packages}{commit}."


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _git(*arguments: str) -> str | None:
    try:
        done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()


def _cpu() -> str:
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
