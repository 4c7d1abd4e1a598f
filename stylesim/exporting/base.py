"""What every writer of a foreign format is given, and must be."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from stylesim.errors import InputError
from stylesim.road import Lane
from stylesim.scene import Scene
from stylesim.tracks import TrackFlag

# Beyond it float32, which the simulators that read these files use, is coarser than 1 cm: such scenes are written in
# metres from their own origin.
LARGEST_FLOAT32_M = 65536.0
DEFAULT_WIDTH_M = 3.5  # of a lane whose width is not known; chosen: as where lanes are matched (`labelers.roadindex`)
Styles = Mapping[str, Mapping[str, str | float]]  # agent_id -> column -> value


@runtime_checkable
class Writer(Protocol):
    """One foreign format. Scenes come one by one, at 0.1 s; `counts` says what was written and what could not be."""

    counts: Counter[str]

    def __init__(self, folder: Path) -> None:
        """Write into `folder`, which exists and is empty."""
        ...

    def add(self, scene: Scene, styles: Styles) -> None:
        """Write a scene, or the windows of it that the format holds."""
        ...

    def finish(self) -> None:
        """Write what stands once per data set."""
        ...


@dataclass(frozen=True, eq=False)
class Window:
    """A stretch of a scene; `number` counts those of the scene, `t0` is the last history frame within it."""

    scene: Scene
    number: int
    t0: int


def windows(scene: Scene, *, length: int, t0: int, counts: Counter[str]) -> list[Window]:
    """The stretches of `length` frames of a scene, one about a t0 that its source fixes, else side by side.

    Frames that no stretch holds are counted as `frames_left_over`.
    """
    n = scene.tracks.n_frames
    if scene.t0_frame is not None:
        start = scene.t0_frame - t0
        starts = [start] if start >= 0 and start + length <= n else []
    else:
        starts = list(range(0, n - length + 1, length))
    counts["frames_left_over"] += n - length * len(starts)
    counts["scenes_too_short"] += not starts
    return [Window(cut(scene, start, start + length), k, t0) for k, start in enumerate(starts)]


def cut(scene: Scene, start: int, stop: int) -> Scene:
    """The frames [start, stop) with the road users that are seen in them."""
    tracks = scene.tracks.frames(start, stop)
    signals = None if scene.signals is None else scene.signals.frames(start, stop)
    t0 = None if scene.t0_frame is None else scene.t0_frame - start
    return replace(scene, tracks=tracks.select(np.asarray(tracks.valid.any(axis=1))), signals=signals, t0_frame=t0)


class Names:
    """The names of scenarios in an export, each given once."""

    def __init__(self) -> None:
        self._given: set[str] = set()

    def of(self, window: Window, *, plain: re.Pattern[str] | None = None) -> str:
        """The source's own name of a scenario that it fixed, else the scene's and the window's number.

        Scenes that were cut from one recording share the recording's name, so that is no name of a scenario. What
        `plain` matches becomes "-". InputError where two names would be one.
        """
        scene = window.scene
        own = f"{scene.scene_id}-{window.number:03d}"
        wanted = (scene.source_scenario_id or scene.scene_id, own) if scene.t0_frame is not None else (own,)
        for name in wanted:
            name = name if plain is None else plain.sub("-", name)
            if name not in self._given:
                self._given.add(name)
                return name
        raise InputError(f"two scenarios would be named {name!r}; give the scenes ids that differ in their letters")


def shift_m(scene: Scene) -> Float64[np.ndarray, " 2"]:
    """What to add to a scene's metres: its origin, or nothing where float32 could not hold the sum."""
    origin = scene.tracks.origin_m
    return origin if np.abs(origin).max() < LARGEST_FLOAT32_M else np.zeros(2)


def numbered(names: tuple[str, ...], *, first: int = 1) -> dict[str, int]:
    """A whole number for each name: its own where all of them are different numbers, else counted from `first`."""
    if all(name.isascii() and name.isdigit() and len(name) < 10 for name in names):
        own = {name: int(name) for name in names}
        if len(set(own.values())) == len(own):
            return own
    return {name: first + i for i, name in enumerate(names)}


def boundaries(lane: Lane) -> tuple[Float64[np.ndarray, "left 2"], Float64[np.ndarray, "right 2"]]:
    """The lane's boundaries; where they are not known, half its width beside its centre line."""
    centre = lane.centre_line_m.astype(np.float64)
    step = np.gradient(centre, axis=0)
    step /= np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-9)
    half = (lane.width_m if np.isfinite(lane.width_m) else DEFAULT_WIDTH_M) / 2
    beside = half * np.stack([-step[:, 1], step[:, 0]], axis=1)
    left = centre + beside if lane.left_boundary_m is None else lane.left_boundary_m.astype(np.float64)
    right = centre - beside if lane.right_boundary_m is None else lane.right_boundary_m.astype(np.float64)
    return left, right


def target_of(window: Window) -> int | None:
    """Whom a benchmark with one focal road user asks about: the source's own, else the car that goes farthest.

    It is a motor vehicle that is seen in every frame; None where there is none.
    """
    tracks = window.scene.tracks
    whole = tracks.valid.all(axis=1) & tracks.is_motor
    focal = whole & tracks.flagged(TrackFlag.FOCAL)
    if focal.any():
        return int(np.flatnonzero(focal)[0])
    if not whole.any():
        return None
    gone = np.linalg.norm(np.nan_to_num(tracks.position_m[:, -1] - tracks.position_m[:, window.t0]), axis=1)
    return int(np.argmax(np.where(whole, gone, -1.0)))
