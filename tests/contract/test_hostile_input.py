"""Hostile input: no reader crashes, hangs, loses a row unsaid, or takes wrong numbers silently."""

import importlib
import shutil
import signal
from collections import Counter
from contextlib import contextmanager

import numpy as np
import pytest

from stylesim.datasets import FORMATS
from stylesim.datasets.accounting import checked
from stylesim.errors import StylesimError
from stylesim.plausibility import MAX_SPEED_MPS, implausible
from stylesim.tracks import TrackFlag
from tests.contract.test_reader import sample
from tests.formats.mutations import mutate_files

QUICK, MANY, REAL = 12, 2000, 100
# Where recorded files of a format are, under the folder of shared data; the smallest are taken, to be quick.
RECORDED = {
    "av2": "av2", "womd": "womd/tfrecord", "gpudrive": "womd/json", "nuplan": "nuplan", "scenarionet": "scenarionet",
    "lyft": "lyft", "dlr_ut": "dlr_ut", "interaction": "interaction", "taf_bw": "taf_bw", "ngsim": "ngsim",
    "smarts": "smarts_i80",
}  # fmt: skip
PATIENCE_S = 30  # a sample takes well under a second: longer is a hang


FARTHEST_M = 40_000.0  # MAX_DISTANCE_M from the middle of all, from which the origin may be as far


class HungError(Exception):
    """A reader did not come back."""


@contextmanager
def patience(seconds):
    def give_up(signum, frame):
        raise HungError

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def hold(name, path):
    """Read; every outcome but a sound corpus or an error in words fails. The outcome."""
    total, steps = Counter(), 0
    try:
        with patience(PATIENCE_S):
            for scene in FORMATS[name].scenes()(path):
                total.update(scene.counts)
                steps += int(scene.tracks.valid.sum())
                _sound(scene.tracks)
    except StylesimError as error:
        told = len(str(error)) > 20 and "TypeCheckError" not in str(error)  # the tests' own type checker: a defect
        return "refused" if told else f"an error without words: {error}"
    checked(total, steps=steps, where=name)
    return "read"


def _sound(tracks):
    there = tracks.valid
    for values in (tracks.position_m, tracks.velocity_mps, tracks.heading_rad):
        assert np.isfinite(values[there]).all()
    assert (tracks.size_m > 0).all()
    assert tracks.size_m.max(initial=0.0) <= 30.0
    assert np.abs(tracks.position_m[there]).max(initial=0.0) <= FARTHEST_M
    flagged = tracks.flagged(TrackFlag.IMPLAUSIBLE)
    assert not (implausible(tracks).agents & ~flagged).any(), "implausible and not flagged"
    with np.errstate(invalid="ignore"):
        assert not ((tracks.speed_mps > MAX_SPEED_MPS).any(axis=1) & ~flagged).any()


def attack(name, tmp_path, n):
    clean = tmp_path / "clean"
    given = sample(name, clean)
    assert hold(name, given) == "read"
    return damage(name, clean, given, tmp_path, n)


def damage(name, clean, given, tmp_path, n, *, values=True):
    files = importlib.import_module(f"tests.formats.{name}_files")
    outcomes = Counter()
    for seed in range(n):
        rng = np.random.default_rng([seed, *name.encode()])
        folder = tmp_path / "damaged"
        shutil.copytree(clean, folder, symlinks=True)
        path = folder / given.relative_to(clean)
        if values and hasattr(files, "mutate") and rng.random() < 0.5:
            what = "values"
            files.mutate(folder, rng)
        else:
            what = mutate_files(folder, rng)
        try:
            outcome = hold(name, path)
        except Exception as error:
            raise AssertionError(f"{name}, seed {seed}: {what}") from error
        assert outcome in ("read", "refused"), (seed, what, outcome)
        outcomes[outcome] += 1
        shutil.rmtree(folder)
    return outcomes


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_a_few_mutations(name, tmp_path):
    assert sum(attack(name, tmp_path, QUICK).values()) == QUICK


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(FORMATS))
def test_many_mutations(name, tmp_path):
    outcomes = attack(name, tmp_path, MANY)
    assert outcomes["refused"] > 0, "nothing was ever refused: the mutations do not bite"
    assert outcomes["read"] > 0


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(RECORDED))
def test_mutations_of_recorded_files(name, tmp_path, shared_data):
    source = shared_data / RECORDED[name]
    if not source.is_dir():
        pytest.skip(f"no recorded files at {source}")
    clean = tmp_path / "clean"
    shutil.copytree(source, clean)
    for path in (clean, *clean.rglob("*")):
        path.chmod(0o755 if path.is_dir() else 0o644)
    outcomes = damage(name, clean, clean, tmp_path, REAL, values=False)
    assert sum(outcomes.values()) == REAL
