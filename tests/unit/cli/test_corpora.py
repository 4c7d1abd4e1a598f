"""What merge says of noise."""

from __future__ import annotations

import pytest

from stylesim.cli.corpora import noise_still_tells


@pytest.mark.parametrize(
    ("found", "tells"),
    [
        ({"area": 0.99, "low": 0.97, "high": 1.0}, True),
        ({"area": 0.55, "low": 0.49, "high": 0.61}, False),
        ({"area": None, "why": "3 moving drivers are too few"}, False),
    ],
)
def test_noise_that_still_tells_is_said(found: dict[str, object], tells: bool) -> None:
    assert noise_still_tells(found) is tells
