"""Driving studies: tracks together with each participant's answers to the MDSI, as in the DISC data set.

DISC itself is not public, so no study's layout is known; a `study.yaml` in the folder says where things are:

    tracks: "drives/*.csv"        # tables below this folder
    table: {columns: {id: id, time: t, x: x, y: y}, unit: metres}     # what their columns mean (see `table_spec`)
    answers: answers.csv          # one row per participant
    participant: participant      # its column of names
    items: "mdsi_{item}"          # its columns of answers, item from 1 to 44; 1 to 6, empty where not answered
    driver: file                  # whose drive a table is: "file" or "folder" (named after the participant), or "id"
    ego: "0"                      # with file or folder: the id of the participant's own vehicle

Participants are flagged EGO and keep their own name as agent id; their answers travel with each scene (see
`stylesim.questionnaire`), where the labeller `mdsi` finds them. All drives of a participant are one unit.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import polars as pl
from jaxtyping import Float64

from stylesim.datasets.cutting import SCENE_S, cut
from stylesim.datasets.recording import Recording
from stylesim.datasets.resampling import on_clock
from stylesim.datasets.sniffing import header
from stylesim.datasets.table import recordings
from stylesim.datasets.table_spec import TableSpec
from stylesim.datasets.tables import csv_table
from stylesim.errors import InputError
from stylesim.questionnaire import N_ITEMS, answer_key, checked_answers
from stylesim.scene import Scene
from stylesim.specs import Spec, load_yaml
from stylesim.tracks import TrackFlag

SOURCE = "study"
SPEC = "study.yaml"
Answers = dict[str, Float64[np.ndarray, " item"]]


class StudySpec(Spec):
    """What `study.yaml` says; see the module."""

    tracks: str
    table: TableSpec
    answers: str
    participant: str = "participant"
    items: str = "mdsi_{item}"
    driver: Literal["file", "folder", "id"] = "file"
    ego: str = "0"


def scenes(path: str | Path, *, scene_s: float = SCENE_S) -> Iterator[Scene]:
    """The scenes of every drive of a study's folder, by file.

    InputError names the file, field, participant or item that is missing or wrong, before any drive is read.
    """
    root = Path(path)
    root = root.parent if root.name == SPEC else root
    spec = load_yaml(StudySpec, root / SPEC)
    spec.table.checked(root / SPEC)
    answers = _answers(_within(root, spec.answers), spec)
    files = _drives(root, spec)
    owners = {file: _owner(file, spec, answers) for file in files}
    for file, owner in owners.items():
        for recording, origin in recordings(file, spec.table):
            name = f"{SOURCE}_{_name(file, root)}"
            unit = name if owner is None else f"{SOURCE}_{owner}"
            renamed = _with_owner(recording, owner, spec, file)
            ids = set(renamed.agent_id)
            known = {who: given for who, given in answers.items() if who in ids}
            unanswered = int(owner is not None and owner not in known)
            drive = replace(
                on_clock(renamed),
                recording_id=name + recording.recording_id.removeprefix("table_").removeprefix(file.stem),
                notes={**renamed.notes, "participants": len(known), "drives_without_answers": unanswered},
            )
            for scene in cut(
                drive, source=SOURCE, scenario=spec.table.site, unit_id=unit, origin_m=origin, scene_s=scene_s
            ):
                yield _answered(scene, known)


def sniff(path: Path) -> bool:
    """True for a folder with a study.yaml, or that file."""
    return (path.is_file() and path.name == SPEC) or (path.is_dir() and (path / SPEC).is_file())


def _within(root: Path, name: str) -> Path:
    """A file of the study; InputError where its name leads out of the folder."""
    file = root / name
    if not file.resolve().is_relative_to(root.resolve()):
        raise InputError(f"{root / SPEC}: {name!r} lies outside of the study's folder")
    return file


def _drives(root: Path, spec: StudySpec) -> list[Path]:
    if Path(spec.tracks).is_absolute() or ".." in Path(spec.tracks).parts:
        raise InputError(f"{root / SPEC}: tracks {spec.tracks!r} lie outside of the study's folder")
    try:
        found = sorted(file for file in root.glob(spec.tracks) if file.is_file())
    except (ValueError, NotImplementedError) as error:
        raise InputError(f"{root / SPEC}: tracks {spec.tracks!r} is no pattern of files ({error})") from error
    files = [_within(root, str(file.relative_to(root))) for file in found]
    if not files:
        raise InputError(f"{root / SPEC}: no file matches tracks {spec.tracks!r}")
    return files


def _answers(file: Path, spec: StudySpec) -> Answers:
    """The answers of each participant."""
    if spec.items.count("{item}") != 1:
        raise InputError(f"{file.parent / SPEC}: items {spec.items!r} must contain {{item}} once")
    columns = [spec.items.replace("{item}", str(i)) for i in range(1, N_ITEMS + 1)]
    padded = [spec.items.replace("{item}", f"{i:02d}") for i in range(1, N_ITEMS + 1)]
    columns = padded if set(padded) <= set(header(file)) else columns
    table = csv_table(file, {spec.participant: pl.String, **dict.fromkeys(columns, pl.String)})
    answers: Answers = {}
    for row in table.iter_rows(named=True):
        who = row[spec.participant]
        if not who:
            raise InputError(f"{file} has a row without a name in the column {spec.participant!r}")
        if who in answers:
            raise InputError(f"{file} has two rows of the participant {who!r}")
        answers[who] = checked_answers(
            np.array([_answer(row[c], who, c, file) for c in columns]), where=f"{file}, participant {who!r}"
        )
    if not answers:
        raise InputError(f"{file} has no participant")
    return answers


def _answer(text: str | None, who: str, column: str, file: Path) -> float:
    if text is None or text.strip().lower() in ("", "na", "nan", "-"):
        return float("nan")
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{file}, participant {who!r}: {column} is {text!r:.40}, no number from 1 to 6") from None


def _owner(file: Path, spec: StudySpec, answers: Answers) -> str | None:
    """The participant whose drive a table is; None where the ids say it. InputError for one without answers."""
    if spec.driver == "id":
        return None
    owner = file.stem if spec.driver == "file" else file.parent.name
    if owner not in answers:
        raise InputError(f"{file}: the participant {owner!r} is not among those who answered ({len(answers)})")
    return owner


def _name(file: Path, root: Path) -> str:
    return "_".join(file.relative_to(root).with_suffix("").parts)[:150]


def _with_owner(recording: Recording, owner: str | None, spec: StudySpec, file: Path) -> Recording:
    """The recording with the participant's own vehicle named after him."""
    if owner is None:
        return recording
    if spec.ego not in recording.agent_id:
        raise InputError(f"{file} has no vehicle {spec.ego!r}, which should be the participant's own (ego)")
    others = {name for name in recording.agent_id if name != spec.ego}
    if owner in others:
        raise InputError(f"{file} has another vehicle with the participant's name {owner!r}")
    return replace(recording, agent_id=tuple(owner if n == spec.ego else n for n in recording.agent_id))


def _answered(scene: Scene, known: Answers) -> Scene:
    """The scene with its participants flagged and their answers."""
    tracks = scene.tracks
    assert tracks.flags is not None
    ego = np.isin(tracks.agent_id, list(known)) if known else np.zeros(tracks.n_agents, bool)
    parameters = {
        answer_key(item, who): float(value)
        for who in sorted(set(tracks.agent_id) & set(known))
        for item, value in enumerate(known[who].tolist(), start=1)
        if not np.isnan(value)
    }
    flags = tracks.flags | np.where(ego, np.int32(TrackFlag.EGO), np.int32(0))
    return replace(scene, tracks=replace(tracks, flags=flags), parameters={**scene.parameters, **parameters})
