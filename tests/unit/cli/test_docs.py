"""What the README and the pages under docs/ print must be there: verbs, options, modules, files."""

from __future__ import annotations

import ast
import re
import shlex
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from stylesim.cli.main import app

ROOT = Path(__file__).parents[3]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
FENCED = re.compile(r"^```\w*\n(.*?)^```", re.MULTILINE | re.DOTALL)
IN_A_BLOCK = re.compile(r"^(stylesim [a-z].*)", re.MULTILINE)
IN_PROSE = re.compile(r"(?:^ {4}|`)(stylesim [a-z][^`\n]*)", re.MULTILINE)
OUTLINES = {"architecture.md"}  # its block of Python is an outline of the corpus API, not a program
PLACEHOLDER = re.compile(r"[…|<>]|\.\.\.")
VERBS = get_command(app)
pages = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)


def check_command(words: list[str], command: Any) -> None:
    """AssertionError for a verb or an option that does not exist."""
    while hasattr(command, "commands") and words:
        word = words.pop(0)
        if PLACEHOLDER.search(word) or word.isupper():
            return
        assert word in command.commands, f"no verb {word!r}"
        command = command.commands[word]
    known = {name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)} | {"--help"}
    for word in words:
        if word.startswith("--"):
            assert word.partition("=")[0] in known, f"{command.name} has no option {word!r}"


@pages
def test_printed_commands_exist(page):
    text = page.read_text()
    blocks = "\n".join(FENCED.findall(text))
    for found in [*IN_A_BLOCK.findall(blocks), *IN_PROSE.findall(FENCED.sub("", text))]:
        first = re.split(r"\s#|[;&>(]|\s\|", found, maxsplit=1)[0]
        check_command(shlex.split(first)[1:], VERBS)


@pytest.mark.parametrize(
    "wrong", ["stylesim generat highway", "stylesim merge A --splits 1,0,0", "stylesim export av3 A"]
)
def test_wrong_commands_are_found(wrong):
    with pytest.raises(AssertionError, match=r"no verb|no option"):
        check_command(shlex.split(wrong)[1:], VERBS)


@pages
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text()):
        if not target.startswith("http"):
            assert (page.parent / target).exists(), target


@pages
def test_named_files_exist(page):
    text = page.read_text()
    for name in re.findall(r"`((?:stylesim|tests|tools|agents|scenarios|notebooks|benchmarks|docs)/[\w./]+)`", text):
        assert (ROOT / name).exists(), name
    for name in re.findall(r"`((?:simulation|forecasting|evaluation|labelers|report|merging)/[\w/]+\.py)`", text):
        assert (ROOT / "stylesim" / name).exists(), name
    for name in re.findall(r"python -m (benchmarks\.\w+)", text):
        assert find_spec(name), name


@pages
def test_snippets_are_python_and_import_what_is_there(page):
    if page.name in OUTLINES:
        return
    for snippet in re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL):
        for node in ast.walk(ast.parse(snippet)):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("stylesim"):
                for name in node.names:
                    assert hasattr(import_module(node.module), name.name), f"{node.module} has no {name.name}"
            if (
                isinstance(node, ast.Attribute)
                and isinstance(node.value, ast.Name)
                and node.value.id in ("ss", "stylesim")
            ):
                assert hasattr(import_module("stylesim"), node.attr), f"stylesim has no {node.attr}"
