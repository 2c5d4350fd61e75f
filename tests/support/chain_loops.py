"""Loops of flexible links, free or on the wheels of a vehicle."""

import pytest
from free_chains import made
from named_ports import parameters

from fmus.track_flexible.model import Model as Flexible
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load

N, SPIN = 16, 20.0  # links, rad/s
CLOSURES = pytest.mark.parametrize("closure", ["pin", pytest.param("spring", marks=pytest.mark.study)])


def loop(links=N, **changes):
    """A loop of cables without gravity; in names of parameters ``_of_`` stands for a point."""
    changes = {name.replace("_of_", "."): value for name, value in changes.items()}
    return made(Flexible, links, gravity=0.0, **changes)


def run(model, time, h=1e-3):
    """Advance a track by a time, s, in steps of ``h``."""
    for i in range(round(time / h)):
        model.advance(i * h, h)
    return model


def on_wheels(*settings):
    """Return a track of the vehicle in ``straight``, at rest, whose wheels then move away from it."""
    scene = load("straight", "flexible", ["placed=true", *settings])
    part = next(part for part in assemble(scene)[0] if part.name == "left_track")
    model = Flexible(part.config)
    model.initialise(parameters(model, **part.parameters))
    model.rows[:] = model.start_rows
    return model
