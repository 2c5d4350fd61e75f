"""Rules that judge the statements about motion, joints, forces and costs by the rows of the study.

A rule returns "holds", "holds in part", "does not hold" or "not measured", with the figures that it used.
"""

from __future__ import annotations

import math

from tests.validation.paper import modulus, pieces, whole_runs
from tests.validation.paper.high_frequencies import ABOVE
from tests.validation.paper.links import AT
from tests.validation.paper.models import CLOSED, CONVENTIONAL, MODELS, RECURSIVE, RIGID, RIGID_SPRING, TRANSFORMED
from tests.validation.paper.ratios import FMUS, INTERVAL, TOLERANCE
from tests.validation.paper.ratios import rows as ratio_rows
from tests.validation.paper.results import HOLDS, NONE, NOT, PART, Results, Verdict, graded

OVER = {TOLERANCE: "tolerances", INTERVAL: "intervals of output", FMUS: "tolerances inside FMUs"}

CPU, EVALUATIONS = 4.0, 8.5  # flexible over rigid, section 8.3
NEAR = 0.25  # relative: a ratio of costs this near counts as the paper's
SIMILAR = 1.5  # ratio of CPU times that are similar
SAME = 1.1  # ratio of equal CPU times that were measured in turn
LINEAR = 1.1  # exponent up to which growth with the links counts as linear
ROUNDING = 1e-11  # violation by rounding alone: m, rad
SETTLED = 0.03  # m, section 8.2
DEFORMED = 1e-9  # m: less is no deformation


# --- joints --------------------------------------------------------------------------------------------------------


def modes(results: Results) -> Verdict:
    """Links of flexible chains deform, those of rigid chains do not."""
    rows = results.models("deformation")
    text = "; ".join(f"{m.label} {1e6 * row['axial']:.3g} / {1e6 * row['transverse']:.3g} um" for m, row in rows)
    good = [(row["transverse"] > DEFORMED) == (m.track == "flexible") for m, row in rows]
    return graded(good, f"largest axial / transverse displacement along links at 5 s: {text}")


def dimension(results: Results) -> Verdict:
    """The mesh with eliminated joints has fewer unknowns and less storage than with multipliers."""
    rows = {m.name: results.first("links", m, links=64) for m in MODELS}
    own, other = rows[CLOSED.name], rows[CONVENTIONAL.name] or rows[RIGID.name]
    if own is None or other is None:
        return NONE
    sizes = [row["coordinates"] + row["multipliers"] for row in (own, other)]
    text = f"64 links: {sizes[0]:.0f} unknowns and {own['bytes'] / 1e3:.0f} kB without joints, {sizes[1]:.0f} and "
    return graded(
        [sizes[0] < sizes[1], own["bytes"] < other["bytes"]], f"{text}{other['bytes'] / 1e3:.0f} kB of {other.case}"
    )


def violated(results: Results) -> Verdict:
    """The violation of eliminated joints is 0 at all three levels; that of kept joints is not."""
    own, rigid = results.first("violation", CLOSED), results.first("violation", RIGID)
    if own is None or rigid is None:
        return NONE
    keys = [f"{level}_gap" for level in ("position", "velocity", "acceleration")]
    gaps = " / ".join(f"{own[key]:.1g}" for key in keys), " / ".join(f"{rigid[key]:.2g}" for key in keys)
    text = f"largest gap of joints, m / m/s / m/s2: {gaps[0]} ({CLOSED.label}), {gaps[1]} ({RIGID.label})"
    return graded([own[key] == 0.0 for key in keys], text)


def similar(results: Results) -> Verdict:
    """A chain with eliminated joints costs as much as a recursive one at any length."""
    texts = {}
    for one, other in ((CLOSED, RECURSIVE), (RIGID_SPRING, RECURSIVE), (CONVENTIONAL, CLOSED)):
        pairs = [
            (row["links"], row["evaluation"] / twin["evaluation"])
            for row in results.of("links", one)
            if (twin := results.first("links", other, links=row["links"])) is not None
        ]
        if pairs:
            shown = ", ".join(f"{ratio:.2f} ({links} links)" for links, ratio in pairs)
            texts[one.name] = f"{one.label} over {other.label} {shown}", [ratio for _, ratio in pairs]
    own = results.first("exponent", CLOSED)
    if own is None or CLOSED.name not in texts:
        return NONE
    words = "; ".join([*(text for text, _ in texts.values()), f"exponent {own['exponent_evaluation']:.2f}"])
    good = [1.0 / SIMILAR <= ratio <= SIMILAR for ratio in texts[CLOSED.name][1]]
    return graded([own["exponent_evaluation"] < LINEAR, all(good)], f"CPU time of an evaluation: {words}")


