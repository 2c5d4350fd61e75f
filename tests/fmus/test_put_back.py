"""A state that is put back goes on to the bit, in every kind of component (on soil: ``test_track_soil``)."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from chassis_probe import Probe as Chassis
from chassis_probe import stir
from differentials import CHAINS, MOTORS, SIDES, differential, sway
from drive_probe import MODES, turning
from drive_probe import Probe as Drive
from flexible_track import at_rest, carrier
from free_chains import HOLD, made
from named_ports import Probe, parameters
from rigid_track import inputs, rolling
from unicycle import Unicycle

from fmus.track_flexible.model import Model as Flexible
from fmus.track_rigid.model import Model as Rigid

OVAL = {"start.spin": 3.0, "start.ovalling": 2.0}
JOINTS = {"formulation": "recursive", "integrator": "dormand_prince", "step": 1.0}


def of_probe(probe, inputs=lambda probe: None):
    """A model and its step of 1 ms from t with inputs that the clock decides."""

    def step(t):
        probe.t = t
        inputs(probe)
        probe.model.step(t, 1e-3, probe.u)

    return probe.model, step


def chassis():
    probe = Chassis()
    stir(probe.model)
    return of_probe(probe)


def drive():
    probe, mount = Drive(**MODES["controller"], extrapolation="acceleration"), turning([0.3, -0.5, 0.8])
    return probe.model, lambda t: (setattr(probe, "t", t), probe.step(1e-3, (0, -90.0, 5.0), mount=mount))


def gearbox():
    def moved(probe):
        for side in SIDES:
            sway(probe, f"{side}.mount", side)
            probe.give(f"{side}.sprocket.torque", CHAINS[side])

    return of_probe(differential(**MOTORS["torques and brakes"]), moved)


def driver():
    run = Unicycle(**{"path.arcs": "2 0; 3 0.1", "speed.end": 2.0})
    return run.model, lambda t: run.model.step(t, 1e-3, np.concatenate([[3.0 * t, t * t], run.hull()[2:]]))


def rods():
    model = rolling()
    model.initialise(parameters(model))
    return model, lambda t: model.step(t, 1e-3, inputs(model, t, 20.0))


def cables(**changes):
    model = carrier(**changes)
    return model, lambda t: model.step(t, 1e-3, at_rest(model, lift=2e-3 * np.cos(1e3 * t)))


def chain(kind, links, ends, **changes):
    return of_probe(Probe(model := made(kind, links, ends, **changes), **parameters(model, **changes)))


LAID_CHAINS = {
    "chassis": chassis, "drive": drive, "differential": gearbox, "driver": driver, "rigid": rods, "cable": cables,
    "folded": partial(chain, Flexible, 9, HOLD, start="folded", step=1e-4),
}  # fmt: skip
OWN_KERNELS = {  # kernels of their own
    **{element: partial(cables, element=element) for element in ("planar", "beam")},
    "free": partial(cables, axes="free"),
    "recursive": partial(chain, Rigid, 16, None, **JOINTS, **OVAL),
    "cholesky": partial(chain, Flexible, 16, None, integrator="runge_kutta", coordinates="cholesky", **OVAL),
}


@pytest.mark.parametrize("kind", [*LAID_CHAINS, *(pytest.param(kind, marks=pytest.mark.long) for kind in OWN_KERNELS)])
def test_a_state_that_is_put_back_goes_on_to_the_bit(kind):
    """Outputs of links too; a state of another size is not taken."""
    model, step = (LAID_CHAINS | OWN_KERNELS)[kind]()

    def shown():
        y = np.zeros(model.link_ports)
        if model.link_ports:
            model.link_outputs(y)
        return np.concatenate([model.state, y])

    for k in range(3):
        step(1e-3 * k)
    saved, ends = model.state.copy(), []
    for between in (0, 5):
        for k in range(3, 3 + between):
            step(1e-3 * k)
        assert model.copy_state(saved)
        at_once = shown()
        step(3e-3)
        step(4e-3)
        ends.append(np.concatenate([at_once, shown()]))
    np.testing.assert_array_equal(*ends)
    assert not np.array_equal(model.state, saved)
    assert not model.copy_state(saved[1:])
