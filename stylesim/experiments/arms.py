"""What is compared: an `Arm` is one way of training; and the request that a folder of runs belongs to."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from stylesim.corpus import Corpus
from stylesim.corpus.files import json_bytes, write_whole
from stylesim.errors import InputError
from stylesim.windows import WindowSpec

PERMUTED_ARM = "+permuted"
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_+-]*")
REQUEST_FILE = "experiment.json"
FORMAT, SCHEMA_VERSION = "stylesim-experiment", 1
SET_BY_RUNNER = frozenset({"seed", "out", "spec", "size", "max_steps", "epochs", "patience", "batch_size", "resume"})


@dataclass(frozen=True)
class Arm:
    """One way of training: `options` go to `stylesim.train`, on `corpus` (None: the experiment's own).

    `permuted` also evaluates each model with the styles that it is told permuted, as the arm "NAME+permuted".
    """

    name: str
    options: Mapping[str, Any] = field(default_factory=dict)
    corpus: Corpus | None = None
    permuted: bool = False

    def __post_init__(self) -> None:
        """Refuse names that make no file name, and options that are the same in all arms."""
        if not NAME.fullmatch(self.name):
            raise InputError(f"the arm {self.name!r} needs a name of letters, digits, _, + and -")
        for option in sorted(SET_BY_RUNNER & set(self.options)):
            raise InputError(f"arm {self.name!r}: {option} is the same in all arms; give it to run_experiment")

    def facts(self) -> dict[str, Any]:
        """What makes a run of this arm the same run: its options, corpora by fingerprint."""
        options = {name: _plain(value) for name, value in sorted(self.options.items())}
        return {"options": options, "corpus": None if self.corpus is None else self.corpus.fingerprint}


def _plain(value: Any) -> Any:
    """A value of an option as JSON."""
    if isinstance(value, Corpus):
        return value.fingerprint
    return json.loads(json.dumps(value, default=lambda one: one.to_dict() if hasattr(one, "to_dict") else str(one)))


def check_arms(arms: Sequence[Arm], seeds: Sequence[int]) -> None:
    """InputError unless there are arms and seeds, none twice."""
    names, numbers = [arm.name for arm in arms], [str(seed) for seed in seeds]
    if not arms or not seeds:
        raise InputError("an experiment needs at least one arm and one seed")
    for what, given in (("arm", names), ("seed", numbers)):
        twice = sorted({one for one in given if given.count(one) > 1})
        if twice:
            raise InputError(f"the {what} {twice[0]} is given twice")


@dataclass(frozen=True)
class Request:
    """What all runs of a folder have in common; written to `experiment.json`."""

    corpus: str  # fingerprint of what is trained on
    test: str  # fingerprint of what is evaluated on
    splits: tuple[str, ...]
    steps: int
    batch_size: int
    size: str
    spec: WindowSpec

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        plain = {**asdict(self), "splits": list(self.splits)}
        return {"format": FORMAT, "schema_version": SCHEMA_VERSION, **plain}

    def open(self, out: Path) -> None:
        """Begin the folder `out`, or go on in it; InputError where it was begun with another request."""
        path = out / REQUEST_FILE
        if not path.exists():
            if out.exists() and any(out.iterdir()):
                raise InputError(f"{out} is there already and holds no experiment; choose another folder")
            write_whole(path, json_bytes(self.to_dict()))
            return
        begun = read_request(out)
        for name, value in self.to_dict().items():
            if begun.get(name) != value:
                raise InputError(f"{out} was begun with {name} = {begun.get(name)}, not {value}; use another folder")


def read_request(out: Path) -> dict[str, Any]:
    """The request of a folder; InputError if it holds no experiment."""
    path = out / REQUEST_FILE
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["format"] != FORMAT or int(content["schema_version"]) > SCHEMA_VERSION:
            raise InputError(f"{path} is no experiment that this version of stylesim can read")
    except FileNotFoundError:
        raise InputError(f"{out} holds no experiment ({REQUEST_FILE} is missing)") from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} is no experiment: {error!r}") from None
    return dict(content)
