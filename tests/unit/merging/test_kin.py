"""Duplicates are dropped and said; what shows the same driving stays on one side of a split."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.merging.merge import merge
from stylesim.scene import Scene
from tests.unit.merging.test_likeness import cut, elsewhere, lively


def written(out: Path, scenes: Sequence[Scene], *, source: str = "table") -> Corpus:
    with CorpusWriter(out, source=source, configuration={"scenes": len(scenes)}) as writer:
        for scene in scenes:
            writer.add(replace(scene, source=source))
        return writer.finish()


def by_id(corpus: Corpus) -> dict[str, str]:
    return {info.scene_id: info.split for info in corpus.info}


@pytest.fixture
def many() -> list[Scene]:
    return [lively(f"s{i}", i) for i in range(9)]


def test_a_scene_of_two_data_sets_is_kept_once(tmp_path: Path, many: list[Scene]) -> None:
    copies = [elsewhere(many[4], "copy"), *(lively(f"other{i}", 50 + i) for i in range(4))]
    merged = merge(
        [written(tmp_path / "a", many), written(tmp_path / "b", copies, source="other")], seed=1, out=tmp_path / "m"
    )
    assert set(by_id(merged)) == {*(f"s{i}" for i in range(9)), *(f"other{i}" for i in range(4))}
    counts = merged.manifest["counts"]
    assert counts["near_duplicate_scenes"] == 1
    assert counts["steps_in"] == merged.manifest["n_steps"] + counts["steps_in_near_duplicates"]


def test_overlapping_cuts_of_one_recording_stay_together(tmp_path: Path, many: list[Scene]) -> None:
    whole = lively("whole", 77)
    parts = [cut(whole, 0, 350, "first"), cut(whole, 250, 600, "second")]
    parts = [replace(part, unit_id=part.scene_id) for part in parts]
    for seed in range(4):
        scenes = written(tmp_path / f"a{seed}", [*many, *parts])
        split = by_id(merge([scenes], split=(0.5, 0.25, 0.25), seed=seed, out=tmp_path / f"m{seed}"))
        assert split["first"] == split["second"]
        assert set(split.values()) == {"train", "val", "test"}


def test_twins_are_no_duplicates_and_a_replay_goes_with_its_recording(tmp_path: Path, many: list[Scene]) -> None:
    twin = replace(many[2], scene_id="s2-twin", twin_of="s2", unit_id="s2")
    replays = [replace(lively(f"r{i}", 90 + i), replay_of=f"s{i}", unit_id=f"r{i}", source="sim") for i in range(6)]
    recorded = written(tmp_path / "a", [*many, twin])
    simulated = written(tmp_path / "b", replays, source="sim")
    for seed in range(3):
        merged = merge([recorded, simulated], split=(0.5, 0.25, 0.25), seed=seed, out=tmp_path / f"m{seed}")
        split = by_id(merged)
        assert merged.manifest["counts"]["near_duplicate_scenes"] == 0
        assert split["s2-twin"] == split["s2"]
        assert all(split[f"r{i}"] == split[f"s{i}"] for i in range(6))


def test_official_splits_that_share_driving_lose_the_training_side(tmp_path: Path, many: list[Scene]) -> None:
    whole = lively("whole", 77)
    train = replace(cut(whole, 0, 350, "first"), unit_id="first", official_split="train")
    test = replace(cut(whole, 200, 600, "second"), unit_id="second", official_split="test")
    merged = merge([written(tmp_path / "a", [*many, train, test])], seed=1, out=tmp_path / "m")
    assert "first" not in by_id(merged)
    assert by_id(merged)["second"] == "test"
    counts = merged.manifest["counts"]
    assert counts["scenes_parted_by_official_splits"] == 1
    assert counts["steps_in"] == merged.manifest["n_steps"] + counts["steps_parted_by_official_splits"]
