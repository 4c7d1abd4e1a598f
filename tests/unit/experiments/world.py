"""A world of plain arrays in which the style decides what a driver does after t0 — or decides nothing.

Drivers are on straight lanes 100 m apart and drive at a constant speed until t0. Then each brakes or speeds up: by its
commanded style where style matters, by lot where it does not. No history tells which, so only the label can.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.forecasting.measured import Measured
from stylesim.scene import Scene
from stylesim.style import CLASS_KNOB
from stylesim.styles import style_table
from stylesim.tracks import AgentKind, Tracks
from stylesim.windows import WindowSpec

DT_S = 0.2
SPEC = WindowSpec(history_s=1.0, future_s=3.0, stride_s=10.0)  # one window per scene
HISTORY, FRAMES = 5, 20
STYLES = ("aggressive", "timid")
CHANGE_MPS2 = 3.0


def scene(episode: int, *, matters: bool, drivers: int = 8) -> Scene:
    """One window of `drivers` drivers."""
    rng = np.random.default_rng([episode, matters])
    style = rng.integers(0, 2, drivers)
    decides = style if matters else rng.integers(0, 2, drivers)
    # six modes cannot cover all of it, but cover half of it twice as well: who knows the half must win
    change = np.where(decides == 0, 1.0, -1.0) * rng.uniform(0.0, CHANGE_MPS2, drivers)
    start = rng.uniform(9.0, 13.0, drivers)
    ahead_s = np.maximum(np.arange(FRAMES) - (HISTORY - 1), 0) * DT_S
    along = start[:, None] * np.arange(FRAMES) * DT_S + 0.5 * change[:, None] * ahead_s**2
    across = np.repeat(100.0 * np.arange(drivers)[:, None], FRAMES, axis=1)
    speed = start[:, None] + change[:, None] * ahead_s
    table = style_table()
    tracks = Tracks(
        agent_id=tuple(f"car{i}" for i in range(drivers)),
        kind=np.full(drivers, AgentKind.CAR),
        size_m=np.tile([4.5, 1.8], (drivers, 1)),
        position_m=np.stack([along, across], axis=-1),
        velocity_mps=np.stack([speed, 0 * speed], axis=-1),
        heading_rad=np.zeros((drivers, FRAMES)),
        valid=np.ones((drivers, FRAMES), bool),
        dt_s=DT_S,
        driver=tuple(table.at(CLASS_KNOB[STYLES[z]]) for z in style),
    )
    return Scene(
        scene_id=f"made-{episode:03d}", unit_id=f"made-{episode:03d}", source="made", scenario="made", tracks=tracks
    )  # fmt: skip


def world(folder: Path, *, matters: bool, train: int = 40, val: int = 6, test: int = 30) -> Corpus:
    """A corpus of such scenes, split; every scene is a unit."""
    splits = ["train"] * train + ["val"] * val + ["test"] * test
    with CorpusWriter(folder, source="made", configuration={"matters": matters}) as writer:
        for episode, split in enumerate(splits):
            writer.add(scene(episode, matters=matters), split=split)
        return writer.finish()


class Told:
    """Judges that know each driver's style from elsewhere: what was commanded, or what it will do."""

    classes = STYLES

    def __init__(self, corpus: Corpus, *, leaks: bool) -> None:
        self._style: dict[tuple[str, str], int] = {}
        for one in corpus:
            future = one.tracks.velocity_mps[:, -1, 0] < one.tracks.velocity_mps[:, 0, 0]
            for i, agent in enumerate(one.tracks.agent_id):
                driver = one.tracks.driver[i]
                assert driver is not None
                self._style[one.scene_id, agent] = int(future[i]) if leaks else STYLES.index(driver.name)

    def measure(self, history: Scene, agent_index: np.ndarray) -> Measured:
        names = [history.tracks.agent_id[i] for i in agent_index]
        style = np.array([self._style[history.scene_id, name] for name in names], np.int64)
        return Measured(style, np.ones((len(style), 4)), np.zeros(len(style), np.int64))

    def to_dict(self) -> Mapping[str, Any]:
        return {"told": len(self._style)}
