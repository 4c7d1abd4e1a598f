"""`train`: the forecaster."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from stylesim.cli.console import progress_bar, say, show_table

if TYPE_CHECKING:
    from stylesim.forecasting.forecaster import TrainedForecaster


class Condition(StrEnum):
    """What the forecaster is told of a driver's style (docs/forecasting.md); from the history, but for the oracle."""

    none = "none"
    tdbm = "tdbm"
    kdsc = "kdsc"
    tdbm_scores = "tdbm_scores"
    kdsc_probabilities = "kdsc_probabilities"
    features = "features"
    random = "random"
    earlier = "earlier"
    earlier_features = "earlier_features"
    oracle = "oracle"


class Fusion(StrEnum):
    """Where the style enters the network."""

    early = "early"
    mid = "mid"
    late = "late"


class Reading(StrEnum):
    """How style, cluster and context make one embedding (docs of `StyleContextEmbedding`)."""

    R1 = "R1"
    R2 = "R2"
    R3 = "R3"
    R4 = "R4"
    R5 = "R5"


def train(
    corpus: Path = typer.Argument(help="A merged corpus (with splits)."),
    out: Path = typer.Option(..., "--out", help="Folder of the new model; must not exist."),
    condition: Condition = typer.Option(
        Condition.none,
        help="What it is told of the style, from the history. features and random are control arms; the oracle sees "
        "the future, for benchmarks only.",
    ),
    fusion: Fusion = typer.Option(
        Fusion.early, help="Where the style enters the network (without --condition it does not)."
    ),
    size: str = typer.Option("tiny", help="mini (for many short trainings), tiny, small or base."),
    reading: Reading = typer.Option(Reading.R1, help="How style, cluster and context make one embedding."),
    style_dropout: float = typer.Option(
        0.125, min=0.0, max=0.99, help="Share of samples whose style is hidden in training."
    ),
    dense: bool = typer.Option(False, help="Learn the futures of the agents around too, and look at them."),
    epochs: int = typer.Option(30, min=1, help="At most this many epochs; stops early without progress."),
    max_steps: int | None = typer.Option(None, min=1, help="At most this many batches, whatever the epochs."),
    patience: int = typer.Option(8, min=1, help="Epochs without a better validation minFDE before it stops."),
    batch_size: int = typer.Option(32, min=1, help="Samples per step."),
    lr: float = typer.Option(1e-3, min=1e-9, help="Peak learning rate."),
    history: float = typer.Option(5.0, min=0.1, help="Seconds of history that the model sees."),
    future: float = typer.Option(6.0, min=0.1, help="Seconds that it forecasts."),
    stride: float = typer.Option(3.0, min=0.1, help="Seconds from one t0 of a scene to the next."),
    robust: str = typer.Option(
        "none",
        help="For rare drivers, comma-separated: balanced (styles drawn equally often), group_dro, jtt, cvar; "
        "the first two need labelled tracks.",
    ),
    robust_by: str = typer.Option("tdbm", help="Labels that make the groups of --robust: tdbm or kdsc."),
    augment: Path | None = typer.Option(None, help="A (generated) corpus to learn from as well."),
    augment_share: float = typer.Option(0.3, min=0.0, max=1.0, help="Share of every batch that --augment gives."),
    seed: int = typer.Option(0, min=0, help="Same seed, same weights (on one kind of machine)."),
    accelerator: str = typer.Option("auto", help="auto, cpu or gpu."),
    precision: str = typer.Option("32-true", help="32-true, or bf16-mixed (needs lightning-fabric)."),
    compiled: bool = typer.Option(False, "--compile", help="Let torch compile the network; pays on a GPU."),
    resume: bool = typer.Option(False, help="Go on from an unfinished training of the same request."),
) -> None:
    """Train the forecaster, with or without style."""
    from stylesim.corpus import Corpus
    from stylesim.forecasting.robust import RobustSettings
    from stylesim.forecasting.training import train as run
    from stylesim.windows import WindowSpec

    opened = Corpus(corpus)
    with progress_bar("training", "steps") as bar:
        model = run(
            opened,
            condition=condition.value,
            fusion=fusion.value,
            size=size,
            reading=reading.value,
            style_dropout=style_dropout,
            dense=dense,
            spec=WindowSpec(history, future, stride),
            epochs=epochs,
            max_steps=max_steps,
            patience=patience,
            batch_size=batch_size,
            lr=lr,
            robust=RobustSettings(RobustSettings.of(robust).methods, by=robust_by),
            augment=None if augment is None else Corpus(augment),
            augment_share=augment_share,
            seed=seed,
            out=out,
            accelerator=accelerator,
            precision=precision,
            compiled=compiled,
            resume=resume,
            progress=bar,
            stage=lambda what: bar.stage(what, "steps" if what == "training" else "scenes"),
        )
    if model.sees_future:
        say(f"{model.name}: it is told what nobody can know at t0; for benchmarks only")
    _show_curve(model)
    say(f"{out}")


def _show_curve(model: TrainedForecaster) -> None:
    rows = [
        (r["epoch"], f"{r['train_loss']:.3f}", f"{r['val_loss']:.3f}", f"{r['min_fde_m']:.2f}")
        for r in model.training_curve
    ]
    show_table("Training", ("epoch", "train loss", "val loss", "val minFDE (m)"), rows)


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    app.command("train", epilog="Example: `stylesim train runs/mixed --condition tdbm --epochs 10 --out runs/model`")(
        train
    )
