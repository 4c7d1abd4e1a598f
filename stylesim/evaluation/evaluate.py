"""`evaluate`: hold one forecaster against one corpus, by style and by scenario."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from typing import Any

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.evaluation.asking import STANDING_M, ask
from stylesim.evaluation.intervals import DRAWS, LEVEL, MIN_DRIVERS, MIN_UNITS
from stylesim.evaluation.metrics import MISS_THRESHOLD_M, MODES
from stylesim.evaluation.results import Evaluation
from stylesim.evaluation.slices import all_slices, driver_table
from stylesim.evaluation.strata import check_strata, with_strata
from stylesim.forecast import Forecaster, horizon_s
from stylesim.windows import WindowSpec


def corpus_facts(corpus: Corpus) -> dict[str, Any]:
    """What identifies a corpus in a report: name, fingerprint, scenes per split and source, units, its seed."""
    return {
        "name": corpus.path.name,
        "fingerprint": corpus.fingerprint,
        "scenes": len(corpus),
        "units": len({info.unit_id for info in corpus.info}),
        "splits": dict(sorted(Counter(info.split for info in corpus.info).items())),
        "sources": dict(sorted(Counter(info.source for info in corpus.info).items())),
        "seed": corpus.manifest.get("seed"),
    }


def evaluate(
    forecaster: Forecaster,
    corpus: Corpus,
    *,
    by: tuple[str, ...] = ("tdbm",),
    spec: WindowSpec | None = None,
    split: str | None = None,
    seed: int = 0,
    modes: int = MODES,
    batch: int = 16,
    beside: Sequence[Forecaster] = (),
    within_site: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> Evaluation:
    """Errors of `forecaster` on the windows of `corpus` (or of its `split`), per driver and per cell of `by`.

    `by` holds strata: "tdbm", "kdsc" (class of the whole track), "tdbm:transposed", "history:tdbm" (class of the
    history before t0), "scenario", "source", "kind", "commanded", or a product such as "tdbm*scenario". The
    forecaster sees histories only; labels are joined to its errors afterwards. Standing agents (< 1 m in the future)
    have a cell of their own and are in no other. Drivers that the forecaster, or one of those `beside` it, has no
    forecast for are not asked; a forecaster that looks less far than the future of `spec` makes it shorter, for all of
    them alike (`about` has both lengths). `batch` tasks are given to `predict` at a time. `within_site=False`
    refuses cells of fewer than 3 units altogether. `seed` is of the bootstrap.

    Raises InputError for an unknown stratum, missing labels, an unknown split, a corpus without one window, or an
    answer of the forecaster that is not what was asked.
    """
    asked = spec or WindowSpec()
    spec = common_spec((forecaster, *beside), asked)
    view = corpus if split is None else corpus.split(split)
    if batch < 1:
        raise InputError(f"batch must be 1 or more, not {batch}")
    check_strata(view, tuple(by))
    windows, counts = ask(forecaster, view, spec=spec, modes=modes, batch=batch, beside=beside, progress=progress)
    if windows.is_empty():
        reasons = ", ".join(f"{name}: {count}" for name, count in counts.items() if count)
        raise InputError(f"{corpus.path} has no window of {spec.history_s:g} s + {spec.future_s:g} s ({reasons})")
    windows, provenance = with_strata(windows, view, by)
    return Evaluation(
        forecaster=forecaster.name,
        by=tuple(by),
        slices=all_slices(windows, tuple(by), seed=seed, within_site=within_site),
        drivers=driver_table(windows),
        about=how_asked(corpus_facts(view), spec, provenance, seed=seed, modes=modes)
        | {"asked_future_s": asked.future_s},
        counts=counts,
    )


def common_spec(forecasters: Sequence[Forecaster], spec: WindowSpec) -> WindowSpec:
    """The windows, their future cut to the shortest horizon of the forecasters; InputError if that is no step."""
    shortest = min(forecasters, key=horizon_s)
    reach = horizon_s(shortest)
    if reach >= spec.future_s:
        return spec
    if not reach > 0:
        raise InputError(f"forecaster {shortest.name!r} says that it can look {reach:g} s ahead; that is no forecast")
    return replace(spec, future_s=reach)


def how_asked(
    corpus: Mapping[str, Any], spec: WindowSpec, provenance: Mapping[str, Any], *, seed: int, modes: int
) -> dict[str, Any]:
    """What an evaluation says about itself: the corpus (its facts), windows, intervals, labels, versions."""
    return {
        "corpus": dict(corpus),
        "history_s": spec.history_s,
        "future_s": spec.future_s,
        "stride_s": spec.stride_s,
        "modes": modes,
        "miss_threshold_m": MISS_THRESHOLD_M,
        "standing_m": STANDING_M,
        "intervals": {
            "level": LEVEL,
            "draws": DRAWS,
            "seed": seed,
            "min_drivers": MIN_DRIVERS,
            "min_units": MIN_UNITS,
        },
        "labels": dict(provenance),
        "versions": {name: version(name) for name in ("stylesim", "numpy", "polars")},
    }
