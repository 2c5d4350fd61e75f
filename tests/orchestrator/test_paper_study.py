"""The study of the paper: what it counts, differentiates and inverts against exact answers; its rules; its logs."""

import csv
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fmus.physics.ancf import cable
from orchestrator.execution.simulate import simulate
from orchestrator.scene.scene import load
from orchestrator.studies import find, paper
from orchestrator.studies.paper import (
    counts,
    modulus,
    pieces,
    recorded,
    singularity,
    statements,
    through_fmus,
    violation,
)
from orchestrator.studies.paper.models import CLOSED, MODELS, PRICED, RIGID, TRANSFORMED, Model, scene
from orchestrator.studies.paper.statements import HOLDS, NOT, PART, STATEMENTS, UNMEASURED, Found, judged
from orchestrator.studies.tables import Row

HALF = 0.0762


def ring(n, tilt=0.0):
    """Poses (n, 7) of a regular polygon of rigid links in x, z; the first one turned by ``tilt`` about its length."""
    angle = 2.0 * np.pi * np.arange(n) / n
    turn = Rotation.from_euler("y", angle[:, None])
    radius = HALF / np.tan(np.pi / n)
    place = radius * turn.apply([0.0, 0.0, 1.0])
    turn = Rotation.concatenate([turn[:1] * Rotation.from_euler("x", tilt), turn[1:]])
    return np.hstack([place, turn.as_quat(scalar_first=True)])


# counting


@pytest.mark.parametrize("n", [5, 64])
def test_a_loop_of_parallel_pins_has_three_equations_too_many(n):
    B = counts.jacobian(ring(n), HALF)
    assert B.shape == (5 * n, 6 * n)
    assert counts.rank(B) == 5 * n - 3
    assert counts.rank(B[5:]) == 5 * n - 5, "opened, none is too many"
    skew = counts.jacobian(ring(n, tilt=0.05), HALF)
    assert counts.rank(skew) > 5 * n - 3, "pins that are not parallel"


# violation


def test_violations_are_the_derivatives_of_the_gap():
    """Links that move freely, so that their joints part: both derivatives by central differences."""
    rng = np.random.default_rng(1)
    start, n, h = ring(6), 6, 1e-4
    drift, bend, spin = rng.normal(size=(n, 3)), rng.normal(size=(n, 3)), rng.normal(size=(n, 3))

    def pose(t):
        turn = Rotation.from_quat(start[:, 3:], scalar_first=True) * Rotation.from_rotvec(t * spin)  # body axes
        return np.hstack([start[:, :3] + drift * t + 0.5 * bend * t**2, turn.as_quat(scalar_first=True)])

    def gaps(q):
        x = Rotation.from_quat(q[:, 3:], scalar_first=True).apply([1.0, 0.0, 0.0])
        return q[:, :3] + HALF * x - np.roll(q[:, :3] - HALF * x, -1, axis=0)

    def tilts(q):
        e = Rotation.from_quat(q[:, 3:], scalar_first=True).as_matrix()
        return np.einsum("nia,ni->na", e[:, :, [0, 2]], np.roll(e[:, :, 1], -1, axis=0))

    v = np.hstack([drift, spin])
    a = np.hstack([bend, np.zeros((n, 3))])
    found = violation.of_poses(pose(0.0), v, a, HALF)
    low, now, high = (gaps(pose(t)) for t in (-h, 0.0, h))
    first, second = (high - low) / (2.0 * h), (high - 2.0 * now + low) / h**2
    assert found.gap[0] < 1e-15
    assert found.gap[1] == pytest.approx(np.linalg.norm(first, axis=1).max(), rel=1e-6)
    assert found.gap[2] == pytest.approx(np.linalg.norm(second, axis=1).max(), rel=1e-5)
    low, now, high = (tilts(pose(t)) for t in (-h, 0.0, h))
    assert found.tilt[0] < 1e-15
    assert found.tilt[1] == pytest.approx(np.abs(high - low).max() / (2.0 * h), rel=1e-6)
    assert found.tilt[2] == pytest.approx(np.abs(high - 2.0 * now + low).max() / h**2, rel=1e-5)
    wrong = violation.of_poses(pose(0.0), 1.03 * v, a, HALF)
    assert wrong.gap[2] != pytest.approx(found.gap[2], rel=1e-4)
    assert found.cut.tolist() == [0.0, 0.0, 0.0]
    cut = violation.of_poses(pose(0.0), v, a, HALF, cut=True)
    assert cut.cut[1] == pytest.approx(np.linalg.norm(first[-1]), rel=1e-6)
    assert cut.gap[1] == pytest.approx(np.linalg.norm(first[:-1], axis=1).max(), rel=1e-6)


