"""`--out figures.json` and `--report page.html` of the verbs that measure."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from stylesim.cli.console import say
from stylesim.errors import InputError


def check_endings(out: Path | None, report: Path | None = None) -> None:
    """InputError, before any work, for files with another ending than what is written into them."""
    if out is not None and out.suffix != ".json":
        raise InputError(f"--out {out}: figures are written as .json")
    if report is not None and report.suffix != ".html":
        raise InputError(f"--report {report}: a report is an .html file")


def write_figures(out: Path | None, figures: Mapping[str, Any]) -> None:
    """The figures as JSON, whole or not at all, and where they are; nothing without `out`."""
    from stylesim.corpus.files import json_bytes, write_whole

    if out is not None:
        write_whole(out, json_bytes(figures))
        say(f"{out}")
