"""Tracks whose values contradict one another are kept and flagged, so that nobody takes them for driving."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stylesim.plausibility import implausible
from stylesim.tracks import TrackFlag, Tracks


def flagged_implausible(tracks: Tracks) -> Tracks:
    """The tracks with IMPLAUSIBLE set for those that jump, slide, or move otherwise than their velocity says."""
    assert tracks.flags is not None
    found = np.where(implausible(tracks).agents, np.int32(TrackFlag.IMPLAUSIBLE), np.int32(0))
    return replace(tracks, flags=tracks.flags | found)
