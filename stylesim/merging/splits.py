"""Which scene goes into which split (REFERENCE, section 8).

The unit of splitting is the continuous recording at one site, or the simulated episode: all scenes of a unit go
to one side. A split that the source itself made is taken over. A source with fewer than three units is split in
contiguous blocks of time with a guard gap between them (`time_blocks`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from stylesim.corpus import SceneInfo
from stylesim.errors import InputError
from stylesim.merging.time_blocks import time_blocks
from stylesim.randomness import stream

SPLITS = ("train", "val", "test")
MIN_UNITS = 3  # REFERENCE, section 8
BY_UNIT, OFFICIAL, WITHIN = "by unit", "official", "within-recording, in time blocks"

SceneKey = tuple[int, str]  # (number of the input corpus, scene_id there)


@dataclass(frozen=True)
class SplitPlan:
    """The split of every scene that is kept; `rule` per source; the scenes that fell into a guard gap."""

    split: dict[SceneKey, str]
    rule: dict[str, str]
    guarded: frozenset[SceneKey] = frozenset()
    within: frozenset[str] = field(default_factory=frozenset)  # sources split within a recording


def plan_splits(
    infos: Sequence[tuple[int, SceneInfo]], *, shares: tuple[float, float, float], seed: int, guard_s: float
) -> SplitPlan:
    """The plan for all scenes of all inputs, given with the number of their corpus.

    `shares` of train, val and test. Equal inputs and seed give an equal plan. InputError where the shares are none.
    """
    check_shares(shares)
    split: dict[SceneKey, str] = {}
    rule: dict[str, str] = {}
    guarded: set[SceneKey] = set()
    within: set[str] = set()
    for source in sorted({info.source for _, info in infos}):
        mine = [(number, info) for number, info in infos if info.source == source]
        official = _official_units(mine)
        free = [(n, info) for n, info in mine if info.unit_id not in official]
        split |= {(n, i.scene_id): official[i.unit_id] for n, i in mine if i.unit_id in official}
        rules = [OFFICIAL] if official else []
        if free and len({info.unit_id for _, info in free}) >= MIN_UNITS:
            by_unit = split_units({info.unit_id: info.scenario for _, info in free}, shares=shares, seed=seed)
            split |= {(n, i.scene_id): by_unit[i.unit_id] for n, i in free}
            rules.append(BY_UNIT)
        elif free:
            blocks, dropped = time_blocks(free, shares=shares, guard_s=guard_s)
            split |= blocks
            guarded |= dropped
            within.add(source)
            rules.append(WITHIN)
        rule[source] = ", ".join(rules)
    return SplitPlan(split, rule, frozenset(guarded), frozenset(within))


def check_shares(shares: tuple[float, float, float]) -> None:
    """InputError unless the three shares are between 0 and 1, sum to 1, and leave something to train on."""
    if any(not 0 <= s <= 1 for s in shares) or abs(sum(shares) - 1) > 1e-6 or shares[0] <= 0:
        raise InputError(
            f"split {shares} must be three shares of train, val and test that sum to 1, with train above 0"
        )


def _official_units(mine: Sequence[tuple[int, SceneInfo]]) -> dict[str, str]:
    """The units that their source put into a split; InputError if it put one unit into two."""
    found: dict[str, str] = {}
    for _, info in mine:
        if info.official_split not in SPLITS:
            continue
        if found.setdefault(info.unit_id, info.official_split) != info.official_split:
            raise InputError(
                f"{info.source}: unit {info.unit_id} is in the official splits {found[info.unit_id]} and "
                f"{info.official_split}; one recording cannot be on both sides"
            )
    return found


def split_units(scenario_of: dict[str, str], *, shares: tuple[float, float, float], seed: int) -> dict[str, str]:
    """Every unit's split: drawn with the seed, each scenario spread over the splits as evenly as its units allow.

    Each split with a share above 0 gets at least one unit; val and test round to the nearest, train has the rest.
    """
    draw = {unit: stream(seed, 0, unit, "split").random() for unit in scenario_of}
    place: dict[str, tuple[float, str, str]] = {}
    for scenario in sorted(set(scenario_of.values())):
        units = sorted((u for u in scenario_of if scenario_of[u] == scenario), key=lambda u: (draw[u], u))
        for rank, unit in enumerate(units):
            place[unit] = ((rank + 0.5) / len(units), scenario, unit)
    order = sorted(place, key=lambda unit: place[unit])
    n_val, n_test = (max(1, round(share * len(order))) if share > 0 else 0 for share in shares[1:])
    # Train takes the middle of the order, where scenarios of few units come to lie.
    result = dict.fromkeys(order, "train")
    result |= dict.fromkeys(order[:n_test], "test")
    result |= dict.fromkeys(order[len(order) - n_val :] if n_val else [], "val")
    return result
