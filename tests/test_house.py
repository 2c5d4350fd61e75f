"""The walls of the project: allowed imports, and the shape of its folders."""

import ast
import re
import subprocess
import sys
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib.util import resolve_name
from pathlib import Path

import pytest

from fmus import components

ROOT = Path(__file__).parents[1]
FMUS = ROOT / "fmus"
ORCHESTRATOR = ROOT / "orchestrator"
COMPONENTS = [components.folder(kind) for kind in components.COMPONENT_KINDS]
BASES = {"fmus.track_rigid", "fmus.track_rigid.model"}  # from which another kind of track may derive its model

# Packages of the orchestrator by level: each imports only from levels below its own, anywhere in its modules.
LAYERS = (
    ("files", "vocabulary"), ("kernels", "fmi"), ("log",), ("cosim",), ("results",), ("scene", "fmu_check"),
    ("execution",), ("studies",), ("recorded_run",), ("cli",),
)  # fmt: skip
# Packages of fmus from the lowest: each imports only from those before its own, anywhere in its modules.
PACKAGES = (
    "cache", "kernels", "physics", "interface", "vehicles", "start", "ground", "track", "components", "fmi", "drives",
    *("track_rigid", "track_flexible", "chassis", "sprocket_drive", "steering_differential", "driver"),
    *("precompile", "native", "monolith", "rest"),
)  # fmt: skip
# Modules that run any co-simulation FMU and depend on no FMU of the project.
IN_COSIM = (
    "base_units callbacks component fast_calls messages variables texts graph mixed_exchange program row_writer master"
)
GENERIC = [
    *(
        file.relative_to(ORCHESTRATOR).as_posix()
        for place in ("files", "kernels", "fmi", "cosim/coupling", "cosim/processes", "log", "fmu_check")
        for file in sorted((ORCHESTRATOR / place).glob("*.py"))
        # a log's system.json as the project writes it; files of tests
        if file.name not in ("recorded_system.py", "tools.py", "measured_formats.py", "bags.py")
    ),
    *(f"cosim/{name}.py" for name in IN_COSIM.split()),
    "execution/replays.py",
]
INSIDE_NUMBA = "fmus.kernels", "fmus.kernels.numba_internals"  # of which no other module knows anything
PROMISED = {"intrinsic", "overload", "register_jitable"}  # by numba.extending
ALLOWED_IMPORTS = {
    "fmus.precompile", "fmus.cache", "fmus.cache.files", "fmus.cache.limit", "fmus.cache.pack", "fmus.fmi.build",
    "fmus.fmi.saved", "fmus.fmi.terminals", "fmus.ground.refinement", "fmus.ground.soils", "fmus.ground.tables",
    "fmus.ground.terrain", "fmus.interface.defaults",
    "fmus.interface.ports", "fmus.interface.units", "fmus.monolith.model", "fmus.native.pack",
    "fmus.rest.equilibrium", "fmus.rest.standing", "fmus.rest.tensioning", *INSIDE_NUMBA,
    "fmus.start", "fmus.track.choices", "fmus.track.link_outputs", "fmus.vehicles.ranges",
    "fmus.vehicles.sides", "fmus.vehicles.tables", "fmus.vehicles.vehicle",
}  # fmt: skip
PROOF = ROOT / "tests"
# Imports inside a function, and why they may close a circle.
LOCAL_IMPORTS = {
    ("fmus.physics.chain.interface", "fmus.physics.chain.rolling"): "a chain that touches nothing has no contacts",
    ("orchestrator.log.measured_formats", "orchestrator.log.bags"): "a scene rarely reads a bag, and it takes long",
    ("orchestrator.scene.kinds", "orchestrator.scene.scene"): "a scene is changed by what reads all kinds of scenes",
    ("orchestrator.scene.scene", "orchestrator.scene.keys"): "a wrong key is told with its range, by a list of scenes",
}
TO_PHYSICS = ORCHESTRATOR / "studies" / "step_limits.py"  # predicts the limit of a link's highest frequency
AT_RUN_TIME = {"numpy", "scipy", "numba", "llvmlite", "pythonfmu", "fmus"}


@cache
def nodes(source: str) -> list[ast.AST]:
    """All nodes of the syntax tree of a source."""
    return list(ast.walk(ast.parse(source)))


