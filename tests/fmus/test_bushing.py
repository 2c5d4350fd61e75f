"""Bushed pins: statics and motion by solutions of their own, friction and its wear, energy, in all kinds of links."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import scipy
from bushed_chains import ELASTIC_CHAINS, INERTIA, MASS, G, P, chain
from m113 import TRACK, VEHICLE
from named_ports import outputs, parameters

from fmus.track_flexible.model import Model as Flexible
from fmus.track_rigid.model import Model as Rigid

pytestmark = pytest.mark.long  # each kind of links is compiled anew with bushes


def places(model) -> np.ndarray:
    """Positions of the pins (pins, 2) along x and z, m."""
    y = outputs(model)
    return np.array([[y[f"joint[{i}].position.{axis}"] for axis in "xz"] for i in range(1, model.nodes + 1)])


def turned(model) -> np.ndarray:
    """Angles of the inner pins, rad, positive as the chain bends round its wheels."""
    chord = np.diff(places(model), axis=0)
    return -np.diff(np.unwrap(np.arctan2(chord[:, 1], chord[:, 0])))


def hanging(links: int, span: float, stiffness: float, preset: float) -> tuple[np.ndarray, float]:
    """Angles of the links of a chain between two ends at one height, and its horizontal pull, N, by its energy."""
    after = links - np.arange(links) - 0.5  # weights that hang on a link's end, and half its own

    def gradient(x: np.ndarray) -> np.ndarray:
        a, (along, up) = x[:-2], x[-2:]
        torque = stiffness * (-np.diff(a) - preset)
        bend = np.zeros(links)
        bend[:-1] += torque
        bend[1:] -= torque
        balance = MASS * G * P * after * np.cos(a) + bend + P * (along * np.sin(a) - up * np.cos(a))
        return np.array([*balance / (MASS * G * P), (P * np.cos(a)).sum() - span, (P * np.sin(a)).sum()])

    slack = np.linspace(-0.6, 0.6, links)
    found = scipy.optimize.root(gradient, [*slack, MASS * G * links, 0.5 * MASS * G * links], tol=1e-13)
    assert np.abs(found.fun).max() < 1e-9
    return found.x[:-2], found.x[-2]


@pytest.mark.parametrize(("model", "changes", "tolerance"), ELASTIC_CHAINS)
def test_hanging_chain_with_bushes(model, changes, tolerance):
    links, span = 16, 0.9 * 16 * P
    ends = {"kind": "pinned", "first": [0.0, 0.0], "last": [span, 0.0]}
    hung = chain(model, links, {"stiffness": 400.0, "preset": 0.1}, ends, changes)
    found = places(hung)[links // 2, 1], abs(outputs(hung)["joint[1].force.x"])

    def expected(stiffness: float, preset: float) -> list[float]:
        angles, pull = hanging(links, span, stiffness, preset)
        return [P * np.sin(angles[: links // 2]).sum(), pull]

    assert found == pytest.approx(expected(400.0, 0.1), rel=tolerance)
    for twin in ((412.0, 0.1), (400.0, 0.103)):
        assert found != pytest.approx(expected(*twin), rel=tolerance)
    moments = [value for name, value in outputs(hung).items() if ".moment." in name]
    assert len(moments) == 3 * (links + 1)
    assert np.abs(moments).max() < 1e-6  # a torque about a pin is no moment across it
    stored = 200.0 * ((turned(hung) - 0.1) ** 2).sum()
    assert outputs(hung)["energy.strain"] == pytest.approx(stored, rel=10.0 * tolerance)


@pytest.mark.parametrize("model", [Rigid, Flexible])
@pytest.mark.parametrize(("bending", "agrees"), [(20.0, True), (20.1, False)])
def test_short_links_with_stiff_bushes_rest_as_an_elastica(model, bending, agrees):
    """Pinned ends at the distance D of a rod of length L and EI = 20 N m2: 2 E(m) / K(m) - 1 = D / L, m = k^2.

    Push 4 K^2 EI / L^2 = 207.85 N, sag k L / K = 0.19492 m; both at the start, and while it rests.
    """
    links, distance = 64, 0.9
    m = scipy.optimize.brentq(
        lambda m: 2.0 * scipy.special.ellipe(m) / scipy.special.ellipk(m) - 1.0 - distance, 1e-4, 0.9
    )
    K, p = scipy.special.ellipk(m), 1.0 / links
    rod = 8.0 * p**3 / 12.0  # 8 kg/m
    track = TRACK | {"pitch": p, "mass": 8.0 * p, "face": 0.01, "inertia": [0.005, rod + 1e-4, rod + 0.005]}
    ends = {"kind": "pinned", "first": [0.0, 0.0], "last": [distance, 0.0]}
    belt = chain(model, links, {"stiffness": bending / p}, ends, {}, gravity=1e-3, track=track)
    for k in range(6):
        y = outputs(belt)
        push = np.array([y[f"joint[{i}].force.x"] for i in range(1, links + 2)])
        assert (push[[0, -1]] == pytest.approx(4.0 * K**2 * 20.0, rel=1e-3)) == agrees
        assert np.ptp(push) < 0.01  # no weight, no acceleration
        assert places(belt)[:, 1].min() == pytest.approx(-np.sqrt(m) / K, rel=1e-3)
        belt.step(k * 1e-3, 1e-3, np.zeros(0))


def motion(model, changes: dict, h: float, bushing: dict) -> float:
    """Angle at 0.1 s of the pin between two links, the first of which the ground holds, from straight, rad."""
    pair = chain(model, 2, bushing, {"kind": "held", "first": [0.0, 0.0]}, changes | {"start": "straight"}, gravity=0.0)
    for k in range(round(0.1 / h)):
        pair.step(k * h, h, np.zeros(0))
    return float(turned(pair)[0])


@pytest.mark.parametrize(("model", "changes", "tolerance"), ELASTIC_CHAINS)
def test_two_links_swing_about_the_preset_of_their_bush(model, changes, tolerance):
    k, c, preset = 40.0, 0.2, 1e-3
    masses = np.array(
        [[INERTIA + 1.25 * MASS * P**2, 0.5 * MASS * P**2], [0.5 * MASS * P**2, INERTIA + 0.25 * MASS * P**2]]
    )

    def expected(k: float, c: float) -> float:
        per_torque = np.array([-1.0, 1.0]) @ np.linalg.solve(masses, [-1.0, 1.0])
        decay, whole = 0.5 * c * per_torque, k * per_torque
        ringing = np.sqrt(whole - decay**2)
        return preset * (1.0 - np.exp(-0.1 * decay) * (np.cos(0.1 * ringing) + decay / ringing * np.sin(0.1 * ringing)))

    bushing = {"stiffness": k, "damping": c, "preset": preset}
    coarse, middle, fine = (motion(model, changes, h, bushing) for h in (1e-3, 5e-4, 2.5e-4))
    assert 3.7 < (coarse - middle) / (middle - fine) < 4.3  # of second order
    extrapolated = fine - (middle - fine) / 3.0
    assert extrapolated == pytest.approx(expected(k, c), rel=max(tolerance, 1e-5))
    assert extrapolated != pytest.approx(expected(1.02 * k, c), rel=1e-3)
    assert extrapolated != pytest.approx(expected(k, 1.05 * c), rel=1e-3)


@pytest.mark.parametrize(("model", "changes", "tolerance"), ELASTIC_CHAINS)
def test_friction_of_pins_is_the_work_of_their_wear(model, changes, tolerance):
    """The ledger closes, and each pin's work is that of its friction under its force."""
    links = 8
    ends = {"kind": "pinned", "first": [0.0, 0.0], "last": [0.8 * links * P, 0.0]}
    bushing = {"stiffness": 50.0, "damping": 1.0, "friction": 0.3}
    swinging = chain(model, links, bushing, ends, changes | {"start": "displaced"})
    parts = [f"energy.{part}" for part in ("kinetic", "strain", "gravity", "dissipated")]
    energies, work, before, most = [], 0.0, None, 0.0
    h = 2.5e-4
    for k in range(800):
        y = outputs(swinging)
        angles, force = (
            turned(swinging),
            [np.hypot(y[f"joint[{i}].force.x"], y[f"joint[{i}].force.z"]) for i in range(2, 9)],
        )
        if before is not None:
            rate = (angles - before) / h
            work += h * (0.3 * 0.02 * np.array(force) * rate**2 / np.sqrt(rate**2 + 0.2**2)).sum()
        before, most = angles, max(most, y["energy.kinetic"])
        energies.append(sum(y[part] for part in parts))
        swinging.step(k * h, h, np.zeros(0))
    y = outputs(swinging)
    assert np.ptp(energies) < 1e-3 * most
    assert y["energy.dissipated.pins"] > 0.1 * most
    assert swinging.s.turned[:, 1].sum() == pytest.approx(y["energy.dissipated.pins"], rel=1e-12)
    assert work == pytest.approx(y["energy.dissipated.pins"], rel=0.01)
    assert 1.03 * work != pytest.approx(y["energy.dissipated.pins"], rel=0.01)
    assert (swinging.s.turned[1:-1] > 0.0).all()
    assert not swinging.s.turned[[0, -1]].any()  # the pins of the ground have no bush


