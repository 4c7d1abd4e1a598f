"""`read`: a foreign data set into a corpus, every row accounted for."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stylesim.datasets.accounting import added, checked
from stylesim.datasets.format import DatasetFormat
from stylesim.datasets.formats import AUTO, dataset_format, recognised
from stylesim.errors import InputError, unknown

if TYPE_CHECKING:
    from stylesim.corpus import Corpus


def read(
    format: str,
    path: str | Path,
    *,
    out: str | Path,
    resume: bool = False,
    progress: Callable[[int, int], None] | None = None,
    **options: Any,
) -> Corpus:
    """Read a data set of that format into a new corpus at `out`; "auto" recognises the format by its files.

    Streams scene by scene; the counts of rows in, out and dropped by reason are summed, held against what was
    written, and stored in the corpus. `progress` is called with (scenes done, 0): how many there will be is not
    known before the end. `options` are the reader's own (`stylesim describe FORMAT`).

    Raises InputError for an unknown format or option, a missing or damaged file, or no scene at all.
    """
    from stylesim.corpus import CorpusWriter

    source = Path(path)
    chosen = recognised(source) if format == AUTO else dataset_format(format)
    format = chosen.name
    options = _checked_options(chosen, options)
    if not source.exists():
        raise InputError(f"{source} does not exist; {format} is to be had from {chosen.where}")
    configuration = {"format": format, "options": dict(sorted(options.items())), "licence": chosen.licence}
    total: dict[str, int] = {}
    steps = 0
    with CorpusWriter(out, source=format, configuration=configuration, resume=resume) as writer:
        for done, scene in enumerate(chosen.scenes()(source, **options), start=1):
            writer.add(scene)
            total = added(total, scene.counts)
            steps += int(scene.tracks.valid.sum())
            if progress is not None:
                progress(done, 0)
        checked(total, steps=steps, where=f"{format} {source.name}")
        if steps == 0:
            raise InputError(f"{source} gave no scene of {format}")
        return writer.finish(run={"path": str(source)})


def _checked_options(chosen: DatasetFormat, options: dict[str, Any]) -> dict[str, Any]:
    """The options, numbers as numbers (a command line gives strings); InputError for what the format does not know."""
    for name in options:
        if not chosen.options:
            raise InputError(f"the format {chosen.name} has no options; {name!r} was given")
        if name not in chosen.options:
            raise unknown("option", name, chosen.options, where=f"the format {chosen.name}")
    return {name: _positive(name, value) if name in chosen.numbers else value for name, value in options.items()}


def _positive(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not (math.isfinite(number) and number > 0):
        raise InputError(f"option {name}: expected a positive number, found {value!r}")
    return number
