"""What is kept of an evaluation: one number a group, and the size that a difference of it is relative to.

A group is an array of one kind (contact residual, wrenches, outputs, ...) and its number the sum of its entries, each
times a weight of its own between 1/2 and 1 of either sign. What two trees differ in is told relative to the norm of the
group, or to a floor where rounding does not fall with the group:

- what steel's axial stiffness EA makes is rounded as EA is, 2e-16 of it: the floor is the force of a strain of STRAIN;
- a contact force is rounded as the place of its point is: the floor is the force of a depth of DEPTH;
- places farther away than NEAR are rounded more, and so are both floors;
- the tangent of friction is rounded as slip over friction velocity is: below SLOW matrices are relative to more;
- outputs have units of their own: each is relative to the most of it that a run shows.

Contacts have groups of their own, of ``bare`` chains, where the axial forces of steel do not hide them: an error of
1e-9 in one contact force of a hundred equal ones is an error of 1e-10 of its group. So have the links, of ``soft``
chains, which are strained far more than steel.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from functools import cache

import numpy as np
from numpy.typing import NDArray

from fmus.physics.arrays import Floats
from orchestrator.studies.chain_states import Completed, Elastic
from orchestrator.studies.evaluations import BARE, SOFT, STEEL, Chain, Found
from orchestrator.studies.gathering import Gathered

WHOLE = ("residual", "matrix", "report", "links")
OF_SOFT = ("soft residual", "soft matrix")
OF_BARE = ("contact residual", "contact matrix", "wrenches", "contact powers")
PINNED = ("pin misfit", "pin jacobian")
GROUPS: dict[str, tuple[str, ...]] = {  # of the kinds of links; elasticities of cables touch as the cable does
    "cable": WHOLE + OF_SOFT + OF_BARE,
    "general": WHOLE + OF_SOFT,
    "engineering": WHOLE + OF_SOFT,
    "planar": WHOLE + OF_SOFT + OF_BARE,
    "beam": WHOLE + OF_SOFT + OF_BARE,
    "rigid": WHOLE + PINNED + OF_BARE,
}
STRAIN = 1e-3
DEPTH = 1e-3  # m
NEAR = 10.0  # m
SLOW = 1e-3  # m/s
FORCE = 1e3  # N, of a chain without stiffness
LEAST = {"m": 1.0, "m/s": 1.0, "N": FORCE, "Pa": 1.0, "J": 100.0, "W": 1e3}  # an output is relative to
STORED = 1e-4  # and strain energy to this part of EA times the pitch
LONG = 2e-2  # s, step of the other matrices: inertia is then no larger than contacts and rubber
SLOPES, INERTIA = 300.0, 1e-2  # of a soft chain: its strains and accelerations over those of steel
SHARP = 3  # one state in so many has its bare matrix in the sharp branch of friction


@cache
def weights(group: str, size: int) -> Floats:
    """Of the entries of a group, the same for ever."""
    draw = np.random.RandomState(zlib.crc32(group.encode())).random_sample(2 * size)
    return np.where(draw[::2] < 0.5, -1.0, 1.0) * (0.5 + 0.5 * draw[1::2])


@cache
def vector(size: int = 1 << 15) -> Floats:
    """What an iteration matrix is multiplied by."""
    return 2.0 * np.random.RandomState(0).random_sample(size) - 1.0


def shown(kind: str, run: Gathered, states: Completed) -> Floats:
    """The most that a run shows of each output, then of each power of its contacts: what these are relative to."""
    chains = _chains(kind, run)
    whole = chains[STEEL]
    most = np.array([LEAST.get(unit, 1.0) for unit in whole.units])
    for i, (name, unit) in enumerate(zip(whole.outputs, whole.units, strict=True)):
        stiff = {"N": STRAIN * whole.axial, "Pa": STRAIN * whole.modulus}.get(unit, 0.0)
        most[i] = max(most[i], STORED * whole.axial * whole.pitch if name == "energy.strain" else stiff)
    every = range(len(states.step))
    found = [abs(evaluation(whole, states, k).report) for k in every]
    powers = [abs(evaluation(chains[BARE], states, k).powers) for k in every] if BARE in chains else []
    sizes = np.max([most, *found], axis=0), np.max([np.full(3, LEAST["W"]), *powers], axis=0)
    return np.concatenate(sizes).astype(np.float32).astype(float)


def numbers(
    kind: str, run: Gathered, states: Completed, chosen: NDArray[np.int64], most: Floats
) -> tuple[Floats, Floats]:
    """The numbers (S, G) of S ``chosen`` states of a run, outputs relative to ``most`` (``shown``), of G groups.

    NaN where a chain touches nothing. With them the sizes (S, G) that differences are relative to.
    """
    chains = _chains(kind, run)
    values, sizes = np.full((2, len(chosen), len(GROUPS[kind])), np.nan)
    for row, k in enumerate(chosen):
        far = max(1.0, float(np.abs(states.coordinates.position[k]).max()) / NEAR)
        parts = [part for chain in chains.values() for part in _arrays(chain, evaluation(chain, states, k), most, far)]
        for column, (group, (array, least)) in enumerate(zip(GROUPS[kind], parts, strict=False)):
            values[row, column] = weights(group, array.size) @ array
            sizes[row, column] = max(float(np.sqrt(array @ array)), least)
            if group.endswith("matrix"):
                sizes[row, column] *= max(1.0, SLOW / chains[STEEL].friction_velocity)
    return values, sizes


def _chains(kind: str, run: Gathered) -> dict[str, Chain]:
    """The variants of the chain of a run with this kind of link, those that have groups."""
    whole = Chain(kind, run.config, run.parameters)
    wanted = {SOFT: OF_SOFT[0] in GROUPS[kind], BARE: OF_BARE[0] in GROUPS[kind] and whole.touches}
    others = (variant for variant, is_wanted in wanted.items() if is_wanted)
    return {STEEL: whole} | {variant: Chain(kind, run.config, run.parameters, variant) for variant in others}


def evaluation(chain: Chain, states: Completed, k: int) -> Found:
    """Of state ``k``; a bare chain is not accelerated and its pins carry nothing, a soft one is bent more."""
    state = states.at(k)
    if chain.variant == STEEL:
        return chain.evaluate(state, float(state.step), vector())
    if chain.variant == SOFT:
        return chain.evaluate(_bent(state, chain.pitch), LONG, vector())
    rigid = state.rigid
    state = state._replace(
        accelerations=Elastic(*(0.0 * part for part in state.accelerations)),
        rigid=rigid._replace(acceleration=0.0 * rigid.acceleration, pull=0.0 * rigid.pull),
    )
    return chain.evaluate(state, LONG, vector(), sharp=k % SHARP == 0)


def _bent(state: Completed, pitch: float) -> Completed:
    """A state whose slopes are farther from the chords of the links, and which is accelerated less."""
    q, links = state.coordinates, len(state.coordinates.begin)
    chord = (np.roll(q.position, -1, axis=0) - q.position)[:links] / pitch
    bent = {field: chord + SLOPES * (getattr(q, field) - chord) for field in ("begin", "end")}
    less = Elastic(*(INERTIA * part for part in state.accelerations))
    return state._replace(coordinates=q._replace(**bent), accelerations=less)


def _arrays(chain: Chain, found: Found, most: Floats, far: float) -> Iterator[tuple[Floats, float]]:
    """Arrays of a variant's groups, and the least that each is relative to; ``far``: places over NEAR, at least 1."""
    if chain.variant == BARE:
        yield found.residual, DEPTH * chain.contact * far
        yield found.matrix, chain.contact
        yield found.wrenches, DEPTH * chain.contact * far
        yield found.powers / most[len(found.report) :], 1.0
        return
    force = STRAIN * chain.axial or FORCE
    yield found.residual, force * far * np.sqrt(found.residual.size)
    yield found.matrix, max(chain.axial / chain.pitch, 1.0)
    if chain.variant == SOFT:
        return
    yield found.report / most[: len(found.report)], 1.0
    tension, stress, position, joint = found.links
    force = max(force, FORCE)
    links = np.concatenate([tension / force, stress / max(1.0, STRAIN * chain.modulus), position, joint / force])
    yield links, far * float(np.sqrt(links.size))
    if chain.kind == "rigid":
        yield found.pins, chain.pitch * far
        yield found.jacobian, 1.0
