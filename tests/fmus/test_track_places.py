"""A track refuses its first step if its wheels are not where it was laid out, for all kinds of links."""

import re

import named_ports
import numpy as np
import pytest

from fmus.interface.model import StepFailed
from fmus.track_flexible.model import Model as Flexible
from fmus.track_rigid.model import Model as Rigid
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load

PITCH = 0.1524
WHEEL_PLACES = [
    (Flexible, "cable"),
    pytest.param(Rigid, None, marks=pytest.mark.long),
    *(pytest.param(Flexible, element, marks=pytest.mark.long) for element in ("planar", "beam")),
]


def laid(kind, element, **parameters):
    """Return an unsettled left track of the standard vehicle, and the inputs of its wheels as drawn."""
    scene = load("straight", "rigid" if kind is Rigid else "flexible")
    model = kind(next(part.config for part in assemble(scene).parts if part.name == "left_track"))
    given = named_ports.parameters(model)
    given |= {"start": "polygon", **({} if element is None else {"element": element})}
    model.initialise({**given, **parameters})
    return model, np.array([port.start for port in model.ports if port.causality == "input"])


@pytest.mark.parametrize(("kind", "element"), WHEEL_PLACES)
def test_wheels_of_the_other_side_are_refused_and_those_in_their_place_are_not(kind, element):
    model, wheels = laid(kind, element, **{"start.lateral": -1.0795})
    before = model.state.copy()
    with pytest.raises(StepFailed):
        model.step(0.0, 1e-3, wheels)
    np.testing.assert_array_equal(model.state, before)
    model, wheels = laid(kind, element)
    wheels[::13] += 1e-5  # a motion between the start and the first exchange
    model.step(0.0, 1e-3, wheels)
    assert np.isfinite(model.state).all()
    assert not np.array_equal(model.state, before)
    assert model.warnings() == []


@pytest.mark.parametrize("axis", range(3))
def test_a_wheel_off_its_place_is_warned_of_or_refused(axis):
    """0.1 % of the pitch, 0.152 mm, is noticed, 2 %, 3.05 mm, refused: the wheel, and how far; 1 cm is play."""
    play = (0.0, 0.01, 0.0)[axis]
    for off, refused, warned in ((0.0, 0, 0), (0.97e-3, 0, 0), (1.03e-3, 0, 1), (0.0194, 0, 1), (0.0206, 1, 0)):
        model, wheels = laid(Flexible, "cable")
        wheels[13 * 2 + axis] -= off * PITCH + play
        said = (
            f"the {model.wheel_list[2]['name']} is {off * PITCH:.3g} m too far from where the track was laid round it ("
        )
        before = model.state.copy()
        if refused:
            with pytest.raises(StepFailed, match=re.escape(said)):
                model.step(0.0, 1e-6, wheels)
            np.testing.assert_array_equal(model.state, before)
        else:
            model.step(0.0, 1e-6, wheels)
            assert [said in text for text in model.warnings()] == [True] * warned
            model.step(1e-6, 1e-6, wheels)
            assert model.warnings() == []
