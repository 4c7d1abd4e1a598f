"""Labels beside a corpus: `labels/<method>.<span>.parquet`, its provenance in a `.json` of the same name."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from stylesim.corpus.files import json_bytes, sha256_of, write_whole
from stylesim.corpus.tables import parquet_bytes, read_parquet
from stylesim.errors import CorpusError, InputError
from stylesim.labels import UNDETERMINED, StyleLabels

_PLAIN = ("start_frame", "stop_frame", "margin", "aggressiveness", "flags")


def _stem(corpus: Path, method: str, span: str) -> Path:
    return corpus / "labels" / f"{method}.{span}"


def has_labels(corpus: Path, method: str, span: str) -> bool:
    """True if that label file is there and whole (its provenance is written last)."""
    return _stem(corpus, method, span).with_name(f"{method}.{span}.json").is_file()


def labels_table(labels: StyleLabels, source_scenario: Mapping[str, str]) -> pl.DataFrame:
    """One row per label; scores, features and missing flags as one column each."""
    name_of = [*labels.classes, "undetermined"]
    columns: dict[str, Any] = {
        "scene_id": labels.scene_id,
        "agent_id": labels.agent_id,
        "source_scenario_id": [source_scenario.get(scene, scene) for scene in labels.scene_id],
        "source_track_id": labels.agent_id,
        "style": [name_of[i] for i in labels.style],
        **{name: getattr(labels, name) for name in _PLAIN},
    }
    for i, name in enumerate(labels.classes):
        columns[f"score.{name}"] = labels.score[:, i]
    if labels.score_transposed is not None and labels.style_transposed is not None:
        columns["style_transposed"] = [name_of[i] for i in labels.style_transposed]
        for i, name in enumerate(labels.classes):
            columns[f"score_transposed.{name}"] = labels.score_transposed[:, i]
    for i, name in enumerate(labels.feature_names):
        columns[f"feature.{name}"] = labels.feature[:, i]
        columns[f"missing.{name}"] = labels.missing[:, i]
    texts = ("scene_id", "agent_id", "source_scenario_id", "source_track_id", "style", "style_transposed")
    return pl.DataFrame(columns, schema_overrides={name: pl.String for name in texts if name in columns})


def write_labels(
    corpus: Path, chunks: Iterable[StyleLabels], source_scenario: Mapping[str, str], fingerprint: str
) -> None:
    """Write the chunks as one file; an older one of that method and span is replaced only when the new one is whole."""
    tables: list[pl.DataFrame] = []
    first: StyleLabels | None = None
    for chunk in chunks:
        first = first or chunk
        if (chunk.method, chunk.span, chunk.classes) != (first.method, first.span, first.classes):
            raise ValueError("all chunks must have one method, span and set of classes")
        tables.append(labels_table(chunk, source_scenario))
    if first is None:
        raise CorpusError(f"{corpus}: there is nothing to label")
    stem = _stem(corpus, first.method, first.span)
    parquet = stem.with_name(stem.name + ".parquet")
    digest = write_whole(parquet, parquet_bytes(pl.concat(tables)))
    about = {
        "method": first.method,
        "span": first.span,
        "classes": list(first.classes),
        "features": list(first.feature_names),
        "provenance": dict(first.provenance),
        "corpus": fingerprint,
        "sha256": digest,
    }
    write_whole(stem.with_name(stem.name + ".json"), json_bytes(about))


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
    if sha256_of(path) != about["sha256"]:
        raise CorpusError(f"{path} does not match its checksum; label the corpus again")
    if scene_ids is not None:
        table = table.filter(pl.col("scene_id").is_in(list(scene_ids)))
    return _labels(table, about)


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
