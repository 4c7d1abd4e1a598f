"""What a merge decides before it writes: who is kept, under which name, on which side, with which noise."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.merging.clock import on_common_clock
from stylesim.merging.kin import Kinship, kept_together, kinship, leaks
from stylesim.merging.noise import NoiseModel, with_noise
from stylesim.merging.noise_fit import recorded_sources, train_noise
from stylesim.merging.splits import SplitPlan, plan_splits
from stylesim.merging.time_blocks import Sight, one_block_each
from stylesim.randomness import stream
from stylesim.scene import Scene
from stylesim.windows import WindowSpec

SceneKey = tuple[int, str]


@dataclass(frozen=True)
class Plan:
    """Everything that is decided before the first scene is written."""

    corpora: tuple[Corpus, ...]
    splits: SplitPlan
    new_id: Mapping[SceneKey, str]  # of the scenes that are kept
    dropped: Mapping[SceneKey, Mapping[str, int]]  # agents taken out of a scene, with their steps
    kin: Kinship
    parted: frozenset[SceneKey]  # scenes whose official split would show a driver on both sides
    noise: tuple[NoiseModel, ...]
    seed: int


def make_plan(
    inputs: tuple[Corpus, ...],
    *,
    split: tuple[float, float, float],
    seed: int,
    noise: str | None,
    spec: WindowSpec,
) -> Plan:
    """One pass over the corpora. InputError where the split would leak."""
    infos = [(number, info) for number, corpus in enumerate(inputs) for info in corpus.info]
    everything = {(number, info.scene_id) for number, info in infos}
    kin = kinship(infos, keyed(inputs, everything))
    infos = [(number, info) for number, info in infos if (number, info.scene_id) not in kin.duplicate_of]
    splits = plan_splits(infos, shares=split, seed=seed, guard_s=spec.history_s + spec.future_s)
    splits, parted = kept_together(splits, infos, kin)
    for leak in leaks(infos, splits.split, splits, kin):
        raise InputError(f"the split would leak: {leak}; merge these corpora apart")
    dropped = _second_blocks(inputs, splits)
    often = Counter(info.scene_id for _, info in infos)
    new_id = {
        (number, info.scene_id): info.scene_id if often[info.scene_id] == 1 else f"c{number}-{info.scene_id}"
        for number, info in infos
        if (number, info.scene_id) in splits.split
        and len(dropped.get((number, info.scene_id), {})) < max(1, info.n_agents)
    }
    models = train_noise(inputs, splits) if noise else ()
    return Plan(inputs, splits, new_id, dropped, kin, parted, models, seed)


def _second_blocks(inputs: Sequence[Corpus], splits: SplitPlan) -> dict[SceneKey, dict[str, int]]:
    """The agents to take out of scenes, because they belong to another block of the same recording."""
    sights = {key: Sight.of(scene) for key, scene in keyed(inputs, splits.split) if scene.source in splits.within}
    home = one_block_each((splits.split[key], sight) for key, sight in sights.items())
    dropped = {}
    for key, sight in sights.items():
        block = splits.split[key]
        strangers = {
            a: n for a, n in sight.frames.items() if home.get((sight.source, sight.unit_id, a), block) != block
        }
        if strangers:
            dropped[key] = strangers
    return dropped


def keyed(inputs: Sequence[Corpus], chosen: Container[SceneKey]) -> Iterator[tuple[SceneKey, Scene]]:
    """The chosen scenes of all corpora, with their keys."""
    for number, corpus in enumerate(inputs):
        for scene in corpus.with_info(i for i in corpus.info if (number, i.scene_id) in chosen):
            yield (number, scene.scene_id), scene


def planned_scenes(
    plan: Plan, *, noise: bool = True, only: Container[SceneKey] | None = None
) -> Iterator[tuple[SceneKey, Scene]]:
    """The scenes as they are written; with `noise=False` as they would be without it."""
    recorded = recorded_sources()
    for key, scene in keyed(plan.corpora, plan.new_id if only is None else only):
        strangers = plan.dropped.get(key, {})
        if strangers:
            keep = np.array([agent not in strangers for agent in scene.tracks.agent_id])
            scene = replace(scene, tracks=scene.tracks.select(keep))
        scene = on_common_clock(scene)
        if noise and plan.noise and scene.source not in recorded:
            number = stream(plan.seed, 0, scene.unit_id, "sensor").integers(len(plan.noise))
            scene = with_noise(scene, plan.noise[int(number)], seed=plan.seed)
        yield key, replace(scene, scene_id=plan.new_id[key], twin_of=_renamed(plan, key[0], scene.twin_of))


def _renamed(plan: Plan, number: int, scene_id: str) -> str:
    """The new id of a scene that another one of the same input is paired with; as it was where that one was dropped."""
    return plan.new_id.get((number, scene_id), scene_id)
