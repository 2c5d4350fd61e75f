"""Benches on soil: a slow press by 10 kN, and resistance over the way of a sled, by closed form."""

from math import exp, radians, tan

import numpy as np
import pytest

from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.scene.scene import load

pytestmark = pytest.mark.long
MODELS = "rigid", "flexible"
AREA, G, LINKS = 0.1524 * 0.378, 9.81, 4
COHESION, PHI, K = 1040.0, radians(28.0), 0.025
LOAD = f"vehicle.track.mass={10e3 / G!r} kg"


def ran(path, name, model, *settings):
    """Record of a scene."""
    return Log(simulate(load(name, model, settings), path / "log.mcap")["log"])


@pytest.mark.parametrize("model", MODELS)
def test_a_plate_that_is_pressed_slowly_sinks_to_the_load(tmp_path, model):
    """10 kN a link: (F/(A k))^(1/n) = 137.8755 mm; let go, (n + 1)^(1/n) times as deep."""
    depths = []
    for start, stop in (("rest", "5 ms"), ("polygon", "0.4 s")):
        with ran(tmp_path, "plate_press", model, f"track.start={start}", LOAD, f"run.stop={stop}") as log:
            z = log.signal("chain.joint[1].position.z")[1]
        depths.append(-0.549 - z.min())
    slowly, let_go = depths
    assert slowly == pytest.approx(0.1378755, abs=5e-8)
    assert slowly == pytest.approx((10e3 / AREA / (0.99e3 / 0.1524 + 1528.43e3)) ** (1.0 / 1.1), rel=1e-7)
    assert slowly != pytest.approx((10e3 / AREA / (0.99e3 / 0.378 + 1528.43e3)) ** (1.0 / 1.1), rel=1e-4)
    assert let_go == pytest.approx(2.1 ** (1.0 / 1.1) * slowly, rel=1e-4)


@pytest.mark.parametrize("model", MODELS)
def test_the_resistance_of_a_sled_follows_its_way(tmp_path, model):
    """Mean over each step, to 5e-4 of the strength: links lean by 0.06 mm."""
    with ran(tmp_path, "shear_sled", model) as log:
        force, way = (log.signal(f"chain.{signal}")[1] for signal in ("ground.force.x", "joint[1].position.x"))
    strength = LINKS * (AREA * COHESION + 18.02 * G * tan(PHI))

    def worst(modulus):
        law = 1.0 - np.exp(-(way - way[0]) / modulus)
        return abs(force[1:] / strength + 0.5 * (law[1:] + law[:-1])).max()

    assert worst(K) < 5e-4
    assert worst(1.02 * K) > 4e-3
    middles = 0.5 * (way[1:] + way[:-1]) - way[0]
    assert np.interp(K, middles, -force[1:]) == pytest.approx(strength * (1.0 - exp(-1.0)), rel=3e-4)
