"""Page of the study: verdicts, then the tables and figures behind them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from orchestrator.results.table import Column, Table
from orchestrator.studies import Row
from tests.validation.paper import (
    conventions,
    curvature,
    effects,
    figures,
    high_frequencies,
    pieces,
    ratios,
    whole_runs,
)
from tests.validation.paper.conventions import INSTANT
from tests.validation.paper.results import Results
from tests.validation.paper.rules import crossed

CASE = Column("case", "model")
NOTE = Column("note", "note")
STATEMENTS = (
    Column("where", "section"), Column("case", "statement"), Column("verdict", "verdict"),
    Column("measured", "measured"), Column("seen", "shown by"),
)  # fmt: skip
SPREAD = (Column("least", "least", ".3f"), Column("most", "most", ".3f"))  # of CPU times
TABLES = {  # item: title, columns
    "run": ("Whole runs, 0 to 8 s", (
        CASE, Column("cpu", "CPU time of the run, s", ".2f"), Column("evaluations", "evaluations", ".0f"),
        Column("steps", "internal steps", ".0f"), Column("ok", "ok"), NOTE,
    )),
    "cost": (f"The cheapest explicit run within an error of {pieces.EQUAL:g}", (
        CASE, Column("method", "method"), Column("setting", "tolerance, or part of the stable step", ".3g"),
        Column("piece", "piece, s", "g"), Column("cpu", "CPU time, s", ".3f"), *SPREAD,
        Column("evaluations", "evaluations", ".0f"), Column("counted", "with projections", ".0f"),
        Column("each", "CPU time of an evaluation, s", ".2e"),
        Column("storage", "bytes of a chain's arrays", ".0f"), Column("error", "error of pins", ".1e"),
        Column("order", "mean order", ".1f"), NOTE,
    )),
    "each": ("CPU time of an evaluation, flexible over rigid, measured in turn", (
        CASE, Column("method", "method"), Column("piece", "piece, s", "g"), Column("each", "of an evaluation", ".2f"),
        Column("least", "least", ".2f"), Column("most", "most", ".2f"), NOTE,
    )),
    "piece": ("All explicit runs", (
        CASE, Column("method", "method"), Column("setting", "tolerance, or part of the stable step", ".3g"),
        Column("cpu", "CPU time, s", ".3f"), *SPREAD, Column("evaluations", "evaluations", ".0f"),
        Column("steps", "steps", ".0f"), Column("projections", "projections", ".0f"),
        Column("error", "error of pins", ".1e"), Column("order", "mean order", ".1f"), NOTE,
    )),
    "interval": (f"Adams' methods at {pieces.AT:g} over the interval of output", (
        CASE, Column("interval", "interval, s", ".3g"), Column("piece", "piece, s", "g"),
        Column("evaluations", "evaluations", ".0f"), Column("floor", "two an interval", ".0f"),
        Column("counted", "with projections", ".0f"), Column("cpu", "CPU time, s", ".3f"), *SPREAD,
        Column("error", "error of pins", ".1e"), NOTE,
    )),
    "fmus": ("Adams' methods inside FMUs, which restart at each communication step", (
        CASE, Column("piece", "s from t = 4 s", "g"), Column("tolerance", "tolerance", ".0e"),
        Column("evaluations", "evaluations a simulated second", ".0f"), Column("steps", "steps", ".0f"),
        Column("restarts", "restarts", ".0f"), NOTE,
    )),
    "ratio": ("Flexible over rigid: what the ratio of costs would be", (
        CASE, Column("over", "varied"), Column("tolerance", "tolerance", ".0e"),
        Column("interval", "interval of output, s", ".3g"),
        Column("flexible_evaluations", "evaluations, flexible", ".0f"),
        Column("rigid_evaluations", "rigid", ".0f"), Column("floor", "two an interval", ".0f"),
        Column("evaluations", "ratio", ".1f"), Column("counted", "with projections", ".1f"),
        Column("cpu", "of CPU times", ".1f"), Column("least", "least", ".1f"), Column("most", "most", ".1f"),
        Column("each", "of an evaluation", ".2f"), Column("flexible_error", "error, flexible", ".0e"),
        Column("rigid_error", "rigid", ".0e"),
    )),
    "stiffness": ("Rigid links closed by springs, the cheapest run by Adams' methods", (
        CASE, Column("stiffness", "spring, N/m", ".0e"), Column("cpu", "CPU time, s", ".3f"),
        Column("evaluations", "evaluations", ".0f"), Column("error", "error of pins", ".1e"), NOTE,
    )),
    "modulus": ("Young's modulus", (
        CASE, Column("modulus", "modulus, Pa", ".1e"), Column("cpu_adams", "Adams, CPU s", ".3f"),
        Column("evaluations_adams", "evaluations", ".0f"), Column("cpu_runge_kutta", "Runge-Kutta, CPU s", ".3f"),
        Column("evaluations_runge_kutta", "evaluations", ".0f"),
        Column("implicit", "implicit, CPU s a simulated second", ".3f"), NOTE,
    )),
    "links": ("Cost and storage by links, no vehicle", (
        CASE, Column("links", "links", ".0f"), Column("evaluation", "CPU time of an evaluation, s", ".2e"),
        Column("over_peer", "over one in nodal coordinates, in turn", ".2f"),
        Column("step", "of an implicit step, s", ".2e"),
        Column("step_over_rigid", "over one of rigid links, in turn", ".2f"),
        Column("coordinates", "numbers of a position", ".0f"),
        Column("multipliers", "multipliers", ".0f"), Column("bytes", "bytes of arrays", ".0f"), NOTE,
    )),
    "elasticity": ("CPU time of other elasticities over that of (11)-(15), no vehicle", (
        CASE, Column("links", "links", ".0f"), Column("evaluation", "of an evaluation", ".2f"),
        Column("step", "of an implicit step", ".2f"), NOTE,
    )),
    "exponent": ("Fitted exponents over the links", (
        CASE, Column("exponent_evaluation", "of an evaluation", ".2f"), Column("exponent_step", "of a step", ".2f"),
        Column("exponent_bytes", "of storage", ".2f"),
    )),
    "violation": ("Largest violation of joints over the run", (
        CASE, *(Column(f"{level}_{key}", f"{word}, {unit}", ".1e")
                for key, word, units in (("gap", "gap", ("m", "m/s", "m/s2")),
                    ("tilt", "tilt", ("rad", "rad/s", "rad/s2")),
                    ("cut", "gap of the cut", ("m", "m/s", "m/s2")))
                for level, unit in zip(("position", "velocity", "acceleration"), units, strict=True)),
        NOTE,
    )),
    "count": ("Joints and equations, counted", (
        Column("case", "what"), Column("value", "found", ".0f"), Column("reference", "expected", ".0f"),
        Column("ok", "ok"),
    )),
    "effect": ("What inertia does, and what elasticity does: relative differences of two runs", (
        Column("case", "the runs differ in"), Column("force", "first joint's force, 2 to 8 s", ".2%"),
        Column("tension", "tensions at 5 s", ".2%"),
        *(Column(name, name.replace("_", " "), ".3%") for name in effects.OBSERVABLES), NOTE,
    )),
    "motion": ("Chassis motion, relative difference from the closed mesh", (
        CASE, *(Column(name, name, ".1e") for name in whole_runs.MOTION), Column("settled", "settled, m", ".4f"),
        Column("follows", "speed less the sprockets', RMS", ".3f"), NOTE,
    )),
    "spectrum": ("First joint's force in explicit steps that resolve the links' modes", (
        CASE, Column("piece", "s from t = 4 s", "g"), Column("step", "stable step, s", ".2e"),
        Column("contact", "link between ground and wheel, Hz", ".3g"),
        Column("wave", "wave round the chain, Hz", ".3g"),
        Column("fastest", "fastest mode of a link, Hz", ".3g"),
        Column("peak", f"largest along above {high_frequencies.WAVES:g} Hz at, Hz", ".0f"),
        *(Column(f"{axis}_{low:g}", f"{axis} the chassis, RMS above {low:g} Hz, N", ".3g")
          for axis in high_frequencies.AXES for low in high_frequencies.ABOVE),
        NOTE,
    )),
    "curvature": ("Curvature at pinned ends", (
        CASE, Column("elements", "elements", ".0f"), Column("ends", "at the pins", ".4g"),
        Column("middle", "in the middle", ".4g"), Column("expected", "expected at the pins", ".4g"), Column("ok", "ok"),
    )),
    "equation": ("Equations, by the project's own elements", (
        Column("where", "section"), Column("case", "what"), Column("value", "found", ".4g"),
        Column("reference", "expected", ".4g"), Column("ok", "ok"),
    )),
    "sections": ("Mean tension of the runs of the right chain, N", (
        CASE, *(Column(f"{name}{tail}", f"{name}{words}", ".0f")
                for tail, words in (("", " at 5 s"), ("_mean", ", 4 to 6 s"), ("_hold", ", 6 to 8 s"))
                for name in whole_runs.RUNS),
        NOTE,
    )),
}  # fmt: skip
REMARKS = {
    "cost": "Paper, section 8.3: CPU time 4, evaluations 8.5 times those of the rigid model. "
    + str(pieces.__doc__)
    .split("\n\n")[1]
    .replace("``BEGIN``", f"t = {pieces.BEGIN:g} s")
    .replace("``EQUAL``", "this")
    .replace("``REPEATS``", f"{pieces.REPEATS} runs"),
    "fmus": "Both tracks together. The paper's ratios are those of the table above, of one differential equation.",
    "ratio": str(ratios.__doc__).split("\n\n")[1],
    "effect": str(effects.__doc__).split("\n\n")[1].replace("``INSTANT``", f"{INSTANT:g} s"),
    "piece": str(pieces.__doc__).split("\n\n")[2],
    "spectrum": str(high_frequencies.__doc__)
    .split("\n\n")[1]
    .replace("``RATE``", f"{high_frequencies.RATE:g} Hz")
    .replace("``SETTLING``", f"{high_frequencies.SETTLING:g} s"),
    "curvature": str(curvature.__doc__).split("\n\n")[1]
    + " Of the pinned link over the exact curvature in the middle; of the right chain's links at 5 s the largest, 1/m.",
    "run": "CPU time of all components and of the log, where the log tells it. Implicit at the scene's own steps,"
    " recursive links by Runge-Kutta.",
    "violation": "At the checkpoints of the run; what is eliminated has one number for both sides.",
    "sections": "Top: before the sprocket; rear: before the idler; front: after the sprocket.",
}


def table(item: str, rows: Sequence[Row]) -> Table:
    """Table of the rows of a kind; curvatures include those of whole runs, ratios come from other rows."""
    title, columns = TABLES[item]
    chosen = ratios.rows(rows) if item == "ratio" else [row for row in rows if row.item == item]
    if item == "curvature":
        chosen += [row for row in rows if row.item == "deformation" and row.ok]
    cells = [row.cells() for row in chosen]
    return Table.of_records(title, columns, cells, (" ".join(REMARKS[item].split()),) if item in REMARKS else ())


def verdicts(rows: Sequence[Row]) -> Table:
    """Table of the statements."""
    return Table.of_records("The paper's statements", STATEMENTS, [row.cells() for row in rows])


def write(folder: Path, name: str, judged: Sequence[Row], rows: Sequence[Row], made: Sequence[Path]) -> list[Path]:
    """Write the page, and each table as CSV; return the files. Raises OSError."""
    files = [folder / f"{name}.md", folder / f"{name}.csv"]
    parts = ["# The paper's comparison", verdicts(judged).markdown("##")]
    for item in TABLES:
        item_table = table(item, rows)
        if item_table.rows:
            parts.append(item_table.markdown("##"))
            files.append(folder / f"{name}-{item}.csv")
            files[-1].write_text(item_table.csv(), encoding="utf-8")
    crossings = [f"- {name} {value:.3g} Pa" for name, value in crossed(Results(rows)).items()]
    if crossings:
        parts.append("Flexible links cost as much as rigid ones at (0: never less; inf: always less)\n")
        parts += [*crossings, ""]
    parts += ["## Figures", *((module.__doc__ or "").split("\n\n", 1)[1] for module in (figures, conventions))]
    parts += [f"![{path.stem}]({path.name})\n" for path in made if path.suffix == ".png"]
    files[0].write_text("\n".join(parts), encoding="utf-8")
    files[1].write_text(verdicts(judged).csv(), encoding="utf-8")
    return files
