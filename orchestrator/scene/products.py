"""FMUs of scenes and SSP archives of them, for other tools.

Source: System Structure and Parameterization 1.0 (Modelica Association, 2019), of SystemStructure.ssd sections 4.4 and
5: components, their connectors and parameters, connections.

Every instance in an archive has an FMU of its own, whose defaults are its parameters. A tool that ignores the parameter
sets of the archive therefore has the right vehicle, and the right side of it at its place.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Collection, Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, SubElement, fromstring, indent, register_namespace, tostring

from markdown_it import MarkdownIt

from fmus.cache.files import replacing
from fmus.fmi.build import Product, archive, build_all
from fmus.interface.defaults import EXPERIMENT, KEY
from fmus.track.choices import TRACKS
from fmus.track.link_outputs import INTERVAL
from fmus.vehicles.tables import BadInput
from orchestrator import __version__
from orchestrator.cosim.graph import Connection
from orchestrator.cosim.variables import LINK_FAMILIES
from orchestrator.files.folders import flaw
from orchestrator.scene.archive.elements import DOCUMENT_NAME, FMU
from orchestrator.scene.assembly import assemble, build_native_all
from orchestrator.scene.kinds import Scene
from orchestrator.scene.parts import Part
from orchestrator.scene.placing import placed
from orchestrator.scene.replacement import DEMANDS
from orchestrator.scene.scene import load, scene_names

STANDARD = "straight"  # its FMUs have names without suffix


def gallery_products(models: Sequence[str] = tuple(TRACKS), settings: Sequence[str] = ()) -> list[Product]:
    """Every distinct FMU of the gallery; those of the standard vehicle come first and have no suffix."""
    ordered = [STANDARD, *(name for name in scene_names() if name != STANDARD)]
    return scene_products([load(name, model, settings) for name in ordered for model in models])


def scene_products(scenes: Sequence[Scene]) -> list[Product]:
    """Every distinct FMU of some scenes, with parameters as defaults; of two sides, the left one's.

    Variants carry the scene's name, and the component's and the links' where needed.
    """
    keys: set[str] = set()
    names: set[str] = set()
    products: list[Product] = []
    for scene in scenes:
        scene.require_own_parts("cotrack build makes")
        for part in sorted(assemble(placed(scene)).parts, key=_side):
            config = product_config(scene, part)
            mirrored = config[KEY] | {"start.lateral": abs(_side(part))}  # one FMU serves both sides
            key = json.dumps([part.kind, part.config, mirrored], sort_keys=True)
            if key in keys:
                continue
            keys.add(key)
            name = part.kind if scene.name == STANDARD else f"{part.kind}-{scene.name}"
            if name in names:
                name = f"{part.kind}-{scene.name}-{part.name}"
            if name in names:  # a place that depends on the links
                name += f"-{scene.track.model}"
            names.add(name)
            products.append((part.kind, config, name))
    return products


def product_config(scene: Scene, part: Part) -> dict[str, Any]:
    """Config of the FMU of a part for another tool: the part's parameters are its defaults."""
    # Another tool takes link means over its own communication step.
    parameters = {name: value for name, value in part.parameters.items() if name != INTERVAL}
    return part.config | {KEY: parameters, EXPERIMENT: {"stop": scene.run.stop, "step": scene.run.step}}


def _side(part: Part) -> float:
    """Lateral distance of the part to the right, m; sorts left before right."""
    return -float(part.parameters.get("start.lateral", 0.0))


def build_to(
    folder: Path, products: Sequence[Product], native: bool = False, windows: bool = False, fmi: int = 2
) -> list[Path]:
    """Build FMUs into a folder; return their paths in order.

    ``windows`` adds libraries to native ones, which may be of FMI 2.0 or 3.0 (``fmi``: 2 or 3). Raises BadInput if the
    folder cannot be created.
    """
    make_folder(folder)
    return build_native_all(products, folder, windows, fmi) if native else build_all(products, folder)


