"""The walls of the project: allowed imports, and the shape of its folders."""

import ast
import re
import subprocess
import sys
from functools import cache
from importlib.util import resolve_name
from pathlib import Path

import pytest

from fmus import components

ROOT = Path(__file__).parents[1]
FMUS = ROOT / "fmus"
ORCHESTRATOR = ROOT / "orchestrator"
COMPONENTS = [components.folder(kind) for kind in components.KINDS]
BASES = {"fmus.track_rigid", "fmus.track_rigid.model"}  # from which another kind of track may derive its model

# Packages of the orchestrator by level: each imports only from levels below its own, anywhere in its modules.
STOREYS = (
    ("files", "vocabulary"), ("kernels",), ("log",), ("cosim",), ("scene", "results", "fmu_check"), ("execution",),
    ("studies",), ("interface",), ("cli",),
)  # fmt: skip
# Rooms of fmus from the lowest: each imports only from those before its own, anywhere in its modules.
ROOMS = (
    "cache", "kernels", "physics", "interface", "start", "vehicles", "ground", "track", "components", "fmi", "drives",
    *("track_rigid", "track_flexible", "chassis", "sprocket_drive", "steering_differential", "driver"),
    *("ahead", "native", "monolith", "rest"),
)  # fmt: skip
# Modules that run any co-simulation FMU and depend on no FMU of the project.
GENERIC = [
    *(
        file.relative_to(ORCHESTRATOR).as_posix()
        for place in ("files", "kernels", "cosim/coupling", "cosim/guests", "log", "fmu_check")
        for file in sorted((ORCHESTRATOR / place).glob("*.py"))
        # a log's system.json as the project writes it; files of tests
        if file.name not in ("recorded_system.py", "tools.py", "measured_formats.py")
    ),
    *(
        f"cosim/{name}.py"
        for name in (
            "base_units",
            "component",
            "messages",
            "variable_arrays",
            "fmi2_library",
            "fmi3_library",
            "fmu_files",
            "model_description",
            "graph",
            "mixed_exchange",
            "program",
            "row_writer",
            "master",
        )
    ),
    "execution/replays.py",
]
DOORS = {
    "fmus.ahead", "fmus.cache", "fmus.cache.files", "fmus.cache.limit", "fmus.fmi.build", "fmus.fmi.saved",
    "fmus.ground.keys", "fmus.ground.soils", "fmus.ground.terrain", "fmus.interface.defaults", "fmus.interface.ports",
    "fmus.interface.units", "fmus.monolith.model", "fmus.native.pack", "fmus.rest.equilibrium", "fmus.rest.standing",
    "fmus.rest.tensioning", "fmus.start", "fmus.track.choices", "fmus.track.link_outputs", "fmus.vehicles.ranges",
    "fmus.vehicles.sides", "fmus.vehicles.tables", "fmus.vehicles.vehicle",
}  # fmt: skip
PROOF = ROOT / "tests"
TO_PHYSICS = ORCHESTRATOR / "studies" / "step_limits.py"  # predicts the limit of a link's highest frequency
AT_RUN_TIME = {"numpy", "scipy", "numba", "llvmlite", "pythonfmu", "fmus"}


@cache
def imports(source: str) -> set[str]:
    """Every module that a source imports, at any place in it."""
    modules = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports must be absolute"
            modules.add(node.module)
            modules |= {f"{node.module}.{alias.name}" for alias in node.names}
    return modules


def declared(source: str) -> set[str]:
    """Modules that the classes of a source name by ``implemented_in``."""
    calls = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)]
    named = [call for call in calls if ast.unparse(call.func) == "implemented_in"]
    return {ast.literal_eval(keyword.value) for call in named for keyword in call.keywords}


def ours(modules: set[str], package: str) -> set[str]:
    """Modules of ``package`` among the imports, without names inside a module."""
    package_modules = set()
    for module in modules:
        path = ROOT.joinpath(*module.split("."))
        if module.split(".")[0] == package and (path.with_suffix(".py").exists() or path.is_dir()):
            package_modules.add(module)
    return package_modules


