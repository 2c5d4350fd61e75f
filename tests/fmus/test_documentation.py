"""Documentation, licences and modelDescription.xml of an FMU."""

from xml.etree.ElementTree import tostring

import pytest
from lxml import html

from fmus.cache.sources import ROOT
from fmus.components import COMPONENT_KINDS
from fmus.fmi.description import document
from fmus.fmi.documentation import COUPLING, documentation, icon_beside, icon_files, key_parts, readme_beside
from fmus.interface.ports import NOT_NEGATIVE, Port, type_of

PORTS = (
    Port("brake.torque", "input", "N.m", "torque of the brake"),
    Port("speed", "output", "rad/s", "speed & direction"),
    Port("gap", "parameter", "m", "gap <between> both", 0.25, allowed=NOT_NEGATIVE),
)
README = "# Brake\nHolds [the wheel](../chassis/README.md).\n\n| file | holds |\n| --- | --- |\n| `a.py` | a |\n"


ABOUT = {"guid": "g", "text": "A brake", "tool": "t", "variables": PORTS, "reals": 3, "continuous": 2, "categories": {}}
DESCRIBED = document("Brake", experiment={"stop": 6.0, "step": 0.00125}, **ABOUT)


def test_the_page_has_the_readme_and_every_variable_without_links():
    files = documentation(tostring(DESCRIBED), README, ("pythonfmu",))
    page = html.fromstring(files["documentation/index.html"])
    assert "Holds the wheel." in page.text_content()
    assert [len([*page.iter(tag)]) for tag in ("a", "table")] == [0, 2]
    cells = [cell.text_content() for cell in page.iter("td")]
    assert cells[-8:] == ["gap", "parameter", "fixed", "m", "0.25", "0.0", "", "gap <between> both"]
    assert page.text_content().count("speed & direction") == 1


@pytest.mark.parametrize(
    ("included", "holders"), [("pythonfmu", ("the cotrack authors", "Sun", "NTNU")), ("numba", ("Sun", "Anaconda"))]
)
def test_licences_of_all_parts_are_whole(included, holders):
    text = documentation(tostring(DESCRIBED), README, (included,))["documentation/licenses/license.txt"].decode()
    assert all(holder in text for holder in ("Copyright (c) 2", *holders))
    assert text.count("THE SOFTWARE IS PROVIDED") + text.count("THIS SOFTWARE IS PROVIDED") == 2


def test_description_names_author_version_licence_and_the_scenes_experiment():
    root = DESCRIBED
    assert {root.get(name) for name in ("author", "copyright", "license", "version")}.isdisjoint({None, ""})
    assert root.find("DefaultExperiment").attrib == {"startTime": "0", "stopTime": "6.0", "stepSize": "0.00125"}
    nominal = {variable.get("name"): variable[0].get("nominal") for variable in root.iter("ScalarVariable")}
    assert nominal == {"brake.torque": "1000.0", "speed": None, "gap": None}


def test_types_and_units_to_show_are_defined():
    """Every unit to show is one of its unit; `test_units.py` says what it is worth."""
    root = DESCRIBED
    units = {unit.get("name"): {each.get("name") for each in unit.iter("DisplayUnit")} for unit in root.iter("Unit")}
    types = {kind.get("name"): dict(kind[0].attrib) for kind in root.iter("SimpleType")}
    for (real,) in root.iter("ScalarVariable"):
        if real.tag == "Real" and real.get("unit") != "1":
            declared = types[real.get("declaredType")]
            assert [declared.get(key) for key in ("unit", "displayUnit")] == [real.get("unit"), real.get("displayUnit")]
            assert real.get("displayUnit") is None or real.get("displayUnit") in units[real.get("unit")]
    names = "speed", "chassis.angular_velocity.z", "left.sprocket.angular_velocity.y"
    kinds = [type_of(Port(name, "output", "rad/s", "")) for name in names]
    assert kinds == ["RotationalSpeed", "AngularVelocity", "RotationalSpeed"]


@pytest.mark.parametrize("kind", COMPONENT_KINDS)
def test_every_component_has_an_icon_and_a_readme_that_a_build_depends_on(kind):
    script = ROOT / COMPONENT_KINDS[kind]
    assert icon_files(script, 2) == {"model.png": icon_beside(script)}
    assert list(icon_files(script, 3)) == ["terminalsAndIcons/icon.png"]
    assert icon_beside(script).startswith(b"\x89PNG")
    assert len({icon_beside(ROOT / other) for other in COMPONENT_KINDS.values()}) == len(COMPONENT_KINDS)
    assert icon_files(ROOT / "fmi" / "slave.py", 2) == {}
    readme = readme_beside(script)
    assert readme.startswith("# ")
    assert [f"\n## {name}\n" in readme for name in COUPLING] == [True] * len(COUPLING)
    assert "## What the host needs" not in readme
    assert readme in key_parts(readme, ("numba",))
