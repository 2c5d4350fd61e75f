"""Small FMUs and archives for the scripts of this folder: a drive of FMI 2.0 and 3.0, and two drives as an archive.

The mount of the drive ``second`` turns as fast as the sprocket of ``first``. Results are given as
multiples of that without changes: a parameter set or factor of 2 that is ignored reads "1 times", one that is
applied "2 times"; a drive whose ``mode`` was set to ``torque`` stands, "0 times".
"""

import re
import subprocess
import sys
import zipfile
from collections.abc import Callable
from math import cos, pi
from pathlib import Path
from xml.etree.ElementTree import fromstring

from orchestrator.cosim.graph import Connection
from orchestrator.scene.products import StructuredComponent, structure_document

H, STEPS = 1e-3, 100
END = 3.0  # rad/s, speed that the drives of the rig have after their ramp of a second
SCALED = '<ssc:LinearTransformation factor="2.0" />'
SHOWN = {
    "shown.first": ("first", "speed"),
    "shown.own": ("second", "speed"),
    "shown.turned": ("second", "sprocket.angular_velocity.y"),
}
DRIVE, OTHER = "SprocketDrive-rig.fmu", "SprocketDrive-rig-idler_drive.fmu"
PLACES = {(0.0, -4.04498505): "its own", (-4.04498505,) * 2: "those of one for all"}  # in numbers.ssp, m


def folder() -> Path:
    """Folder of the command line, with what the scripts need; the first time takes a minute or two."""
    if len(sys.argv) != 2:
        raise SystemExit(f"usage: {sys.argv[0]} FOLDER")
    place = Path(sys.argv[1]).resolve()
    for fmi in ("2", "3"):
        if not (place / f"fmi{fmi}" / DRIVE).exists():
            options = ("--track", "rigid", "--native", "--fmi", fmi, "-o", place / f"fmi{fmi}")
            subprocess.run([sys.executable, "-m", "orchestrator", "build", "rig", *options], check=True)
    write_archives(place)
    return place


def fmu(place: Path, fmi: int) -> str:
    """Path of the drive."""
    return str(place / f"fmi{fmi}" / DRIVE)


def write_archives(place: Path) -> None:
    """Archives of two drives: as cotrack writes them, and the same with changes of the document."""
    two, three = (Path(fmu(place, fmi)).read_bytes() for fmi in (2, 3))
    with zipfile.ZipFile(fmu(place, 2)) as packed:
        description = fromstring(packed.read("modelDescription.xml"))
    parts = [StructuredComponent(name, f"resources/{name}.fmu", description) for name in ("first", "second")]
    wire = Connection("first", ("speed",), "second", ("mount.angular_velocity.y",))
    plain = structure_document("drives", "Two drives", "cotrack", parts, [wire], 14.0).decode()
    documents = {
        "drives": plain,
        "set": parameter(plain, "speed.end", str(2.0 * END)),
        "scaled": re.sub(r"(<ssd:Connection [^>]*?) />", rf"\1>{SCALED}</ssd:Connection>", plain),
        "later": plain.replace('startTime="0.0" stopTime="14.0"', 'startTime="1.0" stopTime="1.05"'),
        "system": with_outputs(plain, {"second.speed": ("second", "speed")}),
    }
    documents |= {
        f"named_{name}": with_outputs(documents[name], SHOWN) for name in ("drives", "set", "scaled", "later")
    }
    for name, document in documents.items():
        write(place / f"{name}.ssp", document, {f"resources/{part.name}.fmu": two for part in parts})
    other = (place / "fmi2" / OTHER).read_bytes()  # of the same shape: only its numbers differ, and by them its guid
    write(place / "numbers.ssp", plain, {"resources/first.fmu": two, "resources/second.fmu": other})
    for name, document in (("three", THREE), ("named_three", with_outputs(THREE, {"shown.first": ("drive", "speed")}))):
        write(place / f"{name}.ssp", document, {"resources/drive.fmu": three})


def with_outputs(document: str, outputs: dict[str, tuple[str, str]]) -> str:
    """Document with outputs of the whole system."""
    connectors = "".join(f'<ssd:Connector name="{name}" kind="output"><ssc:Real /></ssd:Connector>' for name in outputs)
    wires = "".join(
        f'<ssd:Connection startElement="{part}" startConnector="{variable}" endConnector="{name}" />'
        for name, (part, variable) in outputs.items()
    )
    changed = document.replace("<ssd:Elements>", f"<ssd:Connectors>{connectors}</ssd:Connectors><ssd:Elements>", 1)
    if "<ssd:Connections>" in changed:
        return changed.replace("<ssd:Connections>", f"<ssd:Connections>{wires}", 1)
    return changed.replace("</ssd:Elements>", f"</ssd:Elements><ssd:Connections>{wires}</ssd:Connections>", 1)


def parameter(document: str, name: str, value: str) -> str:
    """Document with another value of a parameter of the first component."""
    pattern = rf'(<ssv:Parameter name="{re.escape(name)}">\s*<ssv:\w+ value=")[^"]*'
    return re.sub(pattern, rf"\g<1>{value}", document, count=1)


def write(file: Path, document: str, files: dict[str, bytes]) -> None:
    """Write an archive."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr("SystemStructure.ssd", document)
        for name, content in files.items():
            packed.writestr(name, content)


THREE = """<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="three">
  <ssd:System name="three">
    <ssd:Elements>
      <ssd:Component name="drive" type="application/x-fmu-sharedlibrary" source="resources/drive.fmu">
        <ssd:Connectors>
          <ssd:Connector name="speed" kind="output"><ssc:Real /></ssd:Connector>
        </ssd:Connectors>
      </ssd:Component>
    </ssd:Elements>
  </ssd:System>
</ssd:SystemStructureDescription>
"""


def said(tool: str, found: dict[str, str], expected: dict[str, str]) -> None:
    """Print what was found, one line; exit with 1 and the differences if it is not what the table says."""
    print(f"{tool}: " + "; ".join(f"{name}: {text}" for name, text in found.items()))
    changed = [name for name in expected | found if found.get(name) != expected.get(name)]
    if changed:
        raise SystemExit("changed: " + "; ".join(f"{name}: was {expected.get(name)}" for name in changed))


def times(value: float, once: float) -> str:
    """How many times a value is another one, to a few per cent."""
    return next((f"{k:g} times" for k in (0.0, 1.0, 2.0) if abs(value - k * once) < 0.1 * abs(once)), f"{value!r}")


def speed_at(t: float) -> float:
    """Speed of the drive ``first`` at a time of its ramp, rad/s."""
    return 0.5 * END * (1.0 - cos(pi * min(t, 1.0)))


def attempt(call: Callable[[], str]) -> str:
    """Result of a call, or the kind of its error."""
    try:
        return call()
    except Exception as error:  # a tool's refusal is what is asked for
        return f"refused ({type(error).__name__})"
