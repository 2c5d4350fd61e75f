"""FMUs of the user in place of parts of a scene: they drive, are connected further, and are told apart."""

import json
import math
import shutil

import foreign_fmus
import numpy as np
import pytest
from foreign_drive import INERTIA, PARAMETERS, SHORT, TORQUE, H, brake_fmu, braked, changed, rig
from foreign_fmus import DRIVE, UNITS, Variable

from fmus.fmi.build import build
from fmus.vehicles.tables import BadInput
from orchestrator.cosim.graph import Connection
from orchestrator.execution import monolithic, truth
from orchestrator.execution.replay_model import open_replay
from orchestrator.execution.resume import resume
from orchestrator.execution.simulate import simulate
from orchestrator.execution.summary_text import lines
from orchestrator.files.progress import Progress
from orchestrator.log.reader import Log
from orchestrator.results.run_data import RunData
from orchestrator.scene.assembly import assemble, system
from orchestrator.scene.commented_file import scene_text
from orchestrator.scene.placing import placed
from orchestrator.scene.products import scene_products, write_ssp
from orchestrator.scene.replacement import End, interface_mismatches, typed
from orchestrator.scene.scene import load

TEXTS = ("gear", "Integer", 1), ("on", "Boolean", False), ("word", "String", "")  # further variables of `gain`
OWN = {**SHORT, "drive": {"mode": "torque", "torque": TORQUE}, "vehicle.sprocket.spin_inertia": INERTIA}


@pytest.fixture(scope="module")
def driven(drive, tmp_path_factory):
    """Log and summary of the rig with that drive."""
    path = tmp_path_factory.mktemp("driven") / "rig.mcap"
    return path, simulate(rig(drive), path)


@pytest.mark.long
def test_a_copy_of_our_own_drive_gives_the_same_records(tmp_path, cotrack):
    """Log and digest are those of the scene without --replace; the log says what ran."""
    settings = [f"--set={key}={json.dumps(value)}" for key, value in SHORT.items()]
    own = next(part for part in assemble(placed(rig())).parts if part.name == "drive")
    shutil.copy(build(own.kind, own.config), tmp_path / "MyDrive.fmu")
    runs = {}
    for name, options in (("own", ()), ("replaced", ("--replace", "drive=MyDrive.fmu"))):
        log = tmp_path / f"{name}.mcap"
        said = cotrack("run", "rig", "--track", "rigid", *settings, "--no-estimate", *options, "-o", log)
        assert said[0] == 0, said
        with Log(log) as opened:
            instances = {each["name"]: each for each in opened.table("system.json")["instances"]}
            runs[name] = opened.digest(), instances["drive"], opened.table("scene.json")
    assert runs["own"][0] == runs["replaced"][0]
    assert runs["replaced"][1]["parameters"].items() <= runs["own"][1]["parameters"].items()  # which has all numbers
    assert runs["own"][1]["sha256"] == runs["replaced"][1]["sha256"]
    assert runs["replaced"][1]["fmu"] == "MyDrive.fmu"
    assert runs["replaced"][2]["fmu"] == {
        "drive": {"file": str(tmp_path / "MyDrive.fmu"), "parameters": {}, "in_process": False, "non_finite": "fail"}
    }
    assert "fmu" not in runs["own"][2]


def test_a_foreign_drive_drives(driven):
    """Its momentum is the impulse of its torque and of the chain's, to rounding; its work is all that there is."""
    path, summary = driven
    assert summary["status"] == "ok", summary["message"]
    with Log(path) as log:
        outputs, inputs = log.read("/drive/out"), log.read("/drive/in")
        speed = outputs.values[:, outputs.names.index("speed")]
        angle = outputs.values[:, outputs.names.index("angle")]
        chain = inputs.values[:, inputs.names.index("sprocket.torque.y")]
        momentum = INERTIA * np.diff(speed)
        assert np.abs(momentum - H * (TORQUE + chain)).max() < 1e-12 * np.abs(momentum).max() + 1e-12
        assert np.abs(chain).max() > 100.0
        assert angle[-1] == pytest.approx(H * (speed[1:-1].sum() + 0.5 * speed[-1]), rel=1e-12)
        run = RunData(log)
        held = 0.5 * INERTIA * speed[-1] ** 2
        for part in ("track", "idler_drive"):
            for kind in ("kinetic", "strain", "contact", "dissipated", "covered"):
                if run.has(signal := f"{part}.energy.{kind}"):
                    start, end = run.ends(signal)
                    held += end - start
        assert held == pytest.approx(TORQUE * angle[-1], rel=0.02)


