from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from stylesim.errors import InputError
from stylesim.evaluation.compare import differences
from stylesim.evaluation.evaluate import evaluate
from stylesim.evaluation.results import load_evaluation
from stylesim.forecast import Forecast
from stylesim.windows import WindowSpec

BY = ("tdbm", "history:tdbm", "tdbm:transposed", "scenario", "source", "commanded", "tdbm*scenario")


@pytest.fixture(scope="module")
def result(world, small_corpus):
    return evaluate(world.ConstantVelocity(), small_corpus, by=BY, split="test")


def test_errors_are_those_of_the_world(world, result):
    # car i keeps an acceleration a: constant velocity is wrong by |a| * 6² / 2 at the end, whatever t0
    scene = world.scene(3)
    speed = scene.tracks.velocity_mps[:, :, 0]
    acceleration = (speed[2, 10] - speed[2, 0]) / 1.0
    row = result.drivers.filter((pl.col("unit_id") == scene.unit_id) & (pl.col("agent_id") == "car2"))
    assert row["min_fde_m"].item() == pytest.approx(abs(acceleration) * 18, abs=0.05)
    assert row["n_windows"].item() == 2


def test_every_driver_once_with_both_style_columns(result):
    assert result.drivers.select("unit_id", "agent_id").is_unique().all()
    assert result.drivers.height == 200
    car2 = result.drivers.filter((pl.col("agent_id") == "car2") & (pl.col("scenario") == "straight"))
    assert set(car2["style_cond_tdbm"]) <= {"threatening", "cautious", "aggressive"}  # the commanded class
    assert set(car2["style_strat_tdbm"]) <= {"careful", "timid", "reckless", "undetermined"}  # one step calmer
    assert car2["mode_probability"].to_list()[0] == [1.0]


def test_what_was_not_asked_is_counted(result):
    counts = result.counts
    assert (counts["scenes"], counts["windows"]) == (40, 40 * (5 + 4))
    assert counts["not a motor vehicle"] == 40 * 2
    assert counts["future incomplete"] == 40  # car1 at the second t0


def test_standing_agents_are_apart(result):
    assert result.slices_by("standing")[0].size.n_drivers == 40
    assert result.overall.size.n_drivers == 160
    assert sum(item.size.n_drivers for item in result.slices_by("scenario")) == 160


def test_cells_follow_the_order_of_the_classes_and_refuse_small_ones(result):
    values = [item.value for item in result.slices_by("tdbm")]
    assert values == ["reckless", "threatening", "careful", "cautious", "timid", "undetermined"]
    timid = result.slices_by("tdbm")[4]
    assert (timid.size.refused, timid.size.n_drivers) == (False, 49)
    assert result.slices_by("tdbm")[0].size.refused
    assert all("×" in item.value for item in result.slices_by("tdbm*scenario"))


def test_the_forecaster_sees_history_only(world, small_corpus):
    spy = world.ConstantVelocity()
    evaluate(spy, small_corpus, by=("tdbm",))
    for task in spy.asked:
        assert task.scene.tracks.n_frames == 50
        assert task.scene.tracks.driver == (None,) * task.scene.tracks.n_agents
        assert not task.scene.tracks.flags.any()
        assert not any("style" in name for name in vars(task))


def test_labels_change_no_error(world, small_corpus, tmp_path, result):
    bare = world.write(tmp_path / "bare", [world.scene(e) for e in range(40)], with_labels=False)
    other = evaluate(world.ConstantVelocity(), bare, by=("scenario",))
    names = ["unit_id", "agent_id", "min_ade_m", "min_fde_m", "brier_fde_m"]
    assert other.drivers.select(names).equals(result.drivers.select(names))


def test_batches_change_nothing(world, small_corpus, result):
    other = evaluate(world.ConstantVelocity(), small_corpus, by=BY, batch=1)
    assert other.to_dict() == result.to_dict()


