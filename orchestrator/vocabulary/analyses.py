"""Analyses of a run by name, with their options and the outputs that they need.

``ANALYSES`` defines the command ``cotrack analyse`` and the function ``analyse`` (``results/analyses``).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from fmus.vehicles.tables import BadInput


class Option(NamedTuple):
    """Argument of ``of`` and its option on the command line."""

    name: str  # name of the argument
    kind: Any  # type on the command line
    flag: str
    metavar: str | None
    help: str
    least: int | None = None

    @property
    def keyword(self) -> str:
        """Its name from Python: that of the flag."""
        return self.flag.removeprefix("--")


class Analysis(NamedTuple):
    """Description and options of an analysis."""

    about: str
    options: tuple[Option, ...] = ()
    picture_options: tuple[Option, ...] = ()  # options of ``picture``
    records: tuple[str, ...] = ()  # groups of link outputs that it needs beside the standard ones
    every_step: bool = False  # it needs links at every step: peaks between two records are lost
    stress: bool = False  # rigid links have none, so a run of them is not recorded for it
    seats: bool = False  # it needs the motion of a seat
    library: str = ""  # of the extra analysis, which it needs
    ways: tuple[str, ...] = ()  # values of the option by: what its rows are
    full_series: bool = False  # a file gets all numbers over time, frequency or length instead of the table

    @property
    def flags(self) -> tuple[str, ...]:
        """Options on the command line."""
        return tuple(option.flag for option in (*self.options, *self.picture_options))


UNSTRESSED = "fatigue needs flexible links, or a force (option signal, tension)"
SN_HELP = "S-N line of fatigue: stress range, cycles, slope; default 100e6,2e6,3, units as in '90 MPa,1e6,5'"

TRACK = Option("track", str, "--track", "NAME", "left_track or left; default all, by place and of deformation one")
SIGNALS = Option(
    "signals", list[str], "--signal", "NAME",
    "of a spectrum: instance.variable, * for anything; repeatable; of links by place: link[*].tension or the like, or "
    "pressure; of fatigue: a force, as tension, instead of the stress",
)  # fmt: skip
SIGNAL = SIGNALS._replace(name="signal")
SHAPE = Option("shape", str, "--shape", "hann|flat-top", "window of a spectrum, default hann")
ORDERS = Option("orders", bool, "--order", None, "of a spectrum: tooth orders too")
BINS = Option("bins", int, "--bins", "N", "of links by place, default one a link", 0)
SN = Option("sn", str, "--sn", "RANGE,CYCLES,SLOPE", SN_HELP)
TEETH = Option("teeth", bool, "--teeth", None, "events: each tooth that passes")
AT = Option("at", list[float], "--at", "T", "deformation: an instant, s; repeatable; default last")
LINK = Option("link", int, "--link", "N", "deformation: the link of a picture, default 1")
BY = Option(
    "by",
    str,
    "--by",
    "WAY",
    "life: damage by place or phase, rainflow cycles or matrix; links: by component (default), place or wheel",
)
SEAT = Option("seat", str, "--seat", "NAME", "ride: the seat, default all")

ANALYSES = {
    "power": Analysis("through wheels, sprockets and motors, relative to the hull", full_series=True),
    "spectrum": Analysis(
        "largest peaks of signals, by frequency and tooth order", (SIGNALS, SHAPE, ORDERS), full_series=True
    ),
    "fatigue": Analysis(
        "rainflow cycles of links: damage, equivalent ranges of stress or of a force",
        (TRACK, SN, SIGNAL),
        records=("fibres",),
        every_step=True,
        stress=True,
        library="rainflow",
    ),
    "life": Analysis(
        "of pins and links by the forces in pins: stress, damage, km (table life of the vehicle)",
        (TRACK, BY),
        every_step=True,
        library="rainflow",
        ways=("place", "phase", "cycle", "matrix"),
        full_series=True,
    ),
    "wear": Analysis(
        "of bushed pins that rub: turning, work of friction, growth of the pitch (track.bushing of the vehicle)",
        (TRACK,),
        records=("turned", "rubbed"),
        full_series=True,
    ),
    "wheel-loads": Analysis("of road wheels, and how long they are lifted off"),
    "slip": Analysis("and thrust of tracks", full_series=True),
    "links": Analysis(
        "forces in joints and on links, where and when; tension or ground pressure by place; patches by wheel",
        (TRACK, BY, SIGNAL, BINS),
        ways=("component", "place", "wheel"),
    ),
    "deformation": Analysis(
        "of links along their length, in their tangent frames", (TRACK, AT), (LINK,), ("slopes",), full_series=True
    ),
    "ride": Analysis("vibration of seats by ISO 2631-1, absorbed power, peaks", (SEAT,), seats=True, full_series=True),
    "events": Analysis("wheels that lift off, brakes that hold, steps taken back, warnings", (TEETH,)),
    "phases": Analysis("rest, acceleration, steady, turns, braking, slowing: speed, yaw rate, power, slip, tension"),
    "validity": Analysis("where the run stops being valid: penetration, tooth jumps, travel of idlers, ..."),
}

FORMER = {  # analyses of older versions, and what has their figures
    "joints": "links", "envelope": "links --by place", "contact": "links --by place --signal pressure",
    "patches": "links --by wheel",
}  # fmt: skip


def recorder_of(group: str) -> str:
    """Name of the first analysis that needs a group of link outputs; empty if none does."""
    return next((name for name, one in ANALYSES.items() if group in one.records), "")


def described(name: str) -> Analysis:
    """Description of an analysis; raises BadInput for an unknown name or a former one."""
    if name in FORMER:
        raise BadInput(f"the analysis {name} is now '{FORMER[name]}'")
    if name not in ANALYSES:
        raise BadInput(f"no analysis '{name}': one of {', '.join(ANALYSES)}")
    return ANALYSES[name]


def check_by(name: str, by: str) -> None:
    """Raise BadInput for rows that an analysis does not have."""
    if by and by not in (ways := described(name).ways):
        raise BadInput(f"by = {by}: must be one of {', '.join(ways)}")
