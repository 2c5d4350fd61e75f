"""The mirror's soil itself, by closed forms; and a vehicle's outputs on another soil, which have to be noticed."""

from functools import cache, partial

import numpy as np
import pytest

from mirror import runs, soft, track_checks
from mirror.check import View

SAND = {
    "n": 1.1, "kc": 990.0, "kphi": 1528.43e3, "cohesion": 1040.0, "friction_angle": np.radians(28.0), "k0": 4e8,
    "Au": 0.0, "shear_deformation_modulus": 0.025, "rebound": None, "elastic": 0.0, "damping": 0.0, "width": None,
}  # fmt: skip
WIDTH, PITCH = 0.378, 0.1524
AREA = WIDTH * PITCH


def sled(depths, ways):
    """March of one point that has a whole link."""
    place = np.array([[[way, 0.0, 0.0]] for way in ways])
    points = soft.Points(
        place, np.array(depths)[:, None], np.full((len(ways), 1, 2), [PITCH, 0.0]), [0.0], [AREA], [(0.25, WIDTH)]
    )
    return soft.march(soft.Law(SAND, WIDTH), points)


def test_a_sled_shears_and_comes_back_into_its_rut():
    """Janosi and Hanamoto's force at any length of steps; no compaction where the rut is as deep."""
    ways = [0.0, 0.004, 0.01, 0.03]
    found = sled([0.05, 0.05, 0.05, 0.05, -0.01, 0.05], [*ways, 0.03, 0.03])
    k = SAND["kc"] / WIDTH + SAND["kphi"]
    pressure = k * 0.05**1.1
    limit = AREA * (SAND["cohesion"] + np.tan(SAND["friction_angle"]) * pressure)
    np.testing.assert_allclose(found.normal[:4, 0], AREA * pressure, rtol=1e-12)
    np.testing.assert_allclose(found.shear[:4, 0, 0], -limit * -np.expm1(-np.array(ways) / 0.025), rtol=1e-12)
    work = limit * (0.03 + 0.025 * np.expm1(-0.03 / 0.025))
    assert found.sheared.sum() == pytest.approx(work)  # all of it: the stored part is lost as the point leaves
    assert found.compacted.sum() == 0.0
    assert found.normal[5, 0] == pytest.approx(AREA * pressure)


def test_a_press_leaves_its_work_less_what_springs_back():
    """Work of the first loading F z / (n + 1), as in the set-up of the press."""
    found = sled([0.0, 0.05, 0.1], [0.0] * 3)
    force, stiffness = found.normal[-1, 0], AREA * 4e8
    work = force * 0.1 / 2.1
    assert found.compacted.sum() == pytest.approx(work - 0.5 * force**2 / stiffness, rel=1e-9)
    assert found.stored[-1, 0] == pytest.approx(0.5 * force**2 / stiffness)


@pytest.fixture(scope="module")
def record():
    return runs.record("sinking")


@pytest.mark.long
@pytest.mark.parametrize("key", ["K", "tan", "k0", "n", "rut"])
def test_another_soil_would_be_noticed(key, record, monkeypatch):
    """1 % of a number, or a forgotten rut, exceed the tolerances of the checks of ground forces."""
    if key == "rut":
        monkeypatch.setattr(soft, "_press", lambda *_: None)
    else:
        own = soft.Law.__init__

        def changed(law, *given):
            own(law, *given)
            setattr(law, key, 1.01 * getattr(law, key))

        monkeypatch.setattr(soft.Law, "__init__", changed)
    assert most_wrong(record) > 1.0


def most_wrong(record):
    """Largest error of the ground forces of a track over what is allowed."""
    view = View(record, "right_track")
    check = next(c for c in track_checks.CHECKS if c.basis == "contact laws" and "ground" in c.outputs)
    return max(check.relative_error(view.part[output], *ends) for output, ends in check.bounds(view).items())


@pytest.mark.long
@pytest.mark.parametrize(("run", "key"), [
    ("waving", "height"), *(("sinking", key) for key in ("height", "length", "width", "count")),
])  # fmt: skip
def test_other_grousers_would_be_noticed(run, key, grousers):
    """1 % of a number, or one grouser less."""
    record = grousers(run)
    table = record.parts["right_track"].config["vehicle"]["track"]["grouser"]
    own = table[key]
    assert most_wrong(record) <= 1.0
    table[key] = own - 1 if key == "count" else 1.01 * own
    assert most_wrong(record) > 1.0
    table[key] = own


@pytest.fixture(scope="module")
def grousers():
    """Records of runs on grousers by name, each made once."""
    made = {"waving": partial(runs.waving, runs.GROUSERS, duration=0.05),
            "sinking": partial(runs.record, "sinking on grousers")}  # fmt: skip
    return cache(lambda run: made[run]())
