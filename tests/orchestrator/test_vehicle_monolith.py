"""The monolith of a vehicle: energy, third law, and convergence of co-simulation to it.

Monoliths with wheels or drives take half a minute to compile; these tests are studies.
"""

from itertools import pairwise

import named_ports
import numpy as np
import pytest
from vehicle_in_process import InProcess

from fmus.monolith.model import Monolith
from fmus.track.choices import TRACKS
from orchestrator.execution import monolithic
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results.difference import INTERVAL, differences_of_logs
from orchestrator.results.energy import ledger
from orchestrator.results.run_data import RunData, Window
from orchestrator.results.vehicle_measures import third_law
from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load

DRIVEN = ("run.stop=0.03", "run.links=10", "run.outputs=1", "drive.ramp_start=0", "drive.ramp_time=0.5")

AT_ONCE = ("drive.ramp_start=0", "drive.ramp_time=0.04")
JOINED = (*AT_ONCE, "drive.steering.ramp_start=0", "drive.steering.ramp_time=0.04")


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """Log of the monolith of the vehicle that drives off."""
    path = tmp_path_factory.mktemp("monolith") / "driven.mcap"
    outcome, cost = monolithic.run(load("straight", "flexible", ("run.step=1ms", *DRIVEN)), path)
    assert outcome.status == "ok"
    assert cost["internal_step"] == pytest.approx(8e-6)
    return path


@pytest.mark.study
def test_the_ledger_of_a_whole_vehicle_closes(driven):
    """The energy balance of a whole vehicle with contacts closes only with the covering losses."""
    with Log(driven) as log:
        books = ledger(RunData(log))
    assert books.dissipated > 0.5, "it starts standing, and settles by nothing"
    assert abs(books.residual) < 5e-3 * abs(books.covered)
    assert abs(books.covered) > 0.01


@pytest.mark.study  # compiles a monolith with both integrators
@pytest.mark.parametrize("links", TRACKS)
def test_adams_methods_drive_a_vehicle_to_their_tolerance(links, tmp_path):
    """Adams methods drive a vehicle to their tolerance.

    Contacts begin and end within steps; the method restarts at the ramp of the drives.
    """
    settings = ("run.step=1ms", "run.stop=0.03", "track.link_outputs=false", "drive.ramp_start=0.0105",
                "drive.ramp_time=0.01")  # fmt: skip
    scene, off = load("straight", links, settings), []

    def run(name, **how):
        outcome, cost = monolithic.run(scene, tmp_path / name, **how)
        assert outcome.status == "ok"
        with Log(tmp_path / name) as log:
            names = ("chassis.chassis.position.x", "chassis.chassis.position.z", "left_track.tension.mean")
            return np.array([log.signal(one)[1][-1] for one in names]), cost, ledger(RunData(log))

    fine, equal, _ = run("fine.mcap", refine=4.0)
    for tolerance, left in ((1e-4, 2.0), (1e-6, 0.1), (1e-8, 0.01)):
        x, cost, books = run("adams.mcap", integrator="adams", rtol=tolerance, atol=tolerance)
        off.append(abs(x - fine) / [1e-3, 1e-3, 1e3])
        assert cost["restarts"] == 3
        assert abs(books.residual) < left < 0.01 * books.dissipated
    assert off[0].max() < 1e-2
    assert off[2].max() < min(5e-5, off[0].max()), off
    assert cost["evaluations"] < 0.7 * equal["evaluations"]
    faster = load("straight", links, (*settings, "drive.speed=20.4"))
    monolithic.run(faster, tmp_path / "twin.mcap", integrator="adams")
    with Log(tmp_path / "twin.mcap") as log:
        assert abs(log.signal("left_track.tension.mean")[1][-1] - fine[2]) > 1.0, "the twin, 2 % faster, must differ"


