"""The rigid chain against closed forms and balances, then the track model behind its ports."""

from __future__ import annotations

import numpy as np
import pytest
from vehicle_in_process import InProcess

from fmus import track_steps
from fmus.model import InvalidParameter, StepFailed
from fmus.physics.chain.environment import LOOP, Environment
from fmus.physics.chain.explicit import slopes
from fmus.physics.chain.implicit import ImplicitMethod
from fmus.physics.chain.layout import close_exactly
from fmus.physics.chain.report import COUNTERS, REPORT
from fmus.physics.chain.rigid.dynamics import pin_motion
from fmus.physics.chain.rigid.explicit import accelerations
from fmus.physics.chain.rigid.links import RigidLinks, pins, place
from fmus.physics.chain.rigid.newton import FORCE
from fmus.physics.chain.rigid.state import shapes, views
from fmus.physics.chain.rigid.work import work
from fmus.physics.chain.state import size, store_first_evaluation
from fmus.physics.integrate import hht
from fmus.physics.integrate.generalized_alpha import coefficients
from fmus.physics.rigid.augmented import Ends
from fmus.track import INTEGRATORS
from fmus.track_rigid.model import Model
from fmus.vehicle import read_table, vehicle
from orchestrator.scene.scene import load

VEHICLE = vehicle(*read_table("m113")).model_dump()
TRACK = VEHICLE["track"]
P, MASS, LINKS = TRACK["pitch"], TRACK["mass"], TRACK["links"]


class Chain:
    """A chain without ports, wheels and ground."""

    def __init__(self, pins, ends, gravity=0.0, inertia=TRACK["inertia"], pitch=P, mass=MASS, radius=0.8):
        n = len(pins) if ends.closed else len(pins) - 1
        inertia = np.array(inertia, float)
        self.link = RigidLinks(0.5 * pitch, TRACK["face"], 0.25 * TRACK["width"], mass, inertia, ends)
        self.method = ImplicitMethod(coefficients(radius), FORCE, True)
        self.env = Environment(gravity, LOOP, np.zeros((2, 3)), 0.0, -1)
        sizes = shapes(n, ends.closed, 0)
        self.s, self.work = views(np.zeros(size(sizes)), sizes), work(n, ends.closed, 0)
        self.report, self.counters = np.zeros(REPORT), np.zeros(COUNTERS, np.int64)
        place(self.link, np.asarray(pins, float), self.s, self.work)

    def parts(self):
        return self.link, None, self.env

    def release(self):
        assert accelerations(*self.parts(), self.s, self.work) == -1
        store_first_evaluation(self.s, self.work)
        return self

    def run(self, time, h, step=track_steps.implicit, scheme=None):
        system = (
            self.link,
            self.env,
            self.method if scheme is None else scheme,
            h,
            self.s,
            self.work,
            self.report,
            self.counters,
        )
        assert not step(*track_steps.parts_without_contacts(*system), 0.0, time, np.zeros(0))
        return self

    def march(self, time, h):
        return self.run(time, h, track_steps.explicit, slopes(self.s))

    def pins(self):
        pin_motion(self.link, self.s, self.work)
        return self.work.pins[0]

    def energy(self):
        s, J = self.s, self.link.inertia
        kinetic = 0.5 * self.link.mass * (s.v[:, :3] ** 2).sum() + 0.5 * (s.v[:, 3:] ** 2 * J).sum()
        return kinetic + self.link.mass * self.env.gravity * s.q[:, 2].sum()

    def momenta(self):
        """Linear momentum, and angular momentum about the origin, each (3)."""
        s = self.s
        pin_motion(self.link, s, self.work)
        spin = np.einsum("nij,nj->ni", self.work.system.A, self.link.inertia * s.v[:, 3:])
        linear = self.link.mass * s.v[:, :3]
        return linear.sum(0), (np.cross(s.q[:, :3], linear) + spin).sum(0)


