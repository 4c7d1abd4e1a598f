"""Corpora of known answers through the whole analysis, to the folder that a user gets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from stylesim.corpus import CorpusWriter
from stylesim.errors import InputError
from stylesim.evaluation.analysis.analyze import analyze
from stylesim.evaluation.analysis.judge import JUDGED, fit_within, half_of, with_tdbm
from stylesim.labelers.features import TDBM_FEATURES
from stylesim.labelers.options import FeatureOptions
from stylesim.questionnaire import answer_key
from stylesim.road import Lane, Road
from stylesim.scene import Scene
from stylesim.tracks import AgentKind, Tracks

DT_S, FRAMES = 0.1, 230


def scene(number: int, *, answered: bool = False, agents: int = 4) -> Scene:
    """Car 0 stands; the others keep a speed of their own, odd ones with a swing of their acceleration."""
    rng = np.random.default_rng(number)
    t = np.arange(FRAMES) * DT_S
    mean = rng.uniform(8, 12, agents)
    swing = np.where(np.arange(agents) % 2, 2.0, 0.1)
    mean[0] = swing[0] = 0.0
    speed = mean[:, None] + swing[:, None] * np.sin(1.2 * t)
    x = np.cumsum(speed, axis=1) * DT_S + 60.0 * np.arange(agents)[:, None]
    y = np.zeros_like(x)
    line = np.stack([np.linspace(-50, 900, 100), np.zeros(100)], axis=1)
    said = {answer_key(i + 1, "car1"): 6.0 if i + 1 in (3, 12, 19, 28, 43) else 1.0 for i in range(44)}
    tracks = Tracks(
        agent_id=tuple(f"car{i}" for i in range(agents)),
        kind=np.full(agents, AgentKind.CAR),
        size_m=np.tile([4.5, 1.8], (agents, 1)),
        position_m=np.stack([x, y], axis=-1),
        velocity_mps=np.stack([speed, 0 * speed], axis=-1),
        heading_rad=np.zeros_like(x),
        valid=np.ones((agents, FRAMES), bool),
        dt_s=DT_S,
    )
    return Scene(
        scene_id=f"s{number:03d}", unit_id=f"u{number:03d}", source="made", scenario="line", tracks=tracks,
        road=Road((Lane("lane", line, width_m=3.5),)), parameters=said if answered else {},
    )  # fmt: skip


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    path = tmp_path_factory.mktemp("analysis") / "made"
    with CorpusWriter(path, source="made", configuration={}, seed=1) as writer:
        for number in range(60):
            writer.add(scene(number, answered=number < 5))
        return writer.finish()


@pytest.fixture(scope="module")
def found(corpus):
    return analyze([corpus], reference="sim-reference")


def test_everybody_is_counted(found):
    counts = found.about["corpora"]["made"]["counts"]
    assert (counts["motor vehicles"], counts["parked"], counts["drivers"]) == (240, 60, 180)
    assert found.tables["drivers"].height == 180
    for orientation in ("printed", "transposed"):
        own = found.tables["class_shares"].filter(pl.col("orientation") == orientation)
        assert own["count"].sum() == 180
        assert own["value"].sum() == pytest.approx(1.0)


def test_clusters_are_those_that_were_built_in(found):
    """KDSC must call exactly the swinging cars aggressive; their mean speed is drawn from the same law."""
    named = found.tables["drivers"].with_columns(swings=pl.col("agent_id").is_in(["car1", "car3"]))
    assert ((named["kdsc"] == "aggressive") == named["swings"]).all()
    first = found.tables["kdsc_speed"].row(0, named=True)
    assert first["delta_low"] < 0.3 and abs(first["delta"]) < 0.35
    assert (first["n_first"], first["n_second"]) == (84, 42)  # 70 % of 60 units, two of three drive boldly


def test_a_constant_driver_is_stable(found):
    own = found.tables["stability"].filter((pl.col("figure") == "ICC(1) of a") & (pl.col("context") == "all"))
    assert (own["n_drivers"] == 180).all(), own
    assert (own["low"] > 0).all(), own


def test_no_shift_where_parts_are_drawn_from_one_law(found):
    own = found.tables["share_shift"].filter(pl.col("value").is_not_null())
    assert own.height and ((own["low"] <= 1e-9) & (own["high"] >= -1e-9)).mean() > 0.8


def test_answers_are_crossed(found):
    own = found.tables["mdsi_tdbm"]
    assert own["count"].sum() == 5
    assert own.filter(pl.col("mdsi") == "angry_hostile")["count"].sum() == 5


def test_small_cells_are_refused(tmp_path):
    with CorpusWriter(tmp_path / "few", source="made", configuration={}, seed=1) as writer:
        for number in range(4):
            writer.add(scene(number))
        few = writer.finish()
    tables = analyze([few], reference="sim-reference", with_sensitivity=False).tables
    for name in ("class_shares", "boxes", "split_halves", "stability", "kdsc_speed"):
        assert (tables[name]["status"] == "too few").all(), name
    assert tables["drivers"]["kdsc"].null_count() == 12


def test_the_same_corpus_twice_is_refused(corpus):
    with pytest.raises(InputError, match="twice"):
        analyze([corpus, corpus])


def test_the_folder(found, tmp_path):
    from stylesim.report.analysis_page import save_analysis

    page = save_analysis(found, tmp_path / "out").read_text()
    for title in ("TDBM classes", "Kinematics by class", "Is a style a trait?", "KDSC clusters", "Smoother, window"):
        assert title in page
    assert {p.stem for p in (tmp_path / "out" / "tables").iterdir()} == set(found.tables)
    assert pl.read_parquet(tmp_path / "out" / "tables" / "class_shares.parquet").equals(found.tables["class_shares"])
    assert len(list((tmp_path / "out" / "figures").glob("*.png"))) >= 6
    with pytest.raises(InputError, match="not an empty folder"):
        save_analysis(found, tmp_path / "out")


def test_within_nobody_is_on_his_own_scale(corpus, found):
    """Each half judged by the other half's percentiles: as a labeller that was fitted on exactly those drivers."""
    own = analyze([corpus], reference="within", with_sensitivity=False)
    drivers = own.tables["drivers"]
    half = half_of(drivers)
    fitted = fit_within({("track", 11.0): drivers}, FeatureOptions()).labelers
    for judged, labeler in enumerate(fitted):
        others = drivers.filter(half != judged)
        speed = labeler.track_scaler_.low[0][TDBM_FEATURES.index("v_avg")]
        assert speed == pytest.approx(np.percentile(others["v_avg"].to_numpy(), 5))
        again = with_tdbm(drivers.filter(half == judged).drop(*JUDGED), labeler, "track", 11.0)
        assert again["tdbm"].to_list() == drivers.filter(half == judged)["tdbm"].to_list()
    assert 40 <= (half == 0).sum() <= 140
    assert own.about["corpora"]["made"]["judged_within"] is True


