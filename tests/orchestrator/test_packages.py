"""Packages that are missing or do not fit are named as they are installed."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from orchestrator.cli.common import message_and_status
from orchestrator.log.extra import BROUGHT

ROOT = Path(__file__).parents[2]


BROKEN = "import sys; sys.modules['{module}'] = None; from orchestrator.__main__ import main; main()"


@pytest.mark.parametrize(("module", "said"), [("llvmlite", "numba (module llvmlite)"), ("pydantic", "pydantic")])
def test_a_missing_package_is_named_as_it_is_installed(environment, tmp_path, module, said):
    command = [sys.executable, "-c", BROKEN.format(module=module), "scenes"]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 2
    assert line.startswith(f"cotrack: {said} is not installed: pip install -c constraints.txt -e . in the clone")


def test_a_package_that_is_needed_later_is_named_too():
    """Packages with other names, or that are there but do not fit another one; an error of ours is internal."""
    missing = ModuleNotFoundError("No module named 'google'", name="google.protobuf".partition(".")[0])
    assert message_and_status(missing)[0].startswith("protobuf (module google) is not installed: pip install")
    unfit = ImportError("Numba needs NumPy 2.3 or less", name="numba")
    assert message_and_status(unfit)[0].startswith("numba is installed but cannot be imported (Numba needs NumPy 2.3")
    half = ModuleNotFoundError("No module named 'scipy.linalg'", name="scipy.linalg")
    assert message_and_status(half)[0].startswith("scipy is installed but cannot be imported (No module named")
    assert message_and_status(unfit)[1] == message_and_status(missing)[1] == 2
    assert message_and_status(ImportError("cannot import name 'x'", name="fmus.kernels.jit"))[0].startswith(
        "internal error"
    )


def test_every_package_of_the_core_has_a_name_to_install():
    """The modules that the sources import are packages of pyproject.toml, by their own names or those they come in."""
    table = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    listed = {re.split(r"[<>=]", one)[0].lower() for one in table["dependencies"]}
    listed |= {re.split(r"[<>=]", one)[0].lower() for extra in table["optional-dependencies"].values() for one in extra}
    used = set()
    for package in ("fmus", "orchestrator"):
        for file in (ROOT / package).rglob("*.py"):
            used |= {*re.findall(r"(?m)^ *(?:from|import) (\w+)(?:[\w.]* import .*| as \w+|[.\w]*)$", file.read_text())}
    others = used - sys.stdlib_module_names - {"fmus", "orchestrator", "cotrack", "dask", "these"}
    assert {BROUGHT.get(name, name) for name in others} <= listed
    assert not {name for name in BROUGHT if name in listed}