def ring(n):
    """Pins of a regular polygon, numbered so that the links' z axes point outwards."""
    angle = -2.0 * np.pi * np.arange(n) / n
    return P / (2.0 * np.sin(np.pi / n)) * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def spinning(n, rate, pitch=P):
    loop = Chain(ring(n) * pitch / P, Ends(True, False, False), pitch=pitch)
    loop.s.v[:, :3] = np.cross([0.0, rate, 0.0], loop.s.q[:, :3])
    loop.s.v[:, 4] = rate
    return loop.release()


@pytest.mark.parametrize("n", [5, 64])
def test_joint_force_of_a_spinning_loop(n):
    rate = 3.0
    expected = MASS * rate**2 * P / (2.0 * np.tan(np.pi / n)) / (2.0 * np.sin(np.pi / n))
    loop = spinning(n, rate)
    assert np.abs(np.linalg.norm(loop.s.lam[:, :3], axis=1) / expected - 1.0).max() < 1e-12
    loop.run(0.5, 1e-3)
    assert np.abs(np.linalg.norm(loop.s.lam[:, :3], axis=1) / expected - 1.0).max() < 1e-6
    assert loop.counters[2] <= 1.1 * loop.counters[0]  # one solve per step
    off = spinning(n, rate, 1.02 * P)  # twin: another pitch
    assert np.abs(np.linalg.norm(off.s.lam[:, :3], axis=1) / expected - 1.0).max() > 1e-3


def released(h, pitch=P, time=0.5, radius=0.8):
    """64 thin rods, pinned at one end and released from the horizontal."""
    pins = np.stack([pitch * np.arange(65), np.zeros(65)], axis=1)
    rods = Chain(pins, Ends(False, True, False), 9.81, (0.25, MASS * pitch**2 / 12, 0.22), pitch=pitch, radius=radius)
    return rods.release().run(time, h)


def test_released_horizontal_chain():
    tips = [released(h).pins()[-1, 0] for h in (2e-3, 1e-3, 5e-4)]
    assert tips[-1] == pytest.approx(9.413161, abs=2e-6)
    assert tips[1] == pytest.approx(9.413161, abs=2e-5)
    rate = np.log2((tips[0] - tips[1]) / (tips[1] - tips[2]))
    assert 1.85 < rate < 2.15
    assert abs(released(1e-3, 1.02 * P).pins()[-1, 0] - 9.413161) > 1e-3


def test_released_chain_explicitly():
    tips = []
    for h in (8e-3, 4e-3, 2e-3):
        rods = released(1e-3, time=1e-9)
        place(rods.link, np.stack([P * np.arange(65), np.zeros(65)], axis=1), rods.s, rods.work)
        rods.s.v[:] = 0.0
        tips.append(rods.march(0.5, h).pins()[-1, 0])
    assert tips[-1] == pytest.approx(9.413161, abs=1e-6)
    assert 3.5 < np.log2((tips[0] - tips[1]) / (tips[1] - tips[2])) < 5.5
    pins(rods.link, rods.s, rods.work)
    assert np.abs(rods.work.system.C).max() < 1e-11


def test_energy_of_the_released_chain():
    start = released(1e-3, time=1e-9).energy()
    errors = [abs(released(h, radius=1.0).energy() - start) for h in (2e-3, 1e-3)]
    assert errors[1] < 1e-5 * MASS * 64 * 9.81  # relative to the weight times a metre
    assert np.log2(errors[0] / errors[1]) > 1.7


def test_pins_do_not_drift():
    loop = tumbling().run(0.5, 1e-3)
    ends = loop.pins()
    chord = np.linalg.norm(np.roll(ends, -1, axis=0) - ends, axis=1)
    assert np.abs(chord - P).max() < 2e-11
    half = loop.link.half * loop.work.system.A[:, :, 0]
    gap = np.roll(loop.s.q[:, :3] + half, 1, axis=0) - (loop.s.q[:, :3] - half)
    assert np.abs(gap).max() < 1e-11
    assert np.abs(loop.work.system.A[:, :, 1] - loop.work.system.A[0, :, 1]).max() < 1e-10


