"""The study of the paper: what it counts, differentiates and inverts against exact answers; its rules; its logs."""

import csv
import math
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fmus.physics.ancf import cable
from orchestrator.execution.simulate import simulate
from orchestrator.results.analyses import circuit
from orchestrator.results.analyses.deformation import Deformation
from orchestrator.results.run_data import Window
from orchestrator.scene.scene import load
from orchestrator.studies.row import Row
from tests.validation import paper
from tests.validation.__main__ import app
from tests.validation.paper import (
    conventions,
    counts,
    curvature,
    effects,
    equations,
    figures,
    high_frequencies,
    knots,
    links,
    modulus,
    page,
    pieces,
    ratios,
    recorded,
    rules,
    singularity,
    theory,
    through_fmus,
    violation,
)
from tests.validation.paper.models import (
    CLOSED,
    CLOSED_ROD,
    MODELS,
    PRICED,
    RIGID,
    RIGID_ROD,
    RIGID_SPRING,
    RODS,
    TRANSFORMED,
    Model,
    scene,
)
from tests.validation.paper.results import HOLDS, NOT, PART, UNMEASURED, Results
from tests.validation.paper.statements import STATEMENTS, judged

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
    violations = violation.of_poses(pose(0.0), v, a, HALF)
    low, now, high = (gaps(pose(t)) for t in (-h, 0.0, h))
    first, second = (high - low) / (2.0 * h), (high - 2.0 * now + low) / h**2
    assert violations.gap[0] < 1e-15
    assert violations.gap[1] == pytest.approx(np.linalg.norm(first, axis=1).max(), rel=1e-6)
    assert violations.gap[2] == pytest.approx(np.linalg.norm(second, axis=1).max(), rel=1e-5)
    low, now, high = (tilts(pose(t)) for t in (-h, 0.0, h))
    assert violations.tilt[0] < 1e-15
    assert violations.tilt[1] == pytest.approx(np.abs(high - low).max() / (2.0 * h), rel=1e-6)
    assert violations.tilt[2] == pytest.approx(np.abs(high - 2.0 * now + low).max() / h**2, rel=1e-5)
    wrong = violation.of_poses(pose(0.0), 1.03 * v, a, HALF)
    assert wrong.gap[2] != pytest.approx(violations.gap[2], rel=1e-4)
    assert violations.cut.tolist() == [0.0, 0.0, 0.0]
    cut = violation.of_poses(pose(0.0), v, a, HALF, cut=True)
    assert cut.cut[1] == pytest.approx(np.linalg.norm(first[-1]), rel=1e-6)
    assert cut.gap[1] == pytest.approx(np.linalg.norm(first[:-1], axis=1).max(), rel=1e-6)


def test_a_loop_that_spins_as_one_violates_nothing():
    q, n, omega = ring(8), 8, 3.0
    v = np.hstack([np.cross([0.0, omega, 0.0], q[:, :3]), np.tile([0.0, omega, 0.0], (n, 1))])
    a = np.hstack([-(omega**2) * q[:, :3], np.zeros((n, 3))])
    violations = violation.of_poses(q, v, a, HALF)
    assert np.max([*violations.gap, *violations.tilt]) < 1e-13
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
    history = singularity.followed(t, np.array([belt(24, shift) for shift in t]), 0.2, 18.0)
    assert history.flips > 0
    assert history.closest > 1e10
    assert history.fixed.max() > 20.0 * history.fixed[0]
    assert history.choices > 0
    assert history.chosen.max() < history.fixed.max()
    assert history.cut.max() / history.cut.min() < 10.0


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
    element = cable.Cable(length, mass / length, 1.0, 1.0, 0.0, 0.0, (0, 1), inertia - mass * length**2 / 12.0)
    own = np.zeros((4, 4))
    cable.mass(element, own)
    scale = np.array([1.0, 1.0 / length, 1.0, 1.0 / length])
    one = singularity.mesh(3, length, mass, inertia)
    at = [0, 2, 3, 4]  # place and slope beginning of pin 0, place and slope ending of pin 1
    expected = scale[:, None] * own * scale
    np.testing.assert_allclose(one[np.ix_(at, at)][0, 1:], expected[0, 1:], rtol=1e-12)
    np.testing.assert_allclose(one[0, 0], 2.0 * expected[0, 0], rtol=1e-12)