def open_part(log, instance, gains, losses):
    """Energy residual of a component over the range of its port's work, and that of a twin."""
    parts = {name: log.signal(f"{instance}.{name}")[1] for name in (*gains, *losses)}
    total = sum(parts[name] for name in gains) - sum(parts[name] for name in losses)
    return np.ptp(total) / np.ptp(parts["port.work"]), np.ptp(total + 0.02 * parts["energy.kinetic"])


STORED = ("energy.kinetic", "energy.dissipated", "energy.gravity", "energy.spring")


@pytest.mark.study
def test_books_of_chassis_and_drives_close(driven):
    """Energy balances of chassis and drives close, with the spin at prescribed speed.

    Its work comes from mount and motor, and the chassis takes the reaction.
    """
    with Log(driven) as log:
        chassis, twin = open_part(log, "chassis", ("port.work",), STORED)
        assert chassis < 1e-9 < twin
        for drive in ("left_drive", "right_drive"):
            spin, twin = open_part(log, drive, ("port.work", "energy.work"), STORED[:2])
            assert spin < 1e-9 < twin


BOOKED = [  # scene, links, settings, drives
    *(("straight", "flexible", (*DRIVEN[1:3], "run.stop=0.02", f"drive.mode={mode}", *own), "left_drive")
      for mode, own in (("torque", ("drive.torque=2000",)), ("controller", AT_ONCE))),
    *(("differential", "rigid", ("run.outputs=1", *JOINED, f"drive.mode={mode}", f"drive.steering.mode={mode}",
                                 "run.stop=0.03"), "differential") for mode in ("speed", "controller")),
]  # fmt: skip


@pytest.mark.study
@pytest.mark.parametrize(("scene", "links", "settings", "drive"), BOOKED)
def test_books_of_drives_that_spin_by_themselves_or_joined_close(scene, links, settings, drive, tmp_path):
    more = ("run.step=1ms",) if scene == "straight" else ()
    monolithic.run(load(scene, links, (*more, *settings)), tmp_path / "a.mcap")
    with Log(tmp_path / "a.mcap") as log:
        assert open_part(log, "chassis", ("port.work",), STORED)[0] < 1e-9
        spin, twin = open_part(log, drive, ("port.work", "energy.work"), STORED[:2])
        assert spin < 1e-9 < twin


@pytest.mark.study
def test_a_speed_that_jumps(tmp_path):
    """A jump of the speed within a step equals a ramp of 0.1 ms.

    The motor does the work, and the chassis takes the reaction.
    """
    outcomes = []
    for ramp in ("0", "0.1 ms"):
        drive = ("drive.ramp_start=1.3 ms", f"drive.ramp_time={ramp}", "drive.speed=5")
        scene = load("straight", "flexible", ("run.step=1 ms", "run.stop=3 ms", "run.outputs=1", *drive))
        monolithic.run(scene, tmp_path / "a.mcap")
        with Log(tmp_path / "a.mcap") as log:
            names = ("energy.work", "port.work", "energy.kinetic")
            work, port, kinetic = (np.ptp(log.signal(f"left_drive.{name}")[1]) for name in names)
            assert kinetic == pytest.approx(0.5 * 13.87 * 5.0**2, rel=1e-2)
            assert abs(work - kinetic) == pytest.approx(port, abs=1e-5 * work)
            outcomes.append((work, log.signal("chassis.chassis.angular_velocity.y")[1][-1]))
    np.testing.assert_allclose(*outcomes, rtol=0.05)


@pytest.mark.study
def test_third_law_of_the_vehicle(driven, scaled):
    with Log(driven) as log:
        run = RunData(log)
        assert third_law(run, "", Window(0.0, 0.03)) < 1e-12
        scaled(log, "/chassis/in", "left.road_wheel[3].force.z", 1.02)
        assert third_law(run, "", Window(0.0, 0.03)) > 1e-6


OBSERVABLES = ("chassis.chassis.position.x", "chassis.chassis.velocity.x", "chassis.pitch")


def at_the_end(path, observables=OBSERVABLES):
    with Log(path) as log:
        return np.array([log.signal(name)[1][-1] for name in observables])


