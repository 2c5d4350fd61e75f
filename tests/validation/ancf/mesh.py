"""Mesh of elements and joints: e = B q + b, with a constant B that contains all joints and supports.

Forces by element coordinates e are computed element by element in compiled loops and reduced by B^T. The mass matrix
B^T M B is constant; there are no constraint equations and no multipliers.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from copy import copy
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse.linalg import splu

from fmus.physics.arrays import Floats
from tests.validation.ancf.joints import Joint, smooth
from tests.validation.ancf.many import dampings, energies, forces, tangents

End = tuple[int, int]  # element, counted over all parts; 0: its first node, 1: its second


class Member(NamedTuple):
    """Elements of one kind and section."""

    element: Any  # a module of fmus.physics.ancf: cable, cable_general, cable_engineering, beam
    section: tuple  # its parameters
    e: Floats  # (n, rows, 3) coordinates at the start


class Tie(NamedTuple):
    """Joint between two ends; an end depends on at most one other."""

    leads: End
    follows: End
    joint: Joint


class Support(NamedTuple):
    """End with only some of its coordinates free."""

    end: End
    free_directions: Floats  # (3 rows, free), orthonormal columns


class Load(Protocol):
    """Generalised force on the coordinates q, and its derivative."""

    def force(self, q: Floats) -> Floats: ...
    def tangent(self, q: Floats) -> sparse.csr_array | float: ...


class Spring(Load, Protocol):
    """Elasticity of a mesh besides that of its elements."""

    def energy(self, q: Floats) -> float: ...


def nodes(element, start: ArrayLike, frame: ArrayLike, l: float, n: int) -> Floats:
    """Coordinates (n, rows, 3) of n undeformed elements in a row along the first column of ``frame``."""
    start, frame = np.asarray(start, float), np.asarray(frame, float)
    rows = element.ROWS // 2
    e = np.empty((n, 2, rows, 3))
    e[:, :, 1:] = frame.T[: rows - 1]
    e[:, :, 0] = start + np.add.outer(np.arange(n), np.arange(2))[..., None] * l * frame[:, 0]
    return e.reshape(n, 2 * rows, 3)


def in_a_row(rows: int, n: int, first: int = 0) -> list[Tie]:
    """Ties that join n elements smoothly; ``rows``: vectors of an end."""
    return [Tie((k, 1), (k + 1, 0), smooth(rows)) for k in range(first, first + n - 1)]


class Mesh:
    """Parts, ties and supports, with the ties eliminated."""

    def __init__(self, parts: Sequence[Member], ties: Iterable[Tie] = (), supports: Iterable[Support] = ()) -> None:
        # the class of the section decides the element, whichever cable module was given
        self.parts = tuple(part._replace(section=part.element.Section(*part.section)) for part in parts)
        self.loads: tuple[Load, ...] = ()
        self.springs: tuple[Spring, ...] = ()
        self.e0 = np.concatenate([part.e.ravel() for part in parts])
        self.ends = _ends(parts)  # place of each end in e
        self.B, self.b = _eliminate(self.ends, list(ties), list(supports), self.e0)
        self.M_e = sparse.block_diag([np.kron(_mass(part), np.eye(3)) for part in parts for _ in part.e], format="csr")
        self.M = (self.B.T @ self.M_e @ self.B).tocsc()

    @property
    def n(self) -> int:
        """Degrees of freedom."""
        return self.B.shape[1]

    @property
    def equations(self) -> int:
        """Number of eliminated scalar equations of joints and supports."""
        return self.B.shape[0] - self.B.shape[1]

    def loaded(self, *loads: Load) -> Mesh:
        """Return the mesh with loads."""
        mesh = copy(self)
        mesh.loads = loads
        return mesh

    def sprung(self, *springs: Spring) -> Mesh:
        """Return the mesh with springs."""
        mesh = copy(self)
        mesh.springs = springs
        return mesh

    def coordinates(self, q: Floats) -> Floats:
        """Element coordinates e of q, flat."""
        return self.B @ q + self.b

    def fit(self, e: Floats) -> Floats:
        """Least-squares q of element coordinates; exact if these satisfy the joints."""
        return splu((self.B.T @ self.B).tocsc()).solve(self.B.T @ (e.ravel() - self.b))

    def start(self) -> Floats:
        """Coordinates q of the undeformed mesh."""
        return self.fit(self.e0)

    def split(self, e: Floats) -> list[Floats]:
        """Views (n, rows, 3) of flat element coordinates, one for each part."""
        bounds = np.cumsum([part.e.size for part in self.parts])
        return [flat.reshape(part.e.shape) for flat, part in zip(np.split(e, bounds[:-1]), self.parts, strict=True)]

    def place(self, end: End) -> slice:
        """Slice of an end in the flat element coordinates."""
        return self.ends[2 * end[0] + end[1]]

    def end(self, q: Floats, end: End) -> Floats:
        """Vectors (rows, 3) of an end at q."""
        return self.coordinates(q)[self.place(end)].reshape(-1, 3)

    def pull(self, end: End, row: int = 0) -> sparse.csr_array:
        """Matrix (3, n) from q to one vector of an end."""
        first = self.place(end).start + 3 * row
        return self.B[first : first + 3]

    def _elements(self, *vectors: Floats) -> Iterator[tuple[Any, ...]]:
        """Yield the section of each part, and its views (n, rows, 3) of flat vectors."""
        return zip((part.section for part in self.parts), *map(self.split, vectors), strict=True)

    def energy(self, q: Floats) -> float:
        """Strain energy, J."""
        own = sum(energies(section, e) for section, e in self._elements(self.coordinates(q)))
        return own + sum(spring.energy(q) for spring in self.springs)

    def internal(self, q: Floats) -> Floats:
        """Elastic force on the element coordinates, flat."""
        Q, rest = np.zeros((2, len(self.e0)))
        for section, e, v, f in self._elements(self.coordinates(q), rest, Q):
            forces(section, e, v, f)
        return Q

    def force(self, q: Floats) -> Floats:
        """Elastic force, the gradient of the energy by q."""
        return self.B.T @ self.internal(q) + sum(spring.force(q) for spring in self.springs)

    def damping(self, q: Floats, v: Floats) -> Floats:
        """Damping force f; like the elastic one, it acts as -f."""
        Q = np.zeros_like(self.e0)
        for section, e, rate, f in self._elements(self.coordinates(q), self.B @ v, Q):
            dampings(section, e, rate, f)
        return self.B.T @ Q

    def _assembled(self, blocks: list[Floats]) -> sparse.csr_array:
        """B^T K B of the blocks K (n, size, size) of each part."""
        on_diagonal = [sparse.bsr_array((K, np.arange(len(K)), np.arange(len(K) + 1))) for K in blocks]
        return self.B.T @ sparse.block_diag(on_diagonal, format="csr") @ self.B

    def viscosity(self, q: Floats) -> sparse.csc_array:
        """Derivative of the damping force by the rates; exact, because the force is linear in them."""
        blocks = []
        for section, e in self._elements(self.coordinates(q)):
            D = np.zeros((len(e), e[0].size, e[0].size))
            for k in range(e[0].size):
                rate, Q = np.zeros_like(e), np.zeros_like(e)
                rate.reshape(len(e), -1)[:, k] = 1.0
                dampings(section, e, rate, Q)
                D[:, :, k] = Q.reshape(len(e), -1)
            blocks.append(D)
        return self._assembled(blocks).tocsc()

    def tangent(self, q: Floats) -> sparse.csc_array:
        """Derivative of the elastic force."""
        blocks = []
        for section, e in self._elements(self.coordinates(q)):
            blocks.append(np.empty((len(e), e[0].size, e[0].size)))
            tangents(section, e, np.zeros_like(e), blocks[-1])
        springs = sum((spring.tangent(q) for spring in self.springs), sparse.csc_array((self.n, self.n)))
        return (self._assembled(blocks) + springs).tocsc()

    def applied(self, q: Floats) -> Floats:
        """Sum of the loads."""
        return sum((load.force(q) for load in self.loads), np.zeros(self.n))

    def applied_tangent(self, q: Floats):
        """Derivative of the loads."""
        return sum((load.tangent(q) for load in self.loads), sparse.csc_array((self.n, self.n)))

    def kinetic(self, v: Floats) -> float:
        """Kinetic energy, J."""
        return 0.5 * v @ (self.M @ v)

    def constraints(self, ties: Iterable[Tie]) -> Floats:
        """Matrix C of the tie equations C e = 0, which an augmented formulation would keep."""
        rows = []
        for tie in ties:
            keep = np.linalg.svd(tie.joint.free_directions, full_matrices=True)[0][
                :, tie.joint.free_directions.shape[1] :
            ].T
            C = np.zeros((len(keep), len(self.e0)))
            C[:, self.place(tie.follows)] = keep
            C[:, self.place(tie.leads)] -= keep @ tie.joint.transfer
            rows.append(C)
        return np.vstack(rows)


def _mass(part: Member) -> Floats:
    M = np.zeros((part.element.ROWS, part.element.ROWS))
    part.element.mass(part.section, M)
    return M


def _ends(parts: Sequence[Member]) -> list[slice]:
    sizes = [3 * part.element.ROWS // 2 for part in parts for _ in range(2 * len(part.e))]
    return [slice(stop - size, stop) for stop, size in zip(np.cumsum(sizes).tolist(), sizes, strict=True)]


def _eliminate(ends: list[slice], ties: list[Tie], supports: list[Support], e0: Floats):
    """Return B and b; an end is free, partly fixed, or depends on another end, which may be dependent too."""
    leads = {2 * t.follows[0] + t.follows[1]: (2 * t.leads[0] + t.leads[1], t.joint) for t in ties}
    holds = {2 * s.end[0] + s.end[1]: s.free_directions for s in supports}
    if len(leads) < len(ties) or len(holds) < len(supports) or leads.keys() & holds.keys():
        raise ValueError("an end follows one other end or one support, not several: let the others follow it")
    # by end: factors of the unknowns of ends, and constant
    expressions: dict[int, tuple[dict[int, Floats], Floats]] = {}

    def resolve(end: int, waiting: frozenset[int] = frozenset()) -> None:
        if end in expressions:
            return
        if end in waiting:
            raise ValueError(f"end {end % 2} of element {end // 2} follows itself")
        if end not in leads:
            start = e0[ends[end]]
            own = holds.get(end, np.eye(len(start)))
            expressions[end] = {end: own}, start - own @ (own.T @ start)
            return
        lead, joint = leads[end]
        resolve(lead, waiting | {end})
        factors, constant = expressions[lead]
        mine = {k: joint.transfer @ factor for k, factor in factors.items()}
        expressions[end] = {**mine, end: joint.free_directions}, joint.transfer @ constant

    columns, n = {}, 0
    for end in range(len(ends)):
        resolve(end)
        columns[end], n = n, n + expressions[end][0][end].shape[1]
    B, b = sparse.lil_array((len(e0), n)), np.zeros_like(e0)
    for end, (factors, constant) in expressions.items():
        b[ends[end]] = constant
        for k, factor in factors.items():
            B[ends[end], columns[k] : columns[k] + factor.shape[1]] = factor
    return B.tocsr(), b
