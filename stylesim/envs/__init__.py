"""Environments: an ego (Gymnasium), or several (PettingZoo), among drivers of every style."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stylesim.envs.parallel import ParallelDrivingEnv


def parallel_env(scenario: Any, **arguments: Any) -> ParallelDrivingEnv:
    """A scenario (name, folder or `Scenario`) as a PettingZoo `ParallelEnv`; `arguments` as in `ParallelDrivingEnv`.

    Raises MissingDependencyError without pettingzoo, InputError for names and values that do not fit.
    """
    from stylesim.errors import MissingDependencyError

    try:
        from stylesim.envs.parallel import ParallelDrivingEnv
    except ModuleNotFoundError as error:
        if error.name != "pettingzoo":
            raise
        raise MissingDependencyError("pettingzoo is not installed; pip install 'stylesim[multi]'") from None
    return ParallelDrivingEnv(scenario, **arguments)
