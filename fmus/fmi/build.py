"""Build of FMUs: stage the sources, describe them in one child process, pack, cache the files by content.

An FMU is described once for a shape (``numbers``): another one of that shape is a copy with its own numbers, and a run
takes one with any numbers and sets its parameters. FMUs of a shape are known by one digest, in the file SHAPE.

The child (``python -m fmus.fmi.build``) runs in the stage and imports the staged ``fmus``: an FMU that was built
therefore also loads by itself, and pythonfmu's changes of ``sys.path`` and ``sys.modules`` end with the child. The
comment of the archive holds the checksum of a cached FMU; an FMU whose checksum is wrong is built again.
"""

from __future__ import annotations

import filecmp
import hashlib
import io
import json
import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import fromstring, tostring

from fmus.cache import pack
from fmus.cache.files import (
    CHECKSUM,
    cache_folder,
    private_folder,
    read_checked,
    report_error,
    temporary_folder,
    write,
    write_checked,
)
from fmus.cache.sources import ROOT, reachable, search_path, source_hash, sources
from fmus.components import COMPONENT_KINDS, model_of
from fmus.fmi.description import experiment_attributes
from fmus.fmi.documentation import documentation, icon_beside, icon_files, key_parts, readme_beside
from fmus.fmi.terminals import terminal_files
from fmus.ground.tables import number_meanings
from fmus.interface import numbers
from fmus.interface.defaults import EXPERIMENT, KEY, all_ports, experiment
from fmus.interface.model import InvalidParameter
from fmus.interface.numbers import MEANINGS
from fmus.interface.ports import Port

DIGITS = 24  # of the name of a folder in the cache
INCLUDED = ("pythonfmu",)  # distribution of which an FMU has the wrapper and the sources
CONFIG = "config.json"  # file of an FMU's resources with the argument of its model
SHAPE = "shape.txt"  # file of its resources with the digest of its sources and its shape
DESCRIPTION = "modelDescription.xml"
Product = tuple[str, Mapping[str, Any], str | None]  # kind of component, config, stem of the FMU's file


class BuildFailed(RuntimeError):
    """An FMU could not be built; the message is one sentence."""


class Shell(NamedTuple):
    """A script with a subclass of ``Slave``, its configuration and the stem of the FMU's file."""

    script: Path
    config: Mapping[str, Any]
    stem: str
    shape: Mapping[str, Any] | None = None  # config without what is a parameter; None: the config


def build(kind: str, config: Mapping[str, Any], folder: Path | None = None, name: str | None = None) -> Path:
    """Path of the FMU of a kind of component, built unless the cache has it.

    ``config`` (JSON) is the argument of the component's model. The file is called ``name``.fmu (default: the kind) and
    lies in the cache, or in ``folder`` if one is given. Raises BuildFailed.
    """
    return build_all([(kind, config, name)], folder)[0]


def build_all(products: Sequence[Product], folder: Path | None = None) -> list[Path]:
    """Paths of the FMUs of products (kind, config, name), in order; see ``build``. Raises BuildFailed."""
    shapes = build_shapes(products)

    def built(product: Product, shape: Path) -> Path:
        kind, config, name = product
        packed = packed_config(kind, config)
        key = hashlib.sha256(f"{shape.parent.name} {json_text(packed, kind)}".encode()).hexdigest()[:24]
        return build_once(key, f"{name or kind}.fmu", lambda: _with_numbers(shape, kind, packed), folder)

    return [built(product, shape) for product, shape in zip(products, shapes, strict=True)]


def build_shapes(products: Sequence[Product]) -> list[Path]:
    """Paths of FMUs of the shapes of products, in order, whose parameters have any values; see ``build_all``.

    An instance with all ``start_values`` of a product is one of the FMU of the product. Raises BuildFailed.
    """
    shells = []
    for kind, config, _ in products:
        own = {key: value for key, value in packed_config(kind, config).items() if key not in (KEY, EXPERIMENT)}
        shells.append(Shell(ROOT / COMPONENT_KINDS[kind], own, kind, numbers.shape(own)))
    return build_shells(shells)


class StartValues(NamedTuple):
    """Start values of the FMU of a component."""

    parameters: dict[str, float | int | str]  # all, by name
    inputs: list[float]  # in their order


def start_values(kind: str, config: Mapping[str, Any]) -> StartValues:
    """Start values of the FMU of a kind of component with a config; raises BuildFailed."""
    ports = _configured(kind, packed_config(kind, config))
    parameters = {port.name: port.start for port in ports if port.causality == "parameter"}
    return StartValues(parameters, [float(port.start) for port in ports if port.causality == "input"])


