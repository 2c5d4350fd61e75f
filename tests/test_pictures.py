"""Pictures of the pages are those that the present code draws, and each is on a page."""

import json
import re
from pathlib import Path

import pytest

from tests.pictures import FOLDER, HASHES, PICTURES, ROOT, Picture, source_hash


def test_each_picture_of_the_pages_is_made_by_the_command():
    pages = [path for name in ("orchestrator", "fmus") for path in (ROOT / name).rglob("*.md")]
    shown = {
        Path(target).name
        for page in [ROOT / "README.md", *pages]
        for target in re.findall(r"\((\S+\.(?:png|gif))\)", page.read_text(encoding="utf-8"))
    }
    assert shown == set(PICTURES) == {path.name for path in FOLDER.iterdir()} - {HASHES.name}


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_is_as_new_as_the_code_that_draws_it(name):
    made = json.loads(HASHES.read_text())
    assert made[name] == source_hash(PICTURES[name]), f"python -m tests.pictures {name}"


def test_comments_and_docstrings_draw_nothing(tmp_path):
    def of(text):
        (tmp_path / "a.py").write_text(text)
        return source_hash(Picture(None, (str(tmp_path),)))

    assert of('"""A."""\nx = 1  # one\n') == of("x = 1\n") != of("x = 2\n")
