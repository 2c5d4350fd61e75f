"""Accelerations of a chain of flexible links, with a constant mass matrix that is factored once.

Where the axes of the coordinates turn, it has a border for their accelerations, computed at each evaluation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.jit import kernel
from fmus.physics.ancf.element import highest_frequency
from fmus.physics.arrays import Floats
from fmus.physics.chain.flexible import pin_forces
from fmus.physics.chain.flexible.assembly import evaluate
from fmus.physics.chain.flexible.axes import (
    accelerate_origin,
    axes_rates,
    lateral_bending_frequency,
    orthogonalise,
    solve_accelerations,
)
from fmus.physics.chain.flexible.closing import square_of_frequency
from fmus.physics.chain.flexible.condensation import correct
from fmus.physics.chain.flexible.joints import misfit
from fmus.physics.chain.flexible.joints import project as project_joints
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.state import copy_rows
from fmus.physics.elementary import hypot
from fmus.physics.integrate.generalized_alpha import Slopes

if TYPE_CHECKING:
    from fmus.physics.chain.environment import Environment
    from fmus.physics.chain.flexible.elements import FlexibleLinks
    from fmus.physics.chain.flexible.state import State
    from fmus.physics.chain.flexible.work import Work
    from fmus.physics.chain.protocols import Contacts

# step times highest frequency, within the stability region of the method for lightly damped modes
LIMIT = 2.4
NOTHING = Slopes(0.0, 0.0, 0.0)  # for evaluations without a matrix


def stable(links: FlexibleLinks) -> float:
    """Longest stable step of the explicit method, s, contacts apart."""
    fastest = max(highest_frequency(links.element), float(lateral_bending_frequency(links)))
    longest = LIMIT / hypot(fastest, float(np.sqrt(square_of_frequency(links.closing, links.element))))
    return float(f"{longest:.9g}")  # LAPACK's last digits differ by processor


@kernel
def accelerations(links: FlexibleLinks, contacts: Contacts | None, env: Environment, s: State, w: Work) -> None:
    """Accelerations (nodes, width) into ``w.change[0]``; ``w`` has the factored mass and the wheels."""
    change, x = w.change[0], Motion(s.q, s.v, w.still, s.axes)
    accelerate_origin(links, x, w)
    evaluate(links, contacts, env, x, NOTHING, w, False)
    change[:] = 0.0
    misfit(links, change, w)
    solve_accelerations(links, x, w)
    correct(links, w, Motion(change, w.change[1], w.change[1], s.axes), NOTHING, np.inf)


@kernel
def derivative(links: FlexibleLinks, contacts: Contacts | None, env: Environment, s: State, w: Work, k: Floats) -> int:
    """See ``kinds``."""
    accelerations(links, contacts, env, s, w)
    n, width = s.q.size, s.q.shape[1]
    for i in range(s.q.shape[0]):
        for j in range(width):
            k[i * width + j] = s.v[i, j]
            k[n + i * width + j] = w.change[0, i, j]
    axes_rates(links, s, k, 2 * n)
    return -1


@kernel
def accelerate(links: FlexibleLinks, contacts: Contacts | None, env: Environment, s: State, w: Work) -> None:
    """See ``kinds``."""
    accelerations(links, contacts, env, s, w)
    copy_rows(w.change[0], s.vdot)


@kernel
def stage_joints(links: FlexibleLinks, env: Environment, s: State, w: Work) -> None:
    """See ``kinds``."""
    copy_rows(w.change[0], s.vdot)
    pin_forces.stage_joints(links, env, s, w)


@kernel
def project(links: FlexibleLinks, s: State, w: Work) -> int:
    """See ``kinds``."""
    orthogonalise(links, s)
    project_joints(links, s, w)
    return -1
