"""Growth of step cost and storage with the number of links, by formulation, on free loops.

The loops spin and ovalise, so that Newton's method has to iterate.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.studies import Row
from tests.validation.paper.models import CLOSED, RIGID, TRANSFORMED, named, scene
from tests.validation.paper.states import model

SCENE = "spinning_loop"
LINKS, QUICK = (16, 32, 64, 128, 256, 512), (16, 64, 256)
SPIN, OVALLING, AT = 5.0, 4.0, 64  # rad/s for 64 links; the pins of other loops move at the same speed
STEP = 1e-3  # s
STEPS, REPEATS = 100, 3
IMPLICIT = "track.integrator=generalized_alpha"
PEERS = {TRANSFORMED.name: CLOSED.name}  # times so similar that they are measured in turn


def rows(name: str, numbers: tuple[int, ...]) -> list[Row]:
    """Rows of all sizes, and of the fitted exponents of times and storage."""
    label, results = named(name).label, []
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
            results.append(Row("links", label, figures, True))
        except (BadInput, RuntimeError, ValueError) as failure:
            return [*results, Row("links", label, {"model": name, "links": links}, note=f"not there: {failure}")]
        with suppress(BadInput, RuntimeError, ValueError):  # this formulation has no implicit steps
            results[-1] = results[-1].with_figures(step=step_time(chain_of(name, links, IMPLICIT)))
        if name == CLOSED.name:
            own, rigid = (chain_of(each, links, IMPLICIT) for each in (name, RIGID.name))
            results[-1] = results[-1].with_figures(step_over_rigid=in_turn(own, rigid, STEP))
    exponents = {f"exponent_{key}": exponent(results, key) for key in ("evaluation", "step", "bytes")}
    return [*results, Row("exponent", label, {"model": name, **exponents}, True)]


def elasticities(numbers: tuple[int, ...]) -> list[Row]:
    """Section 7.1: cost of (8)-(10) over (11)-(15), explicit and implicit, timed in turn."""
    results = []
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
            results.append(Row("elasticity", f"{elasticity} over small_deformation", figures, True))
    return results


def chain_of(name: str, links: int, *settings: str) -> Any:
    """Model of a loop of ``links`` links; raises BadInput, InvalidParameter or StepFailed."""
    share = AT / links
    wanted = scene(
        named(name), f"chain.links={links}", f"chain.spin={SPIN * share!r}", f"chain.ovalling={OVALLING * share!r}",
        "track.start=polygon", "track.link_outputs=false", *settings, of=SCENE,
    )  # fmt: skip
    return model(wanted, "chain")


def exponent(rows: Sequence[Row], key: str) -> float:
    """Exponent of a figure over the number of links, by least squares of logarithms; NaN if one lacks it."""
    points = np.array([[row["links"], row[key]] for row in rows], dtype=float)
    if not np.isfinite(points).all():
        return float("nan")
    across, up = np.log(points).T
    return float(np.polyfit(across, up, 1)[0])


def step_time(chain: Any) -> float:
    """CPU time of an implicit step, s: least median of the repeats."""
    return _least(chain, STEP, STEPS)


def evaluation_time(chain: Any) -> float:
    """CPU time of an explicit step over its evaluations, s: least median of the repeats."""
    before = int(chain.counters[1])
    steps = STEPS // 10
    time_of_step = _least(chain, 5.0 * chain.stable_step, steps)
    return time_of_step * (REPEATS * steps + 1) / (int(chain.counters[1]) - before)


def in_turn(first: Any, second: Any, step: float = 0.0) -> float:
    """Median ratio of the CPU times of an evaluation of two chains, timed in turn step by step.

    With ``step``, s, the ratio is that of a step of this length.
    """
    each: list[list[float]] = [[], []]
    for chain in (first, second):
        chain.advance(0.0, step or 5.0 * chain.stable_step)
    for k in range(1, STEPS):
        for chain, times in zip((first, second), each, strict=True):
            h, before, began = step or 5.0 * chain.stable_step, int(chain.counters[1]), time.thread_time()
            chain.advance(k * h, h)
            times.append((time.thread_time() - began) / (1 if step else int(chain.counters[1]) - before))
    return float(np.median(np.divide(each[0], each[1])))


def _least(chain: Any, h: float, steps: int) -> float:
    """CPU time of a step of ``h``, s, without the first, which may compile."""
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
    """Numbers of coordinates and multipliers, and bytes of all arrays of a chain's step."""
    joints = getattr(chain.work, "joints", None)  # of flexible links; None if they are eliminated
    multipliers = None if hasattr(chain.s, "joints") and chain.s.joints.size else getattr(chain.s, "lam", None)
    multipliers = getattr(joints, "multipliers", multipliers)
    arrays = {id(a): a for a in _arrays(chain.s, chain.work, chain.link)}
    return {
        "coordinates": float(chain.s.q.size),
        "multipliers": float(0 if multipliers is None else multipliers.size),
        "bytes": float(sum(array.nbytes for array in arrays.values())),
    }


def _arrays(*things: Any) -> Iterator[np.ndarray]:
    """Yield all arrays in nested objects, each as the base of its view."""
    for thing in things:
        if isinstance(thing, np.ndarray):
            whole = thing
            while isinstance(whole.base, np.ndarray):
                whole = whole.base
            yield whole
        elif isinstance(thing, tuple | list):
            yield from _arrays(*thing)
