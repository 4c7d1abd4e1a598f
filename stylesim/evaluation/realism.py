"""`realism`: how far simulated traffic is from recordings, and how far recordings are from each other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.evaluation.realism_compare import SPLITS, both_distances, collision_rate, compared
from stylesim.evaluation.realism_profile import Profile, profile_of
from stylesim.evaluation.realism_quantities import QUANTITIES
from stylesim.evaluation.realism_results import Realism
from stylesim.labelers.reference import default_labeler, scalers_dir
from stylesim.labelers.tdbm import TDBM

DRAWS = 200  # chosen: the ends of an interval then rest on 5 draws each, of blocks of which there are a few dozen
POOLED = "all recordings"


def realism(
    sim: Corpus,
    real: Sequence[Corpus],
    *,
    reference: str = "",
    seed: int = 0,
    draws: int = DRAWS,
    progress: Callable[[str, int, int], None] | None = None,
) -> Realism:
    """Distances between distributions of driving, simulated against recorded, with real against real as the floor.

    Frames of moving motor vehicles count by their time. Blocks (episodes, recordings, or stretches of one recording)
    are resampled for the intervals. Styles are the measured TDBM classes of both sides, by the frozen scaler
    `reference` ("": `real-reference` where it is shipped, else `sim-reference`). `progress`: corpus, scenes done, their
    number.
    InputError without a recording, for one corpus twice, or where nothing moves.
    """
    if not real:
        raise InputError("realism needs at least one recorded corpus to compare with (`stylesim read`)")
    prints = [one.fingerprint for one in (sim, *real)]
    if len(set(prints)) < len(prints):
        raise InputError("the same corpus was given twice; a corpus has no distance to itself")
    judge = _judge(reference)

    def profiled(corpus: Corpus) -> Profile:
        def tell(done: int, total: int) -> None:
            if progress is not None:
                progress(corpus.path.name, done, total)

        return profile_of(corpus, judge, progress=tell)

    simulated, recorded = profiled(sim), [profiled(one) for one in real]
    recorded = _uniquely_named(recorded)
    several = [*recorded, _together(recorded)] if len(recorded) > 1 else recorded
    return Realism(
        sim=simulated.name,
        collisions=collision_rate(simulated),
        comparisons=tuple(compared(simulated, one, seed=seed, draws=draws) for one in several),
        between_recordings=_between(recorded),
        profiles=(simulated, *several),
        about={
            "sim": {"name": sim.path.name, "fingerprint": sim.fingerprint, "seed": sim.manifest.get("seed")},
            "real": [{"name": p.name, "fingerprint": c.fingerprint} for p, c in zip(recorded, real, strict=True)],
            "labeler_sha256": judge.hash_,
            "bootstrap": {"seed": seed, "draws": draws, "splits": SPLITS},
        },
    )


def _judge(reference: str) -> TDBM:
    real = (scalers_dir() / "real-reference.tdbm.json").is_file()
    labeler = default_labeler("tdbm", reference=reference or ("real-reference" if real else "sim-reference"))
    assert isinstance(labeler, TDBM)
    return labeler


def _uniquely_named(profiles: list[Profile]) -> list[Profile]:
    names = [one.name for one in profiles]
    return [
        replace(one, name=f"{one.name} ({i + 1})") if names.count(one.name) > 1 else one
        for i, one in enumerate(profiles)
    ]


def _together(profiles: Sequence[Profile]) -> Profile:
    """All recordings as one profile."""
    return Profile(
        name=POOLED,
        blocks=tuple(f"{one.name}: {block}" for one in profiles for block in one.blocks),
        within_unit=False,
        histogram=np.concatenate([one.histogram for one in profiles]),
        square=np.concatenate([one.square for one in profiles]),
        drivers=np.concatenate([one.drivers for one in profiles]),
        km=np.concatenate([one.km for one in profiles]),
        collisions=np.concatenate([one.collisions for one in profiles]),
    )


def _between(recorded: Sequence[Profile]) -> dict[tuple[str, str], dict[str, float]]:
    """Matched distances between every two recordings; the second's traffic is what the first is weighted to."""
    found = {}
    for i, first in enumerate(recorded):
        for second in recorded[i + 1 :]:
            pair = first.histogram.sum(axis=(0, 1)), second.histogram.sum(axis=(0, 1))
            found[first.name, second.name] = {
                name: both_distances(pair, k, one.width)[1] for k, (name, one) in enumerate(QUANTITIES.items())
            }
    return found
