"""A scene as a moving picture: road users as boxes on their road, coloured by commanded style."""

from __future__ import annotations

import io
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Float64
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from PIL import Image

from stylesim.corpus.files import write_whole
from stylesim.errors import InputError, MissingDependencyError
from stylesim.geometry import box_corners
from stylesim.report.picture import VIEW_M, agent_styles, busiest_frames, draw_road
from stylesim.report.theme import INK, drawing, style_colour
from stylesim.road import Road
from stylesim.scene import Scene
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind

VIDEOS = (".gif", ".mp4")
SECONDS = 20.0  # what is shown where nothing else is asked for; chosen, because a GIF of it has some megabytes
DPI = 110
WIDTH_IN, HEIGHT_IN = 8.0, 4.6
LEAST_SIDE_M = 80.0  # chosen: a view of less has no road around the traffic
LIGHT_COLOUR = {SignalState.GREEN: "#2E9E5B", SignalState.YELLOW: "#E6A700", SignalState.RED: "#C8372D"}
WALKER_COLOUR = "#7A1FA2"  # pedestrians and animals; none of the styles has it


def shown_frames(scene: Scene, start_s: float | None, seconds: float, follow: str = "") -> tuple[int, int]:
    """First frame and one past the last: from `start_s` on, else from the first sight of `follow`, else the busiest.

    InputError outside the scene, and for a road user that it does not have.
    """
    dt = scene.tracks.dt_s
    if follow and follow not in scene.tracks.agent_id:
        raise InputError(f"{scene.scene_id} has no road user {follow!r}")
    if start_s is None and follow:
        start_s = float(scene.tracks.valid[scene.tracks.agent_id.index(follow)].argmax()) * dt
    if start_s is None:
        return busiest_frames(scene, seconds)
    first = round(start_s / dt)
    if not 0 <= first < scene.tracks.n_frames - 1:
        raise InputError(
            f"{scene.scene_id} lasts {scene.tracks.n_frames * dt:g} s; there is nothing from {start_s:g} s on"
        )
    return first, min(scene.tracks.n_frames, first + max(2, round(seconds / dt)))


def check_video(out: Path) -> None:
    """InputError for another ending than .gif and .mp4, MissingDependencyError for an .mp4 without ffmpeg."""
    if out.suffix not in VIDEOS:
        raise InputError(f"{out}: a video ends in {' or '.join(VIDEOS)}")
    if out.suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise MissingDependencyError(f"{out}: an .mp4 needs the program ffmpeg, which was not found; choose a .gif")


def save_video(
    scene: Scene,
    path: str | Path,
    *,
    start_s: float | None = None,
    seconds: float = SECONDS,
    follow: str = "",
) -> Path:
    """The scene as .gif, or as .mp4 where the program ffmpeg is installed; whole or not at all; returns its path.

    With `follow` the view moves with that road user, who is outlined; without, it stands over the middle of the
    traffic. Raises InputError for another ending, a time outside the scene or an unknown road user,
    MissingDependencyError where ffmpeg is needed and not there.
    """
    out = Path(path)
    check_video(out)
    first, stop = shown_frames(scene, start_s, seconds, follow)
    with drawing():
        images = Stage(scene, first, stop, follow).images()
        write_whole(out, _gif(images, scene.tracks.dt_s) if out.suffix == ".gif" else _mp4(images, scene.tracks.dt_s))
    return out


