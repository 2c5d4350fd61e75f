"""Names that ``import cotrack`` offers, packages that it needs; odd settings run, stderr has no text of a library."""

import pkgutil
import re
import subprocess
import sys
import tomllib
import warnings
from importlib import import_module
from importlib.util import find_spec
from inspect import signature
from pathlib import Path

import cotrack as installed
import numpy as np
import pytest
from made_logs import made, of_columns

import orchestrator as cotrack
from fmus.physics.chain.layout import scale_of_angles
from fmus.vehicles.tables import BadInput
from orchestrator.log.extra import BROUGHT

RESERVED = {*cotrack.OFFERED, "plot", "report"}  # the last two are planned
PEERS = {"tests.benchmarks.peers.exudyn_loops": "exudyn", "tests.benchmarks.peers.mujoco_loops": "mujoco"}


@pytest.fixture(scope="module")
def submodules():
    """Names of all modules of the package, each imported."""
    names = [module.name for module in pkgutil.walk_packages(cotrack.__path__, "orchestrator.")]
    names = [name for name in names if not name.endswith("__main__")]  # these are commands
    names = [name for name in names if name not in PEERS or find_spec(PEERS[name])]
    for name in names:
        import_module(name)
    return names


def test_no_module_takes_a_name_that_is_offered(submodules):
    assert {"orchestrator.scene.scene", "orchestrator.cli.run_commands", "orchestrator.studies.pool"} <= set(submodules)
    assert not RESERVED & vars(cotrack).keys(), "an import has replaced it by a module"
    rooms = {name.split(".")[1] for name in submodules}
    assert not RESERVED & rooms
    assert rooms < vars(cotrack).keys(), "the check does not see the modules of an import"
    assert dir(cotrack) == sorted({*vars(cotrack), *cotrack.OFFERED})


def test_what_is_offered_can_be_called(submodules, tmp_path):
    assert {"straight", "hanging_chain"} <= set(cotrack.scenes())
    for name in cotrack.OFFERED:
        assert signature(getattr(cotrack, name)).parameters or name == "scenes"
        assert getattr(installed, name) is getattr(cotrack, name)
    one, two = tmp_path / "one.mcap", tmp_path / "two.mcap"
    for path, start in ((one, "rest"), (two, "displaced")):
        scene = cotrack.load("hanging_chain", "flexible", ["run.stop=0.02", f"track.start={start}"])
        assert cotrack.run(scene, log=path, estimate=False, progress=False).summary["status"] == "ok"
    with cotrack.Log(one) as log:
        assert len(log.signal("chain.tension.max")[0]) == 21
    assert cotrack.compare(one, one)["pins"].absolute == 0.0 < cotrack.compare(one, two)["pins"].absolute


def test_the_installed_module_is_that_of_the_sources():
    """An editable installation copies it: install again after a change."""
    source = Path(cotrack.__file__).parent / "cotrack" / "__init__.py"
    assert Path(installed.__file__).read_text() == source.read_text()
    assert {*installed.__all__} == {*cotrack.OFFERED, "__version__"} == {*dir(installed)}
    for module in (cotrack, installed):
        with pytest.raises(AttributeError, match="has no attribute 'anything'"):
            _ = module.anything


def test_the_package_alone_imports_nothing_else(environment):
    code = "import sys, cotrack; print({name.split('.')[0] for name in sys.modules} & {'fmus', 'numpy', 'fmpy'})"
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


@pytest.mark.parametrize(
    ("argument", "spared"),
    [
        ("--help", "numpy scipy numba mcap"), ("scenes", "scipy numba llvmlite mcap.records"),
        ("log info", "scipy numba fmpy fmus.rest.equilibrium orchestrator.cosim.component"),
        ("log export -o a.csv --signal a.y", "scipy numba fmpy orchestrator.scene.placing"),
        ("plot a.y -o a.png", "scipy numba fmpy orchestrator.scene.placing"),
    ],
)  # fmt: skip
def test_a_short_command_loads_no_long_library(environment, tmp_path, argument, spared):
    log = made(tmp_path / "a.mcap", {"/a/out": [("y", "m")]}, {"/a/out": ([0.0, 1.0], [[0.0], [1.0]])}, None, ("a",))
    code = "import sys; from orchestrator.__main__ import main\ntry: main()\nfinally: print(*sys.modules)"
    words = argument.split()
    words[1 + (words[0] == "log") : 0] = [str(log)] * (words[0] in ("log", "plot"))
    command = [sys.executable, "-c", code, *words]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=True)
    loaded = {*done.stdout.splitlines()[-1].split()}
    assert {"typer", "orchestrator.cli"} < loaded
    assert not loaded & {*spared.split()}


