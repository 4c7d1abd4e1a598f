from __future__ import annotations

import pytest

from stylesim.errors import InputError
from stylesim.evaluation.results import load_evaluation
from stylesim.report.evaluate import evaluate
from stylesim.report.picture import save_picture


def test_one_call_from_forecasters_to_files(world, tmp_path):
    corpus = world.write(tmp_path / "c", [world.scene(e) for e in range(4)])
    seen = []
    models = [world.ConstantVelocity(name="a / b"), world.ConstantVelocity((1.0, 0.9), name="a ? b")]
    models[1].training_curve = [{"epoch": 0, "train_loss": 1.0, "val_loss": 1.1, "min_fde_m": 2.5}]
    report = evaluate(models, corpus, by=["tdbm"], progress=lambda *step: seen.append(step))
    assert seen[0] == ("a / b", 1, 4)
    assert seen[-1] == ("a ? b", 4, 4)
    page = report.save(tmp_path / "runs" / "report.html")
    assert sorted(p.name for p in page.parent.iterdir()) == [
        "a-b-no2.json", "a-b-no2.md", "a-b-no2.parquet", "a-b.json", "a-b.md", "a-b.parquet", "report.html",
    ]  # fmt: skip
    assert load_evaluation(page.parent / "a-b-no2.json").forecaster == "a ? b"
    assert '<h2 id="training">' in page.read_text()
    assert "| all | 16 | 4 | too few |" in report._repr_markdown_()


def test_a_single_forecaster_needs_no_list(world, tmp_path):
    corpus = world.write(tmp_path / "c", [world.scene(0)])
    assert evaluate(world.ConstantVelocity(), corpus).evaluations[0].forecaster == "constant velocity"
    with pytest.raises(InputError, match="same name"):
        evaluate([world.ConstantVelocity(), world.ConstantVelocity()], corpus)
    with pytest.raises(InputError, match="no forecaster"):
        evaluate([], corpus)


def test_pictures_are_written_whole_and_alike(world, tmp_path):
    scene = world.scene(2)
    for name in ("a.png", "a.svg"):
        first = save_picture(scene, tmp_path / name).read_bytes()
        assert save_picture(scene, tmp_path / f"again-{name}").read_bytes() == first
    with pytest.raises(InputError, match=r"\.png or \.svg"):
        save_picture(scene, tmp_path / "a.gif")
