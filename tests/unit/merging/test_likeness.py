from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stylesim.geometry import rotated
from stylesim.merging.likeness import Likeness, words
from stylesim.scene import Scene
from tests.conftest import make_scene


def lively(scene_id: str, seed: int, n_frames: int = 600) -> Scene:
    """Traffic whose speeds vary by chance, unlike the gentle sines of `make_scene`."""
    scene = make_scene(scene_id, seed=seed, n_agents=8, n_frames=n_frames)
    rng = np.random.default_rng(100 + seed)
    speed = np.clip(10 + np.cumsum(rng.normal(0, 0.25, (8, n_frames)), axis=1), 1, 25)
    position = scene.tracks.position_m.copy()
    position[..., 0] = np.cumsum(speed, axis=1) * 0.1 + 40 * np.arange(8)[:, None]
    position[~scene.tracks.valid] = np.nan
    return replace(scene, tracks=replace(scene.tracks, position_m=position))


def elsewhere(scene: Scene, scene_id: str = "copy") -> Scene:
    """The same driving in another frame, with the rounding of a text file, and other ids."""
    tracks = scene.tracks
    moved = rotated(tracks.position_m.astype(np.float64), 0.7) + np.array([321.0, -40.0])
    ids = tuple(f"v{i}" for i in range(tracks.n_agents))
    return replace(scene, scene_id=scene_id, tracks=replace(tracks, position_m=np.round(moved, 2), agent_id=ids))


def cut(scene: Scene, start: int, stop: int, scene_id: str) -> Scene:
    return replace(scene, scene_id=scene_id, tracks=scene.tracks.frames(start, stop), signals=None)


def test_a_copy_in_another_frame_is_found() -> None:
    seen: Likeness[str] = Likeness()
    for i in range(6):
        assert seen.add(f"s{i}", lively(f"s{i}", i)) == []
    found = seen.add("copy", elsewhere(lively("s3", 3)))
    assert [a.first for a in found] == ["s3"]
    assert found[0].duplicate


def test_a_copy_at_half_the_rate_is_found() -> None:
    seen: Likeness[str] = Likeness()
    seen.add("s", lively("s", 1))
    tracks = lively("s", 1).tracks
    half = replace(
        lively("h", 1),
        signals=None,
        tracks=replace(
            tracks, dt_s=0.2, position_m=tracks.position_m[:, ::2], velocity_mps=tracks.velocity_mps[:, ::2],
            heading_rad=tracks.heading_rad[:, ::2], valid=tracks.valid[:, ::2],
        ),
    )  # fmt: skip
    assert seen.add("h", half)[0].duplicate


def test_overlapping_cuts_are_alike_but_no_duplicates() -> None:
    whole = lively("w", 2)
    seen: Likeness[str] = Likeness()
    seen.add("a", cut(whole, 0, 350, "a"))
    found = seen.add("b", cut(whole, 200, 600, "b"))
    assert [a.first for a in found] == ["a"]
    assert not found[0].duplicate
    assert seen.add("c", cut(whole, 400, 600, "c"))[0].first == "b"


@pytest.mark.parametrize("frames", [20, 80])
def test_short_or_even_driving_says_nothing(frames: int) -> None:
    assert len(words(make_scene(n_frames=frames))) == 0
    even = make_scene(n_frames=300)
    position = even.tracks.position_m.copy()
    position[..., 0] = np.arange(300) * 1.5
    assert len(words(replace(even, tracks=replace(even.tracks, position_m=position)))) == 0