@pytest.mark.long
def test_a_foreign_drive_turns_as_ours_with_the_same_torque(driven, tmp_path):
    simulate(load("rig", "rigid", OWN), tmp_path / "own.mcap")
    with Log(driven[0]) as foreign, Log(tmp_path / "own.mcap") as own:
        (_, there), (_, here) = foreign.signal("drive.speed"), own.signal("drive.speed")
    assert np.abs(there - here).max() < 2e-3 * np.abs(here).max()
    assert np.abs(here).max() > 0.1


@pytest.mark.study
def test_foreign_drives_move_a_vehicle_as_ours_do(drive, tmp_path):
    """Their mounts are where the vehicle is from the start on; the log holds the inputs of the start for replays."""
    inertia, logs = load("straight").vehicle.sprocket.spin_inertia, {}
    given = {"file": str(drive), "parameters": {"torque": TORQUE, "inertia": inertia}}
    parts = {"fmu": {"left_drive": given, "right_drive": given}}
    for name, settings in (("own", {"drive": OWN["drive"]}), ("foreign", parts)):
        logs[name] = tmp_path / f"{name}.mcap"
        summary = simulate(load("straight", "rigid", {**SHORT, "run.stop": 0.05, **settings}), logs[name])
        assert [math.isnan(phase["power"]) for phase in summary["phases"]] == [name == "foreign"]
    with Log(logs["own"]) as own, Log(logs["foreign"]) as foreign:
        for signal in ("chassis.speed", "left_drive.angle", "right_track.tension.mean"):
            (_, here), (_, there) = own.signal(signal), foreign.signal(signal)
            assert np.abs(there - here).max() < 0.01 * np.abs(here).max(), signal
        instances = {each["name"]: each for each in foreign.table("system.json")["instances"]}
        assert instances["right_drive"]["inputs"]["mount.position.y"] == pytest.approx(-1.0795)
        assert "inputs" not in instances["chassis"]
    with open_replay(logs["foreign"], "left_drive", str(drive)) as replay:
        assert replay.verify().equal


def test_what_a_foreign_drive_lacks_is_said(driven):
    """Units, outputs and energies; its other outputs are recorded."""
    path, summary = driven
    texts = [warning["text"] for warning in summary["warnings"] if warning["component"] == "drive"]
    assert texts == [
        "the FMU has no outputs torque, energy.kinetic, energy.work, energy.dissipated, port.work, power,"
        " solver.steps, solver.evaluations: results that need them are missing; it outputs no energies: the energy"
        " balance takes what passes its ports as delivered to it"
    ]
    assert summary["components"]["drive"]["steps"] == 100
    with Log(path) as log:
        _, fast = log.signal("stats.drive.fast")
        _, speed = log.signal("drive.speed")
        assert set(fast) == {0.0, 1.0}
        assert fast[-1] == (speed[-1] > 1.0)


def test_work_of_a_foreign_drive_is_what_its_ports_delivered(driven):
    """Its motor's work less its energy of motion; that of 1 % less torque is told from it."""
    path, summary = driven
    assert summary["energy"]["work"] == 0.0
    assert "drive" not in summary["energy"]["integration"]
    assert abs(summary["energy"]["residual_relative"]) < 5e-3
    with Log(path) as log:
        run = RunData(log)
        angle, speed = (run.ends(f"drive.{name}")[1] for name in ("angle", "speed"))
    delivered = -summary["energy"]["delivered"]["drive"]
    given = TORQUE * angle - 0.5 * INERTIA * speed**2
    assert delivered == pytest.approx(given, rel=5e-3)
    assert delivered != pytest.approx(given - 0.01 * TORQUE * angle, rel=5e-3)
    assert summary["fmus"]["drive"]["file"] == "MyDrive.fmu"
    assert "delivered by drive" in "\n".join(lines(summary))


