"""The command line as a user meets it: arguments in, exit code and two streams out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from stylesim.cli import console, main
from stylesim.corpus import CorpusWriter
from tests.conftest import make_scene


@dataclass(frozen=True)
class Said:
    code: int
    out: str
    err: str


@pytest.fixture
def stylesim(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Said]:
    """`stylesim("verify", path)`: what the command said. A traceback or an internal error fails the test."""
    from rich.console import Console

    def run(*argv: object) -> Said:
        capsys.readouterr()
        monkeypatch.setattr(console, "_out", Console(width=200, highlight=False, soft_wrap=True))
        monkeypatch.setattr(console, "_err", Console(stderr=True, width=200, highlight=False, soft_wrap=True))
        try:
            main([str(word) for word in argv])
            code = 0
        except SystemExit as end:
            code = int(end.code or 0)
        out, err = capsys.readouterr()
        assert "Traceback" not in err
        assert "internal error" not in err, err
        return Said(code, out, err)

    return run


def write_corpus(out: Path, n: int = 6, *, splits: bool = True) -> Path:
    """A small corpus: two thirds train, then val and test."""
    with CorpusWriter(out, source="made", configuration={"n": n}, seed=1) as writer:
        for i in range(n):
            split = "train" if i < n * 2 // 3 else ("val" if i % 2 else "test")
            writer.add(make_scene(f"scene-{i}", seed=i, n_agents=4), split=split if splits else "")
        writer.finish()
    return out


@pytest.fixture
def corpus(tmp_path: Path) -> Path:
    return write_corpus(tmp_path / "corpus")
