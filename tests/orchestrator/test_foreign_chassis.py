"""FMUs of the user with our tracks: a chassis of one rigid body with wheels that spin in it, and a towed mass."""

import foreign_chassis
import foreign_fmus
import numpy as np
import pytest
from foreign_fmus import CHASSIS, PLACES, UNITS, Variable

from fmus.vehicles.tables import BadInput
from orchestrator.execution import summary
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log, Missing
from orchestrator.results.analyses import phases, power, slip
from orchestrator.results.energy import hitch_works, ledger
from orchestrator.results.run_data import RunData, Window
from orchestrator.results.vehicle_measures import ground_force, speed_excess, third_law
from orchestrator.scene.assembly import assemble, system
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load

H, REST, STOP = 1.25e-3, 0.1, 1.5
DRIVEN = Window(1.0, STOP)  # at 2 rad/s
SHORT = {
    "run.stop": STOP, "run.step": H, "track.link_outputs": False, "expect": {}, "drive.speed": 2.0,
    "drive.ramp_start": REST, "drive.ramp_time": 0.5,
}  # fmt: skip


@pytest.fixture(scope="module")
def scene():
    """The straight run, short; its chassis is to be replaced."""
    return placed(load("straight", "rigid", SHORT))


@pytest.fixture(scope="module")
def parameters(scene):
    return foreign_chassis.parameters(system(assemble(scene)), scene.vehicle.model_dump())


@pytest.fixture(scope="module")
def variables(parameters):
    """Variables of the chassis, whose defaults are the parameters."""
    return [each._replace(start=parameters.get(each.name, each.start)) for each in CHASSIS]


@pytest.fixture(scope="module")
def chassis(variables, tmp_path_factory):
    return foreign_fmus.build(tmp_path_factory.mktemp("foreign") / "TheirChassis.fmu", "chassis", variables)


@pytest.fixture(scope="module")
def bare(variables, tmp_path_factory):
    """The same chassis with nothing but the motions that tracks and drives need."""
    needed = tuple(f"{place}." for place in PLACES)
    less = [
        each._replace(causality="local") if each.causality == "output" and not each.name.startswith(needed) else each
        for each in variables
    ]
    return foreign_fmus.build(tmp_path_factory.mktemp("bare") / "Bare.fmu", "chassis", less)


def run(scene, fmu, path, **changes):
    return simulate(scene.changed({"fmu.chassis.file": str(fmu), **changes}), path)


@pytest.fixture(scope="module")
def driven(scene, chassis, tmp_path_factory):
    path = tmp_path_factory.mktemp("driven") / "theirs.mcap"
    return path, run(scene, chassis, path)


@pytest.fixture(scope="module")
def unbalanced(scene, bare, tmp_path_factory):
    path = tmp_path_factory.mktemp("bare") / "bare.mcap"
    return path, run(scene, bare, path, **{"track.link_outputs": True})


@pytest.mark.long
def test_it_stands_on_its_tracks(driven, scene):
    path, result = driven
    assert result["status"] == "ok", result["message"]
    with Log(path) as log:
        data = RunData(log)
        carried = ground_force(data, "", Window(0.0, REST))
        _, height = data.signal("chassis.chassis.position.z", Window(0.0, REST))
        assert carried == pytest.approx(scene.vehicle.gravity * scene.vehicle.total_mass(scene.tracks), rel=1e-3)
        assert np.ptp(height) < 1e-5


def test_another_mass_does_not_stand(scene, chassis, parameters, tmp_path):
    """Twin of the test above: a mass of 1 % more is noticed."""
    heavier = {"run.stop": REST, "fmu.chassis.parameters.mass": 1.01 * parameters["mass"]}
    run(scene, chassis, tmp_path / "heavy.mcap", **heavier)
    with Log(tmp_path / "heavy.mcap") as log:
        _, height = RunData(log).signal("chassis.chassis.position.z")
        assert np.ptp(height) > 1e-4


def test_forces_balance(driven, parameters):
    """Its momentum is the impulse of wrenches and gravity, to rounding; they are the tracks' wrenches."""
    path, _ = driven
    with Log(path) as log:
        data = RunData(log)
        velocity = data.vectors("chassis", "out", "chassis.velocity")[1]
        force = sum(data.vectors("chassis", "in", f"{place}.force")[1] for place in PLACES)
        impulse = H * (force - parameters["mass"] * np.array([0.0, 0.0, parameters["gravity"]]))
        size = H * parameters["mass"] * parameters["gravity"]
        assert np.abs(parameters["mass"] * np.diff(velocity, axis=0) - impulse).max() < 1e-9 * size
        assert third_law(data, "", Window(0.0, STOP)) < 1e-12


