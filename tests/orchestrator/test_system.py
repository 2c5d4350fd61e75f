"""Parts of a scene: their wiring, configurations and products, their inventory, and how their kernels are compiled."""

import dataclasses
import json
import signal
import subprocess
import sys
from contextlib import ExitStack

import numpy as np
import pytest

from fmus.fmi.build import BuildFailed
from fmus.interface.ports import STATE, WRENCH
from fmus.track.choices import TRACKS
from orchestrator.cosim.graph import Connection, Instance, Miswired, System, connect
from orchestrator.execution import loading, warm
from orchestrator.scene.assembly import assemble
from orchestrator.scene.parts import CHASSIS, DRIVE, TRACK
from orchestrator.scene.products import gallery_products, scene_products
from orchestrator.scene.scene import load


def parts(name, *settings, track=None):
    return {part.name: part for part in assemble(load(name, track, settings)).parts}


def test_vehicle_has_its_five_components_in_stages():
    components = parts("straight")
    stages = {"left_track": TRACK, "right_track": TRACK, "left_drive": DRIVE, "right_drive": DRIVE, "chassis": CHASSIS}
    assert {name: part.stage for name, part in components.items()} == stages
    assert components["left_track"].config == components["right_track"].config, "one FMU must serve both sides"
    assert [components[f"{side}_track"].parameters["start.lateral"] for side in ("left", "right")] == [1.0795, -1.0795]


def test_track_model_is_swapped_by_one_word_with_all_else_equal():
    flexible, rigid = parts("straight", track="flexible"), parts("straight", track="rigid")
    assert flexible["left_track"].kind == "TrackFlexible"
    assert rigid["left_track"]._replace(kind="TrackFlexible") == flexible["left_track"]
    assert rigid["chassis"] == flexible["chassis"]


def test_every_input_of_a_vehicle_is_fed_once():
    assembly = assemble(load("straight"))
    fed: dict[str, list[str]] = {part.name: [] for part in assembly.parts}
    for connection in assembly.connections:
        assert len(connection.outputs) == len(connection.inputs)
        fed[connection.target] += connection.inputs
    wheels = 7
    sizes = {"track": wheels * STATE, "drive": STATE + WRENCH, "chassis": 2 * wheels * WRENCH}
    assert {name: len(names) for name, names in fed.items()} == {name: sizes[name.split("_")[-1]] for name in fed}
    assert all(len(set(names)) == len(names) for names in fed.values())


def test_motion_and_wrench_of_a_wheel_go_opposite_ways():
    connections = {(c.source, c.target, c.carries): c for c in assemble(load("rig")).connections}
    state = connections["drive", "track", "state"].outputs
    assert (state[0], state[-1]) == ("sprocket.position.x", "sprocket.orientation.z")
    assert connections["drive", "track", "rate"].outputs[0] == "sprocket.velocity.x"
    assert connections["track", "drive", "mean"].outputs[0] == "sprocket.force.x"
    assert connections["track", "idler_drive", "mean"].outputs[0] == "idler.force.x"
    assert connections["track", "idler_drive", "mean"].inputs[0] == "sprocket.force.x"


def test_what_is_not_declared_does_not_exist():
    chain = parts("hanging_chain")
    assert list(chain) == ["chain"]
    assert chain["chain"].config["track"]["wheels"] == []
    assert assemble(load("hanging_chain")).connections == ()
    bench, rig = parts("sprocket_bench"), parts("rig")
    assert "chassis" not in {**bench, **rig}
    assert [each["track"].config["track"]["gravity"] for each in (bench, rig)] == [0.0, 0.0]
    for track, ground in ((chain["chain"], False), (bench["track"], False), (parts("straight")["left_track"], True)):
        assert track.config["track"]["ground"] is ground


def test_ends_of_a_chain_reach_its_fmu():
    held = parts("released_chain")["chain"]
    assert held.config["track"]["ends"] == {"kind": "held", "first": [0.0, 0.0]}
    assert held.parameters["start"] == "straight"
    hanging = parts("hanging_chain")["chain"]
    assert "start" not in hanging.parameters, "the model has its own default"
    ends = hanging.config["track"]["ends"]
    assert ends["last"][0] - ends["first"][0] == pytest.approx(0.8 * 64 * 0.1524)
    loop = parts("spinning_loop")["chain"]
    assert (loop.config["track"]["closed"], loop.config["track"]["ends"]) == (True, None)
    assert (loop.config["track"]["gravity"], loop.parameters["start.spin"]) == (0.0, 5.0)
    pulled = parts("sprocket_bench")["track"].config["track"]["ends"]
    assert (pulled["first"], pulled["last"]) == ([-15e3, 0.0], [-14e3, 0.0])


