"""`stylesim verify`: is this corpus whole, of its schema, and physically possible?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from stylesim.corpus.corpus import Corpus
from stylesim.corpus.files import inside, sha256_of
from stylesim.corpus.roads import content_hash
from stylesim.errors import CorpusError
from stylesim.plausibility import implausible, overlapping_pairs
from stylesim.scene import Scene
from stylesim.tracks import TrackFlag

OVERLAP_EVERY = 5  # frames; overlaps last longer than 0.5 s, and looking at every frame costs five times as much


@dataclass(frozen=True)
class Verification:
    """What was found. `errors` make the command exit non-zero; `counts` are for information."""

    errors: tuple[str, ...]
    counts: dict[str, int]

    @property
    def ok(self) -> bool:
        """True if nothing is wrong."""
        return not self.errors


def _checksums(corpus: Corpus) -> list[str]:
    errors = []
    known = set(corpus.manifest["files"])
    for name, digest in sorted(corpus.manifest["files"].items()):
        path = inside(corpus.path, name)
        if not path.is_file():
            errors.append(f"{name}: missing")
        elif sha256_of(path) != digest:
            errors.append(f"{name}: sha256 differs from corpus.json")
    for folder in ("tracks", "agents", "signals"):
        extra = {f"{folder}/{p.name}" for p in (corpus.path / folder).glob("*")} - known
        errors += [f"{name}: not listed in corpus.json" for name in sorted(extra)]
    return errors


def _roads(corpus: Corpus) -> list[str]:
    """Roads are named by their content, and the scene table (whose checksum is right) names them."""
    errors = []
    known = {f"{info.road}.json.gz" for info in corpus.info if info.road}
    for name in sorted(known):
        try:
            content = content_hash(inside(corpus.path, f"roads/{name}"))
        except CorpusError as error:
            errors.append(str(error))
            continue
        if content != name.split(".", 1)[0]:
            errors.append(f"roads/{name}: its content is not what its name says")
    extra = {path.name for path in (corpus.path / "roads").glob("*")} - known
    return errors + [f"roads/{name}: no scene names it" for name in sorted(extra)]


def _physics(scene: Scene, counts: Counter[str]) -> list[str]:
    """Contradictions of tracks that are not flagged as implausible are errors; flagged ones are counted."""
    tracks = scene.tracks
    found = implausible(tracks)
    admitted = tracks.flagged(TrackFlag.IMPLAUSIBLE)
    counts["tracks"] += tracks.n_agents
    counts["tracks flagged implausible"] += int(admitted.sum())
    counts["overlapping pairs"] += overlapping_pairs(tracks, every=OVERLAP_EVERY)
    counts["valid agent-frames"] += int(tracks.valid.sum())
    kinds = {"teleports": found.teleport, "velocity against displacement": found.velocity, "slides": found.heading}
    errors = []
    for kind, where in kinds.items():
        for agent in (where.any(axis=1) & ~admitted).nonzero()[0]:
            frame = int(where[agent].argmax())
            errors.append(f"{scene.scene_id}: agent {tracks.agent_id[agent]!r}: {kind} at frame {frame}")
    return errors


def verify(path: str | Path, *, progress: Callable[[int, int], None] | None = None) -> Verification:
    """Check sha256s, schema and physics of every scene. CorpusError only if it is no corpus at all."""
    corpus = Corpus(path)
    errors = _checksums(corpus)
    counts: Counter[str] = Counter()
    try:
        errors += [] if errors else _roads(corpus)
        if errors:
            return Verification(tuple(errors), dict(counts))
        for done, (info, scene) in enumerate(zip(corpus.info, corpus, strict=True), start=1):
            steps = int(scene.tracks.valid.sum())
            if steps != info.n_steps:
                errors.append(f"{info.scene_id}: {steps} agent-frames, the scene table says {info.n_steps}")
            errors += _physics(scene, counts)
            if progress is not None:
                progress(done, len(corpus))
    except (CorpusError, ValueError) as error:
        errors.append(str(error))
    counts["scenes"] = len(corpus)
    return Verification(tuple(errors), dict(counts))
