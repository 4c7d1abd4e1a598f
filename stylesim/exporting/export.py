"""`export`: a corpus as a folder of files in somebody else's format, whole or not at all."""

from __future__ import annotations

import importlib
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from stylesim.corpus import Corpus
from stylesim.corpus.files import json_bytes, new_folder, storage_error, write_whole
from stylesim.errors import InputError, unknown
from stylesim.exporting.base import Styles, Writer
from stylesim.merging.clock import COMMON_DT_S, on_common_clock
from stylesim.scene import Scene

RECORD_FILE = "stylesim_export.txt"  # JSON beside the data (some readers take every *.json): what it was made of
COMMANDED = "commanded"  # the simulator's truth, as if it were a labelling method


@dataclass(frozen=True)
class ExportFormat:
    """One format that can be written."""

    name: str
    module: str
    reads: str  # who reads it
    about: str

    def writer(self, folder: Path) -> Writer:
        """A writer into that folder; its module is imported now."""
        return cast("Writer", importlib.import_module(self.module).FormatWriter(folder))


EXPORTS = {
    name: ExportFormat(name, f"stylesim.exporting.{name}", reads, about)
    for name, reads, about in (
        ("av2", "av2, UniTraj", "Argoverse 2 motion forecasting, windows of 11 s"),
        ("scenarionet", "MetaDrive, UniTraj", "a ScenarioNet database"),
        ("womd", "Waymax, trajdata", "Waymo Scenario protos in a TFRecord, windows of 9.1 s"),
        ("gpudrive", "GPUDrive", "GPUDrive JSON, windows of 9.1 s"),
        ("commonroad", "commonroad-io", "CommonRoad XML, version 2020a"),
        ("levelx", "tools for highD's family", "CSV triples as of inD and rounD"),
    )
}


def export(
    format: str,
    corpus: Corpus,
    *,
    out: str | Path,
    labels: Sequence[str] = (),
    split: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, int]:
    """Write the scenes of a corpus (or of its `split`) in that format into the new folder `out`.

    `labels` are labelling methods ("tdbm", "kdsc") whose style of the whole track goes along as extra columns or
    metadata, and "commanded" for the simulator's own. Scenes of other rates are brought to 0.1 s. The counts that are
    returned stand in `stylesim_export.txt` too, with what could not be written and why.

    Raises InputError for an unknown format or split, labels that the corpus lacks, an `out` that exists, or where
    nothing at all could be written.
    """
    if format not in EXPORTS:
        raise unknown("export format", format, EXPORTS)
    view = corpus if split is None else corpus.split(split)
    known = _track_styles(corpus, labels)
    final, partial = new_folder(out)
    shutil.rmtree(partial, ignore_errors=True)
    try:
        partial.mkdir(parents=True)
        writer = EXPORTS[format].writer(partial)
        for done, scene in enumerate(view, start=1):
            writer.counts["scenes_in"] += 1
            writer.counts["scenes_resampled"] += abs(scene.tracks.dt_s - COMMON_DT_S) > 1e-6
            writer.add(on_common_clock(scene), _styles(scene, known, COMMANDED in labels))
            if progress is not None:
                progress(done, len(view))
        writer.finish()
        counts = dict(sorted(writer.counts.items()))
        if not counts.get("written"):
            why = ", ".join(f"{name}: {n}" for name, n in counts.items() if n)
            raise InputError(f"nothing of {corpus.path} could be written as {format} ({why})")
        record: dict[str, Any] = {"format": format, "corpus": corpus.fingerprint, "labels": list(labels)}
        record |= {"sources": sorted({info.source for info in view.info}), "counts": counts}
        write_whole(partial / RECORD_FILE, json_bytes(record))
        partial.rename(final)
        return counts
    except OSError as error:
        raise storage_error(error, Path(error.filename or out)) from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _track_styles(corpus: Corpus, labels: Sequence[str]) -> dict[tuple[str, str], dict[str, str | float]]:
    """The asked columns of every labelled (scene, agent); InputError for labels that are not there."""
    found: dict[tuple[str, str], dict[str, str | float]] = {}
    for method in labels:
        if method == COMMANDED:
            continue
        if not corpus.has_labels(method, "track"):
            raise InputError(
                f"{corpus.path} has no {method} labels; run `stylesim label {corpus.path} --method {method}`"
            )
        made = corpus.labels(method, "track")
        for row, key in enumerate(zip(made.scene_id, made.agent_id, strict=True)):
            columns = found.setdefault(key, {})
            columns[f"{method}_style"] = made.class_name(row)
            columns[f"{method}_aggressiveness"] = float(made.aggressiveness[row])
    return found


def _styles(scene: Scene, known: dict[tuple[str, str], dict[str, str | float]], commanded: bool) -> Styles:
    """The style columns of a scene's agents; those without any are left out."""
    result: dict[str, dict[str, str | float]] = {}
    for agent, driver in zip(scene.tracks.agent_id, scene.tracks.driver, strict=True):
        columns = dict(known.get((scene.scene_id, agent), {}))
        if commanded and driver is not None:
            columns |= {"commanded_style": driver.name, "commanded_aggressiveness": driver.aggressiveness}
        if columns:
            result[agent] = columns
    return result
