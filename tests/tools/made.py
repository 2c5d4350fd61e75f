"""What other tools are tried on: a drive of FMI 2.0 and 3.0, and archives of two drives."""

import re
import subprocess
import sys
import zipfile
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


def command(*words: object) -> None:
    """Run a command of cotrack."""
    subprocess.run([sys.executable, "-m", "orchestrator", *map(str, words)], check=True, stdout=subprocess.DEVNULL)


def fmu(place: Path, fmi: int) -> str:
    """Path of the drive."""
    return str(place / f"fmi{fmi}" / DRIVE)


def write_archives(place: Path) -> None:
    """Build the drives, and archives of two: as cotrack writes them, and the same with changes of the document."""
    for fmi in (2, 3):
        if not Path(fmu(place, fmi)).exists():
            command("build", "rig", "--track", "rigid", "--native", "--fmi", fmi, "-o", place / f"fmi{fmi}")
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
    documents |= {f"named_{name}": with_outputs(documents[name], SHOWN) for name in ("drives", "set", "scaled")}
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