@pytest.fixture(scope="module")
def coupled(tmp_path_factory):
    """Logs of the same by co-simulation, by step; the components' steps shrink with it."""
    folder, logs = tmp_path_factory.mktemp("coupled"), {}
    for h in (1e-3, 5e-4, 2.5e-4):
        settings = (f"run.step={h}", f"track.step={h / 2}", *DRIVEN, f"run.links={round(INTERVAL / h)}")
        logs[h] = folder / f"{h}.mcap"
        assert simulate(load("straight", "flexible", settings), logs[h])["status"] == "ok"
    return logs


def misfit(coupled, path):
    """Part of the coupling's error that is not linear in H, by extrapolation to 0, over the error."""
    fine, finer, end = (at_the_end(log) for log in (coupled[5e-4], coupled[2.5e-4], path))
    return np.abs(2.0 * finer - fine - end) / np.abs(finer - end)


@pytest.mark.study
def test_co_simulation_converges_to_the_monolith(driven, coupled):
    error = {h: np.abs(at_the_end(log) - at_the_end(driven)) for h, log in coupled.items()}
    for h in (1e-3, 5e-4):
        order = np.log2(error[h] / error[h / 2])
        assert np.all(np.abs(order - 1.0) < 0.25), order
    assert np.all(misfit(coupled, driven) < 0.2)


@pytest.mark.study
def test_joint_forces_converge_to_those_of_the_monolith(driven, coupled):
    """Joint forces converge to those of the monolith, because both logs hold means over INTERVAL."""
    error = {h: differences_of_logs(log, driven)["joint_force"].relative for h, log in coupled.items()}
    for h in (1e-3, 5e-4):
        assert error[h] / error[h / 2] > 1.6, error


@pytest.mark.study
def test_another_vehicle_is_not_what_it_converges_to(coupled, tmp_path):
    heavier = ("run.step=1ms", "vehicle.chassis.mass=5600", *DRIVEN)
    monolithic.run(load("straight", "flexible", heavier), tmp_path / "twin.mcap")
    assert np.max(misfit(coupled, tmp_path / "twin.mcap")) > 0.4


PIVOT = ("run.stop=0.05", "run.outputs=1", "drive.ramp_start=0", "drive.ramp_time=0.1",
         "drive.left.speed=-10", "drive.right.speed=10")  # fmt: skip
TURNED = ("chassis.yaw", "chassis.chassis.angular_velocity.z", "chassis.chassis.position.y", "chassis.pitch")


@pytest.fixture(scope="module")
def pivoted(tmp_path_factory):
    """Log of the monolith of the vehicle that begins to turn on the spot, on cables with free axes."""
    path = tmp_path_factory.mktemp("pivot") / "pivot.mcap"
    outcome, cost = monolithic.run(load("turn", "flexible", ("run.step=1ms", *PIVOT)), path)
    assert outcome.status == "ok"
    assert cost["internal_step"] == pytest.approx(2.11e-6, rel=0.01)  # limited by the bending about the normal
    return path


@pytest.mark.study
def test_books_of_a_turn_close(pivoted, scaled):
    with Log(pivoted) as log:
        run = RunData(log)
        books = ledger(run)
        assert books.dissipated > 300.0
        assert abs(books.residual) < 5e-3 * abs(books.covered)
        assert third_law(run, "", Window(0.0, 0.05)) < 1e-12


