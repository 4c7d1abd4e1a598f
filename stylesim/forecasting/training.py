"""`train`: from a corpus with splits to a `TrainedForecaster` in a folder."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from stylesim.corpus import Corpus
from stylesim.corpus.files import new_folder, write_whole
from stylesim.errors import InputError, unknown
from stylesim.forecasting.checkpoint import MODEL_FILE, RECORD_FILE, load, save
from stylesim.forecasting.conditioner import Judges, StyleConditioner, fit_conditioner
from stylesim.forecasting.config import CONDITIONS, InputConfig, ModelConfig, model_config
from stylesim.forecasting.data import TrainingData
from stylesim.forecasting.devices import runtime
from stylesim.forecasting.forecaster import TrainedForecaster
from stylesim.forecasting.loop import STATE_FILE, Loop, TrainSettings
from stylesim.forecasting.model import ForecastNetwork
from stylesim.forecasting.samples import SPLITS, Progress, compiled, windows
from stylesim.forecasting.store import SampleStore
from stylesim.randomness import stream
from stylesim.resources import cache_dir
from stylesim.windows import WindowSpec

NULL_STYLE = -1


def train(
    corpus: Corpus,
    *,
    condition: str = "none",
    fusion: str = "early",
    size: str = "tiny",
    reading: str = "R1",
    spec: WindowSpec = WindowSpec(),
    seed: int = 0,
    out: str | Path,
    epochs: int = 30,
    max_steps: int | None = None,
    batch_size: int = 32,
    lr: float = 1e-3,
    patience: int = 8,
    judges: Judges | None = None,
    cache: Path | None = None,
    accelerator: str = "auto",
    resume: bool = False,
    progress: Progress | None = None,
    stage: Callable[[str], None] | None = None,
) -> TrainedForecaster:
    """Train on the split "train", stop early on "val", and leave the model in the folder `out`.

    `condition` is "none", "tdbm" or "kdsc": the style that the history shows, added to the network at `fusion`
    ("early", "mid" or "late"). `judges` are fitted labellers to use in place of ones fitted here on the training
    split. `cache` is where compiled samples are kept. The same seed gives the same weights (same machine, same
    number of threads); `out` appears under its name only when whole, and `resume` continues OUT.partial with the
    last finished epoch. `out` holds model.pt and training.json (settings, loss curve). InputError for a corpus
    without those splits, unknown names, or an `out` that exists.

    `stage` is called with what begins (compiling, fitting, judging, training); `progress` then counts for it.
    """
    if condition not in CONDITIONS:
        raise unknown("condition", condition, CONDITIONS)
    settings = TrainSettings(
        seed=seed, epochs=epochs, max_steps=max_steps, batch_size=batch_size, lr=lr, patience=patience
    )
    inputs = InputConfig.of(spec, _time_step(corpus))
    config = model_config(size, inputs, fusion=fusion, reading=reading)
    out = Path(out)
    record = {
        "corpus": corpus.fingerprint,
        "condition": condition,
        "size": size,
        "spec": asdict(spec),
        "settings": asdict(settings),
        "fusion": fusion,
        "reading": reading,
    }
    if resume and (out / MODEL_FILE).exists():
        _same(record, out)
        return load(out)
    folder = _opened(out, record, resume=resume)
    watch = _Watch(stage, progress)
    store = compiled(corpus, spec, inputs, cache or cache_dir(), progress=watch.begin("compiling samples"))
    conditioner, data = _styled(corpus, condition, spec, store, inputs, judges, seed, watch)
    config = _with_styles(config, conditioner)
    place = runtime(accelerator)
    with torch.random.fork_rng():
        torch.manual_seed(int(stream(seed, 0, "", "weights").integers(2**62)))
        network = ForecastNetwork(config)
    network.intention_mps2.copy_(torch.from_numpy(data.intentions(config.queries, seed=seed)))
    loop = Loop(network, data, settings, runtime=place, folder=folder)
    loop.restore()
    loop.run(watch.begin("training"))
    name = size if condition == "none" else f"{size}-{condition}-{fusion}"
    forecaster = TrainedForecaster(name, network, conditioner)
    save(forecaster, folder / MODEL_FILE)
    parameters = sum(p.numel() for p in network.parameters())
    counts = {split: len(data.split(number)) for number, split in enumerate(SPLITS)}
    counts["train_without_weight"] = data.without_weight
    whole = {**record, "samples": counts, "parameters": parameters, "best_epoch": loop.best_epoch, "curve": loop.curve}
    _write_json(folder / RECORD_FILE, whole)
    forecaster.training_curve = tuple(loop.curve)
    (folder / STATE_FILE).unlink(missing_ok=True)
    folder.rename(out)
    return forecaster


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


def _styled(
    corpus: Corpus,
    condition: str,
    spec: WindowSpec,
    store: SampleStore,
    inputs: InputConfig,
    judges: Judges | None,
    seed: int,
    watch: _Watch,
) -> tuple[StyleConditioner | None, TrainingData]:
    """The conditioner fitted on the training split, and the samples with their style."""
    if condition == "none":
        return None, TrainingData(store, np.full((len(store), 3), NULL_STYLE, np.int64), inputs)
    if judges is None:
        from stylesim.forecasting.judging import LabelerJudges

        judges = LabelerJudges.fit(condition, corpus.split("train"), spec, progress=watch.begin("fitting labellers"))
    asked = windows(corpus, spec, progress=watch.begin("judging histories"))
    conditioner, style = fit_conditioner(condition, judges, asked, seed=seed)
    return conditioner, TrainingData(store, style, inputs)


def _with_styles(config: ModelConfig, conditioner: StyleConditioner | None) -> ModelConfig:
    if conditioner is None:
        return config
    styles, clusters, contexts = conditioner.cells.filled.shape
    return ModelConfig.from_dict({**config.to_dict(), "styles": styles, "clusters": clusters, "contexts": contexts})


def _opened(out: Path, record: dict[str, Any], *, resume: bool) -> Path:
    """The folder OUT.partial to train in; InputError if `out` exists or what lies there was begun otherwise."""
    out, partial = new_folder(out)
    if resume and (partial / RECORD_FILE).exists():
        _same(record, partial)
        return partial
    if any((partial / name).exists() for name in (STATE_FILE, "request.json")):  # epochs, or a corpus's parts
        raise InputError(f"{partial} is left from an unfinished run; add --resume to go on, or remove it")
    shutil.rmtree(partial, ignore_errors=True)
    _write_json(partial / RECORD_FILE, record)
    return partial


def _same(record: dict[str, Any], folder: Path) -> None:
    """InputError unless the training in `folder` was begun with the same settings."""
    path = folder / RECORD_FILE
    try:
        begun = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read ({error}); remove {folder} and start anew") from None
    for key, value in record.items():
        if begun.get(key) != value:
            raise InputError(f"{folder} was trained with {key} = {begun.get(key)}, not {value}; resume with the same")


def _write_json(path: Path, content: dict[str, Any]) -> None:
    write_whole(path, json.dumps(content, indent=1, sort_keys=True).encode())
