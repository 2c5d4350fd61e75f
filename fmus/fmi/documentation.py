"""Documentation, licences and icon of an FMU (FMI 2.0.4, section 2.3): its folder ``documentation``, and a picture.

The page has the README of the component, the sections on coupling of the page for users, and a table of the variables,
without links to other files.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape
from importlib.metadata import distribution, version
from pathlib import Path
from xml.etree.ElementTree import Element, fromstring

from markdown_it import MarkdownIt

OWN = "cotrack"  # distribution, whose licence every FMU has
COUPLING = (  # sections of in_your_tool.md that each FMU has
    "Which connector goes where", "In which order", "Check the coupling", "An engine of your own",
    "A drive of your own", "A chassis of your own",
)  # fmt: skip
COLUMNS = ("name", "causality", "variability", "unit", "start", "min", "max", "description")
STYLE = (
    "body { font-family: sans-serif; max-width: 60em; margin: auto } table { border-collapse: collapse } "
    "td, th { border: 1px solid #ccc; padding: 0.2em 0.5em }"
)


def documentation(description: bytes, readme: str, included: Sequence[str]) -> dict[str, bytes]:
    """Files of an FMU's documentation by name.

    ``description``: its modelDescription.xml. ``readme``: Markdown. ``included``: distributions of which the FMU holds
    parts, besides cotrack.
    """
    return {
        "documentation/index.html": _page(description, readme).encode(),
        "documentation/licenses/license.txt": _licences(included).encode(),
    }


def readme_beside(script: Path) -> str:
    """README of the folder of an FMU's shell, then how to couple it; empty where there is no such page."""
    pages = (script.with_name("README.md"), script.parents[1] / "in_your_tool.md")
    readme, users = (page.read_text(encoding="utf-8") if page.is_file() else "" for page in pages)
    return "\n\n".join(filter(None, [readme, *(_section(users, name) for name in COUPLING)]))


def _section(page: str, name: str) -> str:
    """Section of a page in Markdown; empty where there is none."""
    found = re.search(rf"^## {name}\n.*?(?=^## |\Z)", page, re.DOTALL | re.MULTILINE)
    return found[0].rstrip() if found else ""


def icon_beside(script: Path) -> bytes:
    """Icon of the folder of an FMU's shell, PNG; empty where there is none."""
    icon = script.with_name("icon.png")
    return icon.read_bytes() if icon.is_file() else b""


def icon_files(script: Path, fmi: int) -> dict[str, bytes]:
    """Icon of an FMU of FMI 2 or 3, by its name in the archive."""
    icon = icon_beside(script)
    return {"model.png" if fmi == 2 else "terminalsAndIcons/icon.png": icon} if icon else {}


def key_parts(readme: str, included: Sequence[str]) -> tuple[str, ...]:
    """Everything but modelDescription.xml on which the documentation depends, for the key of a build."""
    return readme, version(OWN), *(f"{name} {version(name)}" for name in included)


def _licences(included: Sequence[str]) -> str:
    rule = "\n" + "-" * 80 + "\n\n"
    heads = [f"{OWN} {version(OWN)}", *(f"This FMU contains parts of {name} {version(name)}." for name in included)]
    texts = [distribution(name).read_text("licenses/LICENSE") or "" for name in (OWN, *included)]
    return rule.join(f"{head}\n\n{text}" for head, text in zip(heads, texts, strict=True))


def _page(description: bytes, readme: str) -> str:
    root = fromstring(description)
    markdown = MarkdownIt("commonmark").enable("table")
    tokens = markdown.parse(readme)
    for token in tokens:
        if token.children is not None:
            token.children = [child for child in token.children if child.type not in ("link_open", "link_close")]
    rows = [_cells(variable) for variable in root.iterfind("ModelVariables/*")]
    head = "".join(f"<th>{column}</th>" for column in COLUMNS)
    body = "\n".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    name = escape(root.get("modelName", ""))
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{name}</title><style>{STYLE}</style></head><body>
{markdown.renderer.render(tokens, markdown.options, {})}
<h2>Variables of {name}</h2>
<p>{escape(root.get("description", ""))}. cotrack {escape(root.get("version", ""))}, SI units.</p>
<table><tr>{head}</tr>
{body}
</table></body></html>
"""


def _cells(variable: Element) -> list[str]:
    """Cells of the columns for a variable of FMI 2.0 or 3.0; the sizes of an array follow its name."""
    attributes, sizes = dict(variable.attrib), []
    for child in variable:
        if child.tag == "Dimension":
            sizes.append(child.get("start", ""))
        elif child.tag == "Start":
            attributes["start"] = child.get("value", "")
        else:  # the type of a variable of FMI 2.0
            attributes |= child.attrib
    if sizes:
        attributes["name"] += f"[{', '.join(sizes)}]"
    return [attributes.get(column, "") for column in COLUMNS]
