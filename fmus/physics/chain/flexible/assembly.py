"""A chain of flexible links, link by link, whatever they are made of: residual and iteration matrix; what is shown."""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel
from fmus.physics.chain.flexible.condensation import clear
from fmus.physics.chain.flexible.elements import (
    axes,
    axial,
    condensed,
    energy,
    flatten,
    force,
    gather,
    length,
    mass,
    matter,
    reduced,
    stiffness,
    vectors,
)
from fmus.physics.chain.flexible.inertia import add_kinetic, add_mass, height, inertia, weigh
from fmus.physics.chain.sums import POWER
from fmus.physics.chain.touch import roll


@kernel
def evaluate(links, contacts, env, x, by, w, tangent):
    """Residual M vdot + Q - Q_ext of the whole chain in the motion ``x``, condensed to the pins, into ``w.b``; with
    ``tangent`` also the condensed iteration matrix into ``w.A``, ``w.U``, ``w.L``, the derivatives of rates and
    accelerations being ``by``. Contact sums and wrenches on the wheels at ``w.moved``.

    Returns the largest entry of the residual, N, and the link it belongs to.
    """
    n, l, rows, dims, weight = links.n, length(links), vectors(links), axes(links), matter(links) * env.gravity
    clear(w, tangent)
    mass(links, w.M)
    if contacts is not None:
        flatten(links, w)
        roll(links, contacts, x, w, w.flat, by.v, tangent)
    for i in range(n):
        j = i + 1 if i + 1 < x.q.shape[0] else 0
        gather(links, x.q, i, j, w.e)
        gather(links, x.v, i, j, w.v)
        gather(links, x.vdot, i, j, w.dv)
        r = w.R[i]
        inertia(rows, dims, w.M, w.dv, r)
        weigh(weight, l, rows // 2, dims - 1, r)
        if tangent:
            stiffness(links, w, by.v)
            add_mass(rows, dims, w.M, by.vdot, w.K)
        w.sums[POWER] += force(links, w, r)
        if contacts is not None:  # noqa: SIM102 - numba leaves out the whole branch
            if w.touched[i]:
                for a in range(rows):
                    for k in range(dims):
                        r[a, k] += w.load[i, a, k]
                if tangent:
                    for a in range(rows * dims):
                        for k in range(rows * dims):
                            w.K[a, k] += w.stiffening[i, a, k]
        if tangent:
            condensed(links, w, i, j)
    return reduced(links, env, x, w, by.v, tangent)


@kernel
def measure(links, env, q, v, w):
    """Least, mean and largest tension, N, and largest stress, Pa; kinetic, strain and gravity energy, J."""
    n, l, rows, dims, weight = links.n, length(links), vectors(links), axes(links), matter(links) * env.gravity
    kinetic = strain_energy = gravity = 0.0
    low, high, mean, stress = np.inf, -np.inf, 0.0, 0.0
    for i in range(n):
        j = i + 1 if i + 1 < q.shape[0] else 0
        gather(links, q, i, j, w.e)
        gather(links, v, i, j, w.v)
        kinetic = add_kinetic(kinetic, w.M, w.v)
        strain_energy += energy(links, w)
        gravity += weight * height(l, rows // 2, dims - 1, w.e)
        pull, fibre = axial(links, w)
        low, high, mean = min(low, pull), max(high, pull), mean + pull / n
        stress = max(stress, fibre)
    return (low, mean, high, stress), (kinetic, strain_energy, gravity)


@kernel
def axials(links, q, w, tension, stress):
    """Tension, N, and largest axial stress, Pa, of all links into ``tension`` and ``stress`` (n)."""
    for i in range(links.n):
        gather(links, q, i, i + 1 if i + 1 < q.shape[0] else 0, w.e)
        tension[i], stress[i] = axial(links, w)
