"""Every benchmark must at least start: a missing import would show only after somebody waited for it."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest

from benchmarks.__main__ import LONG, SHORT

FOLDER = Path(__file__).parents[3] / "benchmarks"
COMMANDS = sorted(file.stem for file in FOLDER.glob("[a-z]*.py") if '__name__ == "__main__"' in file.read_text())


@pytest.mark.parametrize("name", COMMANDS)
def test_help_is_printed(name, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    monkeypatch.delitem(sys.modules, f"benchmarks.{name}", raising=False)  # another one may have imported it
    with pytest.raises(SystemExit) as ended:
        runpy.run_module(f"benchmarks.{name}", run_name="__main__")
    assert ended.value.code == 0
    assert "usage:" in capsys.readouterr().out


def test_each_is_either_run_by_make_bench_or_named_as_long():
    assert sorted([*SHORT, *LONG]) == COMMANDS