def tumbling(n=12):
    """A squashed loop in space that flies and turns about an oblique axis."""
    pins = ring(n)
    pins[:, 1] *= 0.6
    pins = close_exactly(pins, P, closed=True)
    loop = Chain(pins, Ends(True, False, False))
    loop.s.q[:, :3] += [0.3, -0.2, 0.1]
    centre, rate = loop.s.q[:, :3].mean(0), np.array([1.0, 2.0, 1.5])
    pin_motion(loop.link, loop.s, loop.work)
    loop.s.v[:, :3] = np.cross(rate, loop.s.q[:, :3] - centre) + np.array([0.5, 0.1, -0.3])
    loop.s.v[:, 3:] = np.einsum("nji,j->ni", loop.work.system.A, rate)
    return loop.release()


def test_momentum_and_energy_in_space():
    errors = []
    for h in (2e-3, 1e-3):
        loop = tumbling()
        (linear, angular), energy = loop.momenta(), loop.energy()
        loop.run(0.5, h)
        after = loop.momenta()
        assert np.abs(after[0] - linear).max() < 1e-11 * np.abs(linear).max()
        errors.append([np.abs(after[1] - angular).max() / np.abs(angular).max(), abs(loop.energy() / energy - 1.0)])
    assert np.all(np.array(errors[1]) < 1e-4)
    assert np.all(np.log2(np.array(errors[0]) / errors[1]) > 1.7)


def test_one_link_turns_as_a_free_body():
    from scipy.integrate import solve_ivp

    J = np.array(TRACK["inertia"])
    one = Chain([[0.0, 0.0], [P, 0.0]], Ends(False, False, False))
    one.s.v[0, 3:] = 0.3, 6.0, 4.0
    start = one.s.v[0, 3:].copy()
    one.release().run(0.5, 2e-4)
    exact = solve_ivp(lambda _, w: -np.cross(w, J * w) / J, (0.0, 0.5), start, rtol=1e-11, atol=1e-12).y[:, -1]
    assert np.abs(one.s.v[0, 3:] - exact).max() < 1e-4
    assert np.abs(exact - start).max() > 0.5


# The model behind its ports ----------------------------------------------------------------------------------


def hanging(span=0.8, vehicle=VEHICLE, **track):
    config = {
        "links": LINKS, "closed": False, "wheels": [], "ground": False, "gravity": 9.81,
        "ends": {"kind": "pinned", "first": [0.0, 0.0], "last": [span * LINKS * P, 0.0]}, "transverse_damping": 0.0,
    }  # fmt: skip
    return Model({"vehicle": vehicle, "track": config | track, "link_outputs": True})


def parameters(model, **given):
    return {p.name: p.start for p in model.ports if p.causality == "parameter"} | given


def outputs(model):
    names = [p.name for p in model.ports if p.causality == "output" and isinstance(p.start, float)]
    y = np.zeros(len(names))
    model.outputs(y[: len(y) - model.link_ports])
    if model.link_ports:
        model.link_outputs(y[len(y) - model.link_ports :])
    return dict(zip(names, y, strict=True))


def test_hanging_chain_at_rest():
    model = hanging()
    model.initialise(parameters(model))
    y = outputs(model)
    w = MASS * 9.81 / P
    assert -min(y[f"joint[{i}].position.z"] for i in range(1, 66)) == pytest.approx(2.589308, abs=1e-6)
    assert abs(y["joint[1].force.x"]) / w == pytest.approx(3.298471, rel=1e-6)
    # the force at a pin carries half of the chain and the horizontal pull
    pull = np.hypot(y["joint[1].force.x"], y["joint[1].force.z"])
    assert pull == pytest.approx(np.hypot(3.298471 * w, 32 * MASS * 9.81), rel=1e-5)
    for k in range(20):
        model.step(k * 1e-3, 1e-3, np.zeros(0))
    later = outputs(model)
    assert max(abs(later[k] - y[k]) for k in y if "position" in k) < 1e-9
    assert model.counters[0] == 20
    other = hanging(span=0.8 * 1.02)
    other.initialise(parameters(other))
    assert abs(-outputs(other)["joint[33].position.z"] - 2.589308) > 1e-2


