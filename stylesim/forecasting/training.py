"""`train`: from a corpus with splits to a `TrainedForecaster` in a folder."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from stylesim.corpus import Corpus
from stylesim.errors import InputError, unknown
from stylesim.forecasting.augmenting import Added, added_view
from stylesim.forecasting.checkpoint import MODEL_FILE, RECORD_FILE, load, save
from stylesim.forecasting.conditioner import Judges, StyleConditioner
from stylesim.forecasting.conditions import CONDITIONS, model_name
from stylesim.forecasting.config import VIEWS, InputConfig, model_config
from stylesim.forecasting.devices import runtime
from stylesim.forecasting.forecaster import TrainedForecaster
from stylesim.forecasting.loop import STATE_FILE, Loop, TrainSettings
from stylesim.forecasting.mixing import MixedData, TrainingSet
from stylesim.forecasting.reweighting import group_report, with_groups
from stylesim.forecasting.robust import RobustSettings
from stylesim.forecasting.samples import SPLITS, Progress, compiled
from stylesim.forecasting.styling import styled_data, with_styles
from stylesim.forecasting.trained_loop import FIRST_FOLDER, trained_loop
from stylesim.forecasting.training_folder import check_same, forgotten_if_refused, opened, write_json
from stylesim.resources import cache_dir
from stylesim.windows import WindowSpec


def train(
    corpus: Corpus,
    *,
    condition: str = "none",
    fusion: str = "early",
    size: str = "tiny",
    reading: str = "R1",
    style_dropout: float = 0.125,
    dense: bool = False,
    spec: WindowSpec = WindowSpec(),
    seed: int = 0,
    out: str | Path,
    epochs: int = 30,
    max_steps: int | None = None,
    batch_size: int = 32,
    lr: float = 1e-3,
    patience: int = 8,
    judges: Judges | None = None,
    robust: str | Sequence[str] | RobustSettings = (),
    augment: Corpus | None = None,
    augment_share: float = 0.3,
    cache: Path | None = None,
    accelerator: str = "auto",
    precision: str = "32-true",
    compiled: bool = False,
    resume: bool = False,
    progress: Progress | None = None,
    stage: Callable[[str], None] | None = None,
) -> TrainedForecaster:
    """Train on the split "train", stop early on "val", and leave the model in the folder `out`.

    `condition` is one of `conditions.CONDITIONS` ("none", "tdbm", "tdbm_scores", ...): what the history shows of the
    style, added to the network at `fusion` ("early", "mid" or "late"); docs/forecasting.md describes them. Whatever
    the condition, the network has the same number of parameters. `style_dropout` is the share of training samples
    whose style is hidden, so that the model also works without it. `dense` learns the futures of the agents around
    too. `judges` are fitted labellers to use in place of ones fitted here on the training split. `cache` is where
    compiled samples are kept. The same seed gives the same weights (same machine, same number of threads); `out`
    appears under its name only when whole, and `resume` continues OUT.partial with the last finished epoch. `out`
    holds model.pt and training.json (settings, loss curve). InputError for a corpus without those splits, unknown
    names, or an `out` that exists.

    `robust` says what to do for rare drivers: names as "balanced,jtt", or `RobustSettings`. `augment` is a corpus,
    usually generated, from which the share `augment_share` of every batch is taken at equal gradient steps
    (`augmenting.added_view` says which of its scenes).

    `accelerator` ("auto", "cpu", "gpu") and `precision` ("32-true", "bf16-mixed") say where and how it runs, `compiled`
    that torch compiles the network first; they are no part of what `resume` compares.
    `stage` is called with what begins (compiling, fitting, judging, training); `progress` then counts for it.
    """
    if condition not in CONDITIONS:
        raise unknown("condition", condition, CONDITIONS)
    settings = TrainSettings(
        seed=seed, epochs=epochs, max_steps=max_steps, batch_size=batch_size, lr=lr, patience=patience
    )
    inputs = InputConfig.of(spec, _time_step(corpus), **VIEWS.get(size, {}))
    config = model_config(size, inputs, fusion=fusion, reading=reading, style_dropout=style_dropout, dense=dense)
    robust = RobustSettings.of(robust)
    added = None if augment is None else added_view(corpus, augment, augment_share)
    out = Path(out)
    network = {"size": size, "fusion": fusion, "reading": reading, "style_dropout": style_dropout, "dense": dense}
    record = _asked(corpus, condition, network, spec, settings, robust, added)
    if resume and (out / MODEL_FILE).exists():
        check_same(record, out)
        return load(out)
    place = runtime(accelerator, precision, compiled=compiled)
    folder = opened(out, record, resume=resume)
    watch = _Watch(stage, progress)
    with forgotten_if_refused(folder):
        conditioner, data, groups = _training_set(
            corpus, added, condition, spec, inputs, judges, robust, dense=dense, seed=seed, cache=cache, watch=watch
        )
    config = with_styles(config, conditioner)
    loop = trained_loop(config, data, groups, settings, robust, runtime=place, folder=folder, begin=watch.begin)
    forecaster = TrainedForecaster(model_name(size, condition, fusion), loop.network, conditioner)
    save(forecaster, folder / MODEL_FILE)
    write_json(folder / RECORD_FILE, {**record, **_outcome(loop, groups)})
    _close(folder, out)
    forecaster.training_curve = tuple(loop.curve)
    return forecaster


def _asked(
    corpus: Corpus,
    condition: str,
    network: dict[str, Any],
    spec: WindowSpec,
    settings: TrainSettings,
    robust: RobustSettings,
    added: Added | None,
) -> dict[str, Any]:
    """What was asked for, for the record and for `resume`."""
    record = {"corpus": corpus.fingerprint, "condition": condition, **network}
    record |= {"spec": asdict(spec), "settings": asdict(settings)}
    return record | {"robust": robust.to_dict(), "augment": None if added is None else added.to_dict()}


def _training_set(
    corpus: Corpus,
    added: Added | None,
    condition: str,
    spec: WindowSpec,
    inputs: InputConfig,
    judges: Judges | None,
    robust: RobustSettings,
    *,
    dense: bool,
    seed: int,
    cache: Path | None,
    watch: _Watch,
) -> tuple[StyleConditioner | None, TrainingSet, tuple[str, ...]]:
    """What is fitted on the training split, all samples with their style, and the names of their groups."""
    corpora = [corpus] if added is None else [corpus, added.corpus]
    kept = cache or cache_dir()
    stores = [compiled(c, spec, inputs, kept, progress=watch.begin("compiling samples")) for c in corpora]
    conditioner, parts = styled_data(corpora, condition, spec, stores, inputs, judges, seed=seed, begin=watch.begin)
    parts = [replace(part, dense=dense) for part in parts]
    data: TrainingSet = parts[0] if added is None else MixedData(parts[0], parts[1], added.share)
    if not robust.grouped:
        return conditioner, data, ()
    return conditioner, *with_groups(data, corpora, robust)


def _outcome(loop: Loop, groups: tuple[str, ...]) -> dict[str, Any]:
    """What a training left behind, for the record."""
    counts = {split: len(loop.data.split(number)) for number, split in enumerate(SPLITS)}
    counts["train_without_weight"] = loop.data.without_weight
    counts["train_added"] = sum(len(part.split(0)) for part in loop.data.parts[1:])
    parameters = sum(p.numel() for p in loop.network.parameters())
    report = group_report(loop.data, groups, loop.weigher)
    found = {"samples": counts, "parameters": parameters, "best_epoch": loop.best_epoch, "curve": loop.curve}
    return {**found, "groups": report}


def _close(folder: Path, out: Path) -> None:
    """Leave nothing but the model and its record, under the final name."""
    (folder / STATE_FILE).unlink(missing_ok=True)
    shutil.rmtree(folder / FIRST_FOLDER, ignore_errors=True)
    folder.rename(out)


@dataclass(frozen=True)
class _Watch:
    """Whoever looks on: told what begins, then how far it is."""

    stage: Callable[[str], None] | None
    progress: Progress | None

    def begin(self, what: str) -> Progress | None:
        """Say what begins; what counts for it."""
        if self.stage is not None:
            self.stage(what)
        return self.progress


def _time_step(corpus: Corpus) -> float:
    """The time step of the train and val scenes; InputError without such splits, or with several time steps."""
    steps = set()
    for split in SPLITS:
        steps |= {round(info.dt_s, 6) for info in corpus.split(split).info}
    if len(steps) > 1:
        raise InputError(f"{corpus.path} mixes time steps {sorted(steps)}: bring it to one with `stylesim merge`")
    return float(steps.pop())
