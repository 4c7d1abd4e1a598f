from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from stylesim.evaluation.label_summary import label_summary
from stylesim.report import style_figures
from stylesim.report.figures import error_figure, loss_figure
from stylesim.report.picture import agent_styles, busiest_frames, scene_figure
from stylesim.report.tables import difference_table, error_table, number
from stylesim.report.theme import STYLE_COLOUR, STYLE_MARKER, style_colour
from stylesim.style import STYLE_CLASSES


def texts(figure):
    return [text.get_text() for text in figure.findobj(lambda artist: hasattr(artist, "get_text"))]


def test_error_figure_shows_n_units_and_refusals(evaluations):
    figure = error_figure(evaluations, "tdbm")
    seen, timid = texts(figure), evaluations[0].slices_by("tdbm")[4].size
    ticks = [text.get_text() for text in figure.axes[0].get_xticklabels()]
    assert ticks[4] == f"timid\nn = {timid.n_drivers}\n{timid.n_units} units"
    assert seen.count("too few") == 5
    assert "minFDE (m)" in seen
    assert "<img src=x>$fan" in seen  # as it is: no formula


def test_a_figure_of_refused_cells_is_none(evaluations):
    assert error_figure(evaluations, "kdsc") is None
    assert loss_figure({"empty": []}) is None


def test_scene_picture_has_a_dot_per_tenth_and_the_style_colours(hostile_corpus):
    scene = next(iter(hostile_corpus))
    figure = scene_figure(scene, hostile_corpus.labels("tdbm", "track"), frames=(0, 100))
    dots = [c for c in figure.axes[0].collections if c.get_label().startswith("_") and len(c.get_offsets()) > 1]
    assert sum(len(c.get_offsets()) for c in dots) == scene.tracks.valid[:, :100].sum()
    used = {tuple(c.get_facecolor()[0][:3]) for c in dots}
    styles = agent_styles(scene, hostile_corpus.labels("tdbm", "track"))
    assert used == {to_rgb(style_colour(name)) for name in styles}


def test_a_scene_without_road_or_labels_is_drawn(world):
    from dataclasses import replace

    scene = replace(world.scene(1), road=None)
    assert "commanded class" in scene_figure(scene).get_suptitle()
    with pytest.raises(ValueError, match="frames"):
        scene_figure(scene, frames=(0, 10_000))


def test_the_busiest_stretch_is_found(world):
    from dataclasses import replace

    scene = world.scene(1)
    valid = scene.tracks.valid.copy()
    valid[:, :30] = False
    hidden = replace(scene, tracks=replace(scene.tracks, valid=valid))
    assert busiest_frames(hidden, 5.0) == (30, 80)


def test_style_figures_say_n(hostile_corpus):
    summary = label_summary(hostile_corpus)
    figure = style_figures.class_distribution_figure([summary])
    assert len(figure.axes) == 2  # both orientations
    assert "sumo, n = 180" in texts(figure)
    assert any("n = 30" in text for text in texts(style_figures.confusion_figure(summary)))
    assert "0.79 to 0.84" in style_figures.rank_note(summary)


def test_tables_span_and_pair(evaluations):
    table = error_table(evaluations, "tdbm")
    assert table.rows[0][0].rows == 2
    assert len(table.rows[0]) == len(table.rows[1]) + 1 == len(table.headings)
    change = difference_table(evaluations, "all", seed=0)
    assert change.rows[0][3].look == "better"
    assert difference_table(evaluations[:1], "all", seed=0) is None


@pytest.mark.parametrize(("value", "text"), [(-0.001, "0.00"), (-1.5, "−1.50"), (0.0, "0.00"), (2.345, "2.35")])
def test_numbers(value, text):
    assert number(value + 1e-9, 2) == text


# Machado, Oliveira, Fernandes 2009, severity 1 [recalled]: what people with each deficiency see, in linear RGB
DEFICIENCIES = {
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "none": np.eye(3).tolist(),
}


def lab(linear):
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ linear
    f = np.cbrt(xyz / [0.9505, 1.0, 1.089])
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("kind", DEFICIENCIES)
def test_classes_can_be_told_apart(kind):
    rgb = {name: np.array(to_rgb(STYLE_COLOUR[name])) for name in STYLE_CLASSES}
    linear = {name: np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4) for name, c in rgb.items()}
    seen = {name: lab(np.clip(np.array(DEFICIENCIES[kind]) @ c, 0, 1)) for name, c in linear.items()}
    gaps = {pair: np.linalg.norm(seen[pair[0]] - seen[pair[1]]) for pair in combinations(STYLE_CLASSES, 2)}
    assert min(gaps.values()) > 10, min(gaps, key=gaps.get)  # 2.3 is just noticeable
    assert len({STYLE_MARKER[name] for name in STYLE_CLASSES}) == 6
