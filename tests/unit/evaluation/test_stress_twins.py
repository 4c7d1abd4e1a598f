"""Twins that were switched on the way (one past, two futures) and twins from the start (two pasts)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stylesim.evaluation.mixtures import best_weights, energy_score
from stylesim.evaluation.ratios import ratio_estimate
from stylesim.evaluation.stress_corpora import own_traffic
from stylesim.evaluation.stress_twins import twin_forecasts
from stylesim.evaluation.twin_shift import twin_shift
from stylesim.windows import WindowSpec

T0 = 60
ASK = {"spec": WindowSpec(), "modes": 6, "seed": 0}


def variant(plain, name, moved, at_s):
    about = {"driver": "car2", "at_s": at_s, "variant": name}
    return replace(
        plain,
        scene_id=f"{plain.scene_id}-{name}",
        twin_of=plain.scene_id,
        tracks=replace(plain.tracks, position_m=moved),
        metadata={"twin": about},
    )


@pytest.fixture(scope="module")
def switched(world, tmp_path_factory):
    """36 episodes; the twin ends 12 m behind after 6 s, the null twin 0.6 m."""
    scenes = []
    for e in range(36):
        plain = world.scene(e)
        frames = np.arange(plain.tracks.n_frames)
        scenes.append(plain)
        for name, behind_mps in (("twin", 2.0), ("null", 0.1)):
            moved = plain.tracks.position_m.copy()
            moved[2, :, 0] -= behind_mps * 0.1 * np.maximum(frames - T0, 0)
            scenes.append(variant(plain, name, moved, 6.0))
    return world.write(tmp_path_factory.mktemp("twins") / "twins", scenes, with_labels=False)


@pytest.fixture(scope="module")
def from_start(world, tmp_path_factory):
    """36 episodes; the twin is 2 m/s slower all the time, the null twin brakes by chance from 6 s on."""
    scenes = []
    for e in range(36):
        plain = world.scene(e)
        t = np.arange(plain.tracks.n_frames) * 0.1
        for name, shift, slower in (
            ("", 0 * t, 0.0),
            ("twin", 2.0 * t, 2.0),
            ("null", np.maximum(t - 6.0, 0) * 1.5, 0.0),
        ):
            moved, velocity = plain.tracks.position_m.copy(), plain.tracks.velocity_mps.copy()
            moved[2, :, 0] -= shift
            velocity[2, :, 0] -= slower
            one = variant(plain, name, moved, None) if name else plain
            scenes.append(replace(one, tracks=replace(one.tracks, velocity_mps=velocity)))
    return world.write(tmp_path_factory.mktemp("twins") / "twins", scenes, with_labels=False)


def test_own_traffic_keeps_twins_apart(switched):
    traffic = own_traffic(switched)
    assert len(traffic.populations[switched.path.name][0]) == 36
    assert traffic.twins == (switched,)


def test_twins_share_a_past_and_part_after_it(world, switched):
    fan = world.ConstantVelocity(tuple(np.linspace(0.4, 1.6, 61)))
    blind = twin_forecasts(fan, (switched,), **ASK | {"modes": 61})
    assert (blind.drivers, blind.identical) == (36, 36)
    assert blind.figures["apart_m"].value == pytest.approx(12.0, abs=1e-3)
    assert blind.figures["covers_both"].value == 1.0
    one_mode = twin_forecasts(world.ConstantVelocity(), (switched,), **ASK)
    assert one_mode.figures["covers_both"].value == 0.0
    assert one_mode.mixture["twin"]["over_best_m"].value == pytest.approx(0.0, abs=1e-6)


def test_no_name_tells_which_twin_it_is(world, switched):
    class Peeping(world.ConstantVelocity):
        def _one(self, task):
            self.asked.append(task)
            given = super()._one(task)
            told = task.scene.scene_id.endswith("twin") or bool(task.scene.twin_of) or bool(task.scene.metadata)
            return replace(given, mode_m=given.mode_m + np.float32(told))

    assert twin_forecasts(Peeping(), (switched,), **ASK).identical == 36


def test_a_forecaster_that_rolls_dice_is_found_out(world, switched):
    class Rolling(world.ConstantVelocity):
        calls = 0

        def _one(self, task):
            self.calls += 1
            given = super()._one(task)
            return replace(given, mode_m=given.mode_m + np.float32(0.01 * self.calls))

    assert twin_forecasts(Rolling(), (switched,), **ASK).identical == 0


def test_an_oracle_is_told_each_side_under_the_same_name(world, switched):
    class Told(world.ConstantVelocity):
        sees_future = True

        def reveal(self, scenes):
            self.told = [(scene.scene_id, float(scene.tracks.position_m[2, -1, 0])) for scene in scenes]

        def _one(self, task):
            given = super()._one(task)
            assert self.told[0][0] == task.scene.scene_id
            return replace(given, mode_m=given.mode_m + np.float32(self.told[0][1]))

    assert twin_forecasts(Told(), (switched,), **ASK).identical == 0


def test_probabilities_are_held_against_the_mixture(world, switched):
    """Modes at the two futures, roughly: equal probabilities are best for the twins, a sure one for the nulls."""

    def forecast(chance):
        class Two(world.ConstantVelocity):
            def _one(self, task):
                given = super()._one(task)
                ends = np.stack([given.mode_m[:, 0], given.mode_m[:, 0]], axis=1)
                ahead = np.arange(1, ends.shape[2] + 1, dtype=np.float32) * 0.1
                ends[:, 1, :, 0] -= 2.0 * ahead
                return replace(given, mode_m=ends, probability=np.tile(np.float32(chance), (len(ends), 1)))

        return twin_forecasts(Two(), (switched,), **ASK).mixture

    even, sure = forecast([0.5, 0.5]), forecast([0.95, 0.05])
    assert even["twin"]["over_best_m"].value < sure["twin"]["over_best_m"].value
    assert sure["null"]["over_best_m"].value < even["null"]["over_best_m"].value
    assert sure["null"]["over_equal_m"].value < 0 < sure["twin"]["over_equal_m"].value
    assert even["twin"]["over_equal_m"].value == pytest.approx(0.0, abs=1e-6)
    assert even["twin"]["score_m"].n_drivers == 36


def test_energy_score_is_least_for_the_truth():
    rng = np.random.default_rng(0)
    ends = rng.normal(0, 5, (6, 2))
    truth = ends[[1, 4]]
    best = best_weights(ends, truth)
    np.testing.assert_allclose(best, [0, 0.5, 0, 0, 0.5, 0], atol=1e-4)
    least = energy_score(ends, best, truth)
    assert all(energy_score(ends, rng.dirichlet(np.ones(6)), truth) >= least - 1e-9 for _ in range(200))
    one = energy_score(ends[:1], np.ones(1), np.zeros((1, 2)))
    assert one == pytest.approx(np.linalg.norm(ends[0]))  # of one mode it is the final displacement


def test_the_forecast_moves_with_the_world(world, from_start):
    """Constant velocity sees a twin that has always been slower, and nothing of chance that comes later."""
    found = twin_shift(world.ConstantVelocity(), (from_start,), spec=WindowSpec(), seed=0)
    twin, null = found.figures["twin"], found.figures["null"]
    assert twin["true_m"].value == pytest.approx(12.0, abs=1e-3)
    assert twin["share"].value == pytest.approx(1.0, abs=1e-3)
    assert twin["agrees"].value == 1.0
    assert null["forecast_m"].value == pytest.approx(0.0, abs=1e-5)
    assert null["share"].value == pytest.approx(0.0, abs=1e-5)
    assert null["true_m"].value > 1.0
    deaf = twin_shift(world.ConstantVelocity((0.0,)), (from_start,), spec=WindowSpec(), seed=0)
    assert deaf.figures["twin"]["share"].value == pytest.approx(0.0, abs=1e-5)


def test_each_kind_of_twin_has_its_own_test(world, switched, from_start):
    assert twin_shift(world.ConstantVelocity(), (switched,), spec=WindowSpec(), seed=0) is None
    only = twin_forecasts(world.ConstantVelocity(), (from_start,), **ASK)
    assert (only.drivers, only.counts) == (0, {"another style from the start": 36})
    assert twin_forecasts(world.ConstantVelocity(), (), **ASK) is None


def test_ratio_of_sums_with_its_interval():
    rng = np.random.default_rng(3)
    below = rng.uniform(1, 3, 400)
    above = 0.5 * below + rng.normal(0, 0.2, 400)
    units = [f"u{i // 10}" for i in range(400)]
    found = ratio_estimate(above, below, units, seed=0, purpose="test")
    assert found.low < 0.5 < found.high
    assert found.high - found.low < 0.05
    assert found.value == pytest.approx(above.sum() / below.sum())
    assert ratio_estimate(above[:20], below[:20], units[:20], seed=0, purpose="test").refused
    assert ratio_estimate(above, 0 * below, units, seed=0, purpose="test").refused
