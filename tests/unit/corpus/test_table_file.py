from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stylesim.corpus import label_store, table_file
from stylesim.corpus.label_store import read_labels, write_labels
from stylesim.labels import StyleLabels


def labels(rows: int, *, span: str = "track", seed: int = 0) -> StyleLabels:
    rng = np.random.default_rng(seed)
    return StyleLabels(
        method="made",
        span=span,
        classes=("calm", "rough"),
        feature_names=("speed",),
        scene_id=tuple(f"s{i // 10}" for i in range(rows)),
        agent_id=tuple(f"a{i % 10}" for i in range(rows)),
        start_frame=np.zeros(rows, np.int32),
        stop_frame=np.full(rows, 50, np.int32),
        score=rng.normal(size=(rows, 2)).astype(np.float32),
        style=rng.integers(-1, 2, rows).astype(np.int8),
        margin=rng.random(rows).astype(np.float32),
        aggressiveness=rng.random(rows).astype(np.float32),
        feature=rng.normal(size=(rows, 1)).astype(np.float32),
        missing=np.zeros((rows, 1), bool),
        flags=np.zeros(rows, np.int32),
    )


def cut(whole: StyleLabels, size: int) -> Iterator[StyleLabels]:
    for start in range(0, len(whole), size):
        yield whole.rows(np.arange(start, min(start + size, len(whole))))


def files(corpus: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted((corpus / "labels").iterdir())}


@pytest.mark.parametrize("size", [7, 100, 1000])
def test_the_same_labels_give_the_same_bytes_however_they_come(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int
) -> None:
    whole = labels(1000)
    write_labels(tmp_path / "one", [whole], {}, "f")
    monkeypatch.setattr(table_file, "PART_ROWS", 150)
    monkeypatch.setattr(label_store, "TABLE_ROWS", 40)
    write_labels(tmp_path / "many", cut(whole, size), {}, "f")
    assert files(tmp_path / "many") == files(tmp_path / "one")
    np.testing.assert_array_equal(read_labels(tmp_path / "many", "made", "track").score, whole.score)


def test_chunks_of_two_spans_go_to_two_files(tmp_path: Path) -> None:
    tracks, histories = labels(20), labels(50, span="history", seed=1)
    mixed = [part for pair in zip(cut(tracks, 4), cut(histories, 10), strict=True) for part in pair]
    write_labels(tmp_path, mixed, {}, "f")
    for wanted in (tracks, histories):
        found = read_labels(tmp_path, "made", wanted.span)
        np.testing.assert_array_equal(found.feature, wanted.feature)
        assert found.agent_id == wanted.agent_id


@pytest.mark.parametrize("part_rows", [8, 1000])
def test_a_failure_leaves_the_older_files_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part_rows: int
) -> None:
    monkeypatch.setattr(table_file, "PART_ROWS", part_rows)
    monkeypatch.setattr(label_store, "TABLE_ROWS", 5)
    write_labels(tmp_path, [labels(30)], {}, "f")
    before = files(tmp_path)

    def failing() -> Iterator[StyleLabels]:
        yield from cut(labels(30, seed=2), 10)
        raise RuntimeError("no more")

    with pytest.raises(RuntimeError, match="no more"):
        write_labels(tmp_path, failing(), {}, "f")
    with pytest.raises(ValueError, match="same classes"):
        write_labels(tmp_path, [labels(30), replace(labels(30), classes=("calm", "wild"))], {}, "f")
    assert files(tmp_path) == before