def test_a_part_of_the_user_is_no_other_scene(drive, driven, cotrack, tmp_path):
    """Runs of a scene with different parts are compared, and the parts are named."""
    simulate(rig(), tmp_path / "own.mcap")
    simulate(rig(drive, {**PARAMETERS, "torque": 1900.0}), tmp_path / "less.mcap")
    digits = driven[1]["fmus"]["drive"]["sha256"][:12]
    for other, said in (
        ("own.mcap", [f"other part: drive is MyDrive.fmu (sha256 {digits}) and the part of cotrack"]),
        ("less.mcap", ["other part: drive: torque = 2000.0 and 1900.0"]),
        (driven[0], []),
    ):
        out = cotrack.done("compare", driven[0], other)
        assert [line for line in out.splitlines() if line.startswith("other part")] == said


LARGE = {"N": "kN", "N.m": "kN.m", "m": "mm", "m/s": "mm/s"}
LARGE_UNITS = {"kN": ("N", 1e3), "kN.m": ("N.m", 1e3), "mm": ("m", 1e-3), "mm/s": ("m/s", 1e-3)}


@pytest.fixture(scope="module")
def large(drive, tmp_path_factory):
    """The drive in kN, kN m and mm, with an inertia in t m2: the same equations."""
    file, units = tmp_path_factory.mktemp("large") / "Large.fmu", dict(UNITS)
    units |= {name: {**UNITS[base], "factor": factor} for name, (base, factor) in LARGE_UNITS.items()}
    return changed(drive, file, lambda each: each._replace(unit=LARGE.get(each.unit, each.unit)), units)


@pytest.mark.long
@pytest.mark.parametrize(
    "run", [{}, {"run.variable": {"tolerance": 1e-3, "estimate": "power"}}], ids=["fixed", "power"]
)
def test_a_drive_in_other_units_drives_as_well(drive, large, tmp_path, run):
    """Others see its ports in SI; its inputs are recorded as it gets them."""
    logs, parameters = {}, {"torque": 1e-3 * TORQUE, "inertia": 1e-3 * INERTIA}
    for name, scene in (("plain", rig(drive, **run)), ("large", rig(large, parameters, **run))):
        logs[name] = tmp_path / f"{name}.mcap"
        summary = simulate(scene, logs[name])
        assert summary["status"] == "ok", summary["message"]
    with Log(logs["plain"]) as plain, Log(logs["large"]) as log:
        for instance, topic in (("drive", "out"), ("track", "in"), ("track", "out")):
            for unit in ("m", "N", "rad/s"):
                about = log.topics[f"/{instance}/{topic}"]
                assert about.units == plain.topics[f"/{instance}/{topic}"].units
                columns = [k for k, each in enumerate(about.units) if each == unit]
                here, there = (each.read(f"/{instance}/{topic}").values[:, columns] for each in (plain, log))
                assert np.abs(here - there).max(initial=0.0) <= 1e-6 * np.abs(here).max(initial=0.0), (instance, unit)
        inputs, si = log.read("/drive/in"), plain.read("/drive/in")
        column = inputs.names.index("sprocket.torque.y")
        assert log.topics["/drive/in"].units[column] == "kN.m"
        torque = si.values[:, column]
        assert np.abs(1e3 * inputs.values[:, column] - torque).max() < 1e-6 * np.abs(torque).max()
        conversions = {each["name"]: each.get("conversions", {}) for each in log.table("system.json")["instances"]}
        assert conversions["drive"]["sprocket.torque.y"] == [1e-3, 0.0]
        assert conversions["drive"]["sprocket.position.x"] == [1e-3, 0.0]
        assert conversions["track"] == {}
    with open_replay(logs["large"], "drive", str(large)) as replay:
        assert replay.verify().equal
    with pytest.raises(BadInput), open_replay(logs["large"], "drive", str(drive)):
        pass