@pytest.mark.study
def test_co_simulation_of_a_turn_converges_to_the_monolith(pivoted, tmp_path):
    """Co-simulation of a turn converges linearly to the monolith, not to one with a sprocket 2 % faster."""
    ends, path = {}, tmp_path / "a.mcap"
    for h, *other in ((1e-3,), (5e-4,), (2.5e-4,), (2.5e-4, "drive.right.speed=10.2")):
        settings = (f"run.step={h}", f"track.step={h / 2}", *PIVOT, *other)
        assert simulate(load("turn", "flexible", settings), path)["status"] == "ok"
        ends[h, *other] = at_the_end(path, TURNED)
    truth = at_the_end(pivoted, TURNED)
    coarse, fine, finer, twin = ends.values()
    for one, half in ((coarse, fine), (fine, finer)):
        order = np.log2(np.abs((one - truth) / (half - truth)))
        assert np.all(np.abs(order - 1.0) < 0.3), order
    left = np.abs(2.0 * finer - fine - truth)
    assert np.all(left < 0.3 * np.abs(finer - truth))
    assert np.all(left < 0.1 * np.abs(twin - finer))


@pytest.mark.study
def test_cables_begin_to_turn_as_rigid_links_do(pivoted, tmp_path):
    monolithic.run(load("turn", "rigid", ("run.step=1ms", *PIVOT)), tmp_path / "a.mcap")
    rigid, cables = (at_the_end(path, TURNED[:2]) for path in (tmp_path / "a.mcap", pivoted))
    np.testing.assert_allclose(cables[1], rigid[1], rtol=2e-3)
    np.testing.assert_allclose(cables[0], rigid[0], rtol=0.05)  # elasticity matters until the chains slide


def outputs(models):
    """Real outputs of the models of a vehicle, by name."""
    values = {}
    for name, model in models.items():
        values |= {f"{name}.{port}": value for port, value in named_ports.outputs(model, links=False).items()}
    return values


def whole(scene, *settings, steps, h=1e-3):
    """Outputs of the monolith of a scene on rigid links after ``steps`` steps of ``h`` s."""
    assembly = assemble(placed(load(scene, "rigid", ("track.link_outputs=false", *settings))))
    monolith = Monolith(monolithic.parts_of(assembly), assembly.connections)
    for k in range(steps):
        monolith.advance(k * h, h)
    return outputs(monolith.models)


@pytest.mark.study
@pytest.mark.parametrize(("brake", "holds"), [(25e3, True), (2.5e3, False)])
def test_a_brake_holds_or_slips(brake, holds):
    """On 20 %: a sprocket at rest; or heat of torque times angle, a closed ledger, and the co-simulation's angle."""
    settings = "drive.mode=torque", f"drive.brake={brake}"
    y = whole("hold", *settings, steps=60)
    drive = {name.removeprefix("left_drive."): value for name, value in y.items() if name.startswith("left_drive.")}
    assert (drive["speed"] == drive["angle"] == 0.0) == holds
    assert drive["energy.dissipated"] == pytest.approx(brake * abs(drive["angle"]), rel=1e-9)
    assert drive["port.work"] == pytest.approx(drive["energy.dissipated"] + drive["energy.kinetic"], abs=1e-8)
    if not holds:
        steps = "run.step=0.25 ms", "track.step=0.25 ms"
        coupled = InProcess(load("hold", "rigid", (*settings, *steps))).run(0.06)["left_drive"]
        assert coupled["angle"] == pytest.approx(drive["angle"], rel=4e-3)


@pytest.mark.study  # compiles two monoliths
def test_a_differential_with_prescribed_speeds_is_two_drives():
    joined, apart = whole("differential", *JOINED, steps=50), whole("turn", *AT_ONCE, steps=50)
    of_drives = {"energy.work": "work"}
    for name, value in apart.items():
        instance, _, port = name.partition(".")
        same = name
        if instance.endswith("_drive"):
            if port.startswith("energy") and port not in of_drives:
                continue
            same = f"differential.{instance.removesuffix('_drive')}.{of_drives.get(port, port)}"
        if same in joined:
            assert joined[same] == pytest.approx(value, rel=1e-9, abs=1e-9), name
    assert abs(joined["chassis.yaw"]) > 1e-6
    powers = [joined[f"differential.{name}.power"] for name in ("left", "right", "propulsion", "steering")]
    assert sum(powers[:2]) == pytest.approx(sum(powers[2:]), rel=1e-9)
    assert sum(powers[:2]) != pytest.approx(1.02 * sum(powers[2:]), rel=1e-3)


