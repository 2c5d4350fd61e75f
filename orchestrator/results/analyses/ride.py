"""Ride: vibration of seats, weighted as by ISO 2631-1, absorbed power and peaks after a low pass, in hull axes."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import vibration
from orchestrator.results.analyses.spectrum import FEWEST, resample_evenly
from orchestrator.results.analyses.vibration import HEALTH, WD, WK, TransferFunction
from orchestrator.results.rotation import matrices
from orchestrator.results.run_data import EVER, RunData, Window, within
from orchestrator.results.table import Table

G = 9.80665  # m/s2, standard gravity
LONGEST_STEP = 1.0 / 160.0  # s between records: the range of ISO 2631-1 ends at 80 Hz
SHOCK_CORNER, SHOCK_POLES = 30.0, 4  # Hz: low pass before the peak that mobility models limit to 2.5 g
STILL = 1e-9  # m/s2: less is rounding, without a crest factor
AXES = "ahead", "left", "up"
UP = 2
_SEAT = re.compile(r"seat\.(\w+)\.acceleration\.x")


class SeatRide(NamedTuple):
    """Vibration of a seat over a window, evenly sampled, in hull axes."""

    name: str
    t: Floats  # (m,) s
    acceleration: Floats  # (m, 3) m/s2
    weighted: Floats  # (m, 3) m/s2: Wd ahead and left, Wk up
    low_passed: Floats  # (m, 3) m/s2, for peaks
    absorbed: Floats  # (m,) W^0.5: its mean square is the absorbed power

    @property
    def step(self) -> float:
        """Time between samples, s."""
        return float(self.t[-1] - self.t[0]) / (len(self.t) - 1)

    @property
    def weighted_rms(self) -> Floats:
        """Weighted RMS acceleration (3,), m/s2."""
        return rms(self.weighted)

    @property
    def total(self) -> float:
        """Vibration total value with the axes' factors for health, m/s2."""
        return float(np.linalg.norm(np.multiply(HEALTH, self.weighted_rms)))

    @property
    def running_rms(self) -> Floats:
        """Running RMS of the weighted acceleration (m, 3), m/s2; NaN in the first second."""
        return np.stack([vibration.running_rms(column, self.step) for column in self.weighted.T], axis=1)

    @property
    def transient(self) -> Floats:
        """Maximum transient vibration value (3,), m/s2; NaN in a window of less than a second."""
        running = self.running_rms
        return running[-1] if np.isnan(running).all() else np.nanmax(running, axis=0)

    @property
    def dose(self) -> Floats:
        """Vibration dose value (3,), m/s^1.75."""
        return np.array([vibration.vibration_dose(column, self.step) for column in self.weighted.T])

    @property
    def absorbed_power(self) -> float:
        """Vertical absorbed power, W, by the rational filter (``vibration.py``)."""
        return float(np.mean(self.absorbed**2))

    def rows(self) -> Iterator[tuple[str | float, ...]]:
        """Row of each axis for ``Ride.table``."""
        plain, weighted, peaks = rms(self.acceleration), self.weighted_rms, np.abs(self.weighted).max(axis=0)
        crests = np.where(weighted > STILL, peaks / np.maximum(weighted, STILL), np.nan)
        columns = (
            plain, weighted, self.transient, self.dose, crests,
            self.low_passed.max(axis=0) / G, -self.low_passed.min(axis=0) / G,
        )  # fmt: skip
        for k, axis in enumerate(AXES):
            power = self.absorbed_power if k == UP else np.nan
            yield (self.name, axis, *(float(column[k]) for column in columns), power)


