"""Deformation of links along their length in tangent frames (paper, figures 18, 19, section 8.3).

The frame of a link has its origin at the first pin and its longitudinal axis along the position gradient there; the
transverse axis points outwards, away from the wheels, the lateral one along the pin. An undeformed link is (x, 0, 0).
Between its pins the axis of an element is the cubic through positions and gradients. The gradients of rigid links are
unit vectors along them, so these show rounding only. In a loop closed by a spring the gap of the cut is added to the
last link.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, record_blocks
from orchestrator.results.rotation import link_axes
from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.results.table import Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS = 21  # along a link, including both pins
MAGNIFIED = 1e5  # in pictures, as in the paper's
AXES = ("axial", "transverse", "lateral")


class Deformation(NamedTuple):
    """Displacements of points of links from the undeformed position, in tangent frames."""

    track: str
    t: Floats  # (m,) s
    x: Floats  # (k,) m, along an undeformed link
    displacement: Floats  # (m, links, k, 3) m: axial, transverse (outwards), lateral (left)

    def table(self) -> Table:
        """Table with a row per instant and link: end displacement, largest transverse one and its place."""
        rows = []
        for t, links in zip(self.t, self.displacement, strict=True):
            at = np.abs(links[..., 1]).argmax(axis=1)
            for i, k in enumerate(at):
                axial, transverse, _ = links[i, -1] * 1e6
                most = links[i, k, 1] * 1e6
                rows.append((float(t), i + 1, float(axial), float(transverse), float(most), float(self.x[k])))
        columns = (
            ("at", "s"), ("link", ""), ("axial at its end", "um"), ("transverse at its end", "um"),
            ("largest transverse", "um"), ("there", "m"),
        )  # fmt: skip
        return Table.of(f"Deformation of the links of {self.track} in their tangent frames", columns, rows)

    def series(self) -> Table:
        """Table with a row per instant, link and point."""
        columns = (("at", "s"), ("link", ""), ("x", "m"), *((axis, "m") for axis in AXES))
        rows = [
            (float(t), i + 1, float(x), *(float(value) for value in point))
            for t, links in zip(self.t, self.displacement, strict=True)
            for i, along in enumerate(links)
            for x, point in zip(self.x, along, strict=True)
        ]
        return Table.of(f"Deformation along the links of {self.track}", columns, rows)

    def draw(self, panes: Sequence[Axes], link: int = 1, label: str = "", **style: object) -> None:
        """Draw link ``link`` (from 1) at each instant into two panes: axial and transverse, magnified."""
        for t, links in zip(self.t, self.displacement, strict=True):
            axial, transverse, _ = MAGNIFIED * links[link - 1].T
            curve_label = ", ".join(filter(None, [label, f"t = {t:g} s"]))
            panes[0].plot(self.x, self.x + axial, label=curve_label, **style)  # type: ignore[arg-type]
            panes[1].plot(self.x, transverse, label=curve_label, **style)  # type: ignore[arg-type]


def draw_frame(panes: Sequence[Axes], length: float) -> None:
    """Draw the undeformed link of ``length``, m, and the labels of two panes."""
    along = np.array([0.0, length])
    panes[0].plot(along, along, "k--", linewidth=1, label="undeformed")
    panes[1].plot(along, np.zeros(2), "k--", linewidth=1, label="undeformed")
    for pane, what in zip(panes, ("place along the tangent", "displacement outwards"), strict=True):
        pane.set_xlabel("along the undeformed link, m")
        pane.set_ylabel(f"{what}, m; deformation x {MAGNIFIED:g}")
        pane.grid(True, color="0.9")


def of(run: RunData, track: str = "", window: Window = EVER, at: Sequence[float] = ()) -> Deformation:
    """Deformation of a track, by default the first, at the records nearest to ``at``, s.

    The default of ``at`` is the last record of the window. Raises Missing without positions or gradients.
    """
    track = hull.tracks(run, track)[0]
    length = hull.vehicle_number(run, "track", "pitch")
    wanted = ["joint[*].position", "link[*].slope.first", "link[*].slope.last"]
    turning = record_blocks.has(run, track, "joint[*].axis")
    times, values = _nearest(run, track, window, at, [*wanted, *["joint[*].axis"] * turning])
    pins, first, last = values[:3]
    across = values[3] if turning else hull.poses(run, track, times).axes[:, None, :, 1]
    links = first.shape[1]
    axes = link_axes(pins, across, links)
    x = np.linspace(0.0, length, POINTS)
    far = np.roll(pins, -1, axis=1)[:, :links] - pins[:, :links]
    shape = _cubic(x, length)
    arm = np.einsum("k,mni->mnki", shape[2], far)
    arm += np.einsum("k,mni->mnki", shape[1], first) + np.einsum("k,mni->mnki", shape[3], last)
    tangent = first / np.linalg.norm(first, axis=2, keepdims=True)
    outwards = np.cross(tangent, axes[..., 1])
    outwards /= np.linalg.norm(outwards, axis=2, keepdims=True)
    frame = np.stack([tangent, outwards, np.cross(outwards, tangent)], axis=-1)
    displacement = np.einsum("mnki,mnij->mnkj", arm, frame)
    displacement[..., 0] -= x
    return Deformation(track, times, x, displacement)


def picture(deformation: Deformation, output: Path, link: int) -> None:
    """Draw figures 18 and 19 for one link at each instant; raises BadInput."""
    from orchestrator.results.output_files import new_figure, save_figure

    if not 1 <= link <= deformation.displacement.shape[1]:
        raise BadInput(f"link = {link}: {deformation.track} has the links 1 to {deformation.displacement.shape[1]}")
    figure = new_figure(10.0, 4.2)
    panes = figure.subplots(1, 2)
    deformation.draw(panes, link)
    draw_frame(panes, float(deformation.x[-1]))
    for pane in panes:
        pane.legend(fontsize=8)
    figure.suptitle(f"{deformation.track}, link {link}", fontsize=10, parse_math=False)
    save_figure(figure, output)


def _cubic(x: Floats, length: float) -> Floats:
    """Cubic shape functions (4, k) of position and gradient at both ends, at ``x``, m. Paper 2."""
    s = x / length
    return np.stack(
        [1 - 3 * s**2 + 2 * s**3, length * (s - 2 * s**2 + s**3), 3 * s**2 - 2 * s**3, length * (s**3 - s**2)]
    )


def _nearest(
    run: RunData, track: str, window: Window, at: Sequence[float], signals: Sequence[str]
) -> tuple[Floats, list[Floats]]:
    """Times (m,) and signals of the records nearest to ``at``, or of the last one; raises Missing."""
    best: dict[float, tuple[float, tuple[Floats, ...]]] = {}
    last = -np.inf
    for block in record_blocks.records(run, track, window, *signals):
        last = float(block.t[-1])
        for t in at or (np.inf,):
            near = int(np.abs(block.t - min(t, last)).argmin())
            if t not in best or not at or abs(block.t[near] - t) < abs(best[t][0] - t):
                best[t] = (float(block.t[near]), tuple(values[near] for values in block.values))
    late = [t for t in at if t > last + 1e-9]
    if late:
        raise Missing(
            f"{run.log.path}: the last record of links in the window is at {last:.9g} s, before {late[0]:g} s"
        )
    times, values = zip(*best.values(), strict=True)
    return np.array(times), [np.stack(each) for each in zip(*values, strict=True)]
