"""Points of a sweep: grids, samples, values of keys, and what is refused before anything runs."""

import numpy as np
import pytest
from designs import shown
from scipy.stats import qmc

from fmus.vehicles.tables import BadInput
from orchestrator.studies import parameter_sweep
from orchestrator.studies.variations import MOST, Design


def test_a_grid_has_every_combination_in_exact_decimals():
    design = Design.of(["x.mu=0.3:0.8:6", "track.model=rigid, flexible", "rig.tension=20:40:3 kN"])
    numbers = [0.3, 0.4, 0.5, 0.6, 0.7, 0.8]
    assert shown(design) == [(x, m, f) for x in numbers for m in ("rigid", "flexible") for f in (20.0, 30.0, 40.0)]
    assert design.settings(design.points[10]) == ("x.mu=0.4", "track.model=flexible", "rig.tension=30 kN")
    assert [(one.key, one.unit, one.is_number) for one in design.variations] == [
        ("x.mu", "", True), ("track.model", "", False), ("rig.tension", "kN", True),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "numbers", "settings"),
    [
        ("k=20 kN,25 kN", [20.0, 25.0], ["20 kN", "25 kN"]),
        ("k=20,22.5, 25 kN", [20.0, 22.5, 25.0], ["20 kN", "22.5 kN", "25 kN"]),
        ("k=20 kN:40 kN:2", [20.0, 40.0], ["20 kN", "40 kN"]),
        ("k=1:-1:3", [1.0, 0.0, -1.0], ["1", "0", "-1"]),
        ("k=1e-3:1e-2:2", [1e-3, 1e-2], ["0.001", "0.01"]),
        ("k=5:9:1", [5.0], ["5"]),
        ("k=8,0.30,1e3", [8.0, 0.3, 1000.0], ["8", "0.30", "1e3"]),
        ("k=1 kN/m, 2 kN/m", [1.0, 2.0], ["1 kN/m", "2 kN/m"]),
        ("k=2,off", ["2", "off"], ["2", "off"]),
        ("k=0:1:4", [0.0, 1 / 3, 2 / 3, 1.0], ["0", repr(1 / 3), repr(2 / 3), "1"]),
    ],
)
def test_values_of_a_key(text, numbers, settings):
    design = Design.of([text])
    assert shown(design) == [(number,) for number in numbers]
    assert [design.settings(point)[0] for point in design.points] == [f"k={setting}" for setting in settings]


def test_a_latin_hypercube_is_that_of_scipy():
    design = Design.of(["a=2:1 s", "m=x,y", "b=-10:30"], sample=5, seed=3)
    unit = qmc.LatinHypercube(2, seed=np.random.default_rng(3)).random(5)
    points = qmc.scale(unit, [1.0, -10.0], [2.0, 30.0])
    assert shown(design) == [(a, m, b) for m in "xy" for a, b in points.tolist()]
    assert float(design.settings(design.points[0])[0][2:-2]) == points[0, 0], "a setting lost digits"
    for column, low, width in ((0, 1.0, 1.0), (1, -10.0, 40.0)):
        assert sorted(np.floor((points[:, column] - low) / width * 5)) == [0, 1, 2, 3, 4]
    assert shown(Design.of(["a=1:2 s", "m=x,y", "b=-10:30"], 5, 4)) != shown(design)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("x",), "vary x: must be KEY=a:b:n or KEY=x,y,z"),
        (("x=",), "must be KEY=a:b:n or KEY=x,y,z"),
        (("x=1,,2",), "a value is empty"),
        (("x=1,1",), "a value is given twice"),
        (("x=1 N,2 kN",), "all numbers must have one unit"),
        (("x=1,2 N,3 kN",), "all numbers must have one unit"),
        (("chain.span=0.7,0.8", "--for", "sga"), "for sga: did you mean 'sag'"),
        (("chain.span=0.7,0.8", "--for", "max"), "for max: needs a signal, as max:left_track.tension.max"),
        (("chain.span=0.7,0.8", "--for", "joints:chain"), "an analysis is given by its name alone"),
        (("x=1 N:2 kN:3",), "all numbers must have one unit"),
        (("x=1:2:0",), f"a whole number from 1 to {MOST}"),
        (("x=1:2:-3",), "a whole number from 1"),
        (("x=1:2:2.5",), "a whole number from 1"),
        (("x=1:2:1e999999999",), "a whole number from 1"),
        (("x=2:2:3",), "the range is empty"),
        (("x=:2:3",), "must be a:b:n"),
        (("x=a:b:3",), "must be a:b:n"),
        (("x=1:2:3:4",), "must be a:b:n"),
        (("x=1:1e999:3",), "must have finite ends"),
        (("x=1:2",), "a range a:b needs a number of points, a:b:n, or sample = N"),
        (("x=1,2", "--vary", "x=3,4"), "vary x: is given twice"),
        (("x=1:2:3", "--sample", 4), "sample 4: needs a range, vary KEY=a:b"),
        (("x=1:2", "--sample", 0), "sample 0: must be at least 1"),
        (("x=1:2", "--sample", 4, "--seed", -1), "seed -1: must be at least 0"),
        (("x=1:2", "--sample", 10**9), f"these are 1000000000 cases, and {MOST} are allowed"),
        (("x=0:1:200", "--vary", "y=0:1:51"), f"these are 10200 cases, and {MOST} are allowed"),
        (("chain.lnks=8,9",), "unknown key 'chain.lnks': did you mean 'chain.links'?"),
        (("chain.span=0.5:2:4",), "chain.span = "),
        (("chain.links=8:9:3",), "chain.links = 8.5"),
        (("chain.span=0.7 kg,0.8 kg",), "chain.span = '0.7 kg'"),
        (("track.model=rigid,soft",), "track.model = 'soft'"),
        (("track=rigid,flexible", "--track", "rigid"), "track=rigid,flexible: its key is set by another option"),
        (("run.stop=1,2", "--set", "run.stop=3"), "run.stop=1,2: its key is set by another option"),
    ],
)
def test_bad_input_is_one_sentence_before_anything_runs(cotrack, monkeypatch, tmp_path, options, said):
    monkeypatch.setattr(parameter_sweep, "simulate", lambda *_, **__: pytest.fail("a case has run"))
    status, out, err = cotrack("sweep", "hanging_chain", "--vary", *options, "-o", "found")
    assert (status, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_what_is_varied_must_be_given(cotrack):
    with pytest.raises(BadInput, match="a sweep needs a key to vary"):
        Design.of([])
    assert cotrack("sweep", "hanging_chain", "-o", "found")[0] == 2
    assert cotrack("sweep", "hanging_chian", "--vary", "x=1,2", "-o", "found")[2].endswith("'hanging_chain'?\n")
