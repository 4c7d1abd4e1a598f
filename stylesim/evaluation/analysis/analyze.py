"""`analyze`: styles in data sets, as the paper describes them and what it leaves open, for any corpora."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from stylesim.corpus import Corpus
from stylesim.corpus.files import write_whole
from stylesim.errors import InputError, unknown
from stylesim.evaluation.analysis import clusters, kinematics, shares
from stylesim.evaluation.analysis.answers import answers
from stylesim.evaluation.analysis.clusters import Clustered
from stylesim.evaluation.analysis.examples import Example, examples
from stylesim.evaluation.analysis.judge import WITHIN, Within
from stylesim.evaluation.analysis.measure import SHORT_WINDOW_S, Measured, measured
from stylesim.evaluation.analysis.parts import parts_of
from stylesim.evaluation.analysis.sensitivity import sensitivity
from stylesim.evaluation.analysis.stability import stability
from stylesim.evaluation.intervals import MIN_DRIVERS
from stylesim.labelers.reference import default_labeler
from stylesim.labelers.tdbm import TDBM
from stylesim.version import __version__

FROZEN = ("real-reference", "sim-reference")
REFERENCES = (*FROZEN, WITHIN)
CLAMPED_SHARE = 0.5  # chosen: from here on most classes are made by the ends of a foreign scale
Tell = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class Analysis:
    """All numbers as tables (the keys are the names of the Parquet files), and the examples to draw."""

    tables: dict[str, pl.DataFrame]
    examples: tuple[Example, ...]
    about: dict[str, Any]

    def save_tables(self, folder: Path) -> list[Path]:
        """Every table as `<folder>/<name>.parquet`, each whole or not at all."""
        paths = []
        for name, table in self.tables.items():
            buffer = io.BytesIO()
            table.write_parquet(buffer, compression="zstd", row_group_size=65536)
            paths.append(folder / f"{name}.parquet")
            write_whole(paths[-1], buffer.getvalue())
        return paths


def analyze(
    corpora: Sequence[Corpus],
    *,
    reference: str = REFERENCES[0],
    by_source: bool = False,
    with_sensitivity: bool = True,
    seed: int = 0,
    progress: Tell | None = None,
) -> Analysis:
    """Measure every corpus and make every table; `progress` gets a stage's name, what is done and of how many.

    `reference`: the frozen scaler that judges TDBM, or "within": each driver is judged by a scale of the other half of
    his own corpus' drivers, so that classes compare drivers of one corpus and not corpora. `by_source`: every source
    of a merged corpus is shown by itself. InputError without a corpus, for the same corpus twice, or for an unknown
    reference.
    """
    if not corpora:
        raise InputError("analyze needs at least one corpus (`stylesim read`, `stylesim generate`)")
    prints = [one.fingerprint for one in corpora]
    if len(set(prints)) < len(prints):
        raise InputError("the same corpus was given twice; its drivers would count twice")
    if reference not in REFERENCES:
        raise unknown("reference", reference, REFERENCES)
    judge = _judge(FROZEN[0] if reference == WITHIN else reference)
    others = {name: _judge(name) for name in FROZEN if name != reference}
    names = _names(corpora)
    made: dict[str, list[pl.DataFrame]] = {}
    drawn: list[Example] = []
    about: dict[str, Any] = {}
    for corpus, name in _views(corpora, names, by_source=by_source):
        part_of, kind = parts_of(corpus, seed=seed)
        stage = _staged(progress, f"{name}: measure")
        within = reference == WITHIN
        one = measured(corpus, name, judge, within=within, part_of=part_of, parts=kind, progress=stage)
        found = clusters.clusters_of(one, seed=seed)
        for key, table in _tables(corpus, one, found, seed=seed).items():
            made.setdefault(key, []).append(table)
        if with_sensitivity:
            stage = _staged(progress, f"{name}: measure again")
            made.setdefault("sensitivity", []).append(sensitivity(corpus, name, one.judge, others, progress=stage))
        drawn += examples(corpus, name, found)
        about[name] = _about(corpus, one, found)
    tables = {key: pl.concat([t for t in parts if t.width], how="diagonal_relaxed") if any(t.width for t in parts)
              else pl.DataFrame() for key, parts in made.items()}  # fmt: skip
    return Analysis(
        {key: table for key, table in tables.items() if table.width},
        tuple(drawn),
        {
            "stylesim": __version__,
            "reference": reference,
            "labeler_sha256": "" if reference == WITHIN else judge.hash_,
            "seed": seed,
            "corpora": about,
            "warnings": _warnings(about, tables["class_shares"], tables["firmness"], reference, judge),
        },
    )


def _judge(reference: str) -> TDBM:
    labeler = default_labeler("tdbm", reference=reference)
    assert isinstance(labeler, TDBM)
    labeler.scaler("history", SHORT_WINDOW_S)  # InputError here if it cannot judge the short windows
    return labeler


def _names(corpora: Sequence[Corpus]) -> list[str]:
    names = [one.path.name for one in corpora]
    return [f"{n} ({i + 1})" if names.count(n) > 1 else n for i, n in enumerate(names)]


def _views(corpora: Sequence[Corpus], names: Sequence[str], *, by_source: bool) -> Iterator[tuple[Corpus, str]]:
    for corpus, name in zip(corpora, names, strict=True):
        sources = sorted({one.source for one in corpus.info}) if by_source else []
        if len(sources) < 2:
            yield corpus, name
            continue
        for source in sources:
            yield corpus.with_info(tuple(one for one in corpus.info if one.source == source)), f"{name}: {source}"


def _staged(progress: Tell | None, stage: str) -> Callable[[int, int], None] | None:
    return None if progress is None else lambda done, total: progress(stage, done, total)


def _tables(corpus: Corpus, one: Measured, found: Clustered, *, seed: int) -> dict[str, pl.DataFrame]:
    named = one.drivers.join(found.drivers.select("unit_id", "agent_id", "kdsc"), on=["unit_id", "agent_id"],
                             how="left", maintain_order="left")  # fmt: skip
    label = pl.lit(one.name).alias("corpus")
    return {
        "drivers": named.select(label, pl.all()),
        "windows": one.windows.select(label, pl.all()),
        "class_shares": shares.class_shares(one, seed=seed),
        "firmness": shares.firmness(one, seed=seed),
        "share_shift": shares.share_shift(one, seed=seed),
        "boxes": kinematics.boxes(one),
        "pair_tests": kinematics.pair_tests(one, seed=seed),
        "split_halves": kinematics.split_halves(one, seed=seed),
        "stability": stability(one, seed=seed),
        "kdsc_speed": clusters.speed_tests(one, found, seed=seed),
        "kdsc_tdbm": clusters.with_tdbm_classes(one, found, seed=seed),
        "mdsi_tdbm": answers(corpus, one),
    }


def _about(corpus: Corpus, one: Measured, found: Clustered) -> dict[str, Any]:
    return {
        "fingerprint": corpus.fingerprint,
        "sources": sorted({i.source for i in corpus.info}),
        "units": len({i.unit_id for i in corpus.info}),
        "scenes": len(corpus.info),
        "parts": one.parts,
        "counts": one.counts,
        "kdsc": None if found.model is None else found.model.to_dict(),
        "kdsc_fitted_on": found.fitted_on,
        "judged_within": one.judge.labelers is not None if isinstance(one.judge, Within) else None,
    }


def _warnings(
    about: dict[str, Any], shares_: pl.DataFrame, firm: pl.DataFrame, reference: str, judge: TDBM
) -> list[str]:
    """What a reader must know before the classes: a scale of the same drivers, a foreign scale, no scale at all.

    REFERENCE section 1 rules out a scaler that was fitted on the judged drivers.
    """
    fitted = set(judge.provenance_.get("sources", [])) if reference != WITHIN else set()
    found = [
        f"{name}: the scaler that judges was fitted on drivers of {', '.join(sorted(fitted & set(one['sources'])))}; "
        "if they are the same recording, its shares are partly the scaler's own percentiles."
        for name, one in about.items()
        if fitted & set(one["sources"])
    ]
    clamped = firm.filter((pl.col("figure") == "a feature clamped") & (pl.col("value") > CLAMPED_SHARE))
    judged = shares_.filter((pl.col("class") == "undetermined") & (pl.col("orientation") == "printed"))
    judged = judged.filter(pl.col("value") < CLAMPED_SHARE)
    foreign = [name for name in clamped["corpus"].to_list() if name in set(judged["corpus"].to_list())]
    if foreign and reference != WITHIN:
        found.append(
            f"{', '.join(foreign)}: most drivers have a feature beyond the range of {reference}. Their classes say how "
            "they differ from the drivers of that reference, not from one another; for that see --reference within."
        )
    unscaled = [name for name, one in about.items() if one["judged_within"] is False]
    if unscaled:
        found.append(
            f"{', '.join(unscaled)}: no scale of its own can be made (it takes {2 * MIN_DRIVERS} drivers, and lanes, "
            "neighbours and leaders); TDBM judges nobody there."
        )
    return found
