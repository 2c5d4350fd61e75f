"""One page: the verdicts, then the tables and figures behind them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from orchestrator.studies.paper import conventions, figures, pieces, through_fmus, whole_runs
from orchestrator.studies.paper.statements import Found, crossed
from orchestrator.studies.tables import Column, Row, Table, to_csv, to_markdown

CASE = Column("case", "model")
NOTE = Column("note", "note")
STATEMENTS = (
    Column("where", "section"), Column("case", "statement"), Column("verdict", "verdict"),
    Column("measured", "measured"), Column("seen", "shown by"),
)  # fmt: skip
TABLES = {  # item: title, columns
    "run": ("Whole runs, 0 to 8 s", (
        CASE, Column("cpu", "CPU time of the run, s", ".2f"), Column("evaluations", "evaluations", ".0f"),
        Column("steps", "internal steps", ".0f"), Column("ok", "ok"), NOTE,
    )),
    "cost": (f"The cheapest explicit run within an error of {pieces.EQUAL:g}", (
        CASE, Column("method", "method"), Column("setting", "tolerance, or part of the stable step", ".3g"),
        Column("piece", "piece, s", "g"), Column("cpu", "CPU time, s", ".3f"),
        Column("evaluations", "evaluations", ".0f"), Column("each", "CPU time of an evaluation, s", ".2e"),
        Column("storage", "bytes of a chain's arrays", ".0f"), Column("error", "error of pins", ".1e"),
        Column("order", "mean order", ".1f"), NOTE,
    )),
    "piece": ("All explicit runs", (
        CASE, Column("method", "method"), Column("setting", "tolerance, or part of the stable step", ".3g"),
        Column("cpu", "CPU time, s", ".3f"), Column("evaluations", "evaluations", ".0f"),
        Column("error", "error of pins", ".1e"), Column("order", "mean order", ".1f"), NOTE,
    )),
    "fmus": (f"Adams' methods inside FMUs, which restart at each communication step, at {through_fmus.TOLERANCE:g}", (
        CASE, Column("piece", "s from t = 4 s", "g"), Column("evaluations", "evaluations a simulated second", ".0f"),
        Column("steps", "steps", ".0f"), Column("restarts", "restarts", ".0f"), NOTE,
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
        Column("step", "of an implicit step, s", ".2e"), Column("coordinates", "numbers of a position", ".0f"),
        Column("multipliers", "multipliers", ".0f"), Column("bytes", "bytes of arrays", ".0f"), NOTE,
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
    "motion": ("Chassis motion, relative difference from the closed mesh", (
        CASE, *(Column(name, name, ".1e") for name in whole_runs.MOTION), Column("settled", "settled, m", ".4f"),
        Column("follows", "speed less the sprockets', RMS", ".3f"), NOTE,
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
    + str(pieces.__doc__).split("\n\n")[1].replace("``BEGIN``", f"t = {pieces.BEGIN:g} s").replace("``EQUAL``", "this"),
    "fmus": "Both tracks together. The paper's ratios are those of the table above, of one differential equation.",
    "run": "CPU time of all components and of the log, where the log tells it. Implicit at the scene's own steps,"
    " recursive links by Runge-Kutta.",
    "violation": "At the checkpoints of the run; what is eliminated has one number for both sides.",
    "sections": "Top: before the sprocket; rear: before the idler; front: after the sprocket.",
}


def table(item: str, rows: Sequence[Row]) -> Table:
    """The rows of a kind."""
    title, columns = TABLES[item]
    cells = [row.cells() for row in rows if row.item == item]
    return Table(title, columns, cells, (" ".join(REMARKS[item].split()),) if item in REMARKS else ())


def verdicts(rows: Sequence[Row]) -> Table:
    """The statements."""
    return Table("The paper's statements", STATEMENTS, [row.cells() for row in rows])


def write(folder: Path, name: str, judged: Sequence[Row], rows: Sequence[Row], made: Sequence[Path]) -> list[Path]:
    """The page, and each table as CSV; raises OSError."""
    files = [folder / f"{name}.md", folder / f"{name}.csv"]
    parts = ["# The paper's comparison", to_markdown(verdicts(judged), "##")]
    for item in TABLES:
        found = table(item, rows)
        if found.rows:
            parts.append(to_markdown(found, "##"))
            files.append(folder / f"{name}-{item}.csv")
            files[-1].write_text(to_csv(found), encoding="utf-8")
    crossings = [f"- {name} {value:.3g} Pa" for name, value in crossed(Found(rows)).items()]
    if crossings:
        parts.append("Flexible links cost as much as rigid ones at (0: never less; inf: always less)\n")
        parts += [*crossings, ""]
    parts += ["## Figures", *((module.__doc__ or "").split("\n\n", 1)[1] for module in (figures, conventions))]
    parts += [f"![{path.stem}]({path.name})\n" for path in made if path.suffix == ".png"]
    files[0].write_text("\n".join(parts), encoding="utf-8")
    files[1].write_text(to_csv(verdicts(judged)), encoding="utf-8")
    return files
