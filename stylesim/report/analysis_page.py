"""The folder of `stylesim analyze`: one HTML page, every figure as PNG, every number as Parquet."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from matplotlib.figure import Figure

from stylesim.corpus.files import write_whole
from stylesim.errors import InputError
from stylesim.evaluation.analysis.analyze import Analysis
from stylesim.evaluation.analysis.judge import WITHIN as WITHIN_CORPUS
from stylesim.evaluation.analysis.tables import known, where
from stylesim.report import analysis_figures as figures
from stylesim.report import analysis_tables as tables
from stylesim.report.analysis_tracks import examples_figure, speeds_figures
from stylesim.report.blocks import Block, Section, picture
from stylesim.report.html import render
from stylesim.report.theme import figure_bytes, plural

WITHIN = "Hollow points with dotted bars (†): fewer than 3 units, the interval speaks of this site and time alone."
CIRCULAR = (
    "Label and kinematics come from the same tracks, and TDBM contains v_avg and j_l (quantities marked * in the "
    "figures): a small p says little here. It also takes drivers as independent. δ is Cliff's: the share of pairs in "
    "which the first class has more, minus the share in which it has less; its interval resamples units, then drivers."
)
SAID_SHARE = 0.05  # chosen: below it, who is undetermined is left to the table
Draw = Callable[[str, Figure | None, str], list[Block]]


def save_analysis(found: Analysis, out: str | Path) -> Path:
    """Write `index.html`, `figures/*.png`, `tables/*.parquet` and `about.json` into `out`; returns the page.

    The page is written last. InputError if `out` exists and is not empty.
    """
    folder = Path(out)
    check_out(folder)
    made: list[tuple[Path, bytes]] = []

    def draw(name: str, figure: Figure | None, caption: str) -> list[Block]:
        if figure is not None:
            made.append((folder / "figures" / f"{name}.png", figure_bytes(figure, raster=True)))
        return picture(figure, caption)

    sections = [_classes(found, draw), _kinematics(found, draw), _stability(found, draw), _clusters(found, draw)]
    sections += [_shift(found, draw), _answers(found, draw), _sensitivity(found), _about(found)]
    names = list(found.about["corpora"])
    page = render("Driving styles in data sets", _lead(found), sections, _warnings(found), _findings(found, names))
    for path, content in made:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, content)
    (folder / "tables").mkdir(parents=True, exist_ok=True)
    found.save_tables(folder / "tables")
    write_whole(folder / "about.json", json.dumps(found.about, indent=1, sort_keys=True).encode())
    write_whole(folder / "index.html", page.encode())
    return folder / "index.html"


def check_out(folder: Path) -> None:
    """InputError if the folder has something in it: an old figure beside a new page would be believed."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder} exists and is not an empty folder; give a new one")


def _lead(found: Analysis) -> str:
    corpora = ", ".join(f"{n} ({plural(a['units'], 'unit')})" for n, a in found.about["corpora"].items())
    judge = found.about["reference"]
    scale = "a scale of the other half of each corpus' drivers" if judge == WITHIN_CORPUS else judge
    return f"{corpora}. TDBM judged by {scale}; stylesim {found.about['stylesim']}."


def _warnings(found: Analysis) -> list[str]:
    return list(found.about.get("warnings", []))


def _findings(found: Analysis, names: list[str]) -> list[str]:
    """The two most frequent classes of each corpus; who cannot be judged is said first."""
    listed = []
    shares = found.tables["class_shares"]
    for name in names:
        own = where(shares, corpus=name, orientation="printed")
        share = {row["class"]: row["value"] for row in known(own, "value").iter_rows(named=True)}
        blank = share.pop("undetermined", 0.0)
        if not share:
            listed.append(f"{name}: {own['n_drivers'][0]} drivers are too few for shares.")
        elif blank == 1.0:
            listed.append(
                f"{name}: TDBM judges nobody here (no lanes, or no scale: see below how firm the classes are)."
            )
        else:
            first, second = sorted(share, key=lambda style: -share[style])[:2]
            unjudged = f" ({100 * blank:.0f} % cannot be judged)" if blank >= SAID_SHARE else ""
            both = f"{first} ({100 * share[first]:.0f} %) and {second} ({100 * share[second]:.0f} %)"
            listed.append(f"{name}: mostly {both} in the printed orientation{unjudged}.")
    return listed


def _classes(found: Analysis, draw: Draw) -> Section:
    caption = f"Share of each TDBM class among the drivers, 95 % intervals. {WITHIN}"
    blocks = draw("class_shares", figures.shares_figure(found.tables["class_shares"]), caption)
    for orientation, title in figures.TITLES.items():
        table = tables.shares_table(found.tables["class_shares"], orientation, title)
        if table.rows:
            blocks.append(Block(table=table))
    blocks.append(Block(table=tables.firmness_table(found.tables["firmness"])))
    text = (
        "The matrix as printed reaches all six classes; its transpose reproduces what the paper reports (only "
        "reckless, threatening and careful; threatening without neighbours). Both are shown."
    )
    return Section("classes", "TDBM classes", (text,), tuple(blocks))


