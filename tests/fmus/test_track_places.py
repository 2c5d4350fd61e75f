"""A track refuses its first step if its wheels are not where it was laid out, for all kinds of links."""

import numpy as np
import pytest

from fmus.model import StepFailed
from fmus.track_flexible.model import Model as Flexible
from fmus.track_rigid.model import Model as Rigid
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load

KINDS = [
    (Flexible, "cable"),
    pytest.param(Rigid, None, marks=pytest.mark.long),
    *(pytest.param(Flexible, element, marks=pytest.mark.long) for element in ("planar", "beam")),
]


def laid(kind, element, **parameters):
    """Return an unsettled left track of the standard vehicle, and the inputs of its wheels as drawn."""
    scene = load("straight", "rigid" if kind is Rigid else "flexible")
    model = kind(next(part.config for part in assemble(scene).parts if part.name == "left_track"))
    given = {port.name: port.start for port in model.ports if port.causality == "parameter"}
    given |= {"start": "polygon", **({} if element is None else {"element": element})}
    model.initialise({**given, **parameters})
    return model, np.array([port.start for port in model.ports if port.causality == "input"])


@pytest.mark.parametrize(("kind", "element"), KINDS)
def test_wheels_of_the_other_side_are_refused(kind, element):
    model, wheels = laid(kind, element, **{"start.lateral": -1.0795})
    before = model.state.copy()
    with pytest.raises(StepFailed, match=r"sprocket is 2.16 m from .* start.lateral = -1.0795 m must be"):
        model.step(0.0, 1e-3, wheels)
    np.testing.assert_array_equal(model.state, before)


@pytest.mark.parametrize("place", [{"start.heading": 0.1}, {"start.position.z": 0.2}])
def test_wheels_of_another_place_are_refused(place):
    model, wheels = laid(Flexible, "cable", **place)
    with pytest.raises(StepFailed, match="from where the track was laid"):
        model.step(0.0, 1e-3, wheels)


@pytest.mark.parametrize(("kind", "element"), KINDS)
def test_wheels_in_their_place_are_not(kind, element):
    """Wheels in their place are accepted, also those of a master that begins a step later (5 cm ahead)."""
    model, wheels = laid(kind, element)
    wheels[::13] += 0.05
    before = model.state.copy()
    model.step(0.0, 1e-6, wheels)
    assert np.isfinite(model.state).all()
    assert not np.array_equal(model.state, before)
