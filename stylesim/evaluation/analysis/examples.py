"""Tracks to look at: for each KDSC cluster of a corpus the driver that stands out, and one from its middle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import polars as pl
from jaxtyping import Float64

from stylesim.corpus import Corpus
from stylesim.evaluation.analysis.clusters import CLUSTERS, Clustered
from stylesim.scene import Scene

MOST_S = 11.0  # a window of the track labels
LEAST_SPEED_MPS = 3.0  # chosen: a track that hardly moves shows no driving
AROUND_M = 25.0  # chosen: lanes are drawn so far around the track


@dataclass(frozen=True, eq=False)
class Example:
    """One driver's track, 0.1 s apart, and the centre lines of the lanes around it."""

    corpus: str
    cluster: str
    tdbm: str
    scene_id: str
    agent_id: str
    time_s: Float64[np.ndarray, " step"]
    position_m: Float64[np.ndarray, "step 2"]
    speed_mps: Float64[np.ndarray, " step"]
    heading_rad: float  # at the first step
    size_m: tuple[float, float]
    lanes_m: tuple[Float64[np.ndarray, "point 2"], ...]


def examples(corpus: Corpus, name: str, found: Clustered) -> tuple[Example, ...]:
    """One per cluster: of the bold the one with the greatest level, of the normal the one nearest the centroid."""
    chosen = []
    moving = found.drivers.filter((pl.col("mean_speed") >= LEAST_SPEED_MPS) & (pl.col("tracks") == 1))
    for cluster in CLUSTERS:
        own = moving.filter(pl.col("kdsc") == cluster)
        if own.height:
            bold = cluster == CLUSTERS[0]
            ranked = own.sort(["level" if bold else "centre", "unit_id", "agent_id"], descending=[bold, False, False])
            row = ranked.row(0, named=True)
            chosen.append(_example(corpus.scene(row["scene_id"]), name, cluster, row["tdbm"], row["agent_id"]))
    return tuple(chosen)


def _example(scene: Scene, name: str, cluster: str, tdbm: str, agent_id: str) -> Example:
    tracks = scene.tracks
    agent = tracks.agent_id.index(agent_id)
    frames = np.flatnonzero(tracks.valid[agent])
    speed = np.linalg.norm(tracks.velocity_mps[agent], axis=1)
    # The stretch of 11 s in which the speed changes most: where there is something to see.
    steps = min(len(frames), round(MOST_S / tracks.dt_s))
    spread = [float(np.ptp(speed[frames[i : i + steps]])) for i in range(len(frames) - steps + 1)]
    frames = frames[int(np.argmax(spread)) :][:steps]
    place = tracks.position_m[agent, frames].astype(np.float64)
    low, high = place.min(axis=0) - AROUND_M, place.max(axis=0) + AROUND_M
    lanes = [] if scene.road is None else [np.asarray(lane.centre_line_m, np.float64) for lane in scene.road.lanes]
    near = tuple(line for line in lanes if _passes(line, low, high))
    return Example(
        corpus=name,
        cluster=cluster,
        tdbm=tdbm,
        scene_id=scene.scene_id,
        agent_id=agent_id,
        time_s=(frames - frames[0]) * tracks.dt_s,
        position_m=place,
        speed_mps=speed[frames].astype(np.float64),
        heading_rad=float(tracks.heading_rad[agent, frames[0]]),
        size_m=(float(tracks.size_m[agent, 0]), float(tracks.size_m[agent, 1])),
        lanes_m=near,
    )


def _passes(
    line: Float64[np.ndarray, "point 2"], low: Float64[np.ndarray, " 2"], high: Float64[np.ndarray, " 2"]
) -> bool:
    """True where a piece of the line may cross the box: a straight lane has points at its two ends only."""
    first, second = np.minimum(line[:-1], line[1:]), np.maximum(line[:-1], line[1:])
    return bool(((second >= low) & (first <= high)).all(axis=1).any())
