"""`stylesim.evaluate`: one or several forecasters on one corpus, and the report of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.evaluation.evaluate import evaluate as evaluate_one
from stylesim.evaluation.results import Evaluation, markdown
from stylesim.forecast import Forecaster
from stylesim.report.figures import Curve
from stylesim.windows import WindowSpec


@dataclass(frozen=True, eq=False)
class Report:
    """The evaluations of several forecasters on one corpus, in the order in which they were given."""

    evaluations: tuple[Evaluation, ...]
    corpora: tuple[Corpus, ...]
    training_curves: Mapping[str, Curve] = field(default_factory=dict)

    def save(self, path: str | Path) -> Path:
        """Write the HTML page to `path`, and JSON, Markdown and Parquet of each evaluation beside it.

        Returns the path of the page. InputError if `path` does not end in .html.
        """
        from stylesim.report.html import build_report

        page = Path(path)
        if page.suffix != ".html":
            raise InputError(f"{page}: a report is an .html file")
        for one in self.evaluations:
            one.save(page.with_name(f"{page.stem}.{one.forecaster}"))
        return build_report(
            page, evaluations=self.evaluations, corpora=self.corpora, training_curves=self.training_curves
        )

    def to_markdown(self) -> str:
        """Every evaluation's tables."""
        return "\n".join(markdown(one) for one in self.evaluations)

    def _repr_markdown_(self) -> str:
        return self.to_markdown()


def evaluate(
    forecasters: Forecaster | Sequence[Forecaster],
    corpus: Corpus,
    *,
    by: tuple[str, ...] = ("tdbm",),
    spec: WindowSpec | None = None,
    seed: int = 0,
    progress: Callable[[str, int, int], None] | None = None,
) -> Report:
    """Errors per driver and per cell of `by` (see `stylesim.evaluation.evaluate`) of one or several forecasters.

    `corpus` may be a view such as `corpus.split("test")`. The first forecaster is the baseline that the others are
    paired with. `progress` is called with (forecaster's name, done, total). InputError as in
    `stylesim.evaluation.evaluate`, or if two forecasters have one name.
    """
    asked = list(forecasters) if isinstance(forecasters, Sequence) else [forecasters]
    names = [one.name for one in asked]
    if len(set(names)) < len(names):
        raise InputError(f"two forecasters have one name: {', '.join(names)}")
    evaluations, curves = [], {}
    for one in asked:

        def tell(done: int, total: int, name: str = one.name) -> None:
            if progress is not None:
                progress(name, done, total)

        evaluations.append(evaluate_one(one, corpus, by=tuple(by), spec=spec, seed=seed, progress=tell))
        curve = getattr(one, "training_curve", None)
        if curve:
            curves[one.name] = curve
    return Report(tuple(evaluations), (corpus,), curves)
