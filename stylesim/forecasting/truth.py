"""The style that a driver really has, unknown to all at t0: for the oracle, and as a target to learn. No torch."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Int32, Int64

from stylesim.errors import InputError
from stylesim.forecasting.conditions import SEES_FUTURE
from stylesim.labels import UNDETERMINED
from stylesim.scene import Scene
from stylesim.style import STYLE_CLASSES, DriverStyle, class_of_knob

TrueStyles = Mapping[tuple[str, str], int]  # (scene id, agent id) to the number of the class, or UNDETERMINED


@runtime_checkable
class TrackJudges(Protocol):
    """Judges that can also look at whole tracks."""

    def whole_track(self, scene: Scene, agent_index: Int32[np.ndarray, " driver"]) -> Int64[np.ndarray, " driver"]:
        """The class of each driver over the whole scene, future included; UNDETERMINED where unknown."""
        ...


class Truth:
    """The style of every agent of a scene: the class of the whole track, or (`commanded`) rather what was commanded."""

    def __init__(self, judges: object, classes: Sequence[str], *, commanded: bool) -> None:
        self._judges, self._classes, self._commanded = judges, tuple(classes), commanded
        self._last: tuple[Scene, Int64[np.ndarray, " agent"]] | None = None  # windows of a scene follow one another

    def of_scene(self, scene: Scene) -> Int64[np.ndarray, " agent"]:
        """Class numbers of all agents; UNDETERMINED for those that nothing is known of, and for who is no motorist."""
        if self._last is None or self._last[0] is not scene:
            self._last = scene, self._judged(scene)
        return self._last[1]

    def _judged(self, scene: Scene) -> Int64[np.ndarray, " agent"]:
        tracks = scene.tracks
        found = np.full(tracks.n_agents, UNDETERMINED, np.int64)
        if self._commanded:
            for agent, driver in enumerate(tracks.driver):
                name = None if driver is None else _class_of(driver)
                if name in self._classes:
                    found[agent] = self._classes.index(name)
        asked = np.flatnonzero(tracks.is_motor & tracks.valid.any(axis=1) & (found == UNDETERMINED)).astype(np.int32)
        if len(asked) and isinstance(self._judges, TrackJudges):
            found[asked] = self._judges.whole_track(scene, asked)
        return found

    def of_scenes(self, scenes: Iterable[Scene]) -> dict[tuple[str, str], int]:
        """The same for every agent of these scenes (a Corpus is such)."""
        table: dict[tuple[str, str], int] = {}
        for scene in scenes:
            names = scene.tracks.agent_id
            table.update(zip(((scene.scene_id, name) for name in names), self.of_scene(scene).tolist(), strict=True))
        return table


def _class_of(driver: DriverStyle) -> str:
    """The class that was commanded; that of his place on the knob for a driver without one (neutral)."""
    return driver.name if driver.name in STYLE_CLASSES else class_of_knob(driver.aggressiveness)


def looked_up(
    truth: TrueStyles, scene: Scene, agent_index: Int32[np.ndarray, " driver"]
) -> Int64[np.ndarray, " driver"]:
    """The true styles of these agents; InputError for one that was not revealed."""
    found = []
    for agent in agent_index:
        key = (scene.scene_id, scene.tracks.agent_id[agent])
        if key not in truth:
            raise InputError(
                f"an oracle ({SEES_FUTURE}) must be told the true styles first: reveal(scenes) with the scenes that it "
                f"is asked about; scene {key[0]!r}, agent {key[1]!r} is not in what was revealed"
            )
        found.append(truth[key])
    return np.array(found, np.int64)
