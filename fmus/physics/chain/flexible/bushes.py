"""Bushed pins of flexible links, see ``chain.bushing``: the angle of a pin is that between the slopes of its links.

The slopes are the links' own and condensed, so the change of each bush's torque is an unknown of its pin (``torques``
of the layout): columns of the derivative b in the matrices of both links, and -1 / T' on the diagonal of the pin. The
curvature of the angle (torque over the square of a slope) is left out of the matrix: it is 1e-4 of a link's stiffness.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kernels.jit import kernel
from fmus.physics.ancf.element import axis_count, vector_count
from fmus.physics.arrays import Floats, Vector
from fmus.physics.chain.bushing import Bushing, stored, turn
from fmus.physics.chain.flexible.closing import first_joined
from fmus.physics.chain.flexible.interface import gather, in_space, layout, pin_axis
from fmus.physics.chain.flexible.link_layout import ends
from fmus.physics.elementary import atan2
from fmus.physics.vector import cross, dot, put, scale

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.interface import FlexibleLinks
    from fmus.physics.chain.flexible.state import Motion, State, Work


@kernel
def _slopes(links: FlexibleLinks, q: Floats, w: Work, j: int) -> tuple[Vector, Vector]:
    """Slopes of the links before and after pin ``j``, or their rates; ``q`` (nodes, width)."""
    indices, nodes, half, e = layout(links), q.shape[0], vector_count(links.element) // 2, w.coordinates
    begin, end = ends(indices, nodes, j - 1 if j > 0 else links.n - 1)
    gather(links, q, begin, end, e)
    before = in_space(links, e[half + 1])
    begin, end = ends(indices, nodes, j)
    gather(links, q, begin, end, e)
    return before, in_space(links, e[1])


@kernel
def _angle(a: Vector, t: Vector, u: Vector) -> float:
    """Angle about the unit vector ``a`` from the slope ``t`` to the slope ``u``, rad."""
    return atan2(dot(a, cross(t, u)), dot(t, u) - dot(a, t) * dot(a, u))


@kernel
def _derivative(a: Vector, t: Vector) -> Vector:
    """Derivative of the angle of the slope ``t`` about the unit vector ``a``, rad."""
    along = dot(a, t)
    return scale(1.0 / (dot(t, t) - along * along), cross(a, t))


@kernel
def turn_bushes(bushing: Bushing | None, links: FlexibleLinks, x: Motion, w: Work, by_rate: float) -> None:
    """Torques of all bushes, and derivatives of their angles by the slopes, into ``w.bushes``; ``by_rate`` in 1/s."""
    if bushing is not None:
        for j in range(first_joined(links), links.n):
            axis = pin_axis(links, x.q[ends(layout(links), x.q.shape[0], j)[0]])
            t, u = _slopes(links, x.q, w, j)
            dt, du = _slopes(links, x.v, w, j)
            before, after = scale(-1.0, _derivative(axis, t)), _derivative(axis, u)
            put(w.bushes.before[j], 0, before)
            put(w.bushes.after[j], 0, after)
            turn(bushing, j, _angle(axis, t, u), dot(before, dt) + dot(after, du), by_rate, w)


@kernel
def add_bushes(bushing: Bushing | None, links: FlexibleLinks, w: Work, i: int, r: Floats, tangent: bool) -> None:
    """Add the torques on link ``i`` to its residual ``r`` (rows, axes); with ``tangent`` couple those of its pins."""
    if bushing is not None:
        b, K, half, dims = w.bushes, w.iteration_matrix, vector_count(links.element) // 2, axis_count(links.element)
        first, size, j = K.shape[0] - 2, K.shape[0], i + 1 if i + 1 < links.n else 0
        if tangent:
            for k in range(size):
                K[first, k] = K[first + 1, k] = K[k, first] = K[k, first + 1] = 0.0
        for k in range(dims):
            axis = k if dims == 3 else 2 * k  # of two axes x and z
            begin, end = b.after[i, axis], b.before[j, axis]
            r[1, k] += b.torque[i] * begin
            r[half + 1, k] += b.torque[j] * end
            if tangent:
                m, n = dims + k, (half + 1) * dims + k
                K[first, m] = K[m, first] = begin
                K[first + 1, n] = K[n, first + 1] = end


@kernel
def add_compliances(bushing: Bushing | None, links: FlexibleLinks, w: Work) -> None:
    """Add the compliances of all bushes to ``w.diagonal``; those of pins without bushes keep it regular."""
    if bushing is not None:
        indices, nodes = layout(links), w.diagonal.shape[0]
        last, share = len(indices.shared) - 1, 1.0 / len(indices.pins)
        first = first_joined(links)
        for j in range(first, links.n):
            i = len(indices.pins) * j
            w.diagonal[i, last, last] -= share / w.bushes.stiffness[j]
            if len(indices.pins) == 2:  # each link has a node of its own there
                w.diagonal[i - 1, last, last] -= share / w.bushes.stiffness[j]
        if first == 1:  # the ends
            w.diagonal[0, last, last] = w.diagonal[nodes - 1, last, last] = -1.0


@kernel
def leave_out_torques(bushing: Bushing | None, links: FlexibleLinks, w: Work) -> None:
    """Keep the matrix ``w.diagonal`` of masses alone regular where the unknowns of the torques are."""
    if bushing is not None:
        for i in range(w.diagonal.shape[0]):
            w.diagonal[i, -1, -1] = 1.0


@kernel
def bush_energy(bushing: Bushing | None, links: FlexibleLinks, s: State, w: Work) -> float:
    """Energy of all bushes, J."""
    energy = 0.0
    if bushing is not None:
        for j in range(first_joined(links), links.n):
            axis = pin_axis(links, s.q[ends(layout(links), s.q.shape[0], j)[0]])
            t, u = _slopes(links, s.q, w, j)
            energy += stored(bushing, _angle(axis, t, u))
    return energy
