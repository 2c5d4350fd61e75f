"""Film (.mp4, .gif) or still of a run from the right, the top or a corner; the camera follows the hull."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fmus.vehicles.tables import BadInput
from orchestrator.log.extra import library
from orchestrator.log.reader import Log
from orchestrator.log.time_series import Floats
from orchestrator.results.ground_mesh import GroundMesh
from orchestrator.results.ground_surface import gives_way
from orchestrator.results.output_files import atomic_write, check_name
from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.results.views import colours, projected, solids
from orchestrator.results.views.bodies import EVERY, Bodies, Poses
from orchestrator.results.views.primitives import forces_of_the_ground
from orchestrator.results.views.projected import Camera, Layers
from orchestrator.results.views.ruts import ground_at, inside, ruts_of, untouched

if TYPE_CHECKING:
    from matplotlib.collections import LineCollection

RATES = {".mp4": 25, ".gif": 12.5}  # pictures a second; a GIF has whole hundredths of a second
STILL = ".png"
WIDTHS = {".mp4": 1280, ".gif": 800, STILL: 1280}  # pixels
DPI = 100
MAX_DURATION = 3600.0  # s
TOP, BESIDE, EDGE = 64, 130, 12  # pixels of title, colour scale and border
MARGIN = 0.3  # m round the bodies
ARROW, HEAD = 0.15, 0.009  # longest scale arrow, and heads of arrows, over the width of the picture
QUADS = 6000  # of a terrain under the whole way
FAR = 1.1  # brightness of the ground under the far track, where it is higher
OPACITY = 0.85  # of the hull: what it hides shines through
SEEN_FROM = {"right": "from the right", "top": "from the top", "corner": "from a corner ahead"}


def write(path: Path, output: Path, viewpoint: str = "right", colour: str | None = None, window: Window = EVER) -> int:
    """Write a film of a window of a log, s, in real time; return its number of pictures.

    Raises BadInput if the log cannot be drawn or the file cannot be written, and NotInstalled.
    """
    suffix = output.suffix.lower()
    check_name(output, tuple(RATES))
    _check_viewpoint(viewpoint)
    ffmpeg = library("imageio_ffmpeg", "video") if suffix == ".mp4" else None
    with Log(path) as log:
        log.require_window(*window)
        bodies = Bodies(RunData(log), RATES[suffix], colour, window)
        if bodies.t[-1] - bodies.t[0] > MAX_DURATION:
            raise BadInput(
                f"{path} is {bodies.t[-1] - bodies.t[0]:.9g} s long: a film is of {MAX_DURATION:g} s at most"
            )
        picture = FilmPicture(bodies, viewpoint, WIDTHS[suffix])
        with atomic_write(output) as temporary:
            if ffmpeg:
                return _mp4(ffmpeg, temporary, picture)
            return _gif(temporary, picture)


def still(path: Path, output: Path, viewpoint: str, colour: str | None = None, latest: float | None = None) -> None:
    """Write a picture, .png, of the last instant up to ``at``, s; raises as ``write``."""
    from PIL import Image

    check_name(output, (STILL,))
    _check_viewpoint(viewpoint)
    with Log(path) as log:
        bodies = Bodies(RunData(log), EVERY, colour, (-np.inf, np.inf if latest is None else latest))
        bodies.select_instants(bodies.t[-1:])
        (drawn,) = FilmPicture(bodies, viewpoint, WIDTHS[STILL]).frames(1.0)
        with atomic_write(output) as temporary:
            Image.fromarray(drawn).save(temporary)


def _check_viewpoint(viewpoint: str) -> None:
    if viewpoint not in projected.VIEWPOINTS:
        raise BadInput(f"--seen-from {viewpoint}: one looks from one of {', '.join(projected.VIEWPOINTS)}")


def _mp4(ffmpeg: Any, output: Path, picture: FilmPicture) -> int:
    writer = ffmpeg.write_frames(
        str(output), picture.size, fps=RATES[".mp4"], pix_fmt_in="rgba", macro_block_size=2, codec="libx264",
        output_params=["-crf", "20", "-movflags", "+faststart"], ffmpeg_log_level="error",
    )  # fmt: skip
    count = 0
    try:
        writer.send(None)
        for drawn in picture.frames(RATES[".mp4"]):
            writer.send(drawn)
            count += 1
    finally:
        writer.close()
    return count


def _gif(output: Path, picture: FilmPicture) -> int:
    from PIL import Image

    images: list[Any] = []
    for drawn in picture.frames(RATES[".gif"]):
        image = Image.fromarray(drawn).convert("RGB")
        if not images:  # one palette for all pictures, because changing palettes flicker
            palette = _palette(np.asarray(image))
        images.append(image.quantize(palette=palette, dither=Image.Dither.NONE))
    images[0].save(
        output, format="GIF", save_all=True, append_images=images[1:], duration=round(1e3 / RATES[".gif"]), loop=0
    )
    return len(images)


def _palette(first: NDArray[np.uint8]) -> Any:
    """256 colours: of the first picture, of the colour scale with all lighting, and of forces."""
    from PIL import Image

    links = colours.map_colours(np.linspace(0.0, 1.0, 40), (40,), (0.0, 1.0))
    swatches = np.concatenate([*(links * light for light in (0.65, 0.82, 1.0)), np.tile(colours.FORCE, (8, 1))])
    columns = np.resize(swatches.astype(np.uint8), (len(first), len(swatches), 3))
    wide = np.concatenate([first, np.repeat(columns, 3, axis=1)], axis=1)
    return Image.fromarray(np.ascontiguousarray(wide)).quantize(256)


class FilmPicture:
    """Pictures of one size; constant parts are drawn once."""

    def __init__(self, bodies: Bodies, viewpoint: str, width: int) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        self._bodies, self._viewpoint = bodies, viewpoint
        self._scale = bodies.colour_range()
        # the upper run would hide the coloured lower run
        self._lower = viewpoint == "top" and bodies.colour in ("ground", "sliding")
        self._speed = bodies.speeds()
        low, high = self._extent()
        across = width - EDGE - (BESIDE if bodies.colour else EDGE)
        metre = across / (high[0] - low[0])  # pixels
        height = int(np.ceil(metre * (high[1] - low[1]))) + TOP + EDGE
        height += height % 2
        self.size = (width, height)
        figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
        self._canvas = FigureCanvasAgg(figure)
        self._pane = figure.add_axes((EDGE / width, EDGE / height, across / width, (height - TOP - EDGE) / height))
        self._pane.set_xlim(low[0], high[0])
        self._pane.set_ylim(low[1], low[1] + (height - TOP - EDGE) / metre)
        self._pane.set_xticks([])
        self._pane.set_yticks([])
        self._half = 0.5 * float(np.hypot(*(high - low))) + MARGIN
        figure.text(EDGE / width, 1 - 8 / height, bodies.title, va="top", fontsize=10, parse_math=False, wrap=True)
        if bodies.colour:
            self._scale_of_colours(figure)
        self._clock = figure.text(EDGE / width, 1 - 36 / height, "", va="top", fontsize=10, parse_math=False)
        self._arrows = ",  red: forces of the ground" if solids.has_forces(bodies) else ""
        self._without = ",  without the upper run of links" if self._lower else ""
        self._add_artists()
        self._canvas.draw()
        self._empty = self._canvas.copy_from_bbox(figure.bbox)

    def _add_artists(self) -> None:
        """Add the artists that change from picture to picture, the nearest last."""
        from matplotlib.collections import LineCollection, PolyCollection

        def lines(colour: Any, width: float) -> LineCollection:
            return LineCollection([], colors=colour, linewidths=width)

        self._earth = PolyCollection([], facecolors=[], edgecolors="0.5", linewidths=0.4)
        self._metres = lines("0.45", 0.7)
        self._untouched = LineCollection([], **colours.UNTOUCHED)
        self._hidden, self._solid = (
            PolyCollection([], facecolors=[], edgecolors="0.2", linewidths=0.3) for _ in range(2)
        )
        edge = colours.to_unit_range(colours.HULL_EDGE)
        self._hull = PolyCollection([], facecolors=[], edgecolors=edge, linewidths=1.0)
        self._forces = lines(colours.to_unit_range(colours.FORCE), 1.2)
        self._artists = [
            self._earth, self._untouched, self._metres, self._hidden, self._hull, self._solid, self._forces
        ]  # fmt: skip
        if self._arrows:
            self._artists.append(self._add_scale_of_forces(lines(colours.to_unit_range(colours.FORCE), 1.6)))
        for collection in self._artists:
            self._pane.add_collection(collection, autolim=False)
        self._numbers = [self._pane.text(0, 0, "", fontsize=7, ha="center", va="top", color="0.3") for _ in range(24)]
        for artist in (*self._artists, *self._numbers, self._clock):
            artist.set_animated(True)

    def _add_scale_of_forces(self, arrow: LineCollection) -> LineCollection:
        """Place the arrow that shows the scale of forces in the upper right corner, with its force under it."""
        (left, right), top = self._pane.get_xlim(), self._pane.get_ylim()[1]
        scale = solids.scale_arrow(ARROW * (right - left), solids.force_of_a_metre(self._bodies))
        metre = (right - left) / self._pane.get_window_extent().width
        end = np.array([right - 14 * metre, top - 14 * metre])
        drawn = np.stack([end - [scale.length, 0.0], end])[None]
        arrow.set_segments([*solids.with_heads(drawn, HEAD * (right - left))])
        x, y = end - [0.5 * scale.length, 6 * metre]
        self._scale_of_forces = self._pane.text(x, y, scale.label, fontsize=9, ha="center", va="top")
        self._scale_of_forces.set_animated(True)
        return arrow

    def frames(self, rate: float) -> Iterator[NDArray[np.uint8]]:
        """Yield pictures (height, width, 4) in real time, up to the last instant; each stays until the next."""
        begin, count = float(self._bodies.t[0]), 0
        last_frame: NDArray[np.uint8] | None = None
        for poses in self._bodies.blocks():
            for k, t in enumerate(poses.t):
                number = round((float(t) - begin) * rate)
                while last_frame is not None and count < number:
                    yield last_frame
                    count += 1
                last_frame = self._draw(poses, k)
        if last_frame is not None:
            yield last_frame

    def _draw(self, poses: Poses, k: int) -> NDArray[np.uint8]:
        bodies, camera, scale = self._bodies, self._camera(poses, k), self._scale
        self._ground(camera, poses, k)
        if self._viewpoint == "top":  # the hull would cover the tracks
            hull = projected.hull_faces(camera, bodies, poses, k)
            links = projected.polygons(camera, bodies, poses, k, scale, self._lower)
            shown = Layers(projected.NOTHING, hull, links)
        else:
            shown = projected.layers(camera, bodies, poses, k, scale)
        for solid, shapes in ((self._hidden, shown.hidden), (self._solid, shown.visible)):
            solid.set_verts(shapes.outlines)
            solid.set_facecolor(list(map(tuple, shapes.colours)))
        self._hull.set_verts(shown.hull.outlines)
        self._hull.set_facecolor([(*colour, OPACITY) for colour in shown.hull.colours])
        head = HEAD * float(np.ptp(self._pane.get_xlim()))
        self._forces.set_segments(list(solids.with_heads(self._arrows_of(camera, poses, k), head)))
        t = float(poses.t[k])
        self._clock.set_text(
            f"{SEEN_FROM[self._viewpoint]},  t = {t:.2f} s{self._motion(t)}{self._arrows}{self._without}"
        )
        self._canvas.restore_region(self._empty)
        renderer = self._canvas.get_renderer()
        texts = [*self._numbers, *([self._scale_of_forces] if self._arrows else [])]
        for artist in (*self._artists, *(text for text in texts if text.get_text())):
            artist.draw(renderer)
        self._clock.draw(renderer)
        return np.array(self._canvas.buffer_rgba())

    def _camera(self, poses: Poses, k: int) -> Camera:
        """Camera above the hull, as high over the ground as at the first instant; from the right it turns with it."""
        start = self._bodies.scene["start"]["heading"]
        ahead = projected.heading(poses, k, start) if self._viewpoint == "right" else start
        centre = self._middle.copy()
        if poses.hull:
            centre[:2] = poses.hull.position[k, :2]
        centre[2] += self._bodies.height_of_ground(poses, k) - self._level
        return projected.make_camera(self._viewpoint, ahead, centre)

    def _extent(self) -> tuple[Floats, Floats]:
        """Return the lower left and upper right corner of the visible area, m from its middle."""
        poses = next(self._bodies.blocks(1))
        first, self._level = poses.positions(), self._bodies.height_of_ground(poses, 0)
        self._middle = 0.5 * (first.min(axis=0) + first.max(axis=0))
        low, high = np.full(2, np.inf), np.full(2, -np.inf)
        for poses in self._bodies.blocks():
            for k in range(len(poses.t)):
                camera = self._camera(poses, k)
                outlines = projected.hull_faces(camera, self._bodies, poses, k).outlines
                outlines += [camera.project(links.centres[k]) for links in poses.links.values()]
                for wheel in self._bodies.wheels:
                    middle = camera.project(poses.wheels[wheel.name].position[k])
                    outlines.append(np.stack([middle - wheel.radius, middle + wheel.radius]))
                points = np.concatenate(outlines)
                low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
        half_width = max([0.0, *(float(track.half.max()) for track in self._bodies.tracks)])
        low, high = low - MARGIN - half_width, high + MARGIN + half_width
        size = high - low  # limits the aspect ratio
        padding = np.maximum(np.array([size[1], 0.25 * size[0]]) - size, 0.0)
        return low - 0.5 * padding, high + 0.5 * padding

    def _ground(self, camera: Camera, poses: Poses, k: int) -> None:
        profile = ground_at(self._bodies, float(poses.t[k])) if self._viewpoint == "right" else self._bodies.ground
        if profile is None:
            return
        earth = np.array(colours.to_unit_range(colours.EARTH))
        if self._viewpoint == "right":
            bottom = [[self._half, -2 * self._half], [-self._half, -2 * self._half]]
            planes = self._planes(camera, poses, k) if profile.terrain else [0.0]
            sections = [projected.section(camera, profile, -self._half, self._half, nearer) for nearer in planes]
            self._earth.set_verts([np.concatenate([line, bottom]) for line, _ in sections])
            self._earth.set_facecolor([*([tuple(np.minimum(FAR * earth, 1.0))] * (len(sections) - 1)), tuple(earth)])
            _, metres = sections[-1]
            self._metres.set_segments(list(np.stack([metres[:, :2], metres[:, :2] - [0.0, 0.08]], axis=1)))
            self._number_metres(metres)
            if before := untouched(self._bodies):
                line, _ = projected.section(camera, before, -self._half, self._half, planes[-1])
                self._untouched.set_segments([line])
            return
        if profile.terrain:
            quads, brightness, lines = projected.patch(camera, self._mesh.around(camera.centre[:2], 2.0 * self._half))
            self._earth.set_edgecolor("face")  # lines of quadrangles would hide those of metres
        else:
            quads, brightness, lines = projected.plane(camera, profile, 2.0 * self._half)
        shades = np.clip(brightness[:, None] * earth, 0.0, 1.0)
        if gives_way(self._bodies.scene):
            pressed = camera.project(ruts_of(self._bodies.run).tiles(float(poses.t[k]))[0])
            quads = np.concatenate([quads, pressed])
            shades = np.concatenate([shades, np.tile(colours.to_unit_range(colours.RUT), (len(pressed), 1))])
            self._earth.set_edgecolor("face")
        self._earth.set_verts(list(quads))
        self._earth.set_facecolor(list(map(tuple, shades)))
        self._metres.set_segments(list(lines))

    @cached_property
    def _mesh(self) -> GroundMesh:
        """Mesh of a terrain under the whole way."""
        assert self._bodies.ground
        return solids.Reach().with_bodies(self._bodies).mesh(self._bodies.ground, 2.0 * self._half, QUADS)

    def _planes(self, camera: Camera, poses: Poses, k: int) -> list[float]:
        """Distances of the near faces of the tracks from the middle, towards the viewer, m, the nearest last."""
        tracks = self._bodies.tracks
        middles = [poses.links[track.name].centres[k].mean(axis=0) - camera.centre for track in tracks]
        halves = [track.half[1] for track in tracks]
        edge = inside(self._bodies)
        near = [float(middle @ camera.toward + half - edge) for middle, half in zip(middles, halves, strict=True)]
        return sorted(near) or [0.0]

    def _number_metres(self, metres: Floats) -> None:
        """Write the distance, m, under metre marks (m, 3), or under every fifth if there are many."""
        left, right = self._pane.get_xlim()
        inside = metres[(metres[:, 0] > left + 0.2) & (metres[:, 0] < right - 0.2)]
        every = 1 if len(inside) < 12 else 5
        labelled = inside[np.round(inside[:, 2]) % every == 0][: len(self._numbers)]
        for text in self._numbers:
            text.set_text("")
        for text, (x, y, metre) in zip(self._numbers, labelled, strict=False):
            text.set_position((x, y - 0.1))
            text.set_text(f"{metre:z.0f} m")

    def _arrows_of(self, camera: Camera, poses: Poses, k: int) -> Floats:
        """Return the arrows of ground forces (n, 2, 2), m in the picture."""
        forces = (
            forces_of_the_ground(self._bodies, track, poses.links[track.name], slice(k, k + 1))
            for track in self._bodies.tracks
        )
        return np.concatenate([np.empty((0, 2, 2)), *(camera.project(arrows.pairs) for arrows in forces if arrows)])

    def _motion(self, t: float) -> str:
        if self._speed is None:
            return ""
        return f",  {np.interp(t, self._bodies.t, self._speed):z.2f} m/s"

    def _scale_of_colours(self, figure: Any) -> None:
        width = self.size[0]
        pane = figure.add_axes(((width - BESIDE + 20) / width, 0.12, 18 / width, 0.68))
        bar = figure.colorbar(colours.colour_bar(self._scale), cax=pane, extend="max")
        bar.set_label(self._bodies.label, fontsize=8)
        bar.ax.tick_params(labelsize=8)
