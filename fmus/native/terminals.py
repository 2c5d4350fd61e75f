"""terminalsAndIcons.xml of FMI 3.0: a terminal for each port of motion, with the wrench about it where there is one.

Terminals of one kind match by the names of their members ("plug"): what one shows, the other takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement, tostring

from fmus.native.arrays import ArrayVariable

MOTION = "position", "orientation", "velocity", "angular_velocity"
KINDS = {"cotrack.motion_and_wrench": (*MOTION, "force", "torque"), "cotrack.motion": MOTION}  # largest first


def terminals(arrays: Sequence[ArrayVariable]) -> dict[str, tuple[str, ...]]:
    """Members of the terminals, a value of ``KINDS`` each, by the terminal's name."""
    members: dict[str, set[str]] = {}
    for array in arrays:
        port, _, member = array.name.rpartition(".")
        if array.shape:
            members.setdefault(port, set()).add(member)
    return {
        port: next(wanted for wanted in KINDS.values() if present >= {*wanted})
        for port, present in members.items()
        if present >= {*MOTION}
    }


def files(arrays: Sequence[ArrayVariable]) -> dict[str, bytes]:
    """File of an FMU by its name; none for a component without terminals, which the schema does not allow."""
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    parent = SubElement(root, "Terminals")
    kinds = {members: kind for kind, members in KINDS.items()}
    for port, members in terminals(arrays).items():
        terminal = SubElement(parent, "Terminal", name=port, matchingRule="plug", terminalKind=kinds[members])
        for member in members:
            SubElement(
                terminal,
                "TerminalMemberVariable",
                variableName=f"{port}.{member}",
                memberName=member,
                variableKind="signal",
            )
    text = bytes(tostring(root, encoding="utf-8", xml_declaration=True))
    return {"terminalsAndIcons/terminalsAndIcons.xml": text} if len(parent) else {}
