"""The baseline as one file: states, numbers, trajectories and errors, and the commit that made them."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.physics.arrays import Floats
from fmus.vehicle import BadInput
from orchestrator.studies.chain_states import Kept
from orchestrator.studies.gathering import Gathered

FILE = Path(__file__).with_name("baseline.npz")
DIGITS = 44  # bits that are kept of a number's 52: 3e-14 of it
STATE = "state"  # prefixes of array names
NUMBERS, MOST, GROWN = "numbers", "most", "grown"


class Grown(NamedTuple):
    """A run at T instants, N signals, and what becomes of a change of one ulp in it."""

    name: str
    signals: tuple[str, ...]
    t: Floats  # (T,) s
    values: Floats  # (T, N)
    growth: Floats  # (T, N) largest difference up to then, over the changes that were tried


class Baseline(NamedTuple):
    """What a tree is compared with."""

    made: Mapping[str, str]  # commit, versions, processor
    runs: Sequence[Gathered]
    numbers: Mapping[str, Sequence[Floats]]  # by kind of link, for each run (states, groups)
    most: Mapping[str, Sequence[Floats]]  # what outputs are relative to, likewise (outputs and powers)
    grown: Sequence[Grown]
    errors: Mapping[str, Mapping[str, Mapping[str, float]]]  # of runs, by case and observable: error, doubt

    @property
    def states(self) -> int:
        """How many there are."""
        return sum(len(run.kept.stretch) for run in self.runs)


def save(path: Path, baseline: Baseline) -> None:
    """Write it, whole or not at all; raises OSError."""
    arrays: dict[str, NDArray[Any]] = {
        f"{STATE}.{field}": np.concatenate([_packed(field, run).ravel() for run in baseline.runs])
        for field in Kept._fields
    }
    for kind, found in baseline.numbers.items():
        arrays[f"{NUMBERS}.{kind}"] = _rounded(np.concatenate(found))
        arrays[f"{MOST}.{kind}"] = _rounded(np.array(baseline.most[kind]))
    for k, grown in enumerate(baseline.grown):
        for field, kind_of in (("t", np.float64), ("values", np.float64), ("growth", np.float32)):
            arrays[f"{GROWN}.{k}.{field}"] = getattr(grown, field).astype(kind_of)
    runs = [
        {"name": run.name, "config": run.config, "parameters": run.parameters, "states": len(run.kept.stretch),
         "links": run.kept.turned.shape[1], "wheels": run.kept.spin.shape[1]}
        for run in baseline.runs
    ]  # fmt: skip
    head = {
        "made": baseline.made, "runs": runs, "errors": baseline.errors,
        "grown": [{"name": grown.name, "signals": grown.signals} for grown in baseline.grown],
        "arrays": {name: [array.dtype.str, array.shape] for name, array in arrays.items()},
    }  # fmt: skip
    planes: dict[str, Any] = {name: _planes(array) for name, array in arrays.items()}
    fresh = path.with_name(f"{path.name}.{os.getpid()}.npz")
    np.savez_compressed(fresh, head=np.frombuffer(json.dumps(head).encode(), np.uint8), **planes)
    fresh.replace(path)


@cache
def load(path: Path) -> Baseline:
    """Read it; raises BadInput where there is none."""
    if not path.is_file():
        raise BadInput(
            f"there is no baseline {path}: 'python -m orchestrator.studies.baseline COMMIT' makes it of this tree"
        )
    try:
        with np.load(path) as file:
            head = json.loads(file["head"].tobytes())
            arrays = {name: _array(file[name], np.dtype(kind), shape) for name, (kind, shape) in head["arrays"].items()}
    except (OSError, ValueError, KeyError) as error:
        raise BadInput(f"the baseline {path} cannot be read: {error}") from None
    runs, rest = [], {field: arrays[f"{STATE}.{field}"] for field in Kept._fields}
    for run in head["runs"]:
        n, links, wheels = run["states"], run["links"], run["wheels"]
        of_chain, of_wheels = ((n, 2), (n, 2), (n,), (n, links), (n, links)), ((n, wheels, 2), (n, wheels))
        parts = []
        for field, shape in zip(Kept._fields, (*of_chain, *of_wheels, *of_wheels), strict=True):
            flat, rest[field] = np.split(rest[field], [math.prod(shape)])
            parts.append(_unpacked(field, flat.reshape(shape)))
        runs.append(Gathered(run["name"], run["config"], run["parameters"], Kept(*parts)))
    ends = np.cumsum([run["states"] for run in head["runs"]])[:-1]
    kinds = [name.removeprefix(f"{NUMBERS}.") for name in arrays if name.startswith(NUMBERS)]
    grown = [
        Grown(one["name"], tuple(one["signals"]), *(
            arrays[f"{GROWN}.{k}.{field}"].astype(float) for field in ("t", "values", "growth")
        ))
        for k, one in enumerate(head["grown"])
    ]  # fmt: skip
    return Baseline(
        head["made"], runs, {kind: np.split(arrays[f"{NUMBERS}.{kind}"], ends) for kind in kinds},
        {kind: list(arrays[f"{MOST}.{kind}"]) for kind in kinds}, grown, head["errors"],
    )  # fmt: skip


def _packed(field: str, run: Gathered) -> NDArray[Any]:
    """What changes little from link to link as its changes."""
    array = getattr(run.kept, field)
    return np.diff(array, axis=1, prepend=array.dtype.type(0)) if field in ("turned", "turning") else array


def _unpacked(field: str, array: NDArray[Any]) -> NDArray[Any]:
    return np.cumsum(array, axis=1, dtype=array.dtype) if field in ("turned", "turning") else array


def _rounded(numbers: Floats) -> Floats:
    """To DIGITS bits; what is cut off costs no room."""
    drop = 52 - DIGITS
    bits = np.ascontiguousarray(numbers, dtype=np.float64).view(np.uint64) + np.uint64(1 << (drop - 1))
    return (bits & ~np.uint64((1 << drop) - 1)).view(np.float64)


def _planes(array: NDArray[Any]) -> NDArray[np.uint8]:
    """First bytes of all entries, second bytes, ...: they shrink more."""
    return np.ascontiguousarray(array).reshape(-1).view(np.uint8).reshape(-1, array.dtype.itemsize).T.copy()


def _array(planes: NDArray[np.uint8], kind: np.dtype[Any], shape: Sequence[int]) -> NDArray[Any]:
    return np.ascontiguousarray(planes.T).reshape(-1).view(kind).reshape(shape)
