"""`EpisodePlan`: JSON there and back, what is refused, and how a twin's scene is named and paired."""

from __future__ import annotations

import json

import pytest

from stylesim.errors import InputError
from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.simulation.plan import PLAIN, EpisodePlan, Stressor, Twin, TwinRequest, stressors_of
from tests.conftest import make_scene

STYLE = Population.of(timid=1.0).draw(stream(0, 0, "", "style"))


def test_a_plan_survives_json():
    plan = EpisodePlan(
        stressors=(Stressor(kind="deer", share=0.5),),
        twin=Twin(name="twin", driver="west.3", style=STYLE, from_style="careful", at_s=4.0),
        ego="planner:Mine",
    )
    assert EpisodePlan.model_validate(json.loads(json.dumps(plan.model_dump(mode="json")))) == plan


def test_stressors_are_parsed():
    assert stressors_of("deer,jaywalker:0.25") == (Stressor(kind="deer"), Stressor(kind="jaywalker", share=0.25))


@pytest.mark.parametrize(
    ("text", "says"),
    [("dear", "Did you mean 'deer'"), ("deer:x", "no number"), ("deer:0", r"\(0, 1\]"), ("deer:1.5", r"\(0, 1\]")],
)
def test_bad_stressors_are_refused(text, says):
    with pytest.raises(InputError, match=says):
        stressors_of(text)


def test_doubled_stressors_and_unknown_styles_are_refused():
    with pytest.raises(InputError, match="given 2 times"):
        EpisodePlan(stressors=stressors_of("deer,deer:0.5"))
    with pytest.raises(InputError, match="Did you mean 'timid'"):
        TwinRequest(style="timd")


def test_a_twin_is_paired_with_its_episode_and_stays_in_its_unit():
    scene = make_scene("yellow-7-00001")
    assert PLAIN.applied_to(scene) is scene
    planned = Twin(name="twin", driver="car-2", style=STYLE, from_style="careful", at_s=4.0)
    twin = EpisodePlan(twin=planned).applied_to(scene)
    assert (twin.scene_id, twin.twin_of, twin.unit_id) == ("yellow-7-00001-twin", scene.scene_id, scene.unit_id)
    about = twin.metadata["twin"]
    assert (about["driver"], about["to_style"], about["at_s"], about["new_noise"]) == ("car-2", "timid", 4.0, False)
    assert about["from_style"] == "careful"
