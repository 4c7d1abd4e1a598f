"""A source of one or two recordings, split in contiguous blocks of time.

Train comes first, then val, then test, as time does. Between two blocks of one recording lies a guard gap at
least as long as a history and its future; the scenes in it are dropped. Nobody is in two blocks: a road user
seen in several keeps the one where it was seen longest.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from stylesim.corpus import SceneInfo
from stylesim.scene import Scene

SceneKey = tuple[int, str]
_ORDER = ("train", "val", "test")


def time_blocks(
    scenes: Sequence[tuple[int, SceneInfo]], *, shares: tuple[float, float, float], guard_s: float
) -> tuple[dict[SceneKey, str], set[SceneKey]]:
    """The split of each scene, and the scenes dropped into the guard gaps.

    Sizes are by number of scenes, at least one for each share above 0. Where there are too few scenes for that,
    all go to train.
    """
    ordered = sorted(scenes, key=lambda item: (item[1].unit_id, item[1].start_s, item[0], item[1].scene_id))
    typical_s = sorted(_stop(info) - info.start_s for _, info in ordered)[len(ordered) // 2]
    names = [name for name, share in zip(_ORDER, shares, strict=True) if share > 0]
    per_guard = int(-(-guard_s // max(typical_s, 1e-9)))
    usable = len(ordered) - per_guard * (len(names) - 1)
    sizes = {name: max(1, round(share * usable)) for name, share in zip(_ORDER, shares, strict=True) if share > 0}
    sizes["train"] = usable - sum(n for name, n in sizes.items() if name != "train")
    if sizes["train"] < 1:
        return {(n, info.scene_id): "train" for n, info in ordered}, set()
    return _laid_out(ordered, names, sizes, guard_s)


def _laid_out(
    ordered: Sequence[tuple[int, SceneInfo]], names: Sequence[str], sizes: Mapping[str, int], guard_s: float
) -> tuple[dict[SceneKey, str], set[SceneKey]]:
    split: dict[SceneKey, str] = {}
    guarded: set[SceneKey] = set()
    block, filled = 0, 0
    last_stop: dict[str, float] = {}  # of the finished blocks, per unit
    current_stop: dict[str, float] = {}
    for number, info in ordered:
        if filled >= sizes[names[block]] and block < len(names) - 1:
            block, filled = block + 1, 0
            last_stop, current_stop = {**last_stop, **current_stop}, {}
        if info.start_s < last_stop.get(info.unit_id, float("-inf")) + guard_s - 1e-9:
            guarded.add((number, info.scene_id))
            continue
        split[number, info.scene_id] = names[block]
        filled += 1
        current_stop[info.unit_id] = max(_stop(info), current_stop.get(info.unit_id, float("-inf")))
    return split, guarded


def _stop(info: SceneInfo) -> float:
    return info.start_s + info.n_frames * info.dt_s


@dataclass(frozen=True)
class Sight:
    """Who was seen in a scene, for how many frames."""

    source: str
    unit_id: str
    frames: Mapping[str, int]

    @classmethod
    def of(cls, scene: Scene) -> Sight:
        """What a scene has to say."""
        counts = scene.tracks.valid.sum(axis=1).tolist()
        return cls(scene.source, scene.unit_id, dict(zip(scene.tracks.agent_id, counts, strict=True)))


def one_block_each(seen: Iterable[tuple[str, Sight]]) -> dict[tuple[str, str, str], str]:
    """The split that each (source, unit_id, agent_id) belongs to, for those that were seen in more than one.

    `seen` gives (split, who was seen). The one with more valid frames wins, the earlier of train, val, test at a tie.
    """
    frames: dict[tuple[str, str, str], dict[str, int]] = defaultdict(lambda: defaultdict(int))
    for split, sight in seen:
        for agent, count in sight.frames.items():
            frames[sight.source, sight.unit_id, agent][split] += count
    return {
        who: max(by_split, key=lambda name: (by_split[name], -_ORDER.index(name)))
        for who, by_split in frames.items()
        if len(by_split) > 1
    }
