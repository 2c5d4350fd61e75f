"""Amplitude spectra of signals, in Hz or in tooth orders: multiples of the tooth passing frequency.

Windows are scaled so that a sine shows its own amplitude (not a density). A Hann window separates near frequencies
and reads the amplitude of a sine between two bins to 15 %, a flat-top window to 0.1 %.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.log.angles import Continuous
from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, record_blocks
from orchestrator.results.run_data import EVER, RunData, Window, mean
from orchestrator.results.table import Table

SHAPES = {  # sums of cosines; importing scipy.signal takes a second
    "hann": (0.5, 0.5),
    "flat-top": (0.21557895, 0.41663158, 0.277263158, 0.083578947, 0.006947368),
}
FEWEST = 16  # least number of samples
EVEN = 1e-6  # of a step: tolerance of even spacing
PEAKS = 8  # in the table
LOBE = 4  # bins on either side in which a sine shows


class Spectrum(NamedTuple):
    """Amplitude spectrum; at 0 Hz the magnitude of the mean."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    frequency: Floats  # (k,) Hz
    amplitude: Floats  # (k, signals) of a sine, in the unit of the signal
    teeth: float  # Hz: mean tooth passing frequency; NaN if not requested
    window: Window  # time span of the samples, s
    shape: str  # "hann" or "flat-top"
    resampled: bool  # the records were not evenly spaced

    @property
    def order(self) -> Floats:
        """Tooth orders (k,): frequency over tooth passing frequency."""
        return self.frequency / self.teeth

    def peak(self, above: float = 0.0, signal: int = 0) -> tuple[float, float]:
        """Frequency, Hz, and amplitude of the largest peak above a frequency; raises Missing."""
        inside = np.flatnonzero(self.frequency > above)
        if not len(inside):
            raise Missing(f"the spectrum ends at {self.frequency[-1]:g} Hz: it has nothing above {above:g} Hz")
        at = inside[self.amplitude[inside, signal].argmax()]
        return float(self.frequency[at]), float(self.amplitude[at, signal])

    def series(self) -> Table:
        """Table of all amplitudes."""
        orders = (("tooth order", ""),) if self.teeth == self.teeth else ()
        columns = (("frequency", "Hz"), *orders, *zip(self.names, self.units, strict=True))
        rows = np.column_stack([self.frequency, *([self.order] if orders else []), self.amplitude]).tolist()
        return Table.of("Amplitudes", columns, rows)

    def table(self) -> Table:
        """Table of the largest peaks of each signal."""
        rows = []
        for column, name in enumerate(self.names):
            a = self.amplitude[:, column]
            tops = [k for k in range(1, len(a)) if a[k] and a[k] == a[max(k - LOBE, 1) : k + LOBE + 1].max()]
            for k in sorted(tops, key=lambda k: -a[k])[:PEAKS]:
                f = float(self.frequency[k])
                rows.append((name, f, *([f / self.teeth] if self.teeth == self.teeth else []), float(a[k])))
        orders = (("tooth order", ""),) if self.teeth == self.teeth else ()
        columns = (("signal", ""), ("frequency", "Hz"), *orders, ("amplitude", " or ".join(dict.fromkeys(self.units))))
        notes = [f"bins are {self.frequency[1]:.4g} Hz wide, {self.shape} window"]
        notes += [f"teeth pass at {self.teeth:.5g} Hz"] * bool(orders)
        notes += ["steps vary: resampled evenly by straight lines"] * self.resampled
        title = f"Largest peaks, {self.window.start:.6g} to {self.window.end:.6g} s"
        return Table.of(title, columns, rows, tuple(notes))


def of(
    run: RunData, signals: Sequence[str] | str = (), window: Window = EVER, shape: str = "hann", orders: bool = False
) -> Spectrum:
    """Spectra of signals ("*" stands for anything) of one topic over a window of time.

    ``orders`` adds the tooth passing frequency of the sprocket that belongs to the signals, or of the log's first
    one. Raises BadInput, Missing.
    """
    if not signals:
        raise BadInput(
            "a spectrum needs a signal: Run.signals, or cotrack log info --signals LOG, says which there are"
        )
    if shape not in SHAPES:
        raise BadInput(f"shape = {shape}: must be {' or '.join(SHAPES)}")
    chosen = record_blocks.named_columns(run, [signals] if isinstance(signals, str) else signals)
    if len(chosen) != 1:
        raise Missing(f"the signals are on {len(chosen)} topics: a spectrum needs signals of one, with common times")
    ((topic, columns),) = chosen.items()
    series = run.log.select(chosen, window)[topic]
    names = tuple(run.log.name(topic, column) for column in columns)
    if len(series.t) < FEWEST:
        raise Missing(f"'{names[0]}' has {len(series.t)} records in the window: a spectrum needs {FEWEST}")
    if not np.isfinite(series.t).all():
        raise Missing(f"{run.log.path}: times of {topic} are no finite numbers: there is no spectrum")
    finite = np.isfinite(series.values).all(axis=0)
    if not finite.all():
        raise Missing(f"'{names[int(np.argmin(finite))]}' is not finite: it has no spectrum")
    units = tuple(run.log.topics[topic].units[column] for column in columns)
    t, values, resampled = resample_evenly(series.t, Continuous(units)(series.values))
    frequency, amplitude = amplitudes(t, values, shape)
    span = Window(float(t[0]), float(t[-1]))
    teeth = tooth_passing_frequency(run, names[0], span) if orders else float("nan")
    return Spectrum(names, units, frequency, amplitude, teeth, span, shape, resampled)


def tooth_passing_frequency(run: RunData, of: str, window: Window) -> float:
    """Mean tooth passing frequency of the sprocket of a signal, or the first, Hz; raises Missing."""
    signal = hull.sprocket_speed(run, of)
    t, speed = run.signal(signal, window)
    rate = hull.pins_of_sprocket(run) * abs(mean(t, speed)) / (2.0 * np.pi)
    if not rate > 0.0:
        raise Missing(f"'{signal}' is 0 over the window: there are no tooth orders")
    return float(rate)


def resample_evenly(t: Floats, values: Floats) -> tuple[Floats, Floats, bool]:
    """Samples (m, n) at evenly spaced times, and whether they were interpolated."""
    steps = np.diff(t)
    if np.ptp(steps) <= EVEN * steps.mean():
        return t, values, False
    even = np.linspace(t[0], t[-1], 1 + round((t[-1] - t[0]) / float(np.median(steps))))
    return even, np.stack([np.interp(even, t, column) for column in values.T], axis=1), True


def amplitudes(t: Floats, values: Floats, shape: str = "hann") -> tuple[Floats, Floats]:
    """Frequencies (k,), Hz, and amplitudes (k, n) of evenly spaced samples (m, n); raises Missing."""
    if shape not in SHAPES:
        raise Missing(f"a window '{shape}' is not known: there is {', '.join(SHAPES)}")
    m = len(t)
    turns = 2.0 * np.pi * np.arange(m) / m
    weights = np.sum([(-1.0) ** k * a * np.cos(k * turns) for k, a in enumerate(SHAPES[shape])], axis=0)
    middle = values.mean(axis=0)
    amplitude = 2.0 * np.abs(np.fft.rfft((values - middle) * weights[:, None], axis=0)) / weights.sum()
    amplitude[0] = np.abs(middle)
    if m % 2 == 0:
        amplitude[-1] *= 0.5  # the Nyquist frequency has no negative twin
    return np.fft.rfftfreq(m, (t[-1] - t[0]) / (m - 1)), amplitude
