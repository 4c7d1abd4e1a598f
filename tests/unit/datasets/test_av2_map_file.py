"""Maps of Argoverse 2 as records: what is not such a map is refused in words."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from stylesim.datasets.av2_map_file import map_file
from tests.formats.av2_files import vector_map


def _written(folder: Path, content: Any) -> Path:
    file = folder / "log_map_archive_0.json"
    file.write_text(content if isinstance(content, str) else json.dumps(content))
    return file


def test_a_map_is_read_as_it_is(tmp_path: Path) -> None:
    given = vector_map()
    read = map_file(_written(tmp_path, given))
    assert list(read.lane_segments) == list(given["lane_segments"])
    for key, lane in given["lane_segments"].items():
        found = read.lane_segments[key]
        assert [(p.x, p.y) for p in found.left_lane_boundary] == [(p["x"], p["y"]) for p in lane["left_lane_boundary"]]
        assert (found.id, found.successors) == (lane["id"], lane["successors"])


@pytest.mark.parametrize(
    "content",
    [
        "",
        "[]",
        "{}",
        '{"lane_segments": [1]}',
        '{"lane_segments": {"1": {"id": 1}}}',
        '{"lane_segments": {}} more',
        "[" * 100_000,
        '{"lane_segments": {"1": NaN}}',
    ],
)
def test_what_is_no_map_is_refused(tmp_path: Path, content: str) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        map_file(_written(tmp_path, content))


def test_a_place_that_is_no_number_is_refused(tmp_path: Path) -> None:
    broken = vector_map()
    next(iter(broken["lane_segments"].values()))["left_lane_boundary"][0]["x"] = "12"
    with pytest.raises(ValueError, match="left_lane_boundary"):
        map_file(_written(tmp_path, broken))
