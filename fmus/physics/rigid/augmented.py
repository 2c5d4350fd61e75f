"""Linear system of a Newton step of a pinned chain of rigid links, solved in O(n).

    [ K  -B^T ] [ dx ]     [ r ]
    [ B   D   ] [ dl ] = - [ C ]

K is block diagonal (6 x 6 a link), B the Jacobian of the pins (rigid/pin.py), D the compliance of the
closing pin. Eliminating dx leaves B K^-1 B^T + D, block tridiagonal with one 5 x 5 block a pin and cyclic
in a closed chain.

Pin j joins link j - 1 with link j. A closed chain of n links has n pins, an open one n + 1; of these the first and the
last hold it to the ground or are absent (their blocks are then identities). Parallel pins close a chain by three
equations too many (320 of rank 317 for 64 links). Therefore the closing pin, 0 of a closed chain and the last of an
open one held at both ends, is compliant along its axis and in tilting. The other pins close the chain in these
directions too, so this spring stays unloaded.
Paper 8.1 closes a chain by a stiff spring instead (``ClosingSpring``): the closing pin is then compliant in its three
position rows and has no others, or it is left out of the system where the spring is an explicit force.
With bushed pins (``chain.bushing``) each has a sixth row, the angle between its links, whose multiplier is the change
of the bush's torque over the step: D is its compliance there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import kernel, noalias
from fmus.physics import block_cyclic
from fmus.physics.arrays import Floats, Matrix
from fmus.physics.elimination import invert
from fmus.physics.rigid import pin

STIFFNESS = 1e9  # of the closing pin, N/m along its axis
TILTING = 1e7  # of the closing pin in tilting, N m/rad
REGULAR = 1e7  # 1/s2: the compliance is then 0.01 1/kg, near that of a link
SIX = (0,) * 6  # size of a link's block, for the inversion


class AugmentedSystem(NamedTuple):
    """Arrays of one chain's linear system; p pins, n links."""

    rotation: np.ndarray  # (n, 3, 3) rotation matrices of the links
    axes_before: np.ndarray  # (p, 2, 3) axis rows of the link before each pin
    axes_after: np.ndarray  # (p, 2, 3) axis rows of the link after each pin
    iteration_matrix: np.ndarray  # (n, 6, 6) K of each link; ``factor`` inverts it in place
    residual: np.ndarray  # (n, 6) r of the links, N and N m
    gap: np.ndarray  # (p, r) C, residual of the equations of the pins, m and rad; r = 5, with bushes 6
    correction: np.ndarray  # (n, 6) dx of the links, m and rad
    multiplier_correction: np.ndarray  # (p, r) dl of the multipliers, N and N m
    schur_complement: np.ndarray  # (3, p, r, r) B K^-1 B^T + D: diagonal, upper, lower
    factors: block_cyclic.Factors  # factors of the Schur complement
    scratch: np.ndarray  # (2 r, 6) also for the inversion


class Ends(NamedTuple):
    """Ends of the chain."""

    closed: bool  # the chain is a loop
    first: bool  # the first pin of an open chain holds it to the ground
    last: bool  # the last pin of an open chain holds it to the ground
    cut: bool = False  # the closing pin is left out of the system


class ClosingSpring(NamedTuple):
    """Spring and damper in place of the closing pin, without moments; stiffness 0 means a pin."""

    stiffness: float  # N/m
    damping: float  # N s/m


PIN = ClosingSpring(0.0, 0.0)


@kernel
def closing_pin(ends: Ends, n: int) -> int:
    """Index of the closing pin of ``n`` links; -1 if an open chain has a free end."""
    if ends.closed:
        return 0
    return n if ends.first and ends.last else -1


@kernel
def spring_compliance(spring: ClosingSpring, by_v: float) -> float:
    """Compliance of the ``spring`` over a step, m/N; 0 for a pin.

    ``by_v``, 1/s, is d velocity / d position, with which the damper contributes.
    """
    return 1.0 / (spring.stiffness + by_v * spring.damping) if spring.stiffness > 0.0 else 0.0


def system(n: int, closed: bool, bushed: bool = False) -> AugmentedSystem:
    """Return zeroed arrays for ``n`` links, whose pins may have bushes."""
    p, r = n if closed else n + 1, 6 if bushed else 5
    return AugmentedSystem(
        rotation=np.zeros((n, 3, 3)),
        axes_before=np.zeros((p, 2, 3)),
        axes_after=np.zeros((p, 2, 3)),
        iteration_matrix=np.zeros((n, 6, 6)),
        residual=np.zeros((n, 6)),
        gap=np.zeros((p, r)),
        correction=np.zeros((n, 6)),
        multiplier_correction=np.zeros((p, r)),
        schur_complement=np.zeros((3, p, r, r)),
        factors=block_cyclic.workspace(p, r),
        scratch=np.zeros((2 * r, 6)),
    )


