"""`generate --from`: recorded scenes that go on with styled drivers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from stylesim.cli.console import progress_bar
from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.population import Population


def continue_recording(
    source: Path,
    population: Population,
    *,
    scenes: Sequence[str],
    drivers: str,
    at_s: float | None,
    out: Path,
    episodes: int,
    seed: int,
    resume: bool,
    unused: Sequence[str],
) -> Corpus:
    """Run `generate_from` for the options of the command line. InputError where they do not go together."""
    from stylesim.simulation.rollout import generate_from

    if unused:
        raise InputError(f"--from goes on with a recording; it cannot go with {', '.join(unused)}")
    if at_s is None:
        raise InputError("--from: say when the drivers take over: --at 5 (seconds of the recorded scene)")
    with progress_bar("driving on", "scenes") as progress:
        return generate_from(
            Corpus(source),
            population,
            at_s=at_s,
            out=out,
            scenes=scenes or None,
            drivers=None if drivers == "all" else [name.strip() for name in drivers.split(",")],
            episodes=episodes,
            seed=seed,
            resume=resume,
            progress=progress,
        )
