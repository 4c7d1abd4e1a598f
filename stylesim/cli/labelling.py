"""`label`, `labels`: styles of every track, and the table that users join to their own data."""

from __future__ import annotations

from collections import Counter
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from stylesim.cli.console import progress_bar, say, show_table
from stylesim.errors import InputError
from stylesim.labels import StyleLabels
from stylesim.windows import WindowSpec

if TYPE_CHECKING:
    from stylesim.corpus import Corpus
    from stylesim.labelers.base import Labeler
    from stylesim.labelers.scaler import FeatureScaler


class Method(StrEnum):
    """The labelling methods."""

    tdbm = "tdbm"
    kdsc = "kdsc"
    mdsi = "mdsi"


class Span(StrEnum):
    """What a label is of."""

    track = "track"
    history = "history"


def _shares(labels: StyleLabels) -> list[tuple[str, int, str]]:
    names = Counter(labels.class_name(row) for row in range(len(labels)))
    return [
        (name, names[name], f"{names[name] / max(1, len(labels)):.3f}") for name in (*labels.classes, "undetermined")
    ]


def _who(corpus: Corpus, labels: StyleLabels, scale: str) -> str:
    """Whose scale judged, and how many tracks of the corpus were not labelled."""
    left = sum(info.n_agents for info in corpus.info) - len(labels)
    judged = f"judged by the scale of {scale}; " if scale else ""
    total = left + len(labels)
    if left:
        return f"{judged}{left} of {total} tracks are no motor vehicles and have no label"
    return f"{judged}all {total} tracks are labelled"


def _clamped(scaler: FeatureScaler, labels: StyleLabels) -> list[tuple[str, str, str]]:
    from stylesim.labelers.scaler import clamped_shares

    return [(name, f"{low:.3f}", f"{high:.3f}") for name, (low, high) in clamped_shares(scaler, labels).items()]


def _labeler(method: Method, corpus: Corpus, fit: Path | None, window: float) -> Labeler:
    """The labeller: fitted on a corpus, or the shipped one; MDSI takes the answers that the corpus carries."""
    from stylesim.corpus import Corpus
    from stylesim.labelers.mdsi import MDSI
    from stylesim.labelers.reference import default_labeler, new_labeler
    from stylesim.labelers.spans import SAME_LENGTH_S

    if method is Method.mdsi:
        answered = MDSI(norm="none" if fit is None else "sample", history_s=(window,))
        answered.fit(corpus if fit is None else Corpus(fit))
        if not answered.provenance_["drivers_with_answers"]:
            raise InputError(f"{corpus.path}: no driver carries answers to the MDSI; read them with the format study")
        return answered
    if fit is None:
        shipped = default_labeler(method.value)
        if not any(abs(window - known) <= SAME_LENGTH_S for known in shipped.history_s):
            known = ", ".join(f"{length:g}" for length in shipped.history_s)
            raise InputError(
                f"--window {window:g}: the shipped reference judges histories of {known} s; for another length fit "
                f"on a corpus of your own: --fit CORPUS --window {window:g}"
            )
        return shipped
    with progress_bar(f"fitting {method.value} on {fit.name}", "scenes") as progress:
        return new_labeler(method.value, history_s=(window,)).fit(Corpus(fit), progress=progress)


def label(
    corpus: Path = typer.Argument(help="A corpus."),
    method: Method = typer.Option(Method.tdbm, help="How to label."),
    fit: Path | None = typer.Option(
        None, help="Corpus to fit scaler, clusters or norm on; without it the shipped reference, and no norm for mdsi."
    ),
    window: float = typer.Option(
        WindowSpec().history_s, help="History in seconds of the window labels; with the shipped reference 1.1, 2 or 5."
    ),
    future: float = typer.Option(WindowSpec().future_s, help="Future in seconds that a forecaster will be asked for."),
    stride: float = typer.Option(WindowSpec().stride_s, help="Seconds from one t0 to the next."),
) -> None:
    """Label every track, and every history window, by driving style."""
    from stylesim.corpus import Corpus
    from stylesim.labelers.labelling import label as run
    from stylesim.labelers.reference import DEFAULT_REFERENCE
    from stylesim.labelers.tdbm import TDBM

    spec = WindowSpec(window, future, stride)
    opened = Corpus(corpus)
    labeler = _labeler(method, opened, fit, window)
    with progress_bar(f"labelling {corpus.name} by {method.value}", "scenes") as progress:
        labels = run(opened, labeler, spec=spec, progress=progress)
    show_table(f"{method.value}: {len(labels)} tracks", ("style", "tracks", "share"), _shares(labels))
    say(_who(opened, labels, "" if method is Method.mdsi else str(fit or DEFAULT_REFERENCE)))
    if isinstance(labeler, TDBM):  # KDSC clamps nothing
        shares = _clamped(labeler.track_scaler_, labels)
        show_table("share of each feature clamped", ("feature", "below the scale", "above the scale"), shares)
    say(f"{corpus / 'labels'}")


def labels(
    corpus: Path = typer.Argument(help="A labelled corpus."),
    join: Path = typer.Option(..., help="CSV to write: one row per label, with the source's own ids."),
    method: Method = typer.Option(Method.tdbm, help="Which labels."),
    span: Span = typer.Option(Span.track, help="track (whole tracks) or history (windows that end at t0)."),
) -> None:
    """Write labels as a CSV that joins to your own data by source_scenario_id and source_track_id."""
    from stylesim.corpus import Corpus
    from stylesim.corpus.label_store import export_csv

    rows = export_csv(Corpus(corpus).path, method.value, span.value, join)
    say(f"{rows} rows: {join}")


def add_to(app: typer.Typer) -> None:
    """Register the verbs."""
    app.command("label", epilog="Example: `stylesim label runs/sim --method tdbm --fit runs/real`")(label)
    app.command("labels", epilog="Example: `stylesim labels runs/sim --join labels.csv`")(labels)
