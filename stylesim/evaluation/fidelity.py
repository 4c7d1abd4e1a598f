"""`fidelity`: do the drivers of a corpus measure as the styles that they were commanded?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool

from stylesim.corpus import Corpus
from stylesim.evaluation.commanded import UNDETERMINED_REASON, CommandedDrivers, commanded_drivers
from stylesim.evaluation.fidelity_agreement import DRAWS, Agreement, Measured, agreement_of
from stylesim.evaluation.fidelity_agreement import measured_tracks as whole_trips
from stylesim.evaluation.fidelity_agreement import measured_windows as own_windows
from stylesim.evaluation.fidelity_ranges import FeatureRanges, ranges_of
from stylesim.evaluation.fidelity_results import EVERYONE, Fidelity
from stylesim.evaluation.fidelity_robustness import robustness
from stylesim.evaluation.fidelity_targets import HELD_TO_TARGET
from stylesim.evaluation.scaler_guard import check_not_calibrated_on, check_unseen
from stylesim.labelers.context import CONTEXTS
from stylesim.labelers.kdsc import KDSC
from stylesim.labelers.reference import DEFAULT_REFERENCE, default_labeler, scalers_dir
from stylesim.labelers.tdbm import TDBM
from stylesim.labels import StyleLabels
from stylesim.style import STYLE_CLASSES

REFERENCES = (DEFAULT_REFERENCE, "real-reference")  # the second beside it where it is shipped


def fidelity(
    corpus: Corpus,
    *,
    scenarios: Sequence[str] = (),
    with_robustness: bool = True,
    seed: int = 0,
    draws: int = DRAWS,
    progress: Callable[[str, int, int], None] | None = None,
) -> Fidelity:
    """Commanded against measured style of every simulated driver who was on the road for 20 s.

    Only the shipped frozen labellers judge: TDBM (both orientations) and KDSC of `sim-reference`, and of
    `real-reference` where it is shipped; on whole trips (a driver's 11 s windows averaged) and on single windows.
    `scenarios`: only these; () is all. `seed`, `draws`: of the bootstrap of the intervals. `progress` is called with a
    stage, the scenes done and their number. No file is written.

    InputError if the corpus (or its seed) is in a labeller's provenance, its seed in that of the shipped calibrated
    styles, or it holds no driver that can be judged.
    """
    shipped = _shipped()
    for (method, reference), labeler in shipped.items():
        check_unseen(corpus, labeler.provenance_, what=f"{reference} ({method})")
    check_not_calibrated_on(corpus)
    judge = shipped["tdbm", DEFAULT_REFERENCE]
    assert isinstance(judge, TDBM)

    def features(done: int, total: int) -> None:
        if progress is not None:
            progress("measuring", done, total)

    people = commanded_drivers(corpus, judge.options, scenarios=scenarios, progress=features)
    agreements, labels = _agreements(people, shipped, seed=seed, draws=draws)
    variants = (
        robustness(
            corpus, judge, people, reference=DEFAULT_REFERENCE, scenarios=tuple(scenarios), seed=seed, progress=progress
        )
        if with_robustness
        else ()
    )
    departed, excluded = _counted(people, labels)
    return Fidelity(
        agreements=agreements,
        ranges=_ranges(people, judge, labels),
        variants=variants,
        departed=departed,
        excluded=excluded,
        outcomes=_nested(people.outcomes),
        unseen=people.unseen,
        knob=people.knob[people.judged],
        measured_a=labels.aggressiveness.astype(np.float64),
        commanded=tuple(STYLE_CLASSES[place] for place in people.commanded[people.judged].tolist()),
        about=_about(corpus, shipped, scenarios, seed=seed, draws=draws),
    )


def _shipped() -> dict[tuple[str, str], TDBM | KDSC]:
    """The frozen labellers that ship; of those that must be there InputError says so itself."""
    found = {}
    for reference in REFERENCES:
        for method in ("tdbm", "kdsc"):
            if reference == DEFAULT_REFERENCE or (scalers_dir() / f"{reference}.{method}.json").is_file():
                found[method, reference] = default_labeler(method, reference=reference)
    return found


def groups_of(people: CommandedDrivers) -> Iterator[tuple[str, Bool[np.ndarray, " driver"]]]:
    """(name, who) among the judged: everyone, each backend, what is held to the target there, each scenario."""
    who = people.judged
    backend = np.array(people.backend, dtype=object)[who]
    scenario = np.array(people.scenario, dtype=object)[who]
    yield EVERYONE, np.ones(len(backend), bool)
    for name in sorted(set(backend.tolist())):
        own = backend == name
        held = own & np.isin(scenario.astype(str), HELD_TO_TARGET)
        several = sorted(set(scenario[own].tolist()))
        if len(several) > 1:  # else it says the same as its one scenario
            yield f"{name}: all", own
        if len(set(scenario[held].tolist())) > 1 and (held != own).any():
            yield f"{name}: held to the target", held
        for one in several:
            yield f"{name}: {one}", own & (scenario == one)


def borrowed_contexts(labeler: TDBM | KDSC) -> list[str]:
    """The contexts in which a labeller has no drivers of its own, and scales by all of its drivers together."""
    if isinstance(labeler, KDSC):
        return []
    return [name for name, n in zip(CONTEXTS, labeler.track_scaler_.drivers, strict=True) if n == 0]


def _agreements(
    people: CommandedDrivers, shipped: Mapping[tuple[str, str], TDBM | KDSC], *, seed: int, draws: int
) -> tuple[tuple[Agreement, ...], StyleLabels]:
    """Figures of every labeller, orientation, span and group; and the labels of whole trips by the first."""
    who = people.judged
    commanded, knob = people.commanded[who], people.knob[who]
    unit = [u for u, kept in zip(people.unit, who, strict=True) if kept]
    groups = list(groups_of(people))
    result: list[Agreement] = []
    first: StyleLabels | None = None
    for (_, reference), labeler in shipped.items():
        tracks, windows = labeler.judge(people.tracks), labeler.judge(people.windows)
        first = tracks if first is None else first
        found: list[Measured] = []
        for transposed in (False, True) if isinstance(labeler, TDBM) else (False,):
            found.append(whole_trips(tracks, reference=reference, transposed=transposed))
            found.append(own_windows(windows, people.owner, len(unit), reference=reference, transposed=transposed))
        result += [
            agreement_of(name, commanded, knob, unit, one, chosen, seed=seed, draws=draws)
            for one in found
            for name, chosen in groups
        ]
    assert first is not None
    return tuple(result), first


def _ranges(people: CommandedDrivers, judge: TDBM, labels: StyleLabels) -> tuple[FeatureRanges, ...]:
    commanded = people.commanded[people.judged]
    return tuple(ranges_of(name, judge, labels, commanded, chosen) for name, chosen in groups_of(people))


def _counted(people: CommandedDrivers, labels: StyleLabels) -> tuple[dict[str, int], dict[str, dict[str, int]]]:
    """Logged drivers of each style, and those without a verdict by reason."""
    departed = Counter(STYLE_CLASSES[place] for place in people.commanded.tolist())
    reasons: Counter[tuple[str, str]] = Counter()
    row = 0
    for place, reason in zip(people.commanded.tolist(), people.reason, strict=True):
        said = reason
        if not reason:
            said = UNDETERMINED_REASON if labels.class_name(row) == UNDETERMINED_REASON else ""
            row += 1
        if said:
            reasons[STYLE_CLASSES[place], said] += 1
    return {style: departed[style] for style in STYLE_CLASSES}, _nested(reasons)


def _nested(counts: Mapping[tuple[str, str], int]) -> dict[str, dict[str, int]]:
    """Counts by style, then by what."""
    result: dict[str, dict[str, int]] = {style: {} for style in STYLE_CLASSES}
    for (style, what), n in sorted(counts.items()):
        result[style][what] = n
    return result


def _about(
    corpus: Corpus,
    shipped: Mapping[tuple[str, str], TDBM | KDSC],
    scenarios: Sequence[str],
    *,
    seed: int,
    draws: int,
) -> dict[str, Any]:
    configuration = corpus.manifest.get("configuration", {})
    return {
        "corpus": {
            "name": corpus.path.name,
            "fingerprint": corpus.fingerprint,
            "seed": corpus.manifest.get("seed"),
            "styles_sha256": configuration.get("styles_sha256"),
            "population": configuration.get("population"),
        },
        "scenarios": sorted(scenarios) or sorted({info.scenario for info in corpus.info}),
        "bootstrap": {"seed": seed, "draws": draws},
        "labelers": {
            f"{reference}.{method}": {
                "sha256": labeler.hash_,
                "fitted_on": labeler.provenance_,
                "borrowed_contexts": borrowed_contexts(labeler),
            }
            for (method, reference), labeler in shipped.items()
        },
    }
