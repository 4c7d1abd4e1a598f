"""Every commanded driver of a corpus with its features, and who is not judged and why."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.rows import DriverRows, concatenated
from stylesim.labelers.single_windows import track_and_window_rows
from stylesim.scene import Scene
from stylesim.style import STYLE_CLASSES
from stylesim.tracks import TrackFlag

LEAST_S = 20.0  # chosen, because whole trips are judged: under two windows there is hardly a trip
CUT = "under 20 s: the recording began or ended"
LEFT = "under 20 s: left the road"
LOST = "under 20 s: removed or teleported"
NO_MOTOR = "no motor vehicle"
UNDETERMINED_REASON = "undetermined"
# What counts as an exclusion: who was on the road for less was not asked for. The others were, and could not be judged.
EXCLUSIONS = (LOST, NO_MOTOR, UNDETERMINED_REASON)


@dataclass(frozen=True, eq=False)
class CommandedDrivers:
    """All logged drivers with a commanded class of the six; one row of features for each that is to be judged.

    `reason` is "" for who is judged, else why not. `tracks` and `windows` have rows of the judged only, in order;
    `owner` says whose each window is, counted among the judged. `unseen` counts drivers that were to depart and have
    no logged frame (not inserted, or gone before the log began): their style is not in the corpus.
    """

    commanded: Int64[np.ndarray, " driver"]  # place in STYLE_CLASSES
    knob: Float64[np.ndarray, " driver"]
    unit: tuple[str, ...]
    backend: tuple[str, ...]
    scenario: tuple[str, ...]
    reason: tuple[str, ...]
    tracks: DriverRows
    windows: DriverRows
    owner: Int64[np.ndarray, " window"]
    unseen: int
    outcomes: Counter[tuple[str, str]]  # (style, flag) of the judged: they are judged all the same

    @property
    def judged(self) -> Bool[np.ndarray, " driver"]:
        """True for the drivers that have a row."""
        return np.array([not reason for reason in self.reason], bool)


def _reason(scene: Scene, agent: int) -> str:
    """Why that driver is not judged; "" if he is."""
    tracks = scene.tracks
    if not tracks.is_motor[agent]:
        return NO_MOTOR
    valid = tracks.valid[agent]
    if valid.sum() * tracks.dt_s >= LEAST_S - tracks.dt_s / 2:
        return ""
    if tracks.flagged(TrackFlag.REMOVED | TrackFlag.TELEPORTED)[agent]:
        return LOST
    return CUT if valid[0] or valid[-1] else LEFT


_OUTCOMES = (TrackFlag.COLLIDED, TrackFlag.TELEPORTED, TrackFlag.REMOVED, TrackFlag.IMPLAUSIBLE)


class _Gatherer:
    """Collects drivers and rows scene by scene; features are all that is kept of a track."""

    def __init__(self, options: FeatureOptions) -> None:
        self.options = options
        self.people: list[tuple[int, float, str, str, str, str]] = []
        self.tracks: list[DriverRows] = []
        self.windows: list[DriverRows] = []
        self.owners: list[Int64[np.ndarray, " window"]] = []
        self.outcomes: Counter[tuple[str, str]] = Counter()
        self.unseen = 0
        self.judged = 0

    def add(self, scene: Scene) -> None:
        """Count the drivers of one scene."""
        tracks, chosen = scene.tracks, []
        logged = sum(driver is not None for driver in tracks.driver)
        self.unseen += max(0, scene.counts.get("drivers", logged) - logged)
        for agent, driver in enumerate(tracks.driver):
            if driver is None or driver.name not in STYLE_CLASSES or not tracks.valid[agent].any():
                continue
            reason = _reason(scene, agent)
            place = STYLE_CLASSES.index(driver.name)
            self.people.append((place, driver.aggressiveness, scene.unit_id, scene.source, scene.scenario, reason))
            if not reason:
                chosen.append(agent)
                self.outcomes.update((driver.name, f.name or "") for f in _OUTCOMES if tracks.flagged(f)[agent])
        if not chosen:
            return
        rows, windows, owner = track_and_window_rows(scene, self.options, np.array(chosen, np.int64))
        self.tracks.append(rows)
        self.windows.append(windows)
        self.owners.append(owner + self.judged)
        self.judged += len(chosen)


def commanded_drivers(
    corpus: Corpus,
    options: FeatureOptions,
    *,
    scenarios: Sequence[str] = (),
    progress: Callable[[int, int], None] | None = None,
) -> CommandedDrivers:
    """The commanded drivers of (chosen scenarios of) a corpus, one scene in memory at a time.

    InputError if a named scenario is not in it, or no commanded driver was on the road for 20 s.
    """
    have = sorted({info.scenario for info in corpus.info})
    for name in scenarios:
        if name not in have:
            raise InputError(f"{corpus.path} has no scene of {name!r}; it has {', '.join(have)}")
    view = corpus.with_info(info for info in corpus.info if not scenarios or info.scenario in scenarios)
    gathered = _Gatherer(options)
    for done, scene in enumerate(view, start=1):
        gathered.add(scene)
        if progress is not None:
            progress(done, len(view))
    if not gathered.judged:
        what = "no driver with a commanded style" if not gathered.people else "no commanded driver that was logged 20 s"
        raise InputError(f"{corpus.path} has {what}: fidelity judges simulated drivers (`stylesim generate`)")
    commanded, knob, unit, backend, scenario, reason = zip(*gathered.people, strict=True)
    return CommandedDrivers(
        commanded=np.array(commanded, np.int64),
        knob=np.array(knob, np.float64),
        unit=unit,
        backend=backend,
        scenario=scenario,
        reason=reason,
        tracks=concatenated(gathered.tracks),
        windows=concatenated(gathered.windows),
        owner=np.concatenate(gathered.owners),
        unseen=gathered.unseen,
        outcomes=gathered.outcomes,
    )
