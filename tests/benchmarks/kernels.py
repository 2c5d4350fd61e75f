"""Parts of a chain's step, timed by the present signatures of kernels; only this module knows them.

A kernel is timed in a compiled loop, because passing its arrays from Python costs as much as its work.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

from fmus.kernels.jit import allocating, kernel
from fmus.physics import block_cyclic
from fmus.physics.chain.flexible.assembly import evaluate
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.rigid.links import residual
from fmus.physics.integrate.generalized_alpha import slopes
from fmus.physics.rigid import augmented
from tests.benchmarks.timing import laps, reading

CALLS = 200  # per compiled loop
PARTS = ("matrix", "residual", "factor", "solve")


@contextmanager
def timed(model: Any, times: list[float]) -> Iterator[None]:
    """Append to ``times`` the CPU time, us, that each step of ``model`` spends in its kernel."""
    own, clock, idle = model.compiled_step(), time.thread_time, reading()

    def step(*arguments: Any) -> Any:
        began = clock()
        result = own(*arguments)
        times.append(1e6 * (clock() - began - idle))
        return result

    model._step = step
    try:
        yield
    finally:
        model._step = own


def parts(kind: str, track: Any, h: float, repeats: int) -> dict[str, float]:
    """Time, us, of each of ``PARTS`` in a Newton iteration of a track at step ``h``; destroys its state."""
    loops = {"TrackRigid": _rigid, "TrackFlexible": _flexible}[kind](track, h)
    for loop in loops.values():
        loop(1)  # compiles
    least = laps(repeats, *(partial(_often, loop) for loop in loops.values())).min(axis=1) / CALLS
    return dict(zip(loops, least.tolist(), strict=True))


def _often(loop: Callable[[int], None], _: int) -> None:
    loop(CALLS)


# --- flexible: cables and beams ----------------------------------------------------------------------------


def _flexible(track: Any, h: float) -> dict[str, Callable[[int], None]]:
    s, w, closed = track.s, track.work, track.closed
    chain = [*track.system(), Motion(s.q, s.v, s.vdot), slopes(track.method.alpha, h), w]
    _evaluations(1, True, *chain)
    matrix, right = w.diagonal.copy(), w.right_side.copy()
    return {
        "matrix": lambda n: _evaluations(n, True, *chain),
        "residual": lambda n: _evaluations(n, False, *chain),
        "factor": lambda n: _factorings(n, matrix, w, closed),
        "solve": lambda n: _solutions(n, right, w, closed),
    }


@kernel
def _evaluations(n, tangent, links, contacts, env, x, by, w):
    for _ in range(n):
        evaluate(links, contacts, env, x, by, w, tangent)


@allocating
def _factorings(n, matrix, w, closed):
    for _ in range(n):
        w.diagonal[:] = matrix  # factorised in place
        block_cyclic.factor(w.diagonal, w.upper, w.lower, w.factors, closed)


@allocating
def _solutions(n, right, w, closed):
    for _ in range(n):
        w.right_side[:] = right
        block_cyclic.solve(w.diagonal, w.upper, w.factors, closed, w.right_side)


# --- rigid -------------------------------------------------------------------------------------------------


def _rigid(track: Any, h: float) -> dict[str, Callable[[int], None]]:
    chain = [*track.system(), track.s, track.work, slopes(track.method.alpha, h)]
    half, ends, s = track.link.half, track.link.ends, track.work.system
    _residuals(1, True, *chain)
    matrix = s.iteration_matrix.copy()
    return {
        "matrix": lambda n: _residuals(n, True, *chain),
        "residual": lambda n: _residuals(n, False, *chain),
        "factor": lambda n: _eliminations(n, matrix, half, ends, s, track.work.bushes.stiffness),
        "solve": lambda n: _increments(n, half, ends, s),
    }


@kernel
def _residuals(n, tangent, links, contacts, env, s, w, by):
    for _ in range(n):
        residual(links, contacts, env, s, w, by, tangent)


@allocating
def _eliminations(n, matrix, half, ends, s, bush):
    for _ in range(n):
        s.iteration_matrix[:] = matrix  # inverted in place
        augmented.factor(half, ends, s, bush, 1.0)


@kernel
def _increments(n, half, ends, s):
    for _ in range(n):
        augmented.solve(half, ends, s)