# equations, knots, curvature


def values(rows):
    return {row.figures["key"]: row for row in rows}


def test_equations_of_the_paper_hold_for_the_elements(monkeypatch):
    rows = values(equations.rows())
    assert all(row.ok is True for row in rows.values()), [row.case for row in rows.values() if not row.ok]
    shape, mass, pin = cable.shape, cable.mass, equations.joints.pin_cable

    def heavier(c, M):
        mass(c, M)
        M[0, 0] *= 1.03

    monkeypatch.setattr(equations.cable, "shape", lambda c, xi, S: shape(c, 1.03 * xi, S))
    assert {key for key, row in values(equations.rows()).items() if not row.ok} == {"cubic", "rigid", "mass", "kinetic"}
    monkeypatch.setattr(equations.cable, "shape", shape)
    monkeypatch.setattr(equations.cable, "mass", heavier)
    monkeypatch.setattr(equations.joints, "pin_cable", lambda axis: equations.joints.spherical(2, 2))
    assert {key for key, row in values(equations.rows()).items() if not row.ok} == {"mass", "kinetic", "inertia", "pin"}
    monkeypatch.setattr(equations.joints, "pin_cable", pin)


def test_knots_join_what_section_5_says(monkeypatch):
    rows = values(knots.rows())
    assert all(row.ok is True for row in rows.values())
    assert rows["continuity_3"]["value"] == 0, "the paper's 'multiplicity three which corresponds to C2'"
    assert rows["pin_equations"]["value"] % 3 == 1
    assert rows["sliding_weaker"]["value"] == 4, "no equation of a knot is one of the joint's"
    spline = knots.spline
    monkeypatch.setattr(knots, "spline", lambda m: spline(min(m + 1, 4)))
    assert {key for key, row in values(knots.rows()).items() if not row.ok} >= {"continuity_1", "continuity_2"}


def test_curvature_at_pins_falls_as_elements_squared():
    rows = curvature.rows()
    assert all(row.ok is True for row in rows)
    ends = [row["ends"] for row in rows]
    assert [a / b for a, b in pairwise(ends)] == pytest.approx([4.0, 4.0, 4.0], rel=1e-3)
    assert rows[0]["middle"] == pytest.approx(2.0 / 3.0, rel=1e-6), "one element: the mean all along"
    assert rows[-1]["middle"] == pytest.approx(1.0, abs=0.02)


def test_curvature_of_recorded_links_is_that_of_their_cubics():
    x = np.linspace(0.0, 0.1524, 21)
    shape = 2e-3 * x**2 - 5e-3 * x**3  # curvature 4e-3 - 0.03 x: 4e-3 and -5.72e-4 at the pins
    moved = np.zeros((1, 3, 21, 3))
    moved[0, 0, :, 1], moved[0, 2, :, 1] = shape, 1e3 * shape
    ends, middle = curvature.of_links(Deformation("right_track", np.array([5.0]), x, moved))
    assert ends == pytest.approx(4e-3, rel=1e-9)
    assert middle == pytest.approx(4e-3 - 0.03 * 0.0762, rel=1e-9)


# frequencies


