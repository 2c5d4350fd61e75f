"""Communication step of a chain by explicit integration, for any kind of link.

Runge-Kutta's classical method in equal steps, that of Dormand and Prince and Adams' methods by their errors.

For reference, short runs and soft links: a steel link's highest mode (3e5 rad/s) requires steps of 8 us, regularised
friction under a loaded rigid link, mu N / (v_reg m) = 2e4 1/s, steps of 50 us.

Adams' methods are of variable order and step. The motion of the wheels changes at each communication step, so they
restart there; a saved state is then complete. The method of Dormand and Prince begins there with the step that it ended
with, which the state keeps (``lengths``). Impulses and dissipated energies are quadratures beside the state.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import allocating, kernel
from fmus.physics.arrays import Floats, Integers
from fmus.physics.chain.bushing import hold_forces
from fmus.physics.chain.integration import DONE, PINS_OPEN, SINGULAR, STEP_TOO_SHORT, UNSTABLE, IntegrationOutcome
from fmus.physics.chain.interface import accelerate, derivative, first_speed, observe, project, speed, stage_joints
from fmus.physics.chain.report import (
    DISSIPATED,
    EVALUATIONS,
    LOST,
    PATCH_DEFECT,
    REJECTED,
    STEPS,
    TRAVEL,
    WORK,
    accumulate,
)
from fmus.physics.chain.state import add_share, copy, integrated_views, store_evaluation
from fmus.physics.chain.sums import END_POWER, LOSSES, PATCH_POWER, SUMS
from fmus.physics.integrate import adams as methods
from fmus.physics.integrate import dormand_prince as eighth
from fmus.physics.integrate.adams import LEAST, NEXT, Adams, accept, accurate, correct, length, predict, restart
from fmus.physics.integrate.dormand_prince import DormandPrince
from fmus.physics.integrate.runge_kutta import RK4, finish, stage
from fmus.physics.wheels import move

if TYPE_CHECKING:
    from fmus.physics.chain.contacts import Contacts
    from fmus.physics.chain.integration import CommunicationStep, Environment
    from fmus.physics.chain.state import ChainState, ChainWork, Links


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

    ``k`` from ``slopes``; flexible links require their factored mass in ``w`` (``flexible.initial_state``). Mean
    wrenches and impulses have the weights of the momentum; ``report`` and ``counters`` as in ``report``. After a
    failure ``s`` is invalid. For the separate arguments see ``implicit``.
    """
    rows, h, longest = step
    steps = max(int(np.ceil(h / longest - 1e-9)), 1)
    dt = h / steps
    stages = RK4.b.size
    x, x0 = s.flat[: k.shape[1]], k[stages]
    s.mean[:] = 0.0
    move(rows, 0.0, w.wheels)
    hold_forces(s, w)
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
            add_share(share, w.bushes.turning, s.turned)
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


SUMMED_ENTRIES = SUMS - LOSSES + 3  # summed entries of the report: losses by cause, and three more


def sizes(s: ChainState) -> tuple[int, int]:
    """Numbers of variables with an error estimate and of quadratures of the State ``s``."""
    controlled = sum(part.size for part in integrated_views(s).values())
    return controlled, s.mean.size + s.on_links_sum.size + s.turned.size + SUMMED_ENTRIES


@allocating
def march_adaptively(
    links: Links,
    contacts: Contacts | None,
    env: Environment,
    m: Adams,
    step: CommunicationStep,
    s: ChainState,
    w: ChainWork,
    report: Floats,
    counters: Integers,
) -> IntegrationOutcome:
    """Integrate over the communication ``step``.

    ``m`` from ``methods.adams`` with the ``sizes`` of ``s``: ``m.x`` the state at the start of a step, ``m.y`` its
    argument, ``m.k`` rates; the first entries of ``s.flat`` are the coordinates at ``m.y``. Flexible links require
    their factored mass in ``w`` (``flexible.initial_state``); ``report`` and ``counters`` as in ``report``.
    After a failure ``s`` is invalid. For the separate arguments see ``implicit``.
    """
    rows, h, longest = step
    n, done = m.controlled, 0.0
    x, y = s.flat[:n], m.y[:n]
    copy(x, m.x[:n])
    copy(x, y)
    m.x[n:] = 0.0
    m.counts[:] = 0
    hold_forces(s, w)
    failed = _evaluate(links, contacts, env, m.y, m.k, rows, 0.0, s, w)
    restart(m, min(longest, h))
    while failed < 0 and done < h * (1.0 - 1e-12):
        dt = length(m, h - done, longest)
        if dt < LEAST:
            return IntegrationOutcome(STEP_TOO_SHORT, done, 0, 0.0)
        predict(m, dt)
        failed = _evaluate(links, contacts, env, m.y, m.k, rows, done + dt, s, w)  # at the prediction
        if failed >= 0 or not accurate(m, dt):
            continue
        correct(m, dt)
        copy(y, x)
        open_pin = project(links, s, w)
        if open_pin >= 0:
            return IntegrationOutcome(PINS_OPEN, done, open_pin, 0.0)
        copy(x, y)
        failed = _evaluate(links, contacts, env, m.y, m.k, rows, done + dt, s, w)
        accept(m, dt)
        done += dt
    if failed >= 0:
        return IntegrationOutcome(SINGULAR, done, failed, 0.0)
    return _finish_adaptively(links, contacts, env, m, h, s, w, report, counters)


