"""`Scene`: tracks, road and signals of one stretch of time at one place, and where they come from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

from stylesim.road import Road
from stylesim.signals import Signals
from stylesim.tracks import Tracks


@dataclass(frozen=True, eq=False)
class Scene:
    """One scene.

    `unit_id` names the continuous recording at one site, or the simulated episode: splits are by unit.
    `start_s` is the time of frame 0 on the unit's clock. `source` is the reader's or backend's name
    ("dlr_ut", "av2", "sumo", "highway_env"), `scenario` the scenario family or the recorded site.
    `t0_frame` is the last history frame where the source fixes it (Argoverse 2: 49), else None.
    `twin_of` is the scene_id of the episode that this is a counterfactual of, `replay_of` that of the recorded scene
    that it was started from ("" for neither); `metadata` (JSON values) says how, and which stressors happened when.
    """

    scene_id: str
    unit_id: str
    source: str
    scenario: str
    tracks: Tracks
    road: Road | None = None
    signals: Signals | None = None
    start_s: float = 0.0
    source_scenario_id: str = ""
    official_split: str = ""  # "train", "val", "test" where the source has one
    t0_frame: int | None = None
    counts: Mapping[str, int] = field(default_factory=dict)  # collisions, dropped rows, … of this scene
    parameters: Mapping[str, float] = field(default_factory=dict)  # what was drawn for this episode
    twin_of: str = ""
    replay_of: str = ""
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check ids and clocks."""
        if not self.scene_id or not self.unit_id:
            raise ValueError("scene_id and unit_id must not be empty")
        if self.signals is not None and self.signals.state.shape[1] != self.tracks.n_frames:
            raise ValueError("signals and tracks differ in their number of frames")
        object.__setattr__(self, "counts", MappingProxyType(dict(self.counts)))
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))
        object.__setattr__(self, "metadata", MappingProxyType(dict(self.metadata)))

    def history(self, t0: int, steps: int) -> Scene:
        """What is known at frame t0 (see `Tracks.history`): no later frame, no commanded style, no outcome.

        `counts`, `parameters` and `metadata` go too: a drawn cycle time would tell when the light changes. So do
        `twin_of` and `replay_of`: that an episode has a counterfactual is nothing that its history shows.
        """
        tracks = self.tracks.history(t0, steps)
        first = t0 + 1 - tracks.n_frames
        signals = None if self.signals is None else self.signals.frames(first, t0 + 1)
        return replace(
            self,
            tracks=tracks,
            signals=signals,
            start_s=self.start_s + first * tracks.dt_s,
            counts={},
            parameters={},
            metadata={},
            t0_frame=None,
            twin_of="",
            replay_of="",
        )
