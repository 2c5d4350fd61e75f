"""Models of tracked vehicles that the paper compares or discusses, one row each."""

from __future__ import annotations

from typing import NamedTuple

from orchestrator.scene.kinds import Scene
from orchestrator.scene.scene import load

SCENE = "straight"  # rest, half-cosine to 20 rad/s at both sprockets, constant: figure 10
DROP = ("start.state=drawn",)  # section 8.2, figure 13: springs settle by 0.03 m from an unloaded start
CONSTRAINED = ("track.joints=constrained",)
SPRING = ("track.closure=spring",)
ROD = (f"vehicle.track.inertia=[0.22, {18.02 * 0.1524**2 / 12.0!r}, 0.25]",)  # kg m2; about the pin m l^2 / 12


class Model(NamedTuple):
    """Track model of the comparison."""

    name: str  # of its files
    label: str  # in tables and pictures
    track: str  # model of the scene
    settings: tuple[str, ...]  # of its tracks
    line: str  # style of its curves
    colour: str


RIGID = Model("rigid", "rigid, augmented, closed by a pin", "rigid", (), ":", "C0")
RIGID_SPRING = Model("rigid-spring", "rigid, augmented, closed by a spring", "rigid", SPRING, "--", "C4")
RECURSIVE = Model(
    "rigid-recursive",
    "rigid, recursive, closed by a spring",
    "rigid",
    ("track.formulation=recursive", "track.integrator=runge_kutta", *SPRING),  # without implicit steps
    "-.",
    "C2",
)
CLOSED = Model("flexible-closed", "flexible, closed mesh", "flexible", (), "-", "C3")
OPEN = Model("flexible-open", "flexible, open mesh, closed by a spring", "flexible", SPRING, "--", "C1")
CONVENTIONAL = Model("flexible-constrained", "flexible, joints as constraints", "flexible", CONSTRAINED, "-.", "C5")
TRANSFORMED = Model(
    "flexible-cholesky",
    "flexible, Cholesky coordinates",
    "flexible",
    ("track.coordinates=cholesky", "track.integrator=runge_kutta"),  # integrated explicitly
    "--",
    "C6",
)
RIGID_ROD = Model("rigid-rod", "rigid, augmented, closed by a pin; inertia of a rod", "rigid", ROD, ":", "C7")
CLOSED_ROD = Model("flexible-rod", "flexible, closed mesh; inertia of a rod", "flexible", ROD, "-", "C8")
MODELS = (RIGID, RIGID_SPRING, RECURSIVE, CLOSED, OPEN, CONVENTIONAL)  # of the figures
RODS = (RIGID_ROD, CLOSED_ROD)  # for the effects of inertia and elasticity
WHOLE = (*MODELS, *RODS)  # of the whole runs
PRICED = (*MODELS, TRANSFORMED)  # models with compared costs; the last one moves like the closed mesh
REFERENCE = CLOSED  # reference of the others


def named(name: str) -> Model:
    """Return a model by its name."""
    return next(model for model in (*WHOLE, *PRICED) if model.name == name)


def scene(model: Model, *settings: str, of: str = SCENE) -> Scene:
    """Return a scene of the gallery with this model; raises BadInput with the reason why it is impossible."""
    drop = DROP if of == SCENE else ()
    loaded_scene = load(of, model.track, (*drop, *model.settings, *settings))
    assert isinstance(loaded_scene, Scene)
    return loaded_scene
