"""The same request by command and in Python is the same: options that share a name share their default."""

from __future__ import annotations

import inspect
from enum import StrEnum

import pytest
from typer.main import get_command

import stylesim
from stylesim.cli.main import app

VERBS = ("generate", "merge", "train", "fidelity", "criticality", "realism", "analyze")
NAMES = {("train", "compile"): "compiled"}


def plain(value: object) -> object:
    if isinstance(value, StrEnum):
        value = value.value
    elif isinstance(value, tuple):
        value = ",".join(map(str, value))
    return None if value in ("", [], None, "none") else value


@pytest.mark.parametrize("verb", VERBS)
def test_defaults_are_the_functions(verb):
    known = {name: p.default for name, p in inspect.signature(getattr(stylesim, verb)).parameters.items()}
    compared = 0
    for option in get_command(app).commands[verb].params:
        name = NAMES.get((verb, option.name), option.name)
        if known.get(name, inspect.Parameter.empty) is inspect.Parameter.empty:
            continue
        compared += 1
        assert plain(option.default) == plain(known[name]), f"{verb} --{option.name}"
    assert compared
