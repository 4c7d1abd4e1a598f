"""What stands in the report: sections made of figures, tables and a few sentences."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from stylesim.corpus import Corpus
from stylesim.evaluation.evaluate import corpus_facts
from stylesim.evaluation.label_summary import LabelSummary, label_summary
from stylesim.evaluation.results import HEADINGS, Evaluation, interval_text
from stylesim.evaluation.slices import ALL, STANDING
from stylesim.evaluation.strata import title_of
from stylesim.evaluation.yellow import yellow_decisions
from stylesim.report import style_figures
from stylesim.report.figures import Curve, error_figure, loss_figure
from stylesim.report.picture import scene_figure
from stylesim.report.tables import Table, difference_table, error_table, facts_table, label_table
from stylesim.report.theme import data_uri

DEFINITIONS = (
    "minADE and minFDE are minimised over the modes separately; the final error is taken at the last valid step; a "
    "miss is a minFDE over 2.0 m; brierFDE is minFDE + (1 − p)², p the probability of the mode with the least final "
    "error; top-1 FDE is the final error of the most probable mode. "
    "A driver counts once, with the mean of its windows. Intervals resample units (a recording at one site, or an "
    "episode), then drivers. A cell of fewer than 30 drivers is refused; with fewer than 3 units the interval "
    "resamples drivers only, is marked “within site”, and says nothing about other sites. A class of the whole "
    "track has seen the future: it sorts drivers here and is never given to a forecaster."
)


@dataclass(frozen=True)
class Block:
    """A figure (`image`), a table, or folded raw text, with its caption."""

    heading: str = ""
    image: str = ""
    caption: str = ""
    table: Table | None = None
    raw: str = ""
    fold: bool = False  # a table that is opened by a click


@dataclass(frozen=True)
class Section:
    """A part of the page."""

    anchor: str
    title: str
    text: tuple[str, ...]
    blocks: tuple[Block, ...]


def picture(figure: Figure | None, caption: str, *, heading: str = "", raster: bool = False) -> list[Block]:
    """A block of that figure; none where there is no figure."""
    return [] if figure is None else [Block(heading, data_uri(figure, raster=raster), caption)]


def strata(evaluations: Sequence[Evaluation]) -> list[str]:
    """Every `by` of any evaluation, in the order in which they were asked for."""
    return list(dict.fromkeys(by for one in evaluations for by in one.by))


def errors_section(evaluations: Sequence[Evaluation], *, seed: int) -> Section:
    """Errors per stratum for all forecasters, and their paired differences to the first."""
    blocks = [Block(table=error_table(evaluations, ALL))]
    unfolded = (ALL, *strata(evaluations)[:1])
    for by in (ALL, *strata(evaluations)):
        if by != ALL:
            caption = (
                "Points are means over drivers, bars 95 % intervals; hollow points with dotted bars are within-site."
            )
            blocks += picture(error_figure(evaluations, by), caption, heading=f"By {title_of(by)}")
            blocks.append(Block(table=error_table(evaluations, by)))
        difference = difference_table(evaluations, by, seed=seed)
        blocks += [] if difference is None else [Block(table=difference, fold=by not in unfolded)]
    blocks.append(Block("Agents that stand", table=error_table(evaluations, STANDING)))
    return Section("errors", "Forecast errors", (DEFINITIONS,), tuple(blocks))


def findings(evaluations: Sequence[Evaluation]) -> list[str]:
    """One sentence per forecaster: overall error, and the worst class that is large enough to be named."""
    found = []
    for one in evaluations:
        overall = one.overall
        text = f"{one.forecaster}: minFDE {interval_text(overall.metrics['min_fde_m'])} m over "
        text += f"{overall.size.n_drivers} drivers of {overall.size.n_units} units"
        by = one.by[0] if one.by else ""
        cells = [item for item in one.slices_by(by) if not item.size.refused] if by else []
        if len(cells) > 1:
            worst = max(cells, key=lambda item: item.metrics["min_fde_m"].value)
            text += f"; worst by {by}: {worst.value}, {interval_text(worst.metrics['min_fde_m'])} m"
            text += f" (n = {worst.size.n_drivers})"
        found.append(text + ".")
    return found


def warnings(evaluations: Sequence[Evaluation]) -> list[str]:
    """What a reader must know before believing a number."""
    found = []
    for one in evaluations:
        splits = one.about["corpus"]["splits"]
        seen = [name for name in ("train", "val") if splits.get(name)]
        if seen:
            found.append(
                f"{one.forecaster} was evaluated on scenes of the split(s) {', '.join(seen)}, not on test alone."
            )
    if len({one.about["corpus"]["fingerprint"] for one in evaluations}) > 1:
        found.append("The forecasters were evaluated on different corpora; only those of the first one's are paired.")
    return found


def labels_section(corpora: Sequence[Corpus], methods: Sequence[str]) -> Section | None:
    """Class shares of every corpus, what could not be judged, commanded against measured; None without labels."""
    blocks: list[Block] = []
    for method in methods:
        summaries = [label_summary(corpus, method) for corpus in corpora if corpus.has_labels(method, "track")]
        if not summaries:
            continue
        caption = "Share of labelled tracks per class and source; a class is fragile where its margin is small."
        figure = style_figures.class_distribution_figure(summaries)
        blocks += picture(figure, caption, heading=f"Classes by {method.upper()}")
        blocks.append(Block(table=label_table(summaries)))
        blocks += _confusion_blocks(summaries)
    return Section("labels", "Styles in the data", (), tuple(blocks)) if blocks else None


def _confusion_blocks(summaries: Sequence[LabelSummary]) -> list[Block]:
    blocks: list[Block] = []
    for summary in summaries:
        caption = (
            f"Simulated drivers of {summary.corpus}: a perfect labeller of a perfect simulator has 100 on the diagonal."
        )
        caption = f"{caption} {style_figures.rank_note(summary)}".strip()
        blocks += picture(style_figures.confusion_figure(summary), caption)
    return blocks


def yellow_section(corpora: Sequence[Corpus]) -> Section | None:
    """Stop or go by time to the stop line; None where no driver carries a decision."""
    blocks: list[Block] = []
    for corpus in corpora:
        decisions = yellow_decisions(corpus)
        if decisions is not None:
            counts = ", ".join(f"{name}: {count}" for name, count in decisions.counts.items())
            caption = (
                f"{corpus.path.name}: {len(decisions)} decisions of {len(set(decisions.unit))} episodes ({counts})."
            )
            blocks += picture(style_figures.stop_probability_figure(decisions), caption)
    return Section("yellow", "The decision at the yellow", (), tuple(blocks)) if blocks else None


def training_section(curves: Mapping[str, Curve]) -> Section | None:
    """Loss curves; None without any."""
    blocks = picture(loss_figure(curves), "Dashed: training loss; solid: validation.")
    return Section("training", "Training", (), tuple(blocks)) if blocks else None


def scenes_section(corpora: Sequence[Corpus], methods: Sequence[str], count: int) -> Section | None:
    """Pictures of `count` scenes of every source, those with the most classes (then the most road users)."""
    blocks: list[Block] = []
    for corpus in corpora:
        method = next((m for m in methods if corpus.has_labels(m, "track")), None)
        labels = corpus.labels(method, "track") if method else None
        variety: dict[str, set[int]] = {}
        if labels is not None:
            for scene_id, style in zip(labels.scene_id, labels.style.tolist(), strict=True):
                variety.setdefault(scene_id, set()).add(style)
        for source in sorted({info.source for info in corpus.info}):
            infos = [info for info in corpus.info if info.source == source]
            infos.sort(key=lambda info: (-len(variety.get(info.scene_id, ())), -info.n_agents, info.scene_id))
            for info in infos[:count]:
                scene = corpus.scene(info.scene_id)
                caption = f"{corpus.path.name}, {info.source}, {info.scenario}; boxes where a road user is last seen."
                blocks += picture(scene_figure(scene, labels), caption, raster=True)
    return Section("scenes", "Example scenes", (), tuple(blocks)) if blocks else None


def provenance_section(evaluations: Sequence[Evaluation], corpora: Sequence[Corpus]) -> Section:
    """What was evaluated, exactly: corpora with fingerprints, windows, seeds, versions, what was not asked."""
    blocks = [Block(table=facts_table(f"Corpus {c.path.name}", _flat(corpus_facts(c)))) for c in corpora]
    for one in evaluations:
        facts = {key: value for key, value in one.about.items() if key != "labels"}
        blocks.append(Block(table=facts_table(f"Evaluation of {one.forecaster}", _flat(facts)), fold=True))
        blocks.append(
            Block(table=facts_table(f"{one.forecaster}: what was asked, and what was not", one.counts), fold=True)
        )
        raw = json.dumps(one.about["labels"], indent=1, sort_keys=True)
        blocks.append(Block(caption=f"{one.forecaster}: provenance of the labels", raw=raw))
    return Section("provenance", "What was evaluated", (f"Metrics: {', '.join(HEADINGS.values())}.",), tuple(blocks))


def _flat(facts: Mapping[str, object], prefix: str = "") -> dict[str, object]:
    """Nested mappings as one level of dotted names."""
    flat: dict[str, object] = {}
    for key, value in facts.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{key or '(no split)'}.")
        else:
            flat[f"{prefix}{key or '(no split)'}"] = value
    return flat
