"""Statements of the paper (sections 1 to 9) beside measured figures, with verdicts by rules.

A statement that does not hold is a result, not a failure.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from orchestrator.studies import Row
from tests.validation.paper import rules, theory
from tests.validation.paper.results import UNMEASURED, Results, Verdict


class Statement(NamedTuple):
    """Statement of the paper."""

    where: str  # sections
    text: str
    rule: Callable[[Results], Verdict]
    seen: str = ""  # figures and tables with the evidence


STATEMENTS = (
    Statement("2", "r = S e: nodal places and slopes give any point, at any rotation.",
              theory.positions, "table of equations"),
    Statement("1, 6 (1), 9", "ANCF meshes have a constant inertia matrix, without Coriolis and centrifugal forces.",
              theory.constant_inertia, "table of equations, figure of conditions"),
    Statement("4.1 to 4.3", "The spherical joint, the pins of cables and of beams and the sliding joint take 3, 4, 6"
              " and 4 freedoms away.",
              theory.joint_equations, "table of equations"),
    Statement("4.4", "A pin of fully parameterised beams has one rotation and five deformations; strains may be"
              " discontinuous there, the pin itself may stretch.",
              theory.joint_modes, "table of equations"),
    Statement("1, 5, 6", "ANCF geometry is that of computational geometry: B-splines and ANCF elements are the same"
              " curves.",
              theory.same_geometry, "table of equations"),
    Statement("5.2", "A bicubic B-spline patch needs 16 control points, whatever its shape.",
              theory.patch, "table of equations"),
    Statement("1 (5), 5.3, 9", "A knot less takes one control point away, three equations at least: pins cannot be"
              " made by knots.",
              theory.knots, "table of equations"),
    Statement("1 (5), 5.4, 9", "A structural discontinuity has the continuity of a spherical joint and fewer"
              " freedoms: no knot makes it.",
              theory.corners, "table of equations"),
    Statement("5.5", "Multiplicities of 3, 2, 1 are C0, C1, C2 (once misprinted): a sliding joint needs equations"
              " between meshes.",
              theory.sliding, "table of equations"),
    Statement("1 (1), 9", "Ideal compliant joints capture modes of deformation that rigid triads cannot.",
              rules.modes, "figures 18, 19"),
    Statement("1 (2), 6 (2), 9", "Linear connectivity eliminates dependent variables before the run: fewer unknowns,"
              " less storage.",
              rules.dimension, "table of links"),
    Statement("1 (3), 9", "Joints are satisfied at position, velocity and acceleration level of themselves.",
              rules.violated, "table of violations"),
    Statement("1 (3), 9", "Augmented and recursive methods take similar CPU times, regardless of the size.",
              rules.similar, "table of links"),
    Statement("1 (4), 6 (3), 9", "Closed rigid chains become singular with one set of independent coordinates; the"
              " spring and the ANCF mesh do not.",
              rules.singular, "figure of conditions"),
    Statement("6 (4)", "Contact forces have frequencies that are comparable to those of the elastic forces.",
              rules.contact_frequencies, "table of the explicit piece"),
    Statement("7.1", "(8)-(10) take long; the small-deformation model (11)-(15) is cheaper.",
              theory.cheaper, "table of elasticities"),
    Statement("7, 7.1", "The small-deformation model keeps the coupling of bending and stretching.",
              theory.coupled, "table of equations"),
    Statement("7.1", "K_e,l and K_e,t are constant.", theory.constant_stiffness, "table of equations"),
    Statement("7.1", "(12) with the mean strain (d - l) / l is the derivative of the strain energy.",
              theory.potential, "table of equations"),
    Statement("7.2", "The damping leaves rigid body motion alone.", theory.undamped, "table of equations"),
    Statement("8.1", "The third model, a closed ANCF loop, meets no singularity.", rules.no_singularity),
    Statement("8.1", "126 pin joints and 630 constraint equations are eliminated.", rules.counted, "table of counts"),
    Statement("8.2", "The velocity of the chassis follows the pattern of the sprockets.",
              rules.follows, "figures 10, 11"),
    Statement("8.2", "The chassis settles by 0.03 m.", rules.settled, "figure 13"),
    Statement("8.2", "The rigid body motion of the models agrees.", rules.alike, "figures 11 to 13"),
    Statement("8.2", "A point on the ground comes to the idler and to the ground again.",
              rules.visited, "figures 14, 15"),
    Statement("8.3", "At 5 s the chain is tight before the sprocket, slack after it, with a transition between.",
              rules.sections, "figures 20, 21"),
    Statement("8.3", "The flexible model takes four times the CPU time of the rigid one, and 8.5 times its"
              " evaluations.",
              rules.ratios, "tables of costs and of ratios"),
    Statement("8.3", "Time and evaluations together, 4 / 8.5 an evaluation, show what the mesh without joints saves.",
              rules.each_evaluation, "tables of costs and of ratios"),
    Statement("8.3, 1 (6)", "Flexible links bring high frequencies, which take the evaluations.",
              rules.fast, "figure and table of the explicit piece"),
    Statement("8.3", "Links that deform give a more realistic prediction of the forces and of the motion.",
              rules.realistic, "table of inertia and elasticity"),
    Statement("8.3", "With a low modulus flexible chains are more efficient than rigid ones.",
              rules.soft, "table of moduli"),
    Statement("8.3, 1 (7)", "Eliminating the joints saves much; without it such a vehicle is very challenging.",
              rules.conventional, "table of links"),
    Statement("6 (1)", "Cholesky coordinates make the mass the identity, which is an optimum sparse structure: they"
              " save time and storage.",
              rules.transformed, "tables of costs and of links"),
    Statement("9", "Flexibility does not make the algorithm more complex.", rules.detail, "table of links"),
    Statement("1 (6), 6, 9", "ANCF solves small deformation problems better than the floating frame of reference.",
              lambda results: Verdict(UNMEASURED, "there is no floating frame of reference here")),
)  # fmt: skip


def judged(rows: Sequence[Row]) -> list[Row]:
    """Rows of all statements."""
    results = Results(rows)
    return [
        Row("statement", each.text, {"where": each.where, "verdict": judgement.verdict, "measured": judgement.measured,
                                     "seen": each.seen})
        for each in STATEMENTS
        if (judgement := each.rule(results))
    ]  # fmt: skip