brake = pytest.fixture(scope="module")(brake_fmu)


@pytest.mark.long
def test_further_connections_reach_fmus_of_the_user(drive, brake, tmp_path):
    """Discrete values of the beginning of the step, Reals as the coupling holds them; parts of ours may be sources."""
    texts = ("drive.steps -> idler_drive.ticks", "drive.fast -> idler_drive.gate")
    real = "2 * track.tension.mean + 1 -> idler_drive.pull"
    scene = braked(drive, brake, *texts, real)
    summary = simulate(scene, tmp_path / "rig.mcap")
    assert summary["status"] == "ok", summary["message"]
    with Log(tmp_path / "rig.mcap") as log:
        given = {name: log.signal(f"idler_drive.{name}")[1] for name in ("ticks", "gate", "pull")}
        fast, speed, tension = (log.signal(each)[1] for each in ("drive.fast", "drive.speed", "track.tension.mean"))
        assert given["ticks"].tolist() == [*range(100)]
        assert given["gate"].tolist() == fast[:-1].tolist() == (np.abs(speed[:-1]) > 1.0).tolist()
        assert np.array_equal(given["pull"], 2e-3 * (0.5 * (tension[:-1] + tension[1:])) + 1.0)
        assert log.unit("idler_drive.pull") == "kN"
        assert "fast" not in log.topics["/idler_drive/out"].names
    with open_replay(tmp_path / "rig.mcap", "idler_drive", str(brake)) as replay:
        assert replay.verify().equal


def test_a_further_connection_begins_in_the_unit_of_the_part(large, brake):
    scene = braked(large, brake, "drive.mount.force.x -> idler_drive.pull")
    instances = {each.name: each for each in system(assemble(placed(scene))).instances}
    assert instances["drive"].conversions["mount.force.x"] == (1e3, 0.0)
    assert instances["idler_drive"].conversions["pull"] == (1e-3, 0.0)


def test_parameters_of_the_part_are_converted(tmp_path):
    brake = Variable("brake.torque", "parameter", 0.0, unit="kN.m")
    units = {**UNITS, "kN.m": {**UNITS["N.m"], "factor": 1e3}}
    fmu = foreign_fmus.build(tmp_path / "more.fmu", "drive", (*DRIVE, brake), units)
    scene = rig(**{"fmu.idler_drive.file": str(fmu), "idler_drive.brake": 500.0})
    given = {i.name: i.parameters for i in system(assemble(placed(scene))).instances}["idler_drive"]
    assert given == {"brake.torque": 0.5}


def test_that_an_fmu_runs_its_code_is_said_once(drive, tmp_path):
    lines = []
    own = next(i for i in system(assemble(placed(rig()))).instances if i.name == "drive")
    for file in (drive, own.fmu):
        with Progress("run", lines.append):
            simulate(rig(file, {}, **{"run.stop": 2 * H}), tmp_path / "rig.mcap")
    assert sum("an FMU runs code with your rights" in line for line in lines) == 2
    (line,) = [line for line in lines if "gets from the scene" in line]
    name, value = next(item for item in own.parameters.items() if f" {item[0]} = " in line)
    assert line.startswith(f"rig: drive gets from the scene {name} = {value}")