@kernel
@noalias
def _multiply_inverse(
    half: float, A: Matrix, Kinv: Floats, WQ: Floats, WP: Floats, P: Floats, rows: tuple[int, ...]
) -> None:
    """Write B K^-1 of a link into ``P``: first the ``rows`` of its first pin (as Q), then of its second (as P).

    The arguments are the blocks of one link and its pins; Kinv is the inverse of K. ``half``, m: half the pitch.
    """
    m = len(rows)
    for k in range(3):
        y, z = -half * A[k, 2], half * A[k, 1]
        for c in range(6):
            turning = y * Kinv[4, c] + z * Kinv[5, c]
            P[k, c] = turning - Kinv[k, c]
            P[m + k, c] = turning + Kinv[k, c]
    for k in range(2):
        for c in range(6):
            P[3 + k, c] = WQ[k, 0] * Kinv[3, c] + WQ[k, 2] * Kinv[5, c]
            P[m + 3 + k, c] = WP[k, 0] * Kinv[3, c] + WP[k, 1] * Kinv[4, c] + WP[k, 2] * Kinv[5, c]
    if m > 5:
        for c in range(6):
            P[5, c], P[m + 5, c] = Kinv[4, c], -Kinv[4, c]


@kernel
@noalias
def _add_complement(  # noqa: PLR0913, arrays that must not alias
    half: float,
    A: Matrix,
    WQ: Floats,
    WP: Floats,
    P: Floats,
    SA: Floats,
    SU: Floats,
    SL: Floats,
    SB: Floats,
    rows: tuple[int, ...],
) -> None:
    """Add B K^-1 B^T of a link to the blocks of its pins; ``P``: B K^-1 of ``_multiply_inverse``."""
    m = len(rows)
    for a in range(m):
        for k in range(3):
            y, z = -half * A[k, 2], half * A[k, 1]
            turning = y * P[a, 4] + z * P[a, 5]
            SA[a, k] += turning - P[a, k]
            SU[a, k] = turning + P[a, k]
            turning = y * P[m + a, 4] + z * P[m + a, 5]
            SL[a, k] = turning - P[m + a, k]
            SB[a, k] += turning + P[m + a, k]
        for k in range(2):
            SA[a, 3 + k] += WQ[k, 0] * P[a, 3] + WQ[k, 2] * P[a, 5]
            SU[a, 3 + k] = WP[k, 0] * P[a, 3] + WP[k, 1] * P[a, 4] + WP[k, 2] * P[a, 5]
            SL[a, 3 + k] = WQ[k, 0] * P[m + a, 3] + WQ[k, 2] * P[m + a, 5]
            SB[a, 3 + k] += WP[k, 0] * P[m + a, 3] + WP[k, 1] * P[m + a, 4] + WP[k, 2] * P[m + a, 5]
        if m > 5:
            SA[a, 5] += P[a, 4]
            SU[a, 5] = -P[a, 4]
            SL[a, 5] = P[m + a, 4]
            SB[a, 5] -= P[m + a, 4]


@kernel
@noalias
def factor(half: float, ends: Ends, s: AugmentedSystem, bush: Floats, scale: float, spring: float = 0.0) -> int:
    """Factor the system from its rotations, axis rows and K; return -1, or the index of the singular block.

    ``half``: half the pitch, m; ``bush`` (p; 0 without bushes): stiffness of each over the step, N m/rad, not 0;
    ``scale`` multiplies the compliance of the closing pin: 1 where dl are forces of a
    spring; where K is the bare mass, ``REGULAR`` makes it as large as the links' own compliance, so that the unloaded
    spring has little effect. ``spring``: ``spring_compliance``, 0 for a pin.
    """
    n, p = s.iteration_matrix.shape[0], s.gap.shape[0]
    S, rows, P = s.schur_complement, s.factors.size, s.scratch
    SA, SU, SL = S[0], S[1], S[2]
    SA[0] = 0.0
    for i in range(n):
        A, K = s.rotation[i], s.iteration_matrix[i]
        if not invert(K, P[0], SIX):
            return i
        j = (i + 1) % p
        if j > 0:
            SA[j] = 0.0
        _multiply_inverse(half, A, K, s.axes_after[i], s.axes_before[j], P, rows)
        _add_complement(half, A, s.axes_after[i], s.axes_before[j], P, SA[i], SU[i], SL[j], SA[j], rows)
    if len(rows) > 5:
        for j in range(p):
            SA[j, 5, 5] += 1.0 / bush[j]
    if not ends.closed:
        if not ends.first:
            _remove_pin(0, SA, SU, SL)
        if not ends.last:
            _remove_pin(n, SA, SU, SL)
    close = closing_pin(ends, n)
    if close >= 0:
        link = 0 if ends.closed else n - 1
        if ends.cut:
            _remove_pin(close, SA, SU, SL)
        elif spring > 0.0:
            for k in range(5):
                SA[close, k, k] += spring if k < 3 else 1.0  # the tilting rows are empty
        else:
            for i in range(3):
                for k in range(3):
                    SA[close, i, k] += s.rotation[link, i, 1] * s.rotation[link, k, 1] * scale / STIFFNESS
            SA[close, 3, 3] += scale / TILTING
            SA[close, 4, 4] += scale / TILTING
    return block_cyclic.factor(SA, SU, SL, s.factors, ends.closed)


