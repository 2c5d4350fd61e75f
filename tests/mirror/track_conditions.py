"""Runs and tracks to which a check of a track applies."""

from __future__ import annotations

from mirror.check import View
from mirror.links import Rigid


def tension_known(view: View) -> bool:
    """True if tensions are known: from strain for elements, from accelerations for rigid links."""
    return implicit(view) or (not isinstance(view.chain, Rigid) and view.chain.excess_inertia == 0.0)


def on_wheels(view: View) -> bool:
    return view.on_wheels()


def implicit(view: View) -> bool:
    """Whether the recursion gives impulses: one implicit internal step per communication step."""
    p = view.part.parameters
    return p["integrator"] in ("generalized_alpha", "hht") and bool((view.part.h < 1.001 * float(p["step"])).all())


def implicit_on_wheels(view: View) -> bool:
    return implicit(view) and view.on_wheels()


def explicit(view: View) -> bool:
    return view.part.parameters["integrator"] == "runge_kutta"


def undamped(view: View) -> bool:
    """Whether a chain on wheels has no transverse damping, or one that the recursion gives.

    Transverse damping is known at instants only.
    """
    return view.on_wheels() and not turning(view) and (implicit(view) or not view.track["transverse_damping"])


def turning(view: View) -> bool:
    return view.kind == "turning"


def in_free_air(view: View) -> bool:
    return not view.on_wheels()


def on_a_vehicle(view: View) -> bool:
    return "chassis" in view.record.parts


def straight_on(view: View) -> bool:
    return on_a_vehicle(view) and not turning(view)


def at_rest(view: View) -> bool:
    """Whether a vehicle starts at rest; on a slope it starts to creep."""
    return straight_on(view) and view.record.scene.ground.grade is None


def in_one_frame(view: View) -> bool:
    """Whether axes stay fixed and pins are undamped across.

    The recursion leaves out the rotation of the axes, and transverse damping is no output.
    """
    return not turning(view) and not view.track["transverse_damping"]


def elements_lifted(view: View) -> bool:
    """Whether links are elements, and each of them is without contact at some instant with known accelerations."""
    if not implicit_on_wheels(view) or isinstance(view.chain, Rigid):
        return False
    free = abs(view.touch.force).max(-1) == 0.0
    return bool(free[30:].any(0).all())
