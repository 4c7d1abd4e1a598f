"""Where a fitted labeller comes from, and its hash."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sized
from typing import Any

from stylesim.labelers.base import Progress
from stylesim.scene import Scene


def content_hash(content: Mapping[str, Any]) -> str:
    """sha256 of JSON-able content in its canonical form."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=True)
    return hashlib.sha256(text.encode()).hexdigest()


class Witness:
    """Passes scenes on and notes what they were: sources, scenarios, how many, and the corpus' fingerprint."""

    def __init__(self, scenes: Iterable[Scene], progress: Progress | None = None) -> None:
        self._scenes = scenes
        self._progress = progress
        self._sources: set[str] = set()
        self._scenarios: set[str] = set()
        self._units: set[str] = set()
        self._count = 0

    def __iter__(self) -> Iterator[Scene]:
        """The scenes."""
        total = len(self._scenes) if isinstance(self._scenes, Sized) else 0
        for scene in self._scenes:
            self._sources.add(scene.source)
            self._scenarios.add(scene.scenario)
            self._units.add(scene.unit_id)
            self._count += 1
            yield scene
            if self._progress is not None:
                self._progress(self._count, total)

    def provenance(self) -> dict[str, Any]:
        """What has been seen, JSON-able."""
        return {
            "sources": sorted(self._sources),
            "scenarios": sorted(self._scenarios),
            "units": len(self._units),
            "scenes": self._count,
            "corpus_fingerprint": str(getattr(self._scenes, "fingerprint", "")),
            "corpus_seed": getattr(self._scenes, "manifest", {}).get("seed"),  # a judged corpus must have another
        }
