"""FMUs of ``cotrack build``: their start values are the scene's parameters."""

import json
from contextlib import ExitStack
from importlib import import_module

import numpy as np
import pytest

from fmus.cache.sources import source_hash
from fmus.components import COMPONENT_KINDS
from fmus.ground.tables import number_meanings
from fmus.precompile import component_ports
from fmus.track.choices import TRACKS
from fmus.track.link_outputs import INTERVAL
from orchestrator.cosim.coupling.tracks_first import Coupling as TracksFirst
from orchestrator.cosim.graph import connect
from orchestrator.cosim.initialisation import load_components
from orchestrator.scene.assembly import assemble, system
from orchestrator.scene.placing import placed
from orchestrator.scene.products import build_to, gallery_products, scene_products
from orchestrator.scene.scene import load, scene_names

SCENES = scene_names()
VARIANTS = {**dict.fromkeys(TRACKS, ()), "beam": ("track.element=beam",)}
OTHERS = ("robot", "elevated_sprocket")  # other vehicles, whose equilibria take seconds
OTHERS += ("climb", "side_slope", "hold", "washboard", "rough", "step", "trench")  # or other ground
ON_SOIL = ("soft_ground", "snow", "treadmill", "plate_press", "shear_sled")
LONG = (*ON_SOIL, "marder", "rear_drive", "half_round", "tank")  # the equilibrium of most wheels


CASES = [
    pytest.param(name, kind, marks=[pytest.mark.long] * (
        name in LONG or kind == "beam" or (name in OTHERS and kind != "flexible")
    )) for name in SCENES for kind in VARIANTS
]  # fmt: skip


def variant(name, kind):
    """A placed scene; beams start on soil where cables do, because their own start compiles kernels of its own."""
    scene = load(name, kind if kind in TRACKS else "flexible", VARIANTS[kind])
    if kind in TRACKS or name not in ON_SOIL:
        return placed(scene)
    return placed(load(name, "flexible")).model_copy(update={"track": scene.track})


def description(kind, config, folder):
    """Root element of the modelDescription.xml of the FMU, without a build."""
    (folder / "config.json").write_text(json.dumps(config))
    (folder / "build.txt").write_text(source_hash())
    (folder / "shape.txt").write_text("")
    (folder / "numbers.json").write_text(json.dumps(number_meanings()))
    shell = getattr(import_module("fmus." + COMPONENT_KINDS[kind].removesuffix(".py").replace("/", ".")), kind)
    return shell(instance_name=kind, resources=str(folder)).to_xml()


def described(kind, config, folder):
    """Start values in the modelDescription.xml of the FMU."""
    xml = description(kind, config, folder)
    return {v.get("name"): v[0].get("start") for v in xml.iter("ScalarVariable") if v.get("causality") != "output"}


OTHER = {"left": "right", "right": "left"}


def beside_place(part):
    """Config and parameters of a part without its lateral place."""
    return part.config, {key: value for key, value in part.parameters.items() if key != "start.lateral"}


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_every_parameter_of_a_scene_is_a_start_value(name, kind, tmp_path):
    scene = variant(name, kind)
    descriptions = [(product, described(*product[:2], tmp_path)) for product in scene_products([scene])]
    parts = {part.name: part for part in assemble(scene).parts}
    for part in parts.values():
        types = {type(port.start) for port in component_ports(part.kind, part.config)}
        assert types <= {float, int, str}, part.name  # exactly: they are the types of FMI
        wanted = {key: v if isinstance(v, str) else repr(float(v)) for key, v in part.parameters.items()}
        lateral = float(wanted.pop("start.lateral", 0.0))
        over = wanted.pop(INTERVAL, "1.0")
        fitting = [
            starts
            for (kind_, config, _), starts in descriptions
            if kind_ == part.kind and {key: config[key] for key in part.config} == part.config
            if {key: starts[key] for key in wanted} == wanted
        ]
        assert len(fitting) == 1, part.name
        side, _, what = part.name.partition("_")
        other = parts.get(f"{OTHER.get(side)}_{what}", part)
        own = beside_place(other) != beside_place(part)  # where they are equal one FMU serves both sides
        assert float(fitting[0].get("start.lateral", 0.0)) == (lateral if own else abs(lateral))
        # in other tools means of links span one step: how often they record is their own matter
        assert float(fitting[0].get(INTERVAL, 1.0)) == 1.0 <= float(over)
        before = described(part.kind, part.config, tmp_path)  # as for runs, with the model's own defaults
        if kind == "beam" and part.kind == "TrackFlexible":
            assert (before["element"], fitting[0]["element"]) == ("cable", "beam")
        if part.kind == "SprocketDrive":
            assert before != fitting[0]


