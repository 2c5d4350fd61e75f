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

KINDS = [
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


@pytest.mark.parametrize(("kind", "element"), KINDS)
def test_wheels_of_the_other_side_are_refused(kind, element):
    model, wheels = laid(kind, element, **{"start.lateral": -1.0795})
    before = model.state.copy()
    with pytest.raises(
        StepFailed, match=r"sprocket is 2.15 m too far from .* 2.16 m to the left, .* start.lateral and all other"
    ):
        model.step(0.0, 1e-3, wheels)
    np.testing.assert_array_equal(model.state, before)


@pytest.mark.parametrize("place", [{"start.heading": 0.1}, {"start.position.z": 0.2}])
def test_wheels_of_another_place_are_refused(place):
    model, wheels = laid(Flexible, "cable", **place)
    with pytest.raises(StepFailed, match="from where the track was laid"):
        model.step(0.0, 1e-3, wheels)


@pytest.mark.parametrize(("kind", "element"), KINDS)
def test_wheels_in_their_place_are_not(kind, element):
    model, wheels = laid(kind, element)
    wheels[::13] += 1e-5  # a motion between the start and the first exchange
    before = model.state.copy()
    model.step(0.0, 1e-3, wheels)
    assert np.isfinite(model.state).all()
    assert not np.array_equal(model.state, before)
    assert said(model) == []


def said(model):
    """Return the warnings of the last step."""
    return model.warnings()


@pytest.mark.parametrize("axis", range(3))
def test_a_wheel_off_its_place_is_warned_of_or_refused(axis):
    """0.1 % of the pitch, 0.152 mm, is noticed, 2 %, 3.05 mm, refused: the wheel, how far, and where; 1 cm is play."""
    pitch, wheel, play = 0.1524, 13 * 2, (0.0, 0.01, 0.0)[axis]
    for off, answer in ((0.0, ""), (0.97e-3, ""), (1.03e-3, "warned"), (0.0194, "warned"), (0.0206, "refused")):
        model, wheels = laid(Flexible, "cable")
        wheels[wheel + axis] -= off * pitch + play
        place = ["0 m", "0 m", "0 m"]
        place[axis] = f"-{off * pitch + play:.3g} m"
        names = [wheel["name"] for wheel in model.wheel_list]
        sentence = (
            f"the {names[2]} is {off * pitch:.3g} m too far from where the track was laid round it"
            f" ({place[0]} ahead, {place[1]} to the left, {place[2]} up): start.position.*, start.lateral and"
        )
        before = model.state.copy()
        if answer == "refused":
            with pytest.raises(StepFailed) as failure:
                model.step(0.0, 1e-6, wheels)
            assert readable(str(failure.value)).find(sentence) > 0
            np.testing.assert_array_equal(model.state, before)
        else:
            model.step(0.0, 1e-6, wheels)
            assert [sentence in readable(text) for text in said(model)] == [True] * (answer == "warned")
            model.step(1e-6, 1e-6, wheels)
            assert said(model) == []


def readable(sentence):
    """Return the sentence with numbers that are rounding as 0."""
    return re.sub(r"-?[\d.]+e-(1\d|[2-9]\d) m", "0 m", sentence).replace("-0 m", "0 m")
