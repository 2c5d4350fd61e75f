"""Stiff and extreme cases: verdict, margin to the predicted limit, observed limit.

A case runs a scene of the gallery with settings and has two requirements: the energy ledger closes to 5 %
(``summary.energy_warning``), and one physical expectation, named in the table, is met; ``verdict`` judges the run. The
predicted limit is the longest communication step of the linearised coupling, or the internal step of an explicit
integrator (``step_limits``); the observed limit is bisected with the same requirements. The table shows all cases, and
the map too. Cases are families of one parameter, and steps whose limits are bisected.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from fmus.vehicles.sides import way_a_turn
from fmus.vehicles.tables import BadInput
from orchestrator.results import output_files
from orchestrator.results.table import Column, Table
from orchestrator.scene.kinds import RigScene
from orchestrator.scene.scene import load
from orchestrator.studies import Case, Row
from orchestrator.studies.step_limits import predicted
from orchestrator.studies.verdict import (
    BLOWN,
    CLEAN,
    EXPECTATIONS,
    MUTE,
    RIGHT,
    VERDICTS,
    WITHOUT_VERDICT,
    WRONG,
    judged_run,
    with_verdict,
)


class Family(NamedTuple):
    """Family of cases: one parameter and its values."""

    name: str
    scene: str
    track: str
    values: tuple[float, ...]
    settings: Callable[[float], Sequence[str]]
    expectation: str | Callable[[float], str] = "weight"
    sensible: tuple[float, float] = (-math.inf, math.inf)  # range of realistic values
    quick: tuple[float, ...] | None = None  # values of the quick form; None: all
    seconds: float = 15.0


class BisectedStep(NamedTuple):
    """Step whose longest stable length is bisected."""

    name: str
    scene: str
    track: str
    settings: Sequence[str]
    key: str  # of the step
    shortest: float  # s; the limit is looked for from this to 100 times this
    quick: bool = False  # part of the quick form


HALF = ("symmetric=true", "track.link_outputs=false")  # no records of links are needed
SHORT = (*HALF, "run.stop=2 s")
DRIVING = (*HALF, "run.stop=3.5 s", "drive.speed=6", "drive.ramp_start=0.3", "drive.ramp_time=1.5")
LAWS = ("sprocket", "wheel", "ground")


def _laws(key: str, factor: float) -> list[str]:
    contact = load("settle").vehicle.contact
    return [f"vehicle.contact.{law}.{key}={factor * getattr(getattr(contact, law), key)}" for law in LAWS]


def _heavy(factor: float) -> list[str]:
    v = load("settle").vehicle
    inertia = [factor * part for part in v.track.inertia]
    return [f"vehicle.track.mass={factor * v.track.mass}", f"vehicle.track.inertia={inertia}"]


def _fast(kmh: float) -> list[str]:
    v = load("straight").vehicle
    omega = kmh / 3.6 * 2 * math.pi / way_a_turn(v.model_dump())
    ramp = max(1.5, 0.7 * kmh / 3.6)  # keeps the peak of the half cosine below a friction of 0.3
    stop = math.ceil(ramp + 2.0)
    return [*HALF, f"run.stop={stop}", f"drive.speed={omega}", "drive.ramp_start=0.3", f"drive.ramp_time={ramp}"]


def _hairpin(outer: float) -> list[str]:
    """Settings of a hairpin: half the speed inside, reached in two seconds or as friction permits."""
    ramp = max(2.0, 0.15 * outer)
    sides = (f"drive.left.speed={0.5 * outer}", f"drive.right.speed={outer}", f"drive.ramp_time={ramp}")
    return [*sides, f"run.stop={math.ceil(ramp + 2.5)}", "track.link_outputs=false"]


def _pivot(friction: float) -> list[str]:
    return [f"vehicle.contact.ground.friction={friction}", "run.stop=4 s", "track.link_outputs=false"]


def _obstacle(rise: float) -> list[str]:
    bump = f'ground.bump={{start=1.0, rise={rise}, slope="30 deg", length=1.0, radius=0.3}}'
    drive = ("drive.speed=8", "drive.ramp_start=0.2", "drive.ramp_time=2", "run.stop=6 s")
    return [*HALF, *drive, "ground.hull=true", bump]


def _steep(percent: float) -> list[str]:
    drive = ("drive.speed=6", "drive.ramp_start=0.1", "drive.ramp_time=2", "run.stop=4 s")
    return [*HALF, *drive, f"ground.grade={percent} %", "vehicle.contact.ground.friction=1"]


def _sandy(kphi: float) -> list[str]:
    drive = ("drive.speed=4", "drive.ramp_start=0.1", "drive.ramp_time=1", "run.stop=3 s", "hitch=false")
    return [*HALF, *drive, "ground.soil.name=dry_sand", f"ground.soil.kphi={kphi}"]


def _stepped(ms: float) -> list[str]:
    return [*HALF, f"run.stop={2.0 if ms >= 0.2 else 0.5}", f"run.step={ms} ms"]


def _link_count(n: float) -> list[str]:
    return [f"chain.links={n:.0f}", "run.stop=0.5 s", "track.link_outputs=true"]


def _loop(n: float) -> list[str]:
    return [f"chain.links={n:.0f}", f"chain.spin={5.0 * 64.0 / n}", "run.stop=0.5 s"]  # gives the tension of 64 links


def _round_wheels(n: float) -> list[str]:
    scene = load("rig")
    assert isinstance(scene, RigScene)
    distance = scene.rig.axle_distance + 0.5 * (n - scene.rig.links) * scene.vehicle.track.pitch
    return [f"rig.links={n:.0f}", f"rig.axle_distance={distance}", "run.stop=4 s", "track.link_outputs=false"]


def _sprung(k: float) -> list[str]:
    return [*SHORT, "track.closure=spring", f"track.closure_stiffness={k}"]


FAMILIES = (
    Family("Young's modulus, Pa", "settle", "flexible", tuple(2.0 * 10.0**k for k in range(6, 14)),
           lambda E: [*SHORT, f"vehicle.material.youngs_modulus={E}"], sensible=(2e9, 2e13), quick=(2e6, 2e11, 2e13)),
    Family("contact stiffness, factor", "settle", "flexible", (0.01, 0.1, 1.0, 10.0, 100.0),
           lambda f: [*SHORT, *_laws("stiffness", f)], sensible=(0.5, 100.0), quick=(0.01, 1.0, 100.0)),
    Family("contact damping, factor", "settle", "flexible", (0.0, 1.0, 10.0),
           lambda f: [*SHORT, *_laws("damping", f)], quick=(0.0,)),
    Family("friction of the ground", "straight", "flexible", (0.0, 0.1, 0.3, 0.6, 1.0, 1.5),
           lambda mu: [*DRIVING, f"vehicle.contact.ground.friction={mu}"],
           lambda mu: "speed" if mu else "stays", quick=(0.0, 1.5), seconds=25.0),
    Family("friction everywhere", "straight", "flexible", (0.0, 0.5, 1.5),
           lambda mu: [*DRIVING, *(f"vehicle.contact.{law}.friction={mu}" for law in LAWS)],
           lambda mu: "speed" if mu else "stays", sensible=(0.0, 0.8), quick=(), seconds=25.0),
    Family("friction velocity, m/s", "straight", "flexible", (1e-1, 1e-2, 1e-3, 1e-4),
           lambda v: [*DRIVING, *(f"vehicle.contact.{law}.friction_velocity={v}" for law in LAWS)],
           "speed", quick=(1e-1, 1e-4), seconds=25.0),
    Family("friction velocity, m/s, rigid", "straight", "rigid", (1e-2, 1e-3, 1e-4),
           lambda v: [*DRIVING, *(f"vehicle.contact.{law}.friction_velocity={v}" for law in LAWS)],
           "speed", quick=(), seconds=25.0),
    Family("material damping, s", "straight", "flexible", (0.0, 1e-6, 1e-4),
           lambda tau: [*DRIVING, f"vehicle.material.relaxation_time={tau}"], "speed", quick=(0.0,), seconds=25.0),
    Family("stiffness of a closing spring, N/m, rigid", "settle", "rigid", (1e7, 1e9, 1e11, 1e13), _sprung, quick=()),
    Family("stiffness of a closing spring, N/m, rigid in joint coordinates", "settle", "rigid", (1e7, 1e9, 1e11),
           lambda k: [*_sprung(k), "track.formulation=recursive", "track.integrator=runge_kutta"], quick=(),
           seconds=60.0),
    Family("link mass, factor", "settle", "flexible", (0.01, 0.1, 1.0, 10.0, 100.0),
           lambda f: [*SHORT, *_heavy(f)], sensible=(0.1, 3.0), quick=(0.01, 100.0)),
    Family("link mass, factor, rigid", "settle", "rigid", (0.01, 0.1, 1.0, 10.0, 100.0),
           lambda f: [*SHORT, *_heavy(f)], sensible=(0.1, 3.0), quick=()),
    Family("communication step, ms", "settle", "flexible", (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0),
           _stepped, sensible=(0.05, 5.0), quick=(0.5, 5.0, 50.0), seconds=60.0),
    Family("internal step of implicit links, ms", "hanging_chain", "flexible", (0.1, 1.0, 5.0, 20.0, 50.0),
           lambda h: ["track.start=displaced", "run.stop=1 s", "run.step=50 ms", f"track.step={h} ms"],
           "ledger", sensible=(0.0, 2.0), quick=(1.0, 50.0)),
    Family("tension at the start, kN", "settle", "flexible", (0.0, 2.0, 16.3, 50.0, 100.0, 300.0),
           lambda T: [*SHORT, f"vehicle.track.tension={T} kN"], sensible=(2.0, 50.0), quick=(2.0, 100.0)),
    Family("links of a hanging chain", "hanging_chain", "flexible", (8.0, 16.0, 64.0, 256.0, 512.0),
           _link_count, "sag", quick=(8.0, 512.0)),
    Family("links of a hanging chain, rigid", "hanging_chain", "rigid", (8.0, 64.0, 512.0), _link_count, "sag",
           quick=()),
    Family("links of a free loop", "spinning_loop", "flexible", (8.0, 64.0, 512.0), _loop, "hoop", quick=(8.0,)),
    Family("links of a free loop, rigid", "spinning_loop", "rigid", (8.0, 64.0, 512.0), _loop, "hoop", quick=(512.0,)),
    Family("links round two wheels", "rig", "flexible", (20.0, 32.0, 64.0, 128.0, 256.0), _round_wheels, "rides",
           quick=(20.0,)),
    Family("links round two wheels, rigid", "rig", "rigid", (20.0, 64.0), _round_wheels, "rides", quick=()),
    Family("sprockets locked at speed, km/h", "straight", "flexible", (10.0, 20.0, 40.0),
           lambda v: [*_fast(v), f"drive.stop={max(1.5, 0.7 * v / 3.6) + 0.3}",
                      f"run.stop={math.ceil(max(1.5, 0.7 * v / 3.6) + 2.0)}"],
           "sliding", quick=(10.0,), seconds=30.0),
    Family("speed, km/h", "straight", "flexible", (20.0, 40.0, 60.0, 80.0, 100.0), _fast, "speed", quick=(),
           seconds=90.0),
    Family("speed, km/h, rigid", "straight", "rigid", (20.0, 60.0, 100.0), _fast, "speed", quick=(20.0,), seconds=90.0),
    Family("drop, m", "settle", "flexible", (0.5, 1.0, 2.0),
           lambda z: [*HALF, "run.stop=4 s", f"start.height={z}", "ground.hull=true"], "at_rest", quick=(2.0,)),
    Family("gravity, g", "settle", "flexible", (0.0, 1.0, 3.0, 10.0),
           lambda g: [*SHORT, f"vehicle.gravity={9.81 * g}"], lambda g: "weight" if g else "afloat",
           sensible=(0.0, 3.0), quick=(0.0, 10.0)),
    Family("thrown upside down from, m", "settle", "flexible", (0.5, 1.0, 2.0),
           lambda z: [*HALF, "run.stop=8 s", f"start.height={0.7 + z}", 'start.pitch=180 deg', "ground.hull=true"],
           "at_rest", quick=(1.0,), seconds=30.0),
    Family("rolled over from, m", "settle", "flexible", (0.5, 1.0),
           lambda z: [*HALF, "run.stop=8 s", f"start.height={0.7 + z}", 'start.roll=180 deg', "ground.hull=true"],
           "at_rest", quick=(1.0,), seconds=30.0),
    Family("obstacle, m", "straight", "flexible", (0.3, 0.65, 1.0), _obstacle, "climbs", quick=(0.65,), seconds=30.0),
    Family("grade, %", "climb", "flexible", (10.0, 30.0, 60.0), _steep, "uphill", quick=(60.0,), seconds=30.0),
    Family("grade, %, rigid", "climb", "rigid", (10.0, 30.0, 60.0), _steep, "uphill", quick=(), seconds=30.0),
    Family("stiffness of soil kphi, N/m^(n+2)", "soft_ground", "flexible", tuple(10.0**k for k in range(5, 11)),
           _sandy, sensible=(3e5, 1e8), quick=(1e6, 1e10)),
    Family("stiffness of soil kphi, N/m^(n+2), rigid", "soft_ground", "rigid", tuple(10.0**k for k in range(5, 11)),
           _sandy, sensible=(3e5, 1e8), quick=()),
    Family("tracks there are", "settle", "flexible", (0.0, 1.0, 2.0),
           lambda n: ["run.stop=2 s", "track.link_outputs=false",
                      f"tracks={['left', 'right'][: int(n)]}".replace("'", '"')], quick=(0.0, 1.0)),
    Family("hairpin, rad/s outside", "turn", "flexible", (5.0, 10.0, 20.0, 30.0), _hairpin, quick=(20.0,)),
    Family("hairpin, rad/s outside, rigid", "turn", "rigid", (5.0, 10.0, 20.0, 30.0), _hairpin, quick=()),
    Family("friction of a pivot", "pivot", "flexible", (0.0, 0.1, 0.3, 0.7, 1.0, 1.5), _pivot, quick=(1.0,)),
    Family("friction of a pivot, rigid", "pivot", "rigid", (0.1, 0.7, 1.5), _pivot, quick=()),
    Family("minutes of driving", "straight", "rigid", (10.0,),
           lambda m: [*HALF, f"run.stop={60 * m}", "run.step=2 ms", "run.outputs=50"], "speed", quick=(),
           seconds=1200.0),
)  # fmt: skip
BISECTED = (
    BisectedStep("communication step", "settle", "rigid", (*HALF, "run.stop=1 s"), "run.step", 1e-3),
    BisectedStep("step of the explicit integrator", "hanging_chain", "flexible",
     ("chain.links=16", "track.start=displaced", "run.stop=0.05 s", "track.integrator=runge_kutta",
      "vehicle.material.relaxation_time=1e-5 s"), "track.step", 1e-6, quick=True),
    BisectedStep("step of the explicit integrator, soft links", "hanging_chain", "flexible",
     ("chain.links=16", "track.start=displaced", "run.stop=0.05 s", "track.integrator=runge_kutta",
      "vehicle.material.youngs_modulus=2e8", "vehicle.material.relaxation_time=1e-3 s"), "track.step", 1e-6),
)  # fmt: skip


TITLE = "Stability: stiff and extreme cases"
LIMIT = 600.0  # s of a case; a longer one hangs
BISECTIONS = 5


def cases(quick: bool) -> list[Case]:
    """Cases: every value of every family, then the bisected limits."""
    all_cases = []
    for number, family in enumerate(FAMILIES):
        values = family.values if not quick or family.quick is None else family.quick
        for value in values:
            limit = max(LIMIT, 3.0 * family.seconds)
            all_cases.append(
                Case(family.name, f"{family.name}: {value:g}", member, (number, value), family.seconds, limit)
            )
    for number, one in enumerate(BISECTED):
        if not quick or one.quick:
            all_cases.append(Case(one.name, f"{one.name}: limit", bisected_limit, (number,), 60.0, LIMIT))
    return all_cases


def member(number: int, value: float) -> list[Row]:
    """Row of a member of a family."""
    family = FAMILIES[number]
    expectation = family.expectation if isinstance(family.expectation, str) else family.expectation(value)
    sensible = family.sensible[0] <= value <= family.sensible[1]
    row = Row("", f"{value:g}", {"value": value, "sensible": sensible, "asked": EXPECTATIONS[expectation][1]})
    try:
        scene = load(family.scene, family.track, family.settings(value))
    except BadInput as refusal:
        return [with_verdict(row, CLEAN, str(refusal))]
    limit, cause = predicted(scene)
    return [judged_run(scene, expectation, row.with_figures(step=scene.run.step, predicted=limit, cause=cause))]


def bisected_limit(number: int) -> list[Row]:
    """Longest stable step, from 1 to 100 times the given one, beside the predicted one."""
    _, scene, track, settings, key, smallest, _ = BISECTED[number]
    expectation = "weight" if scene == "settle" else "ledger"
    base = load(scene, track, settings)
    limit, cause = predicted(base)
    stop = base.run.stop

    def run(step: float) -> Row:
        length = stop / round(stop / step) if key == "run.step" else step
        row = Row("", "limit", {"step": length, "predicted": limit, "cause": cause})
        return judged_run(load(scene, track, [*settings, f"{key}={length!r}"]), expectation, row)

    def longest(good: tuple[str, ...]) -> tuple[Row, Row]:
        """Longest step with a good verdict, and shortest one without."""
        low, high = run(smallest), run(min(100.0 * smallest, stop))
        for _ in range(BISECTIONS if low["verdict"] in good and high["verdict"] not in good else 0):
            middle = run(math.sqrt(low["step"] * high["step"]))
            low, high = (middle, high) if middle["verdict"] in good else (low, middle)
        return (high, high) if high["verdict"] in good else (low, high)

    (right, _), (stable, beyond) = longest((RIGHT,)), longest((RIGHT, WRONG))
    end = (
        f"at {beyond['step']:.3g} s {beyond['verdict']}: {beyond.note}"
        if beyond is not stable
        else "no limit up to there"
    )
    note = f"right up to {right['step']:.3g} s, stable up to {stable['step']:.3g} s; {end}"
    return [replace(right.with_figures(value=stable["step"], observed=stable["step"]), note=note)]


COLOURS = {RIGHT: "#4c9f50", WRONG: "#f0c040", CLEAN: "#5b8fd0", BLOWN: "#d04040", MUTE: "#000000"}
COLUMNS = (
    Column("item", "family"),
    Column("case", "value"),
    Column("verdict", "verdict"),
    Column("sensible", "sensible"),  # a realistic value
    Column("asked", "asked"),
    Column("found", "found", ".3g"),
    Column("expected", "expected", ".3g"),
    Column("tolerance", "tolerance", ".3g"),
    Column("open", "ledger open", ".3g"),  # of the largest of work, change and dissipated
    Column("step", "step, s", ".3g"),  # used: communication, or internal of an explicit integrator
    Column("predicted", "predicted limit, s", ".3g"),  # longest step
    Column("cause", "by"),
    Column("margin", "margin", ".3g"),
    Column("observed", "observed limit, s", ".3g"),  # longest step with a right result
    Column("seconds", "run, s", ".2g"),
    Column("note", "what happened"),
)


def table(rows: Sequence[Row], title: str = "") -> Table:
    """Table of the rows, with the number of cases of each verdict."""
    cells = [_completed(row) for row in rows]
    ends = ", ".join(f"{sum(row['verdict'] == verdict for row in cells)} {verdict}" for verdict in VERDICTS)
    return Table.of_records(title, COLUMNS, cells, (f"{len(rows)} cases: {ends}.",))


def _completed(row: Row) -> dict[str, Any]:
    """Cells of a row, with the margin: predicted limit over used step."""
    cells = {**WITHOUT_VERDICT, **row.cells(), "margin": row["predicted"] / row["step"]}
    return {**cells, "sensible": "yes" if cells["sensible"] else "no"}


def draw(rows: Sequence[Row], title: str) -> output_files.Picture:
    """Draw the map: a line per family, a field per value, coloured by verdict, with the margin below."""
    from matplotlib.patches import Patch, Rectangle

    families = list(dict.fromkeys(row.item for row in rows))
    across = max((sum(row.item == item for row in rows) for item in families), default=1)
    figure = output_files.new_figure(4.5 + 1.05 * across, 1.6 + 0.42 * len(families), dpi=110)
    pane = figure.subplots()
    for y, item in enumerate(families):
        for x, row in enumerate(row for row in rows if row.item == item):
            cells = _completed(row)
            edge = "black" if cells["sensible"] == "yes" else "white"
            colour = COLOURS[cells["verdict"]]
            pane.add_patch(Rectangle((x + 0.04, y + 0.06), 0.92, 0.88, facecolor=colour, edgecolor=edge))
            value = row.case if math.isnan(row["value"]) else f"{row['value']:.3g}"
            label = value + ("" if math.isnan(cells["margin"]) else f"\n{cells['margin']:.2g} x")
            pane.text(x + 0.5, y + 0.5, label, ha="center", va="center", fontsize=7)
    pane.set_xlim(0, across)
    pane.set_ylim(len(families), 0)
    pane.set_yticks([y + 0.5 for y in range(len(families))], families, fontsize=8)
    pane.set_xticks([])
    for spine in pane.spines.values():
        spine.set_visible(False)
    handles = [Patch(color=COLOURS[verdict], label=verdict) for verdict in VERDICTS]
    figure.legend(handles=handles, ncols=3, fontsize=8, loc="outside lower center", frameon=False)
    pane.set_title(f"{title}\nbelow the value: predicted limit over step; framed: physically sensible", fontsize=10)
    return figure


def write(folder: Path, name: str, rows: Sequence[Row], title: str) -> list[Path]:
    """Write table and map; raises OSError if the folder cannot be written."""
    return output_files.save_results(folder, name, table(rows, title), draw(rows, title))
