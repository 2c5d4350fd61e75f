"""Descriptions of variables in the model descriptions of a log, which may come from anyone."""

from __future__ import annotations

from typing import Protocol
from xml.etree import ElementTree

from orchestrator.files.budget import DOCUMENT, check_size
from orchestrator.log.container_reader import LogUnreadable


class WithAttachments(Protocol):
    """An opened log."""

    def attachment(self, name: str) -> bytes:
        """Return an attached file; raises LookupError, LogUnreadable."""


def recorded_texts(log: WithAttachments, instance: str) -> dict[str, str]:
    """Return the descriptions by the variables of an instance; none if the document is missing or damaged."""
    try:
        content = log.attachment(f"{instance}.modelDescription.xml")
        check_size(content, DOCUMENT)
        tree = ElementTree.fromstring(content)
    except (LogUnreadable, ElementTree.ParseError, LookupError, ValueError):  # LookupError: an unknown encoding, too
        return {}
    return {each.get("name", ""): each.get("description", "") for each in tree.iter("ScalarVariable")}