def singular(results: Results) -> Verdict:
    """One fixed set of coordinates becomes singular as the loop moves round; mesh and cut chain do not."""
    row = results.first("singularity", CLOSED)
    if row is None or not row.ok:
        return NONE
    fixed, cut = max(row["fixed"]), max(row["cut"]) / min(row["cut"])
    text = (
        f"the determinant of the dependent Jacobian changes its sign {row['flips']} times, condition "
        f"{row['closest']:.0e} where it does, {fixed:.1e} at recorded instants; "
        f"with {row['choices']} new sets {max(row['chosen']):.0f} at most; "
        f"of the cut chain it varies by a factor of {cut:.2f}, of the ANCF mesh it is {row['mesh']:.0f} always"
    )
    return graded([row["flips"] > 0 and row["closest"] > 1e3 * min(row["fixed"]), cut < 10.0], text)


def no_singularity(results: Results) -> Verdict:
    """The run of the closed ANCF chain reaches its end."""
    row = results.first("run", CLOSED)
    return NONE if row is None else graded([bool(row.ok)], "8 s without a step given up for good")


def counted(results: Results) -> Verdict:
    """The chains have 126 pins and 630 equations."""
    rows = results.of("count")
    return graded(
        [bool(row.ok) for row in rows],
        "; ".join(f"{row.case}: {row['value']:.0f} ({row['reference']:.0f})" for row in rows),
    )


# --- motion --------------------------------------------------------------------------------------------------------


def follows(results: Results) -> Verdict:
    """The chassis follows the sprockets."""
    rows = results.models("motion")
    text = "; ".join(f"{m.label} {100 * row['follows']:.2g} %" for m, row in rows)
    return graded([row["follows"] < 0.05 for _, row in rows], f"speed less teeth x pitch x turns, RMS: {text}")


def settled(results: Results) -> Verdict:
    """The chassis settles by 0.03 m."""
    rows = results.models("motion")
    text = "; ".join(f"{m.label} {1e3 * row['settled']:.2f} mm" for m, row in rows)
    return graded([abs(row["settled"] / SETTLED - 1.0) < 0.1 for _, row in rows], text)


def alike(results: Results) -> Verdict:
    """Chassis motions of all models agree, 0 to 8 s."""
    rows = [(m, row) for m, row in results.models("motion") if m is not whole_runs.REFERENCE]
    parts = "; ".join(
        f"{m.label} " + " / ".join(f"{100 * row[name]:.2g}" for name in whole_runs.MOTION) + " %" for m, row in rows
    )
    good = [row[name] < whole_runs.ALIKE for _, row in rows for name in whole_runs.MOTION]
    return graded(good, f"position / velocity / pitch from those of {whole_runs.REFERENCE.label}: {parts}")


def visited(results: Results) -> Verdict:
    """The node moves from the ground to the idler, round, and back to the ground."""
    rows = results.models("node")
    good = ["ground, idler, upper run, sprocket, ground" in row.figures["visited"] for _, row in rows]
    return graded(good, rows[0][1].figures["visited"] if rows else "")


# --- forces and costs ----------------------------------------------------------------------------------------------


def sections(results: Results) -> Verdict:
    """At 5 s the chain is tight before the sprocket, slack after it, with a transition between."""
    rows = results.models("sections")
    text = "; ".join(
        f"{m.label} {row['top'] / 1e3:.1f} > {row['rear'] / 1e3:.1f} > {row['front'] / 1e3:.1f} kN" for m, row in rows
    )
    return graded(
        [row["top"] > row["rear"] > row["front"] for _, row in rows],
        f"upper run, before the idler, after the sprocket: {text}",
    )


