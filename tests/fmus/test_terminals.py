"""Terminals and arrays of FMI 3.0: a vehicle by 16 pairs of terminals."""

from __future__ import annotations

import pytest
from plugged import pairs_of_terminals, plugged_vehicle

from fmus.components import model_of
from fmus.interface.ports import NOT_NEGATIVE, Port, variables
from fmus.native.arrays import arrays
from fmus.native.fmi3_description import terminals
from fmus.track import link_outputs
from fmus.track.link_outputs import GROUPS
from orchestrator.scene.assembly import assemble, build_native_all
from orchestrator.scene.products import scene_products
from orchestrator.scene.scene import load
from tests import own_master


def test_304_connections_of_a_vehicle_are_16_pairs_of_terminals():
    assembly = assemble(load("straight"))
    members = {}  # of the terminals of each part: their variables, and the terminal of each
    for part in assembly.parts:
        found = terminals(arrays(variables(model_of(part.kind)(part.config).ports).reals))
        members[part.name] = {f"{port}.{member}": port for port, own in found.items() for member in own}
    scalar, array, pair = [], set(), set()
    for connection in assembly.connections:
        for output, input_ in zip(connection.outputs, connection.inputs, strict=True):
            ends = (connection.source, output), (connection.target, input_)
            ends_of_array = frozenset((part, name.rpartition(".")[0]) for part, name in ends)
            scalar.append(ends)
            array.add(ends_of_array)
            pair.add(frozenset((part, members[part][name]) for part, name in ends_of_array))
    assert (len(scalar), len(array), len(pair)) == (304, 96, 16)


@pytest.mark.study
def test_a_vehicle_drives_by_16_pairs_of_terminals_to_the_bits_of_304_connections(tmp_path):
    products = scene_products([load("straight")])
    for version in (2, 3):
        build_native_all(products, tmp_path / str(version), fmi=version)
    expected = own_master.main(tmp_path / "2", stop=0.05, speed=20.5, ramp=(0.0, 0.2))
    fmus = plugged_vehicle(tmp_path / "3", "TrackFlexible")
    assert len([*pairs_of_terminals()]) == 16
    for k in range(40):
        for fmu in fmus.values():
            fmu.step(k * 1.25e-3, 1.25e-3, fmu.read())
    x, _, z, speed = fmus["chassis"].show(["chassis.position", "speed"])
    for fmu in fmus.values():
        fmu.slave.freeInstance()
    assert dict(zip(expected, (x, z, speed), strict=True)) == expected
    assert abs(speed) > 0.01


def test_reals_that_differ_stay_scalars():
    xyz = [Port(f"start.position.{axis}", "parameter", "m", f"{axis} of it") for axis in "xyz"]
    (array,) = arrays(xyz)
    assert (array.name, array.text, array.shape) == ("start.position", "x, y, z of it", (3,))
    for changed in ({"causality": "local"}, {"unit": "1"}, {"allowed": NOT_NEGATIVE}):
        apart = arrays([*xyz[:2], xyz[2]._replace(**changed)])
        assert [(array.name, array.first, array.shape) for array in apart] == [
            (port.name, i, ()) for i, port in enumerate(xyz)
        ]
    assert [array.name for array in arrays(xyz[:2])] == [port.name for port in xyz[:2]]


@pytest.mark.parametrize("group", GROUPS)
def test_outputs_of_links_are_arrays(group):
    links = link_outputs.ports((group,), 4, 5)
    of = GROUPS[group]
    (array,) = arrays(links)
    assert array.name == f"{of.owner}.{of.signal}"
    assert array.shape == (4 if of.owner == "link" else 5, *([len(of.parts)] if len(of.parts) > 1 else []))
    assert (array.first, array.elements) == (0, tuple(links))
    assert "1" not in array.text
