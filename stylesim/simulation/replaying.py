"""`replay`: one generated episode once more, from what corpus.json says, compared with what the corpus holds."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stylesim.corpus import Corpus, SceneInfo
from stylesim.corpus.codec import decode, encode
from stylesim.corpus.files import sha256_of
from stylesim.errors import CorpusError, InputError
from stylesim.population import Population
from stylesim.scenario import Scenario, load_scenario, scenarios
from stylesim.scene import Scene
from stylesim.simulation.plan import EpisodePlan, TwinRequest
from stylesim.simulation.request import SOURCE, configuration
from stylesim.simulation.workers import EpisodeRunner, Job, Task
from stylesim.version import __version__


@dataclass(frozen=True)
class Replay:
    """The episode as it came out now.

    `differences` says where it is not what the corpus holds ("" nowhere: identical to the last stored bit), `changed`
    what of the request is another one now (a simulator's version, a style table, a network), recorded -> now.
    """

    scene: Scene
    differences: tuple[str, ...]
    changed: tuple[str, ...]

    @property
    def identical(self) -> bool:
        """True if tracks, road users, lights and counts are those of the corpus."""
        return not self.differences


def chosen_episode(corpus: Corpus, episode: str) -> SceneInfo:
    """The scene of that id, or of that place in the corpus (0 is the first). InputError if there is none."""
    if episode.isdigit() and not any(info.scene_id == episode for info in corpus.info):
        if int(episode) >= len(corpus):
            raise InputError(f"{corpus.path} has {len(corpus)} episodes, the last is {len(corpus) - 1}; not {episode}")
        return corpus.info[int(episode)]
    wanted = episode or corpus.info[0].scene_id
    known = corpus.scene(wanted).scene_id  # InputError with the nearest name
    return next(info for info in corpus.info if info.scene_id == known)


def replay(
    corpus: Corpus, episode: str, *, scenario: str | None = None, calibration: str | Path | None = None
) -> Replay:
    """Run that episode again and compare it with the corpus.

    `scenario` is the folder of a scenario that is not shipped, `calibration` the file of a population that was
    generated with one. Raises InputError for a corpus that was not generated, an episode that it does not have, or a
    missing folder or file; SimulationError where the simulator refuses.
    """
    if corpus.manifest.get("source") != SOURCE:
        raise InputError(
            f"{corpus.path} was not generated (its source is {corpus.manifest.get('source')!r}); only what `generate` "
            "made can be run again"
        )
    info = chosen_episode(corpus, episode)
    job, task = _job(corpus, info, scenario, calibration)
    runner = EpisodeRunner(job)
    try:
        scenes = {scene.scene_id: scene for scene in runner.scenes(task)}
    finally:
        runner.close()
    changed = _changed(corpus, job)
    stored = corpus.scene(info.scene_id)
    if info.scene_id not in scenes:
        lost = f"{info.scene_id} does not come out; {', '.join(scenes)} do"
        return Replay(next(iter(scenes.values())), (lost,), changed)
    scene = scenes[info.scene_id]
    return Replay(scene, tuple(differences(stored, scene)), changed)


def _job(corpus: Corpus, info: SceneInfo, scenario: str | None, calibration: str | Path | None) -> tuple[Job, Task]:
    try:
        said = corpus.manifest["configuration"]
        names = [item["name"] for item in said["scenarios"]]
        number = names.index(info.scenario)
        population = {**said["population"], "shares": tuple(said["population"]["shares"])}
        plan = EpisodePlan.model_validate(said.get("plan", {}))
        twins = TwinRequest.model_validate(said["twins"]) if said.get("twins") else None
        episode = info.part - number * int(said["episodes"])
        seed = int(corpus.manifest["seed"])
        crowd = Population(**{**population, "calibration": _calibration(population, calibration)})
    except (KeyError, TypeError, ValueError) as error:
        raise CorpusError(f"{corpus.path / 'corpus.json'} does not say how it was generated: {error!r}") from error
    loaded = _scenario(said["scenarios"][number], scenario)
    return Job((loaded,), crowd, seed, corpus.path, plan, twins), Task(info.part, 0, episode)


def _scenario(said: Mapping[str, Any], given: str | None) -> Scenario:
    """The scenario of that name if it says what was recorded; else what was recorded, with that one's folder.

    The first is preferred because corpus.json is sorted: the order of a route's choices, which a draw depends on, is
    not kept there.
    """
    name = str(said["name"])
    if given is None and name not in scenarios():
        raise InputError(f"scenario {name!r} is not shipped; give its folder with --scenario")
    found = load_scenario(given or name)
    if found.name != name:
        raise InputError(f"--scenario {given}: its name is {found.name!r}, the episode's is {name!r}")
    recorded = {key: value for key, value in said.items() if key != "files"}
    if json.loads(json.dumps(found.model_dump(mode="json", exclude={"folder"}))) == recorded:
        return found
    return Scenario.model_validate({**recorded, "folder": found.folder})


def _calibration(population: Mapping[str, Any], given: str | Path | None) -> str:
    wanted = population.get("calibration", "")
    if not wanted:
        return ""
    if given is None:
        raise InputError("the episode's population had a calibration file of its own; give it with --calibration")
    if sha256_of(Path(given)) != wanted:
        raise InputError(f"{given} is not the calibration that the episode was generated with (its sha256 differs)")
    return str(Path(given).absolute())


def _changed(corpus: Corpus, job: Job) -> tuple[str, ...]:
    """What the bytes depend on and is not what it was."""
    said, now = corpus.manifest["configuration"], configuration(job, corpus.manifest["configuration"]["episodes"])
    own = next(item for item in said["scenarios"] if item["name"] == job.scenarios[0].name)
    was = corpus.manifest.get("versions", {}).get("stylesim")
    pairs = {"stylesim": (was, __version__)}
    for kind in ("simulators", "calibrations_sha256"):
        names = now.get(kind, {})
        pairs |= {f"{kind}.{name}": (said.get(kind, {}).get(name), names[name]) for name in names}
    pairs["styles_sha256"] = (said.get("styles_sha256"), now["styles_sha256"])
    files = now["scenarios"][0]["files"]
    pairs |= {
        f"{job.scenarios[0].name}/{name}": (own["files"].get(name), files.get(name))
        for name in {**own["files"], **files}
    }
    return tuple(f"{name}: {before} -> {after}" for name, (before, after) in sorted(pairs.items()) if before != after)


def differences(stored: Scene, scene: Scene) -> list[str]:
    """Where two scenes differ in what a corpus stores: one line per kind of difference."""
    found = []
    one, other = stored.tracks, scene.tracks
    if one.agent_id != other.agent_id:
        missing, more = sorted(set(one.agent_id) - set(other.agent_id)), sorted(set(other.agent_id) - set(one.agent_id))
        found.append(f"road users: {len(missing)} missing {missing[:3]}, {len(more)} more {more[:3]}")
    elif one.driver != other.driver or np.any(one.flags != other.flags):
        found.append("styles or flags of the road users")
    before, after = encode(one), encode(decode(encode(other), other))  # as the corpus would hold them
    rows = {len(column) for column in (*before.values(), *after.values())}
    if len(rows) > 1:
        found.append(f"tracks: {len(before['agent'])} agent-frames in the corpus, {len(after['agent'])} now")
    else:
        unequal = np.flatnonzero(np.any([before[name] != after[name] for name in before], axis=0))
        if len(unequal):
            agent, frame = (index[unequal] for index in np.nonzero(one.valid))  # the rows of `encode`
            first = int(frame.argmin())
            where = f"first {one.agent_id[agent[first]]!r} at frame {frame[first]}"
            found.append(f"tracks: {len(np.unique(agent))} road users differ, {where}")
    lights = [None if s.signals is None else (s.signals.signal_id, s.signals.state.tobytes()) for s in (stored, scene)]
    if lights[0] != lights[1]:
        found.append("lights")
    if dict(stored.counts) != dict(scene.counts):
        found.append("counts")
    return found
