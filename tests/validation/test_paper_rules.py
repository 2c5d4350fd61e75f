"""Rules by which statements of the paper hold, on made-up results."""

import math

from orchestrator.studies import Row
from tests.validation.made_up import cost, rows
from tests.validation.paper import equations, high_frequencies, knots, page, pieces, rules, theory
from tests.validation.paper.models import CLOSED, RIGID, RIGID_SPRING, TRANSFORMED
from tests.validation.paper.results import HOLDS, NOT, PART, UNMEASURED, Results
from tests.validation.paper.statements import STATEMENTS, judged


def verdict(rule, *results):
    return rule(Results(results)).verdict


def test_rules_say_what_the_figures_say():
    assert verdict(rules.ratios, *rows()) == HOLDS
    assert verdict(rules.ratios, *rows(cpu=30.0, count=146.0)) == PART
    assert verdict(rules.ratios, *rows(cpu=0.5)) == NOT
    assert verdict(rules.ratios, *rows()[:2]) == UNMEASURED
    springs = [Row("stiffness", "", {"stiffness": k, "cpu": k**0.5, "evaluations": k**0.5}, True) for k in (1e-4, 1e4)]
    measured = rules.ratios(Results([*rows(cpu=30.0, count=146.0), *springs])).measured
    assert "of a spring of 56 and 3e+02 N/m" in measured, "(30 / 4)^2 and (146 / 8.5)^2"
    assert verdict(rules.sections, *rows()) == HOLDS
    assert verdict(rules.sections, *rows(front=12.0)) == NOT
    mixed = [*rows(), *rows(front=12.0)]
    assert verdict(rules.sections, *(mixed[1], mixed[9])) == PART
    gone = Row("sections", RIGID.label, {"model": RIGID.name}, note="not there: no such key")
    assert verdict(rules.sections, gone) == UNMEASURED


def test_ratios_would_be_others_at_other_tolerances():
    results = [
        *rows(cpu=30.0, count=146.0),
        cost(CLOSED, 100),
        cost(RIGID, 50),
        cost(CLOSED, 90, 1e-6),
        cost(RIGID, 6, 1e-6),
    ]
    measured = rules.ratios(Results(results)).measured
    assert "would be those of the rigid model times: flexible-closed / rigid 30 and 146" in measured
    assert "over tolerances evaluations times 2 to 15" in measured


def test_an_evaluation_of_a_flexible_chain_costs_half():
    def rows_of(each):
        return [
            Row("each", "", {"rigid": rigid.name, "method": pieces.ADAMS, "each": each}, True)
            for rigid in (RIGID_SPRING, RIGID)
        ]

    assert verdict(rules.each_evaluation, *rows_of(0.47)) == HOLDS, "4 / 8.5"
    assert verdict(rules.each_evaluation, *rows_of(0.8)) == PART
    assert verdict(rules.each_evaluation, *rows_of(1.2)) == NOT
    assert verdict(rules.each_evaluation, *rows_of(0.47)[1:]) == UNMEASURED, "few evaluations of the chain with a pin"


def test_high_frequencies_are_those_of_the_links():
    def rows_of(share=5.0, step=8e-6, contact=75.0):
        figures = {"fastest": 48e3, "contact": contact, "wave": 519.0}
        low = {f"along_{f:g}": 1.0 for f in high_frequencies.ABOVE}
        high = {f"along_{f:g}": share for f in high_frequencies.ABOVE}
        return [
            Row("spectrum", "", {"model": CLOSED.name, "step": step, **figures, **high}, True),
            Row("spectrum", "", {"model": RIGID.name, "step": 5e-5, **figures, **low}, True),
        ]

    assert verdict(rules.fast, *rows_of()) == HOLDS
    assert verdict(rules.fast, *rows_of(share=1.0)) == PART
    assert verdict(rules.fast, *rows_of(share=1.0, step=1e-4)) == NOT
    assert verdict(rules.fast, *rows_of()[:1]) == UNMEASURED
    assert verdict(rules.contact_frequencies, *rows_of()) == NOT
    assert verdict(rules.contact_frequencies, *rows_of(contact=400.0)) == HOLDS


def test_what_elasticity_changes_at_equal_inertia():
    def rows_of(elasticity, inertia=0.05):
        return [
            Row("effect", key, {"key": key, "force": size, "tension": size, "pitch": size}, True)
            for key, size in (("elasticity", elasticity), ("inertia", inertia))
        ]

    assert verdict(rules.realistic, *rows_of(0.02)) == HOLDS
    assert verdict(rules.realistic, *rows_of(0.002)) == NOT, "whatever inertia does"
    assert verdict(rules.realistic, *rows_of(0.02)[:1]) == UNMEASURED


def test_statements_of_theory_need_their_equations():
    rows = [*equations.rows(), *knots.rows()]
    held = (theory.positions, theory.constant_inertia, theory.joint_equations, theory.joint_modes, theory.same_geometry,
            theory.patch, theory.knots, theory.corners, theory.sliding, theory.coupled, theory.undamped)  # fmt: skip
    for rule in held:
        assert verdict(rule, *rows) == HOLDS, rule.__name__
        assert verdict(rule) == UNMEASURED
    assert verdict(theory.constant_stiffness, *rows) == PART, "K_e,l is in proportion to the strain"
    assert verdict(theory.potential, *rows) == NOT, "the chord strain has no potential"
    slower = [Row("elasticity", "", {"elasticity": "general", "links": 64, "evaluation": 2.7, "step": 1.9}, True)]
    assert verdict(theory.cheaper, *slower) == HOLDS
    assert verdict(theory.cheaper, slower[0].with_figures(step=0.9)) == PART
    off = [Row("equation", "", {**row.figures}, False) if row.figures["key"] == "pin" else row for row in rows]
    assert verdict(theory.joint_equations, *off) == PART


def test_cholesky_coordinates_save_what_the_figures_say():
    def rows_of(time, size, evaluations=2.0):
        nodal, own = ({"model": model.name, "links": 64} for model in (CLOSED, TRANSFORMED))
        cost = {"method": pieces.ADAMS, "evaluations": 2.0}
        return [
            Row("links", "", {**nodal, "bytes": 1.0}, True),
            Row("links", "", {**own, "over_peer": time, "bytes": size}, True),
            Row("cost", "", {**nodal, **cost}, True),
            Row("cost", "", {**own, **cost, "evaluations": evaluations}, True),
        ]

    assert verdict(rules.transformed, *rows_of(0.9, 0.9)) == HOLDS
    assert verdict(rules.transformed, *rows_of(1.1, 0.9)) == PART
    assert verdict(rules.transformed, *rows_of(1.1, 1.1, 1.0)) == PART
    assert verdict(rules.transformed, *rows_of(1.1, 1.1)) == NOT
    assert verdict(rules.transformed, *rows_of(1.1, 1.1, 1.9)) == NOT, "a tenth dearer each outweighs a twentieth fewer"
    assert verdict(rules.transformed, *rows_of(0.9, 0.9)[:1]) == UNMEASURED


def test_a_step_of_a_flexible_chain_takes_as_long_as_one_of_a_rigid_chain():
    def rows_of(*ratios):
        return [Row("links", "", {"model": CLOSED.name, "links": 64, "step_over_rigid": each}, True) for each in ratios]

    assert verdict(rules.detail, *rows_of(1.02, 0.9)) == HOLDS
    assert verdict(rules.detail, *rows_of(1.02, 1.3)) == PART
    assert verdict(rules.detail, *rows_of(1.3)) == NOT
    assert verdict(rules.detail, *rows_of(math.nan)) == UNMEASURED


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
