"""Pictures in a plane: cameras, panes, instants."""

from itertools import combinations, pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.execution.simulate import simulate
from orchestrator.results.output_files import new_figure
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


def seen_from_above(*motions):
    """Views of a track of 4 m at (x, heading) every second, and the boxes of their labels."""
    views = []
    for t, (x, heading) in enumerate(motions):
        ahead, hull = np.array([np.cos(heading), np.sin(heading)]), np.array([x, 0.0])
        corners = hull + 2.0 * np.stack([ahead, -ahead, 0.1 * ahead[::-1]])
        views.append(flat_views.TopView(float(t), hull, ahead, [corners], hull[None], np.ones((1, 2)), False))
    figure = new_figure(8.0, 8.0)
    pane = figure.subplots()
    flat_views._draw_views(pane, views, max(abs(x) for x, _ in motions) + flat_views.ROOM)
    pane.set_aspect("equal", adjustable="datalim")
    figure.canvas.draw()
    return {text.get_text(): text.get_window_extent() for text in pane.texts}


@pytest.mark.parametrize(("motions", "texts"), [
    ([(0.0, 0.7 * k) for k in range(5)], ["0 s", "1 s", "2 s", "3 s", "4 s"]),  # on the spot
    ([(0.0, 0.0)] * 4, ["0 s", "1, 2, 3 s"]),  # at rest
    ([(5.0 * k, 0.0) for k in range(4)], ["0 s", "1 s", "2 s", "3 s"]),
])  # fmt: skip
def test_times_of_a_vehicle_from_above_do_not_overlap(motions, texts):
    boxes = seen_from_above(*motions)
    assert [*boxes] == texts
    assert not any(one.overlaps(other) for one, other in combinations(boxes.values(), 2))


@pytest.mark.parametrize(("high", "count"), [(1.25, 3), (2.15, 1), (2.15, 4), (2.8, 2)])
def test_a_side_view_has_no_blank_half(monkeypatch, high, count):
    """Of a track of 4.1 m or, for the first, of 5 m; less than a fifth is blank on either side of panes and scale."""
    wide = 5.04 if high < 2.0 else 4.13
    pins = np.array([[0.0, 0.0], [wide - 0.5, high - 0.5]])
    camera = projected.make_camera("right", 0.0, np.zeros(3))
    view = flat_views.SideView(0.0, camera, pins, {"body": np.zeros((0, 4, 2))}, None, [], 0.0)
    monkeypatch.setattr(flat_views, "side_view", lambda bodies, poses: view)
    for name in ("ground_at", "untouched"):
        monkeypatch.setattr(flat_views, name, lambda *of: None)
    track = SimpleNamespace(name="left_track")
    bodies = SimpleNamespace(
        blocks=lambda n: [0] * count, colour_range=lambda: (0.0, 1.0), speeds=lambda: None, wheels=[], colour="x",
        label="x", title="a vehicle", tracks=[track], t=np.zeros(1),
    )  # fmt: skip
    figure = flat_views._figure(bodies)
    figure.canvas.draw()
    width = figure.bbox.width
    left, right = figure.axes[0].get_tightbbox().x0, figure.axes[-1].get_tightbbox().x1
    assert left < 0.2 * width
    assert right > 0.8 * width
    pane = figure.axes[0].get_window_extent()
    assert pane.width > 0.5 * width
    assert pane.height / pane.width == pytest.approx(high / wide, rel=1e-3)


def test_pictures_are_of_instants_in_which_something_moves():
    recorded = np.arange(0, 10.01, 0.1)
    assert flat_views._moving_instants(recorded, 10.0, None, Window(1.0, 4.0)) == pytest.approx([0.0, 2.0, 3.0, 4.0])
    assert flat_views._moving_instants(recorded, 10.0, None) == pytest.approx([3.3, 6.7, 10.0])
    assert flat_views._moving_instants(np.zeros(1), 0.0, None) == [0.0]
