"""Communication step of a chain by the classical Runge-Kutta method of order 4, for any kind of link.

For reference, short runs and soft links: a steel link's highest mode (3e5 rad/s) requires steps of 8 us, regularised
friction under a loaded rigid link, mu N / (v_reg m) = 2e4 1/s, steps of 50 us.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.jit import allocating
from fmus.physics.arrays import Floats, Integers
from fmus.physics.chain.kinds import accelerate, derivative, first_speed, observe, project, speed, stage_joints
from fmus.physics.chain.outcome import DONE, PINS_OPEN, SINGULAR, UNSTABLE, IntegrationOutcome
from fmus.physics.chain.report import EVALUATIONS, STEPS, TRAVEL, WORK, accumulate
from fmus.physics.chain.state import add_share, copy, integrated_views, store_evaluation
from fmus.physics.chain.sums import END_POWER
from fmus.physics.integrate.runge_kutta import RK4, finish, stage
from fmus.physics.wheels import move

if TYPE_CHECKING:
    from fmus.physics.chain.communication_step import CommunicationStep
    from fmus.physics.chain.environment import Environment
    from fmus.physics.chain.protocols import ChainState, ChainWork, Contacts, Links

FAR = 1e9  # m and m/s: a motion beyond counts as unstable


def slopes(s: ChainState) -> Floats:
    """Return zeroed scratch (stages + 1, N) of ``march``: rates of all stages, and the initial state."""
    return np.zeros((RK4.b.size + 1, sum(part.size for part in integrated_views(s).values())))


@allocating
def march(
    links: Links,
    contacts: Contacts | None,
    env: Environment,
    k: Floats,
    step: CommunicationStep,
    s: ChainState,
    w: ChainWork,
    report: Floats,
    counters: Integers,
) -> IntegrationOutcome:
    """Integrate over the communication ``step``, in equal internal steps.

    ``k`` from ``slopes``; flexible links require their factored mass in ``w`` (``flexible.release``). Mean wrenches and
    impulses have the weights of the momentum; ``report`` and ``counters`` as in ``report``. After a failure ``s`` is
    invalid. For the separate arguments see ``implicit``.
    """
    rows, h, longest = step
    steps = max(int(np.ceil(h / longest - 1e-9)), 1)
    dt = h / steps
    stages = RK4.b.size
    x, x0 = s.flat[: k.shape[1]], k[stages]
    s.mean[:] = 0.0
    move(rows, 0.0, w.wheels)
    along = first_speed(links, env, s, w, report)
    for n in range(steps):
        copy(x, x0)
        for i in range(stages):
            stage(RK4, i, dt, x0, k, x)
            move(rows, (n + RK4.c[i]) * dt, w.wheels)
            failed = derivative(links, contacts, env, s, w, k[i])
            if failed >= 0:
                return IntegrationOutcome(SINGULAR, (n + RK4.c[i]) * dt, failed, 0.0)
            share = dt * RK4.b[i]
            stage_joints(links, env, s, w)
            add_share(share / h, w.wrench, s.mean)
            add_share(share, w.on_links, s.on_links_sum)
            accumulate(report, share, w.sums)
            report[WORK] += share * w.sums[END_POWER]
        finish(RK4, dt, x0, k)
        copy(x0, x)
        counters[EVALUATIONS] += stages
        for i in range(x.size):
            if not abs(x[i]) < FAR:
                return IntegrationOutcome(UNSTABLE, (n + 1) * dt, 0, 0.0)
        failed = project(links, s, w)
        if failed >= 0:
            return IntegrationOutcome(PINS_OPEN, (n + 1) * dt, failed, 0.0)
        counters[STEPS] += 1
        before, along = along, speed(links, env, s, w)
        report[TRAVEL] += 0.5 * dt * (before + along)
    accelerate(links, contacts, env, s, w)
    store_evaluation(s, w)
    observe(links, env, s, w, report)
    return IntegrationOutcome(DONE, h, 0, 0.0)
