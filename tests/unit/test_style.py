from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stylesim.errors import InputError
from stylesim.population import Population, populations
from stylesim.style import CLASS_INTERVAL, CLASS_KNOB, PHYSICAL_FIELDS, STYLE_CLASSES, class_of_knob
from stylesim.styles import calibration_file, load_calibration, road_kind, style_table


def test_every_class_sits_at_its_place_of_the_knob():
    for name, place in CLASS_KNOB.items():
        assert class_of_knob(place) == name
        assert style_table().at(place).name == name


@given(st.floats(-1, 1))
def test_the_class_of_a_place_is_the_one_whose_interval_holds_it(knob):
    low, high = CLASS_INTERVAL[class_of_knob(knob)]
    assert low - 1e-9 <= knob <= high + 1e-9


@given(st.floats(-1, 1))
def test_styles_between_two_places_lie_between_their_parameters(knob):
    table, places = style_table(), sorted([*CLASS_KNOB.values(), 0.0])
    low = max(p for p in places if p <= knob)
    high = min(p for p in places if p >= knob)
    a, b, got = table.at(low), table.at(high), table.at(knob)
    for key in PHYSICAL_FIELDS:
        ends = sorted([getattr(a, key), getattr(b, key)])
        assert ends[0] - 1e-9 <= getattr(got, key) <= ends[1] + 1e-9


def test_the_neutral_driver_stops_like_the_published_one():
    neutral = style_table().at(0.0)
    assert (neutral.yellow_slope_per_s, neutral.yellow_midpoint_s) == (2.14, 2.88)


def test_individuals_differ_within_the_limits_of_the_table():
    table = style_table()
    drawn = [table.at(0.1, np.random.default_rng(i)) for i in range(200)]
    for key in PHYSICAL_FIELDS:
        values = np.array([getattr(d, key) for d in drawn])
        parameter = table.parameters[key]
        assert parameter.low <= values.min() <= values.max() <= parameter.high
        assert (values.std() > 0) == (parameter.spread > 0)


@pytest.mark.parametrize("name", ["naturalistic", "tdbm_spectrum", "rare_heavy"])
def test_shipped_populations_load_and_are_drawn_as_they_say(name):
    population = Population.load(name)
    rng = np.random.default_rng(0)
    drawn = [population.draw(rng).name for _ in range(3000)]
    for style, share in population.by_class.items():
        assert abs(drawn.count(style) / 3000 - share) < 4 * np.sqrt(share * (1 - share) / 3000) + 1e-9


def test_reweighting_sets_one_and_scales_the_rest():
    base = Population.load("naturalistic")
    heavy = base.reweighted(aggressive=0.3)
    assert heavy.by_class["aggressive"] == pytest.approx(0.3)
    assert sum(heavy.shares) == pytest.approx(1)
    was = base.by_class["careful"] / base.by_class["timid"]
    assert heavy.by_class["careful"] / heavy.by_class["timid"] == pytest.approx(was)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: Population.of(agressive=1.0), "Did you mean 'aggressive'"),
        (lambda: Population.of(aggressive=0.5), "sum to 0.5"),
        (lambda: Population.of(aggressive=1.5, timid=-0.5), "must be a number >= 0"),
        (lambda: Population.of(aggressive=float("nan")), "must be a number >= 0"),
        (lambda: Population.load("naturalistik"), "Did you mean 'naturalistic'"),
        (lambda: Population.load("nowhere.yaml"), "no such file"),
        (lambda: Population.load("naturalistic").reweighted(aggressive=0.9, timid=0.9), "more than 1"),
        (lambda: Population.of(timid=1.0).reweighted(timid=0.5), "nothing is left to scale"),
    ],
)
def test_bad_shares_are_refused_with_a_reason(call, says):
    with pytest.raises(InputError, match=says):
        call()


def test_unknown_keys_name_the_nearest_known_one(tmp_path):
    file = tmp_path / "crowd.yaml"
    file.write_text("about: x\nsource: made\nshare: {timid: 1.0}\n")
    with pytest.raises(InputError, match="did you mean 'shares'"):
        Population.load(str(file))
    file.write_text("about: [unclosed")
    with pytest.raises(InputError, match="not a YAML file"):
        Population.load(str(file))


