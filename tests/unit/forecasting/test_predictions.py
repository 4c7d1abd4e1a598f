from __future__ import annotations

import gzip
import io
import tarfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from stylesim.errors import InputError
from stylesim.evaluation import evaluate as one
from stylesim.evaluation.metrics import forecast_errors
from stylesim.forecast import ForecastTask
from stylesim.forecasting.baselines import ConstantVelocity
from stylesim.forecasting.opening import open_forecaster
from stylesim.report.evaluate import evaluate
from stylesim.scene import Scene
from stylesim.windows import WindowSpec
from tests.conftest import make_scene
from tests.unit.evaluation import small_world

from .prediction_files import av2_file, truth, waymo_bytes


def cut(scene: Scene, agents: list[int], t0: int = 49, steps: int = 60) -> ForecastTask:
    return ForecastTask(scene.history(t0, 50), np.array(agents), steps, t0)


@pytest.fixture
def recorded() -> Scene:
    scene = make_scene(n_agents=4, n_frames=130)
    ids = tuple(f"c-{i}" for i in range(4))
    tracks = replace(scene.tracks, agent_id=ids, origin_m=np.array([1000.0, -2000.0]))  # Waymo's frames are local
    return replace(scene, source_scenario_id="abc", t0_frame=49, tracks=tracks)


def numbered(scene: Scene) -> Scene:
    """Waymo's track ids are numbers."""
    return replace(scene, tracks=replace(scene.tracks, agent_id=tuple(str(i) for i in range(4))))


def test_an_argoverse_file_is_found_and_moved_into_the_scenes_frame(tmp_path: Path, recorded: Scene) -> None:
    forecaster = open_forecaster(str(av2_file(tmp_path / "mine.parquet", recorded, [0, 2])))
    assert forecaster.name == "mine"
    assert forecaster.covers(cut(recorded, [0, 1, 2])).tolist() == [True, False, True]
    forecast = forecaster.predict([cut(recorded, [2, 0])])[0]
    np.testing.assert_allclose(forecast.probability, [[0.25, 0.75]] * 2)
    np.testing.assert_allclose(forecast.mode_m[1, 0], recorded.tracks.position_m[0, 50:110], atol=1e-3)
    with pytest.raises(InputError, match="no prediction of agent 'c-1'"):
        forecaster.predict([cut(recorded, [1])])


def test_a_t0_column_keeps_the_times_apart(tmp_path: Path, recorded: Scene) -> None:
    forecaster = open_forecaster(str(av2_file(tmp_path / "mine.parquet", recorded, [0], t0=60)))
    assert forecaster.covers(cut(recorded, [0], t0=60)).tolist() == [True]
    assert forecaster.covers(cut(recorded, [0], t0=49)).tolist() == [False]


def test_columns_of_rate_and_unit(tmp_path: Path, recorded: Scene) -> None:
    """A model at 2 Hz that thinks in feet writes its own steps, and says so."""
    path = tmp_path / "mine.parquet"
    where = truth(recorded, 0, every=5) / 0.3048
    row = {
        "scenario_id": ["abc"], "track_id": ["c-0"], "probability": [1.0], "predicted_trajectory_x": [where[:, 0]],
        "predicted_trajectory_y": [where[:, 1]], "dt_s": [0.5], "unit_m": [0.3048],
    }  # fmt: skip
    pl.DataFrame(row, strict=False).write_parquet(path)
    forecaster = open_forecaster(str(path))
    assert forecaster.horizon_s == pytest.approx(6.0)
    forecast = forecaster.predict([cut(recorded, [0])])[0]
    np.testing.assert_allclose(forecast.mode_m[0, 0, 4::5], recorded.tracks.position_m[0, 54:110:5], atol=1e-3)
    pl.DataFrame({**row, "dt_s": [-0.5]}, strict=False).write_parquet(path)
    with pytest.raises(InputError, match="'dt_s' must hold one positive number"):
        open_forecaster(str(path))


