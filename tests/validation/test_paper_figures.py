"""Figures of the paper: frequencies, differences, sections, effects of inertia and elasticity."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.results.analyses import circuit
from orchestrator.results.run_data import Window
from tests.validation.paper import conventions, effects, figures, high_frequencies, links, recorded
from tests.validation.paper.models import CLOSED, CLOSED_ROD, RIGID, RIGID_ROD, RODS, scene

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
