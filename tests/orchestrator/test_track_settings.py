"""Settings of a track: integrator, coordinates, element, elasticity, and the keys of each model."""

from typing import Annotated, Literal, get_args, get_origin

import pytest

from fmus.components import model_of
from fmus.track.choices import TRACKS, models_with
from fmus.track.ports import STARTS
from fmus.vehicles.tables import BadInput
from orchestrator.cli.inventory import describe
from orchestrator.execution.truth import physical_scene
from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load
from orchestrator.scene.track_table import FmuParameter, TrackModelTable


@pytest.mark.long
def test_integrators_reach_the_tracks():
    def parameters(*settings):
        scene = load("straight", "rigid", settings)
        return next(part.parameters for part in assemble(placed(scene)).parts if part.name == "left_track")

    assert "spectral_radius" not in parameters("track.integrator=generalized_alpha")
    assert parameters("track.integrator=hht")["spectral_radius"] == 0.5, "the default is the strongest damping"
    assert parameters("track.integrator=hht", "track.spectral_radius=0.9")["spectral_radius"] == 0.9
    for integrator in ("adams", "dormand_prince"):
        given = parameters(f"track.integrator={integrator}", "track.rtol=1e-8", "track.atol=1e-7")
        assert (given["adams.rtol"], given["adams.atol"]) == (1e-8, 1e-7)
    with pytest.raises(
        BadInput, match=r"rtol = 1e-08 needs integrator = 'adams' or 'dormand_prince', not 'runge_kutta'"
    ):
        parameters("track.integrator=runge_kutta", "track.rtol=1e-8")


def test_coordinates_are_for_explicit_integrators():
    cholesky, explicit = "track.coordinates=cholesky", "track.integrator=runge_kutta"
    scene = load("hanging_chain", "flexible", [cholesky, explicit])
    assert assemble(scene).parts[0].parameters["coordinates"] == "cholesky"
    assert any("516 dofs, Cholesky coordinates" in line for line in describe(scene))
    assert load("straight", "flexible", ["planar=true", "symmetric=true", cholesky, explicit]).planar
    for model, settings, sentence in (
        (
            "flexible",
            [cholesky],
            "needs integrator = 'runge_kutta', 'adams' or 'dormand_prince', not 'generalized_alpha': an implicit step",
        ),
        (
            "flexible",
            [cholesky, "track.integrator=hht"],
            "needs integrator = 'runge_kutta', 'adams' or 'dormand_prince'",
        ),
        (
            "flexible",
            [cholesky, explicit, "track.joints=constrained"],
            "needs axes = 'fixed' and joints = 'eliminated', not",
        ),
        ("rigid", [cholesky, explicit], "coordinates = 'cholesky' needs model = 'flexible': rigid links have none$"),
    ):
        with pytest.raises(BadInput, match=sentence):
            load("hanging_chain", model, settings)


@pytest.mark.parametrize("model", TRACKS)
def test_keys_of_a_track_are_parameters_of_its_fmu(model):
    """Keys that a track takes are parameters of its FMU, with their choices and defaults; it has no other keys."""
    part = assemble(load("rig", model)).parts[0]
    ports = {port.name: port for port in model_of(part.kind)(part.config).ports}
    for key, target in TrackModelTable.fmu_parameters().items():
        assert (model in models_with(target.name)) == (target.name in ports), key
        if port := ports.get(target.name):
            asked = get_args(TrackModelTable.model_fields[key].annotation)
            chosen = next((get_args(one) for one in asked if get_origin(one) is Literal), ())
            assert set(chosen) <= {*(STARTS if key == "start" else port.choices)}, "an unknown start"
            assert {*port.choices} - set(chosen) <= {"planar"}, "scenes have a key of their own for this choice"
    for name, value in TRACKS[model].defaults.items():
        assert ports[name].start == value


@pytest.mark.long
def test_a_key_of_one_model_is_declared_in_its_table_and_with_the_model(monkeypatch):
    """A toy key reaches the FMU, belongs to one model, is dropped when the model changes, is no part of the motion.

    A key that every model has needs no entry in ``TRACKS``.
    """

    class Toy(TrackModelTable):
        stickiness: Annotated[float | None, FmuParameter("glue.stickiness", method=True)] = None

    assert Toy(model="flexible", stickiness=0.5).parameters() == {"glue.stickiness": 0.5}
    monkeypatch.setitem(TRACKS["rigid"].defaults, "glue.stickiness", 0.0)

    toy = Toy(model="rigid", stickiness=0.5)
    assert toy.parameters()["glue.stickiness"] == 0.5
    assert toy.of_model("flexible").parameters() == {}
    with pytest.raises(ValueError, match=r"stickiness = '0.5' needs model = 'rigid': flexible links have none"):
        Toy(model="flexible", stickiness=0.5)
    scene = load("rig", "rigid").model_copy(update={"track": toy})
    assert assemble(scene).parts[0].parameters["glue.stickiness"] == 0.5
    assert physical_scene(placed(scene)).track.stickiness is None


def test_element_is_for_flexible_links():
    assert "element" not in assemble(load("hanging_chain", "flexible")).parts[0].parameters
    scene = load("hanging_chain", "flexible", ["track.element=beam"])
    assert assemble(scene).parts[0].parameters["element"] == "beam"
    assert any("64 elements, 1158 dofs" in line for line in describe(scene))
    assert any("64 elements, 516 dofs" in line for line in describe(load("hanging_chain", "flexible")))
    with pytest.raises(BadInput, match=r"element = 'beam' needs model = 'flexible': rigid links have none$"):
        load("hanging_chain", "rigid", ["track.element=beam"])
    with pytest.raises(BadInput, match=r"elasticity = 'general' needs element = 'cable': a beam has but one$"):
        load("hanging_chain", "flexible", ["track.element=beam", "track.elasticity=general"])


def test_elasticity_is_for_flexible_links():
    assert load("hanging_chain", "flexible").track.elasticity is None
    assert "elasticity" not in assemble(load("hanging_chain", "flexible")).parts[0].parameters
    scene = load("hanging_chain", "flexible", ["track.elasticity=general"])
    assert assemble(scene).parts[0].parameters["elasticity"] == "general"
    with pytest.raises(BadInput, match=r"elasticity = 'general' needs model = 'flexible': rigid links have none$"):
        load("hanging_chain", "rigid", ["track.elasticity=general"])