def test_within_needs_drivers(tmp_path):
    with CorpusWriter(tmp_path / "few", source="made", configuration={}, seed=1) as writer:
        for number in range(4):
            writer.add(scene(number))
        few = writer.finish()
    found = analyze([few], reference="within", with_sensitivity=False)
    assert (found.tables["drivers"]["tdbm"] == "undetermined").all()
    assert "no scale of its own" in " ".join(found.about["warnings"])


def test_sources_of_a_merged_corpus_by_themselves(tmp_path):
    with CorpusWriter(tmp_path / "both", source="merged", configuration={}, seed=1) as writer:
        for number in range(12):
            writer.add(replace(scene(number), source="one" if number < 5 else "other"))
        both = writer.finish()
    found = analyze([both], reference="sim-reference", by_source=True, with_sensitivity=False)
    counted = {name: about["counts"]["drivers"] for name, about in found.about["corpora"].items()}
    assert counted == {"both: one": 15, "both: other": 21}


def test_many_corpora_on_one_page(corpus, tmp_path):
    """More corpora than can stand side by side: one bar each, and the small ones named once."""
    from stylesim.report.analysis_page import save_analysis

    few = [corpus]
    for n in range(5):
        with CorpusWriter(tmp_path / f"few{n}", source="made", configuration={}, seed=n) as writer:
            writer.add(scene(100 + n))
            few.append(writer.finish())
    page = save_analysis(analyze(few, reference="sim-reference", with_sensitivity=False), tmp_path / "out").read_text()
    assert "Nothing can be said of few0, few1, few2, few3, few4: too few drivers." in page
    assert page.count("few3: 3 drivers are too few for shares.") == 1


def test_unknown_reference(corpus):
    with pytest.raises(InputError, match="within"):
        analyze([corpus], reference="withn")
