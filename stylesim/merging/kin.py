"""Which scenes must stay on one side of a split: what shows the same driving, a twin, or a replay and its recording."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from stylesim.corpus import SceneInfo
from stylesim.merging.likeness import Likeness
from stylesim.merging.splits import SPLITS, SplitPlan
from stylesim.scene import Scene

SceneKey = tuple[int, str]
Keyed = tuple[int, SceneInfo]


@dataclass(frozen=True)
class Kinship:
    """What was found: scenes that another one makes needless, and pairs that no split may part."""

    duplicate_of: Mapping[SceneKey, SceneKey]
    bound: tuple[tuple[SceneKey, SceneKey], ...]


def kinship(infos: Sequence[Keyed], scenes: Iterable[tuple[SceneKey, Scene]]) -> Kinship:
    """Near-duplicates and bound pairs among all scenes of all inputs.

    Counterfactual twins share a history on purpose: they are bound, and never taken for duplicates of one another.
    """
    by_id: defaultdict[str, list[SceneKey]] = defaultdict(list)
    about: dict[SceneKey, SceneInfo] = {}
    for number, info in infos:
        by_id[info.scene_id].append((number, info.scene_id))
        about[number, info.scene_id] = info
    bound = [
        (key, other)
        for key, info in about.items()
        for name in (info.twin_of, info.replay_of)
        if name
        for other in by_id[name]
        if other[0] == key[0] or name == info.replay_of
    ]
    duplicate_of: dict[SceneKey, SceneKey] = {}
    seen: Likeness[SceneKey] = Likeness()
    for key, scene in scenes:
        for alike in seen.add(key, scene):
            if _family(about[alike.first]) == _family(about[key]):
                continue
            if alike.duplicate and key not in duplicate_of:
                duplicate_of[key] = duplicate_of.get(alike.first, alike.first)
            bound.append((alike.first, key))
    return Kinship(duplicate_of, tuple(bound))


def _family(info: SceneInfo) -> tuple[str, str]:
    """Episodes with a history in common: an episode and its twins, or a scene by itself."""
    return info.source, info.twin_of or info.scene_id


def kept_together(plan: SplitPlan, infos: Sequence[Keyed], kin: Kinship) -> tuple[SplitPlan, frozenset[SceneKey]]:
    """The plan with bound scenes on one side, and the scenes that were taken out because that is not possible.

    A group goes where most of its scenes were, of equals to train. Splits that a source itself made stay as they are:
    where they part two bound scenes, those on the training side are taken out.
    """
    official = {(n, i.scene_id): i.official_split for n, i in infos if i.official_split in SPLITS}
    unit = {(n, i.scene_id): (i.source, i.unit_id) for n, i in infos if i.source not in plan.within}
    split = dict(plan.split)
    parted: set[SceneKey] = set()
    for group in _groups([pair for pair in kin.bound if pair[0] in split and pair[1] in split], unit, split):
        sides = {official[key] for key in group if key in official}
        if len(sides) > 1:
            parted |= {key for key in group if split[key] == "train"}
            continue
        counts = Counter(split[key] for key in group)
        target = sides.pop() if sides else max(SPLITS, key=lambda name: (counts[name], name == "train"))
        split |= dict.fromkeys(group, target)
    left = {key: name for key, name in split.items() if key not in parted}
    return SplitPlan(left, plan.rule, plan.guarded, plan.within), frozenset(parted)


def _groups(
    pairs: Sequence[tuple[SceneKey, SceneKey]],
    unit: Mapping[SceneKey, tuple[str, str]],
    split: Mapping[SceneKey, str],
) -> list[list[SceneKey]]:
    """Connected scenes: by the pairs, and by unit where a unit is split as a whole."""
    root: dict[object, object] = {}

    def find(node: object) -> object:
        root.setdefault(node, node)
        while root[node] != node:
            root[node] = root[root[node]]
            node = root[node]
        return node

    for a, b in pairs:
        root[find(unit.get(a, a))] = find(unit.get(b, b))
    members: defaultdict[object, list[SceneKey]] = defaultdict(list)
    for key in split:
        node = unit.get(key, key)
        if node in root:
            members[find(node)].append(key)
    return [sorted(group) for _, group in sorted(members.items(), key=lambda item: min(item[1]))]


def leaks(infos: Sequence[Keyed], split: Mapping[SceneKey, str], plan: SplitPlan, kin: Kinship) -> list[str]:
    """What lies on both sides of a split although it must not, in words; empty where nothing does."""
    found = []
    sides: defaultdict[tuple[str, str], set[str]] = defaultdict(set)
    for number, info in infos:
        key = (number, info.scene_id)
        if key in split and info.source not in plan.within:
            sides[info.source, info.unit_id].add(split[key])
    found += [
        f"unit {unit} of {source} is in {sorted(names)}" for (source, unit), names in sides.items() if len(names) > 1
    ]
    for a, b in kin.bound:
        if a in split and b in split and split[a] != split[b]:
            found.append(f"{a[1]} ({split[a]}) and {b[1]} ({split[b]}) show the same driving")
    return found
