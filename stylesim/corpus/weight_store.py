"""Sampling weights: in the corpus where they were known when it was made, or beside it where they came later."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import polars as pl

from stylesim.corpus.files import json_bytes, sha256_of, write_whole
from stylesim.corpus.tables import parquet_bytes, read_parquet
from stylesim.errors import CorpusError

ROW = tuple[str, str]  # (scene_id, agent_id)


def weights_table(weights: Mapping[ROW, float]) -> pl.DataFrame:
    """One row per weighted (scene, agent), sorted."""
    rows = sorted(weights)
    return pl.DataFrame(
        {"scene_id": [s for s, _ in rows], "agent_id": [a for _, a in rows], "weight": [weights[row] for row in rows]},
        schema={"scene_id": pl.String, "agent_id": pl.String, "weight": pl.Float64},
    )


def write_weights(corpus: Path, weights: Mapping[ROW, float], *, by: str, fingerprint: str) -> None:
    """Write `balance.parquet` beside the corpus and, last, the `balance.json` that says it is whole."""
    digest = write_whole(corpus / "balance.parquet", parquet_bytes(weights_table(weights)))
    about = {"by": by, "corpus": fingerprint, "sha256": digest}
    write_whole(corpus / "balance.json", json_bytes(about))


def read_weights(corpus: Path, manifest: Mapping[str, Any]) -> dict[ROW, float]:
    """The weights written beside the corpus, else those made with it, else none. CorpusError if damaged."""
    about = corpus / "balance.json"
    if about.is_file():
        path = corpus / "balance.parquet"
        try:
            expected = json.loads(about.read_bytes())["sha256"]
        except (ValueError, KeyError, TypeError) as error:
            raise CorpusError(f"{about} is damaged: {error}") from error
        table = read_parquet(path)
        if sha256_of(path) != expected:
            raise CorpusError(f"{path} does not match its checksum; balance the corpus again")
    elif "weights.parquet" in manifest["files"]:
        table = read_parquet(corpus / "weights.parquet")
    else:
        return {}
    return {(row[0], row[1]): row[2] for row in table.select("scene_id", "agent_id", "weight").iter_rows()}
