"""How the cost of a step and the storage grow with the links, for each formulation: free loops without a vehicle.

They spin and become oval and round again, so that there is something to iterate on.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from fmus.vehicle import BadInput
from orchestrator.studies.row import Row
from tests.validation.paper.models import CLOSED, RIGID, TRANSFORMED, named, scene
from tests.validation.paper.states import model

SCENE = "spinning_loop"
LINKS, QUICK = (16, 32, 64, 128, 256, 512), (16, 64, 256)
SPIN, OVALLING, AT = 5.0, 4.0, 64  # rad/s of so many links; the pins of other loops are as fast
STEP = 1e-3  # s
STEPS, REPEATS = 100, 3
IMPLICIT = "track.integrator=generalized_alpha"
PEERS = {TRANSFORMED.name: CLOSED.name}  # whose times are nearer to each other than two moments of a machine


def rows(name: str, numbers: tuple[int, ...]) -> list[Row]:
    """A row a size, and the fitted exponents of times and storage."""
    label, found = named(name).label, []
    for links in numbers:
        try:
            explicit = chain_of(name, links, "track.integrator=runge_kutta")
            figures: dict[str, Any] = {
                "model": name,
                "links": links,
                "evaluation": evaluation_time(explicit),
                **storage(explicit),
            }
            if name in PEERS:
                figures["over_peer"] = in_turn(explicit, chain_of(PEERS[name], links, "track.integrator=runge_kutta"))
            found.append(Row("links", label, figures, True))
        except (BadInput, RuntimeError, ValueError) as failure:
            return [*found, Row("links", label, {"model": name, "links": links}, note=f"not there: {failure}")]
        with suppress(BadInput, RuntimeError, ValueError):  # a formulation that has no implicit steps
            found[-1] = found[-1].having(step=step_time(chain_of(name, links, IMPLICIT)))
        if name == CLOSED.name:
            own, rigid = (chain_of(each, links, IMPLICIT) for each in (name, RIGID.name))
            found[-1] = found[-1].having(step_over_rigid=in_turn(own, rigid, STEP))
    exponents = {f"exponent_{key}": exponent(found, key) for key in ("evaluation", "step", "bytes")}
    return [*found, Row("exponent", label, {"model": name, **exponents}, True)]


def elasticities(numbers: tuple[int, ...]) -> list[Row]:
    """Section 7.1: what (8)-(10) cost over (11)-(15), explicit and implicit, in turn."""
    found = []
    for links in numbers:
        for elasticity in ("general", "engineering"):
            own, small = (
                {
                    way: chain_of(CLOSED.name, links, f"track.elasticity={which}", f"track.integrator={integrator}")
                    for way, integrator in (("evaluation", "runge_kutta"), ("step", "generalized_alpha"))
                }
                for which in (elasticity, "small_deformation")
            )
            figures = {
                "elasticity": elasticity,
                "links": links,
                "evaluation": in_turn(own["evaluation"], small["evaluation"]),
                "step": in_turn(own["step"], small["step"], STEP),
            }
            found.append(Row("elasticity", f"{elasticity} over small_deformation", figures, True))
    return found


def chain_of(name: str, links: int, *settings: str) -> Any:
    """The model of a loop of so many links; raises BadInput, InvalidParameter or StepFailed."""
    share = AT / links
    wanted = scene(
        named(name), f"chain.links={links}", f"chain.spin={SPIN * share!r}", f"chain.ovalling={OVALLING * share!r}",
        "track.start=polygon", "track.link_outputs=false", *settings, of=SCENE,
    )  # fmt: skip
    if isinstance(wanted, str):
        raise BadInput(wanted)
    return model(wanted, "chain")


def exponent(rows: Sequence[Row], key: str) -> float:
    """Slope of the logarithm of a figure over that of the links, by least squares; NaN where one lacks it."""
    points = np.array([[row["links"], row[key]] for row in rows], dtype=float)
    if not np.isfinite(points).all():
        return float("nan")
    across, up = np.log(points).T
    return float(np.polyfit(across, up, 1)[0])


def step_time(chain: Any) -> float:
    """CPU time of an implicit step, s: the least of the repeats' medians."""
    return _least(chain, STEP, STEPS)


def evaluation_time(chain: Any) -> float:
    """CPU time of an explicit step over its evaluations, s, likewise."""
    before = int(chain.counters[1])
    steps = STEPS // 10
    time_of_step = _least(chain, 5.0 * chain.stable, steps)
    return time_of_step * (REPEATS * steps + 1) / (int(chain.counters[1]) - before)


def in_turn(one: Any, other: Any, step: float = 0.0) -> float:
    """CPU time of an evaluation of one chain over that of another, step by step in turn: the median of the pairs.

    ``step`` s: of a step so long, not of its evaluations.
    """
    each: list[list[float]] = [[], []]
    for chain in (one, other):
        chain.advance(0.0, step or 5.0 * chain.stable)
    for k in range(1, STEPS):
        for chain, times in zip((one, other), each, strict=True):
            h, before, began = step or 5.0 * chain.stable, int(chain.counters[1]), time.thread_time()
            chain.advance(k * h, h)
            times.append((time.thread_time() - began) / (1 if step else int(chain.counters[1]) - before))
    return float(np.median(np.divide(each[0], each[1])))


def _least(chain: Any, h: float, steps: int) -> float:
    """CPU time of a step of ``h``, s; the first one, which may compile, does not count."""
    times, t = [], 0.0
    chain.advance(t, h)
    for _ in range(REPEATS):
        own = []
        for _ in range(steps):
            t += h
            began = time.thread_time()
            chain.advance(t, h)
            own.append(time.thread_time() - began)
        times.append(float(np.median(own)))
    return min(times)


def storage(chain: Any) -> dict[str, float]:
    """Numbers that describe the motion, multipliers, and bytes of all arrays that a chain steps with."""
    joints = getattr(chain.work, "joints", None)  # of flexible links: None where they are eliminated
    multipliers = None if hasattr(chain.s, "joints") and chain.s.joints.size else getattr(chain.s, "lam", None)
    multipliers = getattr(joints, "multipliers", multipliers)
    arrays = {id(a): a for a in _arrays(chain.s, chain.work, chain.link)}
    return {
        "coordinates": float(chain.s.q.size),
        "multipliers": float(0 if multipliers is None else multipliers.size),
        "bytes": float(sum(array.nbytes for array in arrays.values())),
    }


def _arrays(*things: Any) -> Iterator[np.ndarray]:
    """The arrays below, each as the whole that it looks into."""
    for thing in things:
        if isinstance(thing, np.ndarray):
            whole = thing
            while isinstance(whole.base, np.ndarray):
                whole = whole.base
            yield whole
        elif isinstance(thing, tuple | list):
            yield from _arrays(*thing)
