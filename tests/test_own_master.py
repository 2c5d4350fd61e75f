"""A user's own master drives the standard FMUs to the same bits as ``cotrack run``."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.scene import products
from orchestrator.scene.scene import load

HERE = Path(__file__).resolve().parent
PROGRAM = """
import sys
sys.path.insert(0, sys.argv[1])
import own_master
for speed in (None, 20.5):
    print(own_master.main(sys.argv[2], sys.argv[3], stop=0.05, speed=speed))
"""
BRIEF = ("run.stop=0.05 s", "run.outputs=1", "drive.ramp_start=0 s", "drive.ramp_time=0.2 s")


@pytest.mark.long
@pytest.mark.parametrize(("model", "kind"), [("flexible", "TrackFlexible"), ("rigid", "TrackRigid")])
def test_a_master_of_ones_own_does_what_cotrack_does(model, kind, environment, tmp_path):
    products.build_to(tmp_path, products.scene_products([load(products.STANDARD, model, BRIEF)]))
    alone = {key: value for key, value in environment.items() if key != "PYTHONPATH"}
    program = [sys.executable, "-c", PROGRAM, str(HERE), str(tmp_path), kind]
    done = subprocess.run(program, env=alone, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    outputs, faster = map(ast.literal_eval, done.stdout.splitlines())
    simulate(load("straight", model, BRIEF), tmp_path / "a.mcap")
    with Log(tmp_path / "a.mcap") as log:
        assert outputs == {name: log.signal(f"chassis.{name}")[1][-1] for name in outputs}
    assert faster != outputs
    assert abs(outputs["speed"]) > 0.01
