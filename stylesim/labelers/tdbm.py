"""TDBM: six style scores from five features (Cheung et al. 2018), the class with the highest, and the measured a."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int, Int8

from stylesim.errors import InputError, unknown
from stylesim.labelers.base import Progress
from stylesim.labelers.drivers import driver_samples
from stylesim.labelers.features import TDBM_FEATURES
from stylesim.labelers.judging import margin
from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.provenance import Witness, content_hash
from stylesim.labelers.rows import DriverRows
from stylesim.labelers.scaler import FeatureScaler, fit_scaler
from stylesim.labelers.spans import fitted_length, rows_of
from stylesim.labelers.tdbm_matrix import ORIENTATIONS, aggressiveness, scores
from stylesim.labels import UNDETERMINED, LabelFlag, StyleLabels
from stylesim.scene import Scene
from stylesim.style import STYLE_CLASSES

NO_NEIGHBOURS = ("score", "threatening", "undetermined")
SCHEMA = 1


class TDBM:
    """The labeller. `fit` makes the scalers of track windows and of every history length from a reference population.

    Args (stored untouched): `orientation` "printed" (s = B x) or "transposed" (s = B^T x, see REFERENCE section 1):
    whose scores decide the class; both are always stored. `no_neighbours`: what becomes of a driver who had none:
    "score" takes v_nei = 0, "threatening" names it so as the paper reports, "undetermined" gives no class.
    `history_s`: lengths of histories to fit. `max_drivers`, `seed`: the sample that the scaler is fitted on.
    Learned: `track_scaler_`, `history_scalers_`, `provenance_`.
    """

    def __init__(
        self,
        *,
        options: FeatureOptions | None = None,
        history_s: Sequence[float] = (5.0,),
        orientation: str = "printed",
        no_neighbours: str = "score",
        max_drivers: int = 100_000,
        seed: int = 0,
    ) -> None:
        if orientation not in ORIENTATIONS:
            raise unknown("orientation", orientation, ORIENTATIONS)
        if no_neighbours not in NO_NEIGHBOURS:
            raise unknown("policy for drivers without neighbours", no_neighbours, NO_NEIGHBOURS)
        self.options = FeatureOptions() if options is None else options
        self.history_s = history_s
        self.orientation = orientation
        self.no_neighbours = no_neighbours
        self.max_drivers = max_drivers
        self.seed = seed

    @property
    def method(self) -> str:
        """Its name in file names, another one for the other reading so that both can stand beside each other."""
        return "tdbm" if self.orientation == "printed" else "tdbm_transposed"

    def fit(self, scenes: Iterable[Scene], *, progress: Progress | None = None) -> TDBM:
        """Fit the scalers on one mean per driver of these scenes. InputError if a feature is never known."""
        witness = Witness(scenes, progress)
        lengths = (self.options.window_s, *self.history_s)
        samples = driver_samples(witness, lengths, self.options, max_drivers=self.max_drivers, seed=self.seed)
        fitted = [
            fit_scaler(sample, TDBM_FEATURES, length_s=length) for sample, length in zip(samples, lengths, strict=True)
        ]
        self.track_scaler_: FeatureScaler = fitted[0]
        self.history_scalers_: tuple[FeatureScaler, ...] = tuple(fitted[1:])
        self.provenance_: dict[str, Any] = witness.provenance()
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

    def scaler(self, span: str, length_s: float) -> FeatureScaler:
        """The scaler that judges windows of that span and length. InputError if none was fitted for it."""
        self._need_fit()
        if span == "track":
            return self.track_scaler_
        return fitted_length(self.history_scalers_, length_s)

    def judge(self, rows: DriverRows) -> StyleLabels:
        """Scores, class, margin, a and flags of rows of features."""
        value = rows.columns(TDBM_FEATURES)
        highway = rows.flagged(LabelFlag.HIGHWAY)
        scaled, clamped = self.scaler(rows.span, rows.length_s).scaled(value, highway)
        # Without any leader the gap is the cap of the scale, whatever the scale [ours].
        leaderless = (rows.flagged(LabelFlag.NO_LEADER), TDBM_FEATURES.index("s_front"))
        scaled[leaderless], clamped[leaderless] = 1.0, False
        missing = ~np.isfinite(value)
        scaled = np.where(missing, np.nan, scaled)
        printed, transposed = scores(scaled, "printed"), scores(scaled, "transposed")
        chosen = printed if self.orientation == "printed" else transposed
        undetermined = missing.any(axis=1)
        alone = rows.flagged(LabelFlag.NO_NEIGHBOURS)
        if self.no_neighbours == "undetermined":
            undetermined = undetermined | alone
        measured = np.where(undetermined, np.nan, aggressiveness(printed))
        return StyleLabels(
            method=self.method,
            span=rows.span,
            classes=STYLE_CLASSES,
            feature_names=TDBM_FEATURES,
            scene_id=rows.scene_id,
            agent_id=rows.agent_id,
            start_frame=rows.start_frame,
            stop_frame=rows.stop_frame,
            score=chosen.astype(np.float32),
            style=self._classes(chosen, undetermined, alone),
            margin=margin(chosen).astype(np.float32),
            aggressiveness=measured.astype(np.float32),
            feature=value.astype(np.float32),
            missing=missing,
            flags=rows.flags | np.where(clamped.any(axis=1), np.int32(LabelFlag.CLAMPED), np.int32(0)),
            score_transposed=transposed.astype(np.float32),
            style_transposed=self._classes(transposed, undetermined, alone),
            provenance=self._label_provenance() | {"length_s": rows.length_s},
        )

    def _classes(
        self,
        score: Float64[np.ndarray, "row style"],
        undetermined: Bool[np.ndarray, " row"],
        alone: Bool[np.ndarray, " row"],
    ) -> Int8[np.ndarray, " row"]:
        best = np.where(np.isfinite(score), score, -np.inf).argmax(axis=1)
        if self.no_neighbours == "threatening":
            best = np.where(alone, STYLE_CLASSES.index("threatening"), best)
        return np.where(undetermined, UNDETERMINED, best).astype(np.int8)

    @property
    def hash_(self) -> str:
        """sha256 over everything that decides a label."""
        return content_hash(self.to_dict())

    def to_dict(self) -> dict[str, Any]:
        """Parameters and scalers as JSON-able values. InputError before `fit`."""
        self._need_fit()
        return {
            "labeler": "tdbm",
            "schema": SCHEMA,
            "options": self.options.to_dict(),
            "history_s": list(self.history_s),
            "orientation": self.orientation,
            "no_neighbours": self.no_neighbours,
            "max_drivers": self.max_drivers,
            "seed": self.seed,
            "track_scaler": self.track_scaler_.to_dict(),
            "history_scalers": [scaler.to_dict() for scaler in self.history_scalers_],
            "provenance": self.provenance_,
        }

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> TDBM:
        """The labeller that `to_dict` described. InputError if it is another's, of another schema, or incomplete."""
        if raw.get("labeler") != "tdbm" or raw.get("schema") != SCHEMA:
            raise InputError(
                f"this is not a TDBM labeller of schema {SCHEMA}: it says labeler = {raw.get('labeler')!r}, "
                f"schema = {raw.get('schema')!r}"
            )
        try:
            made = cls(
                options=FeatureOptions.from_dict(raw["options"]),
                history_s=tuple(raw["history_s"]),
                orientation=raw["orientation"],
                no_neighbours=raw["no_neighbours"],
                max_drivers=raw["max_drivers"],
                seed=raw["seed"],
            )
            made.track_scaler_ = FeatureScaler.from_dict(raw["track_scaler"])
            made.history_scalers_ = tuple(FeatureScaler.from_dict(s) for s in raw["history_scalers"])
            made.provenance_ = dict(raw["provenance"])
        except KeyError as error:
            raise InputError(f"the TDBM labeller has no {error}") from None
        return made

    def _label_provenance(self) -> dict[str, Any]:
        return {
            "labeler": "tdbm",
            "labeler_sha256": self.hash_,
            "orientation": self.orientation,
            "no_neighbours": self.no_neighbours,
            "options": self.options.to_dict(),
            "fitted_on": self.provenance_,
        }

    def _need_fit(self) -> None:
        if not hasattr(self, "track_scaler_"):
            raise InputError(
                "this TDBM has no scaler yet: call fit(reference scenes), or take "
                'stylesim.labelers.default_labeler("tdbm")'
            )
