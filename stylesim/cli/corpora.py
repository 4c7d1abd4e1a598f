"""`read`, `merge`, `verify`: corpora in and out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import typer

from stylesim.cli.console import err, progress_bar, say, show_table
from stylesim.errors import InputError

SHOWN_ERRORS = 20
NOISE_TELLS = 0.6  # chosen: the lower end of an interval that lies clear of guessing (0.5)
WAYS = "tdbm, kdsc, context (highway or not), tdbm+context, kdsc+context or source."


def options_of(pairs: list[str]) -> dict[str, str]:
    """`key=value` items as a mapping."""
    result = {}
    for item in pairs:
        key, equals, value = item.partition("=")
        if not equals:
            raise InputError(f"--option: expected KEY=VALUE, found {item!r}")
        result[key.strip()] = value
    return result


def read(
    format: str = typer.Argument(help="Format of the recording (see `stylesim datasets`), or auto: recognise it."),
    path: Path = typer.Argument(help="File or folder of the recording."),
    out: Path = typer.Option(..., "--out", help="Folder of the new corpus; must not exist."),
    option: list[str] = typer.Option(
        [], "--option", "-o", help="The reader's own options, KEY=VALUE, repeatable (see `stylesim describe FORMAT`)."
    ),
    map: str = typer.Option(
        "", "--map", help="Meanings of a table's columns (id=track,time=t,x=center_x,y=…), or the map file of a site."
    ),
    unit: str = typer.Option("", "--unit", help="Unit of a table's places: metres, feet, …, or metres per unit."),
    workers: int = typer.Option(
        1, min=1, help="Processes; for formats of many files. Any number gives the same bytes."
    ),
    resume: bool = typer.Option(False, help="Go on from an unfinished run of the same request."),
) -> None:
    """Read a recorded data set into a new corpus; what was dropped is counted and said."""
    from stylesim.datasets.formats import dataset_format
    from stylesim.datasets.reading import read as run

    options = options_of(option) | {name: value for name, value in (("map", map), ("unit", unit)) if value}
    with progress_bar(f"reading {format}", "scenes") as progress:
        corpus = run(format, path, out=out, resume=resume, workers=workers, progress=progress, **options)
    show_table("Counted", ("what", "n"), sorted(corpus.manifest["counts"].items()))
    if format == "auto":
        say(f"recognised as {corpus.manifest['configuration']['format']}")
    if workers > 1 and not dataset_format(corpus.manifest["configuration"]["format"]).pieces:
        say("read by one process: the files of this format are not read alone, --workers changed nothing")
    say(f"{len(corpus)} scenes, {corpus.manifest['n_agents']} tracks, {corpus.manifest['n_steps']} agent-steps: {out}")


def merge(
    corpus: list[Path] = typer.Argument(help="Corpora to merge (folders)."),
    out: Path = typer.Option(..., "--out", help="Folder of the new corpus; must not exist."),
    balance: str = typer.Option(
        "none",
        help=f"Sampling weights of the training split: none, {WAYS}",
    ),
    split: str = typer.Option("0.8,0.1,0.1", help="Shares of train, val, test; by recording or episode."),
    noise: str = typer.Option("none", help="none, or fit: make simulated tracks as noisy as the recorded ones."),
    seed: int = typer.Option(0, min=0, help="Same seed, same bytes."),
    resume: bool = typer.Option(False, help="Go on from an unfinished run of the same request."),
) -> None:
    """Merge corpora: one clock, one frame, split by recording, styles balanced by weights."""
    from stylesim.corpus import Corpus
    from stylesim.corpus.files import new_folder
    from stylesim.merging.merge import merge as run

    try:
        parts = tuple(float(value) for value in split.split(","))
    except ValueError:
        raise InputError(f"--split: expected three numbers like 0.8,0.1,0.1, found {split!r}") from None
    if len(parts) != 3:
        raise InputError(f"--split: expected three numbers like 0.8,0.1,0.1, found {split!r}")
    new_folder(out)  # before anything long
    with progress_bar("merging", "scenes") as progress:
        merged = run(
            [Corpus(path) for path in corpus],
            balance=balance,
            split=(parts[0], parts[1], parts[2]),
            seed=seed,
            out=out,
            noise=None if noise == "none" else noise,
            resume=resume,
            progress=progress,
        )
    rows = []
    for name in ("train", "val", "test"):
        infos = [info for info in merged.info if info.split == name]
        units = len({(info.source, info.unit_id) for info in infos})
        rows.append((name, len(infos), units, sum(info.n_agents for info in infos)))
    show_table("Splits", ("split", "scenes", "units", "tracks"), rows)
    show_table("Counted", ("what", "n"), sorted(merged.manifest["counts"].items()))
    tell = merged.manifest["configuration"].get("noise_telltale")
    if tell is not None:
        areas = [(name, *_area(found)) for name, found in tell.items()]
        heads = ("noise", "area under the ROC curve", "simulated, recorded drivers")
        show_table("Can noise alone tell simulated from recorded tracks? (0.5: no, 1: always)", heads, areas)
        if noise_still_tells(tell["after"]):
            say(
                "noise still tells simulated from recorded tracks: what the model adds is not what that recording has. "
                "A model trained on both may learn the difference (stylesim/merging/telltale.py says what was tried)"
            )
    say(f"{out}")


def noise_still_tells(found: dict[str, Any]) -> bool:
    """Whether the area under the curve after noise was added lies clear of guessing."""
    low = found.get("low")
    return low is not None and low > NOISE_TELLS


def _area(found: dict[str, Any]) -> tuple[str, str]:
    if found["area"] is None:
        return "not measured", found["why"]
    interval = f"{found['area']:.2f} [{found['low']:.2f}, {found['high']:.2f}]"
    return interval, f"{found['simulated_drivers']}, {found['recorded_drivers']}"


def balance(
    corpus: Path = typer.Argument(help="A merged corpus, labelled where --by needs it."),
    by: str = typer.Option("tdbm", help=f"What to balance: {WAYS}"),
) -> None:
    """Write sampling weights for a merged corpus that was labelled after it was made (e.g. after noise)."""
    from stylesim.corpus import Corpus
    from stylesim.merging.balance import balance as run

    run(Corpus(corpus), by)
    say(f"{corpus}: weights written, balanced by {by}")


def verify(path: Path = typer.Argument(help="A corpus.")) -> None:
    """Check a corpus: checksums, schema, physics.

    Exits with 1 and what it found if something is wrong, with 3 if it is no corpus at all.
    """
    from stylesim.corpus.verify import verify as run

    with progress_bar("verifying", "scenes") as progress:
        result = run(path, progress=progress)
    if result.counts:  # of a damaged corpus nothing may be countable
        show_table("Counted", ("what", "n"), sorted(result.counts.items()))
    for line in result.errors[:SHOWN_ERRORS]:
        err(line)
    if len(result.errors) > SHOWN_ERRORS:
        err(f"… and {len(result.errors) - SHOWN_ERRORS} more")
    if not result.ok:
        err(f"{path}: {len(result.errors)} problem(s)")
        raise typer.Exit(1)
    say(f"{path}: sound")


def add_to(app: typer.Typer) -> None:
    """Register the verbs."""
    app.command("read", epilog="Example: `stylesim read dlr_ut data/dlr_ut --out runs/real`")(read)
    app.command("merge", epilog="Example: `stylesim merge runs/sim runs/real --balance tdbm --out runs/mixed`")(merge)
    app.command("balance", epilog="Example: `stylesim balance runs/mixed --by tdbm`")(balance)
    app.command("verify", epilog="Example: `stylesim verify runs/sim`")(verify)
