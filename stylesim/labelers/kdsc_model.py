"""What KDSC learns for windows of one length: the scale of jerk, the standardisation, the centroids."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float64, Int

from stylesim.errors import InputError
from stylesim.labelers.drivers import DriverSample
from stylesim.labelers.features import FEATURES
from stylesim.labelers.scaler import LEAST_DRIVERS

# The four features that are clustered [paper]; gamma is made from the window's standard deviation of jerk.
CLUSTERED = ("max_abs_acceleration", "var_acceleration", "var_speed", "gamma")
CLUSTERED_FROM = ("max_abs_acceleration", "var_acceleration", "var_speed", "std_jerk")


@runtime_checkable
class Clusterer(Protocol):
    """Anything of scikit-learn that clusters: AgglomerativeClustering, KMeans, GaussianMixture, …"""

    def fit_predict(self, X: Float64[np.ndarray, "driver 4"], /) -> Int[np.ndarray, " driver"]:
        """The cluster of each row."""
        ...


@dataclass(frozen=True, eq=False)
class SpanModel:
    """The model of windows of one length. Clusters are ordered from the highest mean standardised feature."""

    length_s: float
    jerk_scale_mps3: Float64[np.ndarray, " 2"]  # mean |jerk| of the reference population: non-highway, highway
    mean: Float64[np.ndarray, " 4"]
    sd: Float64[np.ndarray, " 4"]
    centroid: Float64[np.ndarray, "cluster 4"]  # standardised
    size: tuple[int, ...]  # drivers in each cluster
    agreement: float  # share of the drivers whose nearest centroid is their own cluster's

    def standardised(self, value: Float64[np.ndarray, "row 4"]) -> Float64[np.ndarray, "row 4"]:
        """Features in standard deviations from the reference population's mean."""
        return (value - self.mean) / self.sd

    def distances(self, standard: Float64[np.ndarray, "row 4"]) -> Float64[np.ndarray, "row cluster"]:
        """Euclidean distance to each centroid; NaN where a feature is."""
        squared = np.zeros((len(standard), len(self.centroid)))
        for i in range(standard.shape[1]):
            squared += (standard[:, i : i + 1] - self.centroid[None, :, i]) ** 2
        return np.sqrt(squared)

    def to_dict(self) -> dict[str, Any]:
        """As JSON-able values."""
        arrays = {n: getattr(self, n).tolist() for n in ("jerk_scale_mps3", "mean", "sd", "centroid")}
        return {"length_s": self.length_s, "size": list(self.size), "agreement": self.agreement} | arrays

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> SpanModel:
        """From what `to_dict` gave; InputError if something is missing."""
        try:
            arrays = {n: np.array(raw[n], np.float64) for n in ("jerk_scale_mps3", "mean", "sd", "centroid")}
            return cls(
                length_s=float(raw["length_s"]), size=tuple(raw["size"]), agreement=float(raw["agreement"]), **arrays
            )
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"this is not a KDSC model: {type(error).__name__} {error}") from None


def jerk_scale(scale: Float64[np.ndarray, " 2"], highway: Bool[np.ndarray, " row"]) -> Float64[np.ndarray, " row"]:
    """Mean |jerk| of the context of each row, m/s3."""
    return scale[highway.astype(np.int64)]


def clustered(
    value: Float64[np.ndarray, "row 4"], highway: Bool[np.ndarray, " row"], scale: Float64[np.ndarray, " 2"]
) -> Float64[np.ndarray, "row 4"]:
    """CLUSTERED from CLUSTERED_FROM: gamma = sd of jerk / mean |jerk| of the context (Murphey et al. 2009) [recalled].

    The denominator is the reference population's in the same context [ours].
    """
    return np.concatenate([value[:, :-1], value[:, -1:] / jerk_scale(scale, highway)[:, None]], axis=1)