@cache
def imports(source: str, for_types: bool = True) -> set[str]:
    """Every module that a source imports, at any place in it; ``for_types``: also those for types alone."""
    types: list[ast.AST] = []
    if not for_types:
        tests = [
            node for node in nodes(source) if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        ]
        types = [inner for node in tests for inner in ast.walk(node)]
    modules = set()
    for node in (node for node in nodes(source) if node not in types):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports must be absolute"
            modules |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return modules


def text(file: Path) -> str:
    return file.read_text(encoding="utf-8")


def sources(*folders: Path) -> list[Path]:
    return [file for folder in folders for file in sorted(folder.rglob("*.py"))]


def importing(package: str, *folders: Path) -> list[Path]:
    """Files that import a package or a module in it."""
    return [f for f in sources(*folders) if any(f"{name}.".startswith(f"{package}.") for name in imports(text(f)))]


def declared(source: str) -> set[str]:
    """Modules that the classes of a source name by ``implemented_in``."""
    calls = [node for node in nodes(source) if isinstance(node, ast.Call)]
    named = [call for call in calls if ast.unparse(call.func) == "implemented_in"]
    return {ast.literal_eval(keyword.value) for call in named for keyword in call.keywords}


def ours(modules: set[str], package: str) -> set[str]:
    """Modules of ``package`` among the imports, without names inside a module."""
    paths = {module: ROOT.joinpath(*module.split(".")) for module in modules if module.split(".")[0] == package}
    return {module for module, path in paths.items() if path.with_suffix(".py").exists() or path.is_dir()}


def reachable(module: str, seen: set[str] | None = None) -> set[str]:
    """Top-level packages that the import of a module of fmus loads, by static analysis."""
    seen = set() if seen is None else seen
    path = ROOT.joinpath(*module.split("."))
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    if module in seen or not file.exists():
        return set()
    seen.add(module)
    modules = imports(text(file)) | {resolve_name(name, module.rpartition(".")[0]) for name in declared(text(file))}
    packages = {name.split(".")[0] for name in modules}
    return packages.union(*(reachable(inner, seen) for inner in ours(modules, "fmus")))


def later_packages(package: str, source: str) -> set[str]:
    """Packages behind its own in ``PACKAGES`` that a source of a package of fmus imports."""
    named = {name.split(".")[1] for name in ours(imports(source), "fmus") if "." in name}
    return {name for name in named if PACKAGES.index(name) > PACKAGES.index(package)}


def test_fmus_never_look_back():
    """The FMUs import nothing of the orchestrator, and the product nothing of its proof, which is in no wheel."""
    assert importing("orchestrator", FMUS) == []
    assert importing("tests", FMUS, ORCHESTRATOR) == []


def test_rooms_of_fmus_import_one_way():
    packages = {file: file.relative_to(FMUS).parts[0].removesuffix(".py") for file in sources(FMUS)}
    assert {*packages.values()} == {*PACKAGES, "__init__"}
    for file, package in packages.items():
        if package != "__init__":
            assert later_packages(package, text(file)) == set(), file
    assert later_packages("start", "from fmus.track import steps") == {"track"}


def test_imports_go_round_in_no_circle_but_for_late_ones():
    graph = {}
    for file in sources(FMUS, ORCHESTRATOR):
        module = name_of(file)
        found = imports(text(file), for_types=False)
        graph[module] = {one for package in ("fmus", "orchestrator") for one in ours(found, package)} - {module}
        graph[module] -= {one for one in graph[module] if ROOT.joinpath(*one.split(".")).is_dir()}
    for above, below in LOCAL_IMPORTS:
        graph[above].remove(below)
        with pytest.raises(CycleError):
            TopologicalSorter({**graph, above: graph[above] | {below}}).prepare()
    TopologicalSorter(graph).prepare()


def others(component: str, source: str) -> set[str]:
    """Modules of other components that a source of a component imports; a kind of track may import BASES."""
    allowed = BASES if component.startswith("track_") else set()
    named = {name: name.split(".")[1] for name in ours(imports(source), "fmus") - allowed if "." in name}
    return {name for name, package in named.items() if package in COMPONENTS and package != component}


@pytest.mark.parametrize("folder", COMPONENTS)
def test_a_component_stands_alone(folder):
    """It knows no other, needs few packages at run time, has a shell without physics, and a page."""
    for file in sources(FMUS / folder):
        assert not others(folder, text(file)), file
    packages = reachable(f"fmus.{folder}.{folder}_fmu")
    assert packages - set(sys.stdlib_module_names) <= AT_RUN_TIME
    assert {"numpy", "fmus"} <= packages, "the shell was not found"
    shell = text(FMUS / folder / f"{folder}_fmu.py")
    assert len([line for line in shell.splitlines() if line.strip()]) <= 20
    assert not [node for node in ast.walk(ast.parse(shell)) if isinstance(node, ast.FunctionDef)]
    page = text(FMUS / folder / "README.md").lower()
    assert [word for word in ("equations", "ports", "state") if word not in page] == []