@pytest.mark.parametrize("python", [False, True], ids=["by kernels", "by Python"])
@pytest.mark.parametrize(
    ("manner", "status", "message"),
    [(1, "ok", "drive has ended the run at t = 0.0205 s"),
     (2, "failed", "drive: fmi2DoStep failed with FMI status 2; the step from t = 0.02 s ended at t = 0.0205 s: a"
                   " step of 0.0005 s or less may help"),
     (3, "failed", "drive: fmi2DoStep returned before it was done (fmi2Pending): asynchronous steps are not supported"
                   " (fmi2DoStep, t = 0.02 s)"),
     (4, "failed", "drive: fmi2DoStep failed with FMI status 3 (fmi2DoStep, t = 0.02 s)")],
)  # fmt: skip
def test_a_step_that_is_not_done(drive, tmp_path, monkeypatch, manner, status, message, python):
    """An FMU that ends the simulation ends the run in order; the log holds all steps before."""
    if python:
        monkeypatch.setattr("orchestrator.cosim.coupling.scheme.CAN_STEP", False)
    path = tmp_path / "rig.mcap"
    summary = simulate(rig(drive, {**PARAMETERS, "end": 0.0205, "manner": manner}), path)
    assert (summary["status"], summary["message"]) == (status, message)
    assert (message in lines(summary)[0]) == (status == "ok"), "a run that was ended says so in its first line"
    assert (summary["communication_steps"], summary["simulated_time"]) == (20, pytest.approx(0.02))
    with Log(path) as log:
        assert log.closing["status"] == status
        assert len(log.signal("drive.speed")[0]) == 21
        assert not log.seal_faults()


def test_what_needs_parts_of_ours_refuses(drive, driven, tmp_path):
    scene, log = rig(drive), driven[0]
    for call in (
        lambda: truth.truth(scene),
        lambda: monolithic.run(scene, tmp_path / "log.mcap"),
        lambda: write_ssp(scene, tmp_path / "rig.ssp"),
        lambda: scene_products([scene]),
        lambda: resume(log, tmp_path / "resumed.mcap"),
    ):
        with pytest.raises(BadInput, match="parts of cotrack alone"):
            call()
    with pytest.raises(BadInput), open_replay(log, "drive", None):
        pass
    with open_replay(log, "drive", str(drive)) as replay:
        assert replay.verify().equal
    with open_replay(log, "track", None) as replay:
        assert replay.verify().equal


def test_the_place_of_the_part_is_set_in_a_copy_for_the_other_side(tmp_path):
    """Of the part's parameters an FMU gets those that it declares by name and type; its table has the last word."""
    scene = load("straight", "rigid", {"start.state": "drawn"})
    part = next(part for part in assemble(scene).parts if part.name == "left_drive")
    fmu = build(part.kind, part.config)
    given = {"file": str(fmu), "parameters": {"brake.torque": 7.0}}
    replaced = load("straight", "rigid", {"start.state": "drawn", "fmu.right_drive": given})
    assert [part.name for part in assemble(replaced).parts if part.fmu] == ["right_drive"]
    instances = {i.name: i for i in system(assemble(replaced)).instances}
    own = {part.name: part for part in assemble(scene).parts}
    assert instances["right_drive"].parameters == {**own["right_drive"].parameters, "brake.torque": 7.0}
    assert (
        instances["right_drive"].parameters["start.lateral"] < 0.0 < instances["left_drive"].parameters["start.lateral"]
    )


def test_other_types_of_outputs_are_counted(tmp_path):
    """Integer, Enumeration and Boolean outputs are read in this order; String outputs are left out."""
    more = (Variable("way", "output", 2, "Enumeration"), Variable("word", "output", 0, "String"))
    fmu = foreign_fmus.build(tmp_path / "more.fmu", "drive", (*DRIVE, *more))
    summary = simulate(rig(fmu, **{"run.stop": 2 * H}), tmp_path / "rig.mcap")
    with Log(tmp_path / "rig.mcap") as log:
        assert log.topics["/stats/drive"].names == ("steps", "way", "fast", "wall_time")
        assert log.signal("stats.drive.way")[1].tolist() == [2.0]
    assert summary["components"]["drive"]["way"] == 2


