"""Which driver becomes a twin, and what `generate` writes of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import yaml

pytest.importorskip("libsumo")

from stylesim.cli.generating import wanted_twins
from stylesim.errors import InputError
from stylesim.population import Population
from stylesim.resources import scenarios_dir
from stylesim.simulation.generate import generate, realised_styles
from stylesim.simulation.plan import TwinRequest
from stylesim.simulation.twins import candidates, twins_of
from tests.conftest import make_scene

CROWD = Population.load("tdbm_spectrum")


def named(scene, *, valid=None):
    return scene if valid is None else replace(scene, tracks=replace(scene.tracks, valid=valid))


def test_candidates_are_on_the_road_then_and_long_enough_after():
    scene = make_scene(n_frames=130)  # the last of five comes after 32 frames and leaves 32 before the end
    assert candidates(scene, TwinRequest(at_s=2.0)) == (0, 1, 2, 3)
    assert candidates(scene, TwinRequest(at_s=4.0)) == (0, 1, 2, 3, 4)
    assert candidates(scene, TwinRequest(at_s=6.0)) == (0, 1, 2, 3)
    assert candidates(scene, TwinRequest(at_s=8.0)) == ()
    assert candidates(scene, TwinRequest()) == (0, 1, 2, 3, 4)


def test_who_has_the_wanted_style_already_is_no_candidate():
    scene = make_scene()
    own = scene.tracks.driver[1].name
    others = tuple(i for i, driver in enumerate(scene.tracks.driver) if driver.name != own)
    assert candidates(scene, TwinRequest(style=own)) == others


def test_the_null_differs_from_the_twin_in_style_and_noise_only():
    twin, null = twins_of(make_scene(), TwinRequest(at_s=1.0, style="timid"), CROWD, backend="sumo", seed=3, episode=4)
    assert (twin.driver, twin.at_s) == (null.driver, null.at_s)
    assert (twin.style.name, twin.new_noise, null.new_noise) == ("timid", False, True)
    assert null.style.name == null.from_style == twin.from_style != "timid"
    again, *none = twins_of(
        make_scene(), TwinRequest(at_s=1.0, style="timid", null=False), CROWD, backend="sumo", seed=3, episode=4
    )
    assert again == twin and not none


@pytest.fixture
def short(tmp_path):
    """A short on-ramp as a folder of its own."""
    folder = tmp_path / "short"
    folder.mkdir()
    for path in (scenarios_dir() / "ramp_merge").iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    raw = yaml.safe_load((folder / "scenario.yaml").read_text()) | {"name": "short", "warm_up_s": 20, "duration_s": 9}
    (folder / "scenario.yaml").write_text(yaml.safe_dump(raw))
    return str(folder)


def test_generate_pairs_them_and_gives_the_same_bytes_with_two_workers(short, tmp_path):
    request = {"episodes": 3, "seed": 4, "twins": TwinRequest(at_s=3.0, style="aggressive")}
    one = generate(short, CROWD, out=tmp_path / "one", **request)
    two = generate(short, CROWD, out=tmp_path / "two", workers=2, **request)
    assert one.fingerprint == two.fingerprint
    assert [info.twin_of for info in one.info] == [
        of for episode in range(3) for of in ("", f"short-4-{episode:05d}", f"short-4-{episode:05d}")
    ]
    assert one.manifest["configuration"]["twins"] == {"at_s": 3.0, "style": "aggressive", "null": True}
    assert one.manifest["counts"]["twins"] == 6
    first = one.scene("short-4-00000")
    assert sum(realised_styles(one)["short"].values()) == sum(i.n_agents for i in one.info if not i.twin_of)
    for name in ("twin", "null"):
        other = one.scene(f"short-4-00000-{name}")
        assert (other.unit_id, other.metadata["twin"]["at_s"]) == (first.unit_id, 3.0)
        rows = [other.tracks.agent_id.index(a) for a in first.tracks.agent_id if first.tracks.valid[:, :31].any()]
        np.testing.assert_array_equal(other.tracks.position_m[rows, :31], first.tracks.position_m[: len(rows), :31])


def test_an_episode_without_a_candidate_is_counted(short, tmp_path):
    timid = Population.of(timid=1.0)
    corpus = generate(short, timid, out=tmp_path / "c", episodes=1, seed=4, twins=TwinRequest(at_s=3.0, style="timid"))
    assert [info.twin_of for info in corpus.info] == [""]
    assert corpus.manifest["counts"]["episodes_without_a_twin"] == 1


def test_a_moment_too_late_is_refused_before_any_work(short, tmp_path):
    with pytest.raises(InputError, match="choose a time below 4 s"):
        generate(short, CROWD, out=tmp_path / "c", episodes=1, seed=4, twins=TwinRequest(at_s=5.0))
    assert not list(tmp_path.glob("c*"))


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ((3.0, "start", "timid"), "choose one"),
        ((None, None, "timid"), "say when"),
        ((None, "end", ""), "'start'"),
        ((-1.0, None, ""), "0 s or later"),
        ((1.0, None, "timd"), "Did you mean 'timid'"),
    ],
)
def test_contradicting_options_are_refused(options, says):
    with pytest.raises(InputError, match=says):
        wanted_twins(*options, null=True)
