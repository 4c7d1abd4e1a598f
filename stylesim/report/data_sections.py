"""The sections about the data: styles, decisions at the yellow, pictures of scenes."""

from __future__ import annotations

from collections.abc import Sequence

from stylesim.corpus import Corpus
from stylesim.evaluation.approaches import yellow_approaches
from stylesim.evaluation.label_summary import LabelSummary, label_summary
from stylesim.report import style_figures
from stylesim.report.blocks import Block, Section, picture
from stylesim.report.picture import scene_figure
from stylesim.report.tables import label_table
from stylesim.report.theme import plural


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
        caption = f"Simulated drivers of {summary.corpus}."
        if summary.method == "tdbm":
            caption += " A perfect labeller of a perfect simulator has 100 on the diagonal."
        caption = f"{caption} {style_figures.rank_note(summary)}".strip()
        blocks += picture(style_figures.confusion_figure(summary), caption)
    return blocks


def yellow_section(corpora: Sequence[Corpus]) -> Section | None:
    """Who stopped and who went, by time to the stop line; None where no commanded driver met a yellow."""
    blocks: list[Block] = []
    for corpus in corpora:
        found = yellow_approaches(corpus)
        if len(found):
            counts = ", ".join(f"{name}: {count}" for name, count in found.counts.items())
            known = found.decided >= 0
            differ = int((known & ((found.decided == 1) != found.stopped)).sum())
            caption = (
                f"{corpus.path.name}: {plural(len(found), 'drive')} up to a yellow in "
                f"{plural(len(set(found.unit)), 'episode')} ({counts}), read from the tracks. {differ} of "
                f"{int(known.sum())} did otherwise than their drivers had decided at the onset."
            )
            blocks += picture(style_figures.stop_probability_figure(found), caption)
    return Section("yellow", "The decision at the yellow", (), tuple(blocks)) if blocks else None


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