def test_a_known_signal_has_its_spectrum():
    t = np.arange(round(0.1 * high_frequencies.RATE)) / high_frequencies.RATE
    signal = sum(a * np.sin(2.0 * np.pi * f * t) for a, f in ((3.0, 50.0), (2.0, 700.0), (0.5, 48e3)))
    rms = [high_frequencies.rms_above(7.0 + signal, low) for low in high_frequencies.ABOVE]
    expected = [np.sqrt((4.0 + 0.25) / 2.0), 0.5 / np.sqrt(2.0), 0.5 / np.sqrt(2.0)]
    assert rms == pytest.approx(expected, rel=1e-3), "48 kHz, the links' own modes, is there too"
    assert high_frequencies.rms_above(1.03 * signal, 100.0) != pytest.approx(expected[0], rel=1e-2)
    assert high_frequencies.peak(signal, high_frequencies.WAVES) == pytest.approx(700.0)
    assert high_frequencies.peak(signal, 1e3) == pytest.approx(48e3)


@pytest.mark.long
def test_forces_of_a_loop_that_spins():
    """m omega^2 Rc / (2 sin(pi / N)) in each joint, and along a link m l omega^2 / 12 more than its ends pull."""
    n, omega, mass, pitch, turned = 16, links.SPIN * links.AT / 16, 18.0, 0.1524, 0.4
    settings = 'track.link_outputs=["force"]', "chain.ovalling=0", "track.integrator=runge_kutta"
    chain = links.chain_of(RIGID.name, n, *settings)
    chassis = SimpleNamespace(state=np.array([0.0, 0, 0, 1, 0, 0, 0]))
    vehicle = SimpleNamespace(models={high_frequencies.TRACK: chain, "chassis": chassis}, advance=chain.advance)
    level, tension = high_frequencies.forces(vehicle, 0.0, 3)
    joint = mass * omega**2 * pitch / (4.0 * np.tan(np.pi / n) * np.sin(np.pi / n))
    np.testing.assert_allclose(np.linalg.norm(level, axis=1), joint, rtol=1e-8)
    outwards = chain.pins()[conventions.FIRST - 1, [0, 2]]  # at right angles to the force
    assert abs(level[-1] @ outwards) < 1e-3 * joint * np.linalg.norm(outwards)
    np.testing.assert_allclose(tension, joint * np.cos(np.pi / n) + mass * pitch * omega**2 / 12.0, rtol=1e-3)
    chassis.state[[3, 5]] = np.cos(0.5 * turned), np.sin(0.5 * turned)  # its nose down
    nose_down, _ = high_frequencies.forces(vehicle, 3.0 / high_frequencies.RATE, 1)
    x, z = level[-1]
    wanted = [x * np.cos(turned) - z * np.sin(turned), x * np.sin(turned) + z * np.cos(turned)]
    np.testing.assert_allclose(nose_down[0], wanted, atol=1e-3 * joint)


def test_frequencies_of_contact_and_of_waves():
    vehicle = scene(CLOSED).vehicle
    assert high_frequencies.contact(vehicle) == pytest.approx(np.sqrt(4e6 / 18.02) / (2.0 * np.pi), rel=1e-9)
    speed = np.sqrt(2e11 / 7800.0)  # of sound in steel, m/s: the section gives the link's mass to 2e-4
    assert high_frequencies.wave(vehicle) == pytest.approx(speed / (64 * 0.1524), rel=1e-3)


# figures


def test_differences_are_at_the_same_instants():
    t = np.linspace(0.0, 1.0, 11)
    reference = figures.Curve(t, t[:, None])
    difference = figures.differences(figures.Curve(t[::2], 3.0 * t[::2, None]), reference)
    np.testing.assert_allclose(difference.values[:, 0], 2.0 * t[::2], atol=1e-15)
    path = figures.Curve(t, np.stack([t, t], axis=1))
    apart = figures.differences(path._replace(values=path.values + np.array([3.0, -4.0])), path)
    np.testing.assert_allclose(apart.values, 5.0)
    assert apart.values.shape == (11, 1), "of a path the distance"