@pytest.mark.parametrize(
    ("model", "changes"),
    [
        pytest.param(Rigid, {"integrator": "runge_kutta"}, marks=pytest.mark.study),
        (Rigid, {"integrator": "dormand_prince", "formulation": "recursive"}),
        pytest.param(Flexible, {"integrator": "adams", "coordinates": "cholesky"}, marks=pytest.mark.study),
    ],
)
def test_explicit_integrators_find_the_same_motion(model, changes):
    ends = {"kind": "pinned", "first": [0.0, 0.0], "last": [0.8 * 8 * P, 0.0]}
    bushing = {"stiffness": 500.0, "preset": 0.05, "damping": 2.0, "friction": 0.2, "slow": 2.0}
    ends_of = []
    for choice, h in ((changes, 1e-3), ({}, 1e-4)):
        model_run = chain(model, 8, bushing, ends, {"start": "displaced"} | choice)
        for k in range(round(0.02 / h)):
            model_run.step(k * h, h, np.zeros(0))
        ends_of.append([*places(model_run)[4], *1e-2 * model_run.s.turned.sum(axis=0)])
    assert ends_of[0] == pytest.approx(ends_of[1], abs=2e-6)
    still = places(chain(model, 8, bushing, ends, {"start": "displaced"}))[4]
    assert np.abs(still - ends_of[1][:2]).max() > 1e-4


