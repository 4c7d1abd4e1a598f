"""`generate`: traffic with drivers of chosen styles."""

from __future__ import annotations

from pathlib import Path

import typer

from stylesim.cli.console import progress_bar, say, show_table
from stylesim.cli.continuing import continue_recording
from stylesim.corpus import Corpus
from stylesim.errors import InputError, unknown
from stylesim.population import Population
from stylesim.simulation.plan import EpisodePlan, TwinRequest, stressors_of
from stylesim.style import STYLE_CLASSES


def shares(text: str, option: str) -> dict[str, float]:
    """`aggressive=0.3,careful=0.7` as a mapping. InputError for anything else, naming the nearest style."""
    result: dict[str, float] = {}
    for item in text.split(","):
        name, equals, value = item.partition("=")
        name = name.strip()
        if not equals:
            raise InputError(f"{option}: expected STYLE=SHARE, found {item!r}")
        if name not in STYLE_CLASSES:
            raise unknown("style", name, STYLE_CLASSES, where=option)
        if name in result:
            raise InputError(f"{option}: {name!r} is given twice")
        try:
            result[name] = float(value)
        except ValueError:
            raise InputError(f"{option}: the share of {name!r} is no number: {value!r}") from None
    return result


def chosen_population(population: str | None, styles: str | None, reweight: str | None) -> Population:
    """The population that the three options describe. InputError where they contradict each other."""
    if styles is not None:
        if population is not None or reweight is not None:
            raise InputError("--styles gives every share; it cannot go with --population or --reweight")
        return Population.of(**shares(styles, "--styles"))
    base = Population.load("tdbm_spectrum" if population is None else population)
    return base.reweighted(**shares(reweight, "--reweight")) if reweight is not None else base


def wanted_twins(at_s: float | None, start: str | None, style: str, *, null: bool) -> TwinRequest | None:
    """What the options say about twins. InputError where they contradict each other."""
    if start is not None and start != "start":
        raise InputError(f"--twins-from: the only moment is 'start' (the driver's insertion), not {start!r}")
    if at_s is not None and start is not None:
        raise InputError("--twins-at and --twins-from: a driver changes on the way or from the start; choose one")
    if at_s is None and start is None:
        if style:
            raise InputError("--twin-style says what the driver becomes; say when: --twins-at 8 or --twins-from start")
        return None
    if at_s is not None and at_s < 0:
        raise InputError(f"--twins-at: a time in the log, 0 s or later, not {at_s:g}")
    return TwinRequest(at_s=at_s, style=style, null=null)


def wanted_scenarios(names: list[str], net: Path | None, demand: Path | None, vph: float | None) -> list[str]:
    """The scenarios that were named, and the one of the user's own network. InputError for options without it."""
    if net is None:
        if demand is not None or vph is not None:
            raise InputError("--demand and --vph say what drives in your own network; give it with --net")
        return names
    from stylesim.simulation.sumo.own import own_network

    return [*names, str(own_network(net, demand=demand, vph=vph))]


