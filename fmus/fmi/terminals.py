"""Terminals of an FMU (terminalsAndIcons.xml: FMI 3.0, section 2.4.9, and FMI 2.0.4), written and read.

Each port of motion is a terminal, with the wrench about it where there is one; its members are arrays in FMI 3.0
(position), their elements in FMI 2.0 (position.x). Terminals of one kind match by the names of their members ("plug"):
what one shows, the other takes. Their kind says what a member carries over a communication step (``CARRIES``); a
further kind marks one variable that is such a mean alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Literal, NamedTuple
from xml.etree.ElementTree import Element, ParseError, SubElement, fromstring, parse, tostring

Carried = Literal["state", "rate", "mean"]
# What a group of members is over a communication step. A state belongs to its beginning, and who receives it
# extrapolates it with the rate beside it; a mean is that over the step just done.
CARRIES: dict[str, Carried] = {
    "position": "state", "orientation": "state", "velocity": "rate", "angular_velocity": "rate",
    "force": "mean", "torque": "mean",
}  # fmt: skip
FILE = "terminalsAndIcons/terminalsAndIcons.xml"
MEMBERS = "TerminalMemberVariable"
MEAN = "cotrack.mean"
TERMINAL_KINDS = {  # with the groups of their members, largest first
    "cotrack.motion_and_wrench": (*CARRIES,),
    "cotrack.motion": tuple(group for group, carried in CARRIES.items() if carried != "mean"),
}
MEMBER = re.compile(rf"(.+)\.(({'|'.join(CARRIES)})(?:\.[wxyz])?)")  # terminal, member, group
DEMAND = re.compile(r"(.+\.)?(speed|torque)\.demand")  # inputs that are means, as a mean wrench is
DEMANDING = {"Driver": ("left.speed", "right.speed")}  # outputs that are means besides wrenches, by model


class Terminal(NamedTuple):
    """Terminal of an FMU."""

    kind: str
    members: dict[str, str]  # variables by the names of members


def terminals(model: str, inputs: Iterable[str], outputs: Iterable[str]) -> dict[str, Terminal]:
    """Terminals, by their names, of an FMU of cotrack with the name of its ``model`` and its variables."""
    ports: dict[str, list[re.Match[str]]] = {}
    names = [*inputs], [*outputs]
    for found in filter(None, map(MEMBER.fullmatch, (*names[0], *names[1]))):
        ports.setdefault(found[1], []).append(found)
    made = {}
    for port, members in ports.items():
        kind = next(
            (kind for kind, groups in TERMINAL_KINDS.items() if {found[3] for found in members} >= {*groups}), ""
        )
        if kind:
            ordered = sorted(members, key=lambda found: [*CARRIES].index(found[3]))
            made[port] = Terminal(kind, {found[2]: found[0] for found in ordered if found[3] in TERMINAL_KINDS[kind]})
    means = [*filter(DEMAND.fullmatch, names[0]), *(name for name in names[1] if name in DEMANDING.get(model, ()))]
    return made | {name: Terminal(MEAN, {"mean": name}) for name in means}


def described_terminals(description: Element) -> dict[str, Terminal]:
    """Terminals of an FMU of cotrack by the root of its modelDescription.xml."""
    variables = [variable for parent in description.iter("ModelVariables") for variable in parent]
    inputs, outputs = (
        [v.get("name", "") for v in variables if v.get("causality") == way] for way in ("input", "output")
    )
    return terminals(description.get("modelName", ""), inputs, outputs)


def terminal_files(description: bytes) -> dict[str, bytes]:
    """File of terminals by its name, from a modelDescription.xml; none without terminals, as the schema wants."""
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    parent = SubElement(root, "Terminals")
    for name, (kind, members) in described_terminals(fromstring(description)).items():
        terminal = SubElement(parent, "Terminal", name=name, matchingRule="plug", terminalKind=kind)
        for member, variable in members.items():
            attributes = {"variableName": variable, "memberName": member, "variableKind": "signal"}
            SubElement(terminal, MEMBERS, attributes)
    return {FILE: bytes(tostring(root, encoding="utf-8", xml_declaration=True))} if len(parent) else {}


def read_terminals(folder: Path) -> list[Terminal]:
    """Terminals of an unpacked FMU; none if their file cannot be read.

    FMUs of FMI 2.0 that older versions of cotrack built have no such file: their variables have the same names.
    """
    try:
        description = parse(folder / "modelDescription.xml").getroot()
        if description.get("generationTool", "").startswith("cotrack") and not (folder / FILE).is_file():
            return [*described_terminals(description).values()]
        nodes = [*parse(folder / FILE).getroot().iter("Terminal")]
    except (OSError, ParseError):
        return []
    members = [{m.get("memberName", ""): m.get("variableName", "") for m in node.iter(MEMBERS)} for node in nodes]
    return [Terminal(node.get("terminalKind", ""), each) for node, each in zip(nodes, members, strict=True)]


def carried(found: Iterable[Terminal]) -> dict[str, Carried]:
    """Return what variables carry over a step, by name, as terminals of our kinds say it."""
    members = [(kind, name.partition(".")[0], variable) for kind, each in found for name, variable in each.items()]
    return {
        variable: CARRIES.get(group, "mean")
        for kind, group, variable in members
        if kind == MEAN or group in TERMINAL_KINDS.get(kind, ())
    }
