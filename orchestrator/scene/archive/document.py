"""Files and documents of an archive, and values in them as XML Schema writes them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import NamedTuple
from urllib.parse import unquote
from xml.etree.ElementTree import Element, ParseError, fromstring

from fmus.vehicle import BadInput, value_text
from orchestrator.cosim.base_units import QUANTITIES, UNCHANGED, BaseUnit, Conversion
from orchestrator.files.budget import DOCUMENT, OverBudget, read_file

VERSIONS = "1.0", "2.0"
REAL = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")
INTEGER = re.compile(r"[+-]?\d+")
TRUTH = {"true": True, "1": True, "false": False, "0": False}
FLOATS = "Real", "Float64", "Float32"
WHOLES = "Integer", *(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64))
OTHER_TRANSFORMATIONS = (
    "BooleanMappingTransformation",
    "IntegerMappingTransformation",
    "EnumerationMappingTransformation",
)


class Place(NamedTuple):
    """Where a document is."""

    folder: Path  # against which its sources are resolved
    where: str  # beginning of messages

    def at(self, name: str) -> Place:
        """The same folder, for messages about a part."""
        return self._replace(where=f"{self.where}: {name}")


def local(element: Element) -> str:
    """Name of an element without its namespace."""
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def children(element: Element | None, *path: str) -> Iterator[Element]:
    """Elements by the names of a path, whatever the prefix of their namespace is."""
    if element is None:
        return
    if not path:
        yield element
        return
    for child in element:
        if local(child) == path[0]:
            yield from children(child, *path[1:])


def child(element: Element | None, *path: str) -> Element | None:
    """First element of a path, or None."""
    return next(children(element, *path), None)


def document(file: Path, where: str) -> Element:
    """Root of an XML document; raises BadInput."""
    try:
        return fromstring(read_file(file, DOCUMENT))
    except (OSError, OverBudget, ParseError, LookupError, ValueError) as error:  # LookupError: an unknown encoding
        raise BadInput(f"{where} cannot be read: {error}") from None


def inside(source: str, place: Place) -> Path:
    """File of a relative URI; raises BadInput for any other place."""
    path = PurePosixPath(unquote(source))
    if not source or ":" in source or path.is_absolute() or ".." in path.parts or "\0" in str(path):
        raise BadInput(f"{place.where}: source = {value_text(source)}: must be a file in the archive")
    if not (place.folder / path).is_file():
        raise BadInput(f"{place.where}: source = {value_text(source)}: there is no such file in the archive")
    return place.folder / path


def content(element: Element, kind: str, place: Place, component: Place | None = None) -> Element | None:
    """Content ``kind`` of an element: in itself, or in the document of its source; raises BadInput.

    ``component``: folder of the component for sources inside it.
    """
    source = element.get("source")
    if not source:
        return next((one for one in element.iter() if local(one) == kind and one is not element), None)
    base = place
    if element.get("sourceBase", "SSD") == "component":
        if component is None:
            raise BadInput(f"{place.where}: source = {value_text(source)}: only FMUs have files of their own")
        base = component
    root = document(inside(source, base), f"{place.where}: {source}")
    if local(root) != kind:
        raise BadInput(f"{place.where}: {source} holds {local(root)}, not {kind}")
    return root


def number(text: str | None) -> float:
    """Double of XML Schema; raises ValueError, also for one that is not finite."""
    text = (text or "").strip()
    if not REAL.fullmatch(text) or not math.isfinite(float(text)):
        raise ValueError(text)
    return float(text)


def truth(text: str | None) -> bool:
    """Boolean of XML Schema; raises ValueError."""
    try:
        return TRUTH[(text or "false").strip()]
    except KeyError:
        raise ValueError(text) from None


def linear(element: Element, where: str) -> Conversion:
    """Linear transformation in a connection or a mapping; raises BadInput, also for other transformations."""
    for one in element:
        if local(one) in OTHER_TRANSFORMATIONS:
            raise BadInput(f"{where}: a {local(one)} is not supported, only a LinearTransformation")
        if local(one) == "LinearTransformation":
            try:
                return Conversion(number(one.get("factor", "1")), number(one.get("offset", "0")))
            except ValueError:
                raise BadInput(f"{where}: its LinearTransformation must have finite numbers") from None
    return UNCHANGED


def units_of(root: Element | None) -> dict[str, BaseUnit]:
    """Units that a document defines."""
    found = {}
    for unit in children(root, "Units", "Unit"):
        base = child(unit, "BaseUnit")
        if base is not None:
            try:
                exponents = tuple(number(base.get(quantity, "0")) for quantity in QUANTITIES)
                found[unit.get("name", "")] = BaseUnit(
                    exponents, number(base.get("factor", "1")), number(base.get("offset", "0"))
                )
            except ValueError:
                continue  # a unit that is not defined: refused where it is needed
    return found
