"""Recordings of one site cut into blocks that share no driver, for `benchmarks.tiny_quality`.

Three ways, because recordings differ in what keeps blocks apart. *Time*, for an intersection that drivers cross in
seconds: with a guard gap between blocks, and everybody only in the block where he is seen longest. *Stream*, for one
minute of a motorway, where most drivers are seen nearly all the time: each carriageway's drivers in their order along
the road, cut into contiguous groups; a block does not see the others, so first and last lack their leader or follower.
*Cuts*, for scenarios cut out of a recording whose times are lost: those that share some driving stay together.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.datasets.formats import dataset_format
from stylesim.scene import Scene
from stylesim.windows import WindowSpec, anchor_frames, target_agents

BLOCKS = 5
SPEC = WindowSpec(history_s=2.0, future_s=6.0, stride_s=1.0)  # UniTraj's lengths; CommonRoad's cuts of 8.1 s hold them
# Tried: cuts of 32 have 200 to 3,600 such words each; kin share 67 or more, others 2 at most.
WORD_STEPS, LEAST_CHANGE_MPS, SHARED, COPY_SHARE = 20, 0.5, 20, 0.9
Blocked = Iterator[tuple[int, Scene]]


@dataclass(frozen=True)
class Recording:
    """A recording: its folder under the data, and how it is cut into (block, scene)."""

    name: str
    folder: str
    cut: Callable[[Path], Blocked]

    def of(self, corpus: Corpus) -> Corpus:
        """The view of its scenes."""
        return corpus.with_info(info for info in corpus.info if info.unit_id.startswith(f"{self.name}/"))


def blocks_corpus(recordings: Iterable[Recording], data: Path, out: Path) -> Corpus:
    """All blocks as one corpus; the unit of a scene is "RECORDING/BLOCK", and recordings are drawn equally often."""
    weight: dict[tuple[str, str], float] = {}
    with CorpusWriter(out, source="recording blocks", configuration={"blocks": BLOCKS}) as writer:
        for recording in recordings:
            windows: Counter[tuple[str, str]] = Counter()
            for block, scene in recording.cut(data / recording.folder):
                writer.add(replace(scene, unit_id=f"{recording.name}/{block}"))
                for t0 in anchor_frames(scene, SPEC):
                    windows.update((scene.scene_id, scene.tracks.agent_id[i]) for i in target_agents(scene, t0, SPEC))
            weight |= dict.fromkeys(windows, 1.0 / windows.total())
        return writer.finish(weights=weight)


def fold(corpus: Corpus, number: int) -> Corpus:
    """The view in which block `number` of each recording is the test split, the next one val, the others train."""
    split = {number: "test", (number + 1) % BLOCKS: "val"}
    blocks = [int(info.unit_id.rsplit("/", 1)[1]) for info in corpus.info]
    pairs = zip(corpus.info, blocks, strict=True)
    return corpus.with_info(replace(info, split=split.get(block, "train")) for info, block in pairs)


def in_time(path: Path) -> Blocked:
    """DLR Urban Traffic, five minutes: a minute each, less half a guard gap at either end."""
    scenes = list(dataset_format("dlr_ut").scenes()(path, scene_s=300.0 / BLOCKS))
    guard = round((SPEC.history_s + SPEC.future_s) / 2 / scenes[0].tracks.dt_s)
    cut = [_frames(scene, guard, scene.tracks.n_frames - guard) for scene in scenes]
    seen: dict[str, Counter[int]] = {}
    for block, scene in enumerate(cut):
        for agent, frames in zip(scene.tracks.agent_id, scene.tracks.valid.sum(axis=1), strict=True):
            seen.setdefault(agent, Counter())[block] += int(frames)
    home = {agent: frames.most_common(1)[0][0] for agent, frames in seen.items()}
    for block, scene in enumerate(cut):
        keep = np.array([home[agent] == block for agent in scene.tracks.agent_id])
        yield block, replace(scene, tracks=scene.tracks.select(keep))


def _frames(scene: Scene, start: int, stop: int) -> Scene:
    signals = scene.signals
    if signals is not None:
        signals = replace(signals, state=signals.state[:, start:stop])
    start_s = scene.start_s + start * scene.tracks.dt_s
    return replace(scene, tracks=scene.tracks.frames(start, stop), signals=signals, start_s=start_s)


def in_stream(path: Path) -> Blocked:
    """DLR Highway Traffic, one minute."""
    (scene,) = dataset_format("dlr_ht").scenes()(path, scene_s=60.0)
    direction, place = _along(scene)
    block = np.zeros(scene.tracks.n_agents, np.int64)
    for side in (direction > 0, direction <= 0):
        order = np.flatnonzero(side)[np.argsort(place[side])]
        block[order] = np.arange(len(order)) * BLOCKS // len(order)
    for number in range(BLOCKS):
        tracks = scene.tracks.select(block == number)
        yield number, replace(scene, scene_id=f"{scene.scene_id}_{number}", tracks=tracks)


def _along(scene: Scene) -> tuple[Float64[np.ndarray, " agent"], Float64[np.ndarray, " agent"]]:
    """Speed and place of everyone along the road, the place moved to one moment with the mean speed of his side."""
    tracks = scene.tracks
    position = tracks.position_m.astype(np.float64)
    axis = np.linalg.svd(tracks.velocity_mps[tracks.valid].astype(np.float64), full_matrices=False)[2][0]
    speed = np.nanmean(tracks.velocity_mps.astype(np.float64) @ axis, axis=1)
    seconds = np.where(tracks.valid, np.arange(tracks.n_frames) * tracks.dt_s, np.nan)
    side = np.where(speed > 0, speed[speed > 0].mean(), speed[speed <= 0].mean())
    return speed, np.nanmean(position @ axis - side[:, None] * seconds, axis=1)


def in_cuts(path: Path) -> Blocked:
    """NGSIM US-101 in CommonRoad's cuts: no copies, kin together, each family to the block with the fewest drivers.

    Two cuts are kin where they share SHARED words: two seconds of one vehicle's speed, digit by digit.
    """
    scenes = [scene for scene in dataset_format("commonroad").scenes()(path) if "US101" in scene.scene_id]
    words = [_words(scene) for scene in scenes]
    family = list(range(len(scenes)))
    copies = set()
    for second in range(len(scenes)):
        for first in range(second):
            shared = len(words[first] & words[second])
            if shared >= SHARED:
                family = [family[first] if name == family[second] else name for name in family]
            if shared > COPY_SHARE * len(words[second]):
                copies.add(second)
    members = {name: [i for i, f in enumerate(family) if f == name and i not in copies] for name in set(family)}
    drivers = {name: sum(int(scenes[i].tracks.is_motor.sum()) for i in found) for name, found in members.items()}
    total = [0] * BLOCKS
    for name in sorted(members, key=lambda f: (-drivers[f], f)):
        block = total.index(min(total))
        total[block] += drivers[name]
        for i in members[name]:
            yield block, scenes[i]


def _words(scene: Scene) -> set[bytes]:
    """Stretches of WORD_STEPS rounded speeds of the motor vehicles in which the speed changes by LEAST_CHANGE_MPS."""
    speed = scene.tracks.speed_mps[scene.tracks.is_motor].round(2)
    if speed.shape[1] < WORD_STEPS:
        return set()
    every = np.lib.stride_tricks.sliding_window_view(speed, WORD_STEPS, axis=1).reshape(-1, WORD_STEPS)
    known = every[np.isfinite(every).all(axis=1)]
    return {word.tobytes() for word in known[np.ptp(known, axis=1) > LEAST_CHANGE_MPS]}


RECORDINGS = (
    Recording("dlr_ut", "dlr_ut", in_time),
    Recording("dlr_ht", "dlr_ht", in_stream),
    Recording("ngsim_us101", "commonroad", in_cuts),
)
