"""Ground contact of hull points and bare wheels: weight, momentum, friction, energy balance."""

import numpy as np
import pytest
from named_ports import Probe

from fmus.chassis.leaf import ROOT
from fmus.chassis.model import Model
from fmus.vehicles.sides import ground_level
from fmus.vehicles.vehicle import read_table, vehicle

TABLE = vehicle(*read_table("m113")).model_dump()
G, LEAVES = 9.81, 12
MASS = 15891.58 - 128 * 18.02
WHEEL = TABLE["road_wheel"]
ON_BEAMS = {
    "suspension": None,
    "road_arm": {
        **TABLE["road_arm"], "beams": ((1, 2, 3), (4, 5)), "mass": (90.0, 40.0, 120.0, 60.0, 30.0),
        "pivot": tuple((at - x, 0.134) for at, x in zip((*3 * [-1.4], *2 * [-2.9]), WHEEL["x"], strict=True)),
    },
}  # fmt: skip
RIDGE = {"start": 0.5, "rise": 0.3, "slope": 0.4, "length": 1.0, "radius": 0.5}


class Body(Probe):
    """A chassis on the ground with bare wheels; ``law`` replaces values of the table's contact law."""

    def __init__(self, hull=False, bare=("left", "right"), bump=None, law=(), start=(), parts=(), **parameters):
        table = {**TABLE, "contact": {**TABLE["contact"], "ground": {**TABLE["contact"]["ground"], **dict(law)}}}
        table |= dict(parts)
        ground = {"hull": hull, "bare": list(bare), **({"bump": bump} if bump else {})}
        model = Model({"vehicle": table, "chassis": {"sides": ["left", "right"], "ground": ground}})
        super().__init__(model, **{f"start.{key}": value for key, value in dict(start).items()}, **parameters)
        self.whole = self.energy

    @property
    def energy(self):
        """Total energy with the dissipated part, J."""
        return sum(self[f"energy.{part}"] for part in ("kinetic", "gravity", "spring", "contact", "dissipated"))


@pytest.mark.long
def test_a_hull_slides_as_far_as_friction_says():
    """A hull slides by v^2 / (2 mu g); wheels and idlers are pulled up and do not touch."""
    v, mu = 3.0, 0.3

    def way(**law):
        body = Body(hull=True, bare=(), law={"friction": mu, "friction_velocity": 1e-3, **law}, start={"height": -0.40})
        x = body.model.state
        body.run(2.0)
        x[7] += v  # at rest on its floor; then all of it gets the speed v
        before = x[0]
        body.run(2.0)
        assert abs(x[7]) < 1e-3
        return x[0] - before

    assert way() == pytest.approx(v * v / (2 * mu * G), rel=0.01)
    assert way(friction=1.04 * mu) != pytest.approx(v * v / (2 * mu * G), rel=0.02)


def test_wheels_of_beams_carry_what_levers_give_them():
    """Level ground under a hull on beams of three and two wheels, without springs; arms have masses of their own.

    Both beams carry the hull at their pivots, by levers. A beam of two wheels shares its load by levers; under that of
    three, which is rigid, the ground gives way along a line. The twin: a pivot 3 % of a wheel base elsewhere.
    """
    mass, pivots = np.array(ON_BEAMS["road_arm"]["mass"]), np.array([-1.4, -1.4, -1.4, -2.9, -2.9])
    x, stiffness = np.array(WHEEL["x"]), TABLE["contact"]["ground"]["stiffness"]
    body = Body(law={"damping": 1e5}, parts=ON_BEAMS).run(1.5)
    assert np.abs(body.model.state[7:13]).max() < 1e-6
    sink = [ground_level(TABLE) + WHEEL["radius"] - body[f"left.road_wheel[{k}].position.z"] for k in range(1, 6)]

    def loads(pivots):
        hull, idler, sprocket = TABLE["chassis"], TABLE["idler"], TABLE["sprocket"]
        weight = 0.5 * G * hull["mass"] + G * (idler["mass"] + sprocket["mass"])
        moment = 0.5 * G * hull["mass"] * hull["centre"][0] + G * idler["mass"] * idler["x"]
        on_pivots = np.linalg.solve([[1.0, 1.0], pivots[[0, 4]]], [weight, moment])
        found = []
        for on, its in zip(on_pivots, (slice(0, 3), slice(3, 5)), strict=True):
            to, arms = x[its] - pivots[its], G * mass[its]
            load = on + (arms + G * WHEEL["mass"]).sum(), (0.5 * arms + G * WHEEL["mass"]) @ to
            line = np.linalg.solve([[len(to), to.sum()], [to.sum(), to @ to]], load)
            found += [*(line[0] + line[1] * to)]
        return found

    assert stiffness * np.array(sink) == pytest.approx(loads(pivots), rel=2e-3)
    assert stiffness * np.array(sink) != pytest.approx(loads(pivots + np.repeat([0.04, 0.0], [3, 2])), rel=2e-2)


@pytest.mark.long
def test_sliding_wheels_spin_up_to_rolling():
    """Sliding wheels spin up to rolling at v = v0 / (1 + sum I / (m R^2)).

    The angular momentum about the ground is conserved, wherever the friction has acted.
    """
    v0 = 2.0
    inertia = 10 * WHEEL["spin_inertia"] / WHEEL["radius"] ** 2

    def end(factor=1.0):
        body = Body().run(3.0)
        x = body.model.state
        x[7] += v0 * factor
        body.run(2.0)
        rim = x[ROOT + 3 * LEAVES] * WHEEL["radius"]
        assert rim == pytest.approx(x[7], rel=1e-3)
        return x[7]

    assert end() == pytest.approx(v0 / (1 + inertia / MASS), rel=2e-3)
    assert end(1.02) != pytest.approx(v0 / (1 + inertia / MASS), rel=1e-2)


@pytest.mark.parametrize(("bump", "parts"), [(None, {}), (RIDGE, {}), (RIDGE, ON_BEAMS)])
def test_ledger_closes_over_an_impact_and_a_bump(bump, parts):
    def left(**changes):
        body = Body(hull=True, bump=bump, start={"height": 0.3, "heading": 0.7}, parts=parts, **changes)
        body.model.state[7:9] = 3.0 * np.cos(0.7), 3.0 * np.sin(0.7)
        body.whole = body.energy
        body.run(1.2)
        assert body["energy.dissipated"] > 1e4
        return abs(body.energy - body.whole) / body["energy.dissipated"]

    assert left() < 1e-4
    assert left(step=1e-3) > 2 * left()


def test_the_way_over_a_bump_is_the_same_at_every_heading():
    def end(heading):
        body = Body(bump=RIDGE, start={"heading": heading, "position.x": 3.0, "position.y": -1.0})
        body.model.state[7:9] = 4.0 * np.cos(heading), 4.0 * np.sin(heading)
        body.run(0.8)
        return [body[name] for name in ("distance", "pitch", "settlement", "energy.dissipated")]

    np.testing.assert_allclose(end(0.9), end(0.0), rtol=1e-8, atol=1e-8)
    assert end(0.0)[2] < 0.0  # it has climbed
