"""Documentation, licences and modelDescription.xml of an FMU."""

from html.parser import HTMLParser
from xml.etree.ElementTree import tostring

import numpy as np
import pytest

from fmus.cache.sources import ROOT
from fmus.components import KINDS
from fmus.fmi.description import document
from fmus.fmi.documentation import documentation, icon_beside, icon_files, key_parts, readme_beside
from fmus.interface.ports import NOT_NEGATIVE, TYPES, Port, type_of

PORTS = (
    Port("brake.torque", "input", "N.m", "torque of the brake"),
    Port("speed", "output", "rad/s", "speed & direction"),
    Port("gap", "parameter", "m", "gap <between> both", 0.25, allowed=NOT_NEGATIVE),
)
README = "# Brake\nHolds [the wheel](../chassis/README.md).\n\n| file | holds |\n| --- | --- |\n| `a.py` | a |\n"


def described(**times):
    experiment = {"stop": 8.0, "step": 0.00125} | times
    return document(
        "Brake",
        guid="g",
        text="A brake",
        tool="t",
        variables=PORTS,
        reals=3,
        continuous=2,
        categories={},
        experiment=experiment,
    )


class Reader(HTMLParser):
    """Text and tags of a page."""

    def __init__(self, page):
        super().__init__()
        self.tags, self.cells, self.text, self.cell_open = [], [], "", False
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.cell_open = tag == "td"
        if self.cell_open:
            self.cells.append("")

    def handle_endtag(self, tag):
        self.cell_open = False

    def handle_data(self, data):
        self.text += data
        if self.cell_open:
            self.cells[-1] += data


def test_the_page_has_the_readme_and_every_variable_without_links():
    files = documentation(tostring(described()), README, ("pythonfmu",))
    page = Reader(files["documentation/index.html"].decode())
    assert "Holds the wheel." in page.text
    assert "a" not in page.tags
    assert page.tags.count("table") == 2
    assert page.cells[-8:] == ["gap", "parameter", "fixed", "m", "0.25", "0.0", "", "gap <between> both"]
    assert page.text.count("speed & direction") == 1


def test_licences_of_all_parts_are_whole():
    for included, holders in (
        (("pythonfmu",), ("the cotrack authors", "Sun", "NTNU")),
        (("numba",), ("Sun", "Anaconda")),
    ):
        text = documentation(tostring(described()), README, included)["documentation/licenses/license.txt"].decode()
        for holder in holders:
            assert "Copyright (c) 2" in text
            assert holder in text
        assert text.count("THE SOFTWARE IS PROVIDED") + text.count("THIS SOFTWARE IS PROVIDED") == 2


def test_description_names_author_version_licence_and_the_scenes_experiment():
    root = described(stop=6.0)
    assert {root.get(name) for name in ("author", "copyright", "license", "version")}.isdisjoint({None, ""})
    assert root.find("DefaultExperiment").attrib == {"startTime": "0", "stopTime": "6.0", "stepSize": "0.00125"}
    nominal = {variable.get("name"): variable[0].get("nominal") for variable in root.iter("ScalarVariable")}
    assert nominal == {"brake.torque": "1000.0", "speed": None, "gap": None}


def test_types_and_units_to_show_are_defined():
    """Every unit to show is one of its unit, and worth what it is called."""
    root = described()
    units = {unit.get("name"): {each.get("name"): float(each.get("factor")) for each in unit.iter("DisplayUnit")}
             for unit in root.iter("Unit")}  # fmt: skip
    types = {kind.get("name"): dict(kind[0].attrib) for kind in root.iter("SimpleType")}
    for variable in root.iter("ScalarVariable"):
        real = variable[0]
        if real.tag == "Real" and real.get("unit") != "1":
            declared = types[real.get("declaredType")]
            assert {key: declared.get(key) for key in ("unit", "displayUnit")} == {
                key: real.get(key) for key in ("unit", "displayUnit")
            }
            assert real.get("displayUnit") is None or real.get("displayUnit") in units[real.get("unit")]
    turn = 2.0 * np.pi  # rad
    worth = {"deg": 360.0 / turn, "deg/s": 360.0 / turn, "rpm": 60.0 / turn, "km/h": 3.6}
    for unit, shown, factor in TYPES.values():
        if shown in worth:
            assert factor == pytest.approx(worth[shown], rel=1e-15)
        elif shown:
            assert (shown[1:], factor) == (unit, {"k": 1e-3, "M": 1e-6}[shown[0]])
    names = "speed", "chassis.angular_velocity.z", "left.sprocket.angular_velocity.y"
    kinds = [type_of(Port(name, "output", "rad/s", "")) for name in names]
    assert kinds == ["RotationalSpeed", "AngularVelocity", "RotationalSpeed"]


@pytest.mark.parametrize("kind", KINDS)
def test_every_component_has_an_icon(kind):
    script = ROOT / KINDS[kind]
    assert icon_files(script, 2) == {"model.png": icon_beside(script)}
    assert list(icon_files(script, 3)) == ["terminalsAndIcons/icon.png"]
    assert icon_beside(script).startswith(b"\x89PNG")
    assert len({icon_beside(ROOT / other) for other in KINDS.values()}) == len(KINDS)
    assert icon_files(ROOT / "fmi" / "slave.py", 2) == {}


@pytest.mark.parametrize("kind", KINDS)
def test_every_component_has_a_readme_that_a_build_depends_on(kind):
    readme = readme_beside(ROOT / KINDS[kind])
    assert readme.startswith("# ")
    assert "## Which connector goes where" in readme
    assert readme in key_parts(readme, ("numba",))
