"""Pictures in a plane: cameras, panes, instants."""

from itertools import pairwise

import numpy as np
import pytest

from orchestrator.execution.simulate import simulate
from orchestrator.results.run_data import Window
from orchestrator.results.views import flat_views, projected
from orchestrator.scene.scene import load


@pytest.mark.parametrize("eye", projected.VIEWPOINTS)
def test_cameras_keep_lengths_and_show_ahead_to_the_right(eye):
    seen = projected.make_camera(eye, 0.4, np.array([1.0, 2.0, 3.0]))
    frame = np.stack([seen.right, seen.up, seen.toward])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(frame) == pytest.approx(1.0)
    ahead = np.array([np.cos(0.4), np.sin(0.4), 0.0])
    assert seen.project(seen.centre + ahead)[0] > 0.5
    if eye == "right":
        np.testing.assert_allclose(seen.project(seen.centre + 2 * ahead + [0, 0, 3]), [2, 3], atol=1e-15)


@pytest.mark.long
def test_numbers_under_narrow_panes_do_not_overlap(tmp_path, monkeypatch):
    path, drawn = tmp_path / "folded.mcap", []
    simulate(load("folded_chain", "flexible", ("run.stop=0.01", "chain.links=65", "expect={}")), path)
    monkeypatch.setattr(flat_views, "save_figure", lambda figure, output: drawn.append(figure))
    flat_views.draw_side(path, tmp_path / "x.png")
    (figure,) = drawn
    figure.canvas.draw()
    panes = figure.axes[:-1]  # the last one is the colour scale
    assert len({pane.get_position().y0 for pane in panes}) == 1, "panes are not side by side"
    for pane in panes:
        low, high = pane.get_xlim()
        labels = [each for each in pane.get_xticklabels() if low <= each.get_position()[0] <= high]
        boxes = sorted((each.get_window_extent().x0, each.get_window_extent().x1) for each in labels)
        assert len(boxes) >= 1
        assert all(end < begin for (_, end), (begin, _) in pairwise(boxes))


def test_pictures_are_of_instants_in_which_something_moves():
    recorded = np.arange(0, 10.01, 0.1)
    assert flat_views._moving_instants(recorded, 10.0, None, Window(1.0, 4.0)) == pytest.approx([0.0, 2.0, 3.0, 4.0])
    assert flat_views._moving_instants(recorded, 10.0, None) == pytest.approx([3.3, 6.7, 10.0])
    assert flat_views._moving_instants(np.zeros(1), 0.0, None) == [0.0]