def packed_config(kind: str, config: Mapping[str, Any]) -> dict[str, Any]:
    """Config as an FMU has it: of the vehicle, the keys that its model reads."""
    if kind not in COMPONENT_KINDS:
        raise BuildFailed(f"no kind of component is called '{kind}': there are {', '.join(COMPONENT_KINDS)}")
    return numbers.packed(config, model_of(kind).reads(config))


def _configured(kind: str, config: Mapping[str, Any]) -> tuple[Port, ...]:
    """Ports of the FMU of a kind of component with a packed config; raises BuildFailed."""
    try:
        return all_ports(model_of(kind)(config).ports, config, number_meanings())
    except InvalidParameter as error:
        raise BuildFailed(f"cannot build {Path(COMPONENT_KINDS[kind]).stem}: {error}") from None


def _with_numbers(fmu: Path, kind: str, config: Mapping[str, Any]) -> bytes:
    """Bytes of an FMU, without checksum, with the numbers and parameters of a config, from one of its shape."""
    starts = {port.name: port.start for port in _configured(kind, config)}
    with zipfile.ZipFile(fmu) as stored:
        files = {name: stored.read(name) for name in stored.namelist()}
    root = fromstring(files[DESCRIPTION])
    for variable in root.iter("ScalarVariable"):
        name, (kind_of_value,) = variable.get("name", ""), variable
        if "start" in kind_of_value.attrib and name in starts:
            start = starts[name]
            kind_of_value.set("start", start if isinstance(start, str) else repr(start))
    for times in root.iter("DefaultExperiment"):
        times.attrib |= experiment_attributes(experiment(config))
    files[DESCRIPTION] = tostring(root, encoding="utf-8", xml_declaration=True)
    return archive({**files, f"resources/{CONFIG}": json_text(config, kind).encode()})


def build_shell(
    script: Path,
    config: Mapping[str, Any],
    folder: Path | None = None,
    name: str | None = None,
    packages: Sequence[Path] = (),
) -> Path:
    """Path of the FMU of a shell, built unless the cache has it.

    ``packages`` are the source folders that the shell imports besides ``fmus``. Raises BuildFailed.
    """
    return build_shells([Shell(script, config, name or script.stem)], folder, packages)[0]


def build_shells(shells: Sequence[Shell], folder: Path | None = None, packages: Sequence[Path] = ()) -> list[Path]:
    """Paths of the FMUs of shells, in order; see ``build_shell``. Raises BuildFailed.

    Those that the cache lacks are described by one child, because a child takes 2 s to start; their scripts have names
    of their own.
    """
    keys = [_digest(shell, packages)[:DIGITS] for shell in shells]
    distinct = dict(zip(keys, shells, strict=True))
    packed: dict[str, bytes] = {}

    def pack(wanted: str) -> bytes:
        if wanted not in packed:
            lacking = {key: shell for key, shell in distinct.items() if key == wanted or not _is_cached(key, shell)}
            with tempfile.TemporaryDirectory(prefix="cotrack-") as stage:
                packed.update(zip(lacking, _pack(Path(stage), [*lacking.values()], packages), strict=True))
        return packed[wanted]

    return [
        build_once(key, f"{shell.stem}.fmu", partial(pack, key), folder)
        for key, shell in zip(keys, shells, strict=True)
    ]