def test_displaced_chain_swings_and_keeps_its_energy():
    model = hanging()
    model.initialise(parameters(model, start="displaced"))
    start = outputs(model)
    assert start["joint[65].position.x"] == pytest.approx(0.8 * LINKS * P, abs=1e-12)
    moved = 0.0
    for k in range(300):
        model.step(k * 1e-3, 1e-3, np.zeros(0))
        y = outputs(model)
        moved = max(moved, abs(y["joint[33].position.z"] - start["joint[33].position.z"]))
    lost = start["energy.gravity"] - y["energy.gravity"] - y["energy.kinetic"]
    assert moved > 0.01
    assert y["energy.kinetic"] > 1.0
    assert abs(lost) < 1e-5 * y["energy.kinetic"]


def rolling(ground=True, idler=-3.998, gravity=9.81, **vehicle):
    v = VEHICLE | vehicle
    rims = [("road_wheel", x, v["road_wheel"]) for x in v["road_wheel"]["x"]] + [("idler", idler, v["idler"])]
    wheels = [{"name": "sprocket", "kind": "teeth", "position": [0.0, 0.0]}]
    for i, (name, x, part) in enumerate(rims):
        wheels.append({"name": f"{name}[{i}]", "kind": "rim", "radius": part["radius"], "position": [x, part["z"]]})
    config = {
        "links": LINKS,
        "closed": True,
        "wheels": wheels,
        "ground": ground,
        "gravity": gravity,
        "ends": None,
    }
    return Model({"vehicle": v, "track": config, "link_outputs": True})


@pytest.fixture(scope="module")
def track():
    model = rolling()
    model.initialise(parameters(model))
    return model, model.state.copy()


def inputs(model, t, spin, lateral=0.0, yaw=0.0, heading=0.0):
    """Inputs: the sprocket spins up to ``spin`` rad/s in 0.2 s; all wheels slide sideways and yaw."""
    ramp = 0.2
    rate = spin * min(t / ramp, 1.0)
    angle = spin * (0.5 * t * t / ramp if t < ramp else t - 0.5 * ramp)
    turned = yaw * t + heading
    c, s = np.cos(turned), np.sin(turned)
    u = np.zeros((len(model.wheel_list), 13))
    for row, wheel in zip(u, model.wheel_list, strict=True):
        x, z = wheel["position"]
        toothed = wheel["kind"] == "teeth"
        y = TRACK["lateral"] + lateral * t
        row[0:3] = c * x - s * y, s * x + c * y, z
        about = 0.5 * (angle if toothed else 0.0)
        cz, sz = np.cos(0.5 * turned), np.sin(0.5 * turned)
        row[3:7] = cz * np.cos(about), -sz * np.sin(about), cz * np.sin(about), sz * np.cos(about)
        row[7:10] = -yaw * row[1] - s * lateral, yaw * row[0] + c * lateral, 0.0
        own = rate if toothed else model.report[1] / wheel["radius"]
        row[10:13] = -s * own, c * own, yaw
    return u.ravel()


def test_closed_track_stays_at_rest(track):
    model, state = track
    model.state[:] = state
    model.counters[:] = 0
    before = outputs(model)
    assert before["tension.min"] > 5e3
    assert before["energy.kinetic"] == 0.0
    weight = LINKS * MASS * 9.81
    lifted = sum(before[f"{w['name']}.force.z"] for w in model.wheel_list)
    assert before["ground.force.z"] - lifted == pytest.approx(weight, abs=1e-4)
    for k in range(20):
        model.step(k * 1e-3, 1e-3, inputs(model, k * 1e-3, 0.0))
    after = outputs(model)
    assert after["tension.mean"] == pytest.approx(before["tension.mean"], rel=1e-6)
    assert after["energy.kinetic"] < 1e-6


