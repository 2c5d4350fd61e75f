"""How the cost of a step and the storage grow with the links, for each formulation: free loops without a vehicle.

They spin and become oval and round again, so that there is something to iterate on.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from fmus.vehicle import BadInput
from orchestrator.studies.paper.models import named, scene
from orchestrator.studies.paper.states import model
from orchestrator.studies.tables import Row

SCENE = "spinning_loop"
LINKS, QUICK = (16, 32, 64, 128, 256, 512), (16, 64, 256)
SPIN, OVALLING, AT = 5.0, 4.0, 64  # rad/s of so many links; the pins of other loops are as fast
STEP = 1e-3  # s
STEPS, REPEATS = 100, 3


def rows(name: str, numbers: tuple[int, ...]) -> list[Row]:
    """A row a size, and the fitted exponents of time and storage."""
    label, found = named(name).label, []
    for links in numbers:
        share = AT / links
        settings = (
            f"chain.links={links}", f"chain.spin={SPIN * share!r}", f"chain.ovalling={OVALLING * share!r}",
            "track.start=polygon", "track.link_outputs=false",
        )  # fmt: skip
        wanted = scene(named(name), *settings, of=SCENE)
        try:
            if isinstance(wanted, str):
                raise BadInput(wanted)
            chain = model(wanted, "chain")
            found.append(
                Row(
                    "links",
                    label,
                    {"model": name, "links": links, "step": step_time(chain), **storage(chain)},
                    True,
                )
            )
        except (BadInput, RuntimeError, ValueError) as failure:
            return [*found, Row("links", label, {"model": name, "links": links}, note=f"not there: {failure}")]
    exponents = {
        f"exponent_{key}": float(np.polyfit(*np.log([[row["links"], row[key]] for row in found]).T, 1)[0])
        for key in ("step", "bytes")
    }
    return [*found, Row("exponent", label, {"model": name, **exponents}, True)]


def step_time(chain: Any) -> float:
    """CPU time of an implicit step, s: the least of the repeats' medians."""
    times = []
    t = 0.0
    chain.advance(t, STEP)
    for _ in range(REPEATS):
        own = []
        for _ in range(STEPS):
            t += STEP
            began = time.thread_time()
            chain.advance(t, STEP)
            own.append(time.thread_time() - began)
        times.append(float(np.median(own)))
    return min(times)


def storage(chain: Any) -> dict[str, float]:
    """Numbers that describe the motion, multipliers, and bytes of all arrays that a chain steps with."""
    multipliers = getattr(chain.s, "lam", None)
    return {
        "coordinates": float(chain.s.q.size),
        "multipliers": float(0 if multipliers is None else multipliers.size),
        "bytes": float(sum(array.nbytes for array in {id(a): a for a in _arrays(chain.s, chain.work)}.values())),
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
