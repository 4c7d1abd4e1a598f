"""A scene seen from above: its road, and its tracks as dots 0.1 s apart, coloured by style."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float32, Float64
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from stylesim.corpus.files import write_whole
from stylesim.errors import InputError
from stylesim.evaluation.slices import value_order
from stylesim.geometry import box_corners
from stylesim.labels import StyleLabels
from stylesim.report.theme import FAINT, INK, SURFACE, drawing, figure_bytes, style_colour
from stylesim.road import Lane, Road
from stylesim.scene import Scene

WINDOW_S = 11.0  # the window of a track label (REFERENCE section 1)
DOT_S = 0.1
VIEW_M = 240.0  # chosen: on a page 22 cm wide a car of 4.5 m is then 4 mm long
MARGIN_M = 12.0  # chosen: some road around the tracks
WIDTH = 8.6


def busiest_frames(scene: Scene, seconds: float = WINDOW_S) -> tuple[int, int]:
    """The stretch of that length with the most road users in sight: (first frame, one past the last)."""
    length = min(scene.tracks.n_frames, max(1, round(seconds / scene.tracks.dt_s)))
    seen = np.concatenate([[0], np.cumsum(scene.tracks.valid.sum(axis=0))])
    start = int(np.argmax(seen[length:] - seen[:-length]))
    return start, start + length


def agent_styles(scene: Scene, labels: StyleLabels | None) -> tuple[str, ...]:
    """The class of each agent: as labelled, without labels as commanded; "unlabelled" or "not commanded" if neither."""
    if labels is None:
        return tuple("not commanded" if driver is None else driver.name for driver in scene.tracks.driver)
    found = {
        agent: labels.class_name(row)
        for row, (scene_id, agent) in enumerate(zip(labels.scene_id, labels.agent_id, strict=True))
        if scene_id == scene.scene_id
    }
    return tuple(found.get(agent, "unlabelled") for agent in scene.tracks.agent_id)


def _ribbon(lane: Lane) -> Float64[np.ndarray, "corner 2"] | None:
    """The lane's surface, from its boundaries or its width; None where neither is known."""
    if lane.left_boundary_m is not None and lane.right_boundary_m is not None:
        return np.concatenate([lane.left_boundary_m, lane.right_boundary_m[::-1]]).astype(np.float64)
    if not np.isfinite(lane.width_m):
        return None
    line = lane.centre_line_m.astype(np.float64)
    tangent = np.gradient(line, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1) * lane.width_m / 2
    return np.concatenate([line + normal, (line - normal)[::-1]])


def draw_road(axes: Axes, road: Road) -> None:
    """Surface, centre lines, crosswalks and stop lines."""
    ribbons = [ribbon for lane in road.lanes if (ribbon := _ribbon(lane)) is not None]
    axes.add_collection(PolyCollection(ribbons, facecolors=SURFACE, edgecolors=FAINT, linewidths=0.5, zorder=1))
    centres = [lane.centre_line_m for lane in road.lanes]
    axes.add_collection(LineCollection(centres, colors="#B8C0C8", linewidths=0.5, linestyles=(0, (6, 5)), zorder=2))
    walks = [walk for walk in road.crosswalks_m if len(walk) >= 3]
    axes.add_collection(PolyCollection(walks, facecolors="#F7E8C8", edgecolors="#D8C79A", linewidths=0.5, zorder=2))
    stops = [lane.stop_line_m for lane in road.lanes if lane.stop_line_m is not None]
    axes.add_collection(LineCollection(stops, colors=INK, linewidths=1.6, zorder=3))


def _draw_tracks(axes: Axes, scene: Scene, styles: tuple[str, ...], shown: Bool[np.ndarray, "agent time"]) -> None:
    tracks = scene.tracks
    for name in sorted(set(styles), key=value_order):
        chosen = np.array([style == name for style in styles])
        dots = tracks.position_m[chosen][shown[chosen]]
        axes.scatter(dots[:, 0], dots[:, 1], s=4.0, color=style_colour(name), linewidths=0, zorder=4)
        agents = np.flatnonzero(chosen & shown.any(axis=1))
        last = shown.shape[1] - 1 - shown[agents, ::-1].argmax(axis=1)
        boxes = box_corners(tracks.position_m[agents, last], tracks.heading_rad[agents, last], tracks.size_m[agents])
        boxes = boxes[np.isfinite(boxes).all(axis=(1, 2))]  # a road user of unknown size has none
        axes.add_collection(
            PolyCollection(list(boxes), facecolors=style_colour(name), edgecolors="white", linewidths=0.4, zorder=5)
        )


