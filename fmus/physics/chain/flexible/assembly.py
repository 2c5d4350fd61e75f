"""Assembly of a chain of flexible links of any element: residual, iteration matrix and outputs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import kernel, noalias
from fmus.physics.ancf.element import axis_count, energy, force, mass, tangent, total_mass, vector_count
from fmus.physics.arrays import Floats, Four, Vector
from fmus.physics.chain.flexible.bushes import add_bushes, bush_energy, turn_bushes
from fmus.physics.chain.flexible.closing import spring_energy
from fmus.physics.chain.flexible.condensation import clear, condense, reduce
from fmus.physics.chain.flexible.inertia import add_kinetic, add_mass
from fmus.physics.chain.flexible.interface import (
    absolute_accelerations,
    absolute_rates,
    add_lateral_bending,
    assemble_border,
    axial,
    centre_of_mass,
    couple_inertia,
    gather,
    inertia_and_weight,
    lateral_bending_energy,
    layout,
    rotary_energy,
    wheels_to_axes,
    wrenches_from_axes,
)
from fmus.physics.chain.flexible.link_layout import ends
from fmus.physics.chain.interface import evaluate_contacts
from fmus.physics.chain.sums import MATERIAL
from fmus.physics.vector import dot, scale

if TYPE_CHECKING:
    from fmus.physics.chain.contacts import Contacts
    from fmus.physics.chain.flexible.interface import FlexibleLinks
    from fmus.physics.chain.flexible.state import Motion, State, Work
    from fmus.physics.chain.integration import Environment
    from fmus.physics.integrate.generalized_alpha import Slopes


@kernel
@noalias
def evaluate(
    links: FlexibleLinks, contacts: Contacts | None, env: Environment, x: Motion, by: Slopes, w: Work, fresh: bool
) -> tuple[float, int]:
    """Residual M vdot + Q - Q_ext of the chain in the motion ``x``, condensed to the pins, into ``w.right_side``.

    With ``fresh`` also the condensed iteration matrix into ``w.diagonal``, ``w.upper``, ``w.lower``; ``by`` holds the
    derivatives of rates and accelerations. Contact sums, and wrenches on the wheels at ``w.wheels``, go to ``w``.
    Returns the largest entry of the residual, N, and its link.
    """
    n, c, indices = links.n, links.element, layout(links)
    rows, dims = vector_count(c), axis_count(c)
    whole, weight = rows * dims + len(indices.common), scale(total_mass(c), env.gravity)
    clear(w, fresh)
    mass(c, w.mass)
    turn_bushes(links.bushing, links, x, w, by.v)
    if contacts is not None:
        if fresh:
            w.points.number[0] = 0
        wheels_to_axes(links, x, w, fresh)
        evaluate_contacts(links, contacts, x, w, w.flat, by.v, fresh)
        wrenches_from_axes(links, x, w)
    for i in range(n):
        first, second = ends(indices, x.q.shape[0], i)
        gather(links, x.q, first, second, w.coordinates)
        gather(links, x.v, first, second, w.rates)
        gather(links, x.vdot, first, second, w.accelerations)
        r = w.residual[i]
        inertia_and_weight(links, x, w, weight, r)
        if fresh:
            tangent(c, w.coordinates, w.rates, by.v, w.iteration_matrix)
            add_mass(c, w.mass, by.vdot, w.iteration_matrix)
            couple_inertia(links, w, by.vdot)
        add_lateral_bending(links, w, r, fresh)
        add_bushes(links.bushing, links, w, i, r, fresh)
        w.sums[MATERIAL] += force(c, w.coordinates, w.rates, r)
        if contacts is not None:  # noqa: SIM102 - numba leaves out the whole branch
            if w.touched[i]:
                for a in range(rows):
                    for k in range(dims):
                        r[a, k] += w.load[i, a, k]
                if fresh:
                    for a in range(whole):
                        for k in range(whole):
                            w.iteration_matrix[a, k] += w.stiffening[i, a, k]
        if fresh:
            condense(links, w, i, first, second)
            assemble_border(links, w, first, second)
    return reduce(links, env, x, w, by.v, fresh)


@kernel
def totals(links: FlexibleLinks, env: Environment, x: State, w: Work) -> tuple[Four, Vector]:
    """Least, mean and largest tension, N, and largest stress, Pa; kinetic, strain and gravity energy, J."""
    n, c, q = links.n, links.element, x.q
    weight = scale(total_mass(c), env.gravity)
    kinetic, gravity = rotary_energy(links, x), 0.0
    strain_energy = spring_energy(links.closing, axis_count(c), q) + bush_energy(links.bushing, links, x, w)
    low, high, mean, stress = np.inf, -np.inf, 0.0, 0.0
    for i in range(n):
        first, second = ends(layout(links), q.shape[0], i)
        absolute_accelerations(links, x, w, first, second)
        gather(links, q, first, second, w.coordinates)
        gather(links, x.v, first, second, w.rates)
        absolute_rates(links, x, w)
        kinetic = add_kinetic(c, kinetic, w.mass, w.rates)
        strain_energy += energy(c, w.coordinates) + lateral_bending_energy(links, w)
        gravity -= dot(weight, centre_of_mass(links, x, w))
        pull, fibre = axial(links, w)
        low, high, mean = min(low, pull), max(high, pull), mean + pull / n
        stress = max(stress, fibre)
    return (low, mean, high, stress), (kinetic, strain_energy, gravity)


@kernel
def axials(links: FlexibleLinks, x: State, w: Work, tension: Floats, stress: Floats) -> None:
    """Tension, N, and largest axial stress, Pa, of all links into ``tension`` and ``stress`` (n)."""
    for i in range(links.n):
        first, second = ends(layout(links), x.q.shape[0], i)
        absolute_accelerations(links, x, w, first, second)
        gather(links, x.q, first, second, w.coordinates)
        gather(links, x.v, first, second, w.rates)
        tension[i], stress[i] = axial(links, w)
