"""Random streams keyed by what they are for, so that adding one driver does not shift another."""

from __future__ import annotations

import zlib

import numpy as np


def stream(seed: int, episode: int, driver: str | int, purpose: str) -> np.random.Generator:
    """The generator of one (seed, episode, driver, purpose).

    Streams of different keys are independent (`numpy.random.SeedSequence` spawn keys); `driver` is the
    vehicle's id or number, or "" for what belongs to the episode as a whole.
    """
    driver_key = zlib.crc32(str(driver).encode())
    key = (episode, driver_key, zlib.crc32(purpose.encode()))
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(entropy=seed, spawn_key=key)))
