"""``cotrack warm``: scenes begun in processes of their own."""

import pytest

from fmus.vehicle import BadInput
from orchestrator.execution import warm


def test_the_gallery_s_vehicles_and_chains_with_both_tracks():
    found = warm.variants()
    assert {("straight", "flexible"), ("straight", "rigid"), ("hanging_chain", "rigid")} <= set(found)
    assert not [name for name, _ in found if name in ("elastica", "l_frame")]


def test_a_scene_without_a_track_is_refused():
    with pytest.raises(BadInput, match="no scene 'strait'"):
        warm.variants(["strait"])


def test_scenes_begin_and_say_how_long_it_took():
    ((name, message, seconds),) = warm.warm([("hanging_chain", "rigid")])
    assert (name, message) == ("hanging_chain, rigid", "")
    assert 0.0 < seconds < 120.0
