from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from stylesim.errors import InputError
from stylesim.labelers.drivers import DriverSample, DriverTable
from stylesim.labelers.features import FEATURES, TDBM_FEATURES
from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.rows import track_rows
from stylesim.labelers.scaler import FeatureScaler, clamped_shares, fit_scaler
from stylesim.labelers.tdbm import TDBM

from .made import scene_of, straight, traffic


def sample(n: int = 200, *, highway: int = 60, seed: int = 0) -> DriverSample:
    value = np.random.default_rng(seed).uniform(0, 10, (n, len(FEATURES)))
    value[:highway, FEATURES.index("v_avg")] += 20
    names = tuple(("u", str(i)) for i in range(n))
    return DriverSample(names, value, np.arange(n) < highway)


def test_percentiles_become_0_and_1_and_the_rest_is_clamped() -> None:
    drivers = sample(highway=0)
    scaler = fit_scaler(drivers, ("v_avg",), length_s=11.0)
    low, high = np.percentile(drivers.value[:, FEATURES.index("v_avg")], [5, 95])
    asked = np.array([[low], [high], [(low + high) / 2], [high + 1], [np.nan]])
    scaled, clamped = scaler.scaled(asked, np.zeros(5, bool))
    np.testing.assert_allclose(scaled[:, 0], [0, 1, 0.5, 1, np.nan], atol=1e-12)
    assert clamped[:, 0].tolist()[3:] == [True, False]


def test_jerk_is_scaled_in_its_logarithm() -> None:
    drivers = sample(highway=0)
    scaler = fit_scaler(drivers, ("j_l",), length_s=11.0)
    low, high = np.percentile(np.log1p(drivers.value[:, FEATURES.index("j_l")]), [5, 95])
    scaled, _ = scaler.scaled(np.array([[np.expm1((low + high) / 2)]]), np.zeros(1, bool))
    assert scaled[0, 0] == pytest.approx(0.5)


def test_each_context_has_its_own_range_unless_it_has_too_few_drivers() -> None:
    scaler = fit_scaler(sample(), TDBM_FEATURES, length_s=11.0)
    speed = TDBM_FEATURES.index("v_avg")
    assert scaler.low[1, speed] >= 20 > scaler.high[0, speed]
    assert scaler.drivers == (140, 60)
    few = fit_scaler(sample(highway=20), TDBM_FEATURES, length_s=11.0)
    assert few.drivers == (180, 0)
    assert few.high[1, speed] > few.high[0, speed]  # everybody's


def test_fitting_twice_is_fitting_once() -> None:
    scenes = [traffic(seed=1), traffic("other", seed=2)]
    first = TDBM().fit(scenes)
    assert TDBM().fit(scenes).hash_ == first.hash_
    assert first.fit(scenes).hash_ == TDBM().fit(scenes).hash_


def test_json_keeps_every_bit() -> None:
    scaler = fit_scaler(sample(), TDBM_FEATURES, length_s=11.0)
    again = FeatureScaler.from_dict(json.loads(json.dumps(scaler.to_dict())))
    np.testing.assert_array_equal(again.low, scaler.low)
    np.testing.assert_array_equal(again.high, scaler.high)
    with pytest.raises(InputError, match="not a feature scaler"):
        FeatureScaler.from_dict({"names": []})


def test_what_cannot_be_fitted_is_said() -> None:
    with pytest.raises(InputError, match=r"s_center is known of none.*a road with lanes"):
        TDBM().fit([replace(traffic(), road=None)])
    with pytest.raises(InputError, match="shorter windows"):
        TDBM().fit([scene_of([straight(0, 10, frames=50)])])


def test_a_driver_contributes_one_mean_over_all_of_its_scenes() -> None:
    options = FeatureOptions()
    slow, fast = scene_of([straight(0, 10)], name="a"), scene_of([straight(0, 20)], name="b")
    fast = replace(fast, unit_id="a")  # two cuts of one recording
    table = DriverTable(max_drivers=10, seed=0)
    for scene in (slow, fast):
        table.add(scene, track_rows(scene, options))
    found = table.sample()
    assert len(found) == 1
    assert found.value[0, FEATURES.index("v_avg")] == pytest.approx(15, rel=1e-3)
    assert np.isnan(found.value[0, FEATURES.index("s_front")])  # 100 m without a leader is no observation


def test_the_sample_does_not_depend_on_the_order_of_the_scenes() -> None:
    scenes = [traffic(f"scene{i}", agents=9, seed=i) for i in range(6)]
    found = []
    for order in (scenes, scenes[::-1]):
        table = DriverTable(max_drivers=7, seed=1)
        for scene in order:
            table.add(scene, track_rows(scene, FeatureOptions()))
        found.append(table.sample())
    assert found[0].name == found[1].name
    assert len(found[0]) == 7
    np.testing.assert_array_equal(found[0].value, found[1].value)


def test_parked_vehicles_teach_nothing() -> None:
    scenes = [traffic(seed=1)]
    parked = scene_of([straight(50, 0), straight(80, 0)], road=scenes[0].road, name="parked")
    assert TDBM().fit([*scenes, parked]).track_scaler_.total_drivers == TDBM().fit(scenes).track_scaler_.total_drivers


def test_clamped_shares() -> None:
    scene = traffic(seed=1)
    tdbm = TDBM().fit([scene])
    shares = clamped_shares(tdbm.track_scaler_, tdbm.label_windows(scene))
    assert shares["v_avg"] == (0.05, 0.05)  # of 40 drivers, two beyond each percentile


def test_jumping_positions_teach_nothing() -> None:
    scenes = [traffic(seed=1)]
    path = straight(0, 10, 3.5)
    path[50:, 0] += 4.0
    jumping = scene_of([path], road=scenes[0].road, name="jumping")
    assert TDBM().fit([*scenes, jumping]).track_scaler_.total_drivers == TDBM().fit(scenes).track_scaler_.total_drivers
