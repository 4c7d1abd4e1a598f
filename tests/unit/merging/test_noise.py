import numpy as np
import pytest

from stylesim.errors import InputError
from stylesim.merging.noise import Ar1, NoiseModel, fit_noise, with_noise
from tests.conftest import make_scene


def model(sd: float, rho: float) -> NoiseModel:
    return NoiseModel("made", Ar1(sd, rho), Ar1(2 * sd, rho), Ar1(0.1 * sd, rho))


def noisy(sd: float, rho: float, *, seed: int = 3):
    return [with_noise(make_scene(f"s{i}", seed=i, n_agents=8), model(sd, rho), seed=seed) for i in range(12)]


@pytest.mark.parametrize(("sd", "rho"), [(0.05, 0.0), (0.1, 0.5), (0.2, 0.8)])
def test_the_fit_finds_the_noise_that_was_put_in(sd, rho):
    found = fit_noise(noisy(sd, rho), source="made")
    for have, wanted in ((found.position, sd), (found.velocity, 2 * sd), (found.heading, 0.1 * sd)):
        assert have.sd == pytest.approx(wanted, rel=0.25)
        assert have.rho == pytest.approx(rho, abs=0.12)


def test_clean_tracks_have_next_to_no_noise():
    found = fit_noise([make_scene(f"s{i}", seed=i) for i in range(6)], source="made")
    assert found.position.sd < 0.005


def test_noise_keeps_what_it_must():
    scene = make_scene(n_agents=4)
    other = with_noise(scene, model(0.1, 0.5), seed=1)
    assert other.tracks.driver == scene.tracks.driver
    np.testing.assert_array_equal(other.tracks.valid, scene.tracks.valid)
    assert np.isnan(other.tracks.position_m[~scene.tracks.valid]).all()
    assert np.nanstd(other.tracks.position_m - scene.tracks.position_m) == pytest.approx(0.1, rel=0.3)
    assert other.parameters["noise_position_sd_m"] == 0.1


def test_a_driver_has_a_noise_of_its_own():
    scene = make_scene(n_agents=4)
    again = with_noise(scene, model(0.1, 0.5), seed=1).tracks
    keep = np.array([False, True, False, True])
    fewer = with_noise(type(scene)(**{**scene.__dict__, "tracks": scene.tracks.select(keep)}), model(0.1, 0.5), seed=1)
    np.testing.assert_array_equal(fewer.tracks.position_m, again.position_m[keep])
    seeded = with_noise(scene, model(0.1, 0.5), seed=2).tracks
    assert not np.array_equal(seeded.position_m, again.position_m, equal_nan=True)


def test_a_standing_vehicle_stays_put():
    scene = make_scene(n_agents=2)
    still = type(scene.tracks)(**{**scene.tracks.__dict__, "velocity_mps": np.zeros_like(scene.tracks.velocity_mps)})
    other = with_noise(type(scene)(**{**scene.__dict__, "tracks": still}), model(0.1, 0.5), seed=1)
    np.testing.assert_array_equal(other.tracks.position_m, still.position_m)


def test_too_little_traffic_is_refused():
    with pytest.raises(InputError, match="too little moving traffic"):
        fit_noise([make_scene(n_agents=1, n_frames=60)], source="made")
