"""The place of the tensioning wheel is computed once per build of the components."""

import pytest

from fmus import tensioning
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load

CONFIG = next(part.config for part in assemble(load("straight")).parts if part.kind == "TrackFlexible")


def test_a_place_is_found_again(monkeypatch, tmp_path):
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path))
    searched = []

    def search(config, name, tension, keys):
        searched.append(tension)
        return -4.0 + 1e-17 * tension / 3.0, tension / 7.0

    monkeypatch.setattr(tensioning, "_search", search)
    first = tensioning.tension_wheel(CONFIG, "idler", 1e4)
    assert tensioning.tension_wheel(CONFIG, "idler", 1e4) == first
    assert searched == [1e4]
    assert tensioning.tension_wheel(CONFIG, "idler", 1.01e4) != first, "another tension gives the same place"
    lighter = CONFIG | {"vehicle": CONFIG["vehicle"] | {"track": CONFIG["vehicle"]["track"] | {"mass": 1.0}}}
    tensioning.tension_wheel(lighter, "idler", 1e4)
    assert searched == [1e4, 1.01e4, 1e4], "another vehicle gives the stored place"
    for file in tmp_path.rglob("place"):
        file.write_bytes(file.read_bytes().replace(b"-", b"+"))
    assert tensioning.tension_wheel(CONFIG, "idler", 1e4) == first
    assert len(searched) == 4, "a damaged file is read"


def test_a_cache_that_cannot_be_used_costs_time_only(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path / "file"))
    monkeypatch.setattr(tensioning, "_search", lambda *asked: (-4.0, 2.0))
    assert tensioning.tension_wheel(CONFIG, "idler", 1e4) == (-4.0, 2.0)
    monkeypatch.setattr(tensioning, "_search", lambda *asked: (-5.0, 3.0))
    assert tensioning.tension_wheel(CONFIG, "idler", 1e4) == pytest.approx((-5.0, 3.0))
