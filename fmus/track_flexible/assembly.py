"""The door from a chain to what it is made of: the class of its links says which, and only that one is imported.

Kernels call kernels by import; these stand-ins choose theirs when they are compiled, by type. The siblings behind the
door are ``cables``, ``planar`` and ``beams``.
"""

from __future__ import annotations

from typing import Any

from numba.extending import overload


def kernels(links: type) -> Any:
    """The module of a class of links."""
    if links.__name__ == "Beams":
        from fmus.track_flexible import beams

        return beams
    if links.__name__ == "Planar":
        from fmus.track_flexible import planar

        return planar
    from fmus.track_flexible import cables

    return cables


def evaluate(links, contacts, env, q, v, vdot, by_rate, by_acceleration, w, tangent) -> Any:
    """Residual M vdot + Q - Q_ext of the whole chain, condensed to the pins, into ``w.b``; with ``tangent`` also the
    condensed iteration matrix. Returns the largest entry of the residual, N, and the link it belongs to.
    """
    return kernels(type(links)).evaluate(links, contacts, env, q, v, vdot, by_rate, by_acceleration, w, tangent)


def correct(links, w, q, v, vdot, by_rate, by_acceleration, longest) -> float:
    """Take the Newton step from the solution in ``w.b``, at most ``longest`` m; returns the largest change of a pin."""
    return float(kernels(type(links)).correct(links, w, q, v, vdot, by_rate, by_acceleration, longest))


def measure(links, env, q, v, w, report) -> None:
    """Fill the report (see fmus.track) with what the state and the sums of the last evaluation say."""
    kernels(type(links)).measure(links, env, q, v, w, report)


def length(links) -> float:
    """Of a link, m."""
    return float(kernels(type(links)).length(links))


@overload(evaluate)
def _evaluate(links, contacts, env, q, v, vdot, by_rate, by_acceleration, w, tangent) -> Any:
    own = kernels(links.instance_class).evaluate
    return lambda links, contacts, env, q, v, vdot, by_rate, by_acceleration, w, tangent: own(
        links, contacts, env, q, v, vdot, by_rate, by_acceleration, w, tangent
    )


@overload(correct)
def _correct(links, w, q, v, vdot, by_rate, by_acceleration, longest) -> Any:
    own = kernels(links.instance_class).correct
    return lambda links, w, q, v, vdot, by_rate, by_acceleration, longest: own(
        links, w, q, v, vdot, by_rate, by_acceleration, longest
    )


@overload(measure)
def _measure(links, env, q, v, w, report) -> Any:
    own = kernels(links.instance_class).measure
    return lambda links, env, q, v, w, report: own(links, env, q, v, w, report)


@overload(length)
def _length(links) -> Any:
    own = kernels(links.instance_class).length
    return lambda links: own(links)
