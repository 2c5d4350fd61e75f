"""Build of FMUs: stage the sources, describe them in a child process, pack, cache the file by content.

The child (``python -m fmus.build``) runs in the stage and imports the staged ``fmus``: an FMU that was built therefore
also loads by itself, and pythonfmu's changes of ``sys.path`` and ``sys.modules`` end with the child. The comment of the
archive holds the checksum of a cached FMU; an FMU whose checksum is wrong is built again.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from fmus.cache import (
    CHECKSUM,
    cache_folder,
    private_folder,
    read_checked,
    report_error,
    temporary_folder,
    write,
    write_checked,
)
from fmus.components import KINDS
from fmus.documentation import documentation, key_parts, readme_beside
from fmus.jit import ROOT, source_hash, sources

INCLUDED = ("pythonfmu",)  # distribution of which an FMU has the wrapper and the sources


class BuildFailed(RuntimeError):
    """An FMU could not be built; the message is one sentence."""


def build(kind: str, config: Mapping[str, Any], folder: Path | None = None, name: str | None = None) -> Path:
    """Path of the FMU of a kind of component, built unless the cache has it.

    ``config`` (JSON) is the argument of the component's model. The file is called ``name``.fmu (default: the kind) and
    lies in the cache, or in ``folder`` if one is given. Raises BuildFailed.
    """
    if kind not in KINDS:
        raise BuildFailed(f"no kind of component is called '{kind}': there are {', '.join(KINDS)}")
    return build_shell(ROOT / KINDS[kind], config, folder, name or kind)


def build_shell(
    script: Path,
    config: Mapping[str, Any],
    folder: Path | None = None,
    name: str | None = None,
    packages: Sequence[Path] = (),
) -> Path:
    """Path of the FMU of a shell (script with a subclass of `Slave`), built unless the cache has it.

    ``packages`` are the source folders that the shell imports besides ``fmus``. Raises BuildFailed.
    """
    try:
        text = json.dumps(config, sort_keys=True, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise BuildFailed(f"the configuration of {script.stem} is not JSON: {error}") from None
    if not script.is_file():
        raise BuildFailed(f"no FMU shell at {script}")
    parts = [version("pythonfmu"), source_hash(), script.name, script.read_text(encoding="utf-8"), text]
    parts += [f"{package.name} {source_hash(package)}" for package in packages]
    parts += key_parts(readme_beside(script), INCLUDED)
    key = hashlib.sha256("\0".join(parts).encode()).hexdigest()[:24]

    def pack() -> bytes:
        with tempfile.TemporaryDirectory(prefix="cotrack-") as stage:
            return _pack(Path(stage), script, text, packages)

    return build_once(key, f"{name or script.stem}.fmu", pack, folder)


def build_once(key: str, file: str, pack: Callable[[], bytes], folder: Path | None = None) -> Path:
    """Path of the FMU ``file`` in the cache, or in ``folder``.

    ``pack`` returns its bytes; it is called unless the cache has the file under ``key``. Raises BuildFailed.
    """

    def cached_in(cache: Path) -> Path:
        path = private_folder(cache / "fmus" / key) / file
        if read_checked(path) is None:
            content = pack()
            if read_checked(path) is None:  # another process may have built the same: its file stays
                write_checked(path, content)
        return path

    try:
        try:
            path = cached_in(cache_folder())
        except OSError as error:
            report_error(error)
            path = cached_in(temporary_folder())
        if folder is None:
            return path
        folder.mkdir(parents=True, exist_ok=True)
        write(folder / file, path.read_bytes())
        return folder / file
    except OSError as error:
        raise BuildFailed(f"cannot build {file}: {error}") from None


def _pack(stage: Path, script: Path, config: str, packages: Sequence[Path]) -> bytes:
    """Bytes of the FMU without the checksum; raises BuildFailed."""
    tree = stage / "tree"
    for package in (ROOT, *packages):
        for source in sources(package):
            target = tree / package.name / source.relative_to(package)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)
    shutil.copyfile(script, tree / script.name)
    (tree / "config.json").write_text(config, encoding="utf-8")
    (tree / "build.txt").write_text(source_hash(tree / ROOT.name), encoding="utf-8")
    child_input = {
        "script": script.name,
        "project": [ROOT.name, *(package.name for package in packages), "config.json", "build.txt"],
        "target": str(stage / "described.fmu"),
    }
    child = subprocess.run(
        [sys.executable, "-m", "fmus.build"],
        input=json.dumps(child_input),
        text=True,
        capture_output=True,
        cwd=tree,
        env={**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"},
    )
    if child.returncode:
        last = (child.stderr.strip() or "no message").splitlines()[-1]
        raise BuildFailed(f"cannot build {script.stem}: {last.removeprefix('fmus.slave.Refused: ')}")
    with zipfile.ZipFile(str(child_input["target"])) as described:
        files = {name: described.read(name) for name in described.namelist()}
    return archive(files | documentation(files["modelDescription.xml"], readme_beside(script), INCLUDED))


def archive(files: Mapping[str, bytes]) -> bytes:
    """Bytes of a zip archive without its checksum; equal files give equal bytes (fixed order, no times)."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as target:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            target.writestr(entry, files[name])
        target.comment = bytes(CHECKSUM)  # space for the checksum
    return packed.getvalue()[:-CHECKSUM]


def _child() -> None:
    from pythonfmu.builder import FmuBuilder

    child_input = json.load(sys.stdin)
    FmuBuilder.build_FMU(
        Path(child_input["script"]).absolute(), dest=child_input["target"], project_files=child_input["project"]
    )


if __name__ == "__main__":
    _child()
