"""A run from Python: of a scene with the defaults of ``cotrack run``, and by its log.

Signals, pictures, tables, analyses and the report are methods of one object.
"""

from __future__ import annotations

import html
import io
import os
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cached_property
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.execution import log_report, summary, summary_text
from orchestrator.execution.simulate import simulate
from orchestrator.files.progress import Progress
from orchestrator.log.angles import continuous, turn_of
from orchestrator.log.export import columns_of, to_pandas
from orchestrator.log.reader import Log, Missing
from orchestrator.log.signal_names import Names, listed
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import catalogue
from orchestrator.results.analyses.signal_picture import figure_of
from orchestrator.results.difference import ObservableDifference, differences_of_logs
from orchestrator.results.measured_difference import MeasuredComparison, compare_measured
from orchestrator.results.measured_record import MeasuredFile
from orchestrator.results.output_files import save_figure
from orchestrator.results.run_data import RunData, Window
from orchestrator.scene.scene import with_settings
from orchestrator.scene.settings import pairs
from orchestrator.scene.ssp_scene import load_runnable
from orchestrator.scene.system_scene import SystemScene

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Extreme(NamedTuple):
    """Largest or smallest value of a signal, of a family that of all members, and when it was first recorded."""

    t: float  # s
    value: float


class Signal(NamedTuple):
    """Values of a signal over time; of a family as "left_track.link[*].tension", a column for each member."""

    name: str
    unit: str
    t: Floats  # (m,) s
    values: Floats  # (m,) or (m, k), in the unit

    def between(self, start: float, end: float) -> Signal:
        """Values in a closed interval of time, s."""
        inside = (self.t >= start) & (self.t <= end)
        return self._replace(t=self.t[inside], values=self.values[inside])

    def at(self, t: float) -> Floats:
        """Values () or (k,) at a time, s, linear between records; held before and after them. Angles have no jumps."""
        columns, turn = self.values.reshape(len(self.t), -1).T, turn_of(self.unit)
        interpolated = np.array([np.interp(t, self.t, continuous(column, turn)) for column in columns])
        return interpolated.reshape(self.values.shape[1:])

    @property
    def max(self) -> Extreme:
        """Largest value and its time; raises ValueError without values."""
        return self._extreme(int(self.values.argmax()))

    @property
    def min(self) -> Extreme:
        """Smallest value and its time; raises ValueError without values."""
        return self._extreme(int(self.values.argmin()))

    def _extreme(self, place: int) -> Extreme:
        row = place // (self.values.size // len(self.t))
        return Extreme(float(self.t[row]), float(self.values.flat[place]))

    def __repr__(self) -> str:
        columns = f" x {self.values.shape[1]}" if self.values.ndim > 1 else ""
        if not self.values.size:
            return f"{self.name}: no values"
        return (
            f"{self.name}: {len(self.t)}{columns} values from {self.t[0]:g} to {self.t[-1]:g} s,"
            f" {self.min.value:.5g} to {self.max.value:.5g} {self.unit}, largest at {self.max.t:.4g} s"
        )


