"""The sections about forecasters: errors, training, and exactly what was evaluated."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

from stylesim.corpus import Corpus
from stylesim.evaluation.compare import differences
from stylesim.evaluation.evaluate import corpus_facts
from stylesim.evaluation.intervals import Estimate
from stylesim.evaluation.permuted import PERMUTED, PLACEBO_ROW
from stylesim.evaluation.results import HEADINGS, Evaluation
from stylesim.evaluation.slices import ALL, LAST, STANDING
from stylesim.evaluation.strata import title_of
from stylesim.report.blocks import Block, Section, picture
from stylesim.report.figures import Curve, error_figure, loss_figure
from stylesim.report.tables import difference_table, error_table, facts_table
from stylesim.report.theme import plural

MOST_OPEN_ROWS = 30  # chosen: longer tables are opened by a click
DEFINITIONS = (
    "minADE and minFDE are minimised over the modes separately; the final error is taken at the last valid step; a "
    "miss is a minFDE over 2.0 m; brierFDE is minFDE + (1 − p)², p the probability of the mode with the least final "
    "error; top-1 FDE is the final error of the most probable mode. "
    "A driver counts once, with the mean of its windows. Intervals resample units (a recording at one site, or an "
    "episode), then drivers. A cell of fewer than 30 drivers is refused; with fewer than 3 units the interval "
    "resamples drivers only, is marked † (within site), and says nothing about other sites. A class of the whole "
    "track has seen the future: it sorts drivers here and is never given to a forecaster. “labels permuted” is the "
    "same forecaster told the styles of other drivers of the same scenario and context: what it still gains is not "
    "from the styles."
)


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
            table = error_table(evaluations, by)
            blocks.append(Block(table=table, fold=len(table.rows) > MOST_OPEN_ROWS))
        difference = difference_table(evaluations, by, seed=seed)
        blocks += [] if difference is None else [Block(table=difference, fold=by not in unfolded)]
    blocks.append(Block("Agents that stand", table=error_table(evaluations, STANDING)))
    return Section("errors", "Forecast errors", (DEFINITIONS,), tuple(blocks))


def _metres(value: Estimate) -> str:
    mark = ", within site" if value.status == "within site" else ""
    return f"{value.value:.2f} m [{value.low:.2f}, {value.high:.2f}{mark}]"


def findings(evaluations: Sequence[Evaluation]) -> list[str]:
    """One sentence per forecaster: overall error, and the class with the largest of those that may be shown."""
    found = []
    for one in evaluations:
        size, overall = one.overall.size, one.overall.metrics["min_fde_m"]
        n = f"{plural(size.n_drivers, 'driver')} of {plural(size.n_units, 'unit')}"
        text = f"{one.forecaster}: {n}, too few for a result" if overall.refused else f"{one.forecaster}: minFDE "
        text += "" if overall.refused else f"{_metres(overall)} over {n}"
        by = one.by[0] if one.by else ""
        cells = [item for item in one.slices_by(by) if not item.size.refused and item.value not in LAST] if by else []
        if len(cells) > 1:
            most = max(cells, key=lambda item: item.metrics["min_fde_m"].value)
            text += f"; largest by {title_of(by)}: {most.value}, {_metres(most.metrics['min_fde_m'])}"
            text += f" (n = {most.size.n_drivers})"
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
    found += placebo_warnings(evaluations)
    if len({one.about["corpus"]["fingerprint"] for one in evaluations}) > 1:
        found.append("The forecasters were evaluated on different corpora; only those of the first one's are paired.")
    return found


def placebo_warnings(evaluations: Sequence[Evaluation]) -> list[str]:
    """Forecasters told somebody else's styles that are nevertheless better than the model that is told nothing.

    A baseline without learning is no such model: that a network beats constant velocity says nothing of styles.
    """
    found = []
    by_name = {one.forecaster: one for one in evaluations}
    for told in evaluations:
        placebo = by_name.get(f"{told.forecaster} ({PERMUTED})")
        if placebo is None:
            continue
        for name in told.about.get(PLACEBO_ROW, {}).get("against", []):
            base = by_name.get(name)
            if base is None or placebo.about["corpus"]["fingerprint"] != base.about["corpus"]["fingerprint"]:
                continue
            gap = differences(placebo, base, ALL)[ALL]["min_fde_m"]
            if not gap.refused and gap.high < 0:
                found.append(
                    f"{placebo.forecaster} is better than {base.forecaster} by {-gap.value:.2f} m minFDE although its "
                    "styles are those of other drivers: that much of the gain is not from the styles."
                )
    return found


def training_section(curves: Mapping[str, Curve]) -> Section | None:
    """Loss curves; None without any."""
    blocks = picture(loss_figure(curves), "Dashed: training loss; solid: validation.")
    return Section("training", "Training", (), tuple(blocks)) if blocks else None


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
