"""Checks of a track's outputs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mirror.check import Check, View
from mirror.record import Floats
from mirror.track_conditions import (
    at_rest,
    elements_lifted,
    explicit,
    implicit,
    implicit_on_wheels,
    in_free_air,
    in_one_frame,
    on_a_vehicle,
    on_wheels,
    straight_on,
    tension_known,
    turning,
    undamped,
)
from mirror.track_energies import (
    causes_together,
    contact_energy,
    deepest,
    end_load_work,
    gravity,
    kinetic,
    ledger,
    losses,
    patch_defect,
    strain,
)
from mirror.track_forces import (
    fibre,
    gradients,
    ground,
    ground_depth,
    ground_of_links,
    joint_axes,
    joint_forces,
    joint_places,
    joint_ways,
    joints_by_momentum,
    links_on_wheels,
    moments,
    momentum,
    newton,
    part_of_wheels,
    parts_of_wheels,
    sliding,
    stress,
    stress_of_all,
    tension,
    tension_bounds,
    tension_of_all,
    wheels_of_links,
    wrenches,
)
from mirror.track_motion import growth_of_travel, slip, speed, travel, travel_bounds


def steps(view: View, names: Sequence[str]) -> Floats:
    """Number of steps by the largest internal step, in runs without a halving."""
    counts = np.ceil(view.part.h / float(view.part.parameters["step"]) - 1e-9)
    return np.concatenate([[0.0], np.cumsum(counts)])[:, None]


def stages(view: View, names: Sequence[str]) -> Floats:
    return 4.0 * view.part["solver.steps"][:, None]


WHEEL = r"(sprocket|road_wheel\[\d+\]|idler)"
PARTS = r"(joint\[\d+\]\.tooth|link\[\d+\]\.(rim|horn))\.force\.[xyz]"
CHECKS = (
    Check(WHEEL + r"\.force\.[xyz]", "contact laws", wrenches, 1e-3, 0.2, applies=implicit_on_wheels),
    Check(WHEEL + r"\.torque\.[xyz]", "contact laws", wrenches, 1e-3, 0.05, applies=implicit_on_wheels),
    Check(WHEEL + r"\.force\.[xyz]", "balance of momentum", momentum, 1e-3, 1.0, balance=True, applies=undamped),
    # the recursion leaves out the rotation of the axes: its jitter leaves some 5 N of 34 kN, at shorter steps too
    Check(rf"({WHEEL}|ground)\.force\.[xyz]", "balance of momentum", momentum, 1e-3, 5.0, balance=True,
          applies=turning),
    Check(r"ground\.force\.[xyz]", "contact laws", ground, 1e-3, 2.0, applies=implicit),
    Check(r"link\[\d+\]\.ground\.force\.[xyz]", "contact laws", ground, 1e-3, 2.0, applies=implicit),
    Check(r"link\[\d+\]\.ground\.force\.[xyz]", "the track's less that of others", ground_of_links, 1e-9, 1e-7,
          balance=True),
    Check(r"link\[\d+\]\.wheels\.force\.[xyz]", "contact laws", wheels_of_links, 1e-3, 2.0, applies=implicit),
    Check(r"link\[\d+\]\.wheels\.force\.[xyz]", "the reaction of wheels less that of others", links_on_wheels, 1e-9,
          1e-7, balance=True),
    Check(r"link\[\d+\]\.wheels\.force\.[xyz]", "what balances a link at rest", newton, 1e-3, 1.0, balance=True,
          applies=at_rest),
    Check(PARTS, "contact laws", parts_of_wheels, 1e-3, 2.0, applies=implicit),
    Check(PARTS, "force of the wheels less that of other parts", part_of_wheels, 1e-9, 1e-7, balance=True),
    Check(r"joint\[\d+\]\.moment\.[xyz]", "motion of the links", moments, 5e-3, 0.3, applies=implicit),
    Check(r"link\[\d+\]\.ground\.sliding\.[xyz]", "points on the ground", sliding, 1e-3, 1e-4, applies=implicit),
    Check(r"link\[\d+\]\.ground\.depth", "points on the ground", ground_depth, 1e-4, 1e-7, applies=implicit),
    Check(r"ground\.force\.[xyz]", "balance of momentum", momentum, 1e-3, 1.0, balance=True, applies=straight_on),
    Check("travel", "straight runs over the carrier, summed", travel, 5e-3, 1e-4),
    Check("travel", "pins that have passed, counted", travel_bounds, 0.02, 2e-3, applies=on_a_vehicle),
    Check("speed", "straight runs over the carrier", speed, 5e-3, 1e-3),
    Check("speed", "growth of travel", growth_of_travel, 0.01, 1e-3, balance=True),
    Check("slip", "points on the ground against the present heading", slip, 1e-3, 1e-5, applies=on_wheels),
    Check(r"link\[\d+\]\.tension", "strain, or pin forces from motion", tension, 1e-3, 2.0, applies=tension_known),
    Check(r"link\[\d+\]\.tension", "between what its pins carry", tension_bounds, 0.03, 50.0,
          applies=elements_lifted),
    Check(r"tension\.(min|mean|max)", "of all links", tension_of_all, 1e-3, 2.0, applies=tension_known),
    Check(r"link\[\d+\]\.stress", "strain at the outer fibre", stress, 1e-4, 1e-2),
    Check(r"link\[\d+\]\.fibre\.(outer|inner)", "strain in the middle", fibre, 1e-4, 0.5),
    Check(r"joint\[\d+\]\.axis\.[xyz]", "coordinates", joint_axes, 1e-12, 1e-15),
    Check(r"link\[\d+\]\.slope\.(first|last)\.[xyz]", "coordinates", gradients, 1e-12, 1e-15),
    Check(r"stress\.max", "of all links", stress_of_all, 1e-4, 1e-2),
    Check(r"joint\[\d+\]\.force\.[xyz]", "motion of the links", joint_forces, 2e-3, 4.0, applies=implicit),
    # the iteration of rigid links ends at corrections of 1e-8 m: some hundredths of a newton of a pin force
    Check(r"joint\[\d+\]\.force\.[xyz]", "balance of a link's momentum", joints_by_momentum, 1e-6, 2e-2, balance=True,
          applies=in_one_frame),
    Check(r"joint\[\d+\]\.position\.[xyz]", "coordinates", joint_places, 1e-12),
    Check(r"joint\[\d+\]\.position\.[xyz]", "ways of the pins", joint_ways, 0.0, 1e-3),
    Check(r"energy\.kinetic", "bodies", kinetic, 1e-9, 1e-9),
    Check(r"energy\.strain", "own quadrature", strain, 1e-6, 1e-7),
    Check(r"energy\.gravity", "heights", gravity, 1e-9, 1e-9),
    Check(r"energy\.contact", "penetrations", contact_energy, 1e-5, 1e-6),
    Check(r"energy\.dissipated", "laws of friction and damping", losses, 2e-3, 1e-3, applies=implicit),
    Check(r"energy\.dissipated\..*", "laws of friction and damping", losses, 3e-3, 1e-6, applies=implicit),
    Check(r"energy\.dissipated", "sum of its causes", causes_together, 1e-12, 1e-15, balance=True),
    Check(r"energy\.dissipated", "ledger", ledger, 0.03, 2.0, balance=True, applies=on_wheels),
    Check(r"energy\.dissipated", "ledger", ledger, 0.02, 1e-4, balance=True, applies=in_free_air),
    Check(r"energy\.covered", "taken in, not stored, not lost", patch_defect, 0.03, 1e-3, applies=implicit_on_wheels),
    Check(r"energy\.work", "end loads times their way", end_load_work, 1e-4, 1e-6),
    Check(r"penetration\.max", "places", deepest, 1e-5, 1e-8),
    Check(r"solver\.steps", "steps of the given length", steps, 0.0, applies=implicit),
    Check(r"solver\.evaluations", "four a step", stages, 0.0, balance=True, applies=explicit),
)  # fmt: skip
