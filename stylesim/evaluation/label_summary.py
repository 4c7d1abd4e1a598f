"""What the labels of a corpus look like: classes per source, what could not be judged, commanded against measured."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int64

from stylesim.corpus import Corpus
from stylesim.labels import UNDETERMINED, LabelFlag, StyleLabels
from stylesim.style import STYLE_CLASSES

FRAGILE_MARGIN = 0.25  # REFERENCE section 1: under it, 62 % of the cube's labels are fragile
RANK_CEILING = (0.79, 0.84)  # REFERENCE section 1 [computed]: Spearman of ranks even with perfect classes


@dataclass(frozen=True, eq=False)
class SourceSummary:
    """Track labels of one source. Counts are tracks (a driver in two scenes counts twice); shares are of `n`."""

    source: str
    n: int
    n_units: int
    classes: dict[str, int]  # with "undetermined"
    classes_transposed: dict[str, int]  # empty where the method has one orientation
    no_neighbours: float  # share
    no_leader: float
    clamped: float
    margin_quartiles: tuple[float, float, float]  # of the determined; NaN without one
    fragile: float  # share of the determined with a margin under FRAGILE_MARGIN

    def share(self, name: str) -> float:
        """Share of a class (or "undetermined") among the tracks."""
        return self.classes.get(name, 0) / self.n if self.n else float("nan")


@dataclass(frozen=True, eq=False)
class Confusion:
    """Commanded class (rows, the six) against measured class (columns) of simulated drivers."""

    commanded: tuple[str, ...]
    measured: tuple[str, ...]
    count: Int64[np.ndarray, "commanded measured"]
    knob_rank_correlation: float  # Spearman of the commanded knob and the measured aggressiveness; NaN under 3 drivers
    n: int

    @property
    def share(self) -> Float64[np.ndarray, "commanded measured"]:
        """Each row divided by its sum; NaN in a row without drivers."""
        total = self.count.sum(axis=1, keepdims=True)
        return np.where(total > 0, self.count / np.maximum(total, 1), np.nan)


@dataclass(frozen=True, eq=False)
class LabelSummary:
    """Labels of one method on one corpus."""

    method: str
    corpus: str
    sources: tuple[SourceSummary, ...]
    confusion: Confusion | None  # None where no labelled driver was commanded
    provenance: dict[str, Any]


def _class_counts(labels: StyleLabels, chosen: Bool[np.ndarray, " row"], *, transposed: bool) -> dict[str, int]:
    style = labels.style_transposed if transposed else labels.style
    if style is None:
        return {}
    tally = Counter(style[chosen].tolist())
    names = dict(enumerate((*labels.classes, "undetermined")))
    names[UNDETERMINED] = names.pop(len(labels.classes))
    return {name: tally.get(i, 0) for i, name in names.items()}


def _source(labels: StyleLabels, source: str, chosen: Bool[np.ndarray, " row"], n_units: int) -> SourceSummary:
    flags, determined = labels.flags[chosen], labels.style[chosen] != UNDETERMINED
    margin = labels.margin[chosen][determined]
    quartiles = np.percentile(margin, [25, 50, 75]) if len(margin) else np.full(3, np.nan)
    n = int(chosen.sum())

    def flagged(flag: LabelFlag) -> float:
        return float(((flags & int(flag)) != 0).mean()) if n else float("nan")

    return SourceSummary(
        source=source,
        n=n,
        n_units=n_units,
        classes=_class_counts(labels, chosen, transposed=False),
        classes_transposed=_class_counts(labels, chosen, transposed=True),
        no_neighbours=flagged(LabelFlag.NO_NEIGHBOURS),
        no_leader=flagged(LabelFlag.NO_LEADER),
        clamped=flagged(LabelFlag.CLAMPED),
        margin_quartiles=(float(quartiles[0]), float(quartiles[1]), float(quartiles[2])),
        fragile=float((margin < FRAGILE_MARGIN).mean()) if len(margin) else float("nan"),
    )


def _confusion(corpus: Corpus, labels: StyleLabels) -> Confusion | None:
    """Reads the commanded style from the scenes, one part at a time."""
    from scipy.stats import spearmanr

    row_of = {key: row for row, key in enumerate(zip(labels.scene_id, labels.agent_id, strict=True))}
    measured = (*labels.classes, "undetermined")
    count = np.zeros((len(STYLE_CLASSES), len(measured)), np.int64)
    knob: list[float] = []
    found: list[float] = []
    for scene in corpus:
        for agent_id, driver in zip(scene.tracks.agent_id, scene.tracks.driver, strict=True):
            row = row_of.get((scene.scene_id, agent_id))
            if driver is None or row is None or driver.name not in STYLE_CLASSES:
                continue
            count[STYLE_CLASSES.index(driver.name), int(labels.style[row])] += 1  # -1, undetermined, is the last
            if np.isfinite(labels.aggressiveness[row]):
                knob.append(driver.aggressiveness)
                found.append(float(labels.aggressiveness[row]))
    if not count.sum():
        return None
    varied = len(knob) >= 3 and np.ptp(knob) > 0 and np.ptp(found) > 0
    rank = float(spearmanr(knob, found).statistic) if varied else float("nan")
    return Confusion(STYLE_CLASSES, measured, count, rank, int(count.sum()))


def label_summary(corpus: Corpus, method: str = "tdbm") -> LabelSummary:
    """The track labels of `method` on `corpus`, per source; InputError if they have not been made."""
    labels = corpus.labels(method, "track")
    source_of = {info.scene_id: info.source for info in corpus.info}
    source = np.array([source_of.get(scene, "") for scene in labels.scene_id], dtype=object)
    units = {s: len({i.unit_id for i in corpus.info if i.source == s}) for s in source_of.values()}
    summaries = tuple(_source(labels, name, source == name, units[name]) for name in sorted(units))
    return LabelSummary(method, corpus.path.name, summaries, _confusion(corpus, labels), dict(labels.provenance))