def test_a_loop_that_spins_as_one_violates_nothing():
    q, n, omega = ring(8), 8, 3.0
    v = np.hstack([np.cross([0.0, omega, 0.0], q[:, :3]), np.tile([0.0, omega, 0.0], (n, 1))])
    a = np.hstack([-(omega**2) * q[:, :3], np.zeros((n, 3))])
    found = violation.of_poses(q, v, a, HALF)
    assert np.max([*found.gap, *found.tilt]) < 1e-13
    assert violation.of_poses(q, v, 1.03 * a, HALF).gap[2] > 1e-3


# singularity


def belt(n, shift, run=6.0):
    """Pins (n, 2) on a belt round two wheels of radius 1, ``run`` apart, moved on by a part ``shift`` of its length."""
    length = 2.0 * run + 2.0 * np.pi
    places = []
    for s in (np.arange(n) / n + shift) % 1.0 * length:
        if s < run:
            places.append((s, -1.0))
        elif s < run + np.pi:
            places.append((run + np.sin(s - run), -np.cos(s - run)))
        elif s < length - np.pi:
            places.append((2.0 * run + np.pi - s, 1.0))
        else:
            places.append((-np.sin(s - 2.0 * run - np.pi), np.cos(s - 2.0 * run - np.pi)))
    return np.array(places)


def test_the_jacobian_of_a_loop_knows_its_motions():
    angle = 2.0 * np.pi * np.arange(9) / 9 + 0.3
    B = singularity.jacobian(angle, 0.2)
    assert np.linalg.matrix_rank(B) == 18
    pins = np.cumsum(0.2 * np.stack([np.cos(angle), np.sin(angle)], axis=1), axis=0)
    middle = pins - 0.1 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    turning = np.concatenate([-middle[:, 1], middle[:, 0], np.full(9, 0.2)])  # about the origin
    assert np.abs(B @ turning).max() < 1e-15
    assert np.abs(B @ (turning * np.repeat([1.0, 1.03, 1.0], 9))).max() > 1e-3


def test_a_four_bar_linkage_is_singular_where_its_dependent_links_are_in_line():
    """A rhombus folds: of the pair of angles that are solved for, the determinant is the sine between them."""
    t = np.linspace(0.4, 2.8, 25)
    left = np.stack([np.zeros_like(t), np.zeros_like(t)], axis=1)
    right = np.stack([np.ones_like(t), np.zeros_like(t)], axis=1)
    arm = np.stack([np.cos(t), np.sin(t)], axis=1)
    pins = np.stack([left, right, right + arm, left + arm], axis=1)
    angle = singularity._angles(pins)
    free = [0, 4, 8, 9]  # place of link 0, angles of links 0 and 1: links 2 and 3 follow
    columns = np.setdiff1d(np.arange(12), free)
    determinants = [np.linalg.det(singularity.jacobian(each, 1.0)[:, columns]) for each in angle]
    np.testing.assert_allclose(np.abs(determinants), np.abs(np.sin(t)), atol=1e-12)
    own = singularity.dependent(singularity.jacobian(angle[12], 1.0))
    assert np.linalg.cond(singularity.jacobian(angle[12], 1.0)[:, own]) < 20.0


def test_a_loop_that_turns_meets_it_with_one_set_and_not_with_others():
    """A belt round two wheels, from pin to pin once round."""
    t = np.linspace(0.0, 1.0, 97)
    found = singularity.followed(t, np.array([belt(24, shift) for shift in t]), 0.2, 18.0)
    assert found.flips > 0
    assert found.closest > 1e10
    assert found.fixed.max() > 20.0 * found.fixed[0]
    assert found.choices > 0
    assert found.chosen.max() < found.fixed.max()
    assert found.cut.max() / found.cut.min() < 10.0


def test_masses_of_tree_and_mesh():
    """Kinetic energy of the tree by the velocities of its links; the mesh's element is that of the project."""
    rng, n, length, mass, inertia = np.random.default_rng(3), 5, 0.3, 2.0, 0.07
    angle, rate, place = rng.normal(size=n), rng.normal(size=n), rng.normal(size=2)
    M = singularity.tree(angle, length, inertia, mass)
    turned = length * rate[:, None] * np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    ends = place + np.cumsum(turned, axis=0)
    energy = 0.5 * mass * np.sum((ends - 0.5 * turned) ** 2) + 0.5 * inertia * np.sum(rate**2)
    x = np.concatenate([place, length * rate])
    assert 0.5 * x @ M @ x == pytest.approx(energy, rel=1e-12)
    element = cable.Cable(length, mass / length, 1.0, 1.0, 0.0, 0.0, (0, 1))
    own = np.zeros((4, 4))
    cable.mass(element, own)
    scale = np.array([1.0, 1.0 / length, 1.0, 1.0 / length])
    one = singularity.mesh(3, length, mass)
    at = [0, 2, 3, 4]  # place and slope beginning of pin 0, place and slope ending of pin 1
    expected = scale[:, None] * own * scale
    np.testing.assert_allclose(one[np.ix_(at, at)][0, 1:], expected[0, 1:], rtol=1e-12)
    np.testing.assert_allclose(one[0, 0], 2.0 * expected[0, 0], rtol=1e-12)


