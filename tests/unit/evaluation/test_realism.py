"""Distances between distributions against scipy, and realism of corpora whose answers are known."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import entropy, wasserstein_distance

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.errors import InputError
from stylesim.evaluation import distances
from stylesim.evaluation.realism import POOLED, realism
from stylesim.evaluation.realism_profile import bins_of, profile_of
from stylesim.evaluation.realism_quantities import BINS, CELLS, QUANTITIES
from stylesim.labelers.reference import default_labeler
from stylesim.report.realism_page import save_realism
from stylesim.road import Lane, Road
from tests.conftest import make_scene
from tests.unit.labelers.made import clock, scene_of

counts = st.lists(st.integers(0, 50), min_size=20, max_size=20).map(lambda v: np.array(v, float))


@given(counts, counts)
@settings(max_examples=50, deadline=None)
def test_wasserstein_is_scipys_on_bin_centres(first, second):
    if first.sum() == 0 or second.sum() == 0:
        assert np.isnan(distances.wasserstein(first, second, 0.5))
        return
    at = np.arange(20) * 0.5
    assert distances.wasserstein(first, second, 0.5) == pytest.approx(
        wasserstein_distance(at, at, first, second), abs=1e-9
    )


@given(counts)
@settings(max_examples=50, deadline=None)
def test_no_likelihood_is_better_than_the_real_distributions_own(real):
    if real.sum() == 0:
        return
    best = distances.best_likelihood(real)
    assert best == pytest.approx(np.exp(-entropy(real)))
    other = np.roll(real, 3) + 1.0
    assert distances.likelihood(other, real, samples=1e6) <= best + 1e-9
    assert distances.likelihood(real, real, samples=1e9) == pytest.approx(best, rel=1e-3)


@given(st.lists(st.floats(0.0, 9.99), min_size=200, max_size=400), st.sampled_from([0.15, 0.5, 0.85]))
@settings(max_examples=30, deadline=None)
def test_quantiles_are_right_to_a_bin(values, share):
    histogram, _ = np.histogram(values, bins=50, range=(0, 10))
    found = float(distances.quantile(histogram.astype(float), share, 0.0, 0.2))
    low, high = (np.quantile(values, s, method=m) for s, m in ((share, "lower"), (share, "higher")))
    assert low - 0.2 <= found <= high + 0.2


def test_matching_undoes_another_mix_of_cells():
    """Two cells with one distribution each; the mix differs: plain distance large, matched none."""
    cells = np.array([[80.0, 20.0, 0, 0], [0, 0, 50.0, 50.0]])
    ours, theirs = cells * [[9.0], [1.0]], cells
    a, b, covered = distances.matched(ours, theirs)
    assert covered == 1.0
    assert distances.wasserstein(ours.sum(axis=0), theirs.sum(axis=0), 1.0) > 0.5
    assert distances.wasserstein(a, b, 1.0) == pytest.approx(0.0)
    gone = ours.copy()
    gone[1] = 0.0
    assert distances.matched(gone, theirs)[2] == pytest.approx(0.5)


def written(out: Path, n: int, *, first: int = 0, units: bool = True, faster: float = 0.0) -> Corpus:
    with CorpusWriter(out, source="made", configuration={"n": n, "first": first, "faster": faster}, seed=1) as writer:
        for i in range(first, first + n):
            scene = make_scene(f"s{i}", n_agents=12, n_frames=130, seed=i, unit_id=None if units else "one")
            tracks = scene.tracks
            shift = np.float32(faster) * np.arange(tracks.n_frames, dtype=np.float32) * np.float32(0.1)
            moved = tracks.position_m + np.stack([shift, 0 * shift], axis=-1)
            writer.add(replace(scene, start_s=13.0 * i, tracks=replace(tracks, position_m=moved)))
        return writer.finish()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("realism")


def test_traffic_of_one_kind_is_as_far_apart_as_halves_of_it(folder):
    found = realism(written(folder / "a", 24), [written(folder / "b", 24, first=100)], draws=40)
    (one,) = found.comparisons
    assert (one.blocks, one.within_unit) == (24, False)
    for quantity in one.quantities:
        if quantity.quantity in ("speed", "acceleration", "lateral_offset"):
            assert quantity.covered > 0.9
            assert quantity.matched.value < 1.5 * quantity.floor.high
            assert quantity.likelihood == pytest.approx(quantity.best_likelihood, rel=0.15)
    rms = one.ratios[-1]
    assert rms.met and rms.ratio.value == pytest.approx(1.0, abs=0.1)
    told = [style for style in one.styles if style.matched is not None]
    assert told and len(told) < len(one.styles)
    for style in one.styles:
        assert (style.matched is None) is (min(style.sim_drivers, style.real_drivers) < 30)
    for style in told:
        speed = style.matched["speed"]
        assert 0.0 <= speed.low < speed.high and speed.value < speed.high
    json.dumps(found.to_dict(), allow_nan=False)


def test_faster_traffic_is_that_much_faster_and_the_page_says_so(folder, tmp_path):
    sim, real = written(folder / "c", 8, faster=3.0), written(folder / "d", 6, units=False)
    found = realism(sim, [real, written(folder / "e", 5, first=50)], draws=20)
    plain = found.comparisons[0].quantities[0]
    assert plain.distance.value == pytest.approx(3.0, abs=0.35)
    assert found.comparisons[0].within_unit
    assert found.comparisons[-1].real == POOLED
    assert set(found.between_recordings) == {("d", "e")}
    page = save_realism(found, tmp_path / "r.html").read_bytes()
    assert page == save_realism(found, tmp_path / "again.html").read_bytes()
    assert b"Against all recordings" in page and b"From site to site" in page
    with pytest.raises(InputError, match=r"\.html"):
        save_realism(found, tmp_path / "r.csv")


def test_a_profile_holds_every_moving_second(folder):
    corpus = written(folder / "f", 3)
    profile = profile_of(corpus, default_labeler("tdbm"))
    assert profile.histogram.shape[2:] == (CELLS, len(QUANTITIES), BINS)
    seconds = sum(scene.tracks.valid.sum() * 0.1 for scene in corpus)
    assert profile.pooled()[..., 0, :].sum() == pytest.approx(seconds)
    assert profile.drivers.sum() == 36


def test_values_beyond_the_span_count_in_its_last_bin():
    """Two cars that close in by a rounding error have a time to collision of 1e300 s."""
    found = bins_of(np.array([1e300, 23.99, 24.0, 0.1, -1e300]), QUANTITIES["ttc"])
    assert found.tolist() == [BINS - 1, BINS - 1, BINS - 1, 0, 0]


def test_the_edge_of_the_road_is_beyond_the_neighbouring_lanes(tmp_path):
    line = np.array([[-200.0, 0.0], [1500.0, 0.0]])
    road = Road((
        Lane("a", line, width_m=4.0, left_neighbour="b"),
        Lane("b", line + np.array([0.0, 4.0]), width_m=4.0, left_neighbour="c", right_neighbour="a"),
        Lane("c", line + np.array([0.0, 8.0]), width_m=4.0, left_neighbour="a", right_neighbour="b"),  # in a circle
    ))  # fmt: skip
    t = clock()
    scene = scene_of([np.stack([12 * t, np.full(len(t), y)], axis=1) for y in (0.5, 4.0)], road=road)
    with CorpusWriter(tmp_path / "c", source="made", configuration={}) as writer:
        writer.add(scene)
        corpus = writer.finish()
    place = list(QUANTITIES).index("road_edge")
    edge = profile_of(corpus, default_labeler("tdbm")).pooled().sum(axis=(0, 1))[place]
    one = QUANTITIES["road_edge"]
    at = [one.low + one.width * (i + 0.5) for i in np.flatnonzero(edge)]
    # Car 0: right edge at -2, its side at 0.5 - 0.9; car 1: right edge at -2, its side at 4 - 0.9.
    assert at == [pytest.approx(1.6, abs=one.width), pytest.approx(5.1, abs=one.width)]


def test_what_cannot_be_compared(folder, tmp_path):
    corpus = written(folder / "g", 4)
    with pytest.raises(InputError, match="at least one recorded corpus"):
        realism(corpus, [])
    with pytest.raises(InputError, match="given twice"):
        realism(corpus, [corpus])
    parked = scene_of([np.zeros((110, 2))])
    with CorpusWriter(tmp_path / "p", source="made", configuration={}) as writer:
        writer.add(parked)
        standing = writer.finish()
    with pytest.raises(InputError, match="no motor vehicle moves"):
        realism(corpus, [standing])