def into_numba(source: str) -> set[str]:
    """Names inside numba that a source imports, and attributes of numba's modules that it sets."""
    found = {name for name in imports(source) if name.startswith("numba.")}
    inner = {name for name in found if name.split(".")[1] == "core" or "._" in name}
    low = {name for name in found if name.startswith("numba.extending.")} - {f"numba.extending.{n}" for n in PROMISED}
    targets = [each for node in nodes(source) if isinstance(node, ast.Assign) for each in node.targets]
    targets += [node.args[0] for node in nodes(source) if isinstance(node, ast.Call) and node.args
                and ast.unparse(node.func) == "setattr"]  # fmt: skip
    return inner | low | {name for each in targets if (name := ast.unparse(each)).startswith(("numba.", "config."))}


def test_one_package_knows_the_inside_of_numba():
    """No other imports from it or changes numba, and its tested version is there alone."""
    room = FMUS / "kernels" / "numba_internals"
    reaching = {file for file in sources(FMUS, ORCHESTRATOR) if into_numba(text(file))}
    assert {file for file in reaching if not file.is_relative_to(room)} == set()
    assert {file.name for file in reaching} == {"compilation.py", "references.py"}
    assert [file.name for file in sources(FMUS, ORCHESTRATOR) if '"0.68' in text(file)] == ["__init__.py"]
    for line in ("import numba.core.types", "def f():\n    from numba.core import cgutils", "numba.config.OPT = 0",
                 "from numba.extending import unbox", "setattr(numba.njit, 'x', 1)"):  # fmt: skip
        assert into_numba(line), line
    assert not into_numba(
        "import numba\nfrom numba import types\nfrom numba.extending import intrinsic\nx = numba.config.OPT"
    )


def test_every_folder_with_a_shell_is_a_component():
    assert {file.parent.name for file in FMUS.glob("*/*_fmu.py")} == set(COMPONENTS)


def test_the_monolith_is_no_part_of_a_component():
    assert [file for file in importing("fmus.monolith", FMUS) if not file.is_relative_to(FMUS / "monolith")] == []
    assert {file.name for file in importing("fmus.monolith", ORCHESTRATOR)} == {"monolithic.py", "truth.py"}


def test_physics_knows_arrays_and_kernels_only():
    allowed = {"numpy", "scipy", "numba"} | set(sys.stdlib_module_names)
    for file in sources(FMUS / "physics"):
        for name in imports(text(file)):
            inside = name.startswith(("fmus.physics", "fmus.kernels.jit"))
            assert inside or name == "fmus" or name.split(".")[0] in allowed, (file, name)


def test_fmus_carry_no_physics_that_nothing_in_them_uses():
    """FMUs carry no physics that they do not use, because all of ``fmus/`` is packed into every FMU.

    Other elements and joints are in ``tests/validation/ancf``.
    """
    used: set[str] = set()
    for file in sources(FMUS):
        if not file.is_relative_to(FMUS / "physics"):
            reachable(name_of(file), used)
    assert {name_of(file) for file in sources(FMUS / "physics") if file.name != "__init__.py"} - used == set()
    assert "fmus.physics.ancf.cable" in used


def name_of(file: Path) -> str:
    return ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def test_the_cache_knows_the_standard_library_alone():
    assert reachable("fmus.cache.files") <= set(sys.stdlib_module_names)


@pytest.mark.parametrize("name", GENERIC)
def test_generic_modules_import_nothing_of_fmus_but_the_cache(name):
    modules = imports(text(ORCHESTRATOR / name))
    assert ours(modules, "fmus") <= {"fmus.cache", "fmus.cache.files", "fmus.cache.pack", *INSIDE_NUMBA}
    inner = {module.removeprefix("orchestrator.").replace(".", "/") for module in ours(modules, "orchestrator")}
    files = {f"{module}.py" for module in inner if (ORCHESTRATOR / f"{module}.py").is_file()}  # the others are folders
    assert files <= set(GENERIC), "a generic module imports one that is not"


