from __future__ import annotations

import json

import numpy as np
import polars as pl
import pytest

from stylesim.corpus import finishing
from stylesim.corpus.finishing import brought_together, records_of
from stylesim.errors import CorpusError


def record(partial, part, ids):
    rows = [
        dict.fromkeys(finishing.SCENE_SCHEMA, None)
        | {"scene_id": i, "part": part, "number": n, "n_agents": 3, "n_steps": 10, "dt_s": 0.1}
        | {"counts": '{"rows_in": 12}'}
        for n, i in enumerate(ids)
    ]  # fmt: skip
    folder = partial / "records"
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps({"scenes": rows, "files": {f"tracks/part-{part:05d}.parquet": f"{part:064x}"}})
    (folder / f"{part:05d}.json").write_text(text)


@pytest.fixture
def partial(tmp_path):
    for part in (0, 1, 99_999, 100_000):
        record(tmp_path, part, [f"s{part}-{n}" for n in range(7)])
    return tmp_path


def test_the_table_is_in_the_order_of_the_parts_and_the_sums_are_right(partial):
    sums = brought_together(partial, records_of(partial))
    table = pl.read_parquet(partial / "scenes.parquet")
    assert table["part"].to_list() == np.repeat([0, 1, 99_999, 100_000], 7).tolist()
    assert (sums.n_scenes, sums.n_agents, sums.n_steps, sums.dt_s, sums.counts) == (
        28,
        84,
        280,
        {0.1},
        {"rows_in": 336},
    )
    assert len(sums.files) == 5


def test_a_table_that_does_not_fit_into_memory_is_the_same(partial, monkeypatch):
    brought_together(partial, records_of(partial))
    whole = (partial / "scenes.parquet").read_bytes()
    monkeypatch.setattr(finishing, "PART_ROWS", 9)
    brought_together(partial, records_of(partial))
    assert (partial / "scenes.parquet").read_bytes() == whole
    assert sorted(path.name for path in partial.iterdir()) == ["records", "scenes.parquet"]


def test_the_same_scene_in_two_parts_is_refused_and_a_collision_of_hashes_is_not(partial, monkeypatch):
    monkeypatch.setattr(finishing, "_hash", lambda scene_id: 1)
    assert brought_together(partial, records_of(partial)).n_scenes == 28
    record(partial, 7, ["new", "s1-3"])
    with pytest.raises(CorpusError, match=r"'s1-3' occurs 1 time"):
        brought_together(partial, records_of(partial))
    monkeypatch.undo()
    with pytest.raises(CorpusError, match=r"'s1-3' occurs 1 time"):
        brought_together(partial, records_of(partial))
