"""Counterfactual twins of an episode: which driver differs, and how. Decided from the finished plain episode."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.scene import Scene
from stylesim.simulation.plan import Twin, TwinRequest
from stylesim.style import STYLE_CLASSES

LEAST_AHEAD_S = (
    5.0  # chosen, because a change of style takes seconds to show (a headway, a lane change) and must be seen
)
TWIN, NULL = "twin", "null"


def candidates(scene: Scene, request: TwinRequest) -> tuple[int, ...]:
    """The agents that a twin can be made of, in the order of the tracks.

    Drivers of a style other than the asked one who are in the log for 5 s or more: from the moment of the switch on
    (where they must be on the road, with the frame before it), or at all.
    """
    tracks = scene.tracks
    least = round(LEAST_AHEAD_S / tracks.dt_s)
    if request.at_s is None:
        long_enough = tracks.valid.sum(axis=1) >= least
    else:
        frame = round(request.at_s / tracks.dt_s)
        if frame + least >= tracks.n_frames:
            return ()
        long_enough = tracks.valid[:, max(0, frame - 1) : frame + least + 1].all(axis=1)
    return tuple(
        int(agent)
        for agent in np.flatnonzero(long_enough)
        if (driver := tracks.driver[agent]) is not None and driver.name != request.style
    )


def twins_of(
    scene: Scene, request: TwinRequest, population: Population, *, backend: str, seed: int, episode: int
) -> tuple[Twin, ...]:
    """The twins to simulate beside the episode `scene`; none where it has no candidate.

    The new style is that of a person of the wanted class as `population` has them on `backend`.

    Driver, class and style come from streams of their own, so that they shift nothing else.
    """
    able = candidates(scene, request)
    if not able:
        return ()
    agent = able[int(stream(seed, episode, "", "twin driver").integers(len(able)))]
    driver_id, own = scene.tracks.agent_id[agent], scene.tracks.driver[agent]
    assert own is not None
    rng = stream(seed, episode, driver_id, "twin style")
    others = [name for name in STYLE_CLASSES if name != own.name]
    name = request.style or others[int(rng.integers(len(others)))]
    within = "placebo" if population.within_class == "placebo" else "interval"
    crowd = replace(population.reweighted(**{name: 1.0}), within_class=within)
    style = crowd.draw(rng, backend=backend, limit_mps=scene.parameters.get("speed_limit_mps"))
    twin = Twin(name=TWIN, driver=driver_id, style=style, from_style=own.name, at_s=request.at_s)
    null = twin.model_copy(update={"name": NULL, "style": own, "new_noise": True})
    return (twin, null) if request.null else (twin,)