def test_drive_profile_reaches_the_parameters():
    drive = parts("straight")["left_drive"].parameters
    assert (drive["speed.end"], drive["ramp.start"], drive["ramp.end"]) == (20.0, 2.0, 6.0)
    brake = parts("rig")["idler_drive"].parameters
    assert (brake["mode"], brake["brake.torque"]) == ("torque", 500.0)


def moved_by_links(scene):
    """A scene that counts as placed, with the idler elsewhere on rigid links, as a static equilibrium would have it."""
    idler = scene.vehicle.idler
    other = idler.model_copy(update={"x": idler.x + 1e-3 * (scene.track.model == "rigid")})
    return scene.model_copy(update={"vehicle": scene.vehicle.model_copy(update={"idler": other})})


@pytest.mark.parametrize("place", [lambda scene: scene, moved_by_links], ids=["drawn", "moved"])
def test_products_are_distinct_and_named(monkeypatch, place):
    """With made-up places, which compile nothing; with those of the scenes: ``test_products.py``, among the long."""
    monkeypatch.setattr("orchestrator.scene.products.placed", place)
    products = gallery_products()
    names = [name for _, _, name in products]
    assert len(set(names)) == len(names)
    assert {"TrackFlexible", "TrackRigid", "Chassis", "SprocketDrive"} <= set(names)
    contents = [json.dumps([kind, config], sort_keys=True) for kind, config, _ in products]
    assert len(set(contents)) == len(contents)
    assert any(name.endswith("-rigid") for name in names) == (place is moved_by_links)
    assert {name for _, _, name in scene_products([load("hanging_chain")])} == {"TrackFlexible-hanging_chain"}


# --- wiring ------------------------------------------------------------------------------------------


@dataclasses.dataclass
class Block:
    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def __post_init__(self):
        self.u, self.y = np.zeros(len(self.inputs)), np.arange(1.0, 1.0 + len(self.outputs))


def graph(outputs=("c", "a"), inputs=("x", "y"), without=()):
    instances = tuple(Instance(name, None, {}, stage) for name, stage in (("one", 1), ("two", 0)))
    system = System(instances, (Connection("one", outputs, "two", inputs),))
    blocks = Block("one", (), ("a", "b", "c")), Block("two", ("x", "y", "z"), ())
    return system, {block.name: block for block in blocks if block.name not in without}


def test_wire_orders_stages_and_copies_by_name():
    system, blocks = graph()
    stages = connect(system, blocks)
    assert [[member.component.name for member in stage] for stage in stages] == [["two"], ["one"]]
    (feed,) = stages[0][0].feeds
    blocks["two"].u[feed.inputs] = feed.source.y[feed.outputs]
    assert blocks["two"].u.tolist() == [3.0, 1.0, 0.0]


@pytest.mark.parametrize(("fault", "said"), [
    ({"outputs": ("d", "a")}, "one has no output 'd'"), ({"inputs": ("w", "y")}, "two has no input 'w'"),
    ({"without": ("one",)}, "no component 'one'"),
])  # fmt: skip
def test_wire_refuses_what_does_not_exist(fault, said):
    with pytest.raises(Miswired, match=said):
        connect(*graph(**fault))


# --- inventory ---------------------------------------------------------------------------------------

PLANAR = "symmetric=true; planar=true; track.link_outputs=false"
NO_WHEELS = ("chassis", "contact with the ground", "contact with wheels")
UNUSED = "of the suspension: springs by a table, gas springs, dampers by a table, torsion bars, rotary dampers"
ROLLERS = ("14 arms with wheels, 2 idlers, 8 return rollers, 2 mounts, torsion bars", ", bushes in the pins, ")
AXLES = ("14 wheels on axles, 2 idlers, 2 return rollers, 2 mounts, recoil springs;",)
CONTENTS = [  # scene, links, settings; words of what is in, of what is left out, of contact pairs, outputs and modules
    ("hanging_chain", "flexible", "", ("516 dofs",), (*NO_WHEELS, "second track"), ("contact pairs\n  none",)),
    ("hanging_chain", "flexible", "track.element=beam", ("64 elements, 1158 dofs",), (), ()),
    ("hanging_chain", "flexible", "track.coordinates=cholesky; track.integrator=runge_kutta",
     ("516 dofs, Cholesky coordinates",), (), ()),
    ("released_chain", "flexible", "", ("516 dofs",), (*NO_WHEELS, "drives"), ()),
    ("folded_chain", "flexible", "", ("33 elements",), ("drives", "contact with the ground", "second track"), ()),
    ("spinning_loop", "flexible", "", ("512 dofs",), (*NO_WHEELS[1:], "drives", "\n  gravity\n"), ()),
    ("straight", "flexible", "", ("512 dofs",), ("a driver",), ()),
    ("straight", "flexible", "vehicle=marder", ("run.step is 0.4167 ms instead of 1.25 ms",), (), ()),
    ("straight", "rigid", "", ("TrackRigid",), (f"  {UNUSED}, bump stops, rebound stops, recoil springs\n",
     "  bushes in the pins\n"), ()),
    pytest.param(
        "straight", "flexible", "vehicle=leopard2; vehicle.track.bushing.stiffness=500", ROLLERS, (), (),
        marks=pytest.mark.long,
    ),
    ("straight", "flexible", "vehicle=dozer", AXLES, ("bushes in the pins",), ()),
    ("rig", "rigid", "", (), (), ("guides: 1 wheels x 64 links",)),
    ("straight", "flexible", PLANAR, ("64 elements, 384 dofs",), ("lateral dofs of the chain",),
     ("teeth: 1 sprocket x 64 pins", "rims: 6 wheels x 64 links", "ground: 64 links", "left_track   70 a step; ",
      "modules of fmus: ", "fmus.physics.rigid: augmented, body, pin, recursive")),
]  # fmt: skip


