"""An FMU of the user, besides our parts, that feeds the force on the hitch: forces, work, energy ledger, refusals."""

import foreign_fmus
import numpy as np
import pytest
from foreign_fmus import UNITS, Variable

from fmus.vehicles.tables import BadInput
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results.energy import hitch_works, ledger
from orchestrator.results.run_data import RunData
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load

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
