"""A user's own master drives the standard FMUs to the same bits as ``cotrack run``."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest
from fmpy.fmi1 import FMICallException

from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.scene import products
from orchestrator.scene.scene import load
from tests import own_master

HERE = Path(__file__).resolve().parent
PROGRAM = """
import sys
sys.path.insert(0, sys.argv[1])
import own_master
for speed in (None, 20.5):
    print(own_master.main(sys.argv[2], sys.argv[3], stop=0.05, speed=speed))
"""
BRIEF = ("run.stop=0.05 s", "run.outputs=1", "drive.ramp_start=0 s", "drive.ramp_time=0.2 s")


def of(vehicle, model, tmp_path):
    """A short scene of a vehicle, and its FMUs: the robot's in an archive, all others in a folder."""
    scene = load(products.STANDARD, model, (*BRIEF, f"vehicle={vehicle}"))
    packed = tmp_path / "robot.ssp" if vehicle == "robot" else tmp_path
    if vehicle == "robot":
        products.write_ssp(scene, packed, native=False)
    else:
        products.build_to(tmp_path, products.scene_products([scene]))
    return scene, packed


@pytest.mark.long
@pytest.mark.parametrize(  # the sides of marder differ
    ("vehicle", "model", "kind"),
    [
        ("m113", "flexible", "TrackFlexible"),
        *((name, "rigid", "TrackRigid") for name in ("marder", "robot", "highdrive")),
    ],
)
def test_a_master_of_ones_own_does_what_cotrack_does(vehicle, model, kind, environment, tmp_path):
    scene, fmus = of(vehicle, model, tmp_path)
    alone = {key: value for key, value in environment.items() if key != "PYTHONPATH"}
    program = [sys.executable, "-c", PROGRAM, str(HERE), str(fmus), kind]
    done = subprocess.run(program, env=alone, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    outputs, faster = map(ast.literal_eval, done.stdout.splitlines())
    simulate(scene, tmp_path / "a.mcap")
    with Log(tmp_path / "a.mcap") as log:
        assert outputs == {name: log.signal(f"chassis.{name}")[1][-1] for name in outputs}
    assert faster != outputs
    assert abs(outputs["speed"]) > 0.01


@pytest.mark.long
def test_a_master_with_a_wrong_place_or_without_a_wheel_does_not(monkeypatch, tmp_path):
    """So what it reads from the descriptions counts: the lateral place by 2 %, and each wheel; some are refused."""
    _, fmus = of("robot", "rigid", tmp_path)
    load_right, wheels_right = own_master.load, own_master.wheels_of

    def outcome():
        try:
            return own_master.main(fmus, stop=0.0125)
        except FMICallException:
            return "refused"

    def load_beside(file, name):
        fmu, said, experiment = load_right(file, name)
        if "start.lateral" in said:
            said["start.lateral"].start = 1.02 * float(said["start.lateral"].start)
        return fmu, said, experiment

    right = outcome()
    assert right["chassis.position.x"] == pytest.approx(0.32, abs=1e-3)
    with monkeypatch.context() as patch:
        patch.setattr(own_master, "load", load_beside)
        assert outcome() != right
    for missing in ("left", "road_wheel[4]"), ("left", "idler"), ("right", "return_roller[2]"), None:

        def without(chassis, side, missing=missing):
            return [wheel for wheel in wheels_right(chassis, side) if (side, wheel) != missing]

        monkeypatch.setattr(own_master, "wheels_of", without)
        assert (outcome() == right) == (missing is None), missing
