"""A toy kind of track is two new files and one declaration: every room of the house then knows it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
NEW = {
    "fmus/track_toy/model.py": '''"""Rigid links of twice the mass."""

from fmus.track_rigid import model as rigid


class Model(rigid.Model):
    def __init__(self, config):
        track = config["vehicle"]["track"]
        heavy = {**track, "mass": 2.0 * track["mass"], "inertia": [2.0 * each for each in track["inertia"]]}
        super().__init__({**config, "vehicle": {**config["vehicle"], "track": heavy}})
''',
    "fmus/track_toy/track_toy_fmu.py": '''"""The FMU shell of the toy track."""

from fmus.fmi.slave import Slave
from fmus.track_toy.model import Model


class TrackToy(Slave):
    """Chain of toy links."""

    model = Model
''',
}
DECLARATION = 'TRACKS["toy"] = TRACKS["rigid"]._replace(fmu="TrackToy", links="toy links")\n'
SETTINGS = ("run.stop=0.02", "chain.links=8", "expect={}")

PROGRAM = f"""
import json
from pathlib import Path
from fmus.monolith.model import Monolith
from fmus.native.pack import with_constants
from fmus.vehicles.tables import BadInput
from orchestrator.cli.inventory import lines
from orchestrator.execution.monolithic import parts_of
from orchestrator.execution.replay_model import open_replay
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load
from orchestrator.scene.tables import Check

settings, found = {SETTINGS}, {{}}
for model in ("rigid", "toy"):
    scene, log = load("hanging_chain", model, settings), Path(f"{{model}}.mcap")
    simulate(scene, log, estimated=False)
    with Log(log) as read:
        found[model] = read.signal("chain.tension.max")[1][-1]
with open_replay(Path("toy.mcap"), "chain", None) as again:
    found["equal"], found["steps"] = again.verify().equal, again.verify().steps
with open_replay(Path("rigid.mcap"), "chain", "toy") as again:
    found["swapped"] = again.model.fmu.name
part = assemble(scene).parts[0]
found["native"] = set(with_constants(part.kind, part.config, part.parameters)["parameters"]) <= set(part.parameters)
found["monolith"] = type(Monolith(parts_of(assemble(scene)), ()).models["chain"]).__module__
found["check"] = Check(signal="chain.travel", track="toy", expected=1, tolerance=1).track
found["shown"] = list(lines(scene))
chosen = [*settings, "track.formulation=recursive", "track.integrator=runge_kutta"]
found["parameters"] = assemble(load("hanging_chain", "toy", chosen)).parts[0].parameters
for model in ("flexible", "toy"):
    try:
        load("hanging_chain", model, chosen[:-1])
    except BadInput as error:
        found[model + ", recursive"] = str(error)
for key in ("element=beam", "model=jelly"):
    try:
        load("hanging_chain", "toy", [*settings, f"track.{{key}}"])
    except BadInput as error:
        found[key] = str(error)
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def called(tmp_path_factory):
    """Return a function that gives the output of a Python process in a copy of the product with a toy kind of track."""
    folder = tmp_path_factory.mktemp("house")
    for package in ("fmus", "orchestrator"):
        shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__", "*.md"))
    for name, text in NEW.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    with (folder / "fmus" / "track" / "choices.py").open("a", encoding="utf-8") as declared:
        declared.write(DECLARATION)

    def call(*arguments):
        env = {**os.environ, "PYTHONPATH": str(folder)}
        done = subprocess.run([sys.executable, *arguments], cwd=folder, env=env, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return call


@pytest.mark.long
def test_a_toy_kind_of_track_is_known_everywhere(called):
    answers = json.loads(called("-c", PROGRAM).splitlines()[-1])
    assert answers["toy"] == pytest.approx(2.0 * answers["rigid"], rel=1e-9), "its links have twice the weight"
    assert (answers["equal"], answers["steps"]) == (True, 20)
    assert answers["swapped"] == "TrackToy.fmu"
    assert answers["native"], "what a native FMU of it holds for good"
    assert answers["monolith"] == "fmus.track_toy.model"
    assert answers["check"] == "toy"
    shown = "\n".join(answers["shown"])
    assert "chain        TrackToy 8 bodies, 7 pins" in shown
    assert "the rigid track model (TrackRigid)" in shown
    assert "fmus.track_toy: model, track_toy_fmu" in shown
    assert (answers["parameters"]["formulation"], answers["parameters"]["integrator"]) == ("recursive", "runge_kutta")
    assert answers["toy, recursive"].endswith(
        "integrator = 'generalized_alpha' must be 'runge_kutta', 'adams' or 'dormand_prince'"
    )
    needs = "formulation = 'recursive' needs model = 'rigid' or 'toy': flexible links have none"
    assert answers["flexible, recursive"].endswith(needs)
    assert answers["element=beam"].endswith("element = 'beam' needs model = 'flexible': toy links have none")
    assert answers["model=jelly"].endswith('must be "flexible" or "rigid" or "toy"')
    assert "--track <flexible|rigid|toy>" in called("-m", "orchestrator", "show", "--help")
    assert "TrackToy" in called("-m", "orchestrator", "show", "hanging_chain", "--track", "toy")
