"""Exchanges of other masters: all parts at once, too long steps; what the parts do and say about them."""

import numpy as np
import pytest
from vehicle_in_process import InProcess

from fmus.drives.mount import MOUNT
from fmus.interface.model import StepFailed
from fmus.interface.ports import WRENCH
from fmus.interface.wrenches import LONG_EXCHANGE, expected, keep, received
from orchestrator.scene.scene import load

H = 1e-3
MOVING = "drive.ramp_start=0", "drive.ramp_time=3"


def driven(step, seconds, at_once=False, extrapolate="no", scene="straight", links="rigid", settings=MOVING):
    """Time, settlement, mean and largest tension of each step, and what the parts say of the exchange."""
    every = {"extrapolate": extrapolate}
    vehicle = InProcess(
        load(scene, links, [f"run.step={step!r} s", "track.step=1 ms", f"run.stop={seconds!r} s", *settings]),
        {"*_drive": every, "chassis": every},
    )
    rows, said = [], []
    for _ in range(round(seconds / step)):
        try:
            vehicle.step(at_once=at_once)
        except StepFailed:
            break
        track = vehicle["left_track"]
        rows.append([vehicle.t, vehicle["chassis"]["settlement"], track["tension.mean"], track["tension.max"]])
        texts = [(member.name, text) for member in vehicle.members.values() for text in member.model.warnings()]
        said += [(vehicle.t, name, text) for name, text in texts if LONG_EXCHANGE in text]
    return np.array(rows), said


@pytest.fixture(scope="module")
def right():
    return driven(0.25e-3, 1.0)


@pytest.mark.long
def test_a_part_says_that_the_step_is_too_long_before_the_tension_is_wrong(right):
    """All at once in steps of 12.5 ms, where the tension would reach 50 times the right one."""
    rows, said = driven(12.5e-3, 1.0, at_once=True)
    wrong = rows[np.argmax(rows[:, 3] > 2.0 * right[0][:, 3].max()), 0]
    assert rows[:, 3].max() > 4.0 * right[0][:, 3].max()
    first = {name.rpartition("_")[2]: time for time, name, _ in reversed(said)}
    assert set(first) == {"track", "chassis"}
    assert min(first.values()) < wrong
    assert max(first.values()) < 0.5
    assert len({text.partition("=")[2][:20] for _, name, text in said if name == "chassis"}) == 1  # once
    texts = dict((name, text) for _, name, text in said)
    assert "J of nothing" in texts["left_track"] or "what it rests on" in texts["left_track"]
    assert "the force of left." in texts["chassis"] or "the force of right." in texts["chassis"]


@pytest.mark.long
def test_extrapolation_in_too_long_steps_is_told(right):
    rows, said = driven(4e-3, 1.0, True, "linear")
    assert said[0][0] < 0.3
    assert rows[: round(said[0][0] / 4e-3), 3].max() < 2.0 * right[0][0, 3]


@pytest.mark.parametrize(("step", "at_once"), [(H, False), (4e-3, False), (2e-3, True)])
def test_no_part_complains_of_an_exchange_that_is_right(step, at_once):
    assert driven(step, 0.6, at_once)[1] == []


def test_a_master_that_steps_all_at_once_starts_at_rest():
    """The chassis begins with the pull of the standing tracks on its mounts: without it the hull is kicked."""
    speeds = []
    for pulls in (True, False):
        vehicle = InProcess(load("straight", "rigid", ["run.step=1 ms", "track.step=1 ms", "run.stop=1 s"]))
        for side in ("left", "right") if not pulls else ():
            drive = vehicle[f"{side}_drive"]
            drive.model.state[MOUNT : MOUNT + WRENCH] = 0.0
            drive.model.outputs(drive.y)
        vehicle.step(at_once=True)
        velocity = [vehicle["chassis"][f"chassis.velocity.{axis}"] for axis in "xyz"]
        speeds.append(float(np.linalg.norm(velocity)))
    assert speeds[0] < 1e-5 < 2e-3 < speeds[1]


@pytest.mark.parametrize("settings", [(), ("start.heading=0.7",), ("drive.steering={speed=1}",)])
def test_the_wrench_on_a_mount_at_the_start_is_that_of_the_track(settings):
    """A drive shows before the first step what its track, which comes to rest by itself, does to its sprocket."""
    vehicle = InProcess(load("straight", "rigid", ["run.stop=1 s", *settings]))
    for side in ("left", "right"):
        driven_alone = f"{side}_drive" in vehicle.members
        drive, before = (f"{side}_drive", "mount") if driven_alone else ("differential", f"{side}.mount")
        for what in ("force", "torque"):
            own = np.array([vehicle[f"{side}_track"][f"sprocket.{what}.{axis}"] for axis in "xyz"])
            shown = np.array([vehicle[drive][f"{before}.{what}.{axis}"] for axis in "xyz"])
            assert np.linalg.norm(shown - own) < 2e-3 * max(np.linalg.norm(own), 1e3), (side, what, shown, own)
            assert np.linalg.norm(own) > 60.0


@pytest.mark.long
def test_extrapolated_wrenches_make_steps_at_once_as_good_as_ours(right):
    """Errors of hull height and tension at 1 ms: ours, at once, at once with extrapolated wrenches."""
    fine = right[0][3::4]  # at the ends of steps of 1 ms
    errors = {}
    for name, at_once, extrapolate in (("ours", False, "no"), ("held", True, "no"), ("extrapolated", True, "linear")):
        rows = driven(H, 1.0, at_once, extrapolate)[0]
        np.testing.assert_allclose(rows[:, 0], fine[:, 0], atol=1e-9)
        errors[name] = np.sqrt(((rows[:, 1:3] - fine[:, 1:3]) ** 2).mean(0))
    assert (errors["held"] > 2.0 * errors["ours"]).all()
    assert (errors["extrapolated"] < 1.25 * errors["ours"]).all()


def test_extrapolation_is_exact_for_wrenches_that_rise_evenly():
    """Means of t -> a + b t over steps of any lengths; held wrenches are not."""
    rng = np.random.default_rng(3)
    a, b = rng.standard_normal((2, WRENCH))
    r, u, out = np.zeros(received(WRENCH)), np.zeros(WRENCH + 2), np.zeros(WRENCH + 2)
    t, last = 0.0, 0.0
    for k, h in enumerate(rng.uniform(0.5e-3, 2e-3, 6)):
        u[2:] = a + b * (t - 0.5 * last)  # mean over the step before
        out[:] = u
        expected(r, u, 2, h, out)
        keep(r, u, 2, h)
        assert np.allclose(out[2:], a + b * (t + 0.5 * h), rtol=1e-12, atol=1e-15) == (k >= 2)
        t, last = t + h, h


def test_an_impulse_that_the_first_step_missed_is_made_up_for():
    r, u, out, given = np.zeros(received(WRENCH)), np.zeros(WRENCH), np.zeros(WRENCH), 0.0
    for k in range(4):
        u[:] = 5.0 * (k > 0)  # the first one is that of a start without a step
        out[:] = u
        expected(r, u, 0, H, out)
        keep(r, u, 0, H)
        given += out[0]
    assert given == 20.0
