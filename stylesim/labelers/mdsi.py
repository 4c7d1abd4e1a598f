"""MDSI: the style that a driver says of himself, from 44 answers; an estimator like TDBM and KDSC.

It judges no track. It is a labeller so that self-reported styles can be crossed with measured ones, driver by driver.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int, Int32

from stylesim.errors import InputError, unknown
from stylesim.labelers.base import Progress
from stylesim.labelers.judging import margin
from stylesim.labelers.mdsi_key import FACTORS, STYLES, factor_scores, style_scores
from stylesim.labelers.mdsi_rows import history_rows, track_rows
from stylesim.labelers.provenance import content_hash
from stylesim.labelers.spans import SPANS
from stylesim.labels import UNDETERMINED, StyleLabels
from stylesim.questionnaire import N_ITEMS, answers_of, checked_answers
from stylesim.scene import Scene

SCHEMA = 1
NORMS = ("none", "sample")
MIN_NORM_DRIVERS = 10  # chosen: a standard deviation of fewer drivers is off by a quarter or more
TIE = 1e-9  # means of whole numbers that differ by less are the same

Answers = Mapping[str, Sequence[float | None]]


class MDSI:
    """The labeller. A driver's class is the broad style with the greatest score; a tie for it is undetermined.

    Args (stored untouched): `answers`, participant (agent id) to 44 answers in the order of the items, None or NaN
    where one is missing; None: those that the scenes carry (see `stylesim.questionnaire`). `norm`: "none" compares the
    raw means; "sample" first standardises each style over the drivers it was fitted on, because most people agree
    with the patient and careful items most. `least_share`: of a factor's items that must be answered [ours: half].
    Learned by `fit`: `mean_`, `deviation_` of each style (norm "sample"), `provenance_`.
    """

    method = "mdsi"

    def __init__(
        self,
        *,
        answers: Answers | None = None,
        norm: str = "none",
        least_share: float = 0.5,
        history_s: Sequence[float] = (1.1, 2.0, 5.0),
    ) -> None:
        self.answers = answers
        self.norm = norm
        self.least_share = least_share
        self.history_s = history_s

    def fit(self, scenes: Iterable[Scene], *, progress: Progress | None = None) -> MDSI:
        """Learn the norm from the answers of the drivers in these scenes, each driver once.

        InputError for options that make no sense, answers that are none, or too few drivers for a norm.
        """
        if self.norm not in NORMS:
            raise unknown("norm", self.norm, NORMS)
        if not 0 < self.least_share <= 1:
            raise InputError(f"least_share is a share above 0 and at most 1, not {self.least_share:g}")
        found: dict[tuple[str, str], Float64[np.ndarray, " item"]] = {}
        seen = 0
        for seen, scene in enumerate(scenes, start=1):
            for agent_id in scene.tracks.agent_id:
                given = self._answers_of(scene, agent_id)
                if given is not None:
                    found.setdefault((scene.source, agent_id), given)
            if progress is not None:
                progress(seen, 0)
        self.mean_, self.deviation_ = np.zeros(len(STYLES)), np.ones(len(STYLES))
        if self.norm == "sample":
            if len(found) < MIN_NORM_DRIVERS:
                raise InputError(f"{len(found)} drivers with answers; a norm needs {MIN_NORM_DRIVERS} or more")
            scores = style_scores(np.stack(list(found.values())), self.least_share)
            if (np.isfinite(scores).sum(axis=0) < MIN_NORM_DRIVERS).any():
                raise InputError(f"fewer than {MIN_NORM_DRIVERS} drivers have answered enough items of some style")
            self.mean_, self.deviation_ = np.nanmean(scores, axis=0), np.nanstd(scores, axis=0, ddof=1)
            if (self.deviation_ < TIE).any():
                raise InputError("all drivers have the same score of some style; there is no norm")
        self.provenance_: dict[str, Any] = {"scenes": seen, "drivers_with_answers": len(found)}
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
        """Labels of one scene; see `base.Labeler.label_windows`. Drivers without answers are undetermined.

        A history label is the same answer, given before any drive; it is undetermined for a driver unknown at t0.
        """
        if not hasattr(self, "mean_"):
            raise InputError("this MDSI has no norm yet: call fit(scenes) first")
        if span not in SPANS:
            raise unknown("span", span, SPANS)
        if span == "track":
            return self._judged(scene, span, *track_rows(scene, agents))
        if starts is None or length_steps is None or not len(starts):
            raise InputError("history labels need the starts of their windows and length_steps")
        return self._judged(scene, span, *history_rows(scene, starts, length_steps, agents))

    def _judged(
        self,
        scene: Scene,
        span: str,
        agent: Int[np.ndarray, " row"],
        first: Int32[np.ndarray, " row"],
        stop: Int32[np.ndarray, " row"],
        known: Bool[np.ndarray, " row"],
    ) -> StyleLabels:
        missing = np.full(N_ITEMS, np.nan)
        given = {i: self._answers_of(scene, scene.tracks.agent_id[i]) for i in np.unique(agent).tolist()}
        rows = [given[i] if there else None for i, there in zip(agent.tolist(), known.tolist(), strict=True)]
        answers = np.array([missing if row is None else row for row in rows]).reshape(-1, N_ITEMS)
        score = (style_scores(answers, self.least_share) - self.mean_) / self.deviation_
        feature = factor_scores(answers, self.least_share)
        complete = np.asarray(np.isfinite(score).all(axis=1))
        best = np.where(complete[:, None], score, -np.inf).argmax(axis=1)
        gap = margin(np.where(complete[:, None], score, np.nan))
        sure = complete & (gap > TIE)
        reckless, _, angry, patient = score.T
        return StyleLabels(
            method=self.method,
            span=span,
            classes=tuple(STYLES),
            feature_names=tuple(FACTORS),
            scene_id=(scene.scene_id,) * len(agent),
            agent_id=tuple(scene.tracks.agent_id[i] for i in agent.tolist()),
            start_frame=first,
            stop_frame=stop,
            score=score.astype(np.float32),
            style=np.where(sure, best, UNDETERMINED).astype(np.int8),
            margin=gap.astype(np.float32),
            # What he says of speed, risk and anger against what he says of patience and care [ours].
            aggressiveness=np.where(sure, (reckless + angry) / 2 - patient, np.nan).astype(np.float32),
            feature=feature.astype(np.float32),
            missing=~np.isfinite(feature),
            flags=np.zeros(len(agent), np.int32),
            provenance={"labeler": "mdsi", "labeler_sha256": self.hash_, "fitted_on": self.provenance_},
        )

    def _answers_of(self, scene: Scene, agent_id: str) -> Float64[np.ndarray, " item"] | None:
        if self.answers is None:
            found = answers_of(scene.parameters, agent_id)
        else:
            raw = self.answers.get(agent_id)
            found = None if raw is None else np.array([np.nan if v is None else v for v in raw], np.float64)
        return None if found is None else checked_answers(found, where=f"participant {agent_id!r}")

    @property
    def hash_(self) -> str:
        """sha256 over everything that decides a label."""
        return content_hash(self.to_dict())

    def to_dict(self) -> dict[str, Any]:
        """Parameters and the norm as JSON-able values. InputError before `fit`."""
        if not hasattr(self, "mean_"):
            raise InputError("this MDSI has no norm yet: call fit(scenes) first")
        plain = None
        if self.answers is not None:
            plain = {who: [_plain(v) for v in values] for who, values in sorted(self.answers.items())}
        return {
            "labeler": "mdsi",
            "schema": SCHEMA,
            "answers": plain,
            "norm": self.norm,
            "least_share": self.least_share,
            "history_s": list(self.history_s),
            "mean": self.mean_.tolist(),
            "deviation": self.deviation_.tolist(),
            "provenance": self.provenance_,
        }

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> MDSI:
        """The labeller that `to_dict` described. InputError if it is another's, of another schema, or incomplete."""
        if raw.get("labeler") != "mdsi" or raw.get("schema") != SCHEMA:
            raise InputError(
                f"this is not an MDSI labeller of schema {SCHEMA}: it says labeler = {raw.get('labeler')!r}, "
                f"schema = {raw.get('schema')!r}"
            )
        try:
            made = cls(
                answers=raw["answers"],
                norm=raw["norm"],
                least_share=raw["least_share"],
                history_s=tuple(raw["history_s"]),
            )
            made.mean_, made.deviation_ = np.array(raw["mean"]), np.array(raw["deviation"])
            made.provenance_ = dict(raw["provenance"])
        except KeyError as error:
            raise InputError(f"the MDSI labeller has no {error}") from None
        return made


def _plain(value: float | None) -> float | None:
    return None if value is None or np.isnan(value) else float(value)