def test_all_shipped_populations_are_listed():
    assert set(populations()) >= {"naturalistic", "tdbm_spectrum", "rare_heavy"}
    assert "styles" not in populations()
    assert len(STYLE_CLASSES) == 6


CALIBRATED = """
about: made
backend: sumo
roads:
  motorway:
    lane_wander_m:
      aggressive: {calm: 0.4, bold: 0.5}
      reckless: {calm: 0.6, bold: 0.6, spread: 0.1}
      threatening: {calm: 0.1, bold: 0.1}
      careful: {calm: 0.3, bold: 0.3}
      cautious: {calm: 0.1, bold: 0.1}
      timid: {calm: 0.05, bold: 0.05}
"""


def calibrated(tmp_path, text=CALIBRATED):
    path = tmp_path / "styles.sumo.yaml"
    path.write_text(text)
    return path


def test_a_calibrated_class_has_its_own_range_up_to_its_border(tmp_path):
    table = style_table("sumo", calibration=calibrated(tmp_path))
    assert table.at(0.801, limit_mps=30.0).lane_wander_m == pytest.approx(0.4005)
    assert table.at(1.0, limit_mps=30.0).lane_wander_m == 0.5
    assert table.at(0.799, limit_mps=30.0).lane_wander_m == 0.6  # reckless begins here
    assert table.at(0.0, limit_mps=30.0) == style_table().at(0.0)  # neutral stays the anchor
    assert table.at(0.9) == style_table().at(0.9)  # nothing was calibrated for other roads


def test_nobody_wishes_to_go_faster_than_is_comfortable(tmp_path):
    speeds = "".join(
        f"    {key}:\n" + "".join(f"      {name}: {{calm: {v}, bold: {v}}}\n" for name in STYLE_CLASSES)
        for key, v in (("desired_speed_factor", 1.1), ("comfortable_speed_mps", 30.0))
    )
    table = style_table("sumo", calibration=calibrated(tmp_path, CALIBRATED + speeds))
    assert table.at(0.5, limit_mps=25.0).desired_speed_factor == pytest.approx(1.1)
    assert table.at(0.5, limit_mps=40.0).desired_speed_factor == pytest.approx(0.75)


def test_a_population_drives_by_the_calibration_that_it_is_given(tmp_path):
    crowd = Population.of(aggressive=1.0).calibrated(calibrated(tmp_path))
    rng = np.random.default_rng(0)
    drawn = [crowd.draw(rng, backend="sumo", limit_mps=30.0).lane_wander_m for _ in range(50)]
    assert 0.4 <= min(drawn) < max(drawn) <= 0.5
    with pytest.raises(InputError, match="calibrated for 'sumo'"):
        crowd.draw(rng, backend="highway")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("lane_wander_m", "lane_wonder_m"), "Did you mean 'lane_wander_m'"),
        (("timid:", "timidd:"), "must name each of"),
        (("motorway", "motorways"), "roads.motorways"),
        (("bold: 0.5", "bolt: 0.5"), "did you mean 'bold'"),
    ],
)
def test_a_calibration_that_does_not_fit_is_refused(tmp_path, change, says):
    with pytest.raises(InputError, match=says):
        load_calibration(calibrated(tmp_path, CALIBRATED.replace(*change)))


def test_the_kind_of_road_follows_from_the_limit():
    assert [road_kind(v) for v in (None, 19.4, 22.22, 33.3)] == ["other", "other", "motorway", "motorway"]


@pytest.mark.parametrize("backend", ["sumo", "highway"])
def test_what_ships_as_calibrated_says_where_it_comes_from(backend):
    path = calibration_file(backend)
    if path is None:
        pytest.skip(f"no calibration ships for {backend}")
    found = load_calibration(path)
    assert found.backend == backend
    assert set(found.provenance) >= {"command", "scenarios", "seeds", "scaler_sha256", "versions"}
    drawn = {name: style_table(backend).at(knob, limit_mps=33.3) for name, knob in CLASS_KNOB.items()}
    wander = {name: style.lane_wander_m for name, style in drawn.items()}
    assert wander["reckless"] == max(wander.values())
    assert drawn["timid"].time_headway_s > drawn["aggressive"].time_headway_s
