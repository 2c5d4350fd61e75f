"""A vehicle in process runs as `cotrack run` does, to the bit, also with other parameters."""

import numpy as np
import pytest
from vehicle_in_process import InProcess

from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.scene.scene import load

BRIEF = (
    "run.stop=0.05 s", "run.step=1 ms", "track.step=1 ms", "run.outputs=1", "drive.ramp_start=0 s",
    "drive.ramp_time=0.2 s",
)  # fmt: skip


def test_it_does_what_a_run_of_fmus_does(tmp_path):
    scene = load("straight", "rigid", BRIEF)
    simulate(scene, tmp_path / "a.mcap")
    vehicle = InProcess(scene).run(0.02).run(0.03)
    with Log(tmp_path / "a.mcap") as log:
        for name, member in vehicle.members.items():
            series = log.read(f"/{name}/out")
            values = [member[output] for output in series.names if output != "status"]
            kept = [k for k, output in enumerate(series.names) if output != "status"]
            assert values == series.values[-1, kept].tolist(), name
    assert abs(vehicle["chassis"]["speed"]) > 0.01
    assert InProcess(scene).run(0.049)["chassis"]["speed"] != vehicle["chassis"]["speed"]


def test_parts_may_have_other_parameters():
    scene = load("straight", "rigid", BRIEF)
    faster = {"right_drive": {"speed.end": 30.0}, "*_track": {"contact.ground.friction": 0.6}}
    vehicle = InProcess(scene, faster).run(0.05)
    assert vehicle["right_drive"]["speed"] == pytest.approx(1.5 * vehicle["left_drive"]["speed"], rel=1e-12)
    for side in ("left", "right"):
        assert vehicle[f"{side}_track"].model.contacts.soil.mu == 0.6
    assert abs(vehicle["chassis"]["yaw"]) > 1e-7
    assert len(vehicle["left_track"].link_outputs()) == len(vehicle["left_track"].links) > 500
    assert vehicle["left_track"]["link[5].tension"] in vehicle["left_track"].link_outputs()
    assert vehicle["left_track"]["solver.steps"] == 50
    with pytest.raises(KeyError, match=r"right_drive has no parameter 'speed\.en'"):
        InProcess(scene, {"right_drive": {"speed.en": 30.0}})
    with pytest.raises(KeyError, match="no part is called 'right_motor'"):
        InProcess(scene, {"right_motor": {"speed.end": 30.0}})


def test_a_chain_alone_and_a_bench_run_too():
    chain = InProcess(load("hanging_chain", "flexible")).run(0.003)
    assert chain["chain"]["solver.steps"] == 3
    bench = InProcess(load("sprocket_bench", "rigid", ["drive.ramp_time=1 ms"]))
    moved = abs(bench["track"].model.s.vdot).max()  # m/s2; 0.03 where Newton's matrix does not know the pull's torque
    assert moved < 1e-5
    bench.run(0.01)
    assert bench["track"].u[bench["track"].inputs.index("sprocket.angular_velocity.y")] == bench["drive"]["speed"]
    assert np.isfinite(bench["track"].y).all()
