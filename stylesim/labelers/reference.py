"""The shipped reference populations: which scaler judges when the user fits none, and how such a one is made."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path

from stylesim.errors import InputError, unknown
from stylesim.labelers.base import Labeler, Progress
from stylesim.labelers.kdsc import KDSC
from stylesim.labelers.tdbm import TDBM
from stylesim.resources import agents_dir
from stylesim.scene import Scene

METHODS: dict[str, type[TDBM] | type[KDSC]] = {"tdbm": TDBM, "kdsc": KDSC}
DEFAULT_REFERENCE = "sim-reference"
# Histories of Waymo (1.1 s), nuScenes (2 s) and Argoverse 2 (5 s), so that a shipped labeller fits each.
REFERENCE_HISTORY_S = (1.1, 2.0, 5.0)


def scalers_dir() -> Path:
    """The folder of the shipped labellers."""
    return agents_dir() / "scalers"


def new_labeler(method: str, *, history_s: Sequence[float] = (5.0,), seed: int = 0) -> TDBM | KDSC:
    """An unfitted labeller of that method. InputError for an unknown one."""
    if method not in METHODS:
        raise unknown("labelling method", method, METHODS)
    return METHODS[method](history_s=history_s, seed=seed)


def default_labeler(method: str, *, reference: str = DEFAULT_REFERENCE) -> TDBM | KDSC:
    """The frozen labeller that ships with stylesim. InputError for an unknown method or reference."""
    new_labeler(method)
    path = scalers_dir() / f"{reference}.{method}.json"
    if not path.is_file():
        known = sorted(p.name.removesuffix(f".{method}.json") for p in scalers_dir().glob(f"*.{method}.json"))
        if known:
            raise unknown(f"{method} reference", reference, known, where=scalers_dir())
        raise InputError(
            f"no {method} reference is shipped in {scalers_dir()}; fit one: "
            f"stylesim.labelers.reference.fit_reference(corpus, {reference!r}), or `stylesim label --fit CORPUS`"
        )
    return load_labeler(path)


def load_labeler(path: Path) -> TDBM | KDSC:
    """The labeller in a JSON file. InputError if the file is missing or holds something else."""
    try:
        raw = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"no such file: {path}") from None
    except (ValueError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is not a labeller: {error}") from None
    if not isinstance(raw, dict) or raw.get("labeler") not in METHODS:
        raise InputError(f"{path} is not a labeller: it names none of {', '.join(sorted(METHODS))}")
    return METHODS[raw["labeler"]].from_dict(raw)


def save_labeler(labeler: Labeler, path: Path) -> None:
    """Write a fitted labeller as JSON, whole or not at all; numbers survive exactly."""
    from stylesim.corpus.files import json_bytes, write_whole

    write_whole(path, json_bytes(labeler.to_dict()))


def fit_reference(
    corpus: Iterable[Scene],
    name: str,
    *,
    methods: Sequence[str] = ("tdbm", "kdsc"),
    history_s: Sequence[float] = REFERENCE_HISTORY_S,
    seed: int = 0,
    out: Path | None = None,
    progress: Progress | None = None,
) -> list[Path]:
    """Fit a reference on a corpus of its population and write `<name>.<method>.json` into `out`, or where they ship.

    For `sim-reference` that is neutral-driver traffic of calibration seeds, pooled over the scenarios; for
    `real-reference` recordings (REFERENCE section 1). The provenance inside names the corpus by its fingerprint.
    """
    folder = scalers_dir() if out is None else out
    paths = []
    for method in methods:
        labeler = new_labeler(method, history_s=history_s, seed=seed).fit(corpus, progress=progress)
        paths.append(folder / f"{name}.{method}.json")
        save_labeler(labeler, paths[-1])
    return paths
