"""The page of fidelity: every section, figures, targets, the same bytes again."""

from __future__ import annotations

import base64
import re
from pathlib import Path

import pytest

from stylesim.corpus import CorpusWriter
from stylesim.errors import InputError
from stylesim.evaluation.fidelity import fidelity
from stylesim.evaluation.fidelity_results import Fidelity
from stylesim.report.fidelity_page import save_fidelity
from tests.conftest import make_scene


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Fidelity:
    with CorpusWriter(tmp_path_factory.mktemp("page") / "c", source="made", configuration={}, seed=1) as writer:
        for i in range(6):
            writer.add(make_scene(f"s{i}", n_agents=10, n_frames=230, seed=i, source="sumo"))
        corpus = writer.finish()
    return fidelity(corpus, draws=20)


def test_the_page_says_everything_and_loads_nothing(found, tmp_path: Path):
    text = save_fidelity(found, tmp_path / "f.html").read_text()
    for anchor in ("agreement", "kdsc", "features", "robustness", "excluded", "provenance"):
        assert f'id="{anchor}"' in text
    assert len(re.findall(r'<img src="data:', text)) >= 4
    assert not re.search(r'(?:src|href)="(?!data:|#)', text)
    assert found.about["labelers"]["sim-reference.tdbm"]["sha256"] in text
    assert "wander off" in text and "radius 150 m" in text
    for image in re.findall(r'src="data:image/svg\+xml;base64,([^"]+)"', text):
        assert b"<svg" in base64.b64decode(image)


def test_the_same_bytes_again_and_only_html(found, tmp_path: Path):
    first = save_fidelity(found, tmp_path / "a.html").read_bytes()
    assert save_fidelity(found, tmp_path / "b.html").read_bytes() == first
    with pytest.raises(InputError, match=r"\.html"):
        save_fidelity(found, tmp_path / "f.pdf")