# rules


def test_crossing_on_lines_of_logarithms():
    points = [(1e8, 1.0), (1e10, 100.0)]
    assert modulus.crossing(points, 10.0) == pytest.approx(1e9)
    assert modulus.crossing(points, 0.5) == 0.0
    assert modulus.crossing(points, 500.0) == math.inf
    assert math.isnan(modulus.crossing([], 1.0))


def test_the_cheapest_run_within_the_error():
    costs = [
        pieces.Cost(pieces.ADAMS, 1e-3, 0.1, 10, 1e-2, 3.0),
        pieces.Cost(pieces.ADAMS, 1e-5, 0.3, 30, 5e-5, 3.0),
        pieces.Cost(pieces.ADAMS, 1e-7, 0.5, 50, 1e-7, 3.0),
        pieces.Cost(pieces.RUNGE_KUTTA, 1.0, 0.2, 20, 1e-9, 4.0),
    ]
    assert pieces.cheapest(costs, pieces.ADAMS).setting == 1e-5
    assert pieces.cheapest(costs[:1], pieces.ADAMS) is None


def rows(cpu=4.0, count=8.5, top=20.0, front=5.0):
    """Made-up results of two models, on which the statements of costs and of sections hold."""
    found = []
    for model, own, number in ((CLOSED, cpu, count), (RIGID, 1.0, 1.0)):
        common = {"model": model.name}
        found.append(
            Row("cost", model.label, {**common, "method": pieces.ADAMS, "cpu": own, "evaluations": number}, True)
        )
        found.append(Row("sections", model.label, {**common, "top": top, "rear": 10.0, "front": front}, True))
    return found


def verdict(rule, *found):
    return rule(Found(found)).verdict


def test_rules_say_what_the_figures_say():
    assert verdict(statements.ratios, *rows()) == HOLDS
    assert verdict(statements.ratios, *rows(cpu=30.0, count=146.0)) == PART
    assert verdict(statements.ratios, *rows(cpu=0.5)) == NOT
    assert verdict(statements.ratios, *rows()[:2]) == UNMEASURED
    springs = [Row("stiffness", "", {"stiffness": k, "cpu": k**0.5, "evaluations": k**0.5}, True) for k in (1e-4, 1e4)]
    told = statements.ratios(Found([*rows(cpu=30.0, count=146.0), *springs])).measured
    assert "of a spring of 56 and 3e+02 N/m" in told, "(30 / 4)^2 and (146 / 8.5)^2"
    assert verdict(statements.sections, *rows()) == HOLDS
    assert verdict(statements.sections, *rows(front=12.0)) == NOT
    mixed = [*rows(), *rows(front=12.0)]
    assert verdict(statements.sections, *(mixed[1], mixed[7])) == PART
    gone = Row("sections", RIGID.label, {"model": RIGID.name}, note="not there: no such key")
    assert verdict(statements.sections, gone) == UNMEASURED


def test_cholesky_coordinates_save_what_the_figures_say():
    def told(time, size, evaluations=2.0):
        nodal, own = ({"model": model.name, "links": 64} for model in (CLOSED, TRANSFORMED))
        cost = {"method": pieces.ADAMS, "evaluations": 2.0}
        return [
            Row("links", "", {**nodal, "bytes": 1.0}, True),
            Row("links", "", {**own, "over_peer": time, "bytes": size}, True),
            Row("cost", "", {**nodal, **cost}, True),
            Row("cost", "", {**own, **cost, "evaluations": evaluations}, True),
        ]

    assert verdict(statements.transformed, *told(0.9, 0.9)) == HOLDS
    assert verdict(statements.transformed, *told(1.1, 0.9)) == PART
    assert verdict(statements.transformed, *told(1.1, 1.1, 1.0)) == PART
    assert verdict(statements.transformed, *told(1.1, 1.1)) == NOT
    assert verdict(statements.transformed, *told(1.1, 1.1, 1.9)) == NOT, (
        "a tenth dearer each outweighs a twentieth fewer"
    )
    assert verdict(statements.transformed, *told(0.9, 0.9)[:1]) == UNMEASURED


