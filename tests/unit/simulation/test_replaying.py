"""`replay`: identical to the corpus, or it says what differs and what has changed since."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import pytest

pytest.importorskip("highway_env")

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.errors import CorpusError, InputError
from stylesim.simulation.generate import generate
from stylesim.simulation.replaying import chosen_episode, differences, replay
from tests.conftest import make_scene
from tests.unit.simulation.test_generate import tiny


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A small corpus and the folder of its scenario."""
    folder = tmp_path_factory.mktemp("replaying")
    scenario = str(tiny(folder).folder)
    return generate(scenario, "tdbm_spectrum", episodes=3, seed=7, out=folder / "corpus"), scenario


def rewritten(corpus, folder, **changes):
    """The corpus with another configuration in its corpus.json."""
    for path in corpus.path.rglob("*"):
        if path.is_file():
            target = folder / "copy" / path.relative_to(corpus.path)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(path.read_bytes())
    manifest = json.loads((corpus.path / "corpus.json").read_text())
    manifest["configuration"] |= changes
    (folder / "copy" / "corpus.json").write_text(json.dumps(manifest))
    return Corpus(folder / "copy")


@pytest.mark.parametrize("episode", ["tiny-7-00001", "2", ""])
def test_an_episode_comes_out_again(made, episode):
    corpus, scenario = made
    found = replay(corpus, episode, scenario=scenario)
    assert (found.identical, found.changed) == (True, ())
    assert found.scene.scene_id == chosen_episode(corpus, episode).scene_id


def test_what_is_not_the_same_any_more_is_named(made, tmp_path):
    corpus, scenario = made
    other = rewritten(corpus, tmp_path, simulators={"highway-env": "0.0.1"}, styles_sha256="0" * 64)
    changed = replay(other, "0", scenario=scenario).changed
    assert [line.split(":")[0] for line in changed] == ["simulators.highway-env", "styles_sha256"]
    assert "0.0.1 -> " in changed[0]


def test_another_population_gives_another_episode(made, tmp_path):
    corpus, scenario = made
    population = {**corpus.manifest["configuration"]["population"], "shares": [0, 0, 0, 0, 0, 1]}
    found = replay(rewritten(corpus, tmp_path, population=population), "0", scenario=scenario)
    assert not found.identical
    assert found.differences[0] == "styles or flags of the road users"
    assert re.match(r"tracks: [34] road users differ, first 'car-0", found.differences[1])


def test_differences_are_of_every_kind():
    scene = make_scene()
    assert differences(scene, scene) == []
    assert differences(scene, replace(scene, counts={"collisions": 9})) == ["counts"]
    assert differences(scene, replace(scene, signals=None)) == ["lights"]
    fewer = replace(scene, tracks=scene.tracks.select(scene.tracks.kind == 9))
    assert [line.split(":")[0] for line in differences(scene, fewer)] == ["road users", "tracks"]


def test_what_cannot_be_replayed_is_refused(made, tmp_path):
    corpus, scenario = made
    with pytest.raises(InputError, match="give its folder with --scenario"):
        replay(corpus, "0")
    with pytest.raises(InputError, match="its name is 'other'"):
        replay(corpus, "0", scenario=str(tiny(tmp_path, "other").folder))
    with pytest.raises(InputError, match="the last is 2"):
        replay(corpus, "3", scenario=scenario)
    with pytest.raises(InputError, match="did you mean 'tiny-7-00001'"):
        replay(corpus, "tiny-7-0001", scenario=scenario)
    with CorpusWriter(tmp_path / "read", source="made", configuration={}) as writer:
        writer.add(make_scene())
        recorded = writer.finish()
    with pytest.raises(InputError, match="was not generated"):
        replay(recorded, "0")
    with pytest.raises(CorpusError, match="does not say how it was generated"):
        replay(rewritten(corpus, tmp_path, scenarios=[]), "0", scenario=scenario)


def test_a_calibration_file_must_be_the_one(made, tmp_path):
    corpus, scenario = made
    population = {**corpus.manifest["configuration"]["population"], "calibration": "0" * 64}
    other = rewritten(corpus, tmp_path, population=population)
    with pytest.raises(InputError, match="give it with --calibration"):
        replay(other, "0", scenario=scenario)
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("about: nothing")
    with pytest.raises(InputError, match="sha256 differs"):
        replay(other, "0", scenario=scenario, calibration=wrong)