@dataclass(frozen=True)
class Picture:
    """A matplotlib ``figure``; a notebook shows it as the value of a cell."""

    figure: Figure

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the picture, .png, .svg or .pdf; raises BadInput."""
        save_figure(self.figure, Path(path))
        return Path(path)

    def _repr_png_(self) -> bytes:
        content = io.BytesIO()
        self.figure.savefig(content, dpi=100, format="png")
        return content.getvalue()


AnyPath = str | os.PathLike[str]


class Run:
    """A run that ``cotrack.run`` made, or the run in a log: ``cotrack.Run("logs/turn-flexible.mcap")``.

    Printed, it is a short summary. Its log on disk is opened when values are asked for. Raises LogUnreadable.

    :ivar log: path of the log.
    """

    def __init__(self, log: AnyPath, result: Mapping[str, Any] | None = None) -> None:
        self.log = Path(log)
        if result is None:
            Log(self.log).close()  # raises LogUnreadable
        else:
            self.summary = dict(result)

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The summary, as ``cotrack run --json`` prints it; of an older log without parts of the cost."""
        return log_report.summary_of(self.log)

    @property
    def ok(self) -> bool:
        """Whether the run ended well and met every check: exit status 0 of ``cotrack run``."""
        return summary.is_passed(self.summary)

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of all recorded signals, "instance.variable"."""
        with Log(self.log) as log:
            return log.signals

    def __getitem__(self, name: str) -> Signal:
        """Return a signal, "chassis.speed", or a family, "left_track.link[*].tension"; raises Missing.

        Members of a family are recorded together and have one unit; raises Missing for a pattern of others.
        """
        with Log(self.log) as log:
            if "*" not in name:
                return Signal(name, log.unit(name), *log.signal(name))
            t, columns = columns_of(log, [name])
            units = {unit for unit, _ in columns.values()}
            if len(units) > 1:
                raise Missing(f"{self.log}: '{name}' matches signals in {' and '.join(sorted(units))}: no family")
            return Signal(name, units.pop(), t, np.stack([values for _, values in columns.values()], axis=1))

    def frame(self, *signals: Names, start: float = -inf, end: float = inf) -> Any:
        """Return signals as a pandas table over ``t``, s; ``*`` stands for any text, units are in ``attrs["units"]``.

        Raises Missing, also for signals that were recorded at different times, and NotInstalled.
        """
        with Log(self.log) as log:
            return to_pandas(log, *signals, window=(start, end))

    def plot(self, *signals: Names, start: float = -inf, end: float = inf, **form: Any) -> Picture:
        """Draw signals over time; a notebook shows the result, ``.save("a.png")`` writes it.

        ``form``: ``frequency=True`` or ``order=True`` (tooth orders) draws amplitudes, ``waterfall=True`` a map of a
        family, ``place=True`` a map by place on the circuit. Raises BadInput, Missing.
        """
        return Picture(figure_of([self.log], listed(signals), Window(start, end), **form))

    def analyse(self, what: str, start: float = -inf, end: float = inf, **options: Any) -> Any:
        """Return an analysis of ``cotrack analyse``: its arrays, ``table()`` and ``table().frame()``; raises BadInput.

        ``options`` are those of the command line, below.
        """
        return catalogue.analyse(self.log, what, (start, end), **options)

    analyse.__doc__ = f"{(analyse.__doc__ or '').rstrip()}{catalogue.options_listed('        ')}"

    def report(
        self,
        path: AnyPath | None = None,
        reference: Run | AnyPath | None = None,
        *,
        measured: AnyPath | None = None,
        columns: Mapping[str, str] | None = None,
        shift: float | str = 0.0,
        clock: str = "",
        sn: str = "",
    ) -> Path:
        """Write the page of the run, by default beside its log, and return its path.

        :param reference: a run to compare with.
        :param measured: a file of measured signals to compare with, with ``columns``, ``shift`` and ``clock`` as
            of ``compare_measured``.
        :param sn: S-N line of the fatigue, "stress range,cycles,slope", as "90 MPa,1e6,5".
        :raises BadInput: for what cannot be compared. Raises NotInstalled, Missing.
        """
        if measured is None and (columns or clock or shift):
            raise BadInput("columns, shift and clock belong to measured, a file, which is not given")
        page = Path(path) if path is not None else self.log.with_suffix(".html")
        other = reference.log if isinstance(reference, Run) else reference
        source = None if measured is None else MeasuredFile(measured, columns or {}, clock, shift)
        log_report.report(self.log, page, other, measured=source, sn=sn)
        return page

    def compare(self, reference: Run | AnyPath) -> dict[str, ObservableDifference]:
        """Return the difference from another run by observable; raises Missing if there is nothing in common."""
        return differences_of_logs(self.log, reference.log if isinstance(reference, Run) else Path(reference))

    def compare_measured(
        self,
        file: AnyPath,
        columns: Mapping[str, str],
        *,
        shift: float | str = 0.0,
        clock: str = "",
        start: float = -inf,
        end: float = inf,
        by_phase: bool = False,
    ) -> MeasuredComparison:
        """Return the difference from a file of measured signals; ``.table()`` is printed, ``.shift`` in s.

        :param columns: "COLUMN" or "COLUMN:UNIT" by signal, ``{"chassis.speed": "v:km/h"}``.
        :param shift: s, added to the times of the file, or "find".
        :param clock: column of the time, by default "t" or "time".
        :raises BadInput: for a file that cannot be used. Raises Missing, also without common time.
        """
        source = MeasuredFile(file, columns, clock, shift)
        with Log(self.log) as log:
            return compare_measured(RunData(log), source, Window(start, end), by_phase)

    def __repr__(self) -> str:
        return f"{summary_text.headline(self.summary)}; log {self.log}"

    def __str__(self) -> str:
        head, *below = summary_text.lines(self.summary, verbose=False)
        message = self.summary["message"]
        return "\n".join([head, *([f"  {message}"] if message else []), *below])

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self))}</pre>"


def run(
    scene: str | os.PathLike[str] | SystemScene,
    settings: Mapping[str, Any] | Sequence[str] = (),
    *,
    track: str | None = None,
    stop: float | str | None = None,
    step: float | str | None = None,
    estimate: bool | Literal["parts"] = True,
    native: bool = False,
    log: str | os.PathLike[str] | None = None,
    progress: bool = True,
) -> Run:
    """Run a scene, record it, evaluate its checks and estimate its error, as ``cotrack run`` does.

    :param scene: name in the gallery, TOML file, SSP archive, or a scene of ``cotrack.load``.
    :param settings: values by dotted key, ``{"vehicle.track.mass": 20, "run.stop": "3 s"}``; numbers are in SI
        units, texts may have others ("2 ms"). ``KEY=VALUE`` texts, as of ``--set``, are allowed too.
    :param track: "flexible" or "rigid", instead of the scene's.
    :param stop: end of the run, s.
    :param step: communication step, s.
    :param estimate: estimate the error by two coarser runs, in 0.75 of the run's time; "parts": also its parts of
        coupling and integration, by a third one.
    :param native: use native FMUs; results have the same bits.
    :param log: path of the log, by default logs/SCENE-TRACK.mcap, with the settings behind TRACK; an older log there is
        replaced, unless it is of a run that ended well and this one fails.
    :param progress: print progress on stderr.
    :returns: the run, also if it failed: see ``Run.ok`` and ``Run.summary``.
    :raises BadInput: before the first step, as BuildFailed, ComponentFailed, CouplingFailed, LogFailed; no log then.
    """
    overrides = {"run.stop": stop, "run.step": step}
    changes = dict(pairs(settings)) | {key: value for key, value in overrides.items() if value is not None}
    if not isinstance(scene, SystemScene):
        resolved: SystemScene = load_runnable(os.fspath(scene), track, changes)
    elif track is None:
        resolved = with_settings(scene, changes) if changes else scene
    else:
        raise BadInput(f"track = '{track}': a scene that is loaded has its track model; cotrack.load takes another one")
    path = Path(log) if log is not None else Path("logs") / resolved.log_name
    with Progress(resolved.name) if progress else nullcontext():
        result = simulate(resolved, path, estimated=estimate, native=native)
    return Run(result["log"] or path, result)
