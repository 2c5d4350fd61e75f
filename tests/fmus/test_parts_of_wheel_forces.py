"""Forces of teeth, rims and horns, and pin moments: by hand, and against the wrenches on the wheels."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from flexible_track import TABLE
from named_ports import parameters
from vehicle_in_process import InProcess, Member

from fmus.track_rigid.model import Model as Rigid
from orchestrator.scene.scene import load

PARTS = 'track.link_outputs=["force", "wheels", "teeth", "rims", "horns"]'
KINDS = ("joint[*].tooth", "link[*].rim", "link[*].horn")


def vectors(part: Member, name: str) -> np.ndarray:
    """Vectors (n, 3) of an output of all links or pins."""
    found = dict(zip(part.links, part.link_outputs(), strict=True))
    rows = []
    while f"{(one := name.replace('*', str(len(rows) + 1)))}.x" in found:
        rows.append([found[f"{one}.{axis}"] for axis in "xyz"])
    return np.array(rows)


@pytest.mark.parametrize("track", ["rigid", "flexible"])
def test_teeth_carry_a_hanging_chain(track):
    """A chain hung over a sprocket that stands: the teeth bear its weight and the pulls on its ends."""
    still = "drive.speed=0 rad/s", "bench.upper=2 kN", "bench.lower=2 kN", "run.links=1"
    part = InProcess(load("sprocket_bench", track, [PARTS, *still])).run(0.2)["track"]
    config, teeth = part.config["track"], vectors(part, "joint[*].tooth.force")
    assert np.count_nonzero(np.linalg.norm(teeth, axis=1)) >= 3
    weight = np.array([0.0, 0.0, config["links"] * part.config["vehicle"]["track"]["mass"] * config["gravity"]])
    pulls = sum(np.array([x, 0.0, z]) for x, z in (config["ends"]["first"], config["ends"]["last"]))
    allowed = 2e-3 * np.linalg.norm(weight - pulls)
    assert teeth.sum(axis=0) == pytest.approx(weight - pulls, abs=allowed)
    assert teeth.sum(axis=0) != pytest.approx(1.03 * (weight - pulls), abs=allowed)


@cache
def turned(track: str) -> Member:
    """The right track of a vehicle that turns to the left, whose guides have little clearance."""
    quick = "drive.ramp_start=0 s", "drive.ramp_time=0.2 s", "vehicle.guide.clearance=3 mm", "run.links=1"
    grip = "vehicle.contact.ground.friction=0.9", "run.step=1 ms"
    sides = {"left_drive": {"speed.end": 2.0}, "right_drive": {"speed.end": 16.0}}
    return InProcess(load("straight", track, [PARTS, *quick, *grip]), sides).run(0.5)["right_track"]


@pytest.mark.parametrize("track", ["rigid", pytest.param("flexible", marks=pytest.mark.study)])
def test_parts_are_the_forces_of_the_wheels(track):
    """On each link together; over all links the reactions of all wheels."""
    part = turned(track)
    teeth, rims, horns = (vectors(part, f"{kind}.force") for kind in KINDS)
    on_links = vectors(part, "link[*].wheels.force")
    size = np.linalg.norm(on_links, axis=1).max()
    together = np.roll(teeth, -1, axis=0) + rims + horns  # of teeth on the pin where the link ends
    assert together == pytest.approx(on_links, abs=1e-9 * size)
    for each in (teeth, rims, horns):
        assert np.linalg.norm(each, axis=1).max() > 0.01 * size, "a part does not act"
        assert together + 0.03 * each != pytest.approx(on_links, abs=1e-4 * size)
    values = dict(zip(part.outputs, part.y, strict=True))
    wheels = [name.removesuffix(".torque.x") for name in values if name.endswith(".torque.x")]
    given = {wheel: np.array([values[f"{wheel}.force.{axis}"] for axis in "xyz"]) for wheel in wheels}
    assert (teeth + rims + horns).sum(axis=0) == pytest.approx(-sum(given.values()), abs=1e-9 * size)


def test_pins_carry_the_moments_of_a_cantilever():
    """M = w (L - x)^2 / 2 about the normal of the links, by the weight w a metre beyond a pin that acts along it."""
    links, pitch, mass = 8, TABLE["track"]["pitch"], TABLE["track"]["mass"]
    config = {"links": links, "closed": False, "wheels": [], "ground": False, "gravity": 9.81}
    config |= {"ends": {"kind": "held", "first": [0.0, 0.0]}, "transverse_damping": 0.0}
    model = Rigid({"vehicle": TABLE, "track": config, "link_outputs": ["force", "moment"]})
    model.initialise(parameters(model, start="straight"))
    model.environment = model.environment._replace(gravity=(0.0, -9.81, 0.0))
    model.s.vdot[:] = model.s.a[:] = 0.0
    model.begin_run()
    for k in range(100):
        model.step(1e-3 * k, 1e-3, np.zeros(0))
    found = np.zeros(model.link_ports)
    model.link_outputs(found)
    moments = found[-3 * (links + 1) :].reshape(-1, 3)
    by_hand = np.zeros((links + 1, 3))
    by_hand[:, 2] = 0.5 * mass / pitch * 9.81 * (pitch * np.arange(links, -1, -1)) ** 2
    assert moments == pytest.approx(by_hand, rel=1e-6, abs=1e-3)
    assert moments != pytest.approx(1.03 * by_hand, rel=1e-6, abs=1e-3)
