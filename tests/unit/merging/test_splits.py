from collections import Counter, defaultdict

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stylesim.corpus import SceneInfo
from stylesim.errors import InputError
from stylesim.merging.splits import BY_UNIT, OFFICIAL, WITHIN, plan_splits, split_units
from stylesim.merging.time_blocks import Sight, one_block_each

SHARES = (0.8, 0.1, 0.1)


def info(scene_id, *, unit="u", source="made", scenario="s", start_s=0.0, n_frames=200, official="") -> SceneInfo:
    return SceneInfo(
        scene_id=scene_id, unit_id=unit, source=source, scenario=scenario, source_scenario_id=scene_id,
        official_split=official, split="", start_s=start_s, dt_s=0.1, n_frames=n_frames, n_agents=1, n_steps=n_frames,
        t0_frame=None, part=0, number=0, road="", counts={}, parameters={}, row={},
    )  # fmt: skip


def plan(infos, *, shares=SHARES, seed=1, guard_s=11.0):
    return plan_splits([(0, i) for i in infos], shares=shares, seed=seed, guard_s=guard_s)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.sampled_from("abc"), st.integers(0, 6), st.integers(1, 4)), min_size=1, max_size=20),
    st.integers(0, 5),
)
def test_no_unit_is_on_both_sides_unless_it_is_cut_in_time(made, seed):
    infos, start = [], defaultdict(float)
    for k, (source, unit, scenes) in enumerate(made):
        for j in range(scenes):
            infos.append(info(f"{k}-{j}", unit=f"{source}{unit}", source=source, start_s=start[source, unit]))
            start[source, unit] += 20.0
    result = plan(infos, seed=seed)
    assert result.split == plan(infos, seed=seed).split
    assert set(result.split) | result.guarded == {(0, i.scene_id) for i in infos}
    assert not set(result.split) & result.guarded
    sides, times = defaultdict(set), defaultdict(list)
    for i in infos:
        if (0, i.scene_id) in result.split:
            side = result.split[0, i.scene_id]
            sides[i.unit_id].add(side)
            times[i.unit_id].append((i.start_s, i.start_s + 20.0, side))
    for i in infos:
        if i.source not in result.within:
            assert len(sides[i.unit_id]) == 1
    for spans in times.values():
        for one in spans:
            for other in spans:
                if one[2] != other[2] and one[0] < other[0]:
                    assert other[0] - one[1] >= 11.0
    for source in {i.source for i in infos}:
        units = {i.unit_id for i in infos if i.source == source}
        assert result.rule[source] == (BY_UNIT if len(units) >= 3 else WITHIN)


def test_one_recording_is_cut_into_blocks_with_a_guard():
    result = plan([info(f"{k:02d}", start_s=20.0 * k) for k in range(15)])
    assert Counter(result.split.values()) == {"train": 11, "val": 1, "test": 1}
    assert result.guarded == {(0, "11"), (0, "13")}
    short = plan([info(f"{k:02d}", start_s=20.0 * k) for k in range(3)])
    assert set(short.split.values()) == {"train"}


def test_every_split_gets_a_unit_and_scenarios_are_spread():
    few = split_units({f"u{i}": "s" for i in range(3)}, shares=SHARES, seed=0)
    assert sorted(few.values()) == ["test", "train", "val"]
    many = split_units({f"{s}{i}": s for s in ("x", "y") for i in range(50)}, shares=SHARES, seed=0)
    assert Counter(many.values()) == {"train": 80, "val": 10, "test": 10}
    assert Counter(u[0] for u, side in many.items() if side == "test") == {"x": 5, "y": 5}
    none = split_units({f"u{i}": "s" for i in range(10)}, shares=(0.9, 0.1, 0.0), seed=0)
    assert Counter(none.values()) == {"train": 9, "val": 1}


def test_another_seed_gives_another_split():
    units = {f"u{i}": "s" for i in range(40)}
    assert split_units(units, shares=SHARES, seed=0) != split_units(units, shares=SHARES, seed=1)


def test_official_splits_are_taken_over():
    infos = [info(f"{k}", unit=f"u{k}", official="val" if k % 2 else "train") for k in range(6)]
    result = plan(infos)
    assert result.rule["made"] == OFFICIAL
    assert all(result.split[0, i.scene_id] == i.official_split for i in infos)
    with pytest.raises(InputError, match="both sides"):
        plan([info("a", official="train"), info("b", official="test")])


@pytest.mark.parametrize("shares", [(0.5, 0.1, 0.1), (1.2, -0.1, -0.1), (0.0, 0.5, 0.5)])
def test_shares_that_are_none(shares):
    with pytest.raises(InputError, match="sum to 1"):
        plan([info("a")], shares=shares)


def test_an_agent_keeps_the_block_it_was_seen_longest_in():
    seen = [
        ("train", Sight("s", "u", {"a": 10, "b": 5, "c": 3})),
        ("val", Sight("s", "u", {"a": 20, "b": 5})),
        ("test", Sight("s", "other", {"c": 9})),
    ]
    assert one_block_each(seen) == {("s", "u", "a"): "val", ("s", "u", "b"): "train"}