@allocating
def march_by_dormand_prince(
    links: Links,
    contacts: Contacts | None,
    env: Environment,
    m: DormandPrince,
    step: CommunicationStep,
    s: ChainState,
    w: ChainWork,
    report: Floats,
    counters: Integers,
) -> IntegrationOutcome:
    """Integrate over the communication ``step``; ``m`` from ``dormand_prince``, else as ``march_adaptively``."""
    rows, h, longest = step
    n, done, again = m.controlled, 0.0, 0
    x = s.flat[:n]
    copy(x, m.x[:n])
    m.x[n:] = 0.0
    m.counts[:] = 0
    hold_forces(s, w)
    m.step_control[NEXT] = s.lengths[0] if s.lengths[0] > 0.0 else h
    while done < h * (1.0 - 1e-12):
        dt = length(m, h - done, longest)
        if dt < LEAST:
            return IntegrationOutcome(STEP_TOO_SHORT, done, 0, 0.0)
        for i in range(again, m.method.b.size):
            stage(m.method, i, dt, m.x, m.k, m.y)
            failed = _evaluate(links, contacts, env, m.y, m.k[i], rows, done + m.method.c[i] * dt, s, w)
            m.counts[methods.EVALUATIONS] += 1
            if failed >= 0:
                return IntegrationOutcome(SINGULAR, done + m.method.c[i] * dt, failed, 0.0)
        again = 1
        if not eighth.accurate(m, dt):
            continue
        finish(m.method, dt, m.x, m.k)
        copy(m.x[:n], x)
        open_pin = project(links, s, w)
        if open_pin >= 0:
            return IntegrationOutcome(PINS_OPEN, done, open_pin, 0.0)
        copy(x, m.x[:n])
        done += dt
        again = 0
    s.lengths[0] = m.step_control[NEXT]
    return _finish_adaptively(links, contacts, env, m, h, s, w, report, counters)


@allocating
def _finish_adaptively(
    links: Links,
    contacts: Contacts | None,
    env: Environment,
    m: Adams | DormandPrince,
    h: float,
    s: ChainState,
    w: ChainWork,
    report: Floats,
    counters: Integers,
) -> IntegrationOutcome:
    """Evaluate the end of a communication step of ``h`` s, over which ``m`` integrated."""
    for i in range(m.controlled):
        if not abs(s.flat[i]) < FAR:
            return IntegrationOutcome(UNSTABLE, h, 0, 0.0)
    _add_integrals(m, h, s, report, counters)
    accelerate(links, contacts, env, s, w)
    store_evaluation(s, w)
    observe(links, env, s, w, report)
    return IntegrationOutcome(DONE, h, 0, 0.0)


@kernel
def _add_integrals(m: Adams | DormandPrince, h: float, s: ChainState, report: Floats, counters: Integers) -> None:
    """Add what ``m`` integrated over ``h`` s to means, sums and report, and its counts to ``counters``."""
    counters[STEPS] += m.counts[methods.STEPS]
    counters[EVALUATIONS] += m.counts[methods.EVALUATIONS]
    counters[REJECTED] += m.counts[methods.REJECTED]
    index = m.controlled
    s.mean[:] = 0.0
    for total, per in ((s.mean, 1.0 / h), (s.on_links_sum, 1.0), (s.turned, 1.0)):
        for i in range(total.shape[0]):
            for k in range(total.shape[1]):
                total[i, k] += per * m.x[index]
                index += 1
    for k in range(SUMS - LOSSES):
        report[LOST + k] += m.x[index]
        report[DISSIPATED] += m.x[index]
        index += 1
    report[PATCH_DEFECT] += m.x[index]
    report[WORK] += m.x[index + 1]
    report[TRAVEL] += m.x[index + 2]


@allocating
def _evaluate(
    links: Links,
    contacts: Contacts | None,
    env: Environment,
    y: Floats,
    k: Floats,
    rows: Floats,
    t: float,
    s: ChainState,
    w: ChainWork,
) -> int:
    """Rates of ``y`` and of all quadratures at ``t`` s into ``k``; return -1, or the link where it failed.

    ``rows`` (m, 15): the wheels at 0 s.
    """
    n = k.size - s.mean.size - s.on_links_sum.size - s.turned.size - SUMMED_ENTRIES
    copy(y[:n], s.flat[:n])
    move(rows, t, w.wheels)
    failed = derivative(links, contacts, env, s, w, k[:n])
    stage_joints(links, env, s, w)
    index = n
    for now in (w.wrench, w.on_links, w.bushes.turning):
        for i in range(now.shape[0]):
            for j in range(now.shape[1]):
                k[index] = now[i, j]
                index += 1
    for j in range(LOSSES, SUMS):
        k[index] = w.sums[j]
        index += 1
    k[index], k[index + 1], k[index + 2] = w.sums[PATCH_POWER], w.sums[END_POWER], speed(links, env, s, w)
    return failed