def test_every_statement_has_a_verdict_even_where_nothing_was_measured():
    found = judged([])
    assert len(found) == len(STATEMENTS) == len({row.case for row in found})
    assert {row.figures["verdict"] for row in found} == {UNMEASURED}
    assert all(row.ok is None for row in found), "a statement that does not hold is no failure"


# models, logs, the command


def test_models_are_told_apart_and_one_that_is_missing_is_a_sentence():
    assert len({model.name for model in PRICED}) == len({model.label for model in PRICED}) == len(PRICED)
    assert not isinstance(scene(TRANSFORMED), str)
    assert {model.track for model in MODELS} == {"rigid", "flexible"}
    assert not isinstance(scene(RIGID), str)
    absent = Model("a", "b", "rigid", ("track.nonsense=1",), "-", "k")
    assert "unknown key 'track.nonsense'" in scene(absent)


def test_a_log_fits_by_its_scene_and_its_end(tmp_path):
    path = tmp_path / "a.mcap"
    settings = ("run.stop=0.02 s", "chain.links=6", "track.start=displaced")
    wanted = load("hanging_chain", "flexible", settings)
    assert not recorded.fits(path, wanted)
    assert simulate(wanted, path)["status"] == "ok"
    assert recorded.fits(path, wanted)
    assert not recorded.fits(path, load("hanging_chain", "flexible", (*settings, "vehicle.gravity=9.8")))
    assert not recorded.fits(path, load("hanging_chain", "rigid", settings))
    path.write_bytes(path.read_bytes()[:-2000])
    assert not recorded.fits(path, wanted)


def test_the_command_writes_the_page_and_a_statement_that_does_not_hold_is_exit_0(cotrack, monkeypatch, tmp_path):
    from orchestrator.studies import Case

    assert find("paper") is paper
    monkeypatch.setattr(paper, "cases", lambda quick, folder: [Case("cost", "made up", rows, (0.5, 0.2, 5.0, 6.0))])
    status, out, err = cotrack("study", "paper", "--quick", "--workers", 1, "-o", "found")
    assert status == 0, err
    assert "does not hold" in out
    page = (tmp_path / "found" / "paper.md").read_text()
    assert "| 8.3 | At 5 s the chain is tight before the sprocket" in page
    table = list(csv.DictReader((tmp_path / "found" / "paper.csv").open()))
    assert [row["verdict"] for row in table].count("does not hold") == 2
    failed = lambda: [Row("count", "pins", {"value": 125, "reference": 126}, False)]  # noqa: E731
    monkeypatch.setattr(paper, "cases", lambda quick, folder: [Case("count", "made up", failed)])
    status, _, err = cotrack("study", "paper", "--workers", 1, "-o", "other")
    assert status == 1
    assert "minutes on two cores" in err, "the long form says before how long it takes"


def test_both_forms_have_the_same_cases(tmp_path):
    quick, full = paper.cases(True, tmp_path), paper.cases(False, tmp_path)
    assert [case.name for case in quick] == [case.name for case in full]
    assert {case.item for case in full} == {"run", "count", "piece", "stiffness", "modulus", "fmus", "links"}
    assert sum(case.item == "piece" for case in full) == len(PRICED) == len(MODELS) + 1


@pytest.mark.study
def test_fmus_begin_anew_at_each_communication_step():
    (row,) = through_fmus.rows(RIGID.name, 0.0125)
    assert row.ok
    assert row["restarts"] == pytest.approx(2 * 800)
    assert row["evaluations"] > 2.0 * row["steps"] > 2.0 * row["restarts"]


@pytest.mark.study
def test_126_pins_of_the_vehicle_itself():
    found = {row.figures["key"]: row for row in counts.counted()}
    assert all(row.ok for row in found.values())
    assert found["equations"]["value"] == 630


@pytest.mark.study
def test_the_quick_form(cotrack, tmp_path):
    status, _, err = cotrack("study", "paper", "--quick", "-o", "found")
    assert status == 0, err
    made = {file.name for file in (tmp_path / "found").iterdir()}
    numbers = [*range(10, 18), 20, 21, "18-19"]
    assert {f"figure-{n}.{suffix}" for n in numbers for suffix in ("png", "svg")} <= made
    rows = list(csv.DictReader((tmp_path / "found" / "paper.csv").open()))
    told = {row["statement"]: row["verdict"] for row in rows}
    for statement in STATEMENTS:
        if statement.rule in (statements.counted, statements.violated, statements.settled, statements.alike,
                              statements.sections, statements.singular):  # fmt: skip
            assert told[statement.text] == HOLDS, statement.text
