"""Chains on soil: links that sink, slide and hop; memory and rut in the state of the track."""

from __future__ import annotations

from math import exp, radians, tan

import numpy as np
import pytest
from m113 import MASS, VEHICLE, P
from scipy.optimize import brentq

from fmus.ground.soils import SoilTable, named
from fmus.interface.model import StepFailed
from fmus.physics.chain import sums
from fmus.physics.chain.report import CONTACT, DISSIPATED, GRAVITY, KINETIC, LOST, REJECTED, STRAIN, WORK
from fmus.physics.contact.soil.memory import CELL, DEEPEST, FIRST, INSIDE, MADE, TILE, TILES
from fmus.physics.contact.soil.pressure import compaction
from fmus.track_flexible.model import Model as Flexible
from fmus.track_rigid.model import Model as Rigid
from fmus.vehicles.sides import ground_level, thickness

COMPACTED, SHEARED = (LOST + cause - sums.LOSSES for cause in (sums.GROUND_DAMPING, sums.GROUND_FRICTION))
WIDTH, FACE, G = VEHICLE["track"]["width"], VEHICLE["track"]["face"], 9.81
AREA, N = P * WIDTH, 4
SAND = {
    "kc": 0.99e3, "kphi": 1528.43e3, "n": 1.1, "cohesion": 1040.0, "friction_angle": radians(28.0),
    "shear_deformation_modulus": 0.025, "Au": 503e6,
}  # fmt: skip
STRENGTH = N * (AREA * SAND["cohesion"] + MASS * G * tan(SAND["friction_angle"]))
SINKAGE = (MASS * G / (AREA * (SAND["kc"] / WIDTH + SAND["kphi"]))) ** (1.0 / SAND["n"])
LEVEL = VEHICLE["road_wheel"]["z"] - VEHICLE["road_wheel"]["radius"] - 2.0 * FACE
pytestmark = pytest.mark.long


@pytest.mark.parametrize("kind", ["rigid", "cable"])
@pytest.mark.parametrize("name", sorted(named()))
def test_a_plate_of_any_weight_starts_at_its_sinkage(kind, name):
    """(F/(A k))^(1/n), level: deep in soil, which holds links up below their centres, that place is on an edge."""
    numbers = SoilTable(name=name).model_dump()
    for mass in (18.0, 500.0, 4000.0):
        track = VEHICLE["track"] | {"mass": mass, "inertia": [2.0 * mass / 500.0] * 3}
        model = pressed(kind, numbers, VEHICLE | {"track": track})
        k = numbers["kc"] / WIDTH + numbers["kphi"]
        expected, other = ((load * G / (AREA * k)) ** (1.0 / numbers["n"]) for load in (mass, 1.02 * mass))
        sinkage, places = LEVEL + FACE - model.pins()[:, 2], model.pins()[:, 0]
        assert sinkage == pytest.approx(expected, rel=1e-6, abs=1e-11)
        assert sinkage != pytest.approx(other, rel=1e-3)
        assert places == pytest.approx(-P * np.arange(3), abs=1e-9)


def free(kind, links, numbers, vehicle, first=(0.0, 0.0), last=(0.0, 0.0)):
    """A free chain on soil with pulls on its ends, N, and the parameter of its kind."""
    config = {
        "links": links, "closed": False, "wheels": [], "ground": True, "gravity": G, "soil": numbers,
        "ends": {"kind": "pulled", "first": list(first), "last": list(last)},
    }  # fmt: skip
    model = (Rigid if kind == "rigid" else Flexible)({"vehicle": vehicle, "track": config, "link_outputs": False})
    return model, {} if kind == "rigid" else {"element": kind}


def pressed(kind, numbers, vehicle):
    """A plate of two links at rest on soil."""
    model, parameters = free(kind, 2, numbers, vehicle)
    model.initialise(parameters)
    return model


def test_a_search_that_tips_a_plate_over_is_a_failure():
    """Links that may turn at once leave the level place; neither the plate upside down nor 4 % too little load."""
    numbers = SoilTable(name="snow").model_dump()
    model = pressed("rigid", numbers, VEHICLE | {"track": VEHICLE["track"] | {"mass": 500.0, "inertia": [2.0] * 3}})
    with pytest.raises(StepFailed, match="static equilibrium"):
        model.settle(np.stack([-P * np.arange(3), np.full(3, LEVEL + FACE)], axis=1), rest=True)


def lying(kind="rigid"):
    """A free chain of N links in equilibrium on soil."""
    model, parameters = free(kind, N, SAND, VEHICLE)
    model.read(parameters)
    model.settle(np.stack([-P * np.arange(N + 1), np.full(N + 1, LEVEL + FACE)], axis=1), rest=True)
    model.begin_run()
    return model


def push(model, along, up):
    """Add a velocity, m/s, to all of the chain."""
    model.s.v[:, 0] += along
    model.s.v[:, 1 if isinstance(model, Flexible) and model.kind.element == "planar" else 2] += up


