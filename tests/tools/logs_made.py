"""A small log and its exports, for the scripts of this folder about logs."""

import subprocess
import sys
from pathlib import Path


def log() -> Path:
    """Log of a second of ``spinning_loop`` in the folder of the command line."""
    if len(sys.argv) != 2:
        raise SystemExit(f"usage: {sys.argv[0]} FOLDER")
    file = Path(sys.argv[1]).resolve() / "loop.mcap"
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        command("run", "spinning_loop", "--stop", "1", "--log", file)
    return file


def exported(file: Path, form: str) -> Path:
    """The outputs of the chain in one file."""
    command("log", "export", file, "--as", form, "--topic", "/chain/out", "-o", file.parent / form)
    return file.parent / form / f"chain.out.{form}"


def command(*words: object) -> None:
    """Run a command of cotrack."""
    subprocess.run([sys.executable, "-m", "orchestrator", *map(str, words)], check=True, stdout=subprocess.DEVNULL)
