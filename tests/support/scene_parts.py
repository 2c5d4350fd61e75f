"""Parts of scenes with their numbers, and a drive with points of its speed."""

from __future__ import annotations

from functools import cache

from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load


@cache
def parts(name="straight", kind="rigid", *settings):
    """Parts of a scene by name, placed."""
    scene = placed(load(name, kind, [*settings]))
    return {part.name: part for part in assemble(scene).parts}


def drive(inertia=9.0, points="", **more):
    """Kind and config of a drive, with points of its speed."""
    given = {"parameters": {"mode": "speed", "speed.points": points}} if points else {}
    return "SprocketDrive", {"drive": {"inertia": inertia, "mount": [0.0, 0.0, 0.0], **more}, **given}
