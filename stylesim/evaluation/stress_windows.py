"""Every window of the stress test's traffic in one table, with the population and the event that it looks into."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import polars as pl

from stylesim.corpus import Corpus
from stylesim.evaluation.asking import ask
from stylesim.evaluation.evaluate import corpus_facts
from stylesim.evaluation.strata import with_strata
from stylesim.evaluation.stress_corpora import StressTraffic
from stylesim.evaluation.stress_criticality import with_criticality
from stylesim.forecast import Forecaster
from stylesim.windows import WindowSpec

POPULATION, EVENT = "population", "event"
NO_EVENT = "no event"
AFTERMATH_S = 3.0  # chosen: an event that began at most so long before t0 is still going on (a cut-in takes 2-3 s)
CAUSED = "windows of who caused an event (listed by event only)"


def stress_windows(
    forecaster: Forecaster,
    traffic: StressTraffic,
    *,
    by: tuple[str, ...],
    spec: WindowSpec,
    modes: int,
    beside: Sequence[Forecaster] = (),
    progress: Callable[[str, int, int], None] | None = None,
) -> tuple[pl.DataFrame, dict[str, int], dict[str, Any]]:
    """(windows of `asking.ask` with `population`, `event` and criticality, counts, provenance of labels), all corpora.

    Units of different populations have the same names where they share a seed; here they get the population's before
    them, because other people drove. `event` is "KIND" for whom it was done to, "KIND, actor" for who did it, in the
    windows whose t0 is at most the length of the future before it or 3 s after; "no event" otherwise.
    """
    tables: list[pl.DataFrame] = []
    counts: Counter[str] = Counter()
    provenance: dict[str, Any] = {}
    for population, corpora in traffic.populations.items():
        for corpus in corpora:
            tell = None
            if progress is not None:
                title = f"{forecaster.name}: {corpus.path.name}"
                tell = lambda done, total, title=title: progress(title, done, total)  # noqa: E731
            windows, asked = ask(
                forecaster, corpus, spec=spec, modes=modes, batch=16, beside=beside, progress=tell
            )  # fmt: skip
            counts.update(asked)
            windows, labels = with_strata(windows, corpus, by)
            provenance |= labels
            windows = with_events(windows, corpus, future_s=spec.future_s)
            windows = with_criticality(windows, corpus, future_s=spec.future_s)
            unit = pl.concat_str([pl.lit(population), pl.col("unit_id")], separator=":")
            tables.append(windows.with_columns(unit.alias("unit_id"), pl.lit(population).alias(POPULATION)))
    table = pl.concat(tables, how="diagonal")
    counts[CAUSED] = table.filter(pl.col(EVENT).str.ends_with(", actor")).height
    return table, dict(counts), provenance


def with_events(windows: pl.DataFrame, corpus: Corpus, *, future_s: float) -> pl.DataFrame:
    """`windows` with a column `event`; of several events the first in time, and having caused one comes first."""
    rows = [
        {"scene_id": scene.scene_id, "agent_id": agent, "event_s": float(event["time_s"]), "found": name, "dt_s": dt}
        for scene in corpus
        for event in scene.metadata.get("events", ())
        for agent, name in ((event["actor"], f"{event['kind']}, actor"), (event["victim"], event["kind"]))
        if (dt := scene.tracks.dt_s) and agent
    ]
    types = {
        "scene_id": pl.String,
        "agent_id": pl.String,
        "event_s": pl.Float64,
        "found": pl.String,
        "dt_s": pl.Float64,
    }
    events = pl.DataFrame(rows, schema=types)
    ahead = pl.col("event_s") - pl.col("t0_frame") * pl.col("dt_s")
    key = ["scene_id", "agent_id", "t0_frame"]
    near = (
        windows.select(key)
        .join(events, on=["scene_id", "agent_id"])
        .filter((ahead < future_s) & (ahead > -AFTERMATH_S))
        .with_columns(pl.col("found").str.ends_with(", actor").alias("acted"))
        .sort([*key, "acted", "event_s", "found"], descending=[False, False, False, True, False, False])
        .unique(key, keep="first", maintain_order=True)
        .select(*key, pl.col("found").alias(EVENT))
    )
    return windows.join(near, on=key, how="left", maintain_order="left").with_columns(pl.col(EVENT).fill_null(NO_EVENT))


def traffic_facts(traffic: StressTraffic) -> dict[str, Any]:
    """The facts of all corpora as those of one; the fingerprint is of theirs, in order."""
    each = [(name, corpus_facts(corpus)) for name, corpora in traffic.populations.items() for corpus in corpora]
    splits: Counter[str] = Counter()
    sources: Counter[str] = Counter()
    for _, facts in each:
        splits.update(facts["splits"])
        sources.update(facts["sources"])
    marks = "\n".join(f"{name} {facts['fingerprint']}" for name, facts in each)
    return {
        "name": ", ".join(facts["name"] for _, facts in each),
        "fingerprint": hashlib.sha256(marks.encode()).hexdigest(),
        "scenes": sum(facts["scenes"] for _, facts in each),
        "units": sum(facts["units"] for _, facts in each),
        "splits": dict(sorted(splits.items())),
        "sources": dict(sorted(sources.items())),
        "seed": each[0][1]["seed"],
        "corpora": [{"population": name, **facts} for name, facts in each],
    }
