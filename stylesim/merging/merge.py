"""`merge`: several corpora into one, on one clock, split without leakage, balanced by weights."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.errors import InputError, unknown
from stylesim.merging.balance import ROW, check_balance, equal_shares, label_groups, method_of, require_labels
from stylesim.merging.carry import carried_kinds, carried_labels
from stylesim.merging.clock import COMMON_DT_S
from stylesim.merging.noise_fit import recorded_sources
from stylesim.merging.plan import Plan, keyed, make_plan, planned_scenes
from stylesim.merging.telltale import NoiseTraces, as_stored, telltale, traces
from stylesim.windows import WindowSpec

Progress = Callable[[int, int], None]


def merge(
    corpora: Sequence[Corpus],
    *,
    balance: str = "none",
    split: tuple[float, float, float] = (0.8, 0.1, 0.1),
    seed: int,
    out: str | Path,
    noise: str | None = None,
    spec: WindowSpec | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> Corpus:
    """Merge corpora into a new one at `out`; equal inputs, options and seed give equal bytes.

    One clock of 0.1 s (`clock`). Splits by unit, official ones respected, sources of fewer than three units in
    time blocks with a guard gap of history + future of `spec` (`splits`). `balance`: sampling weights of the
    training split by measured style, context, both, or source (`balance.BALANCES`); nothing is copied.
    `noise="fit"` makes simulated tracks as noisy as the recorded ones of the training split (`noise`); labels of the
    inputs do not hold any more then, so label the result and call `balance`. Without it, labels made by one labeller
    are taken over.

    Scenes that show (nearly) the same driving as an earlier one are left out, and what shows some of it, like a
    counterfactual twin or a replay and its recording, stays on one side of the split (`likeness`, `kin`).

    Raises InputError for no corpus, one given twice, bad shares, missing labels (naming the command to run), noise
    without recorded tracks. Counted: near-duplicates, scenes in guard gaps, agents taken out of a second block,
    labels left behind.
    """
    check_balance(balance)
    inputs = _checked(corpora)
    if noise not in (None, "fit"):
        raise unknown("noise", str(noise), ("fit",))
    changed = noise is not None or any(abs(i.dt_s - COMMON_DT_S) > 1e-6 for corpus in inputs for i in corpus.info)
    kept, left = _labels_to_carry(inputs, balance, changed=changed, noise=noise)
    plan = make_plan(inputs, split=split, seed=seed, noise=noise, spec=spec or WindowSpec())
    weights = _weights(plan, balance)
    said = _said(plan, balance, split, left)
    if plan.noise:
        said["noise_telltale"] = _telltale(plan)
    with CorpusWriter(out, source="merge", configuration=said, seed=seed, resume=resume) as writer:
        for done, (key, scene) in enumerate(planned_scenes(plan), start=1):
            writer.add(scene, split=plan.splits.split[key])
            if progress is not None:
                progress(done, len(plan.new_id))
        merged = writer.finish(counts=_counts(plan), weights=weights)
    for method, span in kept:
        merged.write_labels(carried_labels(inputs, method, span, new_id=plan.new_id, dropped=plan.dropped))
    return merged


def _checked(corpora: Sequence[Corpus]) -> tuple[Corpus, ...]:
    if not corpora:
        raise InputError("there is no corpus to merge; name at least one")
    seen: dict[str, Path] = {}
    for corpus in corpora:
        if corpus.fingerprint in seen:
            raise InputError(f"{corpus.path} is the same corpus as {seen[corpus.fingerprint]}; name it once")
        seen[corpus.fingerprint] = corpus.path
    return tuple(corpora)


def _labels_to_carry(
    inputs: Sequence[Corpus], balance: str, *, changed: bool, noise: str | None
) -> tuple[list[tuple[str, str]], list[str]]:
    kept, left = carried_kinds(inputs, tracks_changed=changed)
    if balance in ("none", "source"):
        return kept, left
    if changed:
        why = "noise" if noise else "resampling"
        raise InputError(
            f"{why} makes the labels of the inputs void: merge with balance none, then `stylesim label` the result and "
            f"`stylesim balance` it by {balance}"
        )
    method = method_of(balance)
    for corpus in inputs:
        require_labels(corpus, method)
    if (method, "track") not in kept:
        raise InputError(f"cannot balance by {balance}: {'; '.join(left)}; label all inputs with the same labeller")
    return kept, left


def _weights(plan: Plan, balance: str) -> dict[ROW, float]:
    if balance == "none":
        return {}
    train = {key for key in plan.new_id if plan.splits.split[key] == "train"}
    group: dict[ROW, str] = {}
    if balance == "source":
        for key, scene in keyed(plan.corpora, train):
            for agent, motor in zip(scene.tracks.agent_id, scene.tracks.is_motor.tolist(), strict=True):
                if motor and agent not in plan.dropped.get(key, {}):
                    group[plan.new_id[key], agent] = scene.source
    else:
        wanted = {plan.new_id[key] for key in train}
        method = method_of(balance)
        for labels in carried_labels(plan.corpora, method, "track", new_id=plan.new_id, dropped=plan.dropped):
            group |= {row: name for row, name in label_groups(labels, balance).items() if row[0] in wanted}
    return equal_shares(group)


def _telltale(plan: Plan) -> dict[str, Any]:
    """How well noise alone tells simulated from recorded training tracks, before and after noise was added."""
    recorded = recorded_sources()
    train = {key for key in plan.new_id if plan.splits.split[key] == "train"}
    sides: dict[str, NoiseTraces] = {}
    for name, added in (("recorded", False), ("before", False), ("after", True)):
        chosen = (
            scene
            for _, scene in planned_scenes(plan, noise=added, only=train)
            if (scene.source in recorded) == (name == "recorded")
        )
        sides[name] = traces(map(as_stored, chosen))
    result: dict[str, Any] = {}
    for name in ("before", "after"):
        try:
            result[name] = telltale(sides[name], sides["recorded"], seed=plan.seed).to_dict()
        except InputError as error:
            result[name] = {"area": None, "why": str(error)}
    return result


def _said(plan: Plan, balance: str, split: tuple[float, float, float], left: list[str]) -> dict[str, Any]:
    return {
        "inputs": [corpus.fingerprint for corpus in plan.corpora],
        "balance": balance,
        "split": list(split),
        "split_rule": plan.splits.rule,
        "noise": [model.to_dict() for model in plan.noise],
        "labels_left_behind": left,
    }


def _counts(plan: Plan) -> dict[str, int]:
    """Agent-steps in = agent-steps out (before any resampling) + those left out, by reason."""
    infos = [((number, info.scene_id), info) for number, corpus in enumerate(plan.corpora) for info in corpus.info]
    return {
        "near_duplicate_scenes": len(plan.kin.duplicate_of),
        "scenes_parted_by_official_splits": len(plan.parted),
        "scenes_in_guard_gaps": len(plan.splits.guarded),
        "tracks_taken_out_of_a_second_block": sum(len(agents) for agents in plan.dropped.values()),
        "scenes_without_an_agent_left": len(plan.splits.split) - len(plan.new_id),
        "steps_in": sum(info.n_steps for _, info in infos),
        "steps_in_near_duplicates": sum(info.n_steps for key, info in infos if key in plan.kin.duplicate_of),
        "steps_parted_by_official_splits": sum(info.n_steps for key, info in infos if key in plan.parted),
        "steps_in_guard_gaps": sum(info.n_steps for key, info in infos if key in plan.splits.guarded),
        "steps_taken_out": sum(sum(agents.values()) for agents in plan.dropped.values()),
    }
