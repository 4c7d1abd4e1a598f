"""A sensor's noise, fitted on recorded tracks, so that simulated ones are as noisy as they are. [ours]

Model: on each axis of the position, on each axis of the velocity, and on the heading lies a stationary
first-order autoregressive noise, n[t] = rho n[t-1] + sqrt(1 - rho^2) sd e[t]. The three are drawn apart, because
the velocity of a recording is its tracker's estimate and smoother than the differences of its positions: noise
made by differencing would make simulated tracks noisier than the recorded ones.

Fit: the residual of the recorded values to the smoother (`kinematics.Smoother`, the one that labellers use). It
is the noise seen through the filter (1 - smoother), so its first two autocovariances are known functions of rho
and sd, and are solved for them. What the smoother takes for motion (slower than about a second) is not fitted.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Float64

from stylesim.errors import InputError
from stylesim.geometry import wrap_angle
from stylesim.kinematics.smoothing import Smoother, derivatives
from stylesim.randomness import stream
from stylesim.scene import Scene

# Chosen: trackers hold a standing vehicle still (residual of the shipped recording: 1 mm); noise grows with speed
# up to this one and is then full.
FULL_NOISE_MPS = 2.0
# Chosen: a memory of 0.95 s, about the smoother's window; a slower drift does not show in its residual.
MAX_RHO = 0.9
MIN_RESIDUALS = 500  # chosen: 50 s of driving; fewer do not give an autocovariance


@dataclass(frozen=True)
class Ar1:
    """One stationary autoregressive noise at 0.1 s."""

    sd: float
    rho: float


@dataclass(frozen=True)
class NoiseModel:
    """The noise of one source: position (m), velocity (m/s), heading (rad), each per axis."""

    source: str
    position: Ar1
    velocity: Ar1
    heading: Ar1

    def to_dict(self) -> dict[str, object]:
        """The model as JSON-able values."""
        return asdict(self)


class NoiseFit:
    """Gathers residuals scene by scene; `model` solves for the noise. Holds sums only."""

    def __init__(self, source: str) -> None:
        self.source = source
        self._sums = {name: np.zeros(2) for name in ("position", "velocity", "heading")}
        self._counts = {name: np.zeros(2) for name in ("position", "velocity", "heading")}
        self._dt_s = 0.1

    def add(self, scene: Scene) -> None:
        """Add the moving motor vehicles of one scene."""
        tracks = scene.tracks
        self._dt_s = tracks.dt_s
        moving = tracks.valid & tracks.is_motor[:, None] & (np.nan_to_num(tracks.speed_mps) > FULL_NOISE_MPS)
        heading = np.unwrap(np.nan_to_num(tracks.heading_rad.astype(np.float64)), axis=1)
        for name, values in (
            ("position", tracks.position_m.astype(np.float64)),
            ("velocity", tracks.velocity_mps.astype(np.float64)),
            ("heading", heading[..., None]),
        ):
            for axis in range(values.shape[-1]):
                sums, counts = _autocovariance(values[..., axis], moving, tracks.dt_s)
                self._sums[name] += sums
                self._counts[name] += counts

    def model(self) -> NoiseModel:
        """The fitted noise. InputError where too few vehicles were seen moving."""
        if self._counts["position"][0] < MIN_RESIDUALS:
            raise InputError(
                f"too little moving traffic in {self.source} to fit its noise "
                f"({int(self._counts['position'][0])} residuals, {MIN_RESIDUALS} needed); merge without noise"
            )
        covariance = {name: self._sums[name] / np.maximum(self._counts[name], 1) for name in self._sums}
        solved = {name: _solved(*covariance[name].tolist(), dt_s=self._dt_s) for name in covariance}
        return NoiseModel(self.source, solved["position"], solved["velocity"], solved["heading"])


def fit_noise(scenes: Iterable[Scene], *, source: str) -> NoiseModel:
    """The noise of recorded scenes at 0.1 s; see the module for what is fitted and how. InputError if too few."""
    fit = NoiseFit(source)
    for scene in scenes:
        fit.add(scene)
    return fit.model()


def _residual_filter(dt_s: float) -> Float64[np.ndarray, " tap"]:
    """One minus the smoother, in the middle of a whole window."""
    smoother = Smoother()
    taps = smoother.taps(dt_s)
    # The smoother's answer in the middle of a window to a unit in each of its places.
    impulses = np.eye(taps)[..., None]
    run = np.zeros((taps, taps), np.int64)
    weights = -derivatives(impulses, run, dt_s, smoother)[:, taps // 2, 0, 0]
    weights[taps // 2] += 1
    return weights


def _autocovariance(
    values: Float64[np.ndarray, "agent time"], use: Bool[np.ndarray, "agent time"], dt_s: float
) -> tuple[Float64[np.ndarray, " 2"], Float64[np.ndarray, " 2"]]:
    """Sums and counts of residual products at lags 0 and 1, where the whole window is in use."""
    weights = _residual_filter(dt_s)
    taps = len(weights)
    if values.shape[1] <= taps:
        return np.zeros(2), np.zeros(2)
    windows = np.lib.stride_tricks.sliding_window_view(np.where(use, values, 0.0), taps, axis=1)
    whole = np.asarray(np.lib.stride_tricks.sliding_window_view(use, taps, axis=1).all(axis=-1))
    residual = np.where(whole, windows @ weights, 0.0)
    both = whole[:, 1:] & whole[:, :-1]
    sums = np.array([(residual**2).sum(), (residual[:, 1:] * residual[:, :-1])[both].sum()])
    return sums, np.array([whole.sum(), both.sum()], np.float64)


def _solved(lag0: float, lag1: float, *, dt_s: float) -> Ar1:
    """The noise whose residual has these autocovariances: rho by their ratio on a grid, sd by the first."""
    if lag0 <= 1e-12:
        return Ar1(0.0, 0.0)
    weights = _residual_filter(dt_s)
    apart = np.arange(len(weights))[:, None] - np.arange(len(weights))[None]
    grid = np.linspace(0.0, MAX_RHO, 361)
    seen = [[weights @ (rho ** np.abs(apart + lag)) @ weights for lag in (0, 1)] for rho in grid]
    ratio = np.array([one / zero for zero, one in seen])
    best = int(np.argmin(np.abs(ratio - lag1 / lag0)))
    return Ar1(sd=float(np.sqrt(lag0 / seen[best][0])), rho=float(grid[best]))


def with_noise(scene: Scene, model: NoiseModel, *, seed: int) -> Scene:
    """The scene as that sensor would have recorded it; the commanded style and the flags stay.

    Every driver has a stream of its own, keyed by (seed, unit, driver) and advanced on the unit's clock, so that
    dropping an agent, or the end of a scene, changes nobody's noise.
    """
    tracks = scene.tracks
    first = round(scene.start_s / tracks.dt_s)
    draws = np.zeros((tracks.n_agents, tracks.n_frames, 5))
    for row, agent in enumerate(tracks.agent_id):
        rng = stream(seed, 0, f"{scene.unit_id}/{agent}", "sensor-noise")
        draws[row] = rng.standard_normal((first + tracks.n_frames, 5))[first:]
    scale = np.clip(np.nan_to_num(tracks.speed_mps) / FULL_NOISE_MPS, 0.0, 1.0)[..., None]
    position = _ar1(draws[..., 0:2], model.position) * scale
    velocity = _ar1(draws[..., 2:4], model.velocity) * scale
    heading = (_ar1(draws[..., 4:5], model.heading) * scale)[..., 0]
    noisy = replace(
        tracks,
        position_m=(tracks.position_m + position).astype(np.float32),
        velocity_mps=(tracks.velocity_mps + velocity).astype(np.float32),
        heading_rad=wrap_angle(tracks.heading_rad + heading).astype(np.float32),
    )
    said: Mapping[str, float] = {**scene.parameters, "noise_position_sd_m": model.position.sd}
    return replace(scene, tracks=noisy, parameters=said)


def _ar1(draws: Float64[np.ndarray, "agent time axis"], noise: Ar1) -> Float[np.ndarray, "agent time axis"]:
    out = np.empty_like(draws)
    out[:, 0] = draws[:, 0]
    innovation = np.sqrt(1 - noise.rho**2)
    for t in range(1, draws.shape[1]):
        out[:, t] = noise.rho * out[:, t - 1] + innovation * draws[:, t]
    return out * noise.sd