@pytest.mark.parametrize(("scene", "track", "settings", "present", "absent", "evaluated"), CONTENTS)
def test_show_names_what_is_in_left_out_and_evaluated(cotrack, scene, track, settings, present, absent, evaluated):
    """A part stands on one side alone."""
    given = [each for setting in filter(None, settings.split("; ")) for each in ("--set", setting)]
    inside, rest = cotrack.done("show", scene, "--track", track, *given).split("\nleft out\n")
    left, _, last = rest.partition("\nexpected\n")
    for words in present:
        assert words in inside
        assert words.strip(", ") not in left
    for words in absent:
        assert words in f"{left}\n"
    for words in evaluated:
        assert words in last
    assert ("contact with the ground" in left) == ("no ground" in inside)
    assert ("\n  gravity" in f"\n{left}") == (scene in ("spinning_loop", "rig"))
    elements = left.partition("of the suspension: ")[2].partition("\n")[0].split(", ")
    assert not [name for name in filter(None, elements) if name in inside]
    if "planar" in settings:
        loaded, _, without = last.partition("modules of fmus:")[2].partition("modules of fmus:")
        assert ("planar" in loaded, "planar" in without, "beams" in without) == (True, False, True)


# --- compilation -------------------------------------------------------------------------------------


def test_the_gallery_s_vehicles_and_chains_with_both_tracks():
    assert {("straight", "flexible"), ("straight", "rigid"), ("hanging_chain", "rigid")} <= set(warm.variants())


@pytest.mark.parametrize(
    ("scene", "track", "compiled"),
    [
        ("straight", "flexible", [[], ["Chassis", "SprocketDrive", "TrackFlexible"]]),
        ("straight", "rigid", [["TrackRigid"], ["Chassis", "SprocketDrive"]]),
        ("hanging_chain", "flexible", [[], []]),
    ],
)
@pytest.mark.parametrize("error", [KeyboardInterrupt, BuildFailed])
def test_kernels_are_compiled_beside_by_processes_that_end_with_a_start_that_fails(
    monkeypatch, scene, track, compiled, error
):
    """The step of cables comes last; those of native FMUs are compiled for them."""
    kinds, processes = [], []

    def begin(parts, patience, native):
        assert native == (error is BuildFailed)
        kinds.append([kind for kind, _, _ in parts])
        processes.append(subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"]))
        return processes[-1]

    def fail(scene):
        raise error

    monkeypatch.setattr(loading, "start_compilation", begin)
    monkeypatch.setattr(loading, "placed", fail)
    loaded = load(scene, track)
    with pytest.raises(error), ExitStack() as stack:
        loading.load_scene(loaded, assemble(loaded), stack, error is BuildFailed)
    assert kinds == compiled
    assert {process.returncode for process in processes} == {-signal.SIGTERM}


@pytest.mark.long
def test_scenes_begin_and_say_how_long_it_took(environment):
    """Scenes start and report their time, from a process that has loaded no FMU.

    Processes that it spawns would otherwise find the packages of its FMUs.
    """
    command = [sys.executable, "-m", "orchestrator", "warm", "hanging_chain"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
    lines = sorted(line.partition(" ")[2] for line in done.stdout.splitlines())
    assert [line.partition(":")[0] for line in lines] == [f"hanging_chain, {track}" for track in sorted(TRACKS)]
    assert all(": starts after " in line for line in lines)
