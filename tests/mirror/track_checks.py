"""Checks of a track's outputs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mirror import track_conditions as when
from mirror import track_energies as energy
from mirror import track_forces as force
from mirror import track_motion as motion
from mirror.check import Check, View
from mirror.record import Floats


def steps(view: View, names: Sequence[str]) -> Floats:
    """Number of steps by the largest internal step, in runs without a halving."""
    counts = np.ceil(view.part.h / float(view.part.parameters["step"]) - 1e-9)
    return np.concatenate([[0.0], np.cumsum(counts)])[:, None]


def stages(view: View, names: Sequence[str]) -> Floats:
    return 4.0 * view.part["solver.steps"][:, None]


WHEEL = r"(sprocket|road_wheel\[\d+\]|idler)"
PARTS = r"(joint\[\d+\]\.tooth|link\[\d+\]\.(rim|horn))\.force\.[xyz]"
CHECKS = (
    Check(WHEEL + r"\.force\.[xyz]", "contact laws", force.wrenches, 1e-3, 0.2, applies=when.implicit_on_wheels),
    Check(WHEEL + r"\.torque\.[xyz]", "contact laws", force.wrenches, 1e-3, 0.05, applies=when.implicit_on_wheels),
    Check(WHEEL + r"\.force\.[xyz]", "balance of momentum", force.momentum, 1e-3, 1.0, balance=True,
          applies=when.undamped),
    # the recursion leaves out the rotation of the axes: its jitter leaves some 5 N of 34 kN, at shorter steps too
    Check(rf"({WHEEL}|ground)\.force\.[xyz]", "balance of momentum", force.momentum, 1e-3, 5.0, balance=True,
          applies=when.turning),
    Check(r"ground\.force\.[xyz]", "contact laws", force.ground, 1e-3, 2.0, applies=when.implicit),
    Check(r"link\[\d+\]\.ground\.force\.[xyz]", "contact laws", force.ground, 1e-3, 2.0, applies=when.implicit),
    Check(r"link\[\d+\]\.ground\.force\.[xyz]", "the track's less that of others", force.ground_of_links, 1e-9, 1e-7,
          balance=True),
    Check(r"link\[\d+\]\.wheels\.force\.[xyz]", "contact laws", force.wheels_of_links, 1e-3, 2.0,
          applies=when.implicit),
    Check(r"link\[\d+\]\.wheels\.force\.[xyz]", "the reaction of wheels less that of others", force.links_on_wheels,
          1e-9,
          1e-7, balance=True),
    Check(r"link\[\d+\]\.wheels\.force\.[xyz]", "what balances a link at rest", force.newton, 1e-3, 1.0, balance=True,
          applies=when.at_rest),
    Check(PARTS, "contact laws", force.parts_of_wheels, 1e-3, 2.0, applies=when.implicit),
    Check(PARTS, "force of the wheels less that of other parts", force.part_of_wheels, 1e-9, 1e-7, balance=True),
    Check(r"joint\[\d+\]\.moment\.[xyz]", "motion of the links", force.moments, 5e-3, 0.3, applies=when.implicit),
    Check(r"link\[\d+\]\.ground\.sliding\.[xyz]", "points on the ground", force.sliding, 1e-3, 1e-4,
          applies=when.implicit),
    Check(r"link\[\d+\]\.ground\.depth", "points on the ground", force.ground_depth, 1e-4, 1e-7, applies=when.implicit),
    Check(r"ground\.force\.[xyz]", "balance of momentum", force.momentum, 1e-3, 1.0, balance=True,
          applies=when.straight_on),
    Check("travel", "straight runs over the carrier, summed", motion.travel, 5e-3, 1e-4),
    Check("travel", "pins that have passed, counted", motion.travel_bounds, 0.02, 2e-3, applies=when.on_a_vehicle),
    Check("speed", "straight runs over the carrier", motion.speed, 5e-3, 1e-3),
    Check("speed", "growth of travel", motion.growth_of_travel, 0.01, 1e-3, balance=True),
    Check("slip", "points on the ground against the present heading", motion.slip, 1e-3, 1e-5, applies=when.on_wheels),
    Check(r"link\[\d+\]\.tension", "strain, or pin forces from motion", force.tension, 1e-3, 2.0,
          applies=when.tension_known),
    Check(r"link\[\d+\]\.tension", "between what its pins carry", force.tension_bounds, 0.03, 50.0,
          applies=when.elements_lifted),
    Check(r"tension\.(min|mean|max)", "of all links", force.tension_of_all, 1e-3, 2.0, applies=when.tension_known),
    Check(r"link\[\d+\]\.stress", "strain at the outer fibre", force.stress, 1e-4, 1e-2),
    Check(r"link\[\d+\]\.fibre\.(outer|inner)", "strain in the middle", force.fibre, 1e-4, 0.5),
    Check(r"joint\[\d+\]\.axis\.[xyz]", "coordinates", force.joint_axes, 1e-12, 1e-15),
    Check(r"link\[\d+\]\.slope\.(first|last)\.[xyz]", "coordinates", force.gradients, 1e-12, 1e-15),
    Check(r"stress\.max", "of all links", force.stress_of_all, 1e-4, 1e-2),
    Check(r"joint\[\d+\]\.force\.[xyz]", "motion of the links", force.joint_forces, 2e-3, 4.0, applies=when.implicit),
    # the iteration of rigid links ends at corrections of 1e-8 m: some hundredths of a newton of a pin force
    Check(r"joint\[\d+\]\.force\.[xyz]", "balance of a link's momentum", force.joints_by_momentum, 1e-6, 2e-2,
          balance=True,
          applies=when.in_one_frame),
    Check(r"joint\[\d+\]\.position\.[xyz]", "coordinates", force.joint_places, 1e-12),
    Check(r"joint\[\d+\]\.position\.[xyz]", "ways of the pins", force.joint_ways, 0.0, 1e-3),
    Check(r"energy\.kinetic", "bodies", energy.kinetic, 1e-9, 1e-9),
    Check(r"energy\.strain", "own quadrature", energy.strain, 1e-6, 1e-7),
    Check(r"energy\.gravity", "heights", energy.gravity, 1e-9, 1e-9),
    Check(r"energy\.contact", "penetrations", energy.contact_energy, 1e-5, 1e-6),
    Check(r"energy\.dissipated", "laws of friction and damping", energy.losses, 2e-3, 1e-3, applies=when.implicit),
    Check(r"energy\.dissipated\..*", "laws of friction and damping", energy.losses, 3e-3, 1e-6, applies=when.implicit),
    Check(r"energy\.dissipated", "sum of its causes", energy.causes_together, 1e-12, 1e-15, balance=True),
    Check(r"energy\.dissipated", "ledger", energy.ledger, 0.03, 2.0, balance=True, applies=when.on_wheels),
    Check(r"energy\.dissipated", "ledger", energy.ledger, 0.02, 1e-4, balance=True, applies=when.in_free_air),
    Check(r"energy\.covered", "taken in, not stored, not lost", energy.patch_defect, 0.03, 1e-3,
          applies=when.implicit_on_wheels),
    Check(r"energy\.work", "end loads times their way", energy.end_load_work, 1e-4, 1e-6),
    Check(r"penetration\.max", "places", energy.deepest, 1e-5, 1e-8),
    Check(r"solver\.steps", "steps of the given length", steps, 0.0, applies=when.implicit),
    Check(r"solver\.evaluations", "four a step", stages, 0.0, balance=True, applies=when.explicit),
)  # fmt: skip