def _digest(shell: Shell, packages: Sequence[Path]) -> str:
    """Digest of sources and shape of an FMU, whose beginning names its folder in the cache; raises BuildFailed."""
    script = shell.script
    if not script.is_file():
        raise BuildFailed(f"no FMU shell at {script}")
    shape = json_text(shell.config if shell.shape is None else shell.shape, script.stem)
    parts = [
        version("pythonfmu"),
        source_hash(),
        pack.identity(),
        script.name,
        script.read_text(encoding="utf-8"),
        shape,
    ]
    parts += [f"{package.name} {source_hash(package)}" for package in packages]
    parts += [*key_parts(readme_beside(script), INCLUDED), icon_beside(script).hex()]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def json_text(config: Mapping[str, Any], name: str) -> str:
    """Config of ``name`` as JSON with sorted keys; raises BuildFailed."""
    try:
        return json.dumps(config, sort_keys=True, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise BuildFailed(f"the configuration of {name} is not JSON: {error}") from None


def _is_cached(key: str, shell: Shell) -> bool:
    try:
        return read_checked(cache_folder() / "fmus" / key / f"{shell.stem}.fmu") is not None
    except OSError:
        return False


def build_once(key: str, file: str, pack: Callable[[], bytes], folder: Path | None = None, kind: str = "fmus") -> Path:
    """Path of the FMU ``file``, or of another ``kind`` of file, in the cache, or in ``folder``.

    ``pack`` returns its bytes; it is called unless the cache has the file under ``key``. A checksum follows them in the
    cache. Raises BuildFailed.
    """

    def cached_in(cache: Path) -> Path:
        path = private_folder(cache / kind / key) / file
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


def identity(file: Path) -> str:
    """Digest of the content of an FMU; of one that was built here, of its sources and its shape. Raises OSError."""
    if built_here(file):
        with zipfile.ZipFile(file) as fmu, suppress(KeyError):
            return fmu.read(f"resources/{SHAPE}").decode()
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def built_here(file: Path) -> bool:
    """Whether a file is a copy of an FMU that was built here: its bytes are those of one in the cache."""
    with suppress(OSError):
        status = file.stat()
        if file.parent.parent == cache_folder() / "fmus":
            return True
        return _is_cached_content(file, status.st_size, status.st_mtime_ns)
    return False


@lru_cache(maxsize=16)
def _is_cached_content(file: Path, size: int, changed: int) -> bool:
    built = (each for each in cache_folder().glob("fmus/*/*.fmu") if each.stat().st_size == size)
    return any(filecmp.cmp(each, file, shallow=False) for each in built)


def _pack(stage: Path, shells: Sequence[Shell], packages: Sequence[Path]) -> Iterator[bytes]:
    """Bytes of FMUs without the checksum; raises BuildFailed."""
    tree = stage / "tree"
    for package in (ROOT, *packages):
        for source in sources(package):
            target = tree / package.name / source.relative_to(package)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)
    (tree / "build.txt").write_text(source_hash(tree / ROOT.name), encoding="utf-8")
    (tree / MEANINGS).write_text(json.dumps(number_meanings()), encoding="utf-8")
    for script in {shell.script for shell in shells}:
        shutil.copyfile(script, tree / script.name)
    described = [stage / f"{place}.fmu" for place in range(len(shells))]
    child_input = {
        "shells": [
            {
                "script": shell.script.name,
                CONFIG: json_text(shell.config, shell.script.stem),
                SHAPE: _digest(shell, packages),
                "target": str(target),
            }
            for shell, target in zip(shells, described, strict=True)
        ],
        "project": [ROOT.name, *(package.name for package in packages), CONFIG, SHAPE, MEANINGS, "build.txt"],
    }
    child = subprocess.run(
        [sys.executable, "-m", "fmus.fmi.build"],
        input=json.dumps(child_input),
        text=True,
        capture_output=True,
        cwd=tree,
        # a description computes little: compiling for it would take longer
        env={**os.environ, "PYTHONPATH": search_path(tree), "PYTHONDONTWRITEBYTECODE": "1", "NUMBA_DISABLE_JIT": "1"},
    )
    if child.returncode:
        stems = dict.fromkeys(shell.script.stem for shell in shells)
        last = (child.stderr.strip() or "no message").splitlines()[-1]
        if not last.startswith(tuple(f"{stem}: " for stem in stems)):  # the child failed between the shells
            last = f"{', '.join(stems)}: {last}"
        raise BuildFailed(f"cannot build {last}")
    for shell, target in zip(shells, described, strict=True):
        with zipfile.ZipFile(target) as fmu:
            files = {name: fmu.read(name) for name in fmu.namelist()}
        if kernels := pack.part(reachable(shell.script.stem, shell.script)):
            files[f"resources/{ROOT.name}/{pack.NAME}"] = kernels
        files |= documentation(files[DESCRIPTION], readme_beside(shell.script), INCLUDED)
        yield archive(files | icon_files(shell.script, 2) | terminal_files(files[DESCRIPTION]))


def archive(files: Mapping[str, bytes], comment: bytes = bytes(CHECKSUM)) -> bytes:
    """Bytes of a zip archive without its comment; equal files give equal bytes (fixed order, no times).

    By default the comment is the space of the checksum, which the cache adds.
    """
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as target:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            target.writestr(entry, files[name])
        target.comment = comment
    return packed.getvalue()[: packed.tell() - len(comment)]


def _child() -> None:
    from pythonfmu.builder import FmuBuilder

    child_input = json.load(sys.stdin)
    for shell in child_input["shells"]:
        script = Path(shell["script"])
        for name in (CONFIG, SHAPE):
            Path(name).write_text(shell[name], encoding="utf-8")
        try:
            FmuBuilder.build_FMU(script.absolute(), dest=shell["target"], project_files=child_input["project"])
        except Exception as error:
            kind = "" if type(error).__name__ == "RefusedCall" else f"{type(error).__name__}: "
            sys.exit(f"{script.stem}: {kind}{(str(error).splitlines() or ['no message'])[-1]}")


if __name__ == "__main__":
    _child()