def _kinematics(found: Analysis, draw: Draw) -> Section:
    blocks: list[Block] = []
    undrawn: list[str] = []
    for number, name in enumerate(found.about["corpora"]):
        caption = (
            "Median, quartiles, whiskers at the 5th and 95th percentile; classes as printed. * in TDBM's own features."
        )
        figure = figures.boxes_figure(found.tables["boxes"], name)
        blocks += draw(f"kinematics_{number + 1}", figure, caption)
        if figure is None:
            undrawn.append(name)
    texts = [CIRCULAR]
    if undrawn:
        texts.append(f"No boxes of {', '.join(undrawn)}: no class has 30 drivers with plausible motion.")
    blocks.append(Block(table=tables.halves_table(found.tables["split_halves"])))
    if "pair_tests" in found.tables:
        blocks.append(Block(table=tables.pairs_table(found.tables["pair_tests"]), fold=True))
    return Section("kinematics", "Kinematics by class", tuple(texts), tuple(blocks))


def _stability(found: Analysis, draw: Draw) -> Section:
    caption = f"Agreement of non-overlapping windows of one driver, 95 % intervals. {WITHIN}"
    blocks = draw("stability", figures.stability_figure(found.tables["stability"]), caption)
    blocks.append(Block(table=tables.stability_table(found.tables["stability"]), fold=bool(blocks)))
    text = (
        "The paper assumes one style per driver. ICC(1) of the measured a is the share of its variance that lies "
        "between drivers; κ compares the classes of neighbouring windows. 1 is a trait, 0 is a mood. "
        "What a driver's whole track shares (its road, its traffic) counts as his."
    )
    return Section("stability", "Is a style a trait?", (text,), tuple(blocks))


def _clusters(found: Analysis, draw: Draw) -> Section:
    corpora = list(found.about["corpora"])
    caption = "Mean speed of KDSC's clusters, fitted on the training part of each corpus; lines are medians."
    blocks: list[Block] = []
    for number, figure in enumerate(speeds_figures(found.tables["drivers"], corpora)):
        blocks += draw(f"kdsc_speed_{number + 1}", figure, caption)
    blocks.append(Block(table=tables.speed_table(found.tables["kdsc_speed"])))
    blocks.append(Block(table=tables.kdsc_tdbm_table(found.tables["kdsc_tdbm"])))
    for number, name in enumerate(corpora):
        own = [one for one in found.examples if one.corpus == name]
        caption = "Dots are 0.1 s apart, coloured by time; the box is the vehicle at the first."
        blocks += draw(f"examples_{number + 1}", examples_figure(own), caption)
    text = (
        "Ward's two clusters of max |acceleration|, variance of acceleration, variance of speed and γ. Variance of "
        "speed goes with speed, so that a difference of mean speeds is partly built in."
    )
    return Section("kdsc", "KDSC clusters", (text,), tuple(blocks))


def _shift(found: Analysis, draw: Draw) -> Section:
    parts = "; ".join(f"{name}: {about['parts']}" for name, about in found.about["corpora"].items())
    table = found.tables.get("share_shift")
    caption = f"Share in the held-out part minus share in training, 95 % intervals. {WITHIN}"
    blocks = draw("share_shift", None if table is None else figures.shift_figure(table), caption)
    text = [f"How the parts were made: {parts}."]
    if not blocks:
        text.append("No corpus has 30 drivers in both parts: no shift can be stated.")
    return Section("shift", "From training to held out", tuple(text), tuple(blocks))


def _answers(found: Analysis, draw: Draw) -> Section:
    table = found.tables.get("mdsi_tdbm")
    corpora = [] if table is None else list(dict.fromkeys(table["corpus"].to_list()))
    blocks: list[Block] = []
    for number, name in enumerate(corpora):
        assert table is not None
        caption = "Drivers who answered the questionnaire, by the style that they report and the class that they drove."
        blocks += draw(f"mdsi_tdbm_{number + 1}", figures.answers_figure(table, name), caption)
    text = () if corpora else ("No corpus carries answers to the questionnaire (`stylesim read study`).",)
    return Section("mdsi", "MDSI and TDBM", text, tuple(blocks))


def _sensitivity(found: Analysis) -> Section:
    table = found.tables.get("sensitivity")
    blocks = () if table is None else (Block(table=tables.sensitivity_table(table)),)
    text = () if blocks else ("Not measured (--no-sensitivity).",)
    return Section("sensitivity", "Smoother, window, scaler", text, blocks)


def _about(found: Analysis) -> Section:
    blocks = [Block(table=tables.counts_table(found.about["corpora"]))]
    blocks.append(Block(caption="About", raw=json.dumps(found.about, indent=1, sort_keys=True)))
    return Section("about", "What was analysed", (), tuple(blocks))