def _extent(
    points_m: Float32[np.ndarray, "dot 2"], view_m: float | None
) -> tuple[Float64[np.ndarray, " 2"], Float64[np.ndarray, " 2"]]:
    """Lower left and upper right corner of what is shown."""
    if not len(points_m):
        return np.zeros(2), np.ones(2)
    points = points_m.astype(np.float64)
    low, high = points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
    if view_m is None:
        return low, high
    middle = np.median(points, axis=0)
    return np.maximum(low, middle - view_m / 2), np.minimum(high, middle + view_m / 2)


def scene_figure(
    scene: Scene,
    labels: StyleLabels | None = None,
    *,
    frames: tuple[int, int] | None = None,
    view_m: float | None = VIEW_M,
) -> Figure:
    """The tracks of `frames` (by default the busiest 11 s) on the road, coloured by class.

    Colours are the labelled class, or the commanded one where `labels` is None. Boxes stand where a road user is last
    seen. At most `view_m` metres a side are shown, around the middle of the traffic; None shows everything. n counts
    the road users in view. ValueError where `frames` are not the scene's.
    """
    tracks = scene.tracks
    first, stop = frames or busiest_frames(scene)
    if not 0 <= first < stop <= tracks.n_frames:
        raise ValueError(f"frames [{first}, {stop}) are not within 0..{tracks.n_frames}")
    every = max(1, round(DOT_S / tracks.dt_s))
    shown = np.zeros_like(tracks.valid)
    shown[:, first:stop:every] = tracks.valid[:, first:stop:every]
    styles = agent_styles(scene, labels)
    low, high = _extent(tracks.position_m[shown], view_m)
    shown &= ((tracks.position_m >= low) & (tracks.position_m <= high)).all(axis=2)
    seen = Counter(styles[agent] for agent in np.flatnonzero(shown.any(axis=1)))
    span = high - low
    with drawing():
        height = float(np.clip(WIDTH * 0.92 * span[1] / span[0] + 1.2, 2.0, 8.5))
        figure = Figure(figsize=(WIDTH, height), layout="constrained")
        axes = figure.subplots()
        if scene.road is not None:
            draw_road(axes, scene.road)
        _draw_tracks(axes, scene, styles, shown)
        for name in sorted(seen, key=value_order):
            axes.scatter([], [], s=24, color=style_colour(name), linewidths=0, label=f"{name}, n = {seen[name]}")
        axes.set_aspect("equal")
        axes.set_xlim(float(low[0]), float(high[0]))
        axes.set_ylim(float(low[1]), float(high[1]))
        axes.grid(visible=False)
        axes.set_xlabel("x, east (m)")
        axes.set_ylabel("y, north (m)")
        colour = "commanded class" if labels is None else f"measured {labels.method.upper()} class"
        seconds = (stop - first) * tracks.dt_s
        title = f"{scene.scene_id}\n{seconds:.0f} s of traffic, one dot per {DOT_S:g} s, by {colour}"
        figure.suptitle(title, x=0.01, ha="left", size=10, weight="bold")
        figure.legend(loc="outside lower center", ncols=5)
    return figure


def save_picture(
    scene: Scene, path: str | Path, *, labels: StyleLabels | None = None, frames: tuple[int, int] | None = None
) -> Path:
    """`scene_figure` as a .png or .svg file, whole or not at all; returns its path. InputError for another ending."""
    out = Path(path)
    if out.suffix not in (".png", ".svg"):
        raise InputError(f"{out}: a picture ends in .png or .svg")
    write_whole(out, figure_bytes(scene_figure(scene, labels, frames=frames), raster=out.suffix == ".png"))
    return out