def generate(
    scenario: list[str] | None = typer.Argument(
        None, help="Scenarios by name (see `stylesim list scenarios`) or by folder."
    ),
    net: Path | None = typer.Option(
        None, help="Your own network: SUMO (.net.xml), OpenStreetMap (.osm) or OpenDRIVE (.xodr)."
    ),
    demand: Path | None = typer.Option(None, help="With --net: a SUMO route file whose vehicles get styled drivers."),
    vph: float | None = typer.Option(
        None, help="With --net: vehicles/h over all entries.", show_default="300 for each lane that enters"
    ),
    out: Path = typer.Option(..., "--out", help="Folder of the new corpus; must not exist."),
    population: str | None = typer.Option(
        None, help="A population's name (see `stylesim list populations`) or YAML file.", show_default="tdbm_spectrum"
    ),
    styles: str | None = typer.Option(None, help="All shares, sum 1: aggressive=0.3,careful=0.7."),
    reweight: str | None = typer.Option(None, help="Set some shares, scale the rest: aggressive=0.3."),
    calibration: Path | None = typer.Option(
        None, help="A file of `stylesim calibrate` to drive by.", show_default="what ships"
    ),
    episodes: int = typer.Option(10, min=1, help="Episodes per scenario."),
    seed: int = typer.Option(0, min=0, help="Same seed, same bytes."),
    workers: int = typer.Option(1, min=1, help="Simulations side by side, one process each."),
    resume: bool = typer.Option(False, help="Go on from an unfinished run of the same request."),
    twins_at: float | None = typer.Option(
        None, help="Beside each episode a twin of it in which one driver changes its style at this time (s of the log)."
    ),
    twins_from: str | None = typer.Option(
        None, metavar="start", help="The same, but the driver has the other style from its insertion on: 'start'."
    ),
    twin_style: str = typer.Option("", help="The class that the twin's driver gets.", show_default="drawn"),
    ego: str = typer.Option(
        "", metavar="pkg.module:planner", help="Your own planner drives one vehicle of each episode (docs/planners.md)."
    ),
    twin_null: bool = typer.Option(True, help="And a second twin: the same driver and style with other noise."),
    stressor: str = typer.Option(
        "",
        help="Unusual events at seeded moments, KIND or KIND:SHARE of the episodes, separated by commas: "
        "hard_brake, cut_in, jaywalker, deer, stalled, red_runner.",
    ),
    from_: Path | None = typer.Option(
        None, "--from", metavar="CORPUS", help="Instead of scenarios: recorded scenes that go on with styled drivers."
    ),
    scene: list[str] = typer.Option([], help="With --from: this scene, repeatable.", show_default="every scene"),
    drivers: str = typer.Option("all", help="With --from: who is handed over: a,b,c by agent id, or all."),
    at: float | None = typer.Option(None, min=0.0, help="With --from: when, in seconds of the scene."),
) -> None:
    """Generate traffic with drivers of chosen styles into a new corpus."""
    from stylesim.simulation.generate import generate as run

    crowd = chosen_population(population, styles, reweight)
    if calibration is not None:
        crowd = crowd.calibrated(calibration)
    if from_ is not None:
        asked_for = {"a scenario": scenario, "--net": net, "--twins-at": twins_at, "--twins-from": twins_from}
        asked_for |= {"--twin-style": twin_style, "--stressor": stressor, "--ego": ego, "--workers": workers > 1}
        unused = [name for name, value in asked_for.items() if value not in (None, "", False, [])]
        corpus = continue_recording(
            from_, crowd, scenes=scene, drivers=drivers, at_s=at, unused=unused,
            out=out, episodes=episodes, seed=seed, resume=resume,
        )  # fmt: skip
        _show_counts(corpus, crowd)
        say(f"{_number(corpus, 'scene')}, {corpus.manifest['n_steps']} agent-steps: {out}")
        return
    if scene or at is not None or drivers != "all":
        raise InputError("--scene, --drivers and --at say what of a recording goes on; name it with --from CORPUS")
    twins = wanted_twins(twins_at, twins_from, twin_style, null=twin_null)
    plan = EpisodePlan(stressors=stressors_of(stressor) if stressor else (), ego=ego)
    names = wanted_scenarios(scenario or [], net, demand, vph)
    with progress_bar("generating", "episodes") as progress:
        corpus = run(
            names, crowd, episodes=episodes, seed=seed, out=out, workers=workers, resume=resume,
            plan=plan, twins=twins, progress=progress,
        )  # fmt: skip
    _show_counts(corpus, crowd)
    paired = f" ({sum(bool(info.twin_of) for info in corpus.info)} of them twins)" if twins is not None else ""
    say(f"{_number(corpus, 'episode')}{paired}, {corpus.manifest['n_steps']} vehicle-steps: {out}")


def _number(corpus: Corpus, what: str) -> str:
    return f"{len(corpus)} {what}" if len(corpus) == 1 else f"{len(corpus)} {what}s"


def _show_counts(corpus: Corpus, crowd: Population) -> None:
    """Drivers by style, and whatever else was counted."""
    counts = corpus.manifest["counts"]
    styles_asked = ("neutral",) if crowd.within_class == "neutral" else STYLE_CLASSES
    drivers = {name: counts.get(f"drivers.{name}", 0) for name in styles_asked}
    total = max(1, sum(drivers.values()))
    asked = crowd.by_class | {"neutral": 1.0}
    rows = [(name, n, f"{n / total:.3f}", f"{asked[name]:.3f}") for name, n in drivers.items()]
    show_table("Drivers", ("style", "drivers", "share", "asked for"), rows)
    others = {
        "drivers in SUMO's demand, warm-up included" if key == "drivers" else key: n
        for key, n in sorted(counts.items())
        if not key.startswith("drivers.") and n
    }
    if others:
        show_table("Counted", ("what", "n"), list(others.items()))


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    app.command(
        "generate",
        epilog="Example: `stylesim generate yellow_light highway --episodes 9 --reweight timid=0.3 --out runs/sim`",
    )(generate)
