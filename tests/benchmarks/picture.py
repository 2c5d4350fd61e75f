"""Picture of the part ``chain``: error over CPU time of all codes, a pane a chain.

python -m tests.benchmarks --only chain --json > chain.txt
python -m tests.benchmarks.picture chain.txt error-runtime-chains.png
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from orchestrator.results.output_files import Picture, new_figure
from tests.benchmarks.chain import LAYERS

MARKERS = {"ours": "o", "Exudyn": "s", "MuJoCo": "^", "Pinocchio": "D"}  # by the first word of a code
FASTEST = 1e-12  # errors below it are rounding


def draw(rows: Sequence[dict[str, Any]]) -> Picture:
    """Draw the rows of the part's first table, without those of its layers and of the ground."""
    shown = [row for row in rows if row["code"] not in LAYERS and "ground" not in row["case"]]
    cases, codes = (list(dict.fromkeys(row[key] for row in shown)) for key in ("case", "code"))
    figure = new_figure(4.6 * len(cases), 5.6)
    colours = {code: f"C{k % 10}" for k, code in enumerate(codes)}
    drawn = {}
    for pane, case in zip(figure.subplots(1, len(cases), squeeze=False)[0], cases, strict=True):
        for code in codes:
            points = [(row["cpu"], row["error"]) for row in shown if (row["case"], row["code"]) == (case, code)]
            if points:
                marker = MARKERS[code.split(",")[0].split(" ")[0]]
                line = "-" if code.startswith("ours") else "--"
                (drawn[code],) = pane.loglog(*zip(*points, strict=True), line, marker=marker, ms=4, color=colours[code])
        pane.set(title=case, xlabel="CPU ms a simulated second")
        pane.set_ylim(bottom=FASTEST, top=1e-1)
        pane.grid(alpha=0.3)
    figure.axes[0].set_ylabel("RMS error of the pins over their way")
    figure.legend(drawn.values(), drawn, loc="outside lower center", ncols=4, fontsize=8)
    return figure


if __name__ == "__main__":
    result = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8").splitlines()[-1])
    draw(result["parts"]["chain"][0]["rows"]).savefig(sys.argv[2], dpi=100)
