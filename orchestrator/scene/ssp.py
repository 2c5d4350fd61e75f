"""SSP archive of a scene: its FMUs and their connections in one file, for other tools.

Source: System Structure and Parameterization 1.0 (Modelica Association, 2019).

Every instance has an FMU of its own, whose defaults are its parameters. A tool that ignores the parameter sets of the
archive therefore has the right vehicle, and the right side of it at its place.
"""

from __future__ import annotations

import io
import json
import zipfile
from html import escape
from pathlib import Path
from xml.etree.ElementTree import Element, fromstring

from markdown_it import MarkdownIt

from fmus.build import Product, archive, build_all
from fmus.vehicle import BadInput
from orchestrator import __version__
from orchestrator.files.replacing import replacing
from orchestrator.scene.assembly import assemble, build_native_all
from orchestrator.scene.placing import placed
from orchestrator.scene.products import product_config
from orchestrator.scene.scene import Scene
from orchestrator.scene.structure_document import DOCUMENT_NAME, StructuredComponent, structure_document

SCENE = "resources/scene.json"  # the placed scene, by which ``cotrack run`` steps the archive
PAGE = """# {title}

{count} FMUs for co-simulation (FMI 2.0), made by cotrack {version} from the scene `{name}`. Each FMU has its own
documentation.

| component | FMU | contents |
| --- | --- | --- |
{rows}

- **Communication step**: {step} s in the scene, to {stop} s.
- **Parameters**: the defaults of each FMU are those of its component. `SystemStructure.ssd` has all of them too, a
  parameter set of the name `{name}` for each component.
- **Exchange**: cotrack steps the tracks first, with the motion of the wheels at the beginning of the step, then the
  drives, then the chassis, both with the mean wrenches that the tracks have just computed: second order. A tool that
  exchanges all values at once passes every wrench on one step late: first order, so choose a smaller step there.
"""


def write_ssp(scene: Scene, file: Path, native: bool = True) -> None:
    """Write the SSP archive of a scene, with native FMUs (for Windows too where the compiler can) or Python ones.

    Raises BadInput if the file cannot be written, BuildFailed.
    """
    if not file.parent.is_dir():
        raise BadInput(f"{file} cannot be written: there is no folder {file.parent}")
    scene.require_own_parts("an archive has")
    scene = placed(scene)
    assembly = assemble(scene)
    products: list[Product] = [(part.kind, product_config(scene, part), part.name) for part in assembly.parts]
    files = {name: path.read_bytes() for name, path in _build(products, native).items()}
    sources = {part.name: f"resources/{part.name}.fmu" for part in assembly.parts}
    components = [StructuredComponent(name, source, _description(files[source])) for name, source in sources.items()]
    tool = f"cotrack {__version__}"
    files[SCENE] = json.dumps(scene.resolved(), indent=1, sort_keys=True).encode()
    files[DOCUMENT_NAME] = structure_document(
        scene.name, scene.title, tool, components, assembly.connections, scene.run.stop
    )
    files["documentation/index.html"] = _page(scene, components)
    try:
        with replacing(file) as fresh:
            fresh.write_bytes(archive(files, b""))
    except OSError as error:
        raise BadInput(f"{file} cannot be written: {error.strerror}") from None


def _build(products: list[Product], native: bool) -> dict[str, Path]:
    """FMUs by their names in the archive."""
    if not native:
        paths = build_all(products)
    else:
        from fmus.native.pack import targets_windows  # loads compilers

        paths = build_native_all(products, windows=targets_windows())
    return {f"resources/{path.name}": path for path in paths}


def _description(fmu: bytes) -> Element:
    with zipfile.ZipFile(io.BytesIO(fmu)) as packed:
        return fromstring(packed.read("modelDescription.xml"))


def _page(scene: Scene, components: list[StructuredComponent]) -> bytes:
    rows = "\n".join(
        f"| {component.name} | {component.source} | {component.description.get('description', '')} |"
        for component in components
    )
    text = PAGE.format(
        title=scene.title,
        count=len(components),
        version=__version__,
        name=scene.name,
        rows=rows,
        step=scene.run.step,
        stop=scene.run.stop,
    )
    body = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    head = f'<meta charset="utf-8"><title>{escape(scene.name)}</title>'
    return f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head><body>\n{body}</body></html>\n'.encode()