def test_fmus_have_the_experiment_of_their_scene(tmp_path):
    scene = load("hanging_chain", "rigid", ["run.stop=0.7", "run.step=2 ms"])
    ((kind, config, _),) = scene_products([scene])
    experiment = description(kind, config, tmp_path).find("DefaultExperiment")
    assert experiment.attrib == {"startTime": "0", "stopTime": "0.7", "stepSize": "0.002"}


@pytest.mark.parametrize(("tracks", "lateral"), [
    ('["left", "right"]', 1.0795), ('["right", "left"]', 1.0795), ('["right"]', -1.0795),
])  # fmt: skip
def test_one_fmu_serves_both_sides_with_the_place_of_the_left_one(tracks, lateral):
    products = scene_products([load("settle", "rigid", [f"tracks={tracks}"])])
    assert sorted(kind for kind, _, _ in products) == ["Chassis", "SprocketDrive", "TrackRigid"]
    laterals = [config["parameters"].get("start.lateral") for _, config, _ in products]
    assert sorted(filter(None, laterals)) == [lateral] * 2


@pytest.mark.long
def test_plain_names_are_those_of_the_standard_scene():
    drive = next(part for part in assemble(load("straight")).parts if part.kind == "SprocketDrive")
    for products in (gallery_products(), scene_products([load("straight", model) for model in TRACKS])):
        configs = {name: config for _, config, name in products}
        assert len(configs) == len({json.dumps(product[:2], sort_keys=True) for product in products}) == len(products)
        assert list(configs)[:4] == ["TrackFlexible", "SprocketDrive", "Chassis", "TrackRigid"]
        assert configs["SprocketDrive"]["parameters"] == drive.parameters
    assert (drive.parameters["speed.end"], drive.parameters["start.lateral"]) == (20.0, 1.0795)


SLIPS = ("drive.ramp_time=0.1 s", "idler_drive.torque=100 N m", "idler_drive.brake=50 N m")
STOPS = ("drive.ramp_time=5 ms", "drive.stop=6 ms", "drive.stop_time=5 ms")


def outputs(scene, graph, change=lambda name, parameters: parameters):
    """All outputs of 20 coupled steps; ``change`` replaces the parameters that are set on a part."""
    instances = tuple(one._replace(parameters=change(one.name, one.parameters)) for one in graph.instances)
    h, rows = 1e-3, []
    with ExitStack() as stack:
        components = load_components(graph._replace(instances=instances), scene.run.times, stack)
        with TracksFirst(connect(graph, components)) as scheme:
            for k in range(20):
                scheme.advance(k * h, h)
                rows.append(np.concatenate([each.y for each in components.values()]))
    return np.array(rows)


@pytest.mark.long
@pytest.mark.parametrize(("name", "kind", "settings", "telling"), [
    ("hanging_chain", "beam", (), ("element", "cable")),
    ("rig", "rigid", SLIPS, ("brake.torque", 51.0)),
    ("hard_stop", "flexible", STOPS, ("stop.start", 7e-3)),
])  # fmt: skip
def test_fmus_of_a_scene_do_what_the_scene_does(name, kind, settings, telling, tmp_path):
    """FMUs of a scene give its bits without any parameter set; another value of one shows."""
    scene = placed(load(name, kind if kind in TRACKS else "flexible", [*VARIANTS[kind], *settings]))
    assembly = assemble(scene)
    ordinary = system(assembly)
    files = build_to(tmp_path, [(p.kind, p.config | {"parameters": p.parameters}, p.name) for p in assembly.parts])
    products = ordinary._replace(
        instances=tuple(i._replace(fmu=f, starts=()) for i, f in zip(ordinary.instances, files, strict=True))
    )
    run = outputs(scene, ordinary)
    assert np.array_equal(outputs(scene, products, lambda *_: {}), run)
    key, value = telling
    off = outputs(scene, products, lambda _, own: {key: value} if key in own else {})
    assert not np.array_equal(off, run)
    if kind == "beam":  # and the FMUs of runs do not without their parameters
        assert not np.array_equal(outputs(scene, ordinary, lambda *_: {}), run)


def test_build_takes_a_version_of_fmi_for_native_fmus(monkeypatch, cotrack, tmp_path):
    versions = []
    monkeypatch.setattr("fmus.native.pack.build_native", lambda *given: versions.append(given[-1]) or "chain.fmu")
    for option in ((), ("--fmi", "3")):
        cotrack.done("build", "hanging_chain", "-o", tmp_path / "fmus", "--native", *option)
    assert versions == [2, 3]