@pytest.mark.parametrize("model", [Rigid, Flexible])
def test_a_chain_on_flat_ground_lies_or_curls_as_its_preset_says(model):
    stiffness, links = 1500.0, 16
    ends = {"kind": "pulled", "first": [0.0, 0.0], "last": [0.0, 0.0]}
    for preset in (0.0, 0.3):
        lying = chain(model, links, {"stiffness": stiffness, "preset": preset}, ends, {}, ground=True)
        angles, z = turned(lying), places(lying)[:, 1]
        if preset == 0.0:
            assert np.abs(angles).max() < 1e-6
            continue
        # where a pin and the one before it are in the air, the weight beyond it turns against the bush
        x, on = places(lying)[:, 0], z - z.min() < 1e-3
        last = int(np.flatnonzero(on)[-1]) + 2
        assert links - last >= 2
        middle = 0.5 * (x[1:] + x[:-1])
        for j in range(last, links):
            moment = MASS * G * abs(middle[j:] - x[j]).sum()
            assert stiffness * (preset - angles[j - 1]) == pytest.approx(moment, rel=0.01)
            assert stiffness * (1.05 * preset - angles[j - 1]) != pytest.approx(moment, rel=0.01)
        assert z[-1] - z.min() > 0.1


def turned_a_circuit(links: int) -> float:
    """Angle that a pin of a weightless belt round two smooth wheels turns in a circuit, over that of a polygon.

    The pins lie at R = 0.255 m; a polygon's link takes 2 atan(p / 2 R) of a wheel, to and fro at both: 4 p / R.
    """
    radius, face, distance, h, speed = 0.25, 0.005, 1.0, 1e-3, 1.0
    pitch = (2.0 * distance + 2.0 * np.pi * (radius + face)) / links * 0.9995
    rod = pitch**3 / 12.0  # 1 kg/m
    bushing = {"stiffness": 0.0, "preset": 0.0, "damping": 0.05, "friction": 1e-3, "radius": 0.01, "slow": 0.02}
    track = TRACK | {
        "pitch": pitch, "face": face, "mass": pitch, "inertia": [1e-4, 1.0001 * rod, rod + 1e-4], "width": 0.1,
        "bushing": bushing,
    }  # fmt: skip
    vehicle = VEHICLE | {"track": track, "sprocket": VEHICLE["sprocket"] | {"pitch": TRACK["pitch"]}}
    places = {"road_wheel[1]": 0.0, "idler": -distance}
    wheels = [{"name": name, "kind": "rim", "radius": radius, "position": [x, 0.0]} for name, x in places.items()]
    config = {"links": links, "closed": True, "wheels": wheels, "ground": False, "gravity": 0.0, "ends": None}
    belt = Rigid({"vehicle": vehicle, "track": config, "link_outputs": False})
    belt.initialise(parameters(belt, step=h))
    u, k, start, passed = np.zeros((2, 13)), 0, None, 0.0
    u[:, 0], u[:, 1] = list(places.values()), TRACK["lateral"]
    while start is None or belt.report[0] - passed < links * pitch:
        t = k * h
        rate = speed / (radius + face) * min(t, 1.0)
        angle = speed / (radius + face) * (0.5 * t * t if t < 1.0 else t - 0.5)
        u[:, 3], u[:, 5], u[:, 11] = np.cos(0.5 * angle), np.sin(0.5 * angle), rate
        belt.step(t, h, u.ravel())
        k += 1
        if k == 1500:
            start, passed = belt.s.turned[:, 0].copy(), belt.report[0]
        assert k < 10_000
    circuits = (belt.report[0] - passed) / (links * pitch)
    return float((belt.s.turned[:, 0] - start).mean()) / circuits / (8.0 * np.arctan(0.5 * pitch / (radius + face)))


