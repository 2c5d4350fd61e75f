"""Figures 10 to 21 of the paper, all models in one axis; figure 21 has a pane for each.

Below figures 10 to 17 are the differences from the closed mesh at the same instants; for the path of figure 15, the
distance of the points. One pane has the models whose links have the same inertia, the other those with a rod's inertia,
which differ so much more that they would hide the others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.reader import Log
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import circuit, deformation, hull
from orchestrator.results.ground_surface import GroundSurface
from orchestrator.results.run_data import RunData, Window
from orchestrator.results.views import flat_views
from orchestrator.results.views.bodies import EVERY, Bodies
from orchestrator.results.views.colours import MAP
from orchestrator.results.views.flat_views import SideView
from tests.validation.paper.conditions import saved
from tests.validation.paper.conventions import FIRST, INSTANT, LINK, NODE, SECTIONS, SIDE, TRACK, edges, in_chassis
from tests.validation.paper.models import REFERENCE, RODS, Model

SHADES = ("0.93", "0.97", "0.9")  # of the sections of figure 20


class Curve(NamedTuple):
    """Curve of one run in a figure."""

    t: Floats  # (m,) s
    values: Floats  # (m, 1) over time, or (m, 2) across and up of a path


class Figure(NamedTuple):
    """Figure of the paper, over time or of a path."""

    number: int
    title: str
    up: str
    difference_label: str  # label of the differences
    read: Callable[[RunData], Curve]
    across: str = "time, s"


def signal(name: str, from_start: bool = False) -> Callable[[RunData], Curve]:
    """Return the reader of a signal over time."""

    def read(run: RunData) -> Curve:
        t, values = run.signal(name)
        return Curve(t, (values - values[0] if from_start else values)[:, None])

    return read


def node_forward(run: RunData) -> Curve:
    """Forward position of the node over time (figure 14)."""
    t, place = run.vectors(TRACK, "links", f"joint[{NODE}].position")
    return Curve(t, place[:, :1])


def node_path(run: RunData) -> Curve:
    """Path of the node in the chassis frame (figure 15)."""
    t, place = run.vectors(TRACK, "links", f"joint[{NODE}].position")
    return Curve(t, in_chassis(run, t, place, True)[:, [0, 2]])


def joint_force(axis: int) -> Callable[[RunData], Curve]:
    """Return the reader of a component of the first joint's force, kN (figures 16 and 17)."""

    def read(run: RunData) -> Curve:
        t, force = run.vectors(TRACK, "links", f"joint[{FIRST}].force")
        return Curve(t, in_chassis(run, t, force, False)[:, [axis]] / 1e3)

    return read


FIGURES = (
    Figure(10, "Sprocket rotational velocity", "angular velocity, rad/s", "difference, rad/s",
           signal(f"{SIDE}_drive.speed")),
    Figure(11, "Chassis forward velocity", "velocity, m/s", "difference, m/s", signal("chassis.chassis.velocity.x")),
    Figure(12, "Forward displacement of the chassis", "displacement, m", "difference, m",
           signal("chassis.chassis.position.x", True)),
    Figure(13, "Vertical displacement of the chassis", "displacement, m", "difference, m",
           signal("chassis.chassis.position.z", True)),
    Figure(14, f"Node {NODE} (end of link {NODE - 1}): forward position", "forward position, m", "difference, m",
           node_forward),
    Figure(15, f"Node {NODE}: path in the chassis frame", "above it, m", "distance, m", node_path,
           "ahead of the centre of mass, m"),
    Figure(16, "First joint (links 1 and 2): longitudinal force", "force along the chassis, kN", "difference, kN",
           joint_force(0)),
    Figure(17, "First joint (links 1 and 2): vertical force", "force up the chassis, kN", "difference, kN",
           joint_force(2)),
)  # fmt: skip


def differences(curve: Curve, reference: Curve) -> Curve:
    """Difference from the reference at the curve's instants: signed for one value, distance for a path."""
    other = np.stack([np.interp(curve.t, reference.t, column) for column in reference.values.T], axis=1)
    offsets = curve.values - other
    return Curve(curve.t, offsets if offsets.shape[1] == 1 else np.linalg.norm(offsets, axis=1, keepdims=True))


def add(pane: Any, model: Model, x: Floats, y: Floats, **more: Any) -> None:
    """Draw a model's curve in its own style."""
    over = {"-": 2.0, "--": 2.1, "-.": 2.2, ":": 2.3}[model.line]  # dotted lines on top, because curves coincide
    pane.plot(x, y, model.line, color=model.colour, linewidth=over - 0.8, zorder=over, label=model.label, **more)


def draw(logs: dict[Model, Path], folder: Path) -> list[Path]:
    """Draw all figures as PNG and SVG; return the files."""
    curves: dict[int, dict[Model, Curve]] = {figure.number: {} for figure in FIGURES}
    deformations = {}
    for model, run in _opened(logs):
        for figure in FIGURES:
            curves[figure.number][model] = figure.read(run)
        deformations[model] = deformation.of(run, TRACK, at=[INSTANT])
    files = []
    for figure in FIGURES:
        files += saved(_over_differences(figure, curves[figure.number]), folder, f"figure-{figure.number}")
    files += saved(_deformations(deformations), folder, "figure-18-19")
    files += saved(_stresses(logs), folder, "figure-20")
    return [*files, *saved(_configuration(logs), folder, "figure-21")]


