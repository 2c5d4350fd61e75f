"""Figures 10 to 21 of the paper, all models in one axis; figure 21 has a pane for each.

Conventions of what the paper leaves open: the first joint is the one between links 1 and 2, pin 2 here, because the cut
of an open chain is pin 1; its force is that on the link that begins there, along the chassis (ahead) and normal to it
(up). The end point of link 31 is pin 32. Axial stress is tension over section. Links are numbered backwards over the
ground: from the sprocket in front down to the ground, to the idler, and ahead along the upper run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.reader import Log
from orchestrator.log.time_series import Floats
from orchestrator.results import picture
from orchestrator.results.analyses import circuit, deformation, hull
from orchestrator.results.run_data import Links, RunData, Window
from orchestrator.studies.paper.models import REFERENCE, Model
from orchestrator.studies.paper.whole_runs import INSTANT, NODE, SIDE

TRACK = f"{SIDE}_track"
FIRST = 2  # the first joint
LINK = 1  # of figures 18 and 19
Drawn = Callable[[Any, RunData, Model], None]  # adds a model to an axis


class Figure(NamedTuple):
    """One of the paper."""

    number: int
    title: str
    across: str
    up: str
    add: Drawn


def curve(pane: Any, model: Model, x: Floats, y: Floats, **more: Any) -> None:
    """A model's curve in its own style."""
    over = {"-": 2.0, "--": 2.1, "-.": 2.2, ":": 2.3}[model.line]  # dots last: curves lie on one another
    pane.plot(x, y, model.line, color=model.colour, linewidth=over - 0.8, zorder=over, label=model.label, **more)


def signal(name: str, from_start: bool = False) -> Drawn:
    """A signal over time."""

    def add(pane: Any, run: RunData, model: Model) -> None:
        t, values = run.signal(name)
        curve(pane, model, t, values - values[0] if from_start else values)

    return add


def node_forward(pane: Any, run: RunData, model: Model) -> None:
    """Figure 14."""
    t, place = run.vectors(TRACK, "links", f"joint[{NODE}].position")
    curve(pane, model, t, place[:, 0])


def node_path(pane: Any, run: RunData, model: Model) -> None:
    """Figure 15."""
    t, place = run.vectors(TRACK, "links", f"joint[{NODE}].position")
    own = in_chassis(run, t, place, True)
    curve(pane, model, own[:, 0], own[:, 2])
    pane.set_aspect("equal")


def joint_force(axis: int) -> Drawn:
    """Figures 16 and 17."""

    def add(pane: Any, run: RunData, model: Model) -> None:
        t, force = run.vectors(TRACK, "links", f"joint[{FIRST}].force")
        curve(pane, model, t, in_chassis(run, t, force, False)[:, axis] / 1e3, alpha=0.8)

    return add


def axial_stress(pane: Any, run: RunData, model: Model) -> None:
    """Figure 20: from the middle of the wrap of the sprocket, down to the ground and round."""
    area = hull.number(run, "section", "area")
    placed = next(circuit.records(run, TRACK, Window(INSTANT, INSTANT), "link[*].tension"))
    order = placed.links[0].argsort()
    curve(pane, model, placed.links[0, order], placed.values[0][0, order] / area / 1e6, drawstyle="steps-mid")
    if model is REFERENCE:
        sections(pane, run, placed)


def sections(pane: Any, run: RunData, placed: circuit.Placed) -> None:
    """Shade the slack, the transition and the tight section by where links are: round the wheels of the table."""
    vehicle = run.scene["vehicle"]
    first, last = vehicle["road_wheel"]["x"][0], vehicle["road_wheel"]["x"][-1]
    place, (ahead, up) = placed.links[0], placed.centres[0].T
    low = up < vehicle["road_wheel"]["z"]
    ground = place[low & (ahead < first) & (ahead > last)]
    edges = 0.0, float(ground.min()), float(ground.max()), float(placed.length[0])
    words = "slack", "transition", "tight"
    for low_edge, high_edge, text, shade in zip(edges, edges[1:], words, ("0.93", "0.97", "0.9"), strict=False):
        pane.axvspan(low_edge, high_edge, color=shade, zorder=0)
        pane.text(
            0.5 * (low_edge + high_edge), 0.02, text, ha="center", fontsize=8, transform=pane.get_xaxis_transform()
        )


def in_chassis(run: RunData, t: Floats, vectors: Floats, placed: bool) -> Floats:
    """Vectors (m, 3) along the axes of the chassis; places also from its centre of mass."""
    times, centre = run.vectors("chassis", "out", "chassis.position")
    _, q = run.vectors("chassis", "out", "chassis.orientation", "wxyz")
    at = np.clip(np.searchsorted(times, t - 1e-9), 0, len(times) - 1)
    return np.asarray(np.einsum("mi,mij->mj", vectors - (centre[at] if placed else 0.0), hull.matrices(q[at])))