@pytest.mark.parametrize("joint", [False, True])
@pytest.mark.parametrize("packing", ["plain", "gz", "tar.gz"])
def test_a_waymo_file_is_at_two_hertz(tmp_path: Path, recorded: Scene, joint: bool, packing: str) -> None:
    data = waymo_bytes(recorded, [0, 2], joint=joint)
    path = tmp_path / {"plain": "w.binproto", "gz": "w.gz", "tar.gz": "w.tar.gz"}[packing]
    if packing == "plain":
        path.write_bytes(data)
    elif packing == "gz":
        path.write_bytes(gzip.compress(data))
    else:
        with tarfile.open(path, "w:gz") as archive:
            member = tarfile.TarInfo("../../climbing.bin")  # read in memory: its name leads nowhere
            member.size = len(data)
            archive.addfile(member, io.BytesIO(data))
    scene = numbered(recorded)
    forecaster = open_forecaster(str(path))
    assert forecaster.covers(cut(scene, [0, 1, 2])).tolist() == [True, False, True]
    forecast = forecaster.predict([cut(scene, [0, 2])])[0]
    at = np.arange(4, 60, 5)  # 0.5 s, 1.0 s, ...: exact there, linear between
    np.testing.assert_allclose(forecast.mode_m[:, 0, at], scene.tracks.position_m[[0, 2]][:, 50 + at], atol=1e-3)
    error = forecast_errors(forecast.mode_m, forecast.probability, scene.tracks.position_m[[0, 2], 50:110])
    assert error.min_ade_m.max() < 0.05


def test_damaged_files_are_named(tmp_path: Path, recorded: Scene) -> None:
    data = waymo_bytes(recorded, [0])
    for name, content in {"a.binproto": data[:-3], "b.binproto": b"\xff" * 30, "c.gz": b"\x1f\x8bxx"}.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=name):
            open_forecaster(str(tmp_path / name))
    (tmp_path / "d.parquet").write_bytes(b"PAR1")
    with pytest.raises(InputError, match="no Parquet"):
        open_forecaster(str(tmp_path / "d.parquet"))
    good = pl.read_parquet(av2_file(tmp_path / "e.parquet", recorded, [0]))
    good.drop("probability").write_parquet(tmp_path / "f.parquet")
    with pytest.raises(InputError, match="'probability' is missing"):
        open_forecaster(str(tmp_path / "f.parquet"))
    good.with_columns(pl.lit(-1.0).alias("probability")).write_parquet(tmp_path / "g.parquet")
    with pytest.raises(InputError, match="confidence of -1"):
        open_forecaster(str(tmp_path / "g.parquet"))


class ShortSighted(ConstantVelocity):
    name = "short"
    horizon_s = 3.0


def test_all_are_judged_on_what_all_can_answer(tmp_path: Path) -> None:
    """A file that knows two drivers of one t0, beside a baseline and a model that looks 3 s: the same questions."""
    scenes = [small_world.scene(i) for i in range(3)]
    corpus = small_world.write(tmp_path / "c", scenes)
    first = replace(scenes[0], source_scenario_id=scenes[0].scene_id)
    known = open_forecaster(str(av2_file(tmp_path / "file.parquet", first, [2, 3], t0=49)))
    report = evaluate([known, ConstantVelocity(), ShortSighted()], corpus, by=("scenario",))
    for evaluation in report.evaluations:
        assert evaluation.counts["windows"] == 2
        assert evaluation.counts["not forecast by all"] > 2
        assert evaluation.about["future_s"] == 3.0
        assert evaluation.about["asked_future_s"] == 6.0
    assert report.evaluations[0].drivers["min_fde_m"].max() < 1e-3  # it was given the truth
    alone = one.evaluate(ShortSighted(), corpus, by=("scenario",), spec=WindowSpec(5.0, 2.0))
    assert alone.about["future_s"] == 2.0