def energy(model):
    return model.report[[KINETIC, STRAIN, GRAVITY, CONTACT, DISSIPATED]].sum()


def run(model, steps, h=1e-3, start=0):
    for k in range(start, start + steps):
        model.advance(h * k, h)
    return model


@pytest.mark.parametrize("kind", ["rigid", "cable"])
def test_the_work_of_pulls_is_force_times_way(kind):
    model, parameters = free(kind, N, SAND, VEHICLE, (300.0, 60.0), (-90.0, 0.0))
    model.read(parameters)
    model.settle(np.stack([-P * np.arange(N + 1), np.full(N + 1, LEVEL + FACE)], axis=1), rest=False)
    model.begin_run()
    start = model.pins()
    way = run(model, 200).pins() - start
    work = 300.0 * way[0, 0] + 60.0 * way[0, 2] - 90.0 * way[-1, 0]
    assert work > 5.0
    assert model.report[WORK] == pytest.approx(work, rel=1e-4)
    assert model.report[WORK] != pytest.approx(1.02 * work, rel=1e-3)


# planar cables and beams on soil have kernels of their own, a minute to compile
STUDIES = [pytest.param(kind, marks=pytest.mark.study) for kind in ("planar", "beam")]


@pytest.fixture(scope="module", params=["rigid", "cable", *STUDIES])
def chain(request):
    model = lying(request.param)
    return model, model.state.copy()


def test_links_that_slide_stop_where_shear_has_taken_their_energy(chain):
    """Within 0.5 %: shear acts below the pins, so links lean forward a little and press the soil."""
    model, start = chain
    model.state[:] = start
    push(model, 0.1, 0.0)
    first, place, before = model.pins()[:, 0].mean(), 0.0, None
    for k in range(200):
        run(model, 1, 5e-4, k)
        if before is None:
            before = energy(model)
        assert energy(model) == pytest.approx(before, abs=1e-4 * 0.5 * N * MASS * 0.1**2)
        if model.pins()[:, 0].mean() - first < place:
            break
        place = model.pins()[:, 0].mean() - first
    low, high, K = 0.0, 0.1, SAND["shear_deformation_modulus"]
    for _ in range(60):
        way = 0.5 * (low + high)
        work = STRENGTH * (way - K * (1.0 - exp(-way / K)))
        low, high = (way, high) if work < 0.5 * N * MASS * 0.1**2 else (low, way)
    assert place == pytest.approx(way, rel=5e-3)
    assert place != pytest.approx(1.02 * way, rel=5e-3)
    assert model.report[SHEARED] > 0.0
    assert model.report[DISSIPATED] == pytest.approx(model.report[[COMPACTED, SHEARED]].sum(), rel=1e-3)


def hop(model, forget=False):
    """Throw the chain up by 2 cm and let it land; return the sinkage of its points."""
    push(model, 0.0, 0.8)
    run(model, 80)
    assert model.s.rut[MADE] > 0.0
    assert not model.s.soil.any()
    cells = np.count_nonzero(model.s.rut[FIRST:].reshape(TILES, TILE)[:, 2:])
    assert cells == pytest.approx(N * AREA / CELL**2, rel=0.1)
    if forget:
        model.s.rut[FIRST:] = 0.0
    run(model, 160, start=80)
    return model.s.soil[model.s.soil[:, INSIDE] > 0.0, DEEPEST]


def test_links_land_in_their_rut(chain):
    """The loss by compaction is that of the deepest sinkage, hop after hop; without the rut, ground is new again."""
    model, start = chain
    model.state[:] = start
    last = hop(model).mean()
    landed = model.state.copy()
    for forget in (False, True):
        model.state[:] = landed
        deepest = hop(model, forget)
        soil = model.contacts.soil
        expected = N * AREA * (compaction(soil, deepest.mean()) - compaction(soil, SINKAGE))
        assert (deepest.min() > last) != forget
        assert (model.report[COMPACTED] == pytest.approx(expected, rel=1e-3)) != forget
        last = deepest.mean()


def test_a_saved_state_goes_on_to_the_bit(chain):
    """In the air over the rut and on the ground: memory and rut are in the state."""
    model, start = chain
    for k in (0, 100, 215):  # on the ground, in the air, after landing
        model.state[:] = start
        push(model, 0.2, 1.0)
        run(model, k)
        saved = model.state.copy()
        ends = []
        for _ in range(2):
            model.state[:] = saved
            run(model, 60, start=k)
            ends.append(model.state.copy())
        assert (ends[0] == ends[1]).all()
        if k == 100:
            assert model.s.rut[MADE] > 0.0
            assert not model.s.soil.any()
            model.state[:] = saved
            model.s.rut[FIRST:] = 0.0
            run(model, 60, start=k)
            assert (model.state != ends[0]).any()


