"""Strict YAML files: `safe_load`, unknown keys refused with the nearest known one, errors that name file and field."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from stylesim.errors import InputError, nearest


class Spec(BaseModel):
    """Base of every model that is read from a file: frozen; an unknown key, infinity or NaN is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


SpecT = TypeVar("SpecT", bound=Spec)


def _message(model: type[Spec], error: ValidationError, where: Path | str) -> str:
    lines = [f"{where}: {error.error_count()} problem(s)"]
    for item in error.errors():
        place = ".".join(str(part) for part in item["loc"]) or "(top level)"
        hint = ""
        if item["type"] == "extra_forbidden":
            guess = nearest(str(item["loc"][-1]), _known_keys(model))
            hint = f"; did you mean {guess!r}?" if guess else f"; known keys: {', '.join(sorted(_known_keys(model)))}"
        lines.append(f"  {place}: {item['msg']}{hint}")
    return "\n".join(lines)


def _known_keys(model: type[BaseModel]) -> set[str]:
    """Every key that the model or a model within it knows."""
    schema: dict[str, Any] = model.model_json_schema()
    known = set(schema.get("properties", {}))
    for definition in schema.get("$defs", {}).values():
        known |= set(definition.get("properties", {}))
    return known


def parse(model: type[SpecT], raw: Any, where: Path | str) -> SpecT:
    """`raw` as a `model`; InputError naming `where`, the field, and the nearest known key."""
    if not isinstance(raw, dict):
        raise InputError(f"{where}: expected a mapping of keys, found {type(raw).__name__}")
    try:
        return model.model_validate(raw)
    except ValidationError as error:
        raise InputError(_message(model, error, where)) from None


def load_yaml(model: type[SpecT], path: Path) -> SpecT:
    """The YAML file at `path` as a `model`; InputError if it is missing, not YAML, or does not fit."""
    try:
        raw = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"no such file: {path}") from None
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is not a YAML file: {error}") from None
    return parse(model, raw, path)
