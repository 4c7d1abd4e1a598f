"""`Corpus`: a folder of scenes, cheap to hold, lazy to read."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

from stylesim.corpus.files import inside
from stylesim.corpus.finishing import SCENE_SCHEMA
from stylesim.corpus.label_store import has_labels, read_labels, write_labels
from stylesim.corpus.roads import read_road
from stylesim.corpus.tables import part_tables, read_parquet, tracks_and_signals
from stylesim.corpus.weight_store import read_weights, write_weights
from stylesim.corpus.writer import FORMAT, SCHEMA_VERSION
from stylesim.errors import CorpusError, InputError, nearest
from stylesim.labels import StyleLabels
from stylesim.road import Road
from stylesim.scene import Scene


@dataclass(frozen=True)
class SceneInfo:
    """What is known of a scene without reading its tracks."""

    scene_id: str
    unit_id: str
    source: str
    scenario: str
    source_scenario_id: str
    official_split: str
    split: str  # "train", "val", "test", or "" before a merge
    start_s: float
    dt_s: float
    n_frames: int
    n_agents: int
    n_steps: int  # valid agent-frames
    t0_frame: int | None
    part: int
    number: int  # within the part
    road: str
    counts: Mapping[str, int]
    parameters: Mapping[str, float]
    row: Mapping[str, Any]
    twin_of: str = ""  # scene_id of the episode that it is a counterfactual of
    replay_of: str = ""  # scene_id of the recorded scene that it was started from
    metadata: Mapping[str, Any] = field(default_factory=dict)


SINCE_2 = {"twin_of": "", "replay_of": "", "metadata": "{}"}  # what scenes of schema version 1 do not say


def _info(row: dict[str, Any]) -> SceneInfo:
    plain = {f.name: row[f.name] for f in fields(SceneInfo) if f.name in row}
    plain |= {name: json.loads(row[name]) for name in ("counts", "parameters", "metadata")}
    return SceneInfo(**plain, row=row)


def _manifest(path: Path) -> tuple[dict[str, Any], str]:
    file = path / "corpus.json"
    try:
        raw = file.read_bytes()
    except (OSError, ValueError) as error:
        if not isinstance(error, FileNotFoundError | NotADirectoryError):
            raise CorpusError(f"cannot read {file}: {error}") from None
        unfinished = path.with_name(path.name + ".partial")
        hint = f"; {unfinished} is unfinished: repeat its command with --resume" if unfinished.is_dir() else ""
        raise CorpusError(f"{path} is no corpus: it has no corpus.json{hint}") from None
    try:
        manifest = json.loads(raw)
        kind, version = manifest["format"], int(manifest["schema_version"])
    except (ValueError, KeyError, TypeError) as error:
        raise CorpusError(f"{file} is damaged: {error}") from error
    if kind != FORMAT:
        raise CorpusError(f"{file} is no corpus of stylesim (format {kind!r})")
    if version > SCHEMA_VERSION:
        raise CorpusError(
            f"{path} has schema version {version}; this stylesim reads up to {SCHEMA_VERSION}: install a newer one"
        )
    for name, kind_of in (("files", dict), ("counts", dict), ("n_scenes", int), ("n_agents", int), ("n_steps", int)):
        if not isinstance(manifest.get(name), kind_of):
            raise CorpusError(f"{file} is damaged: {name!r} is missing, or no {kind_of.__name__}")
    return manifest, hashlib.sha256(raw).hexdigest()


class Corpus:
    """A finished corpus, or a view of some of its scenes. CorpusError if it is missing, damaged or newer."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.manifest, self.fingerprint = _manifest(self.path)
        self._chosen: tuple[SceneInfo, ...] | None = None
        self._road: tuple[str, Road] | None = None

    @cached_property
    def info(self) -> tuple[SceneInfo, ...]:
        """Every scene of this view, in the order of the corpus."""
        if self._chosen is not None:
            return self._chosen
        table = read_parquet(self.path / "scenes.parquet")
        older = SINCE_2 if int(self.manifest["schema_version"]) < 2 else {}
        missing = set(SCENE_SCHEMA) - set(table.columns) - set(older)
        if missing:
            raise CorpusError(f"{self.path / 'scenes.parquet'} lacks the column(s) {', '.join(sorted(missing))}")
        return tuple(_info(older | row) for row in table.iter_rows(named=True))

    def __len__(self) -> int:
        """Number of scenes."""
        whole = self._chosen is None and "info" not in self.__dict__  # else an object for each scene would be made
        return int(self.manifest["n_scenes"]) if whole else len(self.info)

    def __iter__(self) -> Iterator[Scene]:
        return self.scenes()

    def __repr__(self) -> str:
        return f"Corpus({str(self.path)!r}, {len(self)} scenes)"

    def with_info(self, info: Iterable[SceneInfo]) -> Corpus:
        """A view of the chosen scenes."""
        view = Corpus.__new__(Corpus)
        view.path, view.manifest, view.fingerprint = self.path, self.manifest, self.fingerprint
        view._chosen, view._road = tuple(info), None
        return view

    def split(self, name: str) -> Corpus:
        """The scenes of that split. InputError if the corpus has none of that name."""
        chosen = [info for info in self.info if info.split == name]
        if not chosen:
            have = sorted({info.split for info in self.info} - {""})
            hint = f"it has {', '.join(have)}" if have else "it has no splits: make them with `stylesim merge`"
            raise InputError(f"{self.path} has no split {name!r}; {hint}")
        return self.with_info(chosen)

    def scenes(self, keep: Callable[[SceneInfo], bool] | None = None) -> Iterator[Scene]:
        """The scenes one by one, in order; only the tables of one part are in memory."""
        part, tables = -1, None
        for info in self.info:
            if keep is not None and not keep(info):
                continue
            if tables is None or info.part != part:
                part, tables = info.part, part_tables(self.path, info.part)
            yield self._scene(info, tables)

    def scene(self, scene_id: str) -> Scene:
        """The scene of that id. InputError if there is none."""
        for info in self.info:
            if info.scene_id == scene_id:
                return self._scene(info, part_tables(self.path, info.part))
        guess = nearest(scene_id, [info.scene_id for info in self.info])
        raise InputError(f"{self.path} has no scene {scene_id!r}" + (f"; did you mean {guess!r}?" if guess else ""))

    def _scene(self, info: SceneInfo, tables: Any) -> Scene:
        tracks, signals = tracks_and_signals(info.row, info.number, tables)
        road = None
        if info.road:
            if self._road is None or self._road[0] != info.road:
                self._road = (info.road, read_road(inside(self.path, f"roads/{info.road}.json.gz")))
            road = self._road[1]
        return Scene(
            scene_id=info.scene_id, unit_id=info.unit_id, source=info.source, scenario=info.scenario, tracks=tracks,
            road=road, signals=signals, start_s=info.start_s, source_scenario_id=info.source_scenario_id,
            official_split=info.official_split, t0_frame=info.t0_frame, counts=info.counts, parameters=info.parameters,
            twin_of=info.twin_of, replay_of=info.replay_of, metadata=info.metadata,
        )  # fmt: skip

    def has_labels(self, method: str, span: str) -> bool:
        """True if labels of that method and span lie beside the corpus."""
        return has_labels(self.path, method, span)

    def labels(self, method: str, span: str) -> StyleLabels:
        """The labels of this view's scenes. InputError if they have not been made."""
        chosen = None if self._chosen is None else {info.scene_id for info in self._chosen}
        return read_labels(self.path, method, span, chosen)

    def write_labels(self, chunks: Iterable[StyleLabels]) -> None:
        """Write labels as new files beside the corpus, one for each method and span among the chunks; streams."""
        write_labels(
            self.path, chunks, {info.scene_id: info.source_scenario_id for info in self.info}, self.fingerprint
        )

    def weights(self) -> dict[tuple[str, str], float]:
        """Sampling weight of each (scene_id, agent_id); empty if the corpus has none."""
        return read_weights(self.path, self.manifest)

    def write_weights(self, weights: Mapping[tuple[str, str], float], *, by: str) -> None:
        """Write sampling weights as a new file beside the corpus; they take the place of those made with it."""
        write_weights(self.path, weights, by=by, fingerprint=self.fingerprint)
