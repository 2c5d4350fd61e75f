"""Runs give the same bits on every x86-64 processor (``tests/processors.py``), by their sources too."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
from processors import PYTHON, ROOT, STEPS, compare_native, compare_python, difference

FMUS = ROOT / "fmus"


@pytest.mark.long
def test_a_start_and_its_first_steps_do_not_depend_on_the_libraries():
    assert compare_python("straight", "rigid", 20, ["all of them"]) == 0


@pytest.mark.long
def test_a_path_through_points_does_not_depend_on_the_libraries():
    """The spline of a driver's path is scipy's, whose solve is LAPACK's."""
    made = (
        "import hashlib; import numpy as np; from fmus.driver.path import path_through_points as made;"
        "path = made('points', '0 0; 7.3 2.1; 11 -3; 13.7 4; 29 5.3');"
        "print(hashlib.sha256(b''.join(np.asarray(part).tobytes() for part in path)).hexdigest())"
    )
    hashes = {
        subprocess.run(
            [sys.executable, "-c", made], cwd=ROOT, env={**os.environ, **more}, capture_output=True, check=True
        ).stdout
        for more in PYTHON.values()
    }
    assert len(hashes) == 1
    assert len(hashes.pop()) == 65


@pytest.mark.study
@pytest.mark.parametrize("compare", [compare_python, compare_native])
@pytest.mark.parametrize("scene", ["straight", "turn", "serpentine"])
@pytest.mark.parametrize("links", ["flexible", "rigid"])
def test_fmus_give_the_same_bits_with_all_libraries_and_on_emulated_processors_and_windows(compare, scene, links):
    if compare is compare_native and not (shutil.which("qemu-x86_64") and shutil.which("wine")):
        pytest.skip("needs Debian's qemu-user and wine")
    assert compare(scene, links, STEPS) == 0


def test_a_last_digit_is_a_difference():
    rows = np.linspace(1.0, 2.0, 12).reshape(3, 4)
    other = rows.copy()
    other[2, 1] = np.nextafter(other[2, 1], 3.0)
    assert difference(rows, rows).different == 0
    assert difference(rows, other)[:2] == (12, 1)
    assert len(PYTHON) == 9


def depends_on_the_processor(source: str) -> list[str]:
    """Expressions of a source whose last digits depend on the processor: of libm, numpy's functions, BLAS and LAPACK.

    Squares and whole powers of arrays and of numbers in kernels are products.
    """
    functions = (
        "a?(sin|cos|tan)h?|atan2|arc(sin|cos|tan)h?|arctan2|exp2?|expm1|log(2|10|1p)?|hypot|pow|float_power|power|cbrt|"
        "fmod|remainder|dist|sinc|dot|vdot|inner|matmul|tensordot|leggauss|linalg"
    )
    parts = "linalg|sparse|special|interpolate|signal|integrate|fft"  # of scipy
    found = []
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Attribute(attr="dot"):  # of an array, too
                depends = True
            case ast.Attribute(value=ast.Name(id="np" | "numpy" | "math" | "cmath"), attr=name):
                depends = re.fullmatch(functions, name) is not None
            case ast.ImportFrom(module="math" | "cmath" | "numpy", names=names):
                depends = any(re.fullmatch(functions, alias.name) for alias in names)
            case ast.Attribute(value=ast.Name(id="scipy"), attr=name):
                depends = re.fullmatch(parts, name) is not None
            case ast.ImportFrom(module=module):
                depends = re.match(rf"scipy\.({parts})", module or "") is not None
            case ast.BinOp(op=ast.MatMult()):
                depends = True
            case ast.BinOp(op=ast.Pow(), right=exponent):
                depends = not (isinstance(exponent, ast.Constant) and isinstance(exponent.value, int))
            case _:
                depends = False
        found += [ast.unparse(node)] if depends else []
    return found


# Bounds of frequencies, of which nine digits enter the longest stable step (``chain/flexible/explicit.py``); a radius
# that tables check, for which components give their sine; powers of 2: products in a kernel, constants of the
# functions; whether a sum of squares is finite; the spline of a path, whose tridiagonal solve calls no BLAS (above).
EXEMPT = {
    "physics/ancf/element.py", "physics/chain/flexible/turning.py", "physics/chain/flexible/closing.py",
    "physics/integrate/adams.py", "physics/integrate/dormand_prince.py", "vehicles/sides.py", "physics/elementary.py",
    "interface/model.py", "driver/path.py",
}  # fmt: skip


def test_results_do_not_depend_on_the_processor():
    """FMUs take elementary functions and linear solves from ``elementary`` and ``elimination``."""
    behind = {}
    for file in sorted(FMUS.rglob("*.py")):
        if found := depends_on_the_processor(file.read_text(encoding="utf-8")):
            behind[file.relative_to(FMUS).as_posix()] = found
    assert behind.keys() == EXEMPT, behind
    planted = "import numpy as np\nfrom math import sin\nx = np.cos(1.0) + A @ b + np.linalg.norm(b) + a ** 0.5\n"
    planted += "y = b.dot(b) + scipy.linalg.norm(b)\n"
    assert len(depends_on_the_processor(planted)) == 7
    assert not depends_on_the_processor("from math import isfinite\ny = np.sqrt(x) + x ** 2\n")