FIGURES = (
    Figure(10, "Sprocket rotational velocity", "time, s", "angular velocity, rad/s", signal(f"{SIDE}_drive.speed")),
    Figure(11, "Chassis forward velocity", "time, s", "velocity, m/s", signal("chassis.chassis.velocity.x")),
    Figure(12, "Forward displacement of the chassis", "time, s", "displacement, m",
           signal("chassis.chassis.position.x", True)),
    Figure(13, "Vertical displacement of the chassis", "time, s", "displacement, m",
           signal("chassis.chassis.position.z", True)),
    Figure(14, f"Node {NODE} (end of link {NODE - 1}): forward position", "time, s", "forward position, m",
           node_forward),
    Figure(15, f"Node {NODE}: path in the chassis frame", "ahead of the centre of mass, m", "above it, m", node_path),
    Figure(16, "First joint (links 1 and 2): longitudinal force", "time, s", "force along the chassis, kN",
           joint_force(0)),
    Figure(17, "First joint (links 1 and 2): vertical force", "time, s", "force up the chassis, kN", joint_force(2)),
    Figure(20, f"Right chain: axial stress at t = {INSTANT:g} s",
           "along the circuit from the sprocket to ground, idler and upper run, m", "axial stress, MPa", axial_stress),
)  # fmt: skip


def draw(logs: dict[Model, Path], folder: Path) -> list[Path]:
    """All figures as PNG and SVG; the files."""
    from matplotlib.figure import Figure as Page

    made = []
    for figure in FIGURES:
        page = Page(figsize=(9.0, 4.8), layout="constrained")
        pane = page.subplots()
        for model, run in _opened(logs):
            figure.add(pane, run, model)
        pane.set_xlabel(figure.across)
        pane.set_ylabel(figure.up)
        pane.set_title(f"Figure {figure.number}. {figure.title}", fontsize=10, loc="left")
        pane.grid(True, color="0.9")
        page.legend(*pane.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8)
        made += _saved(page, folder, str(figure.number))
    page = Page(figsize=(10.0, 4.2), layout="constrained")
    panes = page.subplots(1, 2)
    length = 0.0
    for model, run in _opened(logs):
        found = deformation.of(run, TRACK, at=[INSTANT])
        found.draw(panes, LINK, model.label, linestyle=model.line, color=model.colour)
        length = float(found.x[-1])
    deformation.framed(panes, length)
    for number, pane, what in ((18, panes[0], "Axial"), (19, panes[1], "Transverse")):
        pane.set_title(f"Figure {number}. {what} deformation of link {LINK} of the right chain", fontsize=9, loc="left")
    made += _saved(page, folder, "18-19")
    return [*made, *_saved(_configuration(logs), folder, "21")]


def _configuration(logs: dict[Model, Path]) -> Any:
    """Figure 21: all models at the instant, one below the other, one scale of tension; the first joint is marked."""
    with ExitStack() as stack:
        runs = {model: RunData(stack.enter_context(Log(path))) for model, path in logs.items()}
        return _panes({model: (run, run.links(TRACK, Window(INSTANT, INSTANT))) for model, run in runs.items()})


def _panes(found: dict[Model, tuple[RunData, Links]]) -> Any:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure as Page

    tension = np.concatenate([links.tension[0] for _, links in found.values()]) / 1e3
    scale = ScalarMappable(Normalize(float(tension.min()), float(tension.max())), "viridis")
    page = Page(figsize=(9.0, 2.3 * len(found) + 0.5), layout="constrained")
    panes: Any = page.subplots(len(found), 1, sharex=True, squeeze=False)[:, 0]
    for pane, (model, (run, links)) in zip(panes, found.items(), strict=True):
        reach = tuple((float(part.min()) - 0.25, float(part.max()) + 0.25) for part in (links.forward, links.up))
        picture.add(pane, run, TRACK, links, scale, reach)
        place = links.forward[0, FIRST - 1], links.up[0, FIRST - 1]
        pane.plot(*place, "o", color="C3", markersize=5, fillstyle="none")
        pane.annotate("first joint", place, (6, 6), textcoords="offset points", color="C3", fontsize=8)
        pane.set_title(f"{model.label}, t = {INSTANT:g} s", fontsize=9, loc="left")
    panes[-1].set_xlabel("ahead of the sprocket axle, m")
    page.colorbar(scale, ax=list(panes), label="link tension, kN", shrink=0.8)
    page.suptitle("Figure 21. Right chain, coloured by tension", fontsize=10)
    return page


def _opened(logs: dict[Model, Path]) -> Iterable[tuple[Model, RunData]]:
    """Models with their logs, one after the other."""
    for model, path in logs.items():
        with Log(path) as log:
            yield model, RunData(log)


def _saved(page: Any, folder: Path, number: str) -> list[Path]:
    paths = [folder / f"figure-{number}.{suffix}" for suffix in ("png", "svg")]
    for path in paths:
        page.savefig(path, dpi=120)
    return paths
