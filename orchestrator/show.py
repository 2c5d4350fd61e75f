"""``cotrack show``: what is in a scene and what is left out, down to contact pairs, outputs and modules."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from fmus.contents import contents
from orchestrator.scene import Scene, TrackScene
from orchestrator.system import TRACK, Assembly, Part, assemble, describe


def lines(scene: Scene) -> Iterator[str]:
    """Lines of text; raises BuildFailed where a component cannot start."""
    yield from describe(scene)
    if isinstance(scene, TrackScene):
        yield from _evaluated(scene, assemble(scene))


def _evaluated(scene: TrackScene, assembly: Assembly) -> Iterator[str]:
    found = contents([(part.kind, part.config, part.parameters) for part in assembly.parts])
    yield "contact pairs"
    touching = [(part, pairs(scene, part)) for part in assembly.parts]
    for part, own in touching:
        for pair in own:
            yield f"  {part.name:12} {pair}"
    if not any(own for _, own in touching):
        yield "  none: no contact law is loaded"
    yield "outputs"
    sizes = zip(assembly.parts, found.outputs, found.link_outputs, found.state, strict=True)
    for part, outputs, links, state in sizes:
        every = f" and {links} of links every {scene.run.links} steps" if links else ""
        yield f"  {part.name:12} {outputs} a step{every}; {state} numbers of state"
    whole = len(found.modules) + len(found.left_out)
    yield f"modules of fmus: {len(found.modules)} of {whole} in"
    for folder in _folded(found.modules):
        yield f"  {folder}"
    yield f"modules of fmus: {len(found.left_out)} left out"
    for folder in _folded(found.left_out):
        yield f"  {folder}"


def pairs(scene: TrackScene, part: Part) -> list[str]:
    """The contacts that a component looks for in every evaluation."""
    if part.stage != TRACK:
        own: dict[str, Any] = part.config.get("chassis", {}).get("ground", {})
        points = len(part.config["vehicle"]["chassis"].get("hull", ())) if own.get("hull") else 0
        wheels = [f"wheels of the {side} side on the ground" for side in own.get("bare", ())]
        return ([f"{points} points of the hull on the ground"] if points else []) + wheels
    track = part.config["track"]
    links, kinds = track["links"], [wheel["kind"] for wheel in track["wheels"]]
    pins, rims = links + (0 if track["closed"] else 1), kinds.count("rim")
    solid = scene.track.model == "rigid" or scene.track.element == "beam"  # two by two across a link
    found = []
    if "teeth" in kinds:
        found.append(f"teeth: {kinds.count('teeth')} sprocket x {pins} pins")
    if rims:
        found.append(f"rims: {rims} wheels x {links} links, {4 if solid else 2} points where they touch")
        if solid:
            found.append(f"guides: {rims} wheels x {links} links")
    if track["ground"]:
        found.append(f"ground: {links} links, {4 if solid else 2} points each")
    return found


def _folded(modules: Iterable[str]) -> Iterator[str]:
    """Modules by their folder."""
    folders: dict[str, list[str]] = {}
    for module in modules:
        folder, _, name = module.rpartition(".")
        folders.setdefault(folder, []).append(name)
    for folder, names in sorted(folders.items()):
        yield f"{folder}: {', '.join(sorted(names))}"
