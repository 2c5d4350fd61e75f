import dataclasses
import json

import numpy as np
import pytest

from fmus.interface.ports import STATE, WRENCH
from orchestrator.cli.inventory import describe
from orchestrator.cosim.graph import Connection, Instance, Miswired, System, wire
from orchestrator.scene.assembly import assemble
from orchestrator.scene.parts import CHASSIS, DRIVE, TRACK
from orchestrator.scene.products import gallery_products, scene_products
from orchestrator.scene.scene import load


def parts(name, *settings, track=None):
    return {part.name: part for part in assemble(load(name, track, settings)).parts}


def test_vehicle_has_its_five_components_in_stages():
    components = parts("straight")
    assert {name: part.stage for name, part in components.items()} == {
        "left_track": TRACK,
        "right_track": TRACK,
        "left_drive": DRIVE,
        "right_drive": DRIVE,
        "chassis": CHASSIS,
    }
    assert components["left_track"].config == components["right_track"].config, "one FMU must serve both sides"
    assert components["left_track"].parameters["start.lateral"] == 1.0795
    assert components["right_track"].parameters["start.lateral"] == -1.0795


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
    expected = {
        "left_track": wheels * STATE,
        "right_track": wheels * STATE,
        "left_drive": STATE + WRENCH,
        "right_drive": STATE + WRENCH,
        "chassis": 2 * wheels * WRENCH,
    }
    assert {name: len(names) for name, names in fed.items()} == expected
    assert all(len(set(names)) == len(names) for names in fed.values())


def test_motion_and_wrench_of_a_wheel_go_opposite_ways():
    connections = {(c.source, c.target, c.carries): c for c in assemble(load("rig")).connections}
    assert connections["drive", "track", "state"].outputs[0] == "sprocket.position.x"
    assert connections["drive", "track", "state"].outputs[-1] == "sprocket.orientation.z"
    assert connections["drive", "track", "rate"].outputs[0] == "sprocket.velocity.x"
    assert connections["track", "drive", "mean"].outputs[0] == "sprocket.force.x"
    assert connections["track", "idler_drive", "mean"].outputs[0] == "idler.force.x"
    assert connections["track", "idler_drive", "mean"].inputs[0] == "sprocket.force.x"


def test_what_is_not_declared_does_not_exist():
    chain = parts("hanging_chain")
    assert list(chain) == ["chain"]
    track = chain["chain"].config["track"]
    assert track["wheels"] == []
    assert track["ground"] is False
    assert assemble(load("hanging_chain")).connections == ()
    bench, rig = parts("sprocket_bench"), parts("rig")
    assert "chassis" not in {**bench, **rig}
    for components in (bench, rig):
        assert components["track"].config["track"]["gravity"] == 0.0
        assert components["track"].config["track"]["ground"] is False
    assert parts("straight")["left_track"].config["track"]["ground"] is True


def test_show_names_what_is_left_out():
    text = "\n".join(describe(load("hanging_chain")))
    assert "516 dofs" in text
    for absent in ("chassis", "contact with the ground", "contact with wheels", "second track"):
        assert absent in text.split("left out")[1]
    whole = "\n".join(describe(load("straight")))
    assert "512 dofs" in whole
    assert "contact with the ground" not in whole.split("left out")[1].split("expected")[0]


@pytest.mark.parametrize(
    ("name", "present", "absent"),
    [
        ("released_chain", "516 dofs", ("drives", "chassis", "contact with the ground", "contact with wheels")),
        ("folded_chain", "33 elements", ("drives", "contact with the ground", "second track")),
        ("spinning_loop", "512 dofs", ("gravity", "contact with the ground", "contact with wheels", "drives")),
    ],
)
def test_show_names_what_a_component_scene_leaves_out(name, present, absent):
    inside, rest = "\n".join(describe(load(name))).split("left out\n")
    assert present in inside
    left = rest.split("expected\n")[0]
    for word in absent:
        assert word in left
    assert ("gravity" in left) == ("gravity" in absent)


def test_ends_of_a_chain_reach_its_fmu():
    held = parts("released_chain")["chain"]
    assert held.config["track"]["ends"] == {"kind": "held", "first": [0.0, 0.0]}
    assert held.parameters["start"] == "straight"
    assert "start" not in parts("hanging_chain")["chain"].parameters, "the model has its own default"
    loop = parts("spinning_loop")["chain"]
    assert (loop.config["track"]["closed"], loop.config["track"]["ends"]) == (True, None)
    assert (loop.config["track"]["gravity"], loop.parameters["start.spin"]) == (0.0, 5.0)


def test_displaced_start_and_pulled_ends():
    chain = parts("hanging_chain", "track.start=displaced")["chain"]
    assert chain.parameters["start"] == "displaced"
    ends = chain.config["track"]["ends"]
    assert ends["last"][0] - ends["first"][0] == pytest.approx(0.8 * 64 * 0.1524)
    pulled = parts("sprocket_bench")["track"].config["track"]["ends"]
    assert (pulled["first"], pulled["last"]) == ([-15e3, 0.0], [-14e3, 0.0])


def test_drive_profile_reaches_the_parameters():
    drive = parts("straight")["left_drive"].parameters
    assert (drive["speed.end"], drive["ramp.start"], drive["ramp.end"]) == (20.0, 2.0, 6.0)
    brake = parts("rig")["idler_drive"].parameters
    assert brake["mode"] == "torque"
    assert brake["brake.torque"] == 500.0


def test_products_are_distinct_and_named():
    products = gallery_products()
    names = [name for _, _, name in products]
    assert len(set(names)) == len(names)
    assert {"TrackFlexible", "TrackRigid", "Chassis", "SprocketDrive"} <= set(names)
    contents = [json.dumps([kind, config], sort_keys=True) for kind, config, _ in products]
    assert len(set(contents)) == len(contents)
    assert {name for _, _, name in scene_products([load("hanging_chain")])} == {"TrackFlexible-hanging_chain"}


@dataclasses.dataclass
class Block:
    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def __post_init__(self):
        self.u, self.y = np.zeros(len(self.inputs)), np.arange(1.0, 1.0 + len(self.outputs))


def graph(outputs=("c", "a"), inputs=("x", "y")):
    instances = tuple(Instance(name, None, {}, stage) for name, stage in (("one", 1), ("two", 0)))
    system = System(instances, (Connection("one", outputs, "two", inputs),))
    return system, {"one": Block("one", (), ("a", "b", "c")), "two": Block("two", ("x", "y", "z"), ())}


def test_wire_orders_stages_and_copies_by_name():
    system, blocks = graph()
    stages = wire(system, blocks)
    assert [[member.component.name for member in stage] for stage in stages] == [["two"], ["one"]]
    (feed,) = stages[0][0].feeds
    blocks["two"].u[feed.inputs] = feed.source.y[feed.outputs]
    assert blocks["two"].u.tolist() == [3.0, 1.0, 0.0]


def test_wire_refuses_what_does_not_exist():
    with pytest.raises(Miswired, match="one has no output 'd'"):
        wire(*graph(outputs=("d", "a")))
    with pytest.raises(Miswired, match="two has no input 'w'"):
        wire(*graph(inputs=("w", "y")))
    system, blocks = graph()
    with pytest.raises(Miswired, match="no component 'one'"):
        wire(system, {"two": blocks["two"]})
