import math

import pytest

from stylesim.datasets.json_files import json_document
from stylesim.errors import InputError


def test_values_are_those_of_json(tmp_path):
    file = tmp_path / "x.json"
    file.write_text(
        '{"a": [1, 2.5, -3e2, "ä\\u00e4", null, true], "n": NaN, "a big one": 123456789012345678901, "n": 1}'
    )
    read = json_document(file, limit_bytes=1000)
    assert read == {"a": [1, 2.5, -300.0, "ää", None, True], "n": 1, "a big one": 123456789012345678901}
    file.write_text("[NaN, Infinity]")
    assert [math.isnan(value) for value in json_document(file, limit_bytes=1000)] == [True, False]


@pytest.mark.parametrize("text", ["", "{", '{"a": 1}}', "[1,]", "[" * 100_000, '{"a": "\\ud800"}', "{'a': 1}"])
def test_what_is_no_json_is_a_value_error(tmp_path, text):
    file = tmp_path / "x.json"
    file.write_text(text)
    with pytest.raises(ValueError, match=r"."):
        json_document(file, limit_bytes=1_000_000)


def test_size_is_judged_before_anything_is_read(tmp_path):
    file = tmp_path / "x.json"
    file.write_text("[" * 2000)
    with pytest.raises(InputError, match="more than the 1000"):
        json_document(file, limit_bytes=1000)
    with pytest.raises(InputError, match="does not exist"):
        json_document(tmp_path / "none.json", limit_bytes=1000)