def _jerk_scales(sample: DriverSample) -> Float64[np.ndarray, " 2"]:
    """Mean over drivers of mean |jerk|, per context; a context of too few drivers borrows everybody's."""
    jerk = sample.value[:, FEATURES.index("j_l")]
    known = np.isfinite(jerk)
    own = [known & (sample.highway == highway) for highway in (False, True)]
    return np.array([float(jerk[c if c.sum() >= LEAST_DRIVERS else known].mean()) for c in own])


def _known(
    sample: DriverSample, order_of: Mapping[tuple[str, str], int] | None, length_s: float, least: int
) -> tuple[Float64[np.ndarray, "driver 4"], list[tuple[str, str]], Float64[np.ndarray, " 2"]]:
    """Clustering features of the drivers whose features are all known (and that are in `order_of`, where given)."""
    known = np.isfinite(sample.value[:, [FEATURES.index(name) for name in CLUSTERED_FROM]]).all(axis=1)
    if order_of is not None:
        known &= np.array([name in order_of for name in sample.name], bool)
    if known.sum() < least:
        raise InputError(
            f"cannot cluster: {int(known.sum())} drivers have a full window of {length_s:g} s, {least} are needed. "
            "Fit on more or longer scenes, or choose shorter windows (FeatureOptions.window_s, history_s)."
        )
    scale = np.maximum(_jerk_scales(sample), 1e-9)
    raw = sample.value[known][:, [FEATURES.index(name) for name in CLUSTERED_FROM]]
    names = [name for name, keep in zip(sample.name, known, strict=True) if keep]
    return clustered(raw, sample.highway[known], scale), names, scale


def _finished(
    value: Float64[np.ndarray, "driver 4"],
    cluster: Int[np.ndarray, " driver"],
    clusters: int,
    scale: Float64[np.ndarray, " 2"],
    length_s: float,
) -> SpanModel:
    mean, sd = value.mean(axis=0), np.maximum(value.std(axis=0), 1e-9)
    standard = (value - mean) / sd
    centroid = np.stack([standard[cluster == k].mean(axis=0) for k in range(clusters)])
    size = tuple(int((cluster == k).sum()) for k in range(clusters))
    model = SpanModel(length_s, scale, mean, sd, centroid, size, float("nan"))
    nearest = model.distances(standard).argmin(axis=1)
    return SpanModel(length_s, scale, mean, sd, centroid, size, float((nearest == cluster).mean()))


def cluster_tracks(
    sample: DriverSample, clusterer: Clusterer, clusters: int, *, length_s: float
) -> tuple[SpanModel, dict[tuple[str, str], int]]:
    """Cluster a sample; the model, and the cluster of each driver.

    InputError if there are fewer drivers than twice the clusters, or the clusterer finds another number of them.
    """
    value, names, scale = _known(sample, None, length_s, 2 * clusters)
    standard = (value - value.mean(axis=0)) / np.maximum(value.std(axis=0), 1e-9)
    found = np.unique(np.asarray(clusterer.fit_predict(standard)), return_inverse=True)[1]
    if found.max() + 1 != clusters:
        raise InputError(f"the clusterer found {found.max() + 1} clusters for {clusters} names: give as many names")
    level = np.array([standard[found == k].mean() for k in range(clusters)])
    place = np.empty(clusters, np.int64)
    place[np.argsort(-level, kind="stable")] = np.arange(clusters)
    cluster = place[found]
    model = _finished(value, cluster, clusters, scale, length_s)
    return model, {name: int(k) for name, k in zip(names, cluster, strict=True)}


def fit_history(
    sample: DriverSample, cluster_of: Mapping[tuple[str, str], int], clusters: int, *, length_s: float
) -> SpanModel:
    """The same drivers' clusters seen through windows of another length: own scale, own centroids [ours].

    Clustering anew would give the names another meaning for each length.
    """
    value, names, scale = _known(sample, cluster_of, length_s, clusters)
    cluster = np.array([cluster_of[name] for name in names], np.int64)
    if len(np.unique(cluster)) != clusters:
        raise InputError(f"no driver of some cluster has a full window of {length_s:g} s; fit on more scenes")
    return _finished(value, cluster, clusters, scale, length_s)
