"""`stylesim.evaluate`: one or several forecasters on one corpus, with everything that the report needs."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.evaluation import evaluate as one_forecaster
from stylesim.evaluation.metrics import MODES
from stylesim.evaluation.permuted import permuted, with_placebo_row
from stylesim.evaluation.results import Evaluation, markdown
from stylesim.forecast import Forecaster, is_told, is_untold
from stylesim.report.figures import Curve
from stylesim.report.html import build_report
from stylesim.windows import WindowSpec


@dataclass(frozen=True, eq=False)
class Report:
    """Evaluations of several forecasters on one corpus; the first is the baseline of the paired differences."""

    evaluations: tuple[Evaluation, ...]
    corpus: Corpus
    training_curves: Mapping[str, Curve]
    seed: int

    def save(self, path: str | Path) -> Path:
        """Write the HTML page to `path`, and .json, .md, .parquet of each forecaster beside it; returns the page.

        InputError unless `path` ends in .html.
        """
        page = Path(path)
        if page.suffix != ".html":
            raise InputError(f"{page}: a report is an .html file")
        for evaluation, name in zip(self.evaluations, file_names(self.evaluations), strict=True):
            evaluation.save(page.parent / name)
        curves = self.training_curves
        return build_report(
            page, evaluations=self.evaluations, corpora=[self.corpus], training_curves=curves, seed=self.seed
        )

    def _repr_markdown_(self) -> str:
        """What a notebook shows."""
        return "\n".join(markdown(evaluation) for evaluation in self.evaluations)


def file_names(evaluations: Sequence[Evaluation]) -> list[str]:
    """A file name for each forecaster: plain characters only, no two alike."""
    names: list[str] = []
    for evaluation in evaluations:
        plain = re.sub(r"[^A-Za-z0-9_-]+", "-", evaluation.forecaster).strip("-") or "forecaster"
        taken = sum(name == plain or name.startswith(f"{plain}-no") for name in names)
        names.append(f"{plain}-no{taken + 1}" if taken else plain)
    return names


def evaluate(
    forecasters: Forecaster | Sequence[Forecaster],
    corpus: Corpus,
    *,
    by: Sequence[str] = ("tdbm",),
    spec: WindowSpec | None = None,
    split: str | None = None,
    seed: int = 0,
    modes: int = MODES,
    within_site: bool = True,
    placebo: bool = True,
    progress: Callable[[str, int, int], None] | None = None,
) -> Report:
    """Errors of every forecaster by style and scenario; see `stylesim.evaluation.evaluate` for `by` and what is raised.

    Beside another forecaster, one that is told of each driver's style is evaluated once more with the styles that it is
    told permuted within scenario and context (`evaluation.permuted`): a gain that stays is not from the styles.
    `placebo=False` leaves that out.
    A forecaster that has `training_curve` brings its loss curve into the report. `progress` is called with the
    forecaster's name, the scenes done and their number. InputError if there is none, or two have one name.
    """
    several = list(forecasters) if isinstance(forecasters, Sequence) else [forecasters]
    names = [forecaster.name for forecaster in several]
    if not several:
        raise InputError("there is no forecaster to evaluate")
    if len(set(names)) < len(names):
        raise InputError(f"two forecasters have the same name: {', '.join(names)}")
    view = corpus if split is None else corpus.split(split)
    judged_spec = one_forecaster.common_spec(several, spec or WindowSpec())
    untold = [forecaster.name for forecaster in several if is_untold(forecaster)]
    evaluations: list[Evaluation] = []
    # all get the same questions: what one of them cannot answer, none is asked
    for forecaster in several:
        shown: list[Forecaster] = [forecaster]
        if placebo and len(several) > 1 and is_told(forecaster):
            shown.append(permuted(forecaster, view, spec=judged_spec, seed=seed, beside=several))
        found = [
            one_forecaster.evaluate(
                one,
                view,
                beside=several,
                by=tuple(by),
                spec=spec,
                seed=seed,
                modes=modes,
                within_site=within_site,
                progress=None if progress is None else partial(progress, one.name),
            )
            for one in shown
        ]
        evaluations += [with_placebo_row(*found, against=untold) if len(found) > 1 else found[0], *found[1:]]
    curves = {forecaster.name: getattr(forecaster, "training_curve", ()) for forecaster in several}
    return Report(tuple(evaluations), view, {name: curve for name, curve in curves.items() if curve}, seed)
