"""`stylesim export`: files for other programs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from tests.unit.cli.conftest import Said


def test_vehicle_types_for_sumo(stylesim: Callable[..., Said], tmp_path: Path) -> None:
    out = tmp_path / "styles.add.xml"
    done = stylesim("export", "sumo-vtypes", "naturalistic", "--reweight", "timid=0.5", "--out", out)
    assert done.code == 0
    assert 'type="stylesim.naturalistic+timid=0.5"' in done.out
    assert "vTypeDistribution" in out.read_text()
    again = stylesim("export", "sumo-vtypes", "naturalistic", "--out", out)
    assert again.code == stylesim("generate", "highwy", "--out", tmp_path / "y").code  # as any bad input
    assert "there already" in again.err


def test_a_misspelt_population_is_named(stylesim: Callable[..., Said], tmp_path: Path) -> None:
    done = stylesim("export", "sumo-vtypes", "naturalstic", "--out", tmp_path / "x")
    assert done.code != 0
    assert "'naturalistic'" in done.err
    assert not (tmp_path / "x").exists()