def packages(modules: set[str]) -> set[str]:
    """Packages of the orchestrator that contain these modules."""
    known = {package for layer in LAYERS for package in layer}
    return {name.split(".")[1] for name in modules if name.startswith("orchestrator.")} & known


def test_rooms_import_from_layers_below_alone():
    below: set[str] = set()
    for names in LAYERS:
        for package in names:
            for file in sources(ORCHESTRATOR / package) or [ORCHESTRATOR / f"{package}.py"]:
                assert packages(imports(text(file))) <= {package, *below}, file
        below |= {*names}
    assert not packages(imports(text(ORCHESTRATOR / "__init__.py"))), "the package itself imports on request only"
    assert packages(imports("from orchestrator import cli\nimport orchestrator.log.reader")) == {"cli", "log"}
    known = {*below, "__init__", "__main__", "cotrack", "book"}
    found = {file.relative_to(ORCHESTRATOR).parts[0].removesuffix(".py") for file in sources(ORCHESTRATOR)}
    assert found == known
    assert [file.name for file in sources(ORCHESTRATOR / "book")] == ["conf.py"], "the site's configuration alone"


def test_scenes_know_of_results_the_figures_alone():
    """Their names and parts, for checks; late, as they read logs, and without kernels."""
    known = {file.name: imports(text(file)) for file in sources(ORCHESTRATOR / "scene")}
    found = {name: ours(modules, "orchestrator") for name, modules in known.items()}
    of_results = {(name, one) for name, modules in found.items() for one in modules if "results" in one.split(".")}
    figures = {f"orchestrator.results.{name}" for name in ("figures", "measures")}
    measures = ("expectations.py", "orchestrator.results.measures")
    assert of_results == {("tables.py", name) for name in figures} | {measures}
    told = "import sys; from orchestrator.scene import scene, tables; print('orchestrator.results' in sys.modules)"
    told += "; scene.load('straight'); print(*[name in sys.modules for name in ('orchestrator.results', 'numba')])"
    done = subprocess.run([sys.executable, "-c", told], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True", "False"]


def test_orchestrator_reaches_into_fmus_through_few_doors():
    for file in sources(ORCHESTRATOR):
        inner = ours(imports(text(file)), "fmus") - ALLOWED_IMPORTS - {"fmus"}
        assert inner == ({"fmus.physics.ancf.cable", "fmus.physics.ancf.element"} if file == TO_PHYSICS else set()), (
            file
        )


@pytest.mark.parametrize("package", ["exudyn", "mujoco", "pinocchio"])
def test_each_peer_is_known_by_one_module(package):
    known = importing(package, FMUS, ORCHESTRATOR, PROOF / "benchmarks")
    assert [file.name for file in known] == [f"{package}_loops.py"]


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
            for node in nodes(text(file))
        )
    ]
    assert behind == ["log/schema.py"]


def test_physics_and_libraries_do_not_print():
    for file in sources(FMUS, ORCHESTRATOR):
        if not file.is_relative_to(ORCHESTRATOR / "cli"):
            calls = [node.func for node in nodes(text(file)) if isinstance(node, ast.Call)]
            assert not [call for call in calls if isinstance(call, ast.Name) and call.id == "print"], file


def test_top_level():
    try:
        listed = subprocess.run(
            ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout.split()
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout")
    top = {name.split("/")[0] for name in listed}
    assert top <= {
        "pyproject.toml", "fmus", "orchestrator", "tests", "findings", "README.md",
        "LICENSE", "CITATION.cff", ".gitignore", ".ci", ".github", "constraints.txt",
    }  # fmt: skip


def test_constraints_are_plain_pins():
    for line in text(ROOT / "constraints.txt").splitlines():
        name, equals, number = line.partition("==")
        assert all((name, equals, number)), line
        assert not set(line) & set(" ;@/<>~!"), line


def test_docstrings_open_with_their_subject():
    for file in sources(FMUS, ORCHESTRATOR, PROOF):
        assert not re.search('"""(What|Those) ', text(file)), file


OF_A_TEST = re.compile(r"^[ \t]*(?:from|import)[ \t].*\btest_\w+", re.MULTILINE)


def test_no_test_is_imported():
    """Helpers of several tests are in ``tests/support``, where no test is."""
    for file in sources(PROOF):
        assert OF_A_TEST.search(text(file)) is None, file
    assert not [*(PROOF / "support").rglob("test_*.py")]
    for line in ("from test_fit import S", "    import tests.orchestrator.test_fit", "from tests import test_fit"):
        assert OF_A_TEST.search(f"def f():\n{line}\n"), line
