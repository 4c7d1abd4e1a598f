"""Writing a corpus: parts that are whole or absent, a folder that gets its name when it is finished."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import polars as pl

from stylesim.corpus.codec import HEADING_RAD, POSITION_M, VELOCITY_MPS
from stylesim.corpus.files import json_bytes, new_folder, storage_error, write_whole
from stylesim.corpus.finishing import Sums, brought_together, records_of
from stylesim.corpus.roads import write_road
from stylesim.corpus.tables import DRIVER_PARAMETERS, SCALES, agents_table, parquet_bytes, signals_table, tracks_table
from stylesim.errors import InputError
from stylesim.scene import Scene
from stylesim.version import __version__

if TYPE_CHECKING:
    from stylesim.corpus.corpus import Corpus

FORMAT = "stylesim-corpus"
FOLDERS = ("tracks", "agents", "signals", "roads")
# 2 added twin_of, replay_of and metadata to the scenes; 3 lists no roads, whose names are the hashes of their content.
SCHEMA_VERSION = 3
PART_STEPS = 250_000  # agent-frames after which a part is closed: memory does not depend on how large scenes are
VERSIONS = {"stylesim": __version__, "polars": pl.__version__}


def _scene_row(scene: Scene, split: str, part: int, number: int, road: str) -> dict[str, Any]:
    tracks, lights = scene.tracks, scene.signals
    signals = "" if lights is None else json.dumps({"signal_id": lights.signal_id, "lane_id": lights.lane_id})
    return {
        "scene_id": scene.scene_id, "unit_id": scene.unit_id, "source": scene.source, "scenario": scene.scenario,
        "source_scenario_id": scene.source_scenario_id or scene.scene_id, "official_split": scene.official_split,
        "split": split, "start_s": scene.start_s, "dt_s": tracks.dt_s, "n_frames": tracks.n_frames,
        "n_agents": tracks.n_agents, "n_steps": int(tracks.valid.sum()), "t0_frame": scene.t0_frame, "part": part,
        "number": number, "road": road, "origin_x_m": float(tracks.origin_m[0]),
        "origin_y_m": float(tracks.origin_m[1]), "counts": json.dumps(dict(scene.counts), sort_keys=True),
        "parameters": json.dumps(dict(scene.parameters), sort_keys=True), "signals": signals,
        "twin_of": scene.twin_of, "replay_of": scene.replay_of,
        "metadata": json.dumps(dict(scene.metadata), sort_keys=True),
    }  # fmt: skip


def write_part(partial: Path, part: int, scenes: Sequence[Scene], splits: Sequence[str] = ()) -> None:
    """Write one part (tracks, agents, lights, roads) and, last of all, the record that says it is whole."""
    name = f"part-{part:05d}.parquet"
    rows = []
    for number, scene in enumerate(scenes):
        road = "" if scene.road is None else write_road(partial / "roads", scene.road)
        rows.append(_scene_row(scene, splits[number] if splits else "", part, number, road))
    files = {
        f"{kind}/{name}": write_whole(partial / kind / name, parquet_bytes(table(scenes), about))
        for kind, table, about in (
            ("tracks", tracks_table, SCALES),
            ("agents", agents_table, None),
            ("signals", signals_table, None),
        )
    }
    write_whole(partial / "records" / f"{part:05d}.json", json_bytes({"scenes": rows, "files": files}))


class CorpusWriter:
    """Builds `out.partial` and gives it the name `out` when finished; a context manager.

    After an error or a kill the finished parts stay, and the same request with `resume=True` goes on from them.
    InputError if `out` exists, or a partial folder is there without `resume`, or from another request.
    """

    def __init__(
        self,
        out: str | Path,
        *,
        source: str,
        configuration: Mapping[str, Any],
        seed: int | None = None,
        resume: bool = False,
        part_scenes: int = 32,
    ) -> None:
        self.out, self.partial = new_folder(out)
        self._part_scenes = part_scenes
        self._pending: list[tuple[Scene, str]] = []
        self._part = 0  # the number of the part that is being filled
        self._filled = self._steps = 0  # scenes and agent-frames in it
        self._request = {"source": source, "seed": seed, "configuration": dict(configuration)}
        request = json_bytes({**self._request, "versions": VERSIONS})  # parts of another version do not mix
        marker = self.partial / "request.json"
        if self.partial.exists():
            if not resume:
                raise InputError(f"{self.partial} is left from an unfinished run; add --resume to go on, or remove it")
            if not marker.is_file() or marker.read_bytes() != request:
                raise InputError(f"{self.partial} was begun with other settings; remove it, or repeat those settings")
        else:
            write_whole(marker, request)
        self._done = self.done_parts()

    def __enter__(self) -> CorpusWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        """After an error, keep what is worth keeping (see `leave`)."""
        if kind is not None:
            self.leave()

    def leave(self) -> bool:
        """Give up for now: True if finished parts are kept for `resume`; without one, nothing is left on the disk."""
        kept = bool(self.done_parts())
        if not kept and not self.out.exists():
            shutil.rmtree(self.partial, ignore_errors=True)
        return kept

    def done_parts(self) -> set[int]:
        """Numbers of the parts that are whole."""
        return {int(path.stem) for path in records_of(self.partial)}

    def add(self, scene: Scene, *, split: str = "") -> None:
        """Append a scene; a part holds `part_scenes` scenes, or fewer that are large.

        Parts from a resumed run are not rewritten.
        """
        if self._part not in self._done:
            self._pending.append((scene, split))
        self._filled += 1
        self._steps += int(scene.tracks.valid.sum())
        if self._filled == self._part_scenes or self._steps >= PART_STEPS:
            self._flush()

    def _flush(self) -> None:
        if self._pending:
            write_part(self.partial, self._part, [s for s, _ in self._pending], [split for _, split in self._pending])
        self._pending, self._filled, self._steps = [], 0, 0
        self._part += 1

    def finish(
        self,
        *,
        counts: Mapping[str, int] | None = None,
        weights: Mapping[tuple[str, str], float] | None = None,
        run: Mapping[str, Any] | None = None,
    ) -> Corpus:
        """Write the scene table and `corpus.json`, and give the folder its name. CorpusError if no scene was added."""
        from stylesim.corpus.corpus import Corpus

        self._flush()
        sums = brought_together(self.partial, records_of(self.partial))
        if weights:
            ids = sorted(weights)
            weight = pl.DataFrame(
                {"scene_id": [s for s, _ in ids], "agent_id": [a for _, a in ids], "weight": [weights[i] for i in ids]}
            )
            sums.files["weights.parquet"] = write_whole(self.partial / "weights.parquet", parquet_bytes(weight))
        self._write_manifest(sums, {**sums.counts, **(counts or {})})
        write_whole(self.partial / "run.json", json_bytes(dict(run or {})))
        for folder in (self.partial, *(self.partial / name for name in FOLDERS)):
            _remove_strays(folder)
        try:
            self.partial.rename(self.out)
        except OSError as error:
            raise storage_error(error, self.out) from error
        shutil.rmtree(self.out / "records")  # after the rename: a kill in between costs two stray files, not the work
        (self.out / "request.json").unlink()
        return Corpus(self.out)

    def _write_manifest(self, sums: Sums, counts: Mapping[str, int]) -> None:
        manifest = {
            "format": FORMAT, "schema_version": SCHEMA_VERSION, **self._request, "counts": dict(counts),
            "files": sums.files, "n_scenes": sums.n_scenes, "n_agents": sums.n_agents, "n_steps": sums.n_steps,
            "dt_s": sorted(sums.dt_s),
            "scales": {"position_m": POSITION_M, "velocity_mps": VELOCITY_MPS, "heading_rad": HEADING_RAD},
            "driver_parameters": list(DRIVER_PARAMETERS),
            "versions": VERSIONS,
        }  # fmt: skip
        write_whole(self.partial / "corpus.json", json_bytes(manifest))


def _remove_strays(folder: Path) -> None:
    """Remove what a writer that was killed left; entry by entry, for a folder may hold millions."""
    if not folder.is_dir():
        return
    with os.scandir(folder) as entries:
        strays = [Path(entry.path) for entry in entries if entry.name.startswith(".")]
    for stray in strays:
        if stray.name.endswith(".tmp"):
            stray.unlink()
        elif stray.name.endswith(".parts"):
            shutil.rmtree(stray)
