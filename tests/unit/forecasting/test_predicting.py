"""Forecasts in files: what is written is what was predicted, and comes back as a forecaster."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from stylesim.cli.main import main
from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.forecast import ForecastTask
from stylesim.forecasting.baselines import ConstantVelocity
from stylesim.forecasting.checkpoint import save
from stylesim.forecasting.opening import open_forecaster
from stylesim.forecasting.predicting import predict, styles_of
from stylesim.windows import target_agents

from .made import SPEC, made_corpus, untrained


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Corpus:
    return made_corpus(tmp_path_factory.mktemp("corpus") / "c", scenes=3, n_frames=60)


def test_one_file_per_style_that_reads_back_as_a_forecaster(corpus: Corpus, tmp_path: Path) -> None:
    model = untrained(styled=True)
    files = predict(model, corpus, out=tmp_path / "out", styles=["history", "slow", "none"], spec=SPEC)
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["history.parquet", "none.parquet", "slow.parquet"]
    scene, t0 = next(iter(corpus)), 34
    agents = target_agents(scene, t0, SPEC, need_future=False)
    task = ForecastTask(scene.history(t0, 20), agents, 30, t0)
    for style, path in files.items():
        back = open_forecaster(str(path)).predict([task])[0]
        direct = model.predict([task], None if style == "history" else style)[0]
        order = np.argsort(-direct.probability, axis=1, kind="stable")
        row = np.arange(len(agents))[:, None]
        np.testing.assert_allclose(back.mode_m, direct.mode_m[row, order], atol=2e-3)
        np.testing.assert_allclose(back.probability, direct.probability[row, order], atol=1e-5)
    table = pl.read_parquet(files["history"])
    assert table["t0_frame"].unique().sort().to_list() == [19, 34, 49]  # the last one has no future left
    assert files["slow"].read_bytes() != files["none"].read_bytes()


def test_a_baseline_has_no_style_to_ask_for(corpus: Corpus, tmp_path: Path) -> None:
    assert styles_of(ConstantVelocity()) == ("history",)
    predict(ConstantVelocity(), corpus, out=tmp_path / "cv", styles=["all"], spec=SPEC)
    with pytest.raises(InputError, match="it knows history"):
        predict(ConstantVelocity(), corpus, out=tmp_path / "no", styles=["timid"], spec=SPEC)
    with pytest.raises(InputError, match="is there already"):
        predict(ConstantVelocity(), corpus, out=tmp_path / "cv", spec=SPEC)
    assert [p.name for p in tmp_path.iterdir()] == ["cv"]


def test_the_verb(corpus: Corpus, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    with pytest.raises(SystemExit) as done:
        main(["predict", "constant_velocity", str(corpus.path), "--history", "2", "--future", "3", "--out", str(out)])
    assert done.value.code == 0
    assert str(out / "history.parquet") in capsys.readouterr().out.replace("\n", "")
    with pytest.raises(SystemExit) as stopped:
        main(["predict", "constant_velocity", str(corpus.path), "--style", "calm", "--out", str(tmp_path / "x")])
    assert stopped.value.code == InputError.exit_code
    assert "calm" in capsys.readouterr().err


def test_a_model_that_is_asked_with_one_style_by_name(tmp_path: Path) -> None:

    with pytest.raises(InputError, match="no such model"):
        open_forecaster(str(tmp_path / "nothing@timid"))
    model = untrained()
    (tmp_path / "plain").mkdir()
    save(model, tmp_path / "plain" / "model.pt")
    assert open_forecaster(f"{tmp_path / 'plain'}@none").name == "untrained@none"
    with pytest.raises(InputError, match="trained without style"):
        open_forecaster(f"{tmp_path / 'plain'}@timid")