class Ride(NamedTuple):
    """Vibration of seats."""

    seats: tuple[SeatRide, ...]
    resampled: bool  # the records were not evenly spaced

    def table(self) -> Table:
        """Table with a row for each axis of each seat."""
        columns = (
            ("seat", ""), ("axis", ""), ("rms", "m/s2"), ("weighted rms", "m/s2"), ("MTVV", "m/s2"),
            ("VDV", "m/s^1.75"), ("crest factor", ""), ("peak", "g"), ("peak down", "g"), ("absorbed power", "W"),
        )  # fmt: skip
        notes = [f"{seat.name}: total value {seat.total:.4g} m/s2 with the factors for health" for seat in self.seats]
        notes += ["weighted by Wd ahead and left, by Wk up (ISO 2631-1)"]
        notes += [f"peaks after a low pass of {SHOCK_POLES} poles at {SHOCK_CORNER:g} Hz"]
        notes += ["steps vary: resampled evenly by straight lines"] * self.resampled
        t = self.seats[0].t
        title = f"Vibration of seats, {t[0]:.6g} to {t[-1]:.6g} s"
        return Table.of(title, columns, [row for seat in self.seats for row in seat.rows()], tuple(notes))

    def series(self) -> Table:
        """Table of weighted accelerations and of the running RMS upwards over time."""
        columns, values = [("t", "s")], [self.seats[0].t]
        for seat in self.seats:
            columns += [(f"{seat.name}, {axis}, weighted", "m/s2") for axis in AXES]
            columns += [(f"{seat.name}, up, running rms", "m/s2")]
            values += [*seat.weighted.T, seat.running_rms[:, UP]]
        return Table.of("Weighted accelerations of seats", columns, np.column_stack(values).tolist())


def rms(values: Floats) -> Floats:
    """Root of the mean square of the columns of evenly spaced samples (m, n)."""
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def of(run: RunData, seat: str = "", window: Window = EVER) -> Ride:
    """Vibration of all seats of a run, or of one, over a window of time; raises BadInput, Missing.

    The filters begin with the run, at rest.
    """
    places = _seats(run)
    if not places:
        raise Missing(
            f"{run.log.path} holds no motion of a seat: the scene's key seats = ['NAME'], or cotrack run --for ride,"
            " records it"
        )
    if seat and seat not in places:
        raise BadInput(f"seat = {seat}: there is {', '.join(places)}")
    rides, resampled = [], False
    for name in [seat] if seat else places:
        ride, interpolated = _ride(run, name, *places[name], window)
        rides.append(ride)
        resampled |= interpolated
    return Ride(tuple(rides), resampled)


def _seats(run: RunData) -> dict[str, tuple[str, str]]:
    """Component and variable of each seat, by its name, with that of the component where there are several."""
    found = [
        (name, seat[1])
        for name in run.instances
        if (topic := run.log.topics.get(f"/{name}/out"))
        for variable in topic.names
        if (seat := _SEAT.fullmatch(variable))
    ]
    several = len({name for name, _ in found}) > 1
    return {f"{name}.{seat}" if several else seat: (name, f"seat.{seat}") for name, seat in found}


def _ride(run: RunData, name: str, component: str, seat: str, window: Window) -> tuple[SeatRide, bool]:
    """Vibration of a seat, and whether its records were interpolated; raises Missing."""
    t, world = run.vectors(component, "out", f"{seat}.acceleration", window=EVER)
    _, q = run.vectors(component, "out", "chassis.orientation", "wxyz", EVER)
    if not (np.isfinite(t).all() and np.isfinite(world).all() and np.isfinite(q).all()):
        raise Missing(f"'{component}.{seat}.acceleration' is not finite: it has no weighted values")
    if np.count_nonzero(within(t, window)) < FEWEST:
        raise Missing(f"'{component}.{seat}' has fewer than {FEWEST} records in the window")
    if (step := float(np.diff(t).max())) > LONGEST_STEP * (1.0 + 1e-9):
        raise Missing(
            f"'{component}.{seat}' is recorded every {1e3 * step:.4g} ms: vibration up to 80 Hz needs"
            f" {1e3 * LONGEST_STEP:g} ms or less (run.step, run.outputs)"
        )
    t, own, resampled = resample_evenly(t, np.einsum("mki,mk->mi", matrices(q), world))
    step, inside = float(t[-1] - t[0]) / (len(t) - 1), within(t, window)

    def passed(gains: Sequence[TransferFunction]) -> Floats:
        return np.stack([vibration.filtered(a, step, h) for a, h in zip(own.T, gains, strict=True)], axis=1)[inside]

    low = vibration.butterworth(SHOCK_POLES, SHOCK_CORNER)
    return SeatRide(
        name, t[inside], own[inside], passed((WD.gains, WD.gains, WK.gains)), passed((low,) * 3),
        vibration.filtered(own[:, UP], step, vibration.absorption)[inside],
    ), resampled  # fmt: skip
