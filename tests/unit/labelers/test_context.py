from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.rows import track_rows
from stylesim.labels import LabelFlag
from stylesim.road import Lane, Road
from stylesim.scene import Scene

from .made import lanes, scene_of, straight


def highway(scene: Scene) -> list[bool]:
    return track_rows(scene, FeatureOptions()).flagged(LabelFlag.HIGHWAY).tolist()


@pytest.mark.parametrize(("limit", "expected"), [(22.2, True), (22.1, False), (33.3, True), (13.9, False)])
def test_by_limit(limit: float, expected: bool) -> None:
    assert highway(scene_of([straight(0, 10)], road=lanes(limit=limit))) == [expected]


def test_a_junction_within_150_m_makes_it_none() -> None:
    road = lanes(limit=33.3)
    crossing = Lane("crossing", np.array([[600.0, -20], [600, 20]]), in_junction=True, speed_limit_mps=13.9)
    scene = scene_of([straight(0, 10), straight(500, 10)], road=Road((*road.lanes, crossing)))
    assert highway(scene) == [True, False]


def test_without_limits_the_traffic_decides() -> None:
    for road in (None, lanes(limit=float("nan"))):
        assert highway(scene_of([straight(0, 20), straight(50, 10), straight(90, 25)], road=road)) == [True] * 3
        assert highway(scene_of([straight(0, 20), straight(50, 10), straight(90, 11)], road=road)) == [False] * 3


def test_a_window_without_anyone_known_is_no_highway() -> None:
    short = straight(0, 30)
    short[3:] = np.nan
    scene = scene_of([short])
    assert highway(replace(scene, road=None)) == [False]
