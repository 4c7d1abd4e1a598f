"""A small written corpus with labels, made of plain arrays: cars on straight lanes, some of which stand or brake."""

from __future__ import annotations

import numpy as np

from stylesim.corpus import CorpusWriter
from stylesim.forecast import Forecast
from stylesim.labels import LabelFlag, StyleLabels
from stylesim.road import Lane, Road
from stylesim.scene import Scene
from stylesim.signals import Signals
from stylesim.style import STYLE_CLASSES
from stylesim.styles import style_table
from stylesim.tracks import AgentKind, TrackFlag, Tracks

DT_S = 0.1
FRAMES = 150


def lane(y: float, number: int) -> Lane:
    line = np.stack([np.linspace(-50, 300, 50), np.full(50, y)], axis=1)
    return Lane(f"lane{number}", line, width_m=3.5, stop_line_m=np.array([[150.0, y - 1.7], [150.0, y + 1.7]]))


def scene(episode: int, agents: int = 6, *, source: str = "sumo", scene_id: str = "") -> Scene:
    """Car i drives at its own speed and acceleration; car 0 stands; the last "agent" is a pedestrian."""
    rng = np.random.default_rng(episode)
    t = np.arange(FRAMES) * DT_S
    v0, acc = rng.uniform(8, 14, agents), rng.uniform(-0.4, 0.4, agents)
    v0[0] = acc[0] = 0.0
    speed = v0[:, None] + acc[:, None] * t
    x = rng.uniform(0, 40, agents)[:, None] + v0[:, None] * t + acc[:, None] * t**2 / 2
    y = np.repeat((np.arange(agents) % 3 * 3.5)[:, None], FRAMES, axis=1)
    valid = np.ones((agents, FRAMES), bool)
    valid[1, 120:] = False  # its last future is incomplete
    position = np.where(valid[..., None], np.stack([x, y], axis=-1), np.nan)
    velocity = np.where(valid[..., None], np.stack([speed, 0 * speed], axis=-1), np.nan)
    kind = np.full(agents, AgentKind.CAR)
    kind[-1] = AgentKind.PEDESTRIAN
    knob = (1.0, 0.6, 0.2, -0.2, -0.6, -1.0)
    simulated = source == "sumo"
    styles = tuple(style_table().at(knob[(episode + i) % 6]) if i < agents - 1 else None for i in range(agents))
    flags = np.where(np.arange(agents) % 2, TrackFlag.DECIDED_GO, TrackFlag.DECIDED_STOP).astype(np.int32)
    tracks = Tracks(
        agent_id=tuple(f"car{i}" for i in range(agents)),
        kind=kind,
        size_m=np.tile([4.5, 1.8], (agents, 1)),
        position_m=position,
        velocity_mps=velocity,
        heading_rad=np.where(valid, 0.0, np.nan),
        valid=valid,
        dt_s=DT_S,
        driver=styles if simulated else (),
        flags=flags if simulated else None,
    )
    state = np.full((1, FRAMES), 2)
    state[:, 40:70], state[:, 70:] = 3, 4
    return Scene(
        scene_id=scene_id or f"{source}-{episode:03d}",
        unit_id=f"{source}-episode{episode:03d}",
        source=source,
        scenario="yellow_light" if episode % 2 else "straight",
        tracks=tracks,
        road=Road(tuple(lane(3.5 * i, i) for i in range(3))),
        signals=Signals(("light",), (("lane0", "lane1", "lane2"),), state),
    )


def labels(scenes: list[Scene], span: str, *, anchors: tuple[int, ...] = ()) -> StyleLabels:
    """The commanded class one step calmer for the track, the commanded class itself for the history."""
    rows = [
        (s, agent, stop)
        for s in scenes
        for agent in np.flatnonzero(s.tracks.is_motor).tolist()
        for stop in ([a + 1 for a in anchors] if span == "history" else [s.tracks.n_frames])
    ]
    n = len(rows)
    style = np.zeros(n, np.int8)
    for row, (s, agent, _) in enumerate(rows):
        driver = s.tracks.driver[agent]
        place = agent % 6 if driver is None else STYLE_CLASSES.index(driver.name)
        style[row] = min(place + (span == "track"), 5)
    if span == "track":
        style[::17] = -1
    score = np.full((n, 6), -1.0)
    score[np.arange(n), np.maximum(style, 0)] = 1.0
    transposed = np.clip(style, 1, 3)
    other = np.full((n, 6), -1.0)
    other[np.arange(n), transposed] = 1.0
    return StyleLabels(
        method="tdbm",
        span=span,
        classes=STYLE_CLASSES,
        feature_names=("v_avg",),
        scene_id=tuple(s.scene_id for s, _, _ in rows),
        agent_id=tuple(s.tracks.agent_id[agent] for s, agent, _ in rows),
        start_frame=np.zeros(n, np.int32),
        stop_frame=np.array([stop for _, _, stop in rows]),
        score=score,
        style=style,
        margin=np.linspace(0.05, 2.0, n),
        aggressiveness=np.where(style < 0, np.nan, 1.0 - 0.4 * style),
        feature=np.full((n, 1), 10.0),
        missing=np.zeros((n, 1), bool),
        flags=np.where(np.arange(n) % 4, 0, int(LabelFlag.NO_NEIGHBOURS)),
        score_transposed=other,
        style_transposed=transposed,
        provenance={"scaler": "made up", "orientation": "printed"},
    )


def write(path, scenes: list[Scene], *, split: str = "test", with_labels: bool = True):
    """The scenes as a corpus at `path`, with TDBM labels of both spans."""
    with CorpusWriter(path, source=scenes[0].source, configuration={}, seed=7) as writer:
        for one in scenes:
            writer.add(one, split=split)
        corpus = writer.finish()
    if with_labels:
        corpus.write_labels([labels(scenes, "track")])
        corpus.write_labels([labels(scenes, "history", anchors=(49, 79))])
    return corpus


class ConstantVelocity:
    """Modes that keep the last velocity times each factor; remembers what it was asked."""

    def __init__(self, factors: tuple[float, ...] = (1.0,), name: str = "constant velocity") -> None:
        self.name, self.factors, self.asked = name, factors, []

    def predict(self, tasks):
        self.asked.extend(tasks)
        return [self._one(task) for task in tasks]

    def _one(self, task) -> Forecast:
        tracks = task.scene.tracks
        ahead = np.arange(1, task.future_steps + 1) * tracks.dt_s
        where = tracks.position_m[task.agent_index, -1]
        speed = tracks.velocity_mps[task.agent_index, -1]
        modes = [where[:, None] + f * speed[:, None] * ahead[:, None] for f in self.factors]
        chance = np.full((len(where), len(modes)), 1 / len(modes))
        return Forecast(np.stack(modes, axis=1), chance)
