"""`generate_from`: recorded scenes continued with styled drivers, as a corpus."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict
from pathlib import Path

from stylesim.corpus import Corpus, CorpusWriter, SceneInfo
from stylesim.errors import InputError
from stylesim.population import Population
from stylesim.simulation.rollout.route import Lanes
from stylesim.simulation.rollout.scene import SOURCE, continued
from stylesim.simulation.workers import with_driver_counts


def generate_from(
    corpus: Corpus,
    population: Population | str,
    *,
    at_s: float,
    out: str | Path,
    scenes: Iterable[str] | None = None,
    drivers: Iterable[str] | None = None,
    episodes: int = 1,
    seed: int = 0,
    resume: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Corpus:
    """Each of the scenes (all by default) `episodes` times, from `at_s` on driven by people of `population`.

    `drivers` are those handed over; None is every motor vehicle, also those who come later. Everybody else, and
    everybody before `at_s`, is as recorded. `replay_of` pairs each scene with its log; it stays in the log's unit. The
    same arguments give the same bytes.

    Raises InputError before any work for scenes without a road, unknown scenes or drivers, or a moment outside a scene.
    """
    crowd = Population.load(population) if isinstance(population, str) else population
    if episodes < 1 or seed < 0 or not at_s >= 0:
        raise InputError("episodes must be 1 or more, seed 0 or more, and the moment 0 s or later")
    wanted = None if drivers is None else frozenset(drivers)
    infos = _infos(corpus, scenes)
    for info in infos:
        length = info.n_frames * info.dt_s
        if not info.road:
            raise InputError(f"scene {info.scene_id!r} of {corpus.path} has no road; drivers need lanes to go on")
        if at_s >= length - info.dt_s:
            raise InputError(f"scene {info.scene_id!r} lasts {length:g} s; nothing is left from {at_s:g} s on")
    configuration = {
        "from": corpus.fingerprint,
        "scenes": [info.scene_id for info in infos],
        "at_s": at_s,
        "drivers": None if wanted is None else sorted(wanted),
        "episodes": episodes,
        "population": {**asdict(crowd), "shares": list(crowd.shares)},
    }
    keep = {info.scene_id for info in infos}
    with CorpusWriter(out, source=SOURCE, configuration=configuration, seed=seed, resume=resume) as writer:
        done, total = 0, len(infos) * episodes
        for scene in corpus.scenes(lambda info: info.scene_id in keep):
            assert scene.road is not None
            lanes = Lanes(scene.road)
            for episode in range(episodes):
                made = continued(scene, lanes, crowd, at_s=at_s, drivers=wanted, seed=seed, episode=episode)
                writer.add(with_driver_counts(made))
                done += 1
                if progress is not None:
                    progress(done, total)
        return writer.finish()


def _infos(corpus: Corpus, scenes: Iterable[str] | None) -> list[SceneInfo]:
    if scenes is None:
        return list(corpus.info)
    wanted = [corpus.scene(name).scene_id for name in dict.fromkeys(scenes)]  # InputError with the nearest name
    return [info for info in corpus.info if info.scene_id in set(wanted)]