@kernel
def _remove_pin(j: int, SA: Floats, SU: Floats, SL: Floats) -> None:
    """Remove pin ``j`` from the blocks (p, r, r): identity on its diagonal, no coupling."""
    p = SA.shape[0]
    SA[j] = 0.0
    for k in range(SA.shape[1]):
        SA[j, k, k] = 1.0
    SU[j] = 0.0
    SL[j] = 0.0
    SU[j - 1] = 0.0
    SL[(j + 1) % p] = 0.0


@kernel
def compliance(ends: Ends, s: AugmentedSystem, lam: Floats) -> None:
    """Add the compliance of the closing pin under its multipliers ``lam`` (p, 5), N and N m, to ``gap``."""
    n = s.iteration_matrix.shape[0]
    if ends.closed or (ends.first and ends.last):
        link = 0 if ends.closed else n - 1
        j = 0 if ends.closed else n
        along = (
            s.rotation[link, 0, 1] * lam[j, 0] + s.rotation[link, 1, 1] * lam[j, 1] + s.rotation[link, 2, 1] * lam[j, 2]
        )
        for i in range(3):
            s.gap[j, i] += s.rotation[link, i, 1] * along / STIFFNESS
        s.gap[j, 3] += lam[j, 3] / TILTING
        s.gap[j, 4] += lam[j, 4] / TILTING


@kernel
@noalias
def solve(half: float, ends: Ends, s: AugmentedSystem) -> None:
    """Solve for dx and dl with the residuals r and C and the results of ``factor``; ``half`` in m."""
    n, p = s.iteration_matrix.shape[0], s.gap.shape[0]
    dx, dl, WP, WQ, m = s.correction, s.multiplier_correction, s.axes_before, s.axes_after, len(s.factors.size)
    for j in range(p):
        for k in range(m):
            dl[j, k] = -s.gap[j, k]
    for i in range(n):
        for a in range(6):
            y = 0.0
            for c in range(6):
                y += s.iteration_matrix[i, a, c] * s.residual[i, c]
            dx[i, a] = y
        _add_jacobian_product(half, s.rotation[i], WQ[i], WP[(i + 1) % p], dx[i], dl[i], dl[(i + 1) % p])
        if m > 5:
            dl[i, 5] += dx[i, 4]
            dl[(i + 1) % p, 5] -= dx[i, 4]
    _zero_absent_pins(ends, n, dl)
    block_cyclic.solve(s.schur_complement[0], s.schur_complement[1], s.factors, ends.closed, dl)
    f = s.scratch[0]
    for i in range(n):
        for a in range(6):
            f[a] = -s.residual[i, a]
        pin.reaction(half, s.rotation[i], dl[i], dl[(i + 1) % p], WQ[i], WP[(i + 1) % p], f)
        if m > 5:
            f[4] += dl[i, 5] - dl[(i + 1) % p, 5]
        for a in range(6):
            y = 0.0
            for c in range(6):
                y += s.iteration_matrix[i, a, c] * f[c]
            dx[i, a] = y


@kernel
def _add_jacobian_product(
    half: float, A: Matrix, WQ: Floats, WP: Floats, x: Floats, before: Floats, after: Floats
) -> None:
    """Add a link's B x, ``x`` (6), to the first five rows of the pins ``before`` and ``after`` it."""
    for k in range(3):
        turning = half * (A[k, 1] * x[5] - A[k, 2] * x[4])
        before[k] += turning - x[k]
        after[k] += turning + x[k]
    for k in range(2):
        before[3 + k] += WQ[k, 0] * x[3] + WQ[k, 1] * x[4] + WQ[k, 2] * x[5]
        after[3 + k] += WP[k, 0] * x[3] + WP[k, 1] * x[4] + WP[k, 2] * x[5]


@kernel
def rates(half: float, ends: Ends, s: AugmentedSystem, v: Floats) -> None:
    """Rates of the pin equations, m/s and rad/s, for the link velocities ``v`` (n, 6), into ``gap``; ``half`` in m."""
    C, WP, WQ, n, p = s.gap, s.axes_before, s.axes_after, s.iteration_matrix.shape[0], s.gap.shape[0]
    C[:] = 0.0
    for i in range(n):
        _add_jacobian_product(half, s.rotation[i], WQ[i], WP[(i + 1) % p], v[i], C[i], C[(i + 1) % p])
    _zero_absent_pins(ends, n, C)


@kernel
def _zero_absent_pins(ends: Ends, n: int, rows: Floats) -> None:
    """Zero the rows (p, r) of absent pins."""
    close = closing_pin(ends, n)
    for k in range(rows.shape[1]):
        if not (ends.closed or ends.first):
            rows[0, k] = 0.0
        if not (ends.closed or ends.last):
            rows[n, k] = 0.0
        if ends.cut and close >= 0:
            rows[close, k] = 0.0