WITHOUT_LLVMLITE = """
import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name == "llvmlite":
            raise ModuleNotFoundError("No module named 'llvmlite'", name=name)
sys.meta_path.insert(0, Missing())
from orchestrator.__main__ import main
main()
"""


def test_a_missing_package_is_named_as_it_is_installed(environment, tmp_path):
    """Also one that another package brings, when the command is loaded."""
    command = [sys.executable, "-c", WITHOUT_LLVMLITE, "show", "hanging_chain"]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 2
    assert line.startswith("cotrack: numba (module llvmlite) is not installed: ")


def test_every_package_of_the_core_has_a_name_to_install():
    """The modules that the sources import are packages of pyproject.toml, by their own names or those they come in."""
    table = tomllib.loads((Path(cotrack.__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    listed = {re.split(r"[<>=]", one)[0].lower() for one in table["dependencies"]}
    listed |= {re.split(r"[<>=]", one)[0].lower() for extra in table["optional-dependencies"].values() for one in extra}
    used = set()
    for package in ("fmus", "orchestrator"):
        for file in (Path(cotrack.__file__).parents[1] / package).rglob("*.py"):
            used |= {*re.findall(r"(?m)^ *(?:from|import) (\w+)(?:[\w.]* import .*| as \w+|[.\w]*)$", file.read_text())}
    others = used - sys.stdlib_module_names - {"fmus", "orchestrator", "cotrack", "dask", "these"}
    assert {BROUGHT.get(name, name) for name in others} <= listed
    assert not {name for name in BROUGHT if name in listed}


SHORT = ("run", "hanging_chain", "--set", "chain.links=8", "--set", "expect={}", "--stop", "0.002", "--no-estimate")


@pytest.mark.parametrize("setting", ["vehicle.material.youngs_modulus=1 Pa", "run.checkpoints=1e308"])
def test_odd_settings_run(cotrack, setting):
    assert "hanging_chain, flexible links: ok" in cotrack.done(*SHORT, "--set", setting)


WHOLE = ("joint[{}].position", "joint[{}].force", "joint[{}].axis", "link[{}].ground.force")
FIBRES = ("link[{}].fibre.outer", "link[{}].fibre.inner")


@pytest.mark.parametrize("shorter", ["", *WHOLE, *FIBRES])
def test_joints_of_families_of_other_lengths(cotrack, tmp_path, shorter):
    """Records of four links, of one signal of two."""
    names = [
        f"{family.format(k + 1)}{axis}"
        for family in (*WHOLE, *FIBRES)
        for k in range(2 if family == shorter else 4)
        for axis in ((".x", ".y", ".z") if family in WHOLE else ("",))
    ]
    scene = {"run": {"step": 1e-3}, "vehicle": {"section": {"area": 1.0, "bending": 1.0, "outer_fibre": 1.0}}}
    values = np.random.default_rng(1).random((2, len(names)))
    columns = {f"chain.{name}": column for name, column in zip(names, values.T, strict=True)}
    path = of_columns(tmp_path / "a.mcap", columns | {"chain.travel": np.zeros(2)}, np.array([0.0, 1e-3]), scene)
    status, _, err = cotrack("analyse", path, "links")
    assert (status, "holds other numbers" in err) == ((2, True) if shorter else (0, False)), err
    assert "internal error" not in err


def test_the_scale_of_the_angles_of_a_soft_chain_is_found():
    assert scale_of_angles(lambda s: s - 0.5, 1e-3, 1.5) == pytest.approx(0.5, abs=1e-15)


def test_warnings_of_numbers_do_not_reach_stderr(cotrack, monkeypatch):
    def warn(*_):
        warnings.warn("overflow encountered in multiply", RuntimeWarning, stacklevel=1)
        raise BadInput("said")

    monkeypatch.setattr("orchestrator.scene.ssp_scene.load_runnable", warn)
    status, _, err = cotrack("show", "rig")
    assert (status, err) == (2, "cotrack: said\n")
