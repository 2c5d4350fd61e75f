"""Rules by which statements of the paper hold, on made-up results."""

import math

import pytest

from orchestrator.studies import Row
from tests.validation.made_up import cost, rows
from tests.validation.paper import equations, knots, page, pieces, rules, theory
from tests.validation.paper.high_frequencies import ABOVE
from tests.validation.paper.models import CLOSED, RIGID, RIGID_SPRING, TRANSFORMED
from tests.validation.paper.results import HOLDS, NOT, PART, UNMEASURED, Results
from tests.validation.paper.statements import STATEMENTS, judged


def verdict(rule, *results):
    return rule(Results(results)).verdict


def each(cost):
    figures = ({"rigid": rigid.name, "method": pieces.ADAMS, "each": cost} for rigid in (RIGID_SPRING, RIGID))
    return [Row("each", "", of_model, True) for of_model in figures]


def spectra(share=5.0, step=8e-6, contact=75.0):
    common = {"fastest": 48e3, "contact": contact, "wave": 519.0}
    return [
        Row("spectrum", "", {**common, "model": model.name, "step": h} | {f"along_{low:g}": rms for low in ABOVE}, True)
        for model, h, rms in ((CLOSED, step, share), (RIGID, 5e-5, 1.0))
    ]


def effect(elasticity, inertia=0.05):
    sizes = {"elasticity": elasticity, "inertia": inertia}
    return [Row("effect", key, {"key": key, **dict.fromkeys(("force", "tension", "pitch"), size)}, True)
            for key, size in sizes.items()]  # fmt: skip


def transformed(time, size, evaluations=2.0):
    nodal, own = ({"model": model.name, "links": 64} for model in (CLOSED, TRANSFORMED))
    cost = {"method": pieces.ADAMS, "evaluations": 2.0}
    return [
        Row("links", "", {**nodal, "bytes": 1.0}, True),
        Row("links", "", {**own, "over_peer": time, "bytes": size}, True),
        Row("cost", "", {**nodal, **cost}, True),
        Row("cost", "", {**own, **cost, "evaluations": evaluations}, True),
    ]


def steps(*ratios):
    return [Row("links", "", {"model": CLOSED.name, "links": 64, "step_over_rigid": ratio}, True) for ratio in ratios]


def small(step):
    return [Row("elasticity", "", {"elasticity": "general", "links": 64, "evaluation": 2.7, "step": step}, True)]


MIXED = [*rows(), *rows(front=12.0)]
GONE = Row("sections", RIGID.label, {"model": RIGID.name}, note="not there: no such key")


@pytest.mark.parametrize(
    ("rule", "results", "wanted"),
    [
        (rules.ratios, rows(), HOLDS),
        (rules.ratios, rows(cpu=30.0, count=146.0), PART),
        (rules.ratios, rows(cpu=0.5), NOT),
        (rules.ratios, rows()[:2], UNMEASURED),
        (rules.sections, rows(), HOLDS),
        (rules.sections, rows(front=12.0), NOT),
        (rules.sections, (MIXED[1], MIXED[9]), PART),
        (rules.sections, [GONE], UNMEASURED),
        (rules.each_evaluation, each(0.47), HOLDS),  # 4 / 8.5
        (rules.each_evaluation, each(0.8), PART),
        (rules.each_evaluation, each(1.2), NOT),
        (rules.each_evaluation, each(0.47)[1:], UNMEASURED),  # few evaluations of the chain with a pin
        (rules.fast, spectra(), HOLDS),
        (rules.fast, spectra(share=1.0), PART),
        (rules.fast, spectra(share=1.0, step=1e-4), NOT),
        (rules.fast, spectra()[:1], UNMEASURED),
        (rules.contact_frequencies, spectra(), NOT),
        (rules.contact_frequencies, spectra(contact=400.0), HOLDS),
        (rules.realistic, effect(0.02), HOLDS),
        (rules.realistic, effect(0.002), NOT),  # whatever inertia does
        (rules.realistic, effect(0.02)[:1], UNMEASURED),
        (rules.transformed, transformed(0.9, 0.9), HOLDS),
        (rules.transformed, transformed(1.1, 0.9), PART),
        (rules.transformed, transformed(1.1, 1.1, 1.0), PART),
        (rules.transformed, transformed(1.1, 1.1), NOT),
        (rules.transformed, transformed(1.1, 1.1, 1.9), NOT),  # a tenth dearer each outweighs a twentieth fewer
        (rules.transformed, transformed(0.9, 0.9)[:1], UNMEASURED),
        (rules.detail, steps(1.02, 0.9), HOLDS),
        (rules.detail, steps(1.02, 1.3), PART),
        (rules.detail, steps(1.3), NOT),
        (rules.detail, steps(math.nan), UNMEASURED),
        (theory.cheaper, small(1.9), HOLDS),
        (theory.cheaper, small(0.9), PART),
    ],
)
def test_rules_say_what_the_figures_say(rule, results, wanted):
    assert verdict(rule, *results) == wanted


def test_the_papers_ratios_would_be_those_of_other_springs_and_tolerances():
    springs = [Row("stiffness", "", {"stiffness": k, "cpu": k**0.5, "evaluations": k**0.5}, True) for k in (1e-4, 1e4)]
    measured = rules.ratios(Results([*rows(cpu=30.0, count=146.0), *springs])).measured
    assert "of a spring of 56 and 3e+02 N/m" in measured, "(30 / 4)^2 and (146 / 8.5)^2"
    costs = [cost(CLOSED, 100), cost(RIGID, 50), cost(CLOSED, 90, 1e-6), cost(RIGID, 6, 1e-6)]
    measured = rules.ratios(Results([*rows(cpu=30.0, count=146.0), *costs])).measured
    assert "would be those of the rigid model times: flexible-closed / rigid 30 and 146" in measured
    assert "over tolerances evaluations times 2 to 15" in measured


def test_statements_of_theory_need_their_equations():
    rows = [*equations.rows(), *knots.rows()]
    held = (theory.positions, theory.constant_inertia, theory.joint_equations, theory.joint_modes, theory.same_geometry,
            theory.patch, theory.knots, theory.corners, theory.sliding, theory.coupled, theory.undamped)  # fmt: skip
    for rule in held:
        assert verdict(rule, *rows) == HOLDS, rule(Results(rows)).measured
        assert verdict(rule) == UNMEASURED
    assert verdict(theory.constant_stiffness, *rows) == PART, "K_e,l is in proportion to the strain"
    assert verdict(theory.potential, *rows) == NOT, "the chord strain has no potential"
    off = [Row("equation", "", {**row.figures}, False) if row.figures["key"] == "pin" else row for row in rows]
    assert verdict(theory.joint_equations, *off) == PART


def test_every_statement_has_a_verdict_even_where_nothing_was_measured():
    judgements = judged([])
    assert len(judgements) == len(STATEMENTS) == len({row.case for row in judgements})
    assert {row.figures["verdict"] for row in judgements} == {UNMEASURED}
    assert all(row.ok is None for row in judgements), "a statement that does not hold is no failure"


def test_cases_that_failed_leave_a_page(tmp_path):
    """A row of a case that raised has no figures."""
    failed = [Row(item, "a case", ok=False, note="TypeError: too many arguments") for item in page.TABLES]
    files = page.write(tmp_path, "paper", judged(failed), failed, [])
    assert (tmp_path / "paper.md") in files
    assert "TypeError" in (tmp_path / "paper.md").read_text()
