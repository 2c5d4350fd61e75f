"""Runs give the same bits on every x86-64 processor (``tests/processors.py``)."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from processors import PYTHON, STEPS, compare_native, compare_python, difference


@pytest.mark.long
def test_a_start_and_its_first_steps_do_not_depend_on_the_libraries():
    assert compare_python("straight", "rigid", 20, ["all of them"]) == 0


@pytest.mark.study
@pytest.mark.parametrize("scene", ["straight", "turn"])
@pytest.mark.parametrize("links", ["flexible", "rigid"])
def test_python_fmus_give_the_same_bits_with_all_choices_of_the_libraries(scene, links):
    assert compare_python(scene, links, STEPS) == 0


@pytest.mark.study
@pytest.mark.parametrize("scene", ["straight", "turn"])
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
