"""KDSC: kinematic driving style clustering: two clusters of tracks by four kinematic features."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Int

from stylesim.errors import InputError
from stylesim.labelers.base import Progress
from stylesim.labelers.drivers import driver_samples
from stylesim.labelers.features import KDSC_FEATURES
from stylesim.labelers.judging import margin
from stylesim.labelers.kdsc_model import (
    CLUSTERED_FROM,
    Clusterer,
    SpanModel,
    cluster_tracks,
    clustered,
    fit_history,
    jerk_scale,
)
from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.provenance import Witness, content_hash
from stylesim.labelers.rows import DriverRows
from stylesim.labelers.spans import fitted_length, rows_of
from stylesim.labels import UNDETERMINED, LabelFlag, StyleLabels
from stylesim.scene import Scene

SCHEMA = 1
FEATURE_NAMES = (*(name for name in KDSC_FEATURES if name != "std_jerk"), "gamma")


class KDSC:
    """The labeller. `fit` clusters at most `max_tracks` drivers (chosen: Ward holds their pairwise distances, for
    10,000 drivers 0.4 GB twice); a new track takes the nearest cluster's name.

    Args (stored untouched): `clusterer`, anything with `fit_predict`; None is Ward's agglomerative clustering into
    len(names) clusters. `names`: of the clusters, from the highest mean standardised feature to the lowest.
    Learned: `track_model_`, `history_models_` (the same drivers' clusters seen through windows of that length),
    `agreement_`: share of the fitted drivers whose nearest centroid is their own cluster's; `provenance_`.
    """

    method = "kdsc"

    def __init__(
        self,
        *,
        options: FeatureOptions | None = None,
        history_s: Sequence[float] = (5.0,),
        clusterer: Clusterer | None = None,
        names: Sequence[str] = ("aggressive", "normal"),
        max_tracks: int = 10_000,
        seed: int = 0,
    ) -> None:
        self.options = FeatureOptions() if options is None else options
        self.history_s = history_s
        self.clusterer = clusterer
        self.names = names
        self.max_tracks = max_tracks
        self.seed = seed

    def fit(self, scenes: Iterable[Scene], *, progress: Progress | None = None) -> KDSC:
        """Cluster one mean per driver of these scenes.

        InputError if there are too few drivers, or the clusterer finds another number of clusters than `names`.
        """
        witness = Witness(scenes, progress)
        lengths = (self.options.window_s, *self.history_s)
        samples = driver_samples(witness, lengths, self.options, max_drivers=self.max_tracks, seed=self.seed)
        clusterer = _ward(len(self.names)) if self.clusterer is None else self.clusterer
        tracks, cluster_of = cluster_tracks(samples[0], clusterer, len(self.names), length_s=lengths[0])
        self.track_model_: SpanModel = tracks
        self.history_models_: tuple[SpanModel, ...] = tuple(
            fit_history(sample, cluster_of, len(self.names), length_s=length)
            for sample, length in zip(samples[1:], lengths[1:], strict=True)
        )
        self.agreement_ = tracks.agreement
        self.provenance_: dict[str, Any] = witness.provenance() | {"clusterer": repr(clusterer)}
        return self

    def label_windows(
        self,
        scene: Scene,
        starts: Sequence[int] | None = None,
        length_steps: int | None = None,
        *,
        span: str = "track",
        agents: Int[np.ndarray, " driver"] | None = None,
    ) -> StyleLabels:
        """Labels of one scene; see `base.Labeler.label_windows`."""
        self._need_fit()
        return self.judge(rows_of(scene, self.options, starts, length_steps, span=span, agents=agents))

    def judge(self, rows: DriverRows) -> StyleLabels:
        """Class of the nearest centroid. The scores are negative distances in standardised features.

        `aggressiveness` is the mean standardised clustering feature, by which the clusters are ordered [ours].
        """
        self._need_fit()
        model = self.track_model_ if rows.span == "track" else fitted_length(self.history_models_, rows.length_s)
        highway = rows.flagged(LabelFlag.HIGHWAY)
        standard = model.standardised(clustered(rows.columns(CLUSTERED_FROM), highway, model.jerk_scale_mps3))
        known = np.isfinite(standard).all(axis=1)
        score = -model.distances(standard)
        feature = rows.columns(KDSC_FEATURES)
        gamma = feature[:, -1:] / jerk_scale(model.jerk_scale_mps3, highway)[:, None]
        feature = np.concatenate([feature[:, :-1], gamma], axis=1)
        best = np.where(known[:, None], score, -np.inf).argmax(axis=1)
        return StyleLabels(
            method=self.method,
            span=rows.span,
            classes=tuple(self.names),
            feature_names=FEATURE_NAMES,
            scene_id=rows.scene_id,
            agent_id=rows.agent_id,
            start_frame=rows.start_frame,
            stop_frame=rows.stop_frame,
            score=score.astype(np.float32),
            style=np.where(known, best, UNDETERMINED).astype(np.int8),
            margin=margin(score).astype(np.float32),
            aggressiveness=standard.mean(axis=1).astype(np.float32),
            feature=feature.astype(np.float32),
            missing=~np.isfinite(feature),
            flags=rows.flags,
            provenance=self._label_provenance() | {"length_s": rows.length_s, "agreement": model.agreement},
        )

    @property
    def hash_(self) -> str:
        """sha256 over everything that decides a label."""
        return content_hash(self.to_dict())

    def to_dict(self) -> dict[str, Any]:
        """Parameters and models as JSON-able values; of the clusterer only its name. InputError before `fit`."""
        self._need_fit()
        return {
            "labeler": "kdsc",
            "schema": SCHEMA,
            "options": self.options.to_dict(),
            "history_s": list(self.history_s),
            "names": list(self.names),
            "max_tracks": self.max_tracks,
            "seed": self.seed,
            "track_model": self.track_model_.to_dict(),
            "history_models": [model.to_dict() for model in self.history_models_],
            "provenance": self.provenance_,
        }

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> KDSC:
        """The labeller that `to_dict` described; it judges as before, a new `fit` would use the default clusterer.

        InputError if it is another labeller's, of another schema, or incomplete.
        """
        if raw.get("labeler") != "kdsc" or raw.get("schema") != SCHEMA:
            raise InputError(
                f"this is not a KDSC labeller of schema {SCHEMA}: it says labeler = {raw.get('labeler')!r}, "
                f"schema = {raw.get('schema')!r}"
            )
        try:
            made = cls(
                options=FeatureOptions.from_dict(raw["options"]),
                history_s=tuple(raw["history_s"]),
                names=tuple(raw["names"]),
                max_tracks=raw["max_tracks"],
                seed=raw["seed"],
            )
            made.track_model_ = SpanModel.from_dict(raw["track_model"])
            made.history_models_ = tuple(SpanModel.from_dict(m) for m in raw["history_models"])
            made.agreement_ = made.track_model_.agreement
            made.provenance_ = dict(raw["provenance"])
        except KeyError as error:
            raise InputError(f"the KDSC labeller has no {error}") from None
        return made

    def _label_provenance(self) -> dict[str, Any]:
        return {
            "labeler": "kdsc",
            "labeler_sha256": self.hash_,
            "options": self.options.to_dict(),
            "fitted_on": self.provenance_,
        }

    def _need_fit(self) -> None:
        if not hasattr(self, "track_model_"):
            raise InputError(
                "this KDSC has no clusters yet: call fit(reference scenes), or take "
                'stylesim.labelers.reference.default_labeler("kdsc")'
            )


def _ward(clusters: int) -> Clusterer:
    from sklearn.cluster import AgglomerativeClustering

    ward: Clusterer = AgglomerativeClustering(n_clusters=clusters, linkage="ward")
    return ward
