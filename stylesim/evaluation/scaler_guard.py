"""A corpus is never judged by a scaler that was fitted on it, nor as driven by styles that were calibrated on it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.styles import calibration_file, load_calibration

_SEEDS = ("corpus_seed", "corpus_seeds", "seed", "seeds")
_PRINTS = ("corpus_fingerprint", "corpus_fingerprints", "corpus_sha256", "fingerprint", "fingerprints")


def _values(content: Any, names: tuple[str, ...]) -> Iterator[Any]:
    """Every value under one of these names, at any depth."""
    if isinstance(content, Mapping):
        for key, value in content.items():
            if key in names:
                yield from value if isinstance(value, list | tuple) else (value,)
            else:
                yield from _values(value, names)
    elif isinstance(content, list | tuple):
        for value in content:
            yield from _values(value, names)


def check_unseen(corpus: Corpus, provenance: Mapping[str, Any], *, what: str) -> None:
    """InputError if the corpus, one that it was merged from, or its seed is in the provenance of what judges it."""
    prints = {value for value in _values(provenance, _PRINTS) if isinstance(value, str) and value}
    own = {corpus.fingerprint, *(corpus.manifest.get("configuration", {}).get("inputs") or ())}
    if own & prints:
        raise InputError(
            f"{corpus.path} is in the provenance of {what}: a corpus is not judged by what was fitted on it. "
            "Generate another one with another --seed."
        )
    seeds = {value for value in _values(provenance, _SEEDS) if isinstance(value, int)}
    seed = corpus.manifest.get("seed")
    if seed in seeds:
        raise InputError(
            f"{corpus.path} has seed {seed}, which {what} was fitted on: its drivers and episodes are the same. "
            "Generate another one with another --seed."
        )


def check_not_calibrated_on(corpus: Corpus, backends: tuple[str, ...] = ("sumo", "highway")) -> None:
    """InputError if the corpus has a seed that the shipped styles of a backend were calibrated with."""
    seed = corpus.manifest.get("seed")
    for backend in backends:
        path = calibration_file(backend)
        if path is None or not isinstance(seed, int):
            continue
        seeds = load_calibration(path).provenance.get("seeds", {})
        rounds = [value for value in seeds.get("rounds", ()) if isinstance(value, int)]
        if rounds and min(rounds) <= seed <= max(rounds):
            raise InputError(
                f"{corpus.path} has seed {seed}, one of those that {path.name} was calibrated with ({min(rounds)} to "
                f"{max(rounds)}): calibration and judgement share no seed. Generate another one with another --seed."
            )