def make_folder(folder: Path) -> None:
    """Create a folder for results; raises BadInput if that, or a file in it, cannot be made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"the folder {folder} cannot be made: {error.strerror}") from None
    if problem := flaw(folder):
        raise BadInput(f"the folder {folder} cannot be written: {problem}")


VERSION = "1.0"
NAMESPACES = {
    letters: f"http://ssp-standard.org/SSP1/SystemStructure{name}"
    for letters, name in (("ssc", "Common"), ("ssd", "Description"), ("ssv", "ParameterValues"))
}
ENDS = ("startElement", "startConnector", "endElement", "endConnector")  # attributes of a connection


class StructuredComponent(NamedTuple):
    """An FMU of the archive, under the name of its instance."""

    name: str
    source: str  # path in the archive
    description: Element  # root of its modelDescription.xml


def structure_document(
    name: str,
    text: str,
    tool: str,
    components: Sequence[StructuredComponent],
    connections: Iterable[Connection],
    stop: float,
) -> bytes:
    """SystemStructure.ssd: outputs, parameters and connected inputs are connectors, with units.

    The start values of all parameters are a parameter set of each component, so that a system of FMUs of the same
    shapes becomes this one by its document alone. All sets have the name of the system: some tools choose by name.
    Outputs of links are left out: there are 700 to a track. Inputs without a connection are left out too, because some
    tools set every input connector to zero.

    :param text: description of the system, one line.
    :param stop: end of the DefaultExperiment, s; it begins at 0.
    """
    for letters, namespace in NAMESPACES.items():
        register_namespace(letters, namespace)
    root = Element(_tag("ssd:SystemStructureDescription"), version=VERSION, name=name, generationTool=tool)
    system = SubElement(root, _tag("ssd:System"), name=name, description=text)
    elements = SubElement(system, _tag("ssd:Elements"))
    pairs = [
        (connection.source, output, connection.target, into)
        for connection in connections
        for output, into in zip(connection.outputs, connection.inputs, strict=True)
    ]
    for component in components:
        _add_component(elements, component, {into for _, _, target, into in pairs if target == component.name}, name)
    if pairs:
        wiring = SubElement(system, _tag("ssd:Connections"))
        for pair in pairs:
            SubElement(wiring, _tag("ssd:Connection"), dict(zip(ENDS, pair, strict=True)))
    _add_units(root, components)
    SubElement(root, _tag("ssd:DefaultExperiment"), startTime="0.0", stopTime=repr(float(stop)))
    indent(root)
    return bytes(tostring(root, encoding="utf-8", xml_declaration=True))


def _tag(name: str) -> str:
    letters, local = name.split(":")
    return f"{{{NAMESPACES[letters]}}}{local}"


def _add_component(parent: Element, component: StructuredComponent, connected: Collection[str], system: str) -> None:
    element = SubElement(
        parent,
        _tag("ssd:Component"),
        name=component.name,
        type=FMU,
        source=component.source,
        implementation="CoSimulation",
    )
    connectors = SubElement(element, _tag("ssd:Connectors"))
    for variable in component.description.iter("ScalarVariable"):
        name, causality, kind = variable.get("name", ""), variable.get("causality", ""), variable[0]
        shown = causality in ("output", "parameter") or name in connected or name.endswith(DEMANDS)
        if shown and not name.startswith(LINK_FAMILIES):
            connector = SubElement(connectors, _tag("ssd:Connector"), name=name, kind=causality)
            unit = kind.get("unit")
            SubElement(connector, _tag(f"ssc:{kind.tag}"), {"unit": unit} if unit else {})
    bindings = SubElement(element, _tag("ssd:ParameterBindings"))
    values = SubElement(SubElement(bindings, _tag("ssd:ParameterBinding")), _tag("ssd:ParameterValues"))
    chosen = SubElement(values, _tag("ssv:ParameterSet"), version=VERSION, name=system)
    parameters = SubElement(chosen, _tag("ssv:Parameters"))
    for variable in component.description.iter("ScalarVariable"):
        if variable.get("causality") == "parameter":
            parameter = SubElement(parameters, _tag("ssv:Parameter"), name=variable.get("name", ""))
            SubElement(parameter, _tag(f"ssv:{variable[0].tag}"), value=variable[0].get("start", ""))


def _add_units(root: Element, components: Sequence[StructuredComponent]) -> None:
    """Add the units of all components, each once; equal names have equal definitions in our FMUs."""
    units = {
        unit.get("name", ""): unit.find("BaseUnit")
        for component in components
        for unit in component.description.iter("Unit")
    }
    if units:
        parent = SubElement(root, _tag("ssd:Units"))
        for name, base in units.items():
            unit = SubElement(parent, _tag("ssc:Unit"), name=name)
            SubElement(unit, _tag("ssc:BaseUnit"), {} if base is None else base.attrib)


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
