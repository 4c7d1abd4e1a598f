import pytest

from stylesim.envs.crowd import Crowd, resolved_population, resolved_scenario
from stylesim.errors import InputError
from stylesim.population import Population


def test_population_by_name_object_shares_and_text() -> None:
    assert resolved_population(None, None).name == "naturalistic"
    crowd = Population.load("rare_heavy")
    assert resolved_population(crowd, None) is crowd
    assert resolved_population(None, {"aggressive": 0.3, "careful": 0.7}).by_class["careful"] == 0.7
    assert resolved_population(None, "aggressive=0.3, careful=0.7").by_class["aggressive"] == 0.3


@pytest.mark.parametrize(
    ("population", "styles", "words"),
    [
        ("naturalstic", None, "'naturalistic'"),
        (None, {"agressive": 1.0}, "'aggressive'"),
        (None, {"aggressive": 0.4}, "sum to 0.4"),
        (None, "aggressive", "NAME=SHARE"),
        ("naturalistic", {"timid": 1.0}, "not both"),
        (3, None, "not int"),
    ],
)
def test_what_does_not_fit_is_refused_with_the_nearest_name(population, styles, words) -> None:
    with pytest.raises(InputError, match=words):
        resolved_population(population, styles)


def test_scenarios() -> None:
    assert resolved_scenario("yellow_light", backend="sumo").name == "yellow_light"
    with pytest.raises(InputError, match="'yellow_light'"):
        resolved_scenario("yelow_light", backend="sumo")
    with pytest.raises(InputError, match=r"runs in 'highway'.*yellow_light"):
        resolved_scenario("highway", backend="sumo")


def test_options_change_a_copy() -> None:
    crowd = Crowd(resolved_population("naturalistic", None), resolved_scenario("highway", backend="highway"))
    changed = crowd.changed({"styles": {"timid": 1.0}}, backend="highway")
    assert changed.population.by_class["timid"] == 1.0
    assert changed.scenario == crowd.scenario
    assert crowd.changed({}, backend="highway") == crowd
    with pytest.raises(InputError, match="'population'"):
        crowd.changed({"populaton": "naturalistic"}, backend="highway")
