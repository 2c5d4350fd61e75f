"""Descriptions of variables in the ``modelDescription.xml`` of an FMU, which may come from anyone."""

from __future__ import annotations

from xml.etree import ElementTree

from orchestrator.files.budget import DOCUMENT, check_size


def variable_texts(content: bytes) -> dict[str, str]:
    """Return the descriptions by the names of the variables; none if the document is damaged or too large."""
    try:
        check_size(content, DOCUMENT)
        tree = ElementTree.fromstring(content)
    except (ElementTree.ParseError, LookupError, ValueError):  # LookupError: an unknown encoding
        return {}
    return {each.get("name", ""): each.get("description", "") for each in tree.iter("ScalarVariable")}