class Stage:
    """One figure that is drawn again for every frame."""

    def __init__(self, scene: Scene, first: int, stop: int, follow: str) -> None:
        self._scene, self._first, self._stop = scene, first, stop
        self._colours = [
            WALKER_COLOUR if kind in (AgentKind.PEDESTRIAN, AgentKind.OTHER) else style_colour(name)
            for kind, name in zip(scene.tracks.kind.tolist(), agent_styles(scene, None), strict=True)
        ]
        self._followed = scene.tracks.agent_id.index(follow) if follow else -1
        self._centre, self._half = self._view()
        self._figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), dpi=DPI)
        self._canvas = FigureCanvasAgg(self._figure)
        self._axes = self._figure.add_axes((0.0, 0.0, 1.0, 0.93))
        self._axes.set_axis_off()
        self._axes.set_aspect("equal")
        if scene.road is not None:
            draw_road(self._axes, scene.road)
        self._lights = LineCollection([], linewidths=3.0, zorder=4)
        self._boxes = PolyCollection([], linewidths=0.5, zorder=5)
        self._axes.add_collection(self._lights)
        self._axes.add_collection(self._boxes)
        self._title = self._figure.text(0.01, 0.955, "", size=9, color=INK)

    def _view(self) -> tuple[Float64[np.ndarray, "time 2"], Float64[np.ndarray, " 2"]]:
        """Middle of the view in each frame, and half of its sides."""
        tracks, frames = self._scene.tracks, slice(self._first, self._stop)
        points = tracks.position_m[:, frames].astype(np.float64)
        side = VIEW_M
        if self._followed >= 0:
            own = points[self._followed]
            seen = np.flatnonzero(np.isfinite(own[:, 0]))
            if not len(seen):
                raise InputError(f"{tracks.agent_id[self._followed]!r} is not there in what is to be shown")
            held = seen[np.clip(np.searchsorted(seen, np.arange(len(own)), side="right") - 1, 0, None)]
            centre = own[held]
        else:
            all_points = points[np.isfinite(points[..., 0])]
            middle = np.median(all_points, axis=0) if len(all_points) else np.zeros(2)
            centre = np.tile(middle, (self._stop - self._first, 1))
            reach = np.abs(all_points - middle).max(axis=0, initial=LEAST_SIDE_M / 2)
            side = float(min(VIEW_M, 2.2 * max(reach[0], reach[1] * WIDTH_IN / HEIGHT_IN)))
        return centre, np.array([side, side * HEIGHT_IN * 0.93 / WIDTH_IN]) / 2

    def images(self) -> Iterator[Image.Image]:
        """The frames as pictures."""
        for frame in range(self._first, self._stop):
            yield self._image(frame)

    def _image(self, frame: int) -> Image.Image:
        tracks = self._scene.tracks
        here = np.flatnonzero(tracks.valid[:, frame])
        size = np.maximum(np.nan_to_num(tracks.size_m[here]), 0.5)
        corners = box_corners(tracks.position_m[here, frame], tracks.heading_rad[here, frame], size)
        self._boxes.set_verts(list(corners))
        self._boxes.set_facecolor([self._colours[agent] for agent in here])
        self._boxes.set_edgecolor([INK if agent == self._followed else "white" for agent in here])
        self._boxes.set_linewidth([1.8 if agent == self._followed else 0.5 for agent in here])
        if self._scene.signals is not None and self._scene.road is not None:
            self._show_lights(self._scene.road, frame)
        centre = self._centre[frame - self._first]
        self._axes.set_xlim(centre[0] - self._half[0], centre[0] + self._half[0])
        self._axes.set_ylim(centre[1] - self._half[1], centre[1] + self._half[1])
        self._title.set_text(f"{self._scene.scene_id}   {frame * tracks.dt_s:.1f} s")
        self._canvas.draw()  # type: ignore[no-untyped-call]
        pixels = bytes(self._canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        return Image.frombuffer("RGBA", self._canvas.get_width_height(), pixels).convert("RGB")

    def _show_lights(self, road: Road, frame: int) -> None:
        assert self._scene.signals is not None
        lanes = {lane.lane_id: lane for lane in road.lanes}
        lines, colours = [], []
        for ids, state in zip(self._scene.signals.lane_id, self._scene.signals.state[:, frame].tolist(), strict=True):
            for lane in (lanes[name] for name in ids if name in lanes):
                if lane.stop_line_m is not None and state in LIGHT_COLOUR:
                    lines.append(lane.stop_line_m)
                    colours.append(LIGHT_COLOUR[SignalState(state)])
        self._lights.set_segments(lines)
        self._lights.set_color(colours)


def _gif(images: Iterator[Image.Image], dt_s: float) -> bytes:
    """All frames with the palette of the first; 0.1 s is a whole number of the hundredths that a GIF counts."""
    first = next(images).quantize(128)
    rest = (image.quantize(palette=first, dither=Image.Dither.NONE) for image in images)
    buffer = io.BytesIO()
    first.save(
        buffer, format="GIF", save_all=True, append_images=rest, duration=round(dt_s * 1000), loop=0, optimize=False
    )
    return buffer.getvalue()


def _mp4(images: Iterator[Image.Image], dt_s: float) -> bytes:
    """Raw frames through ffmpeg, H.264; InputError with its words where it fails."""
    first = next(images)
    width, height = (side - side % 2 for side in first.size)  # H.264 wants even sides
    with tempfile.TemporaryDirectory(prefix="stylesim-") as folder:
        made = Path(folder) / "video.mp4"
        command = ["ffmpeg", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}"]
        command += [
            "-r",
            f"{1.0 / dt_s:g}",
            "-i",
            "-",
            "-an",
            "-c:v",
            "libx264",
            "-pix_fmt",
            "yuv420p",
            "-y",
            str(made),
        ]
        command += ["-y", str(made)]
        frames = b"".join(image.crop((0, 0, width, height)).tobytes() for image in (first, *images))
        done = subprocess.run(command, input=frames, capture_output=True, check=False)
        if done.returncode != 0 or not made.is_file():
            raise InputError(f"ffmpeg could not write the video: {done.stderr.decode(errors='replace').strip()}")
        return made.read_bytes()
