"""Force of the first joint and its spectrum in explicit steps that resolve the links' modes.

Implicit steps of 0.625 ms damp faster motion, and records every 5 ms show nothing above 100 Hz, so figures 16, 17 and
20 cannot contain the high frequencies that section 8.3 mentions. Here the vehicle starts from the co-simulation's state
at t = 4 s and continues by Runge-Kutta within its stable step. The force is recorded at ``RATE``, more than twice the
highest frequency of a link; each value is the mean since the last one, as in logs. Spectra leave out the first
``SETTLING``, in which the fast motion that the implicit state lacks dies out. The left chain is computed; the right one
is its mirror image, with the same forces along and up the chassis.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from fmus.physics.ancf.element import highest_frequency
from fmus.physics.chain import link_columns as column
from fmus.physics.chain import on_links
from fmus.physics.chain.interface import observe_links
from fmus.vehicles.tables import BadInput
from fmus.vehicles.vehicle import VehicleTable
from orchestrator.execution.monolithic import states_at
from orchestrator.log.reader import Log
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses.spectrum import amplitudes
from orchestrator.results.rotation import matrices
from orchestrator.results.run_data import RunData, Window
from orchestrator.studies import Row
from tests.validation.paper.conditions import saved
from tests.validation.paper.conventions import FIRST, in_chassis
from tests.validation.paper.models import CLOSED, REFERENCE, RIGID, Model, named, scene
from tests.validation.paper.pieces import BEGIN, OUTPUT, TRACK
from tests.validation.paper.states import whole

MODELS = (RIGID, CLOSED)
LONG, QUICK = 0.4, 0.1  # s, of a piece
RATE = 160.0 / OUTPUT  # 1/s: 128 kHz
SETTLING = 0.02  # s
RECORDED = 100.0  # Hz: limit of records every 5 ms
ABOVE = (RECORDED, 1e3, 1e4)  # Hz, of the RMS in the table
WAVES = 500.0  # Hz: waves along the chain are above
ZOOM = 0.01  # s, of the pane of single waves
BROADENED = 1.5  # noise bandwidth of a Hann window, bins
AXES = ("along", "up")


def rows(name: str, piece: float) -> list[Row]:
    """Row of a model: force, N, at ``RATE``, its RMS above each of ABOVE, and frequencies."""
    model = named(name)
    try:
        wanted = scene(model, 'track.link_outputs=["force"]', "run.links=1")  # means over each call
        begun = states_at(wanted, BEGIN)
        vehicle = whole(wanted)
        vehicle.begin_at(begun.time, begun.parts)
        force, tension = forces(vehicle, BEGIN, round(piece * RATE))
    except (BadInput, RuntimeError, ValueError) as failure:
        return [Row("spectrum", model.label, {"model": name}, note=f"not there: {failure}")]
    element = getattr(vehicle.models[TRACK].link, "element", None)
    settled = force[round(SETTLING * RATE) :]
    figures = {
        "model": name,
        "piece": piece,
        "step": vehicle.step,
        "contact": contact(wanted.vehicle),
        "wave": wave(wanted.vehicle),
        "fastest": highest_frequency(element) / (2.0 * np.pi) if element is not None else math.nan,
        "peak": peak(settled[:, 0], WAVES),
        **{f"{axis}_{low:g}": rms_above(settled[:, k], low) for k, axis in enumerate(AXES) for low in ABOVE},
        "force": np.round(force, 3).tolist(),
        "tension": np.round(tension, 3).tolist(),
    }
    return [Row("spectrum", model.label, figures, True)]


def forces(vehicle: Any, t: float, samples: int) -> tuple[Floats, Floats]:
    """First joint's force (samples, 2) along and up the chassis, N, means over 1 / RATE; last tensions, N."""
    chain, chassis = vehicle.models[TRACK], vehicle.models["chassis"]
    n, joint_force, force = chain.links_count, np.zeros((samples, 2)), slice(column.JOINT, column.JOINT + 3)
    for k in range(samples):
        vehicle.advance(t + k / RATE, 1.0 / RATE)
        mean = chain.s.on_links_sum[FIRST - 1, force] / chain.s.span[on_links.SPAN]
        joint_force[k] = (mean @ matrices(chassis.state[3:7]))[[0, 2]]
    tension, stress, place = np.zeros(n), np.zeros(n), np.zeros((chain.nodes, 3))
    observe_links(chain.link, chain.environment, chain.s, chain.work, tension, stress, place)
    return joint_force, tension


def rms_above(values: Floats, low: float) -> float:
    """RMS of the content of samples at RATE above a frequency, Hz, with a Hann window."""
    frequency, amplitude = amplitudes(np.arange(len(values)) / RATE, values[:, None])
    inside = (frequency > low)[:, None] & (frequency > 0.0)[:, None]
    return float(np.sqrt(np.sum(amplitude[inside] ** 2) / (2.0 * BROADENED)))


