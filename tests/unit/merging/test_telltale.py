"""The classifier finds a difference where there is one, and none where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from stylesim.errors import InputError
from stylesim.merging.noise import Ar1, NoiseModel, with_noise
from stylesim.merging.telltale import NoiseTraces, residuals, telltale, traces
from stylesim.scene import Scene
from tests.conftest import make_scene


def noisy(sd: float, rho: float, first: int) -> list[Scene]:
    model = NoiseModel("made", Ar1(sd, rho), Ar1(2 * sd, rho), Ar1(0.1 * sd, rho))
    return [with_noise(make_scene(f"s{i}", seed=i, n_agents=10), model, seed=3) for i in range(first, first + 7)]


def test_the_same_noise_cannot_be_told() -> None:
    found = telltale(traces(noisy(0.05, 0.3, 0)), traces(noisy(0.05, 0.3, 100)), seed=0)
    assert found.simulated_drivers > 55
    assert found.low < 0.5 < found.high
    assert 0.3 < found.area < 0.7


@pytest.mark.parametrize(("sd", "rho"), [(0.1, 0.3), (0.05, 0.8)])
def test_another_size_or_memory_is_told(sd: float, rho: float) -> None:
    found = telltale(traces(noisy(0.05, 0.3, 0)), traces(noisy(sd, rho, 100)), seed=0)
    assert found.area > 0.9
    assert found.low > 0.8


def test_speed_and_place_play_no_part() -> None:
    """The residual of clean motion is next to nothing, whatever the motion."""
    left, moving = residuals(make_scene(n_agents=4))
    assert np.abs(left[moving]).max() < 0.02


def test_too_few_drivers_are_refused() -> None:
    with pytest.raises(InputError, match="too few to tell noise apart"):
        telltale(NoiseTraces(), traces(noisy(0.05, 0.3, 0)), seed=0)
