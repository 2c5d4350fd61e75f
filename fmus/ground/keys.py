"""Keys of a table ``ground`` that make it a terrain; without the kernels of one, so that level scenes load none."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

SLOPES = ("grade", "bank")
SHAPES = ("step", "half_round", "trench", "kerb", "washboard", "rough", "heightmap", "friction")


def is_terrain(ground: Mapping[str, Any]) -> bool:
    """Whether the ground is neither level nor level with a bump."""
    return any(ground.get(key) for key in (*SLOPES, *SHAPES))


def is_plane(ground: Mapping[str, Any]) -> bool:
    """Whether the ground is a slope everywhere, and nothing else."""
    return ground.get("incline_start") is None and not any(ground.get(key) for key in (*SHAPES, "bump"))
