"""`KinematicFan`: six arcs, accelerations and turn rates fitted on the training split. What six modes alone buy."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Float64

from stylesim.errors import InputError
from stylesim.forecast import Forecast, ForecastTask
from stylesim.forecasting.baselines import future_times_s, known_at_t0
from stylesim.kinematics.smoothing import DIRECTION_MIN_SPEED_MPS
from stylesim.scene import Scene
from stylesim.windows import WindowSpec, anchor_frames, target_agents

MODES = 6
MOST_SAMPLES = 200_000  # chosen: six clusters of two numbers need no more
METRES_PER_TURN = 10.0  # a turn of 1 rad counts like 10 m along; chosen: the end of an arc at 10 m/s for 2 s


class KinematicFan:
    """Every driver leaves t0 with his speed along one of six arcs: (acceleration, turn rate) pairs, the same for all.

    The pairs are k-means centres of what drivers of the training split did over the future, clustered by where it
    brought them; probabilities are the clusters' shares. No learning from the history, no road: a model with six modes
    has to beat this, not only constant velocity.
    """

    name = "kinematic_fan"

    def __init__(self, *, seed: int = 0) -> None:
        self.seed = seed
        self.acceleration_mps2: Float64[np.ndarray, " mode"] | None = None
        self.turn_rate_radps: Float64[np.ndarray, " mode"] | None = None
        self.probability: Float64[np.ndarray, " mode"] | None = None

    def fit(self, scenes: Iterable[Scene], spec: WindowSpec) -> KinematicFan:
        """Fit on training scenes. InputError where there are fewer than six windows with a mover."""
        from sklearn.cluster import KMeans

        pairs = np.concatenate([np.zeros((0, 2)), *(_driven(scene, spec) for scene in scenes)])
        if len(pairs) < MODES:
            raise InputError(f"{self.name}: only {len(pairs)} moving drivers to fit six arcs on")
        if len(pairs) > MOST_SAMPLES:
            pairs = pairs[np.random.default_rng(self.seed).permutation(len(pairs))[:MOST_SAMPLES]]
        scale = np.array([spec.future_s**2 / 2, METRES_PER_TURN * spec.future_s])
        found = KMeans(MODES, n_init=5, random_state=self.seed).fit(pairs * scale)
        share = np.bincount(found.labels_, minlength=MODES) / len(pairs)
        order = np.argsort(-share, kind="stable")
        centre = (found.cluster_centers_ / scale)[order]
        self.acceleration_mps2, self.turn_rate_radps = centre[:, 0], centre[:, 1]
        self.probability = share[order]
        return self

    def predict(self, tasks: Sequence[ForecastTask]) -> list[Forecast]:
        """Six arcs per agent; InputError before `fit`, or if an agent is not known at t0."""
        return [self._one(task) for task in tasks]

    def _one(self, task: ForecastTask) -> Forecast:
        if self.acceleration_mps2 is None or self.turn_rate_radps is None or self.probability is None:
            raise InputError(f"{self.name} must be fitted on a training split first")
        tracks, index, t = known_at_t0(task), task.agent_index, future_times_s(task)
        start = tracks.position_m[index, -1].astype(np.float64)
        speed = tracks.speed_mps[index, -1].astype(np.float64)[:, None, None]
        velocity = tracks.velocity_mps[index, -1].astype(np.float64)
        course = np.arctan2(velocity[:, 1], velocity[:, 0])
        heading = np.where(speed[:, 0, 0] > DIRECTION_MIN_SPEED_MPS, course, tracks.heading_rad[index, -1])
        later = np.maximum(speed + self.acceleration_mps2[None, :, None] * t, 0.0)
        angle = heading[:, None, None] + self.turn_rate_radps[None, :, None] * t * (speed > DIRECTION_MIN_SPEED_MPS)
        step = later[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1) * tracks.dt_s
        path = start[:, None, None] + np.cumsum(step, axis=2)
        chance = np.broadcast_to(self.probability, path.shape[:2])
        return Forecast(path.astype(np.float32), np.array(chance, np.float32))


def _driven(scene: Scene, spec: WindowSpec) -> Float64[np.ndarray, "driver 2"]:
    """(mean acceleration, mean turn rate) over the future of every mover of a scene's windows."""
    tracks, (_, future, _) = scene.tracks, spec.steps(scene.tracks.dt_s)
    found = [np.zeros((0, 2))]
    for t0 in anchor_frames(scene, spec):
        who = target_agents(scene, t0, spec)
        path = tracks.position_m[who, t0 : t0 + 1 + future].astype(np.float64)
        length = np.linalg.norm(np.diff(path, axis=1), axis=2).sum(axis=1)
        speed = tracks.speed_mps[who, t0].astype(np.float64)
        seconds = future * tracks.dt_s
        turned = tracks.heading_rad[who, t0 + future].astype(np.float64) - tracks.heading_rad[who, t0]
        turned = np.remainder(turned + math.pi, 2 * math.pi) - math.pi
        pair = np.stack([2 * (length - speed * seconds) / seconds**2, turned / seconds], axis=1)
        found.append(pair[(length > 1.0) & np.isfinite(pair).all(axis=1)])
    return np.concatenate(found)