def test_it_drives_at_the_speed_of_its_sprockets(driven, scene):
    """Within the slip that the shipped scene allows."""
    path, _ = driven
    allowed = load("straight").expect["speed_excess"]
    with Log(path) as log:
        data = RunData(log)
        assert speed_excess(data, "", DRIVEN) == pytest.approx(allowed.expected, abs=allowed.tolerance)
        assert data.ends("chassis.distance")[1] > 0.25
        assert data.mean("chassis.left.road_wheel[1].angular_velocity.y", DRIVEN) == pytest.approx(
            data.mean("left_track.speed", DRIVEN) / (scene.vehicle.road_wheel.radius + scene.vehicle.track.face),
            rel=0.2,
        )


@pytest.mark.long
def test_it_meets_the_checks_of_the_shipped_scene(chassis, tmp_path):
    result = simulate(load("straight", "rigid", {"fmu.chassis.file": str(chassis)}), tmp_path / "whole.mcap")
    assert len(result["checks"]) == 8
    assert summary.verdict(result) == "ok", result["checks"]


def test_its_energies_are_in_the_ledger(driven, scaled):
    path, result = driven
    energy = result["energy"]
    assert energy["delivered"] == {}
    assert abs(energy["residual_relative"]) < 1e-3
    assert abs(energy["integration_relative"]["chassis"]) < 1e-3
    assert summary.energy_warning(energy) == ""
    with Log(path) as log:
        scaled(log, "/chassis/in", "left.sprocket.force.x", 0.95)
        broken = ledger(RunData(log))
    assert abs(broken.integration["chassis"]) > 100.0 * abs(energy["integration"]["chassis"])


@pytest.mark.long
def test_without_energies_it_is_outside_of_the_ledger(driven, unbalanced):
    """The ports delivered what its own energies say; the balance is that of tracks and drives."""
    whole, energy = driven[1]["energy"], unbalanced[1]["energy"]
    with Log(driven[0]) as log:
        data = RunData(log)
        gained = sum(np.subtract(*data.ends(f"chassis.energy.{kind}")[::-1]) for kind in ("kinetic", "gravity"))
    assert energy["delivered"]["chassis"] == pytest.approx(gained, rel=1e-3)
    assert energy["delivered"]["chassis"] != pytest.approx(whole["work"], rel=1e-2)
    assert abs(energy["residual_relative"]) < 1e-3
    assert "chassis" not in energy["integration"]
    (text,) = [each["text"] for each in unbalanced[1]["warnings"] if each["component"] == "chassis"]
    assert text.endswith("it outputs no energies: the energy balance takes what passes its ports as delivered to it")


def test_results_that_lack_its_outputs_name_them(unbalanced, cotrack, tmp_path):
    path, result = unbalanced
    assert result["status"] == "ok", result["message"]
    known = {k for k, v in result["observables"].items() if v == v}
    assert {"ground_force", "tension_max", "pad_velocity"} <= known
    assert not known & {"slip", "pad_slip"}
    with Log(path) as log:
        data = RunData(log)
        for analysis, lacking in (
            (phases, "chassis.speed"),
            (slip, "chassis.yaw"),
            (power, "chassis.chassis.velocity.x"),
        ):
            with pytest.raises(Missing, match=f"holds no '{lacking}'"):
                analysis.of(data)
    assert cotrack("view", path, "-o", "side.png")[0] == 0
    status, _, err = cotrack("view", path, "--above", "-o", "above.png")
    assert (status, "holds no 'chassis.yaw'" in err) == (2, True), err


def test_report_and_comparison_name_it(driven, unbalanced, cotrack, tmp_path):
    hashed = {path: result["fmus"]["chassis"]["sha256"] for path, result in (driven, unbalanced)}
    assert cotrack("report", unbalanced[0], driven[0], "-o", "page.html")[0] == 0
    page = (tmp_path / "page.html").read_text()
    assert f"Bare.fmu, sha256 {hashed[unbalanced[0]]}" in page
    assert "was delivered to chassis, an FMU without energies" in page
    out = cotrack.done("compare", driven[0], unbalanced[0])
    files = [
        f"{name}.fmu (sha256 {hashed[path][:12]})"
        for name, path in (("TheirChassis", driven[0]), ("Bare", unbalanced[0]))
    ]
    assert f"other part: chassis is {files[0]} and {files[1]}" in out.splitlines()


# --- an FMU besides our parts, that feeds the force on the hitch ----------------------------------------

IN_KN = {**UNITS, "kN": {**UNITS["N"], "factor": 1e3}}
TRAILER = (
    Variable("velocity", "input", unit="m/s"),
    Variable("force", "output", unit="N"),
    Variable("stretch", "local", unit="m"),
    Variable("speed", "local", unit="m/s"),
    Variable("energy.kinetic", "output", unit="J"),
    Variable("energy.spring", "output", unit="J"),
    Variable("energy.dissipated", "output", unit="J"),
    Variable("mass", "parameter", 2e3, unit="kg"),
    Variable("stiffness", "parameter", 2e5, unit="N/m"),
    Variable("damping", "parameter", 2e4, unit="N.s/m"),
)
TOWED = ["chassis.hitch.velocity.x -> trailer.velocity", "trailer.force -> chassis.hitch.force.x"]
PULLING = {
    "symmetric": True, "run.stop": 0.5, "run.step": 1e-3, "track.link_outputs": False, "expect": {},
    "drive.speed": 3.0, "drive.ramp_start": 0.0, "drive.ramp_time": 0.3,
}  # fmt: skip


