"""Lists in the READMEs name what the registries of the code hold, and nothing else."""

import re
from collections.abc import Collection
from pathlib import Path
from typing import NamedTuple

import pytest

from fmus import components
from fmus.physics.contact.laws import LAWS
from fmus.precompile import component_ports
from fmus.track.choices import TRACKS
from orchestrator.cosim.coupling import COUPLINGS
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load, scene_names
from orchestrator.scene.tables import CouplingTable
from orchestrator.studies import STUDIES
from orchestrator.vocabulary.analyses import ANALYSES
from tests.validation.__main__ import STUDIES as VALIDATIONS

ROOT = Path(__file__).parents[1]
ROW = r"(?m)^\| `([\w-]+)`"  # of a table, with a name in code
STANDARD = {part.kind for model in TRACKS for part in assemble(load("straight", model)).parts}


class Listed(NamedTuple):
    """A list in a README, and the names that it must have."""

    page: str
    line: str  # pattern whose group contains names, in all its matches
    known: Collection[str]
    name: str = r"[\w-]+"  # pattern of a name

    def names(self) -> set[str]:
        """Names in the README."""
        text = (ROOT / self.page).read_text(encoding="utf-8")
        return {name for part in re.findall(self.line, text, re.MULTILINE) for name in re.findall(self.name, part)}


LISTS = {
    "scenes": Listed(
        "orchestrator/scenes.md",
        r"^\| scene \| content \|\n\| --- \| --- \|\n((?:\|.*\n)+)",
        scene_names(),
        ROW,
    ),
    "analyses": Listed("orchestrator/commands.md", r"^cotrack analyse LOG (\S+)$", ANALYSES),
    "definitions of analyses": Listed("orchestrator/analyses.md", r"^## ([a-z-]+)$", ANALYSES),
    "commands of studies": Listed("orchestrator/commands.md", r"^cotrack study ([a-z-]+)", STUDIES),
    "studies": Listed("orchestrator/studies.md", r"lists the studies of a scene: (.*?)\. ", STUDIES),
    "validations": Listed("orchestrator/commands.md", r"^python -m tests\.validation ([a-z-]+)", VALIDATIONS),
    "option --coupling": Listed(
        "orchestrator/commands.md",
        r"--coupling (\w+ +# or .*)$",
        {*COUPLINGS} - {CouplingTable().scheme},
        r"\b(?!or\b)\w+",
    ),
    "couplings": Listed("orchestrator/running.md", r"^\| coupling \| order \|.*\n\|.*\n((?:\|.*\n)+)", COUPLINGS, ROW),
    "components": Listed(
        "fmus/README.md",
        r"^\| (.*) \| the components \|$",
        [components.folder(kind) for kind in components.COMPONENT_KINDS],
    ),
    "standard FMUs": Listed(
        "fmus/in_your_tool.md", r"^`cotrack build -o FOLDER` writes (.*)$", STANDARD, r"(\w+)\.fmu"
    ),
    "laws": Listed("fmus/physics/README.md", r"^\| `contact/laws\.py` \| (.*) \|$", LAWS, r"`(\w+)\.py`"),
}


def test_common_signals_are_those_of_a_vehicle():
    """Names and units of the table of signals are those of the components."""
    text = (ROOT / "orchestrator" / "results.md").read_text(encoding="utf-8")
    listed = dict(re.findall(r"(?m)^\| `((?:left_|chassis|driver)[^`]*\.[^`]*)` \| (\S+) \|", text))
    parts = [(part.name, component_ports(part.kind, part.config)) for part in assemble(load("serpentine")).parts]
    units = {f"{name}.{port.name}": port.unit for name, ports in parts for port in ports}
    assert len(listed) == 18
    assert {name: units.get(name) for name in listed} == listed


@pytest.mark.parametrize("name", LISTS)
def test_a_list_names_what_there_is(name):
    assert LISTS[name].names() == set(LISTS[name].known)


OF_USERS = (
    "README", "fmus/in_your_tool", "orchestrator/tutorial", "orchestrator/scenes", "orchestrator/running",
    "orchestrator/results", "orchestrator/analyses", "orchestrator/studies", "orchestrator/measured_data",
    "orchestrator/your_fmus", "orchestrator/accuracy", "orchestrator/commands", "orchestrator/keys",
    "orchestrator/changes",
)  # fmt: skip


def test_pages_of_users_name_no_module():
    modules = {
        file.relative_to(ROOT).as_posix() for top in ("fmus", "orchestrator") for file in (ROOT / top).rglob("*.py")
    }
    assert len(modules) > 300
    for page in OF_USERS:
        for name in re.findall(r"[`(]((?:[\w.]+/)*\w+\.py)[`)]", (ROOT / f"{page}.md").read_text(encoding="utf-8")):
            assert not any(module.endswith(name.lstrip("./")) for module in modules), (page, name)


MADE_BY_THE_PAGE = {"MyDrive.py"}  # a file that a page for users writes


def test_pages_name_modules_that_there_are():
    modules = {file.name for folder in ("fmus", "orchestrator", "tests") for file in (ROOT / folder).rglob("*.py")}
    pages = [file for folder in ("fmus", "orchestrator", "tests") for file in (ROOT / folder).rglob("*.md")]
    named = {(page.name, name) for page in pages for name in re.findall(r"`(?:[\w./]*/)?(\w+\.py)`", page.read_text())}
    assert len(named) > 200
    assert {name for _, name in named} - modules == MADE_BY_THE_PAGE