@pytest.mark.study
@pytest.mark.parametrize("motors", [(), ("drive.steering.mode=controller", "drive.mode=controller")])
def test_driven_co_simulation_goes_to_the_monolith(motors):
    """Driven co-simulation converges to the monolith with order 1, for all motors."""
    path = ("driver.arcs=[[0.05, 0], [9, 0.3]]", "driver.reach=0.5", "driver.preview=0.2", "driver.ramp_start=0",
            "driver.ramp_time=0.1", *motors)  # fmt: skip
    names = ("chassis.chassis.position.x", "chassis.chassis.velocity.x")
    errors = []
    for ms in (1.0, 0.5, 0.25):
        truth = np.array([whole("serpentine", *path, steps=round(120 / ms), h=ms * 1e-3)[name] for name in names])
        steps = f"run.step={ms} ms", f"track.step={ms} ms", "track.link_outputs=false"
        vehicle = InProcess(load("serpentine", "rigid", (*path, *steps))).run(0.12)
        errors.append(np.array([vehicle["chassis"][name.removeprefix("chassis.")] for name in names]) - truth)
    assert (abs(truth - [-2.0, 0.0]) > 10.0 * abs(errors[0])).all()
    for error, halved in pairwise(errors):
        order = np.log2(error / halved)
        assert np.all(abs(order - 1.0) < 0.3), order


@pytest.mark.study
@pytest.mark.parametrize(("model", "axes"), [("flexible", ()), ("flexible", ("track.axes=free",)), ("rigid", ())])
def test_both_sides_are_what_one_side_says(model, axes):
    """The mirrored vehicle equals the whole one."""
    assembly = assemble(placed(load("straight", model, (*DRIVEN, *axes))))
    ends = []
    for halved in (True, False):
        whole = Monolith(monolithic.parts_of(assembly), assembly.connections, halved=halved)
        for k in range(10):
            whole.advance(k * 1e-3, 1e-3)
        ends.append(whole.models)
    for name, part in ends[0].items():
        reals = sum(p.causality == "output" and isinstance(p.start, float) for p in part.ports)
        shown = np.zeros((2, reals - part.link_ports))
        for y, models in zip(shown, ends, strict=True):
            models[name].outputs(y)
        assert np.allclose(*shown, rtol=1e-7, atol=1e-6), name


@pytest.mark.study
@pytest.mark.parametrize("ground", ["ground.grade=0.2", "ground.half_round={x=[-1.2], radius=0.08}"])
def test_co_simulation_on_a_slope_and_on_an_obstacle_goes_to_the_monolith(ground, tmp_path):
    """The error falls with order 1, and is less than that of motions and forces that come half a step late."""
    settings = (ground, "symmetric=true", "run.stop=0.03", "run.outputs=1", "drive.ramp_start=0", "drive.ramp_time=0.1",
                "track.link_outputs=false")  # fmt: skip

    def written(name, step, go):
        go(load("straight", "rigid", (*settings, f"run.step={step}", f"track.step={step}")), tmp_path / name)
        return tmp_path / name

    steps = (1e-3, 0.5e-3, 0.25e-3)
    reference = written("monolith.mcap", 1e-3, monolithic.run)
    errors = [
        differences_of_logs(written(f"{step}.mcap", step, simulate), reference)["velocity"].absolute for step in steps
    ]
    with Log(reference) as log:
        t, velocity = RunData(log).vectors("chassis", "out", "chassis.velocity")
    changes = np.diff(velocity, axis=0) / np.diff(t)[:, None]
    late = 0.5 * steps[0] * np.sqrt(np.mean(np.sum(changes**2, axis=1)))
    assert 0.1 * late < errors[0] < late
    for error, halved in pairwise(errors):
        assert abs(np.log2(error / halved) - 1.0) < 0.3, errors
