"""Labels beside a corpus: `labels/<method>.<span>.parquet`, its provenance in a `.json` of the same name."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from stylesim.corpus.files import json_bytes, sha256_of, write_whole
from stylesim.corpus.table_file import TableFile
from stylesim.corpus.tables import read_parquet
from stylesim.errors import CorpusError, InputError
from stylesim.labels import UNDETERMINED, StyleLabels

# Rows of a table in memory. Chosen: some hundred times what it costs to make an empty one.
TABLE_ROWS = 1 << 13
_PLAIN = ("start_frame", "stop_frame", "margin", "aggressiveness", "flags")


def _stem(corpus: Path, method: str, span: str) -> Path:
    return corpus / "labels" / f"{method}.{span}"


def has_labels(corpus: Path, method: str, span: str) -> bool:
    """True if that label file is there and whole (its provenance is written last)."""
    return _stem(corpus, method, span).with_name(f"{method}.{span}.json").is_file()


def labels_table(chunks: Sequence[StyleLabels], source_scenario: Mapping[str, str]) -> pl.DataFrame:
    """One row per label of chunks that are alike; scores, features and missing flags as one column each."""
    first = chunks[0]
    name_of = np.array([*first.classes, "undetermined"], object)  # the index UNDETERMINED is -1: the last

    def joined(name: str) -> np.ndarray:
        return np.concatenate([getattr(chunk, name) for chunk in chunks])

    scenes = [scene for chunk in chunks for scene in chunk.scene_id]
    agents = [agent for chunk in chunks for agent in chunk.agent_id]
    columns: dict[str, Any] = {
        "scene_id": scenes,
        "agent_id": agents,
        "source_scenario_id": [source_scenario.get(scene, scene) for scene in scenes],
        "source_track_id": agents,
        "style": name_of[joined("style")],
        **{name: joined(name) for name in _PLAIN},
    }
    columns |= _columns("score", first.classes, joined("score"))
    if first.score_transposed is not None and first.style_transposed is not None:
        columns["style_transposed"] = name_of[joined("style_transposed")]
        columns |= _columns("score_transposed", first.classes, joined("score_transposed"))
    feature = _columns("feature", first.feature_names, joined("feature"))
    missing = _columns("missing", first.feature_names, joined("missing"))
    for pair in zip(feature.items(), missing.items(), strict=True):
        columns |= dict(pair)
    texts = ("scene_id", "agent_id", "source_scenario_id", "source_track_id", "style", "style_transposed")
    return pl.DataFrame(columns, schema_overrides={name: pl.String for name in texts if name in columns})


def _columns(prefix: str, names: Sequence[str], matrix: np.ndarray) -> dict[str, np.ndarray]:
    return {f"{prefix}.{name}": np.ascontiguousarray(matrix[:, i]) for i, name in enumerate(names)}


def write_labels(
    corpus: Path, chunks: Iterable[StyleLabels], source_scenario: Mapping[str, str], fingerprint: str
) -> None:
    """Write the chunks, one file for each method and span among them, whatever the order they come in.

    Older files are replaced only when all chunks are there; memory does not grow with their number. CorpusError if
    there is no chunk or the disk is full, ValueError if chunks of one file differ in their classes or features.
    """
    files: dict[tuple[str, str], _Growing] = {}
    try:
        for chunk in chunks:
            key = (chunk.method, chunk.span)
            if key not in files:
                stem = _stem(corpus, *key)
                files[key] = _Growing(TableFile(stem.with_name(stem.name + ".parquet")), source_scenario, chunk)
            files[key].add(chunk)
        if not files:
            raise CorpusError(f"{corpus}: there is nothing to label")
        for file in files.values():
            about = _about(file.kind, fingerprint) | {"sha256": file.finish()}
            write_whole(file.file.path.with_suffix(".json"), json_bytes(about))
    finally:
        for file in files.values():
            file.file.discard()


class _Growing:
    """Labels on their way to one file, a table for many small chunks: making one takes longer than filling it."""

    def __init__(self, file: TableFile, source_scenario: Mapping[str, str], first: StyleLabels) -> None:
        self.file, self.source_scenario = file, source_scenario
        self.kind = first.rows(np.zeros(0, np.int64))  # what all have in common
        self._waiting: list[StyleLabels] = []
        self._rows = 0

    def add(self, chunk: StyleLabels) -> None:
        if (chunk.classes, chunk.feature_names) != (self.kind.classes, self.kind.feature_names):
            raise ValueError("all chunks of one method and span must have the same classes and features")
        self._waiting.append(chunk)
        self._rows += len(chunk)
        if self._rows >= TABLE_ROWS:
            self._flush()

    def finish(self) -> str:
        self._flush()
        return self.file.finish()

    def _flush(self) -> None:
        self.file.add(labels_table([self.kind, *self._waiting], self.source_scenario))
        self._waiting, self._rows = [], 0


def _about(labels: StyleLabels, fingerprint: str) -> dict[str, Any]:
    return {
        "method": labels.method,
        "span": labels.span,
        "classes": list(labels.classes),
        "features": list(labels.feature_names),
        "provenance": dict(labels.provenance),
        "corpus": fingerprint,
    }


def read_labels(corpus: Path, method: str, span: str, scene_ids: set[str] | None = None) -> StyleLabels:
    """The labels, optionally of some scenes. InputError if not made yet, CorpusError if damaged."""
    stem = _stem(corpus, method, span)
    try:
        about = json.loads(stem.with_name(stem.name + ".json").read_bytes())
    except FileNotFoundError:
        raise InputError(f"{corpus} has no {method} labels; run `stylesim label {corpus} --method {method}`") from None
    except ValueError as error:
        raise CorpusError(f"{stem}.json is damaged: {error}") from error
    path = stem.with_name(stem.name + ".parquet")
    table = read_parquet(path)
    try:
        if sha256_of(path) != about["sha256"]:
            raise CorpusError(f"{path} does not match its checksum; label the corpus again")
        if scene_ids is not None:
            table = table.filter(pl.col("scene_id").is_in(list(scene_ids)))
        return _labels(table, about)
    except (KeyError, TypeError, ValueError, pl.exceptions.PolarsError) as error:
        raise CorpusError(f"{stem}.json (or the .parquet beside it) is damaged: {error!r}; label again") from error


def export_csv(corpus: Path, method: str, span: str, out: Path) -> int:
    """Write the labels as CSV, whole or not at all; returns the number of rows. InputError if there are none."""
    read_labels(corpus, method, span)  # checks that they are there and undamaged
    table = read_parquet(_stem(corpus, method, span).with_name(f"{method}.{span}.parquet"))
    write_whole(out, table.write_csv().encode())
    return table.height


def _labels(table: pl.DataFrame, about: Mapping[str, Any]) -> StyleLabels:
    classes, features = tuple(about["classes"]), tuple(about["features"])
    index = {name: i for i, name in enumerate(classes)} | {"undetermined": UNDETERMINED}

    def matrix(prefix: str, names: tuple[str, ...]) -> np.ndarray:
        return (
            np.stack([table[f"{prefix}.{n}"].to_numpy() for n in names], axis=1)
            if names
            else np.zeros((table.height, 0))
        )

    labels = StyleLabels(
        method=about["method"],
        span=about["span"],
        classes=classes,
        feature_names=features,
        scene_id=tuple(table["scene_id"].to_list()),
        agent_id=tuple(table["agent_id"].to_list()),
        score=matrix("score", classes).astype(np.float32),
        style=np.array([index[name] for name in table["style"].to_list()], np.int8),
        feature=matrix("feature", features).astype(np.float32),
        missing=matrix("missing", features).astype(bool),
        provenance=about["provenance"],
        **{name: table[name].to_numpy() for name in _PLAIN},
    )
    if "style_transposed" not in table.columns:
        return labels
    other = np.array([index[name] for name in table["style_transposed"].to_list()], np.int8)
    return replace(
        labels, score_transposed=matrix("score_transposed", classes).astype(np.float32), style_transposed=other
    )