def towing(file, connections=TOWED, name="trailer", **changes):
    settings = {"hitch": {}, "connections": list(connections), f"fmu.{name}.file": str(file), **PULLING, **changes}
    return load("straight", "rigid", settings)


@pytest.fixture(scope="module")
def trailer(tmp_path_factory):
    return foreign_fmus.build(tmp_path_factory.mktemp("trailer") / "Trailer.fmu", "trailer", TRAILER)


@pytest.fixture(scope="module")
def towed(trailer, tmp_path_factory):
    path = tmp_path_factory.mktemp("towed") / "towed.mcap"
    result = simulate(towing(trailer), path)
    assert result["status"] == "ok", result["message"]
    with Log(path) as log:
        yield RunData(log), result


@pytest.mark.long
def test_the_force_of_the_fmu_is_that_on_the_hitch(towed):
    """Over each step the mean of its values at both ends; it pulls rearward, and draws the mass along."""
    run, _ = towed
    given = run.signal("trailer.force")[1]
    felt = run.vectors("chassis", "in", "hitch.force")[1]
    np.testing.assert_array_equal(felt[:, 0], given[:-1] + 0.5 * (given[1:] - given[:-1]))
    assert not felt[:, 1:].any()
    assert given.min() < -2e3
    assert run.signal("trailer.energy.kinetic")[1][-1] == pytest.approx(
        0.5 * 2e3 * run.signal("chassis.hitch.velocity.x")[1][-1] ** 2, rel=0.5
    )


@pytest.mark.long
def test_the_work_of_the_hitch_goes_into_the_trailer(towed):
    """Towed energy of the chassis is the force times the way; the ledger takes it to the trailer, which has it.

    The trailer's damper sees the velocity of half a step before: 0.46 % of its energy at 1 ms, 0.23 % at 0.5 ms.
    """
    run, result = towed
    account = {name: {"kinetic": 0.0} for name in run.instances}
    work = hitch_works(run, account)["trailer"]
    assert work == pytest.approx(np.ptp(run.signal("chassis.energy.towed")[1]), rel=1e-9)
    has = sum(run.signal(f"trailer.energy.{kind}")[1][-1] for kind in ("kinetic", "spring", "dissipated"))
    assert work == pytest.approx(has, rel=6e-3)
    assert work > 500.0
    of_run = ledger(run)
    assert of_run.towed == pytest.approx(0.0, abs=1e-9 * work)
    assert abs(of_run.residual) < 1e-2 * work
    assert of_run.integration["trailer"] == pytest.approx(work - has, abs=1e-6 * work)
    assert result["energy"]["residual_relative"] == pytest.approx(of_run.residual_relative)


@pytest.mark.long
def test_a_force_in_other_units_is_converted(trailer, towed, tmp_path):
    """The same library; it says that its output is in kN, so a thousandth of it arrives in kN, with factor 1e-3."""
    kilo = [each._replace(unit="kN") if each.name == "force" else each for each in TRAILER]
    file = foreign_fmus.build(tmp_path / "kN.fmu", "trailer", kilo, IN_KN, foreign_fmus.library_of(trailer))
    connections = [TOWED[0], "0.001 * trailer.force -> chassis.hitch.force.x"]
    result = simulate(towing(file, connections), tmp_path / "kN.mcap")
    assert result["status"] == "ok", result["message"]
    with Log(tmp_path / "kN.mcap") as log:
        felt = RunData(log).vectors("chassis", "in", "hitch.force")[1]
    expected = towed[0].vectors("chassis", "in", "hitch.force")[1]
    np.testing.assert_allclose(felt, expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("connections", "changes", "said"),
    [
        (TOWED, {"hitch": False}, "the chassis has a hitch only with the table [hitch], which may be empty"),
        (["trailer.force -> chassis.hitch.force.y"], {}, "symmetric = true has no lateral force"),
        (["trailer.force -> left_track.idler.force.x"], {}, "only chassis.hitch.force.{x,y,z}, and speed.demand"),
        (["left_track.travel -> chassis.hitch.force.x", TOWED[0]], {}, "and from an FMU of the user"),
        ([], {}, "fmu.trailer: no such part, and no connection names it: the parts are left_track, left"),
        (TOWED[:1], {"name": "a/b"}, "fmu.'a/b': the name of an instance must have no dot and no slash"),
    ],
)
def test_what_a_further_fmu_cannot(connections, changes, said):
    with pytest.raises(BadInput) as caught:
        assemble(towing("no.fmu", connections, **changes))
    assert said in str(caught.value)