def sources(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*.py"))


def reachable(module: str, seen: set[str] | None = None) -> set[str]:
    """Top-level packages that the import of a module of fmus loads, by static analysis."""
    seen = set() if seen is None else seen
    packages: set[str] = set()
    path = ROOT.joinpath(*module.split("."))
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    if module in seen or not file.exists():
        return packages
    seen.add(module)
    text = file.read_text(encoding="utf-8")
    modules = imports(text) | {resolve_name(name, module.rpartition(".")[0]) for name in declared(text)}
    for inner in ours(modules, "fmus"):
        packages |= reachable(inner, seen)
    return packages | {name.split(".")[0] for name in modules}


def test_fmus_never_look_back():
    for file in sources(FMUS):
        assert not any(name.split(".")[0] == "orchestrator" for name in imports(file.read_text())), file


def later_rooms(room: str, source: str) -> set[str]:
    """Rooms behind its own in ``ROOMS`` that a source of a room of fmus imports."""
    named = {name.split(".")[1] for name in ours(imports(source), "fmus") if "." in name}
    return {name for name in named if ROOMS.index(name) > ROOMS.index(room)}


def test_rooms_of_fmus_import_one_way():
    assert {file.relative_to(FMUS).parts[0].removesuffix(".py") for file in sources(FMUS)} == {*ROOMS, "__init__"}
    for file in sources(FMUS):
        room = file.relative_to(FMUS).parts[0].removesuffix(".py")
        if room != "__init__":
            assert later_rooms(room, file.read_text(encoding="utf-8")) == set(), file
    assert later_rooms("start", "from fmus.track import steps") == {"track"}


def others(component: str, source: str) -> set[str]:
    """Modules of other components that a source of a component imports; a kind of track may import BASES."""
    allowed = BASES if component.startswith("track_") else set()
    named = {name: name.split(".")[1] for name in ours(imports(source), "fmus") - allowed if "." in name}
    return {name for name, package in named.items() if package in COMPONENTS and package != component}


def test_every_folder_with_a_shell_is_a_component():
    assert {file.parent.name for file in FMUS.glob("*/*_fmu.py")} == set(COMPONENTS)


@pytest.mark.parametrize("component", COMPONENTS)
def test_components_do_not_know_each_other(component):
    for file in sources(FMUS / component):
        assert not others(component, file.read_text(encoding="utf-8")), file


def test_the_monolith_is_no_part_of_a_component():
    for file in sources(FMUS):
        if not file.is_relative_to(FMUS / "monolith"):
            assert not any(n.startswith("fmus.monolith") for n in imports(file.read_text())), file
    behind = {
        file.name
        for file in sources(ORCHESTRATOR)
        if any(n.startswith("fmus.monolith") for n in imports(file.read_text(encoding="utf-8")))
    }
    assert behind == {"monolithic.py", "truth.py"}


def test_physics_knows_arrays_and_kernels_only():
    allowed = {"numpy", "scipy", "numba"} | set(sys.stdlib_module_names)
    for file in sources(FMUS / "physics"):
        for name in imports(file.read_text()):
            inside = name.startswith(("fmus.physics", "fmus.kernels.jit", "fmus.kernels.by_reference"))
            assert inside or name == "fmus" or name.split(".")[0] in allowed, (file, name)


def test_the_product_knows_nothing_of_its_proof():
    """The product does not import ``tests`` (validation, regression, benchmarks), which is in no wheel."""
    for file in [*sources(FMUS), *sources(ORCHESTRATOR)]:
        assert "tests" not in {name.split(".")[0] for name in imports(file.read_text(encoding="utf-8"))}, file


def test_fmus_carry_no_physics_that_nothing_in_them_uses():
    """FMUs carry no physics that they do not use, because all of ``fmus/`` is packed into every FMU.

    Other elements and joints are in ``tests/validation/ancf``.
    """
    used: set[str] = set()
    for file in sources(FMUS):
        if not file.is_relative_to(FMUS / "physics"):
            reachable(name_of(file), used)
    left = {name_of(file) for file in sources(FMUS / "physics") if file.name != "__init__.py"} - used
    assert not left
    assert "fmus.physics.ancf.cable" in used


def name_of(file: Path) -> str:
    return ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


@pytest.mark.parametrize("folder", COMPONENTS)
def test_an_fmu_needs_few_packages_at_run_time(folder):
    packages = reachable(f"fmus.{folder}.{folder}_fmu")
    assert packages - set(sys.stdlib_module_names) <= AT_RUN_TIME
    assert {"numpy", "fmus"} <= packages, "the shell was not found"


def test_the_cache_knows_the_standard_library_alone():
    assert reachable("fmus.cache.files") <= set(sys.stdlib_module_names)


@pytest.mark.parametrize("name", GENERIC)
def test_generic_modules_import_nothing_of_fmus_but_the_cache(name):
    source = (ORCHESTRATOR / name).read_text(encoding="utf-8")
    modules = imports(source)
    assert ours(modules, "fmus") <= {"fmus.cache.files"}
    inner = {module.removeprefix("orchestrator.").replace(".", "/") for module in ours(modules, "orchestrator")}
    files = {f"{module}.py" for module in inner if (ORCHESTRATOR / f"{module}.py").is_file()}  # the others are folders
    assert files <= set(GENERIC), "a generic module imports one that is not"


def rooms(modules: set[str]) -> set[str]:
    """Packages of the orchestrator that contain these modules."""
    return {name.split(".")[1] for name in modules if name.startswith("orchestrator.")} & {
        r for s in STOREYS for r in s
    }


def test_rooms_import_from_storeys_below_alone():
    for storey, names in enumerate(STOREYS):
        below = {room for lower in STOREYS[:storey] for room in lower}
        for room in names:
            for file in sources(ORCHESTRATOR / room):
                assert rooms(imports(file.read_text(encoding="utf-8"))) <= {room, *below}, file
    assert not rooms(imports((ORCHESTRATOR / "__init__.py").read_text())), "the package itself imports on request only"
    assert rooms(imports("from orchestrator import cli\nimport orchestrator.log.reader")) == {"cli", "log"}


def test_every_module_of_the_orchestrator_is_in_a_room():
    known = {room for storey in STOREYS for room in storey} | {"__init__.py", "__main__.py", "cotrack", "book"}
    assert {file.relative_to(ORCHESTRATOR).parts[0] for file in sources(ORCHESTRATOR)} == known
    assert [file.name for file in sources(ORCHESTRATOR / "book")] == ["conf.py"], "the site's configuration alone"


def test_orchestrator_reaches_into_fmus_through_few_doors():
    for file in sources(ORCHESTRATOR):
        inner_modules = ours(imports(file.read_text(encoding="utf-8")), "fmus") - DOORS - {"fmus"}
        if file == TO_PHYSICS:
            assert inner_modules == {"fmus.physics.ancf.cable", "fmus.physics.ancf.element"}
            continue
        assert not inner_modules, (file, inner_modules)


def test_each_peer_is_known_by_one_module():
    known = {
        (package, file.name)
        for package in ("exudyn", "mujoco")
        for file in [*sources(FMUS), *sources(ORCHESTRATOR), *sources(PROOF / "benchmarks")]
        if package in {name.split(".")[0] for name in imports(file.read_text(encoding="utf-8"))}
    }
    assert known == {("exudyn", "exudyn_loops.py"), ("mujoco", "mujoco_loops.py")}


def test_the_checks_see_forbidden_imports():
    assert imports("def f():\n    from orchestrator import scene\n") >= {"orchestrator.scene"}
    assert ours({"fmus.chassis.model", "fmus.vehicles.vehicle.BadInput"}, "fmus") == {"fmus.chassis.model"}
    derived = "import fmus.track.ports\nfrom fmus.track_rigid import model\nfrom fmus.chassis.model import Model\n"
    assert others("track_flexible", derived) == {"fmus.chassis.model"}
    assert others("driver", derived) == {"fmus.track_rigid", "fmus.track_rigid.model", "fmus.chassis.model"}
    assert others("track_rigid", "import fmus.track_rigid.model\n") == set()


def test_numbers_in_names_of_signals_are_read_in_one_place():
    """Numbers in names of signals, as in ``link[12].tension``, are read by ``schema.family`` alone."""
    behind = [
        file.relative_to(ORCHESTRATOR).as_posix()
        for file in sources(ORCHESTRATOR)
        if any(
            isinstance(node, ast.Constant) and isinstance(node.value, str) and "\\[(\\d" in node.value
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        )
    ]
    assert behind == ["log/schema.py"]


def test_physics_and_libraries_do_not_print():
    for file in [*sources(FMUS), *sources(ORCHESTRATOR)]:
        if file.is_relative_to(ORCHESTRATOR / "cli"):
            continue
        calls = [n for n in ast.walk(ast.parse(file.read_text())) if isinstance(n, ast.Call)]
        assert not [c for c in calls if isinstance(c.func, ast.Name) and c.func.id == "print"], file


def test_shells_hold_no_physics():
    for folder in COMPONENTS:
        shell = FMUS / folder / f"{folder}_fmu.py"
        lines = [line for line in shell.read_text(encoding="utf-8").splitlines() if line.strip()]
        assert len(lines) <= 20, shell
        assert not [n for n in ast.walk(ast.parse(shell.read_text())) if isinstance(n, ast.FunctionDef)], shell


def test_every_component_has_its_page():
    for folder in COMPONENTS:
        page = (FMUS / folder / "README.md").read_text(encoding="utf-8").lower()
        for word in ("equations", "ports", "state"):
            assert word in page, (folder, word)


def test_top_level():
    try:
        listed = subprocess.run(
            ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout.split()
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout")
    top = {name.split("/")[0] for name in listed}
    assert top <= {
        "pyproject.toml", "fmus", "orchestrator", "tests", "logs", "findings", "README.md",
        "LICENSE", "CITATION.cff", ".gitignore", ".ci", "constraints.txt",
    }  # fmt: skip


def test_constraints_are_plain_pins():
    for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines():
        name, equals, number = line.partition("==")
        assert all((name, equals, number)), line
        assert not set(line) & set(" ;@/<>~!"), line


def test_docstrings_open_with_their_subject():
    for file in (*sources(FMUS), *sources(ORCHESTRATOR), *sources(PROOF)):
        assert not re.search('"""(What|Those) ', file.read_text(encoding="utf-8")), file
