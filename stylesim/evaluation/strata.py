"""By what an evaluation is cut: scenario, source, commanded style, and the styles that labellers found."""

from __future__ import annotations

import polars as pl

from stylesim.corpus import Corpus
from stylesim.errors import InputError, unknown
from stylesim.labels import UNDETERMINED, StyleLabels

PLAIN = ("scenario", "source", "kind", "commanded")
METHODS = ("tdbm", "kdsc")  # whose columns the driver table has whenever the corpus has their labels
KNOWN = (*PLAIN, *METHODS, "tdbm:transposed", *(f"history:{m}" for m in METHODS))
DRIVER = ("unit_id", "agent_id")  # a source's track id is one person within one recording


def column_of(stratum: str) -> str:
    """The column that a stratum is read from: "tdbm" from whole tracks, "history:tdbm" from the history alone."""
    if stratum in PLAIN:
        return stratum
    kind, _, method = stratum.rpartition(":")
    return f"style_cond_{method}" if kind == "history" else f"style_strat_{stratum.replace(':', '.')}"


def parts_of(by: str) -> tuple[str, ...]:
    """The strata that are crossed in one `by`: "tdbm*scenario" -> ("tdbm", "scenario")."""
    return tuple(part.strip() for part in by.split("*"))


def title_of(by: str) -> str:
    """A stratum in words, for headings: "history:tdbm" -> "TDBM class of the history"."""

    def one(stratum: str) -> str:
        first, _, second = stratum.partition(":")
        if stratum in PLAIN:
            return "commanded style" if stratum == "commanded" else stratum
        if first == "history":
            return f"{second.upper()} class of the history"
        return f"{first.upper()} class of the track" + (f" ({second})" if second else "")

    return " × ".join(one(part) for part in parts_of(by))


def _names(labels: StyleLabels, *, transposed: bool) -> list[str]:
    style = labels.style_transposed if transposed else labels.style
    if style is None:
        raise InputError(f"{labels.method} labels have one orientation only; ask for {labels.method!r}")
    names = dict(enumerate(labels.classes)) | {UNDETERMINED: "undetermined"}
    return [names[int(i)] for i in style]


def label_frame(labels: StyleLabels, *, transposed: bool = False) -> pl.DataFrame:
    """The class of each label row with what it is joined by."""
    return pl.DataFrame(
        {
            "scene_id": list(labels.scene_id),
            "agent_id": list(labels.agent_id),
            "t0_frame": labels.stop_frame - 1,
            "style": _names(labels, transposed=transposed),
            "margin": labels.margin,
        },
        schema_overrides={"scene_id": pl.String, "agent_id": pl.String, "style": pl.String, "t0_frame": pl.Int32},
    )


def with_track_style(
    windows: pl.DataFrame, labels: StyleLabels, column: str, *, transposed: bool = False
) -> pl.DataFrame:
    """`windows` with the class of the whole driver: of several scenes, the class that most of his windows have.

    Scenes where the class is undetermined count only if all are; ties go to the larger summed margin, then by name.
    A driver that the labeller did not judge is "unlabelled".
    """
    frame = label_frame(labels, transposed=transposed).select("scene_id", "agent_id", "style", "margin")
    voted = (
        windows.select("scene_id", *DRIVER)
        .join(frame.unique(["scene_id", "agent_id"], keep="first", maintain_order=True), on=["scene_id", "agent_id"])
        .group_by([*DRIVER, "style"])
        .agg(pl.len().alias("votes"), pl.col("margin").fill_nan(0.0).sum())
        .with_columns((pl.col("style") == "undetermined").alias("last"))
        .sort([*DRIVER, "last", "votes", "margin", "style"], descending=[False, False, False, True, True, False])
        .unique(list(DRIVER), keep="first", maintain_order=True)
        .select(*DRIVER, pl.col("style").alias(column))
    )
    joined = windows.join(voted, on=list(DRIVER), how="left", maintain_order="left")
    return joined.with_columns(pl.col(column).fill_null("unlabelled"))


def with_history_style(windows: pl.DataFrame, labels: StyleLabels, column: str) -> pl.DataFrame:
    """`windows` with the class that the labeller found in the history that ends at each window's t0."""
    key = ["scene_id", "agent_id", "t0_frame"]
    frame = (
        label_frame(labels).select(*key, pl.col("style").alias(column)).unique(key, keep="first", maintain_order=True)
    )
    joined = windows.join(frame, on=key, how="left", maintain_order="left")
    return joined.with_columns(pl.col(column).fill_null("unlabelled"))


def with_strata(windows: pl.DataFrame, corpus: Corpus, by: tuple[str, ...]) -> tuple[pl.DataFrame, dict[str, object]]:
    """`windows` with every column that `by` needs, and the provenance of the labels used.

    Labels are joined to errors here, after the forecasts have been made: nothing of them can reach a forecaster.
    InputError for an unknown stratum, or where the corpus has no such labels.
    """
    wanted = {part for item in by for part in parts_of(item)}
    wanted |= {m for m in METHODS if corpus.has_labels(m, "track")}
    wanted |= {f"history:{m}" for m in METHODS if corpus.has_labels(m, "history")}
    provenance: dict[str, object] = {}
    for stratum in sorted(wanted - set(PLAIN)):
        method, span, transposed = _method_and_span(stratum)
        labels = corpus.labels(method, span)
        provenance[f"{method}.{span}"] = dict(labels.provenance)
        column = column_of(stratum)
        if span == "history":
            windows = with_history_style(windows, labels, column)
        else:
            windows = with_track_style(windows, labels, column, transposed=transposed)
    return windows, provenance


def check_strata(corpus: Corpus, by: tuple[str, ...]) -> None:
    """InputError for an unknown stratum, or one whose labels the corpus lacks: before any forecast is made."""
    for item in by:
        for stratum in parts_of(item):
            if stratum in PLAIN:
                continue
            method, span, transposed = _method_and_span(stratum)
            if (method not in METHODS or (transposed and method != "tdbm")) and not corpus.has_labels(method, span):
                raise unknown("stratum", stratum, KNOWN, where="by")
            if not corpus.has_labels(method, span):
                raise InputError(
                    f"{corpus.path} has no {method} labels; run `stylesim label {corpus.path} --method {method}`"
                )


def _method_and_span(stratum: str) -> tuple[str, str, bool]:
    first, _, second = stratum.partition(":")
    if first == "history" and second:
        return second, "history", False
    if not second and first:
        return first, "track", False
    if second == "transposed":
        return first, "track", True
    raise unknown("stratum", stratum, KNOWN, where="by")
