"""From scenes to samples: the windows of a corpus, and their compilation into a store on disk. No torch."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from weakref import WeakKeyDictionary

import numpy as np
from jaxtyping import Int32, Int64

from stylesim.corpus import Corpus
from stylesim.corpus.files import storage_error
from stylesim.forecasting.config import InputConfig
from stylesim.forecasting.snapshot import RoadArrays, agent_arrays, evidence, lane_signals, road_arrays
from stylesim.forecasting.store import NO_ROAD, FileSink, SampleStore, StoreBuilder
from stylesim.road import Road
from stylesim.scene import Scene
from stylesim.windows import WindowSpec, anchor_frames, target_agents

SPLITS = ("train", "val")
STORE_FORMAT = 2  # raise it when the arrays of the store change meaning
Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class Window:
    """One (scene, t0): what is known then, and the agents that are asked for."""

    scene_number: int  # among the train and val scenes
    split: str
    scene: Scene  # the whole scene: for the future targets only
    history: Scene
    t0: int
    targets: Int32[np.ndarray, " driver"]


def windows(corpus: Corpus, spec: WindowSpec, *, progress: Progress | None = None) -> Iterator[Window]:
    """Every window of the train and val scenes of a corpus that has someone to forecast, in corpus order."""
    view = corpus.with_info(info for info in corpus.info if info.split in SPLITS)
    for number, (info, scene) in enumerate(zip(view.info, view, strict=True)):
        history_steps = spec.steps(scene.tracks.dt_s)[0]
        for t0 in anchor_frames(scene, spec):
            targets = target_agents(scene, t0, spec)
            if len(targets):
                yield Window(number, info.split, scene, scene.history(t0, history_steps), t0, targets)
        if progress is not None:
            progress(number + 1, len(view))


class RoadCutter:
    """Roads as arrays, each cut once for as long as the `Road` lives."""

    def __init__(self, config: InputConfig) -> None:
        self._config = config
        self._cut: WeakKeyDictionary[Road, RoadArrays] = WeakKeyDictionary()
        self._evidence: WeakKeyDictionary[Road, frozenset[str]] = WeakKeyDictionary()

    def arrays(self, road: Road, track_id: str) -> RoadArrays:
        """The road as the driver of that track may see it."""
        if road not in self._evidence:
            self._evidence[road] = evidence(road)
        if track_id in self._evidence[road]:
            return road_arrays(road, self._config, without=track_id)
        if road not in self._cut:
            self._cut[road] = road_arrays(road, self._config)
        return self._cut[road]


def add_window(
    builder: StoreBuilder,
    cutter: RoadCutter,
    history: Scene,
    targets: Int32[np.ndarray, " driver"],
    config: InputConfig,
) -> Int64[np.ndarray, "driver 3"]:
    """Store one history and name its samples (the rows of `SampleStore.sample`); reads nothing but the history."""
    agents = agent_arrays(history, config)
    road, signals = history.road, history.signals
    lit = None if road is None or signals is None else lane_signals(road, signals, config)
    snapshot, first = builder.snapshot(agents, lit)
    rows = np.zeros((len(targets), 3), np.int64)
    for i, target in enumerate(targets):
        number = NO_ROAD
        if road is not None:
            number = builder.road(cutter.arrays(road, history.tracks.agent_id[target]))
        rows[i] = snapshot, first + agents.row[target], number
    return rows


def store_key(corpus: Corpus, spec: WindowSpec, config: InputConfig) -> str:
    """Name of a compiled store: a hash of everything that it depends on."""
    parts = {
        "format": STORE_FORMAT,
        "corpus": corpus.fingerprint,
        "scenes": [(info.scene_id, info.split) for info in corpus.info],
        "spec": asdict(spec),
        "inputs": asdict(config),
        "weights": sorted(corpus.weights().items()),  # may come later than the corpus, by `stylesim balance`
    }
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:24]


def compiled(
    corpus: Corpus, spec: WindowSpec, config: InputConfig, cache: Path, *, progress: Progress | None = None
) -> SampleStore:
    """The samples of a corpus, compiled once into `cache`; the folder appears under its name only when whole."""
    folder = cache / f"samples-{store_key(corpus, spec, config)}"
    if not folder.is_dir():
        partial = cache / f"{folder.name}.partial-{os.getpid()}"
        shutil.rmtree(partial, ignore_errors=True)
        try:
            partial.mkdir(parents=True)
            with FileSink(partial, config) as sink:
                _compile(corpus, spec, config, StoreBuilder(sink), progress)
            partial.rename(folder)
        except OSError as error:
            if not folder.is_dir():  # else another process finished the same store first
                raise storage_error(error, partial) from error
        finally:
            shutil.rmtree(partial, ignore_errors=True)
    return SampleStore.load(folder)


def _compile(
    corpus: Corpus, spec: WindowSpec, config: InputConfig, builder: StoreBuilder, progress: Progress | None
) -> None:
    weights = corpus.weights()
    unknown = np.nan if weights else 1.0  # `TrainingData` says how many of the training samples have none
    cutter = RoadCutter(config)
    for window in windows(corpus, spec, progress=progress):
        scene, targets = window.scene, window.targets
        rows = add_window(builder, cutter, window.history, targets, config)
        origin = np.zeros((len(targets), 4), np.int64)
        origin[:] = window.scene_number, window.t0, 0, SPLITS.index(window.split)
        origin[:, 2] = targets
        keys = [(scene.scene_id, scene.tracks.agent_id[i]) for i in targets]
        builder.samples(
            rows,
            origin=origin,
            weight=np.array([weights.get(key, unknown) for key in keys], np.float32),
            future_m=scene.tracks.position_m[targets, window.t0 + 1 : window.t0 + 1 + config.future_steps],
        )
