"""`read`: a foreign data set into a corpus, every row accounted for."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stylesim.datasets.accounting import added, checked
from stylesim.datasets.format import DatasetFormat
from stylesim.datasets.formats import AUTO, dataset_format, recognised
from stylesim.datasets.pieces import Done, Piece, finished, in_processes, pieces, read_piece
from stylesim.errors import InputError, unknown

if TYPE_CHECKING:
    from stylesim.corpus import Corpus


def read(
    format: str,
    path: str | Path,
    *,
    out: str | Path,
    resume: bool = False,
    workers: int = 1,
    progress: Callable[[int, int], None] | None = None,
    **options: Any,
) -> Corpus:
    """Read a data set of that format into a new corpus at `out`; "auto" recognises the format by its files.

    Streams scene by scene; the counts of rows in, out and dropped by reason are summed, held against what was
    written, and stored in the corpus. `progress` is called with (scenes done, 0): how many there will be is not
    known before the end. `options` are the reader's own (`stylesim describe FORMAT`).

    `workers` processes read the files of a format whose files can be read alone (`DatasetFormat.pieces`), with the
    same bytes for any number of them; another format is read by this process, whatever `workers` is.

    Raises InputError for an unknown format or option, a missing or damaged file, or no scene at all; WorkerError if a
    process was killed. What was finished stays under `out.partial` for `resume`.
    """
    from stylesim.corpus import CorpusWriter

    source = Path(path)
    chosen = recognised(source) if format == AUTO else dataset_format(format)
    format = chosen.name
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise InputError(f"workers must be a whole number of at least 1, not {workers!r}")
    options = _checked_options(chosen, options)
    if not source.exists():
        raise InputError(f"{source} does not exist; {format} is to be had from {chosen.where}")
    configuration = {"format": format, "options": dict(sorted(options.items())), "licence": chosen.licence}
    files = chosen.files(source) if chosen.pieces else ()
    total: dict[str, int] = {}
    steps = 0
    with CorpusWriter(out, source=format, configuration=configuration, resume=resume) as writer:
        if chosen.pieces:
            about = {"format": format, "options": options, "partial": writer.partial}
            work = pieces(files, root=source, single=chosen.pieces == "large files", **about)
            done = _read_pieces(work, workers=workers, progress=progress or _quiet)
            total, steps = dict(done.counts), done.steps
        else:
            workers = 1
            for number, scene in enumerate(chosen.scenes()(source, **options), start=1):
                writer.add(scene)
                total = added(total, scene.counts)
                steps += int(scene.tracks.valid.sum())
                if progress is not None:
                    progress(number, 0)
        checked(total, steps=steps, where=f"{format} {source.name}")
        if steps == 0:
            raise InputError(f"{source} gave no scene of {format}")
        return writer.finish(run={"path": str(source), "workers": workers})


def _quiet(done: int, total: int) -> None:
    """Tells nobody."""


def _read_pieces(work: list[Piece], *, workers: int, progress: Callable[[int, int], None]) -> Done:
    """Read what is not finished yet; the sums over all pieces."""
    total, waiting = Done(), []
    for piece in work:
        before = finished(piece)
        if before is None:
            waiting.append(piece)
        else:
            total += before
    seen = total.scenes

    def one_more() -> None:
        nonlocal seen
        seen += 1
        progress(seen, 0)

    if workers == 1:
        for piece in waiting:
            total += read_piece(piece, one_more)
        return total
    with closing(in_processes(waiting, workers=workers)) as answers:
        for done in answers:
            total += done
            progress(total.scenes, 0)
    return total


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
