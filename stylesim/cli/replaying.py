"""`replay`: a generated episode once more, compared with its corpus, and as a video."""

from __future__ import annotations

from pathlib import Path

import typer

from stylesim.cli.console import err, say
from stylesim.errors import InputError
from stylesim.scene import Scene

PICTURES = (".png", ".svg")
BEFORE_TWIN_S = 2.0  # of what both twins share is shown; chosen, because that is enough to see who is meant


def replay(
    episode: str = typer.Argument(metavar="CORPUS#EPISODE", help="A scene's id, or its place in the corpus from 0 on."),
    out: Path | None = typer.Option(None, "--out", help="Show it: a .gif, an .mp4 (needs ffmpeg), a .png or .svg."),
    scenario: str | None = typer.Option(None, help="Folder of the scenario, where it is not a shipped one."),
    calibration: Path | None = typer.Option(None, help="The population's calibration file, where it had one."),
    start: float | None = typer.Option(None, min=0.0, help="First second that is shown.", show_default="the busiest"),
    seconds: float = typer.Option(20.0, min=0.2, help="How many seconds are shown."),
    follow: str = typer.Option("", help="A road user that the view follows.", show_default="a twin's driver"),
) -> None:
    """Run one generated episode again, bit for bit, and render it.

    Exits with 1 if what comes out is not what the corpus holds, and says what has changed since.
    """
    from stylesim.corpus import Corpus
    from stylesim.simulation.replaying import replay as run

    path, hash_sign, name = episode.partition("#")
    if not hash_sign:
        raise InputError(f"expected CORPUS#EPISODE, found {episode!r}; an episode is a scene's id or 0, 1, 2, …")
    if out is not None:
        _check(out)
    found = run(Corpus(path), name, scenario=scenario, calibration=calibration)
    for line in found.changed:
        err(f"changed since: {line}")
    if out is not None:
        _show(found.scene, out, start_s=start, seconds=seconds, follow=follow)
    if not found.identical:
        for line in found.differences:
            err(f"differs: {line}")
        err(f"{found.scene.scene_id}: not what the corpus holds")
        raise typer.Exit(1)
    say(f"{found.scene.scene_id}: identical to the corpus" + (f"; {out}" if out is not None else ""))


def _check(out: Path) -> None:
    """InputError, MissingDependencyError for what cannot be written, before any work."""
    from stylesim.report.animation import VIDEOS, check_video

    if out.suffix in VIDEOS:
        check_video(out)
    elif out.suffix not in PICTURES:
        raise InputError(f"{out}: the ending must be one of {', '.join((*VIDEOS, *PICTURES))}")


def _show(scene: Scene, out: Path, *, start_s: float | None, seconds: float, follow: str) -> None:
    """A picture or a video; of a twin, from two seconds before its driver changes."""
    from stylesim.report.animation import save_video, shown_frames
    from stylesim.report.picture import save_picture

    twin = scene.metadata.get("twin", {})
    if start_s is None and twin.get("at_s") is not None:
        start_s = max(0.0, twin["at_s"] - BEFORE_TWIN_S)
    if out.suffix in PICTURES:
        save_picture(scene, out, frames=shown_frames(scene, start_s, seconds, follow))
    else:
        save_video(scene, out, start_s=start_s, seconds=seconds, follow=follow or twin.get("driver", ""))


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    app.command("replay", epilog="Example: `stylesim replay runs/sim#0 --out episode.gif`")(replay)
