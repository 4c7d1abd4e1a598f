"""`StyledTraffic` on highway-env's own environments, and on a user's."""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("highway_env")
from gymnasium.utils.env_checker import check_env
from highway_env.envs.highway_env import HighwayEnv
from highway_env.road.road import Road

import stylesim
from stylesim.errors import InputError
from stylesim.simulation.highway.road import StyledRoad
from stylesim.simulation.highway.vehicle import StyledVehicle

NAMES = ("exit", "highway", "intersection", "merge", "racetrack", "roundabout", "two-way")


def make(name: str, **arguments: Any) -> Any:
    # the versions of highway-env's ids differ between its releases
    latest = max(i for i in gym.registry if i.startswith(f"{name}-v"))
    return stylesim.StyledTraffic(gym.make(latest), **arguments)


@pytest.mark.parametrize("name", NAMES)
def test_everybody_but_the_ego_is_styled_and_stays_so(name):
    env = make(name, population="rare_heavy")
    _, info = env.reset(seed=3)
    inner = env.unwrapped
    assert isinstance(inner.road, StyledRoad)
    seen = set()
    for _ in range(6):
        others = [car for car in inner.road.vehicles if car not in inner.controlled_vehicles]
        assert all(isinstance(car, StyledVehicle) and car.style is not None for car in others)
        assert info["drivers"]["id"] == tuple(car.driver_id for car in others)
        assert all(car.on_road for car in others if not car.crashed)
        seen |= set(info["drivers"]["id"])
        *_, ended, _, info = env.step(env.action_space.sample() if name != "highway" else 1)
        if ended:
            break
    assert set(info["drivers"]["style"]) <= {"aggressive", "reckless", "threatening", "careful", "cautious", "timid"}
    if name == "intersection":
        assert len(seen) > len(set(env.reset(seed=3)[1]["drivers"]["id"])), "newcomers are styled too"


def rollout(seed: int | None, **arguments: Any) -> tuple[list[Any], list[Any]]:
    env = make("highway", **arguments)
    _, info = env.reset(seed=seed)
    places, crowd = [], [info["drivers"]]
    for _ in range(3):
        *_, info = env.step(1)
        places.append([car.position.tolist() for car in env.unwrapped.road.vehicles])
        crowd.append(info["drivers"])
    return places, crowd


def test_the_same_seed_gives_the_same_crowd_and_another_seed_another():
    one, other, third = rollout(5), rollout(5), rollout(6)
    assert one == other
    assert one[1] != third[1]


def test_the_crowds_own_seed_leaves_the_environment_as_it_is():
    one, other = make("highway", seed=1), make("highway", seed=2)
    first, second = one.reset(seed=5), other.reset(seed=5)
    np.testing.assert_array_equal(first[0], second[0])
    assert first[1]["drivers"] != second[1]["drivers"]


def test_shares_can_be_given():
    _, info = make("highway", styles={"timid": 1.0}).reset(seed=0)
    assert set(info["drivers"]["style"]) == {"timid"}


def test_gymnasiums_checker_is_content():
    with warnings.catch_warnings():  # that it is wrapped, and that highway-env's box is unbounded
        warnings.simplefilter("ignore", UserWarning)
        check_env(make("highway"), skip_render_check=True)


class Slippery(Road):
    """A user's own road."""

    grip = 0.5


class TheirEnv(HighwayEnv):  # type: ignore[misc]
    """A user's own environment on it."""

    def _create_road(self) -> None:
        super()._create_road()
        self.road.__class__ = Slippery


def test_a_users_own_environment_keeps_its_class_of_road():
    env = stylesim.StyledTraffic(TheirEnv())
    env.reset(seed=0)
    assert isinstance(env.unwrapped.road, Slippery)
    assert isinstance(env.unwrapped.road, StyledRoad)
    assert env.unwrapped.road.grip == 0.5
    assert len(env.step(1)[4]["drivers"]["id"]) == len(env.unwrapped.road.vehicles) - 1


def test_other_environments_are_refused():
    with pytest.raises(InputError, match="highway-env"):
        stylesim.StyledTraffic(gym.make("CartPole-v1"))
    with pytest.raises(InputError, match="timd"):
        stylesim.StyledTraffic(gym.make("highway-v0"), styles={"timd": 1.0})
