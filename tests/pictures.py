"""Pictures of the pages, made again by ``python -m tests.pictures [NAME ...]``.

A picture is drawn from a run of the gallery by a command, or from the table of errors and run times. ``pictures.json``
has for each the hash of what draws it: the code of the named modules without comments and docstrings, and files of
data. ``test_pictures.py`` compares it with the present ones.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from orchestrator.execution import precision
from orchestrator.results import output_files
from orchestrator.studies import error_runtime

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "orchestrator" / "studies" / "pictures"
HASHES = FOLDER / "pictures.json"
VIEWS = "orchestrator/results/views"
ERRORS = ("orchestrator/studies/error_runtime.py", "orchestrator/gallery/precision.json")


class Picture(NamedTuple):
    """How a picture is made in an empty folder, and the files and folders of code and data that draw it."""

    make: Callable[[Path, Path], None]  # of the picture's path and of the folder
    sources: tuple[str, ...]


def drawn(run: str, draw: str) -> Picture:
    """Picture that ``cotrack view`` draws of a run."""

    def make(path: Path, folder: Path) -> None:
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        for words in (f"run {run} --no-estimate -o log.mcap", f"view log.mcap {draw} -o {shlex.quote(str(path))}"):
            command = [sys.executable, "-m", "orchestrator", *shlex.split(words)]
            done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
            if not (folder / "log.mcap").exists() or (done.returncode and words.startswith("view")):
                raise SystemExit(f"{path.name}: {done.stderr}")

    return Picture(make, (VIEWS,))


def errors(scene: str) -> Picture:
    """Error over run time of a scene, from the table that ``cotrack run --error`` reads."""

    def make(path: Path, folder: Path) -> None:
        rows = [row for row in precision.read(precision.SHIPPED) if row.scene == scene]
        output_files.save_figure(error_runtime.draw(rows, f"{scene}: error over run time"), path)

    return Picture(make, ERRORS)


PICTURES = {
    "straight.png": drawn("straight", "--at 1 --at 4 --at 8"),
    "error-over-run-time.png": errors("straight"),
    "turn-above.png": drawn("turn", "--above"),
    "turn-corner.gif": drawn("turn", "--seen-from corner --from 5 --to 6.5"),
    "serpentine-above.png": drawn("serpentine", "--above"),
    "marder-corner.png": drawn("marder", "--seen-from corner --at 3"),
    "elevated_sprocket-corner.png": drawn("elevated_sprocket", "--seen-from corner --at 3"),
    "snow-corner.png": drawn("snow", "--seen-from corner --at 3"),
}


def source_hash(picture: Picture) -> str:
    """Hash of what draws a picture."""
    files = [path for name in picture.sources for path in sorted((ROOT / name).rglob("*.py")) or [ROOT / name]]
    return hashlib.sha256("".join(map(_content, files)).encode()).hexdigest()[:20]


def _content(file: Path) -> str:
    text = file.read_text(encoding="utf-8")
    if file.suffix != ".py":
        return text
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body = node.body[1:]
    return ast.dump(tree)


def main() -> None:
    """Make the named pictures, by default all, and note what drew them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", choices=[*PICTURES, []], metavar="NAME", help="default: all")
    hashes = json.loads(HASHES.read_text()) if HASHES.exists() else {}
    for name in parser.parse_args().names or PICTURES:
        with tempfile.TemporaryDirectory() as folder:
            PICTURES[name].make(FOLDER / name, Path(folder))
        hashes[name] = source_hash(PICTURES[name])
        HASHES.write_text(json.dumps(hashes, indent=1, sort_keys=True) + "\n")
        print(name, (FOLDER / name).stat().st_size)


if __name__ == "__main__":
    main()