def peak(values: Floats, low: float) -> float:
    """Frequency of the largest amplitude of samples at RATE above ``low``, Hz."""
    frequency, amplitude = amplitudes(np.arange(len(values)) / RATE, values[:, None])
    return float(frequency[np.where(frequency > low, amplitude[:, 0], 0.0).argmax()])


def contact(vehicle: VehicleTable) -> float:
    """Frequency of a link between ground and wheel, Hz, by the stiffnesses of Table 2."""
    stiffness = vehicle.contact.ground.stiffness + vehicle.contact.wheel.stiffness
    return math.sqrt(stiffness / vehicle.track.mass) / (2.0 * math.pi)


def wave(vehicle: VehicleTable) -> float:
    """Frequency of the longitudinal wave once round the chain, Hz: sqrt(E A l / m) over its length."""
    track, stiffness = vehicle.track, vehicle.material.youngs_modulus * vehicle.section.area
    return math.sqrt(stiffness * track.pitch / track.mass) / (track.links * track.pitch)


def draw(rows: list[Row], logs: dict[Model, Path], folder: Path) -> list[Path]:
    """Draw force over time and frequency, along and up, and last tensions, as PNG and SVG."""
    from matplotlib.figure import Figure

    page = Figure(figsize=(11.0, 9.0), layout="constrained")
    panes: Any = page.subplots(3, 2)
    for row in rows:
        _add(panes, named(row.figures["model"]), row)
    end = BEGIN + rows[0]["piece"]
    if REFERENCE in logs:
        _add_recorded(panes, logs[REFERENCE], end)
    for k, axis in enumerate(AXES):
        panes[0, k].set_title(f"First joint's force {axis} the chassis", fontsize=9, loc="left")
        panes[0, k].set(xlabel="time, s", ylabel="force, kN")
        limit = panes[1, k].axvline(RECORDED, color="k", linewidth=0.8, label="records every 5 ms end here")
        panes[1, k].set(xlabel="frequency, Hz", ylabel="amplitude, N", xlim=(10.0, 0.5 * RATE))
        panes[1, k].legend(handles=[limit], fontsize=8, loc="lower left")
    panes[2, 0].set(xlabel="time, s", ylabel="force, kN", xlim=(end - ZOOM, end))
    panes[2, 0].set_title(f"First joint's force along the chassis, the last {1e3 * ZOOM:g} ms", fontsize=9, loc="left")
    panes[2, 1].set(xlabel="link", ylabel="tension, kN")
    panes[2, 1].set_title(f"Tension of the links at t = {end:g} s (figure 20)", fontsize=9, loc="left")
    for pane in panes.flat:
        pane.grid(True, color="0.9")
    page.suptitle("Figures 16, 17 and 20 in explicit steps", fontsize=10)
    page.legend(*panes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8)
    return saved(page, folder, "high-frequencies")


def _add(panes: Any, model: Model, row: Row) -> None:
    """Draw the curves of a model in all panes."""
    force = np.array(row["force"])
    t = BEGIN + np.arange(1, len(force) + 1) / RATE
    style = {"color": model.colour, "linewidth": 0.9, "label": f"{model.label}, explicit"}
    settled = t > BEGIN + SETTLING
    frequency, amplitude = amplitudes(t[settled], force[settled])
    for k in range(len(AXES)):
        panes[0, k].plot(t, force[:, k] / 1e3, **style)
        panes[1, k].loglog(frequency[1:], amplitude[1:, k], **style)
    late = t > t[-1] - ZOOM
    panes[2, 0].plot(t[late], force[late, 0] / 1e3, **style)
    panes[2, 1].step(np.arange(1, len(row["tension"]) + 1), np.array(row["tension"]) / 1e3, where="mid", **style)


def _add_recorded(panes: Any, file: Path, end: float) -> None:
    """Draw the force of the whole run in implicit steps: means over record intervals, at their middles."""
    track, window = "left_track", Window(BEGIN, end)
    with Log(file) as log:
        run = RunData(log)
        t, force = run.vectors(track, "links", f"joint[{FIRST}].force", window=window)
        seen = in_chassis(run, t, force, False)
        tension = run.links(track, Window(end, end)).tension
    interval = t[1] - t[0]
    t = t - 0.5 * interval
    label = f"{REFERENCE.label}, implicit, means over {1e3 * interval:.3g} ms"
    style = {"color": "k", "markersize": 3, "linestyle": "none", "label": label}
    for k, axis in enumerate((0, 2)):
        panes[0, k].plot(t, seen[:, axis] / 1e3, "o", **style)
    panes[2, 0].plot(t[t > end - ZOOM], seen[t > end - ZOOM, 0] / 1e3, "o", **style)
    for each in tension[:1]:
        panes[2, 1].plot(np.arange(1, len(each) + 1), each / 1e3, "o", **style)
