from __future__ import annotations

import json

import numpy as np
import pytest

from stylesim.errors import InputError
from stylesim.forecasting.conditioner import fit_conditioner
from stylesim.forecasting.conditioning import LEAST_IN_CELL, NULL, StyleCells
from stylesim.forecasting.measured import CLUSTER_FEATURES, Measured
from stylesim.forecasting.samples import Window
from stylesim.labels import LabelFlag, StyleLabels
from stylesim.scene import Scene
from tests.conftest import make_scene

from .made import SPEC, SpeedJudges


def labels(span: str = "history", style: int = 1, names: tuple[str, ...] = CLUSTER_FEATURES) -> StyleLabels:
    return StyleLabels(
        method="kdsc",
        span=span,
        classes=("aggressive", "normal"),
        feature_names=names,
        scene_id=("s",),
        agent_id=("a",),
        start_frame=np.array([0]),
        stop_frame=np.array([20]),
        score=np.zeros((1, 2)),
        style=np.array([style]),
        margin=np.zeros(1),
        aggressiveness=np.zeros(1),
        feature=np.arange(len(names), dtype=np.float32)[None],
        missing=np.arange(len(names))[None] == len(names) - 1,
        flags=np.array([LabelFlag.HIGHWAY]),
    )


def measured(per_cell: dict[tuple[int, int], int]) -> Measured:
    """So many drivers of each (style, context), features around three places per style."""
    rng = np.random.default_rng(0)
    style = np.concatenate([np.full(n, z) for (z, _), n in per_cell.items()])
    highway = np.concatenate([np.full(n, c) for (_, c), n in per_cell.items()])
    feature = np.expm1(
        np.array([0.0, 2.0, 4.0])[np.arange(len(style)) % 3, None] + rng.uniform(0, 0.1, (len(style), 4))
    )
    return Measured(style.astype(np.int64), feature, highway.astype(np.int64))


def fitted(drivers: Measured) -> StyleCells:
    return StyleCells.fit(drivers, ("a", "b"), clusters=3, contexts=2, rng=np.random.default_rng(0))


def test_class_features_and_context_come_from_history_labels() -> None:
    found = Measured.of(labels(), labels())
    assert found.style.tolist() == [1]
    assert found.highway.tolist() == [1]
    np.testing.assert_array_equal(found.feature, [[0, 1, 2, np.nan]])


def test_labels_of_whole_tracks_cannot_condition() -> None:
    with pytest.raises(InputError, match="only history can"):
        Measured.of(labels(span="track"), labels())
    with pytest.raises(InputError, match="only history can"):
        Measured.of(labels(), labels(span="track"))


def test_labels_without_the_kdsc_features_are_refused_by_name() -> None:
    with pytest.raises(InputError, match="gamma"):
        Measured.of(labels(), labels(names=CLUSTER_FEATURES[:3]))


def test_drivers_fall_into_three_clusters_of_their_style() -> None:
    drivers = measured({(0, 0): 90, (1, 0): 90})
    cell = fitted(drivers).assign(drivers)
    assert (cell[:, 0] == drivers.style).all()
    assert (cell[:, 2] == 0).all()
    for z in (0, 1):
        groups = {tuple(cell[(drivers.style == z) & (np.arange(180) % 3 == g), 1]) for g in range(3)}
        assert all(len(set(group)) == 1 for group in groups)
        assert len(groups) == 3


def test_a_cell_with_too_few_training_drivers_is_given_the_null_token() -> None:
    few = 3 * (LEAST_IN_CELL - 1)
    drivers = measured({(0, 0): 90, (0, 1): few, (1, 0): 90})
    cell = fitted(drivers).assign(drivers)
    assert (cell[90 : 90 + few] == NULL).all()
    assert (cell[:90] != NULL).all()


def test_undetermined_style_or_missing_feature_is_the_null_token() -> None:
    drivers = measured({(0, 0): 90, (1, 0): 90})
    drivers.style[0] = -1
    drivers.feature[1, 2] = np.nan
    cell = fitted(drivers).assign(drivers)
    assert (cell[:2] == NULL).all()
    assert (cell[2:] != NULL).all()


def test_what_if_everyone_had_that_style() -> None:
    drivers = measured({(0, 0): 90, (1, 0): 90})
    cells = fitted(drivers)
    cell = cells.assign(drivers, style=cells.class_index("b"))
    assert (cell[:, 0] == 1).all()
    with pytest.raises(InputError, match="Did you mean"):
        cells.class_index("bb")


def test_cells_come_back_from_json_bit_for_bit() -> None:
    drivers = measured({(0, 0): 90, (1, 1): 90})
    cells = fitted(drivers)
    back = StyleCells.from_dict(json.loads(json.dumps(cells.to_dict())))
    np.testing.assert_array_equal(back.assign(drivers), cells.assign(drivers))
    np.testing.assert_array_equal(back.centre, cells.centre)


def test_no_known_style_at_all_says_what_to_do() -> None:
    drivers = measured({(0, 0): 30})
    drivers.style[:] = -1
    with pytest.raises(InputError, match="condition 'none'"):
        fitted(drivers)


def window(scene: Scene, split: str) -> Window:
    targets = np.arange(4, dtype=np.int32)
    return Window(0, split, scene, scene.history(40, SPEC.steps(0.1)[0]), 40, targets)


def test_clusters_are_fitted_on_the_training_split_only() -> None:
    train = [window(make_scene(f"s{i}", seed=i), "train") for i in range(12)]
    others = [window(make_scene(f"v{i}", seed=100 + i), "val") for i in range(5)]
    alone, _ = fit_conditioner("tdbm", SpeedJudges(), train, seed=0)
    mixed, style = fit_conditioner("tdbm", SpeedJudges(), [*others, *train], seed=0)
    np.testing.assert_array_equal(alone.cells.centre, mixed.cells.centre)
    np.testing.assert_array_equal(alone.cells.filled, mixed.cells.filled)
    assert len(style) == 4 * 17
