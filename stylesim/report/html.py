"""`build_report`: one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from stylesim.corpus import Corpus
from stylesim.corpus.files import write_whole
from stylesim.errors import InputError
from stylesim.evaluation.results import Evaluation
from stylesim.report import data_sections as data
from stylesim.report import sections as parts
from stylesim.report.blocks import Section
from stylesim.report.figures import Curve
from stylesim.report.theme import plural

METHODS = ("tdbm", "kdsc")


def render(title: str, lead: str, sections: Sequence[Section], warnings: Sequence[str], findings: Sequence[str]) -> str:
    """The page. Everything is escaped; the page forbids itself to load anything (Content-Security-Policy)."""
    loader = FileSystemLoader(Path(__file__).parent)
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    template = environment.get_template("template.html.j2")
    return template.render(title=title, lead=lead, sections=sections, warnings=warnings, findings=findings)


def build_report(
    out: str | Path,
    *,
    evaluations: Sequence[Evaluation] = (),
    corpora: Sequence[Corpus] = (),
    training_curves: Mapping[str, Curve] | None = None,
    methods: Sequence[str] = METHODS,
    example_scenes: int = 1,
    title: str = "Forecasts by driving style",
    seed: int = 0,
) -> Path:
    """Write the report to `out` (.html), whole or not at all, and return its path.

    The first evaluation is the baseline that the others are paired with. `corpora` are described: class shares,
    commanded against measured, decisions at the yellow, `example_scenes` pictures per source. `training_curves` maps a
    model's name to its records of epoch, train_loss, val_loss and val_min_fde_m. `seed` is of the bootstrap of the
    differences. The same input gives the same bytes. InputError if there is nothing to report, two evaluations have
    one name, or `out` does not end in .html.
    """
    path = Path(out)
    if path.suffix != ".html":
        raise InputError(f"{path}: a report is an .html file")
    curves = training_curves or {}
    if not (evaluations or corpora or curves):
        raise InputError("there is nothing to report: give an evaluation, a corpus or a training curve")
    names = [one.forecaster for one in evaluations]
    if len(set(names)) < len(names):
        raise InputError(f"two evaluations have the same forecaster name: {', '.join(sorted(names))}")
    found = [
        parts.errors_section(evaluations, seed=seed) if evaluations else None,
        data.labels_section(corpora, methods),
        data.yellow_section(corpora),
        parts.training_section(curves),
        data.scenes_section(corpora, methods, example_scenes),
        parts.provenance_section(evaluations, corpora),
    ]
    sections = [section for section in found if section is not None]
    page = render(
        title, _lead(evaluations, corpora), sections, parts.warnings(evaluations), parts.findings(evaluations)
    )
    write_whole(path, page.encode())
    return path


def _lead(evaluations: Sequence[Evaluation], corpora: Sequence[Corpus]) -> str:
    names = ", ".join(
        dict.fromkeys([*(one.about["corpus"]["name"] for one in evaluations), *(c.path.name for c in corpora)])
    )
    versions = next((f", made with stylesim {one.about['versions']['stylesim']}" for one in evaluations), "")
    return f"{plural(len(evaluations), 'forecaster')}; corpora: {names or 'none'}{versions}."