@pytest.mark.long
def test_an_engine_of_the_user_drives_our_drive(tmp_path, cotrack):
    """A constant torque of an FMU is that of ``torque_points`` with the lag of the demand, to its order."""
    engine = foreign_fmus.build(tmp_path / "engine.fmu", "gain", [
        Variable("u", "input", 1.0), Variable("y", "output", unit="N.m"), Variable("k", "parameter", 1.0),
        *(Variable(f"{name}_start", "parameter", start, kind) for name, kind, start in TEXTS),
        *(Variable(name, "output", start, kind) for name, kind, start in TEXTS),
    ])  # fmt: skip
    lag = 0.02
    demanded = {
        "drive": {"mode": "torque", "demand": True, "demand_lag": lag},
        "connections": ["engine.y -> drive.torque.demand"],
        "fmu.engine": {"file": str(engine), "parameters": {"k": TORQUE}},
    }
    times = np.arange(0.0, 0.101, H)
    points = [[float(t), float(TORQUE * (1.0 - math.exp(-t / lag)))] for t in times]
    runs = {}
    by_points = {"drive": {"mode": "torque", "torque_points": points}}
    for name, settings in (("engine", demanded), ("points", by_points)):
        summary = simulate(load("rig", "rigid", SHORT | settings), tmp_path / f"{name}.mcap")
        assert summary["status"] == "ok", summary["message"]
        with Log(tmp_path / f"{name}.mcap") as log:
            runs[name] = RunData(log).signal("drive.speed")[1]
    assert runs["engine"][-1] > 1.0
    np.testing.assert_allclose(runs["engine"], runs["points"], rtol=1e-9, atol=1e-9)
    said = [f"--set={key}={json.dumps(value)}" for key, value in SHORT.items()]
    wire = "--set=connections=['engine.y -> drive.torque.demand', 'drive.speed -> engine.u']"
    for mode, more, text in (
        ("torque", (), "nothing brings its input torque.demand, which stays 0"),
        ("speed", (f"--set=fmu.engine.file={engine}", wire), "its input torque.demand does not count in mode speed"),
    ):
        drive = f"--set=drive={{mode='{mode}',demand=true}}"
        _, out, err = cotrack("run", "rig", "--track", "rigid", *said, drive, *more, "--no-estimate")
        assert text in out + err


def test_a_demand_is_held_over_the_step():
    """As the page says: what the coupling extrapolated would be a torque that the engine never gave."""
    real, inputs = End("Real", "output", "", None), ("propulsion.torque.demand", "v")
    carried = typed(
        [Connection("engine", ("y", "z"), "differential", inputs)],
        {"engine": {"y": real, "z": real}, "differential": dict.fromkeys(inputs, real)},
    )
    assert {each.inputs: each.carries for each in carried} == {
        ("propulsion.torque.demand",): "discrete", ("v",): "value"}  # fmt: skip


def test_a_unit_that_is_not_declared_is_that_of_the_part_and_other_names_of_units_fit(drive, tmp_path):
    said = "the FMU declares no unit of sprocket.torque.y: it is taken to be that of the part"
    for unit, texts in ("", [said]), ("Nm", []):

        def named(each, unit=unit):
            return each._replace(unit=unit) if each.name == "sprocket.torque.y" else each

        scene = rig(changed(drive, tmp_path / "other.fmu", named, {**UNITS, "Nm": UNITS["N.m"]}))
        assert [text for _, text in interface_mismatches(scene, assemble(scene))][:-1] == texts


# --- files -----------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_path_is_relative_to_its_scene_or_to_the_folder(cotrack, drive, tmp_path):
    text = scene_text("rig").replace("# [fmu]", "[fmu]")
    (tmp_path / "far").mkdir()
    assert "# file: text: FMU for co-simulation" in text
    (tmp_path / "far" / "own.toml").write_text(text + '[fmu.drive]\nfile = "MyDrive.fmu"\n')
    assert load(str(tmp_path / "far" / "own.toml")).fmu["drive"].file == str(tmp_path / "far" / "MyDrive.fmu")
    assert load("rig", None, ["fmu.drive.file=MyDrive.fmu"]).fmu["drive"].file == str(tmp_path / "MyDrive.fmu")
    (tmp_path / "again.toml").write_text(scene_text(str(tmp_path / "far" / "own.toml")))
    assert load("again.toml").fmu["drive"].file == str(tmp_path / "far" / "MyDrive.fmu")
    out = cotrack.done("show", "rig", "--track", "rigid", "--set", f"fmu.drive.file={drive}")
    assert f"  drive        FMU           {drive}; 6 values in, 13 out a step\n" in out
