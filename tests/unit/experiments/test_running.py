from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
import torch

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.experiments.arms import Arm
from stylesim.experiments.records import RUNS_FILE
from stylesim.experiments.remembering import Remembered
from stylesim.experiments.results import Experiment
from stylesim.experiments.running import run_experiment
from stylesim.forecasting.measured import Measured
from stylesim.scene import Scene

from .world import SPEC, Told, world


@pytest.fixture(autouse=True, scope="module")
def _one_thread() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Corpus:
    return world(tmp_path_factory.mktemp("w") / "c", matters=True, train=8, val=2, test=5)


def arms(corpus: Corpus) -> list[Arm]:
    return [Arm("none"), Arm("told", {"condition": "tdbm", "judges": Told(corpus, leaks=False)}, permuted=True)]


def run(corpus: Corpus, out: Path, **changes: Any) -> Experiment:
    settings: dict[str, Any] = {
        "arms": arms(corpus), "corpus": corpus, "seeds": (0, 1), "steps": 3, "out": out, "size": "mini", "spec": SPEC,
        "batch_size": 16, "cache": out.parent / "cache",
    }  # fmt: skip
    settings |= changes
    return run_experiment(settings.pop("arms"), **settings)


@pytest.fixture(scope="module")
def finished(corpus: Corpus, tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    return run(corpus, tmp_path_factory.mktemp("e") / "out")


def test_every_arm_with_every_seed(finished: Experiment) -> None:
    assert [r.key for r in finished.runs] == [(a, s) for a in ("none", "told", "told+permuted") for s in (0, 1)]
    assert finished.mean("told+permuted").value != finished.mean("told").value
    assert finished.seeds("none", "told") == (0, 1)
    assert finished.measured("told", "steps") == [3, 3] == finished.measured("none", "steps")
    found = finished.difference("told", "none", relative=True)
    assert (found.n_drivers, found.n_units, found.n_seeds) == (40, 5, 2)
    assert finished.mean("none").value > 0
    split = finished.difference("told", "none", split="val")
    assert split.refused  # 16 drivers
    assert set(finished.cells("commanded")) == {"aggressive", "timid"}


def test_what_is_done_is_not_done_again(
    finished: Experiment, corpus: Corpus, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("trained again")

    before = (finished.path / RUNS_FILE).read_bytes()
    monkeypatch.setattr("stylesim.forecasting.training.train", refuse)
    again = run(corpus, finished.path)
    assert again.runs == finished.runs and (finished.path / RUNS_FILE).read_bytes() == before
    with pytest.raises(AssertionError, match="trained again"):
        run(corpus, finished.path, seeds=(0, 1, 2))


def test_a_run_whose_line_was_cut_short_is_made_again(corpus: Corpus, tmp_path: Path) -> None:
    one = run(corpus, tmp_path / "out", arms=[Arm("none")])
    file = tmp_path / "out" / RUNS_FILE
    lines = file.read_text().splitlines()
    file.write_text(lines[0] + "\n" + lines[1][:40])
    with pytest.warns(UserWarning, match="cut short"):
        again = run(corpus, tmp_path / "out", arms=[Arm("none")])
    assert again.mean("none").value == one.mean("none").value  # from the trained model that was there
    file.write_text("".join(f"{line}\n" for line in file.read_text().splitlines() if line.endswith("}")))
    assert [r.key for r in Experiment.load(tmp_path / "out").runs] == [("none", 0), ("none", 1)]


def test_judges_say_once_what_the_labellers_say(corpus: Corpus) -> None:
    scene = next(iter(corpus))
    history = scene.history(10, 8)
    agents, others = np.array([0, 2], np.int32), np.array([1], np.int32)

    class Counting:
        classes = ("a", "b")
        asked = 0

        def measure(self, history: Scene, agent_index: np.ndarray) -> Measured:
            self.asked += 1
            style = np.asarray(agent_index, np.int64)
            return Measured(style, np.ones((len(style), 4)), np.full(len(style), history.tracks.n_frames))

        def whole_track(self, scene: Scene, agent_index: np.ndarray) -> np.ndarray:
            self.asked += 1
            return np.zeros(len(agent_index), np.int64)

        def to_dict(self) -> dict[str, Any]:
            return {}

    counting = Counting()
    judges = Remembered(counting)
    for _ in range(3):
        assert judges.measure(history, agents).style.tolist() == [0, 2]
        assert judges.measure(history, others).style.tolist() == [1]
        assert judges.measure(scene.history(11, 8), agents).highway.tolist() == [8, 8]
    assert counting.asked == 3
    assert judges.whole_track(scene, agents).tolist() == judges.whole_track(scene, agents).tolist() == [0, 0]
    assert counting.asked == 4


def test_refusals(finished: Experiment, corpus: Corpus, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="was begun with steps = 3, not 4"):
        run(corpus, finished.path, steps=4)
    with pytest.raises(InputError, match="'none' was run with"):
        run(corpus, finished.path, arms=[Arm("none", {"lr": 2e-3})])
    with pytest.raises(InputError, match="arm none is given twice"):
        run(corpus, tmp_path / "x", arms=[Arm("none"), Arm("none")])
    with pytest.raises(InputError, match="at least one arm"):
        run(corpus, tmp_path / "x", arms=[])
    with pytest.raises(InputError, match="max_steps is the same in all arms"):
        Arm("none", {"max_steps": 3})
    with pytest.raises(InputError, match="needs a name"):
        Arm("../none")
    with pytest.raises(InputError, match="holds no experiment"):
        Experiment.load(tmp_path / "x")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").touch()
    with pytest.raises(InputError, match="is there already and holds no experiment"):
        run(corpus, tmp_path / "full")
    with pytest.raises(InputError, match="unknown arm 'nobody'"):
        finished.difference("nobody", "none")
    with pytest.raises(InputError, match="unknown cell"):
        finished.mean("none", by="commanded", cell="reckless")
    with pytest.raises(InputError, match="label the corpus"):
        finished.mean("none", by="tdbm", cell="reckless")
    with pytest.raises(InputError, match="cannot be read"):
        finished.mean("none", split="train")


def made(out: Path, errors: dict[str, dict[str, float]]) -> Experiment:
    """An experiment of one seed whose drivers of a style all have the given error."""
    out.mkdir()
    (out / "experiment.json").write_text(json.dumps({"format": "stylesim-experiment", "schema_version": 1}))
    from stylesim.experiments.records import Run, write_run

    for arm, by_style in errors.items():
        rows = [
            {"unit_id": f"u{i % 5}", "agent_id": f"{style}{i}", "n_windows": 1, "commanded": style, "min_fde_m": error}
            for style, error in by_style.items()
            for i in range(40 if style != "rare" else 5)
        ]
        write_run(out, Run(arm, 0, {}, {}), {"val": pl.DataFrame(rows), "test": pl.DataFrame(rows)})
    return Experiment.load(out)


def test_the_worst_cell_is_one_that_may_be_shown(tmp_path: Path) -> None:
    found = made(tmp_path / "a", {"none": {"aggressive": 2.0, "timid": 3.0, "not commanded": 7.0, "rare": 9.0}})
    assert found.worst("none", "commanded") == "timid"
    assert found.cells("commanded")["rare"] == (5, 5)


def test_arms_that_were_asked_about_others_are_not_compared(tmp_path: Path) -> None:
    found = made(tmp_path / "a", {"none": {"aggressive": 2.0}, "other": {"timid": 2.0}})
    with pytest.raises(InputError, match="different drivers"):
        found.difference("other", "none")