def ratios(results: Results) -> Verdict:
    """Flexible over rigid by Adams' methods at equal error: 4 in CPU time, 8.5 in evaluations.

    CPU times are evaluations times the cost of one, measured in turn.
    """
    sentences, near, order = [], [], []
    for rigid in (RIGID, RIGID_SPRING, RECURSIVE):
        one, other = (results.first("cost", model, method=pieces.ADAMS) for model in (CLOSED, rigid))
        each = results.first("each", rigid=rigid.name, method=pieces.ADAMS)
        if one is None or other is None or each is None or not (one.ok and other.ok):
            continue
        count = one["evaluations"] / other["evaluations"]
        cpu = count * each["each"]
        sentences.append(f"{CLOSED.name} / {rigid.name} {cpu:.3g} and {count:.3g}")
        near.append(abs(cpu / CPU - 1.0) < NEAR and abs(count / EVALUATIONS - 1.0) < NEAR)
        order.append(count > cpu > 1.0)
    if not sentences:
        return NONE
    text = f"at an error of {pieces.EQUAL:g} CPU time and evaluations would be those of the rigid model times: "
    text += f"{'; '.join(sentences)}; paper {CPU:g} and {EVALUATIONS:g}"
    for over in (TOLERANCE, INTERVAL, FMUS):
        counts = [row["evaluations"] for row in ratio_rows(results.rows) if row.figures["over"] == over]
        text += f"; over {OVER[over]} evaluations times {min(counts):.3g} to {max(counts):.3g}" if counts else ""
    own = results.first("cost", CLOSED, method=pieces.ADAMS)
    each = results.first("each", rigid=RIGID_SPRING.name, method=pieces.ADAMS)
    springs = []
    if own is not None and each is not None:
        points = [(row["stiffness"], row["evaluations"]) for row in results.of("stiffness") if row.ok]
        parts = each["each"] / CPU, 1.0 / EVALUATIONS
        springs = [modulus.crossing(points, own["evaluations"] * part) for part in parts]
    if springs and all(0.0 < spring < math.inf for spring in springs):
        text += f"; the paper's would be those of a spring of {springs[0]:.2g} and {springs[1]:.2g} N/m"
    return Verdict(HOLDS if any(near) else PART if all(order) else NOT, text)


def each_evaluation(results: Results) -> Verdict:
    """4 / 8.5: an evaluation of the flexible model costs about half of one of the augmented rigid model.

    Compared by Adams' methods with the chain closed by a spring, as in the paper. The chain closed by a pin takes so
    few evaluations that outputs dominate, so it is compared by Runge-Kutta only.
    """
    sentences, ratios = [], []
    for method, rigid in (
        (pieces.ADAMS, RIGID_SPRING),
        (pieces.RUNGE_KUTTA, RIGID_SPRING),
        (pieces.RUNGE_KUTTA, RIGID),
    ):
        row = results.first("each", rigid=rigid.name, method=method)
        if row is not None and row.ok:
            sentences.append(f"{row['each']:.2f} over {rigid.label} ({method})")
            ratios.append(row["each"])
    if not sentences:
        return NONE
    paper = CPU / EVALUATIONS
    text = f"CPU time of an evaluation, flexible, {'; '.join(sentences)}; paper {CPU:g} / {EVALUATIONS:g} = {paper:.2f}"
    near = abs(ratios[0] / paper - 1.0) < NEAR and all(ratio < 1.0 for ratio in ratios)
    return Verdict(HOLDS if near else PART if any(ratio < 1.0 for ratio in ratios) else NOT, text)


def fast(results: Results) -> Verdict:
    """The force of a flexible chain has high frequencies that a rigid one lacks; they limit the steps."""
    own, rigid = results.first("spectrum", CLOSED), results.first("spectrum", RIGID)
    if own is None or rigid is None:
        return NONE
    shares = ", ".join(
        f"above {low:g} Hz {own[f'along_{low:g}']:.3g} against {rigid[f'along_{low:g}']:.3g} N" for low in ABOVE
    )
    text = (
        f"first joint's force along the chassis, RMS, flexible against rigid: {shares}; stable step of Runge-Kutta"
        f" {1e6 * own['step']:.2g} against {1e6 * rigid['step']:.2g} us; fastest mode of a link {own['fastest']:.3g} Hz"
    )
    high = ABOVE[1]
    return graded([own[f"along_{high:g}"] > 2.0 * rigid[f"along_{high:g}"], own["step"] < rigid["step"]], text)


def contact_frequencies(results: Results) -> Verdict:
    """Section 6, point 4: contact forces have frequencies as high as elastic ones."""
    own = results.first("spectrum", CLOSED)
    if own is None:
        return NONE
    text = (
        f"a link between ground and wheel, by table 2, {own['contact']:.3g} Hz; the slowest longitudinal wave round the"
        f" chain {own['wave']:.3g} Hz, the fastest mode of a link {own['fastest']:.3g} Hz"
    )
    return graded([own["contact"] > 0.5 * own["wave"]], text)


