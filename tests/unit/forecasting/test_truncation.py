"""A recording cut off at t0, through reader and corpus: what the forecaster is given is the same to the bit."""

from __future__ import annotations

import gzip
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from stylesim.corpus import Corpus
from stylesim.datasets.reading import read
from stylesim.forecasting.batching import Batch, gather
from stylesim.forecasting.conditioner import StyleConditioner
from stylesim.forecasting.conditioning import StyleCells
from stylesim.forecasting.config import InputConfig
from stylesim.forecasting.judging import LabelerJudges
from stylesim.forecasting.measured import Measured
from stylesim.forecasting.samples import RoadCutter, add_window
from stylesim.forecasting.store import MemorySink, StoreBuilder
from stylesim.scene import Scene
from stylesim.windows import WindowSpec, target_agents

RECORDING = Path(__file__).resolve().parents[3] / "data" / "dlr_ut"
SPEC = WindowSpec()
INPUTS = InputConfig.of(SPEC, 0.1)
SCENE_START_S, FRAME = 40.0, 123  # 52.3 s: in the third scene, with interpolated rows before it
END = "2023-09-24 12:00:52.316482+00:00"  # the source's timestamp of that frame

pytestmark = pytest.mark.skipif(not RECORDING.is_dir(), reason=f"{RECORDING} is not there")


def truncated(folder: Path) -> Path:
    """The recording without any row, of tracks and lights, after END."""
    folder.mkdir()
    for file in RECORDING.glob("*.csv.gz"):
        header, *rows = gzip.decompress(file.read_bytes()).decode().splitlines()
        kept = [row for row in rows if row.split(",", 1)[0] <= END]
        assert 0 < len(kept) < len(rows) / 4
        (folder / file.name).write_bytes(gzip.compress("\n".join([header, *kept, ""]).encode()))
    return folder


def scene_at(corpus: Corpus) -> Scene:
    return next(corpus.scenes(lambda info: info.start_s == SCENE_START_S))


def seen(scene: Scene, agents: list[str]) -> tuple[Batch, Scene, np.ndarray]:
    """The inputs of these agents at t0, their history, and their places in it."""
    history = scene.history(FRAME, INPUTS.history_steps)
    index = np.array([history.tracks.agent_id.index(agent) for agent in agents], np.int32)
    sink = MemorySink(INPUTS)
    sink.append("sample", add_window(StoreBuilder(sink), RoadCutter(INPUTS), history, index, INPUTS))
    return gather(sink.store(), np.arange(len(agents)), INPUTS), history, index


def targets(scene: Scene) -> list[str]:
    return sorted(scene.tracks.agent_id[i] for i in target_agents(scene, FRAME, SPEC, need_future=False))


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Corpus, Corpus]:
    folder = tmp_path_factory.mktemp("dlr")
    whole = read("dlr_ut", RECORDING, out=folder / "whole")
    return whole, read("dlr_ut", truncated(folder / "source"), out=folder / "cut")


def test_the_cut_ends_at_t0_and_asks_the_same_agents(pair: tuple[Corpus, Corpus]) -> None:
    whole, cut = (scene_at(corpus) for corpus in pair)
    assert cut.tracks.n_frames == FRAME + 1 < whole.tracks.n_frames
    assert targets(whole) == targets(cut)
    assert len(targets(cut)) >= 10


def test_the_inputs_are_the_same_bits(pair: tuple[Corpus, Corpus]) -> None:
    whole, cut = (scene_at(corpus) for corpus in pair)
    batches = [seen(scene, targets(cut))[0] for scene in (whole, cut)]
    for field in fields(Batch):
        one, other = (getattr(batch, field.name) for batch in batches)
        assert one.tobytes() == other.tobytes(), field.name
    assert batches[0].piece_valid.any()
    assert batches[0].agent_valid[:, 1:].any()


@pytest.mark.parametrize("condition", ["tdbm", "kdsc"])
def test_the_style_is_the_same_bits(pair: tuple[Corpus, Corpus], condition: str) -> None:
    whole, cut = (scene_at(corpus) for corpus in pair)
    judges = LabelerJudges.fit(condition, pair[0].with_info(pair[0].info[5:9]), SPEC)
    found = []
    for scene in (whole, cut):
        _, history, index = seen(scene, targets(cut))
        found.append(judges.measure(history, index))
    for field in fields(Measured):
        assert getattr(found[0], field.name).tobytes() == getattr(found[1], field.name).tobytes(), field.name
    assert (found[0].style >= 0).any()
    rng = np.random.default_rng(0)
    fitted = StyleCells.fit(found[0], judges.classes, clusters=3, contexts=2, rng=rng)
    cells = StyleCells(fitted.classes, fitted.centre, fitted.mean, fitted.sd, np.ones_like(fitted.filled))
    conditioner = StyleConditioner(condition, judges, cells)
    conds = []
    for scene in (whole, cut):
        _, history, index = seen(scene, targets(cut))
        conds.append(conditioner.style_cond(history, index))
    np.testing.assert_array_equal(conds[0], conds[1])
    assert (conds[0][:, 0] >= 0).any()