def test_a_belt_round_two_wheels_turns_its_pins_by_four_pitches_over_the_radius():
    """Links that strike the wheels rock besides, the less the shorter they are."""
    coarse, fine = turned_a_circuit(128), turned_a_circuit(256)
    assert 1.0 < fine < coarse < 1.04
    assert 2.0 * fine - coarse == pytest.approx(1.0, abs=0.01)
    assert 1.03 * (2.0 * fine - coarse) != pytest.approx(1.0, abs=0.01)


AS_PYTHON = """
import numpy as np
from bushed_chains import ELASTIC_CHAINS, P, chain
ends = {"kind": "pinned", "first": [0.0, 0.0], "last": [0.8 * 3 * P, 0.0]}
for model, changes, _ in (kind.values for kind in ELASTIC_CHAINS):
    pair = chain(model, 3, {"damping": 1e4, "friction": 0.2, "preset": 0.1}, ends, changes | {"start": "polygon"})
    for k in range(3):
        pair.step(k * 1e-3, 1e-3, np.zeros(0))
    print(pair.counters[2] <= 9 and pair.counters[3] == 0)
"""


def test_all_kinds_keep_inside_their_arrays(environment):
    """Kernels as Python check every index; the kinds that are compiled in studies alone converge here too."""
    env = {**environment, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run([sys.executable, "-c", AS_PYTHON], env=env, capture_output=True, text=True)
    assert done.stdout.split() == ["True"] * len(ELASTIC_CHAINS), done.stderr
