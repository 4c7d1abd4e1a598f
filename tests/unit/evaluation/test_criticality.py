"""Criticality, collisions and exposure of scenes whose answers are known."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.errors import InputError
from stylesim.evaluation.collisions import (
    INTO_SIDE,
    INTO_STANDING,
    RAN_RED,
    REAR_END,
    SIDEWAYS,
    UNDECIDED,
    collisions_of,
)
from stylesim.evaluation.criticality import criticality, quantile_estimate
from stylesim.evaluation.driver_criticality import drivers_criticality
from stylesim.evaluation.exposure import driver_weights, event_rate, style_weights
from stylesim.population import Population
from stylesim.scene import Scene
from stylesim.styles import style_table
from stylesim.tracks import TrackFlag
from tests.conftest import make_scene
from tests.unit.labelers.made import clock, lanes, scene_of

T = clock(200)


def straight(start: float, speed: float, y: float = 0.0) -> np.ndarray:
    return np.stack([start + speed * T, np.full(len(T), y)], axis=1)


def driven(scene: Scene, knobs: list[float | None], flags: list[int] | None = None) -> Scene:
    drivers = tuple(None if k is None else style_table().at(k) for k in knobs)
    return replace(
        scene, tracks=replace(scene.tracks, driver=drivers, flags=None if flags is None else np.array(flags))
    )


def written(out, scenes, **configuration) -> Corpus:
    with CorpusWriter(out, source="made", configuration=configuration, seed=3) as writer:
        for one in scenes:
            writer.add(one)
        return writer.finish()


def test_a_follower_that_closes_in(tmp_path):
    """At 15 m/s, 40 m behind a car at 13 m/s: the gap falls to 0.5 m at the end; nobody is ahead of the leader."""
    scene = driven(scene_of([straight(0.0, 15.0), straight(44.3, 13.0)], road=lanes(1)), [1.0, -1.0])
    found = drivers_criticality(written(tmp_path / "c", [scene])).drivers
    gap = 39.8 - 2.0 * T
    assert found.style == ("aggressive", "timid")
    assert found.km.tolist() == pytest.approx([15 * 19.9 / 1000, 13 * 19.9 / 1000], rel=1e-4)
    assert found.ttc_min_s[0] == pytest.approx(gap[-1] / 2, abs=0.02)
    assert found.ttc_p5_s[0] == pytest.approx(np.percentile(gap / 2, 5), abs=0.02)
    assert found.headway_min_s[0] == pytest.approx(gap[-1] / 15, abs=0.01)
    assert found.deceleration_max_mps2[0] == pytest.approx(4 / (2 * gap[gap > 0][-1]), rel=0.05)
    assert found.ttc_conflicts.tolist() == [1, 0]
    assert np.isnan(found.ttc_min_s[1]) and np.isnan(found.pet_min_s).all()


def test_rear_end_collisions_are_the_followers():
    scene = scene_of([straight(0.0, 15.0), straight(30.0, 12.0)], road=lanes(1))
    (one,), at_first = collisions_of(scene)
    assert (one.how, one.charged, at_first) == (REAR_END, (0,), 0)
    assert one.frame == pytest.approx((30 - 4.5) / 3 / 0.1, abs=1)


def test_who_moves_over_is_charged():
    side = straight(0.0, 12.0, 3.5)
    side[50:, 1] = np.maximum(3.5 - 0.15 * np.arange(150), 0.0)
    (one,), _ = collisions_of(scene_of([straight(0.5, 12.0), side], road=lanes(2)))
    assert (one.how, one.charged) == (SIDEWAYS, (1,))


def crossing_scene(late: float, flags: list[int] | None = None) -> Scene:
    """Car 0 eastward, car 1 northward, whose centres meet the origin `late` seconds apart."""
    east = np.stack([10.0 * (T - 8.0), np.zeros(len(T))], axis=1)
    north = np.stack([np.zeros(len(T)), 10.0 * (T - 8.0 - late)], axis=1)
    scene = scene_of([east, north])
    return driven(scene, [0.6, -0.6], flags)


def test_into_the_side_and_through_the_red():
    (one,), _ = collisions_of(crossing_scene(0.35))
    assert (one.how, one.charged) == (INTO_SIDE, (1,))
    (one,), _ = collisions_of(crossing_scene(0.35, [int(TrackFlag.RAN_RED), 0]))
    assert (one.how, one.charged) == (RAN_RED, (0,))
    (one,), _ = collisions_of(crossing_scene(0.0))
    assert (one.how, one.charged) == (UNDECIDED, (0, 1))


def test_who_runs_into_one_that_stands():
    oncoming = np.stack([60.0 - 10.0 * T, np.full(len(T), 1.0)], axis=1)
    (one,), _ = collisions_of(scene_of([oncoming, straight(0.0, 0.0)], headings=[np.pi, 0.0]))
    assert (one.how, one.charged) == (INTO_STANDING, (0,))


def test_a_red_light_is_no_excuse_for_who_follows_too_closely():
    scene = driven(
        scene_of([straight(0.0, 15.0), straight(30.0, 12.0)], road=lanes(1)), [1.0, 0.6], [0, int(TrackFlag.RAN_RED)]
    )
    (one,), _ = collisions_of(scene)
    assert (one.how, one.charged) == (REAR_END, (0,))


def test_nobody_is_charged_under_a_stressor(tmp_path):
    event = {"kind": "hard_brake", "time_s": 2.0, "actor": "car-1", "victim": "car-0", "numbers": {}}
    for time_s, charged in ((2.0, 0), (19.0, 1)):
        scene = scene_of([straight(0.0, 15.0), straight(30.0, 12.0)], road=lanes(1))
        scene = replace(scene, metadata={"events": [{**event, "time_s": time_s}]})
        (one,), _ = collisions_of(scene)
        assert one.under_stressor == (not charged)
        found = drivers_criticality(written(tmp_path / f"c{charged}", [scene]))
        assert found.drivers.collisions_charged.tolist() == [charged, 0]
        assert found.drivers.in_collisions.tolist() == [1, 1]


def test_cars_put_onto_each_other_did_not_collide():
    found, at_first = collisions_of(scene_of([straight(0.0, 10.0), straight(1.0, 10.0)], road=lanes(1)))
    assert (found, at_first) == ([], 1)


def test_crossing_drivers_have_a_post_encroachment_time(tmp_path):
    found = drivers_criticality(written(tmp_path / "c", [crossing_scene(2.0)])).drivers
    assert found.pet_min_s.tolist() == pytest.approx([2 - 0.63] * 2, abs=0.16)
    assert found.pet_conflicts.tolist() == [0, 0]


SPECTRUM = {"name": "tdbm_spectrum", "shares": [1 / 6] * 6, "within_class": "interval"}


@pytest.fixture(scope="module")
def corpus(tmp_path_factory) -> Corpus:
    scenes = [make_scene(f"s{i}", n_agents=24, n_frames=150, seed=i, source="sumo") for i in range(12)]
    return written(tmp_path_factory.mktemp("criticality") / "c", scenes, population=SPECTRUM)


def test_the_table_holds_every_driver_and_kilometre(corpus):
    found = criticality(corpus, as_population="naturalistic", draws=50)
    styles = [one.style for one in found.rows]
    assert styles[-2:] == ["all", "as naturalistic"] and len(styles) == 8
    everyone = found.row("all")
    assert everyone.drivers == 288 == sum(one.drivers for one in found.rows[:6])
    assert everyone.km == pytest.approx(sum(one.km for one in found.rows[:6])) == pytest.approx(found.drivers.km.sum())
    assert found.row("all").rates["ttc_conflicts"].events == found.drivers.ttc_conflicts.sum()
    json.dumps(found.to_dict(), allow_nan=False)
    assert criticality(corpus, draws=50).to_dict()["rows"] == found.to_dict()["rows"][:-1]


def test_naturalistic_rates_are_those_of_the_styles_in_its_shares(corpus):
    """Sum over styles of share x (events per driver) over share x (km per driver): worked out by hand."""
    found = criticality(corpus, as_population="naturalistic", draws=20)
    shares, drivers = Population.load("naturalistic").by_class, found.drivers
    style = np.array(drivers.style)
    above = below = 0.0
    for name, share in shares.items():
        own = style == name
        weight = share * 6
        above += weight * drivers.ttc_conflicts[own].sum()
        below += weight * drivers.km[own].sum() / 1000
    rate = found.row("as naturalistic").rates["ttc_conflicts"]
    assert rate.value == pytest.approx(above / below)
    assert rate.effective_drivers < 288
    assert rate.low <= rate.value <= rate.high


def test_weights_of_every_driver(corpus):
    weights = driver_weights(corpus, Population.load("naturalistic"))
    assert len(weights) == 288
    name = corpus.scene("s0").tracks.driver[0].name
    assert weights["s0", "car-0"] == pytest.approx(6 * Population.load("naturalistic").by_class[name])


def test_weights_that_do_not_exist(corpus, tmp_path):
    with pytest.raises(InputError, match="names no population"):
        criticality(written(tmp_path / "r", [make_scene()]), as_population="naturalistic")
    with pytest.raises(InputError, match="has no reckless, threatening"):
        style_weights(
            Population.of(aggressive=0.5, careful=0.3, cautious=0.1, timid=0.1), Population.load("naturalistic")
        )
    with pytest.raises(InputError, match="neutral drivers only"):
        style_weights(Population.load("neutral"), Population.load("naturalistic"))
    with pytest.raises(InputError, match="no ratio"):
        style_weights(Population("c", (1 / 6,) * 6, "centre"), Population.load("naturalistic"))
    with pytest.raises(InputError, match="by is one of"):
        criticality(corpus, by="colour")


@given(st.integers(0, 40), st.floats(0.1, 50))
def test_with_equal_weights_the_interval_is_garwoods(events, exposure):
    rate = event_rate(np.array([events, 0]), np.array([exposure, exposure]))
    low = chi2.ppf(0.025, 2 * events) / 2 if events else 0.0
    assert rate.low == pytest.approx(low / (2 * exposure), abs=1e-12)
    assert rate.high == pytest.approx(chi2.ppf(0.975, 2 * events + 2) / 2 / (2 * exposure))
    assert rate.value == pytest.approx(events / (2 * exposure))
    assert rate.effective_drivers == pytest.approx(2)


def test_the_weighted_interval_covers():
    """Poisson counts of four styles with unequal weights, 400 trials: at least 93 % of the 95 % intervals hold."""
    rng = np.random.default_rng(0)
    exposure, rate = np.repeat([2.0, 2.0, 1.0, 4.0], 50), np.repeat([0.5, 0.2, 0.05, 0.02], 50)
    weight = np.repeat([0.1, 0.5, 2.0, 1.5], 50)
    truth = (weight * rate * exposure).sum() / (weight * exposure).sum()
    found = [event_rate(rng.poisson(rate * exposure), exposure, weight) for _ in range(400)]
    assert np.mean([one.low <= truth <= one.high for one in found]) >= 0.93


@given(st.lists(st.floats(-5, 5), min_size=30, max_size=60), st.sampled_from([0.05, 0.5]))
@settings(max_examples=20, deadline=None)
def test_quantiles_are_numpys(values, share):
    value = np.array(values)
    unit = [f"u{i % 5}" for i in range(len(value))]
    found = quantile_estimate(value, np.ones(len(value)), unit, share, seed=0, purpose="t", draws=20)
    assert found.value == np.quantile(value, share, method="inverted_cdf")
    assert found.low <= found.high