def realistic(results: Results) -> Verdict:
    """Elasticity at equal inertia changes forces by more than 1 %; the effect of inertia as information."""
    rows = {key: results.of("effect", key=key) for key in ("elasticity", "inertia")}
    if not all(rows.values()):
        return NONE
    text = "; ".join(
        f"{row.case}: {100 * row['force']:.2g} / {100 * row['tension']:.2g} / {100 * row['pitch']:.2g} %"
        for each in rows.values()
        for row in each
    )
    good = [row[key] > whole_runs.ALIKE for row in rows["elasticity"] for key in ("force", "tension", "pitch")]
    return graded(good, f"first joint's force / tensions at 5 s / pitch, relative differences: {text}")


def soft(results: Results) -> Verdict:
    """Below some modulus flexible chains cost less than rigid ones, explicit and implicit."""
    crossings = crossed(results)
    if not crossings:
        return NONE
    words = [
        f"{name} {'never' if crossing == 0.0 else 'always' if math.isinf(crossing) else f'below {crossing:.2g} Pa'}"
        for name, crossing in crossings.items()
    ]
    good = [crossing > 0.0 for crossing in crossings.values()]
    return graded(good, f"the flexible chain takes less CPU time than the rigid one: {', '.join(words)}")


def crossed(results: Results) -> dict[str, float]:
    """Modulus, Pa, below which the closed mesh costs less, by method and rigid model, as far as known."""
    crossings = {}
    for method, key in ((pieces.ADAMS, "cpu_adams"), (pieces.RUNGE_KUTTA, "cpu_runge_kutta"), ("implicit", "implicit")):
        points = [(row["modulus"], row[key]) for row in results.of("modulus", CLOSED) if row[key] > 0.0]
        for model in (RIGID, RIGID_SPRING, RECURSIVE):
            one = (
                results.first("modulus", model) if method == "implicit" else results.first("cost", model, method=method)
            )
            cost = math.nan if one is None else one["implicit" if method == "implicit" else "cpu"]
            crossing = modulus.crossing(points, cost)
            if not math.isnan(crossing):
                crossings[f"{method}, {model.label}:"] = crossing
    return crossings


def detail(results: Results) -> Verdict:
    """An implicit step of a flexible chain costs as much as one of a rigid chain, measured in turn."""
    rows = [row for row in results.of("links", CLOSED) if math.isfinite(row["step_over_rigid"])]
    text = ", ".join(f"{row['links']}: {row['step_over_rigid']:.2f}" for row in rows)
    good = [row["step_over_rigid"] < SAME for row in rows]
    return graded(good, f"time of an implicit step, {CLOSED.label} over {RIGID.label}, by links: {text}")


def conventional(results: Results) -> Verdict:
    """Elimination of joints saves time over the conventional chain, if that was measured."""
    run, sentences, ratios = results.first("run", CONVENTIONAL), [], []
    for row in results.of("links", CONVENTIONAL):
        own = results.first("links", CLOSED, links=row["links"])
        for key in ("evaluation", "step"):
            if own is not None and math.isfinite(row[key]) and math.isfinite(own[key]):
                ratios.append(row[key] / own[key])
                sentences.append(f"{row['links']} links, {key} {ratios[-1]:.2f}")
    if not ratios:
        return NONE
    arrives = "" if run is None else f"; its own 8 s {'end well' if run.ok else 'do not end well'}"
    return graded(
        [min(ratios) > 1.0, run is not None and not run.ok],
        f"CPU time, joints as constraints over eliminated: {', '.join(sentences)}{arrives}",
    )


def transformed(results: Results) -> Verdict:
    """Cholesky coordinates save time and storage over nodal ones of the same mesh: ratios are below 1.

    The time of a run is its evaluations times that of one, measured in turn with the nodal mesh.
    """
    ratios, sentences, each = [], [], math.nan
    for row in results.of("links", TRANSFORMED):
        nodal = results.first("links", CLOSED, links=row["links"])
        if nodal is not None and math.isfinite(row["over_peer"]):
            each = row["over_peer"] if row["links"] == AT else each
            ratios += [row["over_peer"], row["bytes"] / nodal["bytes"]]
            sentences.append(f"{row['links']} links {ratios[-2]:.2f} of an evaluation, {ratios[-1]:.2f} of the storage")
    for method in (pieces.ADAMS, pieces.RUNGE_KUTTA):
        own, nodal = (results.first("cost", model, method=method) for model in (TRANSFORMED, CLOSED))
        if own is not None and nodal is not None and own.ok and nodal.ok and math.isfinite(each):
            count = own["evaluations"] / nodal["evaluations"]
            ratios.append(count * each)
            sentences.append(f"{method} {count:.3f} of the evaluations, {ratios[-1]:.2f} of their time")
    return graded([ratio < 1.0 for ratio in ratios], f"Cholesky over nodal coordinates: {'; '.join(sentences)}")