def test_halved_steps_commit_once():
    """Newton's iteration fails until the step is halved ten times: soil remembers what equal short steps leave."""
    model, ends = lying(), []
    push(model, 0.1, -0.5)
    run(model, 3)
    saved, longest, model.method = model.state.copy(), model.max_step, model.method._replace(tolerance=-1.0)
    for step, rejected in ((longest, 10), (1e-3 / 1024, 0)):
        model.state[:], model.max_step = saved, step
        model.begin_run()
        before = model.counters[REJECTED]
        run(model, 1, start=3)
        assert model.counters[REJECTED] == before + rejected
        ends.append(np.append(model.s.flat, model.report))
    assert (ends[0] == ends[1]).all()
    assert model.report[COMPACTED] > saved[len(model.s.flat) + COMPACTED]


# --- grousers ---


def with_grousers(height, length, *, mass=MASS, **more):
    """The vehicle whose links have grousers of a ``height``, m, and a ``length``, of the pitch."""
    grouser = {"height": height, "length": length * P, "width": None, "count": 1} | more
    inertia = VEHICLE["track"]["inertia"] if mass == MASS else [2.0 * mass / 500.0] * 3
    return VEHICLE | {"track": VEHICLE["track"] | {"mass": mass, "inertia": inertia, "grouser": grouser}}


def touching(vehicle):
    """Height of the pins of links that just touch the ground, m."""
    return ground_level(vehicle) + thickness(vehicle["track"]) - vehicle["track"]["face"]


@pytest.mark.parametrize("kind", ["rigid", "cable"])
@pytest.mark.parametrize(("mass", "plate"), [(18.0, False), (50.0, False), (800.0, True), (4000.0, True)])
def test_pads_sink_under_their_own_pressure_until_the_plate_bears_too(kind, mass, plate):
    """F = A (share p(z) + (1 - share) p(z - height)); where the plate hangs, Bekker's sinkage at twice the pressure."""
    numbers, height = SoilTable(name="dry_sand").model_dump(), 0.02
    k = numbers["kc"] / WIDTH + numbers["kphi"]

    def expected(share):
        def missing(z):
            on_pads, on_plate = (k * max(depth, 0.0) ** numbers["n"] for depth in (z, z - height))
            return AREA * (share * on_pads + (1.0 - share) * on_plate) - mass * G

        return brentq(missing, 0.0, 1.0, xtol=1e-13)

    model = pressed(kind, numbers, with_grousers(height, 0.5, mass=mass))
    depth = touching(model.vehicle) - model.pins()[:, 2]
    assert depth == pytest.approx(expected(0.5), rel=1e-5)  # cables bend between their pads
    assert (depth > height).all() == plate
    assert plate or depth == pytest.approx((2.0 * mass * G / (AREA * k)) ** (1.0 / numbers["n"]), rel=1e-6)
    assert depth != pytest.approx(expected(0.5 * 1.05), rel=1e-3)


@pytest.mark.parametrize("kind", ["rigid", "cable", *STUDIES])
def test_the_energy_of_links_that_hop_and_slide_on_grousers_is_accounted_for(kind):
    """Two bars that sink to the plate and beyond: work of the soil is stored, compaction or shear."""
    model, parameters = free(kind, N, SAND, with_grousers(0.01, 0.1, count=2, width=0.3, mass=200.0))
    model.read(parameters)
    model.settle(np.stack([-P * np.arange(N + 1), np.full(N + 1, touching(model.vehicle))], axis=1), rest=True)
    model.begin_run()
    push(model, 0.3, 0.5)
    run(model, 1, 5e-4)
    before, moving = energy(model), 0.5 * N * 200.0 * (0.3**2 + 0.5**2)
    run(model, 400, 5e-4, 1)
    assert model.report[COMPACTED] > 0.1 * moving
    assert model.report[SHEARED] > 0.02 * moving
    assert energy(model) == pytest.approx(before, abs=1e-3 * moving)


@pytest.mark.parametrize("kind", ["rigid", "cable", *STUDIES])
@pytest.mark.parametrize("numbers", [None, SAND], ids=["hard", "soil"])
def test_pads_all_over_a_link_are_a_thicker_face(kind, numbers):
    """With a height of 0 to the bit; of 20 mm like a face that is 20 mm farther out, without wheels; not over 9/10."""
    states = []
    for face, grouser in ((0.0, None), (0.0, (0.0, 1.0)), (0.02, None), (0.0, (0.02, 1.0)), (0.0, (0.02, 0.9))):
        vehicle = with_grousers(*grouser) if grouser else VEHICLE
        vehicle |= {"track": vehicle["track"] | {"face": FACE + face}}
        model, parameters = free(kind, N, numbers, vehicle, (300.0, 60.0), (-90.0, 0.0))
        model.read(parameters)
        model.settle(np.stack([-P * np.arange(N + 1), np.full(N + 1, touching(vehicle))], axis=1), rest=False)
        model.begin_run()
        states.append(run(model, 40).pins() - [0.0, 0.0, ground_level(vehicle)])
    assert np.array_equal(states[0], states[1])
    assert abs(states[3] - states[2]).max() < 1e-6 < 1e-5 < abs(states[4] - states[2]).max()