def test_rigid_links_show_the_forces_that_cables_show_at_rest():
    """Rigid links at rest have the forces of cables, between seated pins too.

    There T cos^2(pi/z), 9.5 % less, passes from link to link. A rim stretches the halves of a cable, by 2 % of its
    tension on the idler.
    """
    shown = {}
    for name, settings in {"rigid": ("rigid",), "cable": ("flexible",)}.items():
        track = InProcess(load("straight", settings[0], settings[1:]))["left_track"]
        shown[name] = track.link_outputs(), track["tension.mean"], track["tension.max"]
        tension = [k for k, output in enumerate(track.links) if output.endswith("tension")]
        force = [k for k, output in enumerate(track.links) if ".force." in output]
    for which, allowed in ((tension, 0.03), (force, 5e-3)):
        one, other = (shown[name][0][which] for name in ("rigid", "cable"))
        assert abs(other).max() > 1e4
        assert abs(one - other).max() < allowed * abs(other).max()
        assert abs(1.05 * one - other).max() > allowed * abs(other).max()
    assert shown["rigid"][1:] == pytest.approx(shown["cable"][1:], rel=3e-3)


@pytest.mark.long
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_impulses_on_the_wheels_balance_the_momentum(track, integrator):
    model, state = track
    model.state[:] = state
    model.integrator, method = integrator, model.method
    if integrator == "hht":
        model.method = method._replace(alpha=hht.coefficients(0.8))
    model.begin_run()
    s, h = model.s, 1e-3
    for k in range(40):
        t = k * h
        before = MASS * s.v[:, :3].sum(0)
        model.step(t, h, inputs(model, t, 20.0, lateral=0.05))
        y = outputs(model)
        gained = MASS * s.v[:, :3].sum(0) - before
        force = [y[f"ground.force.{a}"] - sum(y[f"{w['name']}.force.{a}"] for w in model.wheel_list) for a in "xyz"]
        force[2] -= LINKS * MASS * 9.81
        assert np.abs(gained - h * np.array(force)).max() < 1e-9
    model.integrator, model.method = INTEGRATORS[0], method
    model.begin_run()
    assert np.abs(gained).max() > 0.1


def test_sprocket_drives_the_chain_over_wheels_and_ground(track):
    model, state = track
    model.state[:] = state
    model.counters[:] = 0
    for k in range(400):
        model.step(k * 1e-3, 1e-3, inputs(model, k * 1e-3, 10.0))
    y = outputs(model)
    pins = 10 * 10.0 * 0.3 / (2.0 * np.pi)  # teeth passed: half of the ramp of 0.2 s, and 0.2 s
    assert y["travel"] == pytest.approx(pins * P, rel=0.01)
    assert y["speed"] == pytest.approx(10 * P * 10.0 / (2.0 * np.pi), rel=0.04)
    assert y["energy.dissipated"] > 0.0
    assert model.counters[0] == 400
    assert model.counters[3] == 0
    assert model.counters[2] < 4 * 400
    worst = np.abs(model.work.system.C).max()
    assert worst < 1e-11


@pytest.mark.long
def test_integrators_agree():
    runs = []
    for integrator in INTEGRATORS:
        model = rolling()
        model.initialise(parameters(model, integrator=integrator, spectral_radius=0.5))
        for k in range(100):
            model.step(k * 1e-3, 1e-3, inputs(model, k * 1e-3, 10.0))
        runs.append(outputs(model))
    other = runs.pop(INTEGRATORS.index("runge_kutta"))
    for one in runs:
        assert one["speed"] == pytest.approx(other["speed"], rel=5e-3)
        assert one["travel"] == pytest.approx(other["travel"], rel=1e-2)
        assert one["tension.mean"] == pytest.approx(other["tension.mean"], rel=2e-2)
        assert one["energy.dissipated"] == pytest.approx(other["energy.dissipated"], rel=0.05)
    adams = runs[-1]
    assert adams["speed"] == pytest.approx(other["speed"], rel=1e-6)
    assert adams["energy.dissipated"] == pytest.approx(other["energy.dissipated"], rel=1e-5)


