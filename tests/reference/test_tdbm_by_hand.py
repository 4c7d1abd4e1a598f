"""TDBM against what was worked out by hand from its definitions, and the computed facts about its matrix."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from stylesim.labelers.features import FEATURES, window_features
from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.tdbm_matrix import MATRIX, aggressiveness, scores
from stylesim.labels import LabelFlag
from stylesim.scene import Scene
from stylesim.style import STYLE_CLASSES
from stylesim.tracks import AgentKind

from ..unit.labelers.made import LANE_M, clock, lanes, scene_of, straight


def feature(scene: Scene, name: str, agent: int = 0, **options: object) -> float:
    found = window_features(scene, 0, scene.tracks.n_frames, FeatureOptions(**options))
    return float(found.value[agent, 0, FEATURES.index(name)])


def flags(scene: Scene, agent: int = 0) -> LabelFlag:
    return LabelFlag(int(window_features(scene, 0, scene.tracks.n_frames, FeatureOptions()).flags[agent, 0]))


def test_s_center_of_a_constant_offset_is_the_offset() -> None:
    assert feature(scene_of([straight(0, 10, 0.5)], road=lanes()), "s_center") == pytest.approx(0.5, abs=1e-6)


def test_s_center_weighs_the_offset_by_how_fast_it_changes() -> None:
    t = clock()
    path = np.stack([10 * t, 0.05 * t], axis=1)
    wanted = np.mean(0.05 * t * (1 + 0.05))
    assert feature(scene_of([path], road=lanes()), "s_center") == pytest.approx(wanted, abs=1e-5)
    wanted = np.mean(0.05 * t * (3 + 0.05))
    assert feature(scene_of([path], road=lanes()), "s_center", mu_per_s=3.0) == pytest.approx(wanted, abs=1e-5)


def test_s_center_is_zero_two_seconds_around_a_lane_change() -> None:
    t = clock()
    y = 0.5 + LANE_M * np.clip((t - 4) / 2, 0, 1)  # from 0.5 m left of one centre to 0.5 m left of the next
    found = feature(scene_of([np.stack([10 * t, y], axis=1)], road=lanes()), "s_center")
    assert found == pytest.approx(0.5 * (110 - 41) / 110, abs=1e-3)


def test_s_center_is_missing_without_a_road_or_off_it() -> None:
    for scene in (scene_of([straight(0, 10)]), scene_of([straight(0, 10, -9.0)], road=lanes())):
        assert np.isnan(feature(scene, "s_center"))
        assert LabelFlag.NO_LANE in flags(scene)


def test_v_nei_is_the_closing_speed_over_the_distance() -> None:
    scene = scene_of([straight(0, 20), straight(60, 15, LANE_M)], road=lanes())
    wanted = np.mean(5 / np.hypot(60 - 5 * clock(), LANE_M))
    assert feature(scene, "v_nei") == pytest.approx(wanted, rel=1e-4)
    assert feature(scene, "v_nei", agent=1) == 0.0  # the slower one does not close
    assert LabelFlag.NO_NEIGHBOURS not in flags(scene, agent=1)


@pytest.mark.parametrize(
    "other",
    [straight(300, -10, 7.0), straight(30, 0, LANE_M), straight(150, 20)],
    ids=["oncoming", "parked", "beyond 100 m"],
)
def test_who_is_no_neighbour(other: np.ndarray) -> None:
    scene = scene_of([straight(0, 20), other], road=lanes())
    assert feature(scene, "v_nei") == 0.0
    assert LabelFlag.NO_NEIGHBOURS in flags(scene)


def test_a_cyclist_is_a_neighbour_only_on_request() -> None:
    scene = scene_of([straight(0, 10), straight(30, 5, LANE_M)], road=lanes(), kinds=[AgentKind.CAR, AgentKind.BICYCLE])
    assert feature(scene, "v_nei") == 0.0
    assert feature(scene, "v_nei", neighbours="all") > 0.1


def test_s_front_is_the_mean_gap_between_bumpers() -> None:
    scene = scene_of([straight(0, 10), straight(30, 10), straight(10, 10, LANE_M)], road=lanes())
    assert feature(scene, "s_front") == pytest.approx(30 - 4.5, abs=1e-3)
    assert feature(scene_of([straight(0, 10), straight(30, 10)]), "s_front") == pytest.approx(25.5, abs=1e-3)


def test_without_a_leader_s_front_is_the_cap_and_flagged() -> None:
    scene = scene_of([straight(0, 10), straight(120, 10)], road=lanes())
    assert feature(scene, "s_front") == 100.0
    assert LabelFlag.NO_LEADER in flags(scene)


def test_s_front_counts_only_frames_with_a_leader() -> None:
    leader = straight(30, 10)
    leader[60:] = np.nan
    assert feature(scene_of([straight(0, 10), leader], road=lanes()), "s_front") == pytest.approx(25.5, abs=1e-3)


def test_v_avg_and_j_l() -> None:
    t = clock()
    path = np.stack([10 * t + 2 * t**3 / 6, 0 * t], axis=1)  # jerk 2 m/s3
    scene = scene_of([path], road=lanes())
    assert feature(scene, "v_avg") == pytest.approx(np.mean(10 + t**2), rel=1e-4)
    assert feature(scene, "j_l") == pytest.approx(2.0, abs=5e-3)  # float32 positions


def test_kdsc_features() -> None:
    t = clock()
    scene = scene_of([np.stack([10 * t + t**2 / 2, 0 * t], axis=1)], road=lanes())
    assert feature(scene, "mean_speed") == pytest.approx(10 + np.mean(t), rel=1e-4)
    assert feature(scene, "max_speed") == pytest.approx(20.9, rel=1e-4)
    assert feature(scene, "var_speed") == pytest.approx(np.var(t), rel=1e-3)
    assert feature(scene, "mean_acceleration") == pytest.approx(1.0, abs=1e-3)
    assert feature(scene, "max_abs_acceleration") == pytest.approx(1.0, abs=5e-3)
    assert feature(scene, "var_acceleration") == pytest.approx(0.0, abs=1e-5)
    assert feature(scene, "mean_jerk") == pytest.approx(0.0, abs=1e-2)


def cube(n: int = 400_000) -> np.ndarray:
    return np.random.default_rng(0).random((n, 5))


def test_shares_of_the_cube_with_the_printed_matrix() -> None:
    shares = np.bincount(scores(cube()).argmax(axis=1), minlength=6) / 400_000
    np.testing.assert_allclose(shares, [0.19, 0.29, 0.11, 0.19, 0.06, 0.15], atol=0.0075)


def test_the_transposed_product_reaches_three_classes_only() -> None:
    corners = np.array(list(product([0.0, 1.0], repeat=5)))
    reached = set(scores(np.concatenate([cube(), corners]), "transposed").argmax(axis=1))
    assert {STYLE_CLASSES[i] for i in reached} == {"reckless", "threatening", "careful"}


def test_nothing_at_all_is_careful_printed_and_threatening_transposed() -> None:
    zero = np.zeros((1, 5))
    assert STYLE_CLASSES[scores(zero).argmax()] == "careful"
    assert STYLE_CLASSES[scores(zero, "transposed").argmax()] == "threatening"


def test_without_closing_speed_threatening_never_wins() -> None:
    x = cube()
    x[:, 1] = 0
    assert STYLE_CLASSES.index("threatening") not in scores(x).argmax(axis=1)


def test_range_of_the_scores_is_that_of_the_answers() -> None:
    middle = scores(np.full((1, 5), 0.5))
    assert middle.min() > -0.7
    assert middle.max() < 0.4
    low = MATRIX[:, 5] + np.minimum(MATRIX[:, :5], 0).sum(axis=1)
    high = MATRIX[:, 5] + np.maximum(MATRIX[:, :5], 0).sum(axis=1)
    assert low.min() >= -5.5
    assert high.max() <= 4.1


def test_margins_are_small_in_most_of_the_cube() -> None:
    two = np.partition(scores(cube()), -2, axis=1)[:, -2:]
    assert np.mean(two[:, 1] - two[:, 0] < 0.25) == pytest.approx(0.62, abs=0.01)


def test_a_larger_gap_never_raises_a_but_the_class_is_not_monotone() -> None:
    x = cube(20_000)
    wider = x.copy()
    wider[:, 2] = np.minimum(1, x[:, 2] + 0.3)
    before, after = scores(x), scores(wider)
    assert (aggressiveness(after) <= aggressiveness(before) + 1e-12).all()
    # Regression: on the order of the classes some drivers become *more* aggressive by keeping more distance.
    assert (after.argmax(axis=1) < before.argmax(axis=1)).any()


def test_the_transposed_score_uses_the_constant_too() -> None:
    np.testing.assert_allclose(scores(np.eye(5)[:1], "transposed")[0], MATRIX[0] + MATRIX[5])
