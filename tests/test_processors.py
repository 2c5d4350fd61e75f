"""Runs give the same bits on every x86-64 processor (``tests/processors.py``)."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
from processors import PYTHON, ROOT, STEPS, compare_native, compare_python, difference


@pytest.mark.long
def test_a_start_and_its_first_steps_do_not_depend_on_the_libraries():
    assert compare_python("straight", "rigid", 20, ["all of them"]) == 0


@pytest.mark.long
@pytest.mark.parametrize("choice", PYTHON)
def test_a_path_through_points_does_not_depend_on_the_libraries(choice):
    """The spline of a driver's path is scipy's, whose solve is LAPACK's."""
    made = (
        "from fmus.driver.path import path_through_points as made;"
        "path = made('points', '0 0; 7.3 2.1; 11 -3; 13.7 4; 29 5.3');"
        "print(hashlib.sha256(b''.join(np.asarray(part).tobytes() for part in path)).hexdigest())"
    )
    command = [sys.executable, "-c", f"import hashlib; import numpy as np; {made}"]
    hashes = {
        subprocess.run(command, cwd=ROOT, env={**os.environ, **more}, capture_output=True, check=True).stdout
        for more in ({}, PYTHON[choice])
    }
    assert len(hashes) == 1
    assert len(hashes.pop()) == 65


@pytest.mark.study
@pytest.mark.parametrize("scene", ["straight", "turn", "serpentine"])
@pytest.mark.parametrize("links", ["flexible", "rigid"])
def test_python_fmus_give_the_same_bits_with_all_choices_of_the_libraries(scene, links):
    assert compare_python(scene, links, STEPS) == 0


@pytest.mark.study
@pytest.mark.parametrize("scene", ["straight", "turn", "serpentine"])
@pytest.mark.parametrize("links", ["flexible", "rigid"])
def test_native_fmus_give_the_same_bits_on_emulated_processors_and_windows(scene, links):
    if not (shutil.which("qemu-x86_64") and shutil.which("wine")):
        pytest.skip("needs Debian's qemu-user and wine")
    assert compare_native(scene, links, STEPS) == 0


def test_a_last_digit_is_a_difference():
    rows = np.linspace(1.0, 2.0, 12).reshape(3, 4)
    other = rows.copy()
    other[2, 1] = np.nextafter(other[2, 1], 3.0)
    assert difference(rows, rows).different == 0
    assert difference(rows, other)[:2] == (12, 1)
    assert len(PYTHON) == 8