def test_guides_take_the_chain_along_sideways(track):
    model, state = track
    model.state[:] = state
    for k in range(600):
        model.step(k * 1e-3, 1e-3, inputs(model, k * 1e-3, 0.0, lateral=0.05))
    off = model.pins()[:, 1] - 0.05 * 0.6
    play = VEHICLE["guide"]["clearance"]
    assert np.abs(off).max() < play + 2e-3
    free = rolling(guide={"clearance": 1.0}, contact={k: v | {"friction": 0.0} for k, v in VEHICLE["contact"].items()})
    free.initialise(parameters(free))
    for k in range(600):
        free.step(k * 1e-3, 1e-3, inputs(free, k * 1e-3, 0.0, lateral=0.05))
    assert np.abs(free.pins()[:, 1]).max() < 1e-3  # nothing moves it sideways


def test_turned_vehicle_runs_alike(track):
    model, state = track
    model.state[:] = state
    for k in range(100):
        model.step(k * 1e-3, 1e-3, inputs(model, k * 1e-3, 10.0))
    straight = outputs(model)
    heading = np.radians(37.0)
    model.initialise(parameters(model, **{"start.heading": heading}))
    for k in range(100):
        model.step(k * 1e-3, 1e-3, inputs(model, k * 1e-3, 10.0, heading=heading))
    turned = outputs(model)
    for name in ("speed", "tension.mean", "travel", "road_wheel[2].force.z"):
        assert turned[name] == pytest.approx(straight[name], rel=1e-7, abs=1e-7)
    c, s = np.cos(heading), np.sin(heading)
    x, y = straight["sprocket.force.x"], straight["sprocket.force.y"]
    assert turned["sprocket.force.x"] == pytest.approx(c * x - s * y, rel=1e-6)
    assert turned["sprocket.force.y"] == pytest.approx(s * x + c * y, rel=1e-6)


def test_state_is_everything(track):
    model, state = track
    model.state[:] = state
    u = inputs(model, 0.3, 10.0)
    model.step(0.0, 1e-3, u)
    saved, counters = model.state.copy(), model.counters.copy()
    model.step(1e-3, 1e-3, u)
    first, first_counters = outputs(model), model.counters.copy()
    for _ in range(3):
        model.step(2e-3, 1e-3, inputs(model, 0.1, 3.0))
    model.state[:], model.counters[:] = saved, counters
    model.step(1e-3, 1e-3, u)
    assert outputs(model) == first
    assert np.array_equal(model.counters, first_counters)


def test_bad_parameters_and_hopeless_steps(track):
    model = hanging()
    with pytest.raises(InvalidParameter, match=r"spectral_radius = 1\.5: must be between 0 and 1"):
        model.initialise(parameters(model, spectral_radius=1.5))
    with pytest.raises(InvalidParameter, match=r"spectral_radius = 0\.4: integrator = 'hht' has 0\.5 to 1"):
        model.initialise(parameters(model, integrator="hht"))
    with pytest.raises(InvalidParameter, match=r"adams\.rtol = 1: must be between 1e-13 and 0\.1"):
        model.initialise(parameters(model, **{"adams.rtol": 1.0}))
    rolled, state = track
    rolled.state[:] = state
    u = inputs(rolled, 0.0, 0.0)
    u[5] = np.nan
    with pytest.raises(StepFailed, match=r"at t = 0 s the input sprocket.orientation.y is not finite"):
        rolled.step(0.0, 1e-3, u)
    u = inputs(rolled, 0.0, 0.0)
    u[3:7] = 0.0
    with pytest.raises(StepFailed, match=r"t = 2 s the input sprocket.orientation is no rotation: its length is 0"):
        rolled.step(2.0, 1e-3, u)
    u = inputs(rolled, 0.0, 0.0)
    with pytest.raises(StepFailed, match=r"a communication step of 1e\+06 s takes 1e\+09 internal steps of 0.001 s"):
        rolled.step(0.0, 1e6, u)
    rolled.state[:] = state
    rolled.step(0.0, 1e-13, u)
    assert np.isfinite(rolled.state).all()
    kept, u = rolled.contacts, inputs(rolled, 0.0, 0.0)
    rolled.contacts = kept._replace(wheel=kept.wheel._replace(k=1e40))
    rolled.begin_run()
    with pytest.raises(StepFailed, match=r"did not converge at t = 1 s, link \d+: residual"):
        rolled.step(1.0, 1e-3, u)
    rolled.contacts = kept
    rolled.begin_run()
