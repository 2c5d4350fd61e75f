"""Sources of a tree, and hashes of them: of all, and of those that a module reaches by imports."""

from __future__ import annotations

import ast
import hashlib
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import cache, lru_cache
from importlib.util import resolve_name
from pathlib import Path
from threading import Lock
from typing import NamedTuple

from fmus.cache.files import cached_result

ROOT = Path(__file__).resolve().parents[1]  # the fmus tree this process runs
PARSING = Lock()  # Python 3.11 counts the depth of a tree for all threads together


def sources(root: Path = ROOT) -> list[Path]:
    """Python sources below ``root``, in a fixed order."""
    return sorted(root.rglob("*.py"), key=lambda path: path.relative_to(root).as_posix())


def search_path(first: Path) -> str:
    """PYTHONPATH with which a child process finds what is in ``first``, and else what this process finds.

    Folders of FMUs that this process has loaded, ours or not, which pythonfmu adds to its path, are left out: their
    pythonfmu has no wrappers, so FMUs that are built with it have no binaries.
    """
    others = (each for each in sys.path if not (Path(each).parent / "modelDescription.xml").exists())
    return os.pathsep.join([str(first), *others])


def source_hash(root: Path = ROOT) -> str:
    """Hash of all Python sources of a tree, by relative path and content; it identifies a build."""
    return _hash_of(root, tuple(sorted(_states(os.fspath(root)))))


def _states(folder: str) -> Iterator[tuple[str, int, int]]:
    """Yield path, time of the last change in ns, and size of each Python source below a folder: a run asks often."""
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir():
                yield from _states(entry.path)
            elif entry.name.endswith(".py"):
                status = entry.stat()
                yield entry.path, status.st_mtime_ns, status.st_size


@lru_cache(maxsize=4)
def _hash_of(root: Path, files: tuple[tuple[str, int, int], ...]) -> str:
    """Hash of the Python sources of a tree, computed again when one of the ``files`` (see ``_states``) changes."""
    digest = hashlib.sha256()
    for path in sources(root):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0")
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def _statements(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    for statement in body:
        yield statement
        for name in ("body", "orelse", "finalbody"):
            yield from _statements(getattr(statement, name, []))
        for handler in getattr(statement, "handlers", []):
            yield from _statements(handler.body)


class _Source(NamedTuple):
    digest: bytes
    imports: Sequence[str]


@cache
def _source(path: Path, package: str) -> _Source:
    """Digest of a source of a package, and what it imports: read once in a process."""
    content = path.read_bytes()
    known = _own_imports().get(path.relative_to(ROOT).as_posix()) if path.is_relative_to(ROOT) else None
    return _Source(hashlib.sha256(content).digest(), _imports(content, package) if known is None else known)


@cache
def _own_imports() -> Mapping[str, Sequence[str]]:
    """Imports of all sources below ROOT by relative path, parsed once for a build: parsing takes half a second."""

    def parsed() -> dict[str, list[str]]:
        files = ((path, path.relative_to(ROOT)) for path in sources())
        return {name.as_posix(): _imports(path.read_bytes(), ".".join([ROOT.name, *name.parent.parts]))
                for path, name in files}  # fmt: skip

    imports: Mapping[str, Sequence[str]] = cached_result("contents", "imports", [source_hash()], parsed)
    return imports


def _imports(content: bytes, package: str) -> list[str]:
    """Absolute names that a source of a package imports; of ``from a import b`` both ``a`` and ``a.b``.

    The modules that a class names by ``implemented_in`` are among them.
    """
    names_found: list[str] = []
    with PARSING:
        tree = ast.parse(content)
    for statement in _statements(tree.body):
        if isinstance(statement, ast.Import):
            names_found += [alias.name for alias in statement.names]
        elif isinstance(statement, ast.ImportFrom):
            parents = package.split(".")[: len(package.split(".")) - statement.level + 1] if statement.level else []
            base = ".".join([*parents, *filter(None, [statement.module])])
            names_found += [base, *(f"{base}.{alias.name}" for alias in statement.names)]
        elif isinstance(statement, ast.ClassDef):
            calls = [each for each in statement.decorator_list if ast.unparse(each).startswith("implemented_in(")]
            names = [ast.literal_eval(keyword.value) for call in calls for keyword in call.keywords]  # type: ignore[attr-defined]
            names_found += [resolve_name(name, package) for name in names]
    return names_found


@cache
def _locate(module: str, folder: Path) -> Path | None:
    """Source of a module, not imported: in ``folder``, else in that of its loaded package.

    A tool may delete the folder of a freed FMU, and with it the loaded package; ``folder`` then has the source.
    """
    top, *parts = module.split(".")
    for root in (folder / top, *getattr(sys.modules.get(top), "__path__", ())):
        base = Path(root).joinpath(*parts)
        for path in (base / "__init__.py", base.with_name(f"{base.name}.py")):
            if path.is_file():
                return path
    return None


@cache
def reachable(module: str, path: Path) -> Mapping[str, bytes]:
    """Digests by module of the source at ``path`` and of all it reaches by imports within its package and ``fmus``."""
    packages = {module.partition(".")[0], "fmus"}
    folder = path.parents[module.count(".") + (path.name == "__init__.py")]
    paths: dict[str, Path] = {module: path}
    digests: dict[str, bytes] = {}
    pending = [module]
    while pending:
        name = pending.pop()
        source = paths[name]
        package = name if source.name == "__init__.py" else name.rpartition(".")[0]
        digests[name], imports = _source(source, package)
        for imported in (package, *imports):
            parts = imported.split(".")
            if parts[0] not in packages:
                continue
            for depth in range(1, len(parts) + 1):  # importing a.b.c runs a and a.b too
                parent = ".".join(parts[:depth])
                if parent not in paths and (source_path := _locate(parent, folder)) is not None:
                    paths[parent] = source_path
                    pending.append(parent)
    return digests


@cache
def reachable_hash(module: str, path: Path) -> str:
    """Hash of what is ``reachable``."""
    digest = hashlib.sha256()
    for name, source in sorted(reachable(module, path).items()):
        digest.update(name.encode() + b"\0" + source)
    return digest.hexdigest()