def test_save_and_load(result, tmp_path):
    files = result.save(tmp_path / "runs" / "cv.json")
    assert [file.name for file in files] == ["cv.json", "cv.md", "cv.parquet"]
    again = load_evaluation(files[0])
    assert again.to_dict() == result.to_dict()
    assert again.drivers.equals(result.drivers)
    first = [file.read_bytes() for file in files]
    assert first == [file.read_bytes() for file in again.save(tmp_path / "copy" / "cv")]
    text = files[1].read_text()
    assert "| timid | 49 | 32 |" in text
    assert "| reckless | 26 | 26 | too few |" in text
    with pytest.raises(InputError, match="build_report"):
        result.save(tmp_path / "cv.html")


@pytest.mark.parametrize("damage", ["nothing", "{}", "[1]", '{"format": "other", "schema_version": 1}'])
def test_what_is_no_evaluation_is_refused(tmp_path, damage):
    if damage != "nothing":
        (tmp_path / "x.json").write_text(damage)
    with pytest.raises(InputError, match=r"x\.json"):
        load_evaluation(tmp_path / "x.json")


class Wrong:
    name = "wrong one"

    def __init__(self, answer):
        self.answer = answer

    def predict(self, tasks):
        return self.answer(tasks)


def answer(drivers=0, steps=0, factor=1.0):
    def make(tasks):
        return [
            Forecast(
                np.full((len(t.agent_index) + drivers, 1, t.future_steps + steps, 2), factor),
                np.ones((len(t.agent_index) + drivers, 1)),
            )
            for t in tasks
        ]

    return make


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        (answer(drivers=1), "drivers were asked"),
        (answer(steps=-1), "59 steps, asked were 60"),
        (answer(factor=np.nan), "finite"),
        (lambda tasks: [], "one Forecast per task"),
        (lambda tasks: None, "NoneType"),
        (lambda tasks: [np.zeros(3)] * len(tasks), "not ndarray"),
    ],
)
def test_a_wrong_answer_names_the_forecaster(small_corpus, bad, says):
    with pytest.raises(InputError, match=f"wrong one.*{says}"):
        evaluate(Wrong(bad), small_corpus, by=("scenario",))


def test_what_the_corpus_does_not_have_is_refused(world, small_corpus, tmp_path):
    cv = world.ConstantVelocity()
    with pytest.raises(InputError, match="no kdsc labels"):
        evaluate(cv, small_corpus, by=("kdsc",))
    with pytest.raises(InputError, match="unknown stratum"):
        evaluate(cv, small_corpus, by=("tdbm:sideways",))
    with pytest.raises(InputError, match="no split 'train'"):
        evaluate(cv, small_corpus, split="train")
    with pytest.raises(InputError, match="no window"):
        evaluate(cv, small_corpus, spec=WindowSpec(history_s=20.0))


def test_differences_are_paired(world, small_corpus, result):
    fan = evaluate(world.ConstantVelocity((1.0, 0.9, 1.1), name="fan"), small_corpus, by=("tdbm",))
    change = differences(fan, result, "all")["all"]
    assert change["min_fde_m"].high < 0  # one mode is the same, two can only help
    assert change["top_fde_m"].value == 0.0
    assert differences(fan, result, "tdbm")["reckless"]["min_fde_m"].refused
    part = evaluate(world.ConstantVelocity(), small_corpus.with_info(small_corpus.info[:20]), by=())
    with pytest.raises(InputError, match="different drivers"):
        differences(part, result, "all")
    with pytest.raises(InputError, match="no column"):
        differences(fan, result, "kdsc")


def test_a_driver_in_several_scenes_is_one_driver(world, tmp_path):
    from dataclasses import replace

    scenes = [replace(world.scene(0, scene_id=f"cut{i}"), unit_id="one recording") for i in range(3)]
    corpus = world.write(tmp_path / "cuts", scenes)
    drivers = evaluate(world.ConstantVelocity(), corpus, by=("tdbm",)).drivers
    assert drivers.height == 5
    assert drivers.filter(pl.col("agent_id") == "car2")["scene_id"].to_list() == [["cut0", "cut1", "cut2"]]
    assert drivers["n_windows"].sum() + drivers["n_standing"].sum() == 3 * 9
    assert "undetermined" not in drivers["style_strat_tdbm"].to_list()  # judged in at least one of its scenes
