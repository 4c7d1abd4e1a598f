from __future__ import annotations

import base64
import re
from html.parser import HTMLParser

import pytest

from stylesim.errors import InputError
from stylesim.report.html import build_report

CURVES = {
    "none": [
        {"epoch": i, "train_loss": 2.0 / (i + 1), "val_loss": 2.2 / (i + 1), "val_min_fde_m": 3.0 / (i + 1)}
        for i in range(4)
    ]
}


@pytest.fixture(scope="module")
def page(evaluations, hostile_corpus, tmp_path_factory):
    out = tmp_path_factory.mktemp("page") / "report.html"
    curves = {**CURVES, "<b>odd</b>": [{"epoch": 0, "train_loss": 1.0}, {"epoch": 1, "train_loss": float("nan")}]}
    build_report(out, evaluations=evaluations, corpora=[hostile_corpus], training_curves=curves)
    return out.read_text(encoding="utf-8")


class Tags(HTMLParser):
    def __init__(self):
        super().__init__()
        self.seen, self.links, self.open = set(), [], []

    def handle_starttag(self, tag, attrs):
        self.seen.add(tag)
        self.links += [value for name, value in attrs if name in ("src", "href")]
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_hostile_names_stay_text(page):
    tags = Tags()
    tags.feed(page)
    assert not tags.open
    assert "script" not in tags.seen
    assert "b" not in tags.seen
    assert "&lt;img src=x&gt;$fan" in page


def test_nothing_is_loaded_from_elsewhere(page):
    tags = Tags()
    tags.feed(page)
    assert all(link.startswith(("data:image/", "#")) for link in tags.links)
    assert "http" not in re.sub(r"http-equiv", "", re.sub(r'src="data:[^"]*"', "", page))
    for image in re.findall(r"data:image/svg\+xml;base64,([A-Za-z0-9+/=]+)", page):
        svg = base64.b64decode(image).decode()
        assert not re.findall(r'(?:href|src)="(?!#)[^"]*"', re.sub(r'href="data:image/png[^"]*"', "", svg))
        assert "<script" not in svg


def test_every_section_is_there_with_its_numbers(page, evaluations):
    for anchor in ("errors", "labels", "yellow", "training", "scenes", "provenance"):
        assert f'<h2 id="{anchor}">' in page
    assert evaluations[0].about["corpus"]["fingerprint"] in page
    overall = evaluations[0].overall.metrics["min_fde_m"]
    assert f"{overall.value:.2f}" in page
    assert "too few" in page
    assert "Difference to constant velocity" in page


def test_same_input_same_bytes(evaluations, hostile_corpus, tmp_path):
    part = hostile_corpus.with_info(hostile_corpus.info[:3])
    given = {"evaluations": evaluations[:1], "corpora": [part], "training_curves": CURVES}
    pages = [build_report(tmp_path / f"{i}.html", **given) for i in range(2)]
    assert pages[0].read_bytes() == pages[1].read_bytes()


def test_a_report_that_fails_leaves_nothing(evaluations, tmp_path, monkeypatch):
    def broken(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_bytes", broken)
    with pytest.raises(Exception, match="disk is full"):
        build_report(tmp_path / "r.html", evaluations=evaluations[:1])
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_reported_is_refused(evaluations, tmp_path):
    with pytest.raises(InputError, match="nothing to report"):
        build_report(tmp_path / "r.html")
    with pytest.raises(InputError, match=r"\.html"):
        build_report(tmp_path / "r.pdf", evaluations=evaluations)
    with pytest.raises(InputError, match="same forecaster name"):
        build_report(tmp_path / "r.html", evaluations=[evaluations[0], evaluations[0]])


def test_training_data_in_the_test_is_a_warning(world, tmp_path):
    from stylesim.evaluation.evaluate import evaluate

    corpus = world.write(tmp_path / "c", [world.scene(e) for e in range(3)], split="train")
    one = evaluate(world.ConstantVelocity(), corpus, by=("tdbm",))
    page = build_report(tmp_path / "r.html", evaluations=[one]).read_text()
    assert "evaluated on scenes of the split(s) train" in page
    assert "too few" in page  # 15 drivers: nothing is claimed anywhere


def test_rows_that_begin_alike_share_their_first_cell():
    from stylesim.report.tables import Cell, grouped

    rows = [(Cell("a"), Cell("1")), (Cell("a"), Cell("2")), (Cell("b"), Cell("3")), (Cell("a"), Cell("4"))]
    assert grouped(rows) == (
        (Cell("a", rows=2), Cell("1")), (Cell("2"),), (Cell("b"), Cell("3")), (Cell("a"), Cell("4")),
    )  # fmt: skip