def _over_differences(figure: Figure, curves: dict[Model, Curve]) -> Any:
    """Draw a figure with panes of differences from the reference: equal inertia, and inertia of a rod."""
    from matplotlib.figure import Figure as Page

    path = next(iter(curves.values())).values.shape[1] > 1
    page = Page(figsize=(9.0, 7.2 if path else 8.4), layout="constrained")
    pane, alike, rods = page.subplots(3, 1, sharex=not path, height_ratios=(1.0, 0.9, 0.9) if path else (1.6, 1.0, 1.0))
    for model, curve in curves.items():
        add(pane, model, *(curve.values.T if path else (curve.t, curve.values[:, 0])), alpha=0.8)
        if model is not REFERENCE and REFERENCE in curves:
            apart = differences(curve, curves[REFERENCE])
            add(rods if model in RODS else alike, model, apart.t, apart.values[:, 0], alpha=0.8)
    pane.set_title(f"Figure {figure.number}. {figure.title}", fontsize=10, loc="left")
    for below, inertia in ((alike, "links of equal inertia"), (rods, "links with the inertia of a rod")):
        what = f"{'distance from' if path else 'less'} that of the {REFERENCE.label}: {inertia}"
        below.set_title(what, fontsize=9, loc="left")
        below.set_ylabel(figure.difference_label)
    if path:
        pane.set_aspect("equal")
        pane.set_xlabel(figure.across)
    rods.set_xlabel("time, s")
    pane.set_ylabel(figure.up)
    for each in (pane, alike, rods):
        each.grid(True, color="0.9")
    page.legend(*pane.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8)
    return page


def _deformations(deformations: dict[Model, deformation.Deformation]) -> Any:
    """Draw figures 18 and 19."""
    from matplotlib.figure import Figure as Page

    page = Page(figsize=(10.0, 5.0), layout="constrained")
    panes = page.subplots(1, 2)
    for model, each in deformations.items():
        each.draw(panes, LINK, model.label, linestyle=model.line, color=model.colour)
    deformation.draw_frame(panes, float(next(iter(deformations.values())).x[-1]))
    for number, pane, what in ((18, panes[0], "Axial"), (19, panes[1], "Transverse")):
        pane.set_title(f"Figure {number}. {what} deformation of link {LINK} of the right chain", fontsize=9, loc="left")
    page.legend(*panes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8)
    return page


def _stresses(logs: dict[Model, Path]) -> Any:
    """Draw figure 20, from the middle of the sprocket's wrap over the ground and round; sections shaded."""
    from matplotlib.figure import Figure as Page

    page = Page(figsize=(9.0, 4.8), layout="constrained")
    pane = page.subplots()
    for model, run in _opened(logs):
        area = hull.vehicle_number(run, "section", "area")
        placed = next(circuit.records(run, TRACK, Window(INSTANT, INSTANT), "link[*].tension"))
        order = placed.links[0].argsort()
        add(pane, model, placed.links[0, order], placed.values[0][0, order] / area / 1e6, drawstyle="steps-mid")
        if model is REFERENCE:
            _shade(pane, edges(run.scene["vehicle"], placed))
    pane.set_xlabel("along the circuit from the sprocket to ground, idler and upper run, m")
    pane.set_ylabel("axial stress, MPa")
    pane.set_ylim(bottom=min(0.0, pane.get_ylim()[0]))  # room for names of sections below the curves
    pane.set_title(f"Figure 20. Right chain: axial stress at t = {INSTANT:g} s", fontsize=10, loc="left")
    pane.grid(True, color="0.9")
    page.legend(*pane.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8)
    return page


def _shade(pane: Any, limits: tuple[float, ...]) -> None:
    for low, high, text, shade in zip(limits, limits[1:], SECTIONS, SHADES, strict=False):
        pane.axvspan(low, high, color=shade, zorder=0)
        pane.text(0.5 * (low + high), 0.02, text, ha="center", fontsize=8, transform=pane.get_xaxis_transform())


def _configuration(logs: dict[Model, Path]) -> Any:
    """Draw figure 21: all models at the instant with one tension scale; the first joint is marked."""
    views = {}
    for model, run in _opened(logs):
        bodies = Bodies(run, EVERY, "tension", track=TRACK)
        bodies.select_instants([INSTANT])
        views[model] = flat_views.side_view(bodies, next(bodies.blocks(1))), bodies.ground
    return _panes(views)


def _panes(views: dict[Model, tuple[SideView, GroundSurface | None]]) -> Any:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure as Page

    tension = np.concatenate([view.colour for view, _ in views.values() if view.colour is not None])
    scale = float(tension.min()), float(tension.max())
    page = Page(figsize=(9.0, 2.3 * len(views) + 0.5), layout="constrained")
    panes: Any = page.subplots(len(views), 1, sharex=True, squeeze=False)[:, 0]
    for pane, (model, (view, ground)) in zip(panes, views.items(), strict=True):
        flat_views.draw_view(pane, view, ground, scale, flat_views.extent([view]))
        place = view.pins[FIRST - 1]
        pane.plot(*place, "o", color="C3", markersize=5, fillstyle="none")
        pane.annotate("first joint", place, (6, 6), textcoords="offset points", color="C3", fontsize=8)
        pane.set_title(f"{model.label}, t = {INSTANT:g} s", fontsize=9, loc="left")
    panes[-1].set_xlabel("ahead of the sprocket axle, m")
    page.colorbar(ScalarMappable(Normalize(*scale), MAP), ax=list(panes), label="link tension, kN", shrink=0.8)
    page.suptitle("Figure 21. Right chain, coloured by tension", fontsize=10)
    return page


def _opened(logs: dict[Model, Path]) -> Iterable[tuple[Model, RunData]]:
    """Yield the models with their open logs, one after the other."""
    for model, path in logs.items():
        with Log(path) as log:
            yield model, RunData(log)