def test_links_with_the_inertia_of_a_rod_have_a_pane_of_their_own():
    t = np.linspace(0.0, 1.0, 11)
    curves = {model: figures.Curve(t, k * t[:, None]) for k, model in enumerate((CLOSED, RIGID, RIGID_ROD))}
    page = figures._over_differences(figures.FIGURES[1], curves)
    shown = [{line.get_label(): line.get_ydata()[-1] for line in pane.get_lines()} for pane in page.axes]
    assert shown == [{CLOSED.label: 0.0, RIGID.label: 1.0, RIGID_ROD.label: 2.0}, {RIGID.label: 1.0},
                     {RIGID_ROD.label: 2.0}]  # fmt: skip


def test_sections_of_figure_20_are_those_of_the_text():
    """Slack from the sprocket to the first road wheel, transition over the ground and round the idler, tight above."""
    vehicle = scene(CLOSED).resolved()["vehicle"]
    wheel, idler = vehicle["road_wheel"], vehicle["idler"]
    corners = np.array([[0.25, 0.0], [wheel["x"][0], -0.53], [wheel["x"][-1], -0.53], [idler["x"], -0.4],
                        [idler["x"] - 0.28, -0.12], [idler["x"], 0.15], [0.0, 0.25]])  # fmt: skip
    closed = np.vstack([corners, corners[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    s = along[-1] * np.arange(256) / 256
    pins = np.stack([np.interp(s, along, closed[:, k]) for k in range(2)], axis=1)[None]
    links, joints, length = circuit.places(pins - pins[0].mean(axis=0), -pins[0].mean(axis=0))
    centres = 0.5 * (pins + np.roll(pins, -1, axis=1))
    placed = circuit.PlacedRecords(np.zeros(1), np.zeros(1), length, links, joints, centres, pins, np.eye(3)[None], ())
    between = conventions.edges(vehicle, placed)
    kinds = np.array(conventions.SECTIONS)[np.searchsorted(between[1:3], links[0], side="right")]
    ahead, up = centres[0].T
    ground = (up < -0.5) & (ahead < wheel["x"][0])
    behind = ahead < idler["x"]
    assert set(kinds[ground | behind]) == {"transition"}
    assert set(kinds[(up > 0.14) & (ahead > idler["x"]) & (ahead < 0.0)]) == {"tight"}
    assert set(kinds[(ahead > wheel["x"][0]) & (ahead < 0.2) & (up < -0.05)]) == {"slack"}
    assert list(between) == sorted(between)
    assert between[-1] == pytest.approx(length[0])


# inertia and elasticity


def test_a_rods_inertia_is_one_of_the_vehicles():
    for model, plain in zip(RODS, (RIGID, CLOSED), strict=True):
        track, own = scene(model).vehicle.track, scene(plain).vehicle.track
        assert track.inertia[1] == pytest.approx(track.mass * track.pitch**2 / 12.0, rel=1e-12)
        assert track.inertia[::2] == own.inertia[::2]
        assert own.inertia[1] == 0.04
        assert model.track == plain.track
    assert {(pair.run, pair.reference) for pair in effects.PAIRS} >= {(RIGID_ROD, CLOSED_ROD), (CLOSED, CLOSED_ROD)}


@pytest.mark.long
def test_effects_are_differences_of_two_runs(tmp_path, monkeypatch):
    monkeypatch.setattr(effects, "INSTANT", 0.05)
    monkeypatch.setattr(effects, "TURNING", Window(0.0, 0.05))
    logs = {}
    for model in (RIGID, RIGID_ROD):
        recorded.ensure(model, tmp_path, 0.05)
        logs[model.name] = recorded.path(tmp_path, model)
    (row,) = effects.rows(logs)
    assert row.case == "inertia, rigid links"
    assert 1e-6 < row["force"] < 0.05
    assert row["tension"] > 1e-6
    assert row["torque"] > 0.0
    same = effects.compared(logs, effects.Pair("", "", RIGID, RIGID))
    assert max(same.values()) == 0.0
    assert effects.relative(np.array([1.03, 0.0]), np.array([1.0, 0.0])) == pytest.approx(0.03)


# ratios


def cost(model, evaluations, setting=1e-3, interval=pieces.OUTPUT, item="piece", **more):
    figures = {"model": model.name, "method": pieces.ADAMS, "setting": setting, "interval": interval, **more}
    return Row(item, model.label, {**figures, "evaluations": evaluations})


def test_ratios_over_tolerance_interval_and_inside_fmus():
    results = [
        cost(CLOSED, 11000, cpu=0.4, least=0.3, most=0.5, counted=11100.0, each=2e-5, error=1e-8),
        cost(RIGID, 75, cpu=0.01, least=0.008, most=0.02, counted=90.0, each=4e-5, error=1e-5),
        cost(CLOSED, 11000, setting=1e-6),
        cost(RIGID, 300, setting=1e-6),
        cost(RIGID, 0, setting=1e-7),  # a tolerance that it could not keep
        cost(CLOSED, 11000, setting=1e-7),
        cost(CLOSED, 11000, interval=0.02, item="interval"),
        cost(RIGID_SPRING, 550, interval=0.02, item="interval", floor=2),
        Row("fmus", "", {"model": CLOSED.name, "tolerance": 1e-6, "evaluations": 1.2e6}, True),
        Row("fmus", "", {"model": RIGID.name, "tolerance": 1e-6, "evaluations": 5e4}, True),
        Row("fmus", "", {"model": RIGID.name, "tolerance": 1e-4, "evaluations": 5e4}, True),
    ]
    first, second, over_interval, inside = ratios.rows(results)
    assert first["evaluations"] == 11000 / 75
    assert first["counted"] == pytest.approx(11100 / 90)
    assert first["cpu"] == pytest.approx(40.0)
    assert (first["least"], first["most"]) == pytest.approx((0.3 / 0.02, 0.5 / 0.008)), "fastest over slowest"
    assert first["each"] == pytest.approx(0.5)
    assert second["evaluations"] == 11000 / 300
    assert second["tolerance"] == 1e-6
    assert over_interval["evaluations"] == 20.0
    assert (over_interval["interval"], over_interval["floor"]) == (0.02, 2)
    assert inside["evaluations"] == 24.0
    assert [row.figures["over"] for row in (first, second, over_interval, inside)] == [
        ratios.TOLERANCE, ratios.TOLERANCE, ratios.INTERVAL, ratios.FMUS
    ]  # fmt: skip
    assert len(page.table("ratio", results).rows) == 4


def test_evaluations_are_timed_in_turn(monkeypatch):
    timed = []

    class Drive:
        def __init__(self, wanted, piece):
            self.track = wanted.track.model

        def vehicle(self, method, setting):
            return self.track

        def evaluation_time(self, vehicle):
            timed.append(vehicle)
            return {"flexible": 1.0, "rigid": 2.0 if len(timed) > 2 else 4.0}[vehicle]  # the first run is slow

    monkeypatch.setattr(pieces, "Drive", Drive)
    adams, runge_kutta = pieces.in_turn(RIGID_SPRING.name, 0.02)
    assert timed == ["flexible", "rigid"] * 2 * pieces.TURNS
    assert (adams["method"], adams["least"], adams["each"], adams["most"]) == (pieces.ADAMS, 0.25, 0.5, 0.5)
    assert (runge_kutta["rigid"], runge_kutta["least"]) == (RIGID_SPRING.name, 0.5)


def test_projections_count_as_evaluations():
    run = pieces.Cost(pieces.ADAMS, 1e-3, 0.0095, 75, 1e-5, 3.0, steps=36, projections=36)
    assert pieces.figures(run)["counted"] == 111
    assert pieces.figures(run._replace(projections=0))["counted"] == 75, "joints that are eliminated"


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
    results = []
    for model, own, number in ((CLOSED, cpu, count), (RIGID, 1.0, 1.0)):
        common = {"model": model.name}
        results.append(
            Row("cost", model.label, {**common, "method": pieces.ADAMS, "cpu": own, "evaluations": number}, True)
        )
        results.append(Row("sections", model.label, {**common, "top": top, "rear": 10.0, "front": front}, True))
    for rigid in (RIGID, RIGID_SPRING):
        each = {"rigid": rigid.name, "method": pieces.ADAMS, "each": cpu / count}
        results.append(Row("each", rigid.label, each, True))
    return results


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


# models, logs, the command


def test_models_are_told_apart_and_one_that_is_missing_is_a_sentence():
    assert len({model.name for model in PRICED}) == len({model.label for model in PRICED}) == len(PRICED)
    assert not isinstance(scene(TRANSFORMED), str)
    assert {model.track for model in MODELS} == {"rigid", "flexible"}
    assert not isinstance(scene(RIGID), str)
    absent = Model("a", "b", "rigid", ("track.nonsense=1",), "-", "k")
    assert "unknown key 'track.nonsense'" in scene(absent)


def test_a_log_fits_by_its_scene_its_fmus_and_its_end(tmp_path, monkeypatch):
    path = tmp_path / "a.mcap"
    settings = ("run.stop=0.02 s", "chain.links=6", "track.start=displaced")
    wanted = load("hanging_chain", "flexible", settings)
    assert not recorded.fits(path, wanted)
    assert simulate(wanted, path)["status"] == "ok"
    assert recorded.fits(path, wanted)
    assert not recorded.fits(path, load("hanging_chain", "flexible", (*settings, "vehicle.gravity=9.8")))
    assert not recorded.fits(path, load("hanging_chain", "rigid", settings))
    with monkeypatch.context() as other:
        other.setattr(recorded, "sha256", lambda file: "another FMU's")
        assert not recorded.fits(path, wanted), "of other sources"
    path.write_bytes(path.read_bytes()[:-2000])
    assert not recorded.fits(path, wanted)


def test_an_interrupted_run_ends_the_study(tmp_path, monkeypatch):
    """An interruption is not stored as the result of a case."""
    results = {"status": "interrupted", "message": "interrupted at t = 1 s"}
    monkeypatch.setattr(recorded, "simulate", lambda wanted, file: results)
    with pytest.raises(KeyboardInterrupt):
        recorded.ran(None, tmp_path)
    results["status"] = "failed"
    with pytest.raises(RuntimeError, match="interrupted at"):
        recorded.ran(None, tmp_path)


def test_the_command_writes_the_page_and_a_statement_that_does_not_hold_is_exit_0(call, monkeypatch, tmp_path):
    from orchestrator.studies import Case

    monkeypatch.setattr(paper, "cases", lambda quick, folder: [Case("cost", "made up", rows, (0.5, 0.2, 5.0, 6.0))])
    status, out, err = call(app, "paper", "--quick", "--workers", 1, "-o", "found")
    assert status == 0, err
    assert "does not hold" in out
    page = (tmp_path / "found" / "paper.md").read_text()
    assert "| 8.3 | At 5 s the chain is tight before the sprocket" in page
    table = list(csv.DictReader((tmp_path / "found" / "paper.csv").open()))
    assert [row["verdict"] for row in table].count("does not hold") == 3
    failed = lambda: [Row("count", "pins", {"value": 125, "reference": 126}, False)]  # noqa: E731
    monkeypatch.setattr(paper, "cases", lambda quick, folder: [Case("count", "made up", failed)])
    status, _, err = call(app, "paper", "--workers", 1, "-o", "other")
    assert status == 1
    assert "minutes on two cores" in err, "the long form says before how long it takes"


def test_both_forms_have_the_same_cases(tmp_path):
    quick, full = paper.cases(True, tmp_path), paper.cases(False, tmp_path)
    assert [case.name for case in quick] == [case.name for case in full]
    assert {case.item for case in full} == {
        "run", "count", "equation", "curvature", "piece", "each", "stiffness", "modulus", "fmus", "spectrum", "links",
        "elasticity",
    }  # fmt: skip
    assert sum(case.item == "piece" for case in full) == len(PRICED) == len(MODELS) + 1


@pytest.mark.study
def test_fmus_begin_anew_at_each_communication_step():
    coarse, fine = through_fmus.rows(RIGID.name, 0.0125)
    assert [row["tolerance"] for row in (coarse, fine)] == [*through_fmus.TOLERANCES]
    for row in (coarse, fine):
        assert row.ok
        assert row["restarts"] == pytest.approx(2 * 800)
        assert row["evaluations"] > 2.0 * row["steps"] > 2.0 * row["restarts"]
    assert fine["evaluations"] > 1.2 * coarse["evaluations"]


@pytest.mark.study
def test_counts_of_a_piece():
    """Evaluations, not times: what the ratios are made of. Counted on 2026-11-23."""
    runs = {}
    for model in (RIGID, CLOSED):
        for row in pieces.rows(model.name, pieces.QUICK, (), pieces.INTERVALS):
            runs[row.item, model.name, row["method"], row["setting"], row["interval"]] = row
    assert all(row["least"] <= row["cpu"] <= row["most"] for row in runs.values())

    def adams(model, tolerance=pieces.AT, interval=pieces.OUTPUT, item="piece"):
        return runs[item, model.name, pieces.ADAMS, tolerance, interval]

    assert adams(RIGID)["evaluations"] == pytest.approx(75, abs=4)
    assert adams(RIGID)["projections"] == adams(RIGID)["steps"] == pytest.approx(36, abs=2)
    assert adams(RIGID, 1e-6)["evaluations"] == pytest.approx(294, rel=0.05)
    assert adams(CLOSED)["evaluations"] == pytest.approx(10801, rel=0.03)
    assert adams(CLOSED, 1e-6)["evaluations"] == pytest.approx(10901, rel=0.03), "bound by stability"
    assert adams(CLOSED)["projections"] == 0
    floors = [adams(RIGID, interval=part * pieces.OUTPUT, item="interval") for part in pieces.INTERVALS]
    assert [row["floor"] for row in floors] == [128, 32, 8, 2]
    assert [row["evaluations"] for row in floors] == pytest.approx([129, 75, 65, 72], abs=4)
    assert floors[0]["evaluations"] < 1.05 * floors[0]["floor"], "outputs every 0.3 ms take the steps"
    assert floors[1]["evaluations"] > 2.0 * floors[1]["floor"], "those every 1.25 ms do not"


@pytest.mark.study
def test_126_pins_of_the_vehicle_itself():
    by_key = {row.figures["key"]: row for row in counts.counted()}
    assert all(row.ok for row in by_key.values())
    assert by_key["equations"]["value"] == 630


@pytest.mark.study
def test_the_quick_form(call, tmp_path):
    status, _, err = call(app, "paper", "--quick", "-o", "found")
    assert status == 0, err
    made = {file.name for file in (tmp_path / "found").iterdir()}
    numbers = [*range(10, 18), 20, 21, "18-19"]
    assert {f"figure-{n}.{suffix}" for n in numbers for suffix in ("png", "svg")} <= made
    assert {"high-frequencies.png", "conditions.png", "paper-ratio.csv", "paper-effect.csv"} <= made
    rows = list(csv.DictReader((tmp_path / "found" / "paper.csv").open()))
    verdicts = {row["statement"]: row["verdict"] for row in rows}
    assert [text for text, v in verdicts.items() if v == UNMEASURED] == [STATEMENTS[-1].text], "no such frame here"
    for statement in STATEMENTS:
        if statement.rule in (rules.counted, rules.violated, rules.settled, rules.alike, rules.sections, rules.singular,
                              rules.fast, theory.cheaper):  # fmt: skip
            assert verdicts[statement.text] == HOLDS, statement.text
