"""Writing a corpus: parts that are whole or absent, a folder that gets its name when it is finished."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import polars as pl

from stylesim.corpus.codec import HEADING_RAD, POSITION_M, VELOCITY_MPS
from stylesim.corpus.files import json_bytes, new_folder, sha256_of, storage_error, write_whole
from stylesim.corpus.roads import write_road
from stylesim.corpus.tables import DRIVER_PARAMETERS, SCALES, agents_table, parquet_bytes, signals_table, tracks_table
from stylesim.errors import CorpusError, InputError
from stylesim.scene import Scene
from stylesim.version import __version__

if TYPE_CHECKING:
    from stylesim.corpus.corpus import Corpus

FORMAT = "stylesim-corpus"
SCHEMA_VERSION = 2  # 2 added twin_of, replay_of and metadata to the scenes
PART_STEPS = 250_000  # agent-frames after which a part is closed: memory does not depend on how large scenes are
VERSIONS = {"stylesim": __version__, "polars": pl.__version__}
SCENE_SCHEMA = {
    "scene_id": pl.String, "unit_id": pl.String, "source": pl.String, "scenario": pl.String,
    "source_scenario_id": pl.String, "official_split": pl.String, "split": pl.String, "start_s": pl.Float64,
    "dt_s": pl.Float64, "n_frames": pl.Int32, "n_agents": pl.Int32, "n_steps": pl.Int64, "t0_frame": pl.Int32,
    "part": pl.Int32, "number": pl.Int32, "road": pl.String, "origin_x_m": pl.Float64, "origin_y_m": pl.Float64,
    "counts": pl.String, "parameters": pl.String, "signals": pl.String, "twin_of": pl.String, "replay_of": pl.String,
    "metadata": pl.String,
}  # fmt: skip


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
        return {int(path.stem) for path in self._records()}

    def _records(self) -> list[Path]:
        """The records of the parts that are whole, by number (from 100,000 on, names sort otherwise)."""
        return sorted((self.partial / "records").glob("*.json"), key=lambda path: int(path.stem))

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
        records = [json.loads(p.read_bytes()) for p in self._records()]
        rows = [row for record in records for row in record["scenes"]]
        if not rows:
            raise CorpusError(f"{self.out}: nothing to write, there is no scene")
        twice = [scene_id for scene_id, n in Counter(row["scene_id"] for row in rows).items() if n > 1]
        if twice:
            raise CorpusError(f"{self.out}: scene_id {twice[0]!r} occurs {len(twice)} time(s) too often")
        files = {name: digest for record in records for name, digest in record["files"].items()}
        table = pl.DataFrame(rows, schema=SCENE_SCHEMA, orient="row")
        files["scenes.parquet"] = write_whole(self.partial / "scenes.parquet", parquet_bytes(table))
        for road in sorted({row["road"] for row in rows} - {""}):
            files[f"roads/{road}.json.gz"] = sha256_of(self.partial / "roads" / f"{road}.json.gz")
        if weights:
            ids = sorted(weights)
            weight = pl.DataFrame(
                {"scene_id": [s for s, _ in ids], "agent_id": [a for _, a in ids], "weight": [weights[i] for i in ids]}
            )
            files["weights.parquet"] = write_whole(self.partial / "weights.parquet", parquet_bytes(weight))
        total: Counter[str] = Counter()
        for row in rows:
            total.update(json.loads(row["counts"]))
        self._write_manifest(rows, files, {**total, **(counts or {})})
        write_whole(self.partial / "run.json", json_bytes(dict(run or {})))
        for stray in self.partial.rglob(".*.tmp"):  # left by a writer that was killed
            stray.unlink()
        try:
            self.partial.rename(self.out)
        except OSError as error:
            raise storage_error(error, self.out) from error
        shutil.rmtree(self.out / "records")  # after the rename: a kill in between costs two stray files, not the work
        (self.out / "request.json").unlink()
        return Corpus(self.out)

    def _write_manifest(self, rows: list[dict[str, Any]], files: dict[str, str], counts: Mapping[str, int]) -> None:
        manifest = {
            "format": FORMAT, "schema_version": SCHEMA_VERSION, **self._request, "counts": dict(counts), "files": files,
            "n_scenes": len(rows), "n_agents": sum(row["n_agents"] for row in rows),
            "n_steps": sum(row["n_steps"] for row in rows), "dt_s": sorted({row["dt_s"] for row in rows}),
            "scales": {"position_m": POSITION_M, "velocity_mps": VELOCITY_MPS, "heading_rad": HEADING_RAD},
            "driver_parameters": list(DRIVER_PARAMETERS),
            "versions": VERSIONS,
        }  # fmt: skip
        write_whole(self.partial / "corpus.json", json_bytes(manifest))
